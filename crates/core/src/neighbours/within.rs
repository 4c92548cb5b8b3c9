//! All points within a radius of positions.

use super::knn::rank::Rows;
use super::knn::search::Seeker;
use super::knn::tree::{Tree, check};
use crate::cloud::Positions;
use crate::csr::Csr;
use crate::error::{Error, Result};
use crate::memory;
use crate::parallel::{Monitor, map_ordered_with};
use pulp::{Arch, Simd, WithSimd};

/// Queries that one task searches.
const QUERIES: usize = 64;

/// The points within a radius of each query, ascending by (squared distance, index).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Within {
    near: Csr,
    squared_distance: Vec<f32>,
}

impl Within {
    /// Number of queries.
    pub fn len(&self) -> usize {
        self.near.len()
    }

    /// True if there is no query.
    pub fn is_empty(&self) -> bool {
        self.near.is_empty()
    }

    /// The points around query `i`, the nearest first.
    pub fn of(&self, i: usize) -> &[u32] {
        self.near.group(i)
    }

    /// Squared distances of [`Within::of`], m².
    pub fn squared_distances(&self, i: usize) -> &[f32] {
        let offsets = self.near.offsets();
        &self.squared_distance[offsets[i] as usize..offsets[i + 1] as usize]
    }

    /// The points of all queries.
    pub fn groups(&self) -> &Csr {
        &self.near
    }
}

/// All of `points` within `radius` metres of each of `queries`, ascending by (squared distance, index); group i belongs
/// to query i.
///
/// A point at the position of a query is in its group: with the points themselves as queries, each is in its own. A
/// point is within the radius if `(dx² + dy²) + dz²` in `f32`, each operation rounded once, is at most the square of
/// the radius rounded to `f32`: brute force in that order gives the same groups. Both have the same origin; the points of
/// another cloud are first [moved to it](crate::cloud::Points::moved_to). O(n log n + q log n + m log m) expected time
/// for m points in all groups; memory 8 bytes for each of these.
///
/// # Errors
/// If the radius is negative or not finite, a coordinate is not finite, the groups have more than 2^32 points or do not
/// fit into memory, or the work was cancelled.
///
/// ```
/// use scansion_core::{Cloud, cloud::Points, neighbours::within, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// let cloud = Cloud::from_rows(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])?;
/// let points = Points::from_cloud(&cloud, 1.0).positions;
/// let near = within(&points, &points, 2.0, &Monitor::default())?;
/// assert_eq!(near.of(1), [1, 0, 2]);
/// assert_eq!(near.squared_distances(1), [0.0, 1.0, 4.0]);
/// # Ok(())
/// # }
/// ```
pub fn within(points: &Positions, queries: &Positions, radius: f64, monitor: &Monitor) -> Result<Within> {
    if !(radius.is_finite() && radius >= 0.0) {
        return Err(Error::parameter("radius", radius, "metres, 0 or more, finite"));
    }
    check(queries)?;
    // The tree finds any number of coincident points.
    let tree = Tree::new(points, points.len(), monitor)?;
    let limit = (radius * radius) as f32;
    monitor.stage("neighbours", queries.len() as u64);
    let mut offsets = vec![0u32];
    let mut all = Rows::default();
    let count = queries.len().div_ceil(QUERIES);
    let at_once = 16 * rayon::current_num_threads();
    for first in (0..count).step_by(at_once) {
        let blocks = first..(first + at_once).min(count);
        let parts = map_ordered_with(blocks, monitor, Seeker::default, |seeker, block| {
            let range = block * QUERIES..((block + 1) * QUERIES).min(queries.len());
            let places: Vec<[f32; 3]> = range.map(|i| queries.xyz(i)).collect();
            let search = BallQuery { seeker, tree: &tree, places: &places, limit, monitor };
            let found = Arch::new().dispatch(search)?;
            monitor.advance(places.len() as u64);
            Ok(found)
        })?;
        for Found { rows, ends } in parts {
            make_room(&mut all, rows.index.len())?;
            let before = all.index.len();
            for end in ends {
                let end = u32::try_from(before + end).map_err(|_| {
                    Error::parameter("radius", radius, "a radius with fewer than 2^32 neighbours of all points")
                })?;
                offsets.push(end);
            }
            all.index.extend(rows.index);
            all.squared.extend(rows.squared);
        }
    }
    let near = Csr::new(offsets, all.index, points.len())?;
    Ok(Within { near, squared_distance: all.squared.into_iter().map(f32::from_bits).collect() })
}

/// The groups of consecutive queries: `rows` up to `ends[q]` belong to queries 0..=q.
#[derive(Clone, Debug, Default)]
struct Found {
    rows: Rows,
    ends: Vec<usize>,
}

/// A search around some positions, compiled for each instruction set.
struct BallQuery<'a> {
    seeker: &'a mut Seeker,
    tree: &'a Tree,
    places: &'a [[f32; 3]],
    /// Square of the radius.
    limit: f32,
    monitor: &'a Monitor,
}

impl WithSimd for BallQuery<'_> {
    type Output = Result<Found>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<Found> {
        let mut found = Found::default();
        for &at in self.places {
            self.monitor.check()?;
            let count = self.seeker.collect(simd, self.tree, at, self.limit);
            make_room(&mut found.rows, count)?;
            self.seeker.write(simd, count, &mut found.rows);
            found.ends.push(found.rows.index.len());
        }
        Ok(found)
    }
}

/// Makes room for more neighbours; at least doubles the room, so that memory is rarely asked for.
fn make_room(rows: &mut Rows, more: usize) -> Result<()> {
    if rows.index.capacity() - rows.index.len() < more {
        let more = more.max(rows.index.len());
        memory::reserve(&mut rows.index, more, "the neighbours within the radius")?;
        memory::reserve(&mut rows.squared, more, "the neighbours within the radius")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::random::stream;

    fn points(rows: &[[f64; 3]]) -> Positions {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0).positions
    }

    fn random(n: usize, extent: [f64; 3]) -> Vec<[f64; 3]> {
        let mut s = stream(17, n as u64);
        (0..n).map(|_| extent.map(|e| s.uniform() * e)).collect()
    }

    /// The groups of up to 300 queries against brute force, index for index and bit for bit.
    fn check_all(points: &Positions, queries: &Positions, radius: f64) {
        let found = within(points, queries, radius, &Monitor::default()).unwrap();
        assert_eq!(found.len(), queries.len());
        let limit = (radius * radius) as f32;
        for i in (0..queries.len()).step_by(queries.len().div_ceil(300)) {
            let at = queries.xyz(i);
            let apart = |j: usize| {
                let [x, y, z] = [points.x[j] - at[0], points.y[j] - at[1], points.z[j] - at[2]];
                x * x + y * y + z * z
            };
            let mut expected: Vec<(f32, u32)> =
                (0..points.len()).map(|j| (apart(j), j as u32)).filter(|e| e.0 <= limit).collect();
            expected.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let group: Vec<(f32, u32)> =
                found.squared_distances(i).iter().copied().zip(found.of(i).iter().copied()).collect();
            assert_eq!(group, expected, "query {i}, radius {radius}");
        }
    }

    #[test]
    fn equals_brute_force_on_surfaces_lattices_and_piles() {
        let lattice: Vec<[f64; 3]> =
            (0..2197).map(|i| [f64::from(i * 5 % 13), f64::from(i / 13 % 13), f64::from(i / 169)]).collect();
        let mut pile = vec![[1.0, 2.0, 3.0]; 700];
        pile.extend(random(500, [3.0, 3.0, 3.0]));
        for rows in [random(3000, [40.0, 40.0, 0.3]), lattice, pile, vec![[5.0; 3]], random(15, [2.0; 3])] {
            let points = points(&rows);
            for radius in [0.0, 0.5, 1.0, 3.0, 1e3, 1e30] {
                check_all(&points, &points, radius);
            }
        }
    }

    #[test]
    fn positions_far_away_and_of_another_origin_find_what_is_near_them() {
        let of = |rows: &[[f64; 3]]| Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0);
        let cloud = of(&random(3000, [30.0, 30.0, 4.0]));
        let shifted: Vec<[f64; 3]> = random(400, [50.0, 50.0, 4.0]).iter().map(|p| p.map(|v| v + 1000.0)).collect();
        let mut queries = of(&shifted);
        queries.frame.origin = queries.frame.origin.map(|o| o - 1000.0);
        let (queries, cloud) = (queries.moved_to(cloud.frame.origin).unwrap().positions, cloud.positions);
        for radius in [0.7, 5.0, 25.0] {
            check_all(&cloud, &queries, radius);
        }
        let none = within(&Positions::default(), &queries, 3.0, &Monitor::default()).unwrap();
        assert!(none.len() == 400 && none.groups().items().is_empty());
        assert!(within(&cloud, &Positions::default(), 3.0, &Monitor::default()).unwrap().is_empty());
    }

    #[test]
    fn radii_and_coordinates_that_are_no_numbers_are_refused_and_a_cancelled_search_stops() {
        let mut points = points(&random(50, [1.0; 3]));
        for radius in [-1.0, f64::NAN, f64::INFINITY] {
            let message = within(&points, &points, radius, &Monitor::default()).unwrap_err().to_string();
            assert!(message.contains("radius"), "{message}");
        }
        let monitor = Monitor::default();
        monitor.cancel();
        assert!(matches!(within(&points, &points, 1.0, &monitor), Err(Error::Interrupted)));
        points.y[7] = f32::NAN;
        assert!(within(&points, &points, 1.0, &Monitor::default()).is_err());
    }

    #[test]
    fn the_groups_are_the_same_for_any_number_of_threads() {
        let points = points(&random(20_000, [50.0, 50.0, 3.0]));
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| within(&points, &points, 0.8, &Monitor::default())).unwrap()
        };
        let one = with(1);
        assert!(one == with(2) && one == with(5));
    }
}
