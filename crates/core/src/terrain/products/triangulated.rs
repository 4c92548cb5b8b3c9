//! Linear interpolation on the Delaunay triangulation of scattered heights, at the centres of a raster's cells.

use crate::cloud::Raster;
use crate::error::{Error, Result};
use crate::memory;
use crate::parallel::{Looks, Monitor};
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

/// Bytes of a triangulation per site, about.
const BYTES: u64 = 200;

/// A height at a position. Positions are in cells: the centre of column c and row r is at (c, r).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Site {
    pub(super) at: [f64; 2],
    pub(super) height: f64,
}

impl HasPosition for Site {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

/// Sets the heights of all cells whose centre lies in the convex hull of the sites; leaves the others as they are.
/// O(n log n + cells).
///
/// # Errors
/// If the memory does not suffice, or the work was cancelled. The triangulation itself cannot be cancelled.
pub(super) fn interpolate(raster: &mut Raster, sites: Vec<Site>, monitor: &Monitor) -> Result<()> {
    memory::require(BYTES * sites.len() as u64, "the triangulation of the ground")?;
    let (columns, rows) = (raster.columns(), raster.rows());
    let triangulation: DelaunayTriangulation<Site> = DelaunayTriangulation::bulk_load(sites)
        .map_err(|e| Error::input(format!("the ground points cannot be triangulated: {e}")))?;
    let mut looks = Looks::at(monitor);
    for face in triangulation.inner_faces() {
        let triangle = Triangle(face.vertices().map(|vertex| *vertex.data()));
        let Some(plane) = triangle.plane() else { continue };
        let [low, high] = triangle.range(1);
        for row in low.ceil().max(0.0) as usize..(high.floor() + 1.0).clamp(0.0, rows as f64) as usize {
            let [west, east] = triangle.across(row as f64);
            let columns_inside =
                west.ceil().max(0.0) as usize..(east.floor() + 1.0).clamp(0.0, columns as f64) as usize;
            looks.steps(columns_inside.len() + 1)?;
            for column in columns_inside {
                raster.values_mut()[row * columns + column] = plane.height([column as f64, row as f64]);
            }
        }
    }
    Ok(())
}

struct Triangle([Site; 3]);

/// The plane through a site with two slopes.
struct Plane {
    through: Site,
    slopes: [f64; 2],
}

impl Triangle {
    fn range(&self, axis: usize) -> [f64; 2] {
        let values = self.0.map(|site| site.at[axis]);
        [values.iter().copied().fold(f64::INFINITY, f64::min), values.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
    }

    /// First and last x of the triangle at that y, which is in its range.
    fn across(&self, y: f64) -> [f64; 2] {
        let (mut west, mut east) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..3 {
            let (a, b) = (self.0[i].at, self.0[(i + 1) % 3].at);
            if (a[1] <= y) == (b[1] <= y) && (a[1] - y).abs() > 0.0 && (b[1] - y).abs() > 0.0 {
                continue;
            }
            let level = (b[1] - a[1]).abs() <= 0.0;
            let ends = if level { [a[0], b[0]] } else { [a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]); 2] };
            for x in ends {
                west = west.min(x);
                east = east.max(x);
            }
        }
        [west, east]
    }

    /// `None` if the triangle has no area.
    fn plane(&self) -> Option<Plane> {
        let [a, b, c] = self.0;
        let [u, v] = [b, c].map(|site| [site.at[0] - a.at[0], site.at[1] - a.at[1], site.height - a.height]);
        let area = u[0] * v[1] - u[1] * v[0];
        let slopes = [(u[2] * v[1] - v[2] * u[1]) / area, (v[2] * u[0] - u[2] * v[0]) / area];
        slopes.iter().all(|s| s.is_finite()).then_some(Plane { through: a, slopes })
    }
}

impl Plane {
    fn height(&self, at: [f64; 2]) -> f64 {
        let [x, y] = [0, 1].map(|a| at[a] - self.through.at[a]);
        self.through.height + self.slopes[0] * x + self.slopes[1] * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn holes(columns: usize, rows: usize) -> Raster {
        Raster::new([0.0; 2], 1.0, columns, vec![f64::NAN; columns * rows]).unwrap()
    }

    #[test]
    fn a_plane_comes_back_inside_the_hull_and_nowhere_else() {
        let mut s = stream(8, 1);
        let height = |[x, y]: [f64; 2]| 100.0 + 0.3 * x - 0.2 * y;
        let sites = (0..300).map(|_| [s.uniform() * 20.0 + 5.0, s.uniform() * 10.0 + 5.0]);
        let corners = [[5.0, 5.0], [25.0, 5.0], [25.0, 15.0], [5.0, 15.0]];
        let sites: Vec<Site> = sites.chain(corners).map(|at| Site { at, height: height(at) }).collect();
        let mut raster = holes(40, 30);
        interpolate(&mut raster, sites, &Monitor::default()).unwrap();
        for (i, value) in raster.values().iter().enumerate() {
            let at = [(i % 40) as f64, (i / 40) as f64];
            let inside = (5.0..=25.0).contains(&at[0]) && (5.0..=15.0).contains(&at[1]);
            assert_eq!(!value.is_nan(), inside, "{at:?}");
            assert!(!inside || (value - height(at)).abs() < 1e-9);
        }
    }

    #[test]
    fn sites_on_a_line_cover_no_cell() {
        let line = |n: i32| (0..n).map(|i| Site { at: [f64::from(i), 2.0], height: 1.0 }).collect::<Vec<_>>();
        for n in [0, 1, 2, 9] {
            let mut raster = holes(10, 5);
            interpolate(&mut raster, line(n), &Monitor::default()).unwrap();
            assert!(raster.values().iter().all(|v| v.is_nan()));
        }
    }
}
