//! Products of a few rows with a matrix, and sums of outer products: the kernels of sparse convolutions.
//!
//! Plain loops over arrays that fit into registers; they run inside [`pulp::Arch::dispatch`], which compiles them for
//! several instruction sets.

use super::block::Pairs;
use crate::nn::scalar::Scalar;
use pulp::{Arch, Simd, WithSimd};

/// Rows that share the loads of a matrix.
const ROWS: usize = 6;
/// Rows whose outer products are added together.
const TOGETHER: usize = 4;
/// Columns of a tile.
const WIDE: usize = 16;
const NARROW: usize = 8;

/// A row-major matrix.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix<'a, T> {
    pub(crate) values: &'a [T],
    pub(crate) columns: usize,
}

impl<T> Matrix<'_, T> {
    #[inline(always)]
    fn row(&self, row: usize) -> &[T] {
        &self.values[row * self.columns..][..self.columns]
    }

    #[inline(always)]
    fn from(&self, first: usize) -> Tile<'_, T> {
        Tile { values: self.values, columns: self.columns, first }
    }
}

/// Some columns of a row-major matrix.
#[derive(Clone, Copy, Debug)]
struct Tile<'a, T> {
    values: &'a [T],
    columns: usize,
    first: usize,
}

impl<'a> Pairs<'a> {
    /// Groups of `N` pairs, and the remaining pairs.
    #[inline(always)]
    fn grouped<const N: usize>(self) -> (impl Iterator<Item = Self>, Self) {
        let whole = self.outputs.len() / N * N;
        let pairs = |(outputs, inputs): (&'a [u8], &'a [u32])| Self { outputs, inputs };
        let groups = self.outputs[..whole].chunks_exact(N).zip(self.inputs[..whole].chunks_exact(N));
        (groups.map(pairs), Self { outputs: &self.outputs[whole..], inputs: &self.inputs[whole..] })
    }
}

/// Adds to row `output` of `out` the product of row `input` of `x` with `weights`, for each pair. `out` has as many columns
/// as `weights`.
#[inline(always)]
pub(crate) fn add_products<T: Scalar>(pairs: Pairs<'_>, x: Matrix<'_, T>, weights: Matrix<'_, T>, out: &mut [T]) {
    let (columns, (groups, rest)) = (weights.columns, pairs.grouped::<ROWS>());
    for group in groups {
        in_tiles(columns, Products::<T, ROWS> { pairs: group, x, weights, out });
    }
    match rest.outputs.len() {
        0 => {}
        1 => in_tiles(columns, Products::<T, 1> { pairs: rest, x, weights, out }),
        2 => in_tiles(columns, Products::<T, 2> { pairs: rest, x, weights, out }),
        3 => in_tiles(columns, Products::<T, 3> { pairs: rest, x, weights, out }),
        4 => in_tiles(columns, Products::<T, 4> { pairs: rest, x, weights, out }),
        _ => in_tiles(columns, Products::<T, 5> { pairs: rest, x, weights, out }),
    }
}

/// Work on some columns of a matrix at once.
trait Tiled {
    /// Works on `L` columns from the first one on.
    fn tile<const L: usize>(&mut self, first: usize);
}

/// All columns, in tiles that fit into registers.
#[inline(always)]
fn in_tiles(columns: usize, mut work: impl Tiled) {
    let mut first = 0;
    while columns - first >= WIDE {
        work.tile::<WIDE>(first);
        first += WIDE;
    }
    if columns - first >= NARROW {
        work.tile::<NARROW>(first);
        first += NARROW;
    }
    while first < columns {
        work.tile::<1>(first);
        first += 1;
    }
}

/// Products of `R` rows.
struct Products<'a, T, const R: usize> {
    pairs: Pairs<'a>,
    x: Matrix<'a, T>,
    weights: Matrix<'a, T>,
    out: &'a mut [T],
}

impl<T: Scalar, const R: usize> Tiled for Products<'_, T, R> {
    #[inline(always)]
    fn tile<const L: usize>(&mut self, first: usize) {
        products::<T, R, L>(self.pairs, self.x, self.weights.from(first), self.out);
    }
}

/// One tile of `R` rows and `L` columns.
#[inline(always)]
fn products<T: Scalar, const R: usize, const L: usize>(
    pairs: Pairs<'_>,
    x: Matrix<'_, T>,
    weights: Tile<'_, T>,
    out: &mut [T],
) {
    let rows: [&[T]; R] = std::array::from_fn(|r| x.row(pairs.inputs[r] as usize));
    let place = |r: usize| usize::from(pairs.outputs[r]) * weights.columns + weights.first;
    let mut sums = [[T::ZERO; L]; R];
    for r in 0..R {
        sums[r].copy_from_slice(&out[place(r)..][..L]);
    }
    let mut tile = [T::ZERO; L];
    // Whole rows of the weights: their places need no product, which would be checked.
    for (c, own) in weights.values.chunks_exact(weights.columns).enumerate().take(x.columns) {
        tile.copy_from_slice(&own[weights.first..][..L]);
        for (row, sum) in rows.iter().zip(&mut sums) {
            for l in 0..L {
                sum[l] = row[c].mul_add(tile[l], sum[l]);
            }
        }
    }
    for r in 0..R {
        out[place(r)..][..L].copy_from_slice(&sums[r]);
    }
}

/// Adds to `sum` (columns of `x` by columns of `y`, row-major) the outer products of row `input` of `x` and row `output` of
/// `y`, for all pairs.
#[inline(always)]
pub(crate) fn add_outer_products<T: Scalar>(pairs: Pairs<'_>, x: Matrix<'_, T>, y: Matrix<'_, T>, sum: &mut [T]) {
    let (columns, (groups, rest)) = (y.columns, pairs.grouped::<TOGETHER>());
    for group in groups {
        in_tiles(columns, OuterProducts::<T, TOGETHER> { pairs: group, x, y, sum });
    }
    match rest.outputs.len() {
        0 => {}
        1 => in_tiles(columns, OuterProducts::<T, 1> { pairs: rest, x, y, sum }),
        2 => in_tiles(columns, OuterProducts::<T, 2> { pairs: rest, x, y, sum }),
        _ => in_tiles(columns, OuterProducts::<T, 3> { pairs: rest, x, y, sum }),
    }
}

/// Outer products of `P` pairs.
struct OuterProducts<'a, T, const P: usize> {
    pairs: Pairs<'a>,
    x: Matrix<'a, T>,
    y: Matrix<'a, T>,
    sum: &'a mut [T],
}

impl<T: Scalar, const P: usize> Tiled for OuterProducts<'_, T, P> {
    #[inline(always)]
    fn tile<const L: usize>(&mut self, first: usize) {
        outer_products::<T, P, L>(self.pairs, self.x, self.y.from(first), self.sum);
    }
}

/// The outer products of `P` pairs in `L` columns.
#[inline(always)]
fn outer_products<T: Scalar, const P: usize, const L: usize>(
    pairs: Pairs<'_>,
    x: Matrix<'_, T>,
    y: Tile<'_, T>,
    sum: &mut [T],
) {
    let rows: [&[T]; P] = std::array::from_fn(|p| x.row(pairs.inputs[p] as usize));
    let mut right = [[T::ZERO; L]; P];
    for (own, &output) in right.iter_mut().zip(pairs.outputs) {
        own.copy_from_slice(&y.values[usize::from(output) * y.columns + y.first..][..L]);
    }
    let mut total = [T::ZERO; L];
    for (c, own) in sum.chunks_exact_mut(y.columns).enumerate().take(x.columns) {
        let place = &mut own[y.first..][..L];
        total.copy_from_slice(place);
        for p in 0..P {
            let value = rows[p][c];
            for l in 0..L {
                total[l] = value.mul_add(right[p][l], total[l]);
            }
        }
        place.copy_from_slice(&total);
    }
}

/// Numbers of the rows of a block.
const PLACES: [u8; 256] = {
    let mut places = [0; 256];
    let mut i = 0;
    while i < 256 {
        places[i] = i as u8;
        i += 1;
    }
    places
};

/// Adds x·W to `out`, row by row.
pub(crate) fn add_products_of_rows<T: Scalar>(x: Matrix<'_, T>, weights: Matrix<'_, T>, out: &mut [T]) {
    Arch::new().dispatch(Rows { x, weights, out });
}

struct Rows<'a, T> {
    x: Matrix<'a, T>,
    weights: Matrix<'a, T>,
    out: &'a mut [T],
}

impl<T: Scalar> WithSimd for Rows<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let inputs: [u32; 256] = PLACES.map(u32::from);
        let Self { x, weights, out } = self;
        for (values, out) in x.values.chunks(256 * x.columns).zip(out.chunks_mut(256 * weights.columns)) {
            let rows = values.len() / x.columns;
            let pairs = Pairs { outputs: &PLACES[..rows], inputs: &inputs[..rows] };
            add_products(pairs, Matrix { values, columns: x.columns }, weights, out);
        }
    }
}

/// Adds xᵀ·y to `sum`.
pub(crate) fn add_outer_products_of_rows<T: Scalar>(x: Matrix<'_, T>, y: Matrix<'_, T>, sum: &mut [T]) {
    Arch::new().dispatch(OuterRows { x, y, sum });
}

struct OuterRows<'a, T> {
    x: Matrix<'a, T>,
    y: Matrix<'a, T>,
    sum: &'a mut [T],
}

impl<T: Scalar> WithSimd for OuterRows<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let inputs: [u32; 256] = PLACES.map(u32::from);
        let Self { x, y, sum } = self;
        for (values, own) in x.values.chunks(256 * x.columns).zip(y.values.chunks(256 * y.columns)) {
            let rows = values.len() / x.columns;
            let pairs = Pairs { outputs: &PLACES[..rows], inputs: &inputs[..rows] };
            let y = Matrix { values: own, columns: y.columns };
            add_outer_products(pairs, Matrix { values, columns: x.columns }, y, sum);
        }
    }
}
