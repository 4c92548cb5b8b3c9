//! The surface of the highest points: a plane through those of the cells around each cell.

use crate::error::Result;
use crate::parallel::{Monitor, concat_watched, map_ordered};
use crate::voxels::cells::index::{Walk, block_of};
use pulp::{Arch, Simd, WithSimd};
use std::array;
use std::ops::Range;

/// Cells of a block.
const BLOCK: usize = 4096;

/// Cells on each side of the widest window.
const SIDE: usize = 2;

/// Cells of the widest window.
const WINDOW: usize = (2 * SIDE + 1) * (2 * SIDE + 1);

/// Cells whose windows are fitted together, one SIMD lane a cell.
const LANES: usize = 8;

/// One number per cell.
type Lane<T> = [T; LANES];

/// The surface around a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Surface {
    /// In the window of 3 x 3 cells.
    pub(super) of3: Window,
    /// In the window of 5 x 5 cells.
    pub(super) of5: Window,
    /// The least roughness of the 3 x 3 windows around these 3 x 3 cells.
    pub(super) least: f32,
    /// Share of the 5 x 5 cells that hold points.
    pub(super) cover: f32,
}

/// Heights in a window of cells.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Window {
    pub(super) highest: f32,
    pub(super) lowest: f32,
    /// Root mean square distance in height of the highest points from their plane.
    pub(super) roughness: f32,
    /// Slope of that plane, rise over run.
    pub(super) slope: f32,
    /// Mean of the highest points.
    pub(super) mean: f32,
}

/// The surface around each cell. `keys` ascend; `ends` are the lowest and the highest point of each cell. The same bytes
/// with and without vector instructions.
pub(super) fn surfaces(keys: &[[i32; 2]], ends: &[[f32; 2]], size: f64, monitor: &Monitor) -> Result<Vec<Surface>> {
    let blocks = keys.len().div_ceil(BLOCK);
    let parts = map_ordered(blocks, monitor, |b| {
        Ok(Arch::new().dispatch(Block { keys, ends, size, cells: block_of(b, BLOCK, keys.len()) }))
    })?;
    let mut surfaces = concat_watched(parts, monitor)?;
    let least = map_ordered(blocks, monitor, |b| {
        let range = block_of(b, BLOCK, keys.len());
        let mut walk = Walk::<1>::new(keys, range.start);
        let least = |c: usize| {
            let mut least = f32::INFINITY;
            walk.around(c, |near, _| least = least.min(surfaces[near].of3.roughness));
            least
        };
        Ok(range.map(least).collect::<Vec<f32>>())
    })?;
    surfaces.iter_mut().zip(least.into_iter().flatten()).for_each(|(surface, least)| surface.least = least);
    Ok(surfaces)
}

/// Cells whose surfaces are computed, compiled for each instruction set.
struct Block<'a> {
    keys: &'a [[i32; 2]],
    ends: &'a [[f32; 2]],
    size: f64,
    cells: Range<usize>,
}

impl WithSimd for Block<'_> {
    type Output = Vec<Surface>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<Surface> {
        let Self { keys, ends, size, cells } = self;
        let mut walk = Walk::<SIDE>::new(keys, cells.start);
        let mut surfaces = Vec::with_capacity(cells.len());
        let mut near = Near::default();
        for first in cells.clone().step_by(LANES) {
            let own = first..(first + LANES).min(cells.end);
            near.clear();
            for (lane, cell) in own.clone().enumerate() {
                walk.around(cell, |other, [i, j]| near.put(lane, (2 * SIDE + 1) * i + j, ends[other]));
            }
            let (of3, of5) = (near.windows::<1>(size), near.windows::<SIDE>(size));
            let lanes = of3.into_iter().zip(of5).zip(near.found);
            let surface = |((of3, of5), found)| Surface { of3, of5, least: 0.0, cover: found / WINDOW as f32 };
            surfaces.extend(lanes.take(own.len()).map(surface));
        }
        surfaces
    }
}

/// The heights in the 5 x 5 cells around each of some cells, cell by cell of the window, by x, then y. No row crosses a line
/// of the cache.
#[repr(align(64))]
struct Near {
    /// The lowest points; infinity in an empty cell.
    lowest: [Lane<f32>; WINDOW],
    /// The highest points; minus infinity in an empty cell.
    highest: [Lane<f32>; WINDOW],
    /// Number of occupied cells.
    found: Lane<f32>,
}

impl Default for Near {
    fn default() -> Self {
        Self {
            lowest: [[f32::INFINITY; LANES]; WINDOW],
            highest: [[f32::NEG_INFINITY; LANES]; WINDOW],
            found: [0.0; LANES],
        }
    }
}

impl Near {
    #[inline(always)]
    fn clear(&mut self) {
        self.lowest.fill([f32::INFINITY; LANES]);
        self.highest.fill([f32::NEG_INFINITY; LANES]);
        self.found = [0.0; LANES];
    }

    #[inline(always)]
    fn put(&mut self, lane: usize, place: usize, [lowest, highest]: [f32; 2]) {
        self.lowest[place][lane] = lowest;
        self.highest[place][lane] = highest;
        self.found[lane] += 1.0;
    }

    /// Heights within `REACH` cells, and the least-squares plane of the highest points; a level plane if the cells are on one
    /// line. An empty cell adds zeros to all sums, which leaves their bits as they are.
    #[inline(always)]
    fn windows<const REACH: usize>(&self, size: f64) -> Lane<Window> {
        let (mut lowest, mut highest) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
        let mut sums = Sums::default();
        let range = SIDE - REACH..=SIDE + REACH;
        for i in range.clone() {
            for j in range.clone() {
                let place = (2 * SIDE + 1) * i + j;
                let (low, high) = (&self.lowest[place], &self.highest[place]);
                for lane in 0..LANES {
                    lowest[lane] = if low[lane] < lowest[lane] { low[lane] } else { lowest[lane] };
                    highest[lane] = if high[lane] > highest[lane] { high[lane] } else { highest[lane] };
                }
                sums.add([i, j].map(|place| place as f32 - SIDE as f32), high);
            }
        }
        let [gradient, square] = sums.planes();
        array::from_fn(|lane| Window {
            highest: highest[lane],
            lowest: lowest[lane],
            roughness: square[lane].max(0.0).sqrt() as f32,
            slope: (gradient[lane] / size) as f32,
            mean: (sums.z[0][lane] / f64::from(sums.n[lane])) as f32,
        })
    }
}

/// Sums over cells: offsets u and v, height z, and their products.
#[derive(Default)]
struct Sums {
    n: Lane<f32>,
    /// Of u and v.
    first: [Lane<f32>; 2],
    /// Of u², u v and v².
    second: [Lane<f32>; 3],
    /// Of z, u z, v z and z².
    z: [Lane<f64>; 4],
}

impl Sums {
    /// Adds the cells at an offset with these heights; those without a point have minus infinity.
    #[inline(always)]
    fn add(&mut self, [u, v]: [f32; 2], heights: &Lane<f32>) {
        for (lane, &height) in heights.iter().enumerate() {
            let occupied = height > f32::NEG_INFINITY;
            let one = if occupied { 1.0 } else { 0.0 };
            let z = f64::from(if occupied { height } else { 0.0 });
            self.n[lane] += one;
            self.first[0][lane] += u * one;
            self.first[1][lane] += v * one;
            self.second[0][lane] += u * u * one;
            self.second[1][lane] += u * v * one;
            self.second[2][lane] += v * v * one;
            self.z[0][lane] += z;
            self.z[1][lane] += f64::from(u) * z;
            self.z[2][lane] += f64::from(v) * z;
            self.z[3][lane] += z * z;
        }
    }

    /// The lengths of the gradients of the least-squares planes (per cell), and the mean squares of the residuals.
    #[inline(always)]
    fn planes(&self) -> [Lane<f64>; 2] {
        let (mut gradients, mut squares) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let n = f64::from(self.n[lane]);
            let [u, v] = [0, 1].map(|k| f64::from(self.first[k][lane]));
            let [uu, uv, vv] = [0, 1, 2].map(|k| f64::from(self.second[k][lane]));
            let [z, uz, vz, zz] = [0, 1, 2, 3].map(|k| self.z[k][lane]);
            let (uu, uv, vv) = (uu - u * u / n, uv - u * v / n, vv - v * v / n);
            let (uz, vz, zz) = (uz - u * z / n, vz - v * z / n, zz - z * z / n);
            let determinant = uu * vv - uv * uv;
            let (a, b) = ((uz * vv - vz * uv) / determinant, (vz * uu - uz * uv) / determinant);
            let level = determinant < 1e-6;
            gradients[lane] = if level { 0.0 } else { (a * a + b * b).sqrt() };
            squares[lane] = if level { zz / n } else { (zz - a * uz - b * vz) / n };
        }
        [gradients, squares]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// Cells of 2 m with gaps, on a rough slope.
    fn scene() -> (Vec<[i32; 2]>, Vec<[f32; 2]>) {
        let mut s = stream(11, 2);
        let keys: Vec<[i32; 2]> = (0..900).filter(|_| s.uniform() < 0.6).map(|i| [i / 30 - 15, i % 30 - 15]).collect();
        let ends = keys.iter().map(|&[x, y]| {
            let low = 0.7 * f64::from(x) - 0.2 * f64::from(y) + s.uniform();
            [low as f32, (low + 3.0 * s.uniform()) as f32]
        });
        let ends = ends.collect();
        (keys, ends)
    }

    /// The plane through the highest points of cells, by differences from their means.
    fn plane(cells: &[[f64; 3]]) -> [f64; 2] {
        let n = cells.len() as f64;
        let mean = [0, 1, 2].map(|a| cells.iter().map(|cell| cell[a]).sum::<f64>() / n);
        let product = |a: usize, b: usize| cells.iter().map(|c| (c[a] - mean[a]) * (c[b] - mean[b])).sum::<f64>();
        let determinant = product(0, 0) * product(1, 1) - product(0, 1).powi(2);
        let slope = match determinant < 1e-6 {
            true => [0.0; 2],
            false => [[0, 1], [1, 0]]
                .map(|[a, b]| (product(a, 2) * product(b, b) - product(b, 2) * product(a, b)) / determinant),
        };
        let rest = |c: &[f64; 3]| c[2] - mean[2] - slope[0] * (c[0] - mean[0]) - slope[1] * (c[1] - mean[1]);
        [slope[0].hypot(slope[1]), (cells.iter().map(|c| rest(c).powi(2)).sum::<f64>() / n).sqrt()]
    }

    #[test]
    fn windows_are_those_of_looking_at_all_cells() {
        let (keys, ends) = scene();
        let found = surfaces(&keys, &ends, 2.0, &Monitor::default()).unwrap();
        let near = |c: usize, reach: i32| {
            let inside = |&o: &usize| (0..2).all(|a| (keys[o][a] - keys[c][a]).abs() <= reach);
            (0..keys.len()).filter(inside).collect::<Vec<usize>>()
        };
        for (c, found) in found.iter().enumerate() {
            for (window, reach) in [(found.of3, 1), (found.of5, 2)] {
                let cells = near(c, reach);
                let tops: Vec<[f64; 3]> = cells
                    .iter()
                    .map(|&o| [2.0 * f64::from(keys[o][0]), 2.0 * f64::from(keys[o][1]), ends[o][1].into()])
                    .collect();
                let [slope, roughness] = plane(&tops);
                let mean = tops.iter().map(|top| top[2]).sum::<f64>() / tops.len() as f64;
                let wanted = [roughness, slope, mean];
                for (found, wanted) in [window.roughness, window.slope, window.mean].into_iter().zip(wanted) {
                    assert!((f64::from(found) - wanted).abs() < 1e-5, "{c} {reach} {found} {wanted}");
                }
                assert_eq!(window.lowest, cells.iter().map(|&o| ends[o][0]).fold(f32::INFINITY, f32::min));
                assert_eq!(window.highest, cells.iter().map(|&o| ends[o][1]).fold(f32::NEG_INFINITY, f32::max));
            }
            assert_eq!(found.cover, near(c, 2).len() as f32 / 25.0);
        }
        for (c, own) in found.iter().enumerate() {
            assert_eq!(own.least, near(c, 1).iter().map(|&o| found[o].of3.roughness).fold(f32::INFINITY, f32::min));
        }
    }

    #[test]
    fn surfaces_have_the_same_bytes_with_and_without_vector_instructions() {
        let (keys, ends) = scene();
        let block = || Block { keys: &keys, ends: &ends, size: 2.0, cells: 3..keys.len() };
        let [with, without] = [Arch::new().dispatch(block()), pulp::Scalar::new().vectorize(block())];
        let bits = |surfaces: Vec<Surface>| format!("{surfaces:?}");
        assert_eq!(with.len(), keys.len() - 3);
        assert!(bits(with) == bits(without));
    }
}
