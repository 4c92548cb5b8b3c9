//! The k nearest neighbours of all points, and of other positions.

pub(super) mod build;
mod lanes;
mod list;
pub(super) mod rank;
pub(super) mod search;
pub(super) mod tree;

use super::nearest::Neighbours;
use crate::cloud::Positions;
use crate::error::Result;
use crate::memory;
use crate::parallel::{Monitor, map_ordered_with, watched};
use pulp::{Arch, Simd, WithSimd};
use rank::Rows;
use search::{Nearest, Seeker};
use std::ops::Range;
use tree::{Tree, check};

/// Leaves that one task searches.
const LEAVES: usize = 64;
/// Queries that one task searches.
const QUERIES: usize = 512;

/// The `k` nearest other points of every point, exactly, ascending by (squared distance, index).
///
/// Returns a row of `k` indices and squared distances (m²) for each point. Distances are `(dx² + dy²) + dz²` in `f32`,
/// each operation rounded once: brute force in that order gives the same bits. `k` is reduced to at most one less than
/// the number of points. A balanced k-d tree is built, and all points of a leaf are searched together. O(n log n)
/// expected time for any distribution of the points; memory 8 (k + 4) bytes a point.
///
/// # Errors
/// If a coordinate is not finite, the result does not fit into memory, or the work was cancelled.
///
/// ```
/// use scansion_core::{Cloud, cloud::Points, neighbours::knn, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// let cloud = Cloud::from_rows(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])?;
/// let near = knn(&Points::from_cloud(&cloud, 1.0).positions, 2, &Monitor::default())?;
/// assert_eq!(near.of(2), [1, 0]);
/// assert_eq!(near.squared_distances(2), [4.0, 9.0]);
/// # Ok(())
/// # }
/// ```
pub fn knn(points: &Positions, k: usize, monitor: &Monitor) -> Result<Neighbours> {
    let k = k.min(points.len().saturating_sub(1));
    let tree = Tree::new(points, k, monitor)?;
    let mut index = room(points.len(), k)?;
    let mut squared_distance = room(points.len(), k)?;
    for piece in watched(points.len() * k, monitor) {
        let end = piece?.end;
        index.resize(end, 0u32);
        squared_distance.resize(end, 0f32);
    }
    if k > 0 {
        monitor.stage("neighbours", points.len() as u64);
        blocks(
            Nearest { tree: &tree, k },
            monitor,
            |block, _| Ok(block),
            |block| {
                let rows = block.rows.index.chunks_exact(k).zip(block.rows.squared.chunks_exact(k));
                for (&point, (near, squared)) in tree.index[block.points].iter().zip(rows) {
                    let range = point as usize * k..(point as usize + 1) * k;
                    index[range.clone()].copy_from_slice(near);
                    squared_distance[range].iter_mut().zip(squared).for_each(|(to, &d)| *to = f32::from_bits(d));
                }
            },
        )?;
    }
    Ok(Neighbours::trusted(k, index, squared_distance))
}

/// The `k` nearest of `points` to each of `queries`, ascending by (squared distance, index): row i belongs to query i.
///
/// A point at the position of a query is among its nearest points. Both have the same origin; the points of another
/// cloud are first [moved to it](crate::cloud::Points::moved_to). `k` is reduced to at most the number of points.
/// O((n + q) log n) expected time.
///
/// # Errors
/// If a coordinate is not finite, the result does not fit into memory, or the work was cancelled.
pub fn nearest_of(points: &Positions, queries: &Positions, k: usize, monitor: &Monitor) -> Result<Neighbours> {
    let k = k.min(points.len());
    let tree = Tree::new(points, k, monitor)?;
    check(queries)?;
    let mut index = room(queries.len(), k)?;
    let mut squared_distance = room(queries.len(), k)?;
    monitor.stage("neighbours", queries.len() as u64);
    let count = if k > 0 { queries.len().div_ceil(QUERIES) } else { 0 };
    let parts = map_ordered_with(0..count, monitor, Seeker::default, |seeker, block| {
        let range = block * QUERIES..((block + 1) * QUERIES).min(queries.len());
        let places: Vec<[f32; 3]> = range.map(|i| queries.xyz(i)).collect();
        let mut rows = Rows::with_room(places.len() * k);
        Arch::new().dispatch(Places { seeker, of: Nearest { tree: &tree, k }, places: &places, out: &mut rows });
        monitor.advance(places.len() as u64);
        Ok(rows)
    })?;
    for rows in parts {
        index.extend(rows.index);
        squared_distance.extend(rows.squared.into_iter().map(f32::from_bits));
    }
    Ok(Neighbours::trusted(k, index, squared_distance))
}

/// Neighbours of consecutive points: `rows` holds `k` for each of `points` (positions in the tree's order).
#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    pub(super) points: Range<usize>,
    pub(super) rows: Rows,
}

/// Searches all points of the tree block by block: `kernel` in parallel, `take` in order. `k` may be 0.
pub(super) fn blocks<T: Send>(
    of: Nearest<'_>,
    monitor: &Monitor,
    kernel: impl Fn(Block, &Tree) -> Result<T> + Sync + Send,
    mut take: impl FnMut(T),
) -> Result<()> {
    let Nearest { tree, k } = of;
    let count = tree.leaves.len().div_ceil(LEAVES);
    let at_once = 16 * rayon::current_num_threads();
    for first in (0..count).step_by(at_once) {
        let parts = map_ordered_with(first..(first + at_once).min(count), monitor, Seeker::default, |seeker, b| {
            let leaves = b * LEAVES..((b + 1) * LEAVES).min(tree.leaves.len());
            let points = tree.points_of(leaves.clone());
            let mut rows = Rows::with_room(points.len() * k);
            if k > 0 {
                Arch::new().dispatch(Leaves { seeker, of, leaves, out: &mut rows });
            }
            monitor.advance(points.len() as u64);
            kernel(Block { points, rows }, tree)
        })?;
        parts.into_iter().for_each(&mut take);
    }
    Ok(())
}

/// A search of all points of some leaves, compiled for each instruction set.
struct Leaves<'a> {
    seeker: &'a mut Seeker,
    of: Nearest<'a>,
    leaves: Range<usize>,
    out: &'a mut Rows,
}

impl WithSimd for Leaves<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.seeker.leaves(simd, self.of, self.leaves, self.out);
    }
}

/// A search of arbitrary positions, compiled for each instruction set.
struct Places<'a> {
    seeker: &'a mut Seeker,
    of: Nearest<'a>,
    places: &'a [[f32; 3]],
    out: &'a mut Rows,
}

impl WithSimd for Places<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.seeker.places(simd, self.of, self.places, self.out);
    }
}

/// Allocates a table, after a check that enough memory is free.
fn room<T>(rows: usize, k: usize) -> Result<Vec<T>> {
    let mut table = Vec::new();
    memory::reserve(&mut table, rows.saturating_mul(k), &format!("the {k} nearest neighbours of {rows} points"))?;
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::error::Error;
    use crate::random::stream;

    fn points(rows: &[[f64; 3]]) -> Positions {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0).positions
    }

    #[test]
    fn a_table_that_does_not_fit_tells_the_memory_that_it_needs() {
        for rows in [1 << 42, usize::MAX] {
            let error = room::<u32>(rows, 10).unwrap_err();
            assert!(matches!(&error, Error::Memory { what, .. } if what.contains("10 nearest neighbours")), "{error}");
        }
    }

    fn brute_force(points: &Positions, at: [f32; 3], but: Option<usize>) -> Vec<(f32, u32)> {
        let apart = |j: usize| {
            let [x, y, z] = [points.x[j] - at[0], points.y[j] - at[1], points.z[j] - at[2]];
            x * x + y * y + z * z
        };
        let mut all: Vec<(f32, u32)> =
            (0..points.len()).filter(|&j| Some(j) != but).map(|j| (apart(j), j as u32)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        all
    }

    /// Rows of up to 500 points against brute force, index for index and bit for bit.
    fn check(rows: &[[f64; 3]], k: usize) {
        let points = points(rows);
        let found = knn(&points, k, &Monitor::default()).unwrap();
        assert_eq!(found.k(), k.min(points.len() - 1));
        for i in (0..points.len()).step_by(points.len().div_ceil(500)) {
            let mut expected = brute_force(&points, points.xyz(i), Some(i));
            expected.truncate(k);
            let row: Vec<(f32, u32)> =
                found.squared_distances(i).iter().copied().zip(found.of(i).iter().copied()).collect();
            assert_eq!(row, expected, "point {i} of {}, k {k}", points.len());
        }
    }

    fn random(n: usize, extent: [f64; 3]) -> Vec<[f64; 3]> {
        let mut s = stream(11, n as u64);
        (0..n).map(|_| extent.map(|e| s.uniform() * e)).collect()
    }

    #[test]
    fn equals_brute_force_on_surfaces_and_in_volumes() {
        for k in [1, 2, 10, 33, 100] {
            check(&random(5000, [40.0, 40.0, 0.3]), k);
            check(&random(3000, [8.0, 8.0, 8.0]), k);
        }
    }

    #[test]
    fn equals_brute_force_on_lattices_full_of_ties() {
        let cube: Vec<[f64; 3]> =
            (0..2197).map(|i| [f64::from(i * 5 % 13), f64::from(i / 13 % 13), f64::from(i / 169)]).collect();
        let square: Vec<[f64; 3]> = (0..4096).map(|i| [f64::from(i % 64), f64::from(i / 64), 1.0]).collect();
        for k in [1, 10, 50] {
            check(&cube, k);
            check(&square, k);
            check(&square.iter().chain(&cube).chain(&square).copied().collect::<Vec<_>>(), k);
        }
    }

    #[test]
    fn equals_brute_force_where_many_points_share_a_place_or_a_line() {
        check(&(0..33).map(|i| [5.0, 5.0, f64::from(i)]).collect::<Vec<_>>(), 10);
        check(&vec![[1.0, 2.0, 3.0]; 5000], 10);
        check(&vec![[1.0, 2.0, 3.0]; 40], 100);
        let mut places = random(40, [9.0, 9.0, 9.0]);
        let mut s = stream(2, 2);
        places = (0..6000).map(|_| places[s.below(40)]).collect();
        places.extend(random(1000, [9.0, 9.0, 9.0]));
        for k in [1, 10, 100, 200] {
            check(&places, k);
        }
    }

    #[test]
    fn equals_brute_force_where_the_density_varies_wildly() {
        let mut s = stream(3, 3);
        let mut rows: Vec<[f64; 3]> = (0..4000)
            .map(|_| {
                let scale = (s.uniform() * 16.0 - 4.0).exp();
                [0; 3].map(|_| (s.uniform() - 0.5) * scale)
            })
            .collect();
        rows.push([90_000.0, 5.0, 700.0]);
        rows.extend((0..500).map(|i| [90_000.0, 5.0 + f64::from(i) * 0.01, 0.0]));
        for k in [1, 10, 100] {
            check(&rows, k);
        }
    }

    #[test]
    fn few_points_have_few_neighbours() {
        for n in 1..20 {
            check(&random(n, [5.0, 5.0, 5.0]), 10);
        }
        let none = knn(&Positions::default(), 10, &Monitor::default()).unwrap();
        assert!(none.is_empty() && none.k() == 0);
        let zero = knn(&points(&random(9, [1.0; 3])), 0, &Monitor::default()).unwrap();
        assert!(zero.is_empty() && zero.k() == 0);
    }

    #[test]
    fn other_places_find_their_nearest_points_across_origins() {
        let rows = random(3000, [30.0, 30.0, 4.0]);
        let cloud = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let mut asked: Vec<[f64; 3]> = random(400, [50.0, 50.0, 4.0]);
        asked.extend_from_slice(&rows[..50]);
        let shifted = asked.iter().map(|p| p.map(|v| v + 1000.0)).collect::<Vec<_>>();
        let mut queries = Points::from_cloud(&Cloud::from_rows(&shifted).unwrap(), 1.0);
        queries.frame.origin = queries.frame.origin.map(|o| o - 1000.0);
        let moved = queries.clone().moved_to(cloud.frame.origin).unwrap().positions;
        for k in [1, 7, 5000] {
            let found = nearest_of(&cloud.positions, &moved, k, &Monitor::default()).unwrap();
            assert_eq!((found.len(), found.k()), (450, k.min(3000)));
            for i in 0..450 {
                let own = queries.positions.xyz(i);
                let at =
                    [0, 1, 2].map(|a| (f64::from(own[a]) + queries.frame.origin[a] - cloud.frame.origin[a]) as f32);
                let mut expected = brute_force(&cloud.positions, at, None);
                expected.truncate(k);
                assert!(found.of(i).iter().eq(expected.iter().map(|e| &e.1)));
                assert!(found.squared_distances(i).iter().eq(expected.iter().map(|e| &e.0)));
            }
        }
        assert!(nearest_of(&Positions::default(), &moved, 3, &Monitor::default()).unwrap().is_empty());
        assert!(nearest_of(&cloud.positions, &Positions::default(), 3, &Monitor::default()).unwrap().is_empty());
    }

    #[test]
    fn coordinates_that_are_not_finite_and_endless_tables_are_refused() {
        let mut points = points(&random(50, [1.0; 3]));
        points.y[7] = f32::NAN;
        assert!(knn(&points, 3, &Monitor::default()).unwrap_err().to_string().contains("y of point 7"));
        points.y.pop();
        assert!(knn(&points, 3, &Monitor::default()).is_err());
    }

    #[test]
    fn a_cancelled_search_stops() {
        let monitor = Monitor::default();
        monitor.cancel();
        assert!(matches!(knn(&points(&random(500, [1.0; 3])), 3, &monitor), Err(Error::Interrupted)));
    }

    #[test]
    fn the_neighbours_are_the_same_for_any_number_of_threads() {
        let points = points(&random(60_000, [50.0, 50.0, 3.0]));
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| knn(&points, 10, &Monitor::default())).unwrap()
        };
        let one = with(1);
        assert!(one == with(2) && one == with(5));
    }
}
