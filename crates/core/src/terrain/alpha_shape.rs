//! The α-shape of the road points in plan.

use super::elevation::check_mask;
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::voxels::cells::{Cells, cell_of};
use serde::{Deserialize, Serialize};
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// A position relative to the origin of the points, metres.
pub(super) type Place = [f64; 2];

/// Parameters of the extent of the road, and the width of its border zone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlphaParams {
    /// Radius α, metres, above 0: triangles with a larger circumscribed circle are removed. It must exceed the spacing
    /// of the road points and be smaller than the radius of the smallest hole to keep. (CGAL's "alpha" is its square;
    /// the Python package `alphashape` uses its inverse.)
    pub alpha: f64,
    /// Edge of thinning squares as a share of α: of the road points in a square only the outermost on each side are
    /// used; 0..=0.5, 0 uses all.
    pub thinning: f64,
    /// Points nearer than this to the border of the road count as on the border, metres, not negative.
    pub rim: f64,
}

impl Default for AlphaParams {
    /// `rim` is that of Guinard & Landrieu 2017; α is our choice.
    fn default() -> Self {
        Self { alpha: 2.0, thinning: 0.25, rim: 1.0 }
    }
}

impl AlphaParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(self.alpha > 0.0 && self.alpha <= 1e9) {
            return Err(Error::parameter("alpha", self.alpha, "metres, above 0, at most 1e9"));
        }
        if !(0.0..=0.5).contains(&self.thinning) {
            return Err(Error::parameter("thinning", self.thinning, "0..0.5"));
        }
        if !(0.0..=1e9).contains(&self.rim) {
            return Err(Error::parameter("rim", self.rim, "metres, 0..1e9"));
        }
        Ok(())
    }
}

/// The union of the Delaunay triangles whose circumscribed circle has a radius of at most α.
///
/// N. Akkiraju et al., *Alpha shapes: definition and software*, 1995; used in Guinard & Landrieu 2017, section 2.2.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlphaShape {
    pub(super) origin: [f64; 3],
    pub(super) triangles: Vec<[Place; 3]>,
    pub(super) border: Vec<[Place; 2]>,
}

impl AlphaShape {
    /// The α-shape of the points for which `is_road` is true; empty if they are too few or too far apart.
    ///
    /// Deviation from the definition: with `thinning` not every road point is used (see [`AlphaParams`]), which moves
    /// the border by less than that share of α. O(n log n).
    ///
    /// # Errors
    /// If lengths differ, a parameter is out of range, or the work was cancelled. The triangulation itself cannot be cancelled.
    pub fn fit(points: &Points, is_road: &[bool], params: &AlphaParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        check_mask(points.len(), is_road)?;
        let place = |i: usize| [f64::from(points.positions.x[i]), f64::from(points.positions.y[i])];
        let road: Vec<Place> = (0..points.len()).filter(|&i| is_road[i]).map(place).collect();
        monitor.check()?;
        let road = thinned(&road, params.thinning * params.alpha, monitor)?;
        monitor.check()?;
        let shape = triangulate(&road, params.alpha)?;
        monitor.check()?;
        Ok(Self { origin: points.frame.origin, ..shape })
    }

    /// Area in m².
    pub fn area(&self) -> f64 {
        self.triangles.iter().map(|t| 0.5 * twice_area(t).abs()).sum()
    }

    /// Length of the border in metres: of the edges that belong to only one triangle.
    pub fn border_length(&self) -> f64 {
        self.border.iter().map(|&[a, b]| (a[0] - b[0]).hypot(a[1] - b[1])).sum()
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }
}

/// The westernmost, easternmost, southernmost and northernmost point of every square with that edge; all points if it
/// is 0.
fn thinned(road: &[Place], edge: f64, monitor: &Monitor) -> Result<Vec<Place>> {
    if edge <= 0.0 {
        return Ok(road.to_vec());
    }
    let squares = Cells::new(road.len(), |i| cell_of(road[i].map(|v| v / edge)), monitor)?;
    let mut kept = Vec::new();
    for square in 0..squares.len() {
        let members = squares.of(square);
        let mut outermost = [members[0]; 4];
        for &i in members {
            for (side, best) in outermost.iter_mut().enumerate() {
                let along = |i: u32| road[i as usize][side / 2] * if side % 2 == 0 { 1.0 } else { -1.0 };
                if along(i) < along(*best) {
                    *best = i;
                }
            }
        }
        outermost.sort_unstable();
        kept.extend(outermost.chunk_by(|a, b| a == b).map(|same| road[same[0] as usize]));
    }
    Ok(kept)
}

fn triangulate(road: &[Place], alpha: f64) -> Result<AlphaShape> {
    // The triangulation refuses coordinates so near 0, far below the resolution of any scan.
    let clean = |v: f64| if v.abs() < 1e-30 { 0.0 } else { v };
    let sites: Vec<Point2<f64>> = road.iter().map(|p| Point2::new(clean(p[0]), clean(p[1]))).collect();
    let delaunay: DelaunayTriangulation<Point2<f64>> = DelaunayTriangulation::bulk_load(sites)
        .map_err(|e| Error::input(format!("the road points cannot be triangulated: {e}")))?;
    let mut shape = AlphaShape::default();
    let mut kept = vec![false; delaunay.num_all_faces()];
    for face in delaunay.inner_faces() {
        let triangle = face.positions().map(|p| [p.x, p.y]);
        if within(&triangle, alpha) {
            kept[face.fix().index()] = true;
            shape.triangles.push(triangle);
        }
    }
    for edge in delaunay.directed_edges() {
        if kept[edge.face().fix().index()] && !kept[edge.rev().face().fix().index()] {
            shape.border.push(edge.positions().map(|p| [p.x, p.y]));
        }
    }
    Ok(shape)
}

fn twice_area([a, b, c]: &[Place; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether the radius of the circumscribed circle, (product of the edges) / (4 area), is at most α.
fn within(triangle: &[Place; 3], alpha: f64) -> bool {
    let [a, b, c] = *triangle;
    let edge = |p: Place, q: Place| (p[0] - q[0]).hypot(p[1] - q[1]);
    let area = twice_area(triangle).abs();
    area > 0.0 && edge(a, b) * edge(b, c) * edge(c, a) <= alpha * 2.0 * area
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;

    pub(super) fn shape(rows: &[[f64; 3]], alpha: f64, thinning: f64) -> AlphaShape {
        let points = Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0);
        let params = AlphaParams { alpha, thinning, ..AlphaParams::default() };
        AlphaShape::fit(&points, &vec![true; rows.len()], &params, &Monitor::default()).unwrap()
    }

    fn lattice(hole: bool) -> Vec<[f64; 3]> {
        let missing = |x: i32, y: i32| hole && (8..=22).contains(&x) && (8..=22).contains(&y);
        (0..=30)
            .flat_map(|x| (0..=30).map(move |y| (x, y)))
            .filter(|&(x, y)| !missing(x, y))
            .map(|(x, y)| [100.0 + f64::from(x) * 0.5, 200.0 + f64::from(y) * 0.5, 1.0])
            .collect()
    }

    fn random(n: usize) -> Vec<[f64; 3]> {
        let mut s = stream(9, n as u64);
        (0..n).map(|_| [s.uniform() * 30.0, s.uniform() * 20.0, s.uniform()]).collect()
    }

    #[test]
    fn a_square_lattice_reproduces_the_square_and_its_border() {
        let found = shape(&lattice(false), 2.0, 0.0);
        assert!((found.area() - 225.0).abs() < 1e-9 && (found.border_length() - 60.0).abs() < 1e-9);
        let thin = shape(&lattice(false), 2.0, 0.25);
        assert!((thin.area() - 225.0).abs() < 1e-9);
    }

    #[test]
    fn a_hole_larger_than_the_radius_is_kept() {
        // The lattice lacks 15 x 15 points: a hole of 8 m x 8 m. No disc of radius 2 reaches its corners.
        let found = shape(&lattice(true), 2.0, 0.0).area();
        assert!((225.0 - 64.0..225.0 - 52.0).contains(&found), "{found}");
        assert!((shape(&lattice(true), 20.0, 0.0).area() - 225.0).abs() < 1e-9);
    }

    #[test]
    fn a_huge_radius_gives_the_convex_hull_and_a_tiny_one_nothing() {
        let rows = random(400);
        let mut sorted: Vec<Place> = rows.iter().map(|p| [f64::from(p[0] as f32), f64::from(p[1] as f32)]).collect();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let chain = |points: &mut dyn Iterator<Item = Place>| {
            let mut hull: Vec<Place> = Vec::new();
            for p in points {
                while hull.len() > 1 && twice_area(&[hull[hull.len() - 2], hull[hull.len() - 1], p]) <= 0.0 {
                    hull.pop();
                }
                hull.push(p);
            }
            hull
        };
        let mut hull = chain(&mut sorted.iter().copied());
        hull.pop();
        hull.extend(chain(&mut sorted.iter().rev().copied()));
        let area: f64 = hull.windows(2).map(|w| w[0][0] * w[1][1] - w[1][0] * w[0][1]).sum::<f64>() * 0.5;
        assert!((shape(&rows, 1e9, 0.0).area() - area).abs() < 1e-6 * area);
        assert_eq!(shape(&rows, 1e-6, 0.0).triangles(), 0);
    }

    #[test]
    fn few_or_collinear_or_identical_points_have_no_extent() {
        for rows in [vec![], vec![[1.0; 3]], vec![[1.0; 3]; 50], (0..40).map(|i| [f64::from(i), 2.0, 0.0]).collect()] {
            let found = shape(&rows, 5.0, 0.25);
            assert!(found.triangles() == 0 && found.area() == 0.0 && found.border_length() == 0.0);
        }
    }

    #[test]
    fn thinning_moves_the_border_by_less_than_its_cell() {
        let rows = random(40_000);
        let (all, thin) = (shape(&rows, 2.0, 0.0), shape(&rows, 2.0, 0.25));
        assert!(thin.triangles() < all.triangles() / 2);
        assert!((all.area() - thin.area()).abs() < 0.05 * all.border_length());
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let points = Points::default();
        for bad in [
            AlphaParams { alpha: 0.0, ..AlphaParams::default() },
            AlphaParams { thinning: 0.6, ..AlphaParams::default() },
            AlphaParams { rim: f64::NAN, ..AlphaParams::default() },
        ] {
            assert!(AlphaShape::fit(&points, &[], &bad, &Monitor::default()).is_err());
        }
        assert!(AlphaShape::fit(&points, &[true], &AlphaParams::default(), &Monitor::default()).is_err());
    }
}
