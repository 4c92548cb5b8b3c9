//! Normals and surface variation of points from their nearest neighbours.

use super::params::{Centre, Divisor};
use super::tensor::{Batch, Convention, LANES, MOST, Tensor, tensor};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::Shape;
use crate::neighbours::Neighbours;
use crate::parallel::{Monitor, map_ordered_with};
use pulp::{Arch, Simd, WithSimd};

/// Points of a block.
const BLOCK: usize = 4096;
const CONVENTION: Convention = Convention { centre: Centre::Mean, divisor: Divisor::N };

/// Normal and surface variation of each point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Normals {
    /// Unit normals (directions of least variance). Their sign carries no information: they point up, or, if
    /// horizontal, to the side where the first nonzero coordinate is positive; see [`Orientation::orient`](crate::graph::Orientation::orient) for
    /// oriented normals. (0, 0, 1) if there are fewer than three points.
    pub directions: Vec<[f32; 3]>,
    /// λ3 / (λ1 + λ2 + λ3), 0..1/3: 0 on a plane.
    pub variation: Vec<f32>,
}

/// The normal of each point by principal component analysis of the point and its neighbours (divisor: their number).
///
/// As in Li 2018, section 3.1, and Hasanpour Zaryabi et al. 2022, section 3.2. Returns one unit normal and one surface
/// variation a point. O(n k).
///
/// # Errors
/// If there are more than 32 neighbours a point, or fewer than 2 in a cloud of three points or more, if rows of neighbours and
/// points differ in number, or if the work was cancelled.
///
/// ```
/// use scansion_core::{Cloud, cloud::Points, features::normals, neighbours::knn, parallel::Monitor};
///
/// let roof: Vec<[f64; 3]> = (0..100).map(|i| [f64::from(i % 10), f64::from(i / 10), f64::from(i / 10)]).collect();
/// let points = Points::from_cloud(&Cloud::from_rows(&roof)?, 1.0).positions;
/// let monitor = Monitor::default();
/// let found = normals(&points, &knn(&points, 8, &monitor)?, &monitor)?;
/// assert!((found.directions[55][2] - 0.5f32.sqrt()).abs() < 1e-4);
/// assert!(found.variation[55] < 1e-6);
/// # Ok::<(), scansion_core::Error>(())
/// ```
pub fn normals(points: &Positions, neighbours: &Neighbours, monitor: &Monitor) -> Result<Normals> {
    let few = neighbours.k() < 2;
    if !few || points.len() > 2 {
        check_neighbours(neighbours.k())?;
    }
    if neighbours.k() > 0 && neighbours.len() != points.len() {
        let (rows, n) = (neighbours.len(), points.len());
        return Err(Error::input(format!("neighbours of {rows} points for a cloud of {n}")));
    }
    if few {
        return Ok(Normals { directions: vec![[0.0, 0.0, 1.0]; points.len()], variation: vec![0.0; points.len()] });
    }
    monitor.stage("normals", points.len() as u64);
    let blocks = points.len().div_ceil(BLOCK);
    let parts = map_ordered_with(0..blocks, monitor, Batch::default, |batch, b| {
        let range = b * BLOCK..((b + 1) * BLOCK).min(points.len());
        monitor.advance(range.len() as u64);
        Ok(Arch::new().dispatch(Describe { points, neighbours, range, batch }))
    })?;
    let mut found = Normals::default();
    found.directions.reserve_exact(points.len());
    found.variation.reserve_exact(points.len());
    for part in parts {
        monitor.check()?;
        found.directions.extend(part.directions);
        found.variation.extend(part.variation);
    }
    Ok(found)
}

/// Fails if that many neighbours of a point give no normal.
pub(crate) fn check_neighbours(k: usize) -> Result<()> {
    match (2..MOST).contains(&k) {
        true => Ok(()),
        false => Err(Error::parameter("neighbours", k, "2..=32")),
    }
}

/// Computes the normals of a block, compiled for each instruction set.
struct Describe<'a> {
    points: &'a Positions,
    neighbours: &'a Neighbours,
    range: std::ops::Range<usize>,
    batch: &'a mut Batch,
}

impl WithSimd for Describe<'_> {
    type Output = Normals;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Normals {
        let mut out = Normals::default();
        for first in self.range.clone().step_by(LANES) {
            let lanes = LANES.min(self.range.end - first);
            for lane in 0..lanes {
                self.gather(first + lane, lane);
            }
            push(&tensor(self.batch, self.neighbours.k() + 1, CONVENTION), lanes, &mut out);
        }
        out
    }
}

impl Describe<'_> {
    /// The neighbours of a point relative to it, into a lane of the batch; row 0 is the point itself.
    #[inline(always)]
    fn gather(&mut self, point: usize, lane: usize) {
        let (points, batch) = (self.points, &mut *self.batch);
        let at = points.xyz(point);
        (batch.x[0][lane], batch.y[0][lane], batch.z[0][lane]) = (0.0, 0.0, 0.0);
        for (j, &n) in self.neighbours.of(point).iter().enumerate() {
            let n = n as usize;
            batch.x[j + 1][lane] = points.x[n] - at[0];
            batch.y[j + 1][lane] = points.y[n] - at[1];
            batch.z[j + 1][lane] = points.z[n] - at[2];
        }
    }
}

#[inline(always)]
fn push(found: &Tensor, lanes: usize, out: &mut Normals) {
    for l in 0..lanes {
        let values = [0, 1, 2].map(|i| found.values[i][l]);
        out.variation.push(Shape::of::<Exact>(values).surface_variation);
        let direction = [0, 1, 2].map(|i| found.normal[i][l]);
        out.directions.push(if values[0] > 0.0 { upward(direction) } else { [0.0, 0.0, 1.0] });
    }
}

/// The normal v or its opposite −v: the one that points up, or if both are horizontal the one whose first nonzero
/// coordinate is positive.
#[inline(always)]
fn upward(v: [f32; 3]) -> [f32; 3] {
    let lead = if v[2] != 0.0 {
        v[2]
    } else if v[0] != 0.0 {
        v[0]
    } else {
        v[1]
    };
    if lead < 0.0 { v.map(|c| -c) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::linalg::{Sym3, mean};
    use crate::neighbours::knn;
    use crate::random::stream;

    fn points(rows: &[[f64; 3]]) -> Positions {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0).positions
    }

    fn normals_of(rows: &[[f64; 3]], k: usize) -> Normals {
        let points = points(rows);
        let monitor = Monitor::default();
        normals(&points, &knn(&points, k, &monitor).unwrap(), &monitor).unwrap()
    }

    #[test]
    fn one_neighbour_spans_no_plane() {
        let (points, monitor) = (points(&[[0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), Monitor::default());
        let near = knn(&points, 1, &monitor).unwrap();
        assert!(normals(&points, &near, &monitor).unwrap_err().to_string().contains("2..=32"));
    }

    #[test]
    fn agree_with_the_reference_eigen_system() {
        let mut random = stream(3, 1);
        let rows: Vec<[f64; 3]> =
            (0..500).map(|_| [random.uniform() * 9.0, random.uniform() * 9.0, random.uniform()]).collect();
        let (points, monitor) = (points(&rows), Monitor::default());
        let near = knn(&points, 12, &monitor).unwrap();
        let found = normals(&points, &near, &monitor).unwrap();
        for i in 0..rows.len() {
            let own = std::iter::once(i).chain(near.of(i).iter().map(|&n| n as usize));
            let set: Vec<[f64; 3]> = own.map(|j| rows[j]).collect();
            let eigen = Sym3::scatter(&set, mean(&set), set.len() as f64).eigen();
            let expected = eigen.values[2] / eigen.values.iter().sum::<f64>();
            assert!((f64::from(found.variation[i]) - expected).abs() < 1e-5, "{i}");
            if (eigen.values[1] - eigen.values[2]) / eigen.values[0] > 0.02 {
                let cosine: f64 = (0..3).map(|a| f64::from(found.directions[i][a]) * eigen.vectors[2][a]).sum();
                assert!(cosine.abs() > 0.9999, "{i}: {cosine}");
            }
            assert!(found.directions[i][2] >= 0.0);
        }
    }

    #[test]
    fn a_vertical_wall_has_level_normals_to_one_side() {
        let wall: Vec<[f64; 3]> = (0..100).map(|i| [f64::from(i % 10), 0.0, f64::from(i / 10)]).collect();
        let found = normals_of(&wall, 8);
        assert!(found.directions.iter().all(|n| n[1].abs() > 0.9999 && n[2].abs() < 1e-3));
    }

    #[test]
    fn too_few_or_equal_points_have_normals_straight_up() {
        for rows in [vec![[1.0, 2.0, 3.0]], vec![[0.0; 3], [1.0, 0.0, 0.0]], vec![[5.0; 3]; 20]] {
            let found = normals_of(&rows, 8);
            assert!(found.directions.iter().all(|&n| n == [0.0, 0.0, 1.0]), "{rows:?}");
            assert!(found.variation.iter().all(|&v| v == 0.0));
        }
    }

    #[test]
    fn more_than_32_neighbours_are_refused() {
        let line: Vec<[f64; 3]> = (0..50).map(|i| [f64::from(i), 0.0, 0.0]).collect();
        let (points, monitor) = (points(&line), Monitor::default());
        let near = knn(&points, 33, &monitor).unwrap();
        assert!(normals(&points, &near, &monitor).unwrap_err().to_string().contains("2..=32"));
    }
}
