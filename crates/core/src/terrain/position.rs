//! Position of points with respect to the border of the road.

use super::alpha_shape::{AlphaShape, Place};
use crate::cloud::{Points, Positions};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};
use parry2d_f64::bounding_volume::Aabb;
use parry2d_f64::math::Vector;
use parry2d_f64::partitioning::{Bvh, BvhBuildStrategy};
use parry2d_f64::query::PointQuery;
use parry2d_f64::shape::Segment;

/// Points of a block.
const BLOCK: usize = 16_384;

/// Position of every point with respect to the road: 0.5 within `rim` metres of its border on either side, else 0
/// inside and 1 outside (Guinard & Landrieu 2017, section 2.2). O(n √e + e log e) for a border of e edges.
///
/// # Errors
/// If `rim` is negative or not finite, or the work was cancelled.
pub fn position(points: &Points, shape: &AlphaShape, rim: f64, monitor: &Monitor) -> Result<Vec<f32>> {
    if !(0.0..=1e9).contains(&rim) {
        return Err(Error::parameter("rim", rim, "metres, 0..1e9"));
    }
    let index = Index::new(shape, rim);
    let shift = [0, 1].map(|a| points.frame.origin[a] - shape.origin[a]);
    let parts = map_ordered(points.len().div_ceil(BLOCK), monitor, |block| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(points.len());
        let Positions { x, y, .. } = &points.positions;
        let place = |i: usize| [f64::from(x[i]) + shift[0], f64::from(y[i]) + shift[1]];
        Ok(range.map(|i| index.position(place(i))).collect::<Vec<f32>>())
    })?;
    Ok(parts.concat())
}

/// The border, with a bounding-box tree over its edges.
struct Index<'a> {
    border: &'a [[Place; 2]],
    rim: f64,
    tree: Bvh,
    /// Largest x of the border.
    east: f64,
}

impl<'a> Index<'a> {
    fn new(shape: &'a AlphaShape, rim: f64) -> Self {
        let boxes: Vec<Aabb> = shape.border.iter().map(|edge| Aabb::from_points(edge.map(vector))).collect();
        let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        let east = tree.root_aabb().maxs.x;
        Self { border: &shape.border, rim, tree, east }
    }

    fn position(&self, at: Place) -> f32 {
        let near = vector(at);
        let around = Aabb::new(near - Vector::splat(self.rim), near + Vector::splat(self.rim));
        let on = |e: u32| distance(near, self.border[e as usize]) <= self.rim;
        if self.tree.intersect_aabb(&around).any(on) {
            return 0.5;
        }
        // A ray to the east from inside the road crosses the border an odd number of times.
        let ray = Aabb::new(near, Vector::new(self.east.max(at[0]), at[1]));
        let crossings = self.tree.intersect_aabb(&ray).filter(|&e| crosses(&self.border[e as usize], at)).count();
        if crossings % 2 == 1 { 0.0 } else { 1.0 }
    }
}

/// Whether a ray to the east meets a segment; of its two ends only the lower one counts.
fn crosses([a, b]: &[Place; 2], at: Place) -> bool {
    let side = (b[0] - a[0]) * (at[1] - a[1]) - (b[1] - a[1]) * (at[0] - a[0]);
    (a[1] <= at[1] && at[1] < b[1] && side > 0.0) || (b[1] <= at[1] && at[1] < a[1] && side < 0.0)
}

fn vector(place: Place) -> Vector {
    Vector::new(place[0], place[1])
}

/// Distance of a position from a segment.
fn distance(at: Vector, [a, b]: [Place; 2]) -> f64 {
    Segment::new(vector(a), vector(b)).distance_to_local_point(at, true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;
    use crate::terrain::AlphaParams;

    /// Whether a triangle (border included) contains a position.
    fn holds([a, b, c]: &[Place; 3], p: Place) -> bool {
        let side = |a: &Place, b: &Place| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        let sides = [side(a, b), side(b, c), side(c, a)];
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    }

    fn points(rows: &[[f64; 3]]) -> Points {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0)
    }

    #[test]
    fn a_square_road_has_an_inside_a_rim_and_an_outside() {
        let road: Vec<[f64; 3]> =
            (0..=40).flat_map(|x| (0..=40).map(move |y| [f64::from(x) * 0.5, f64::from(y) * 0.5, 0.0])).collect();
        let road = points(&road);
        let everything = vec![true; road.len()];
        let shape = AlphaShape::fit(&road, &everything, &AlphaParams::default(), &Monitor::default()).unwrap();
        let mut s = stream(3, 8);
        let asked: Vec<[f64; 3]> =
            (0..5000).map(|_| [s.uniform() * 40.0 - 10.0, s.uniform() * 40.0 - 10.0, 9.0]).collect();
        let queries = points(&asked);
        let found = position(&queries, &shape, 1.0, &Monitor::default()).unwrap();
        for (p, value) in asked.iter().zip(&found) {
            let inwards = (p[0].min(20.0 - p[0])).min(p[1].min(20.0 - p[1]));
            let outside = [p[0], p[1]].map(|v| (-v).max(v - 20.0).max(0.0));
            let away = if inwards >= 0.0 { inwards } else { outside[0].hypot(outside[1]) };
            if (away - 1.0).abs() > 1e-4 {
                let expected = if away < 1.0 {
                    0.5
                } else if inwards > 0.0 {
                    0.0
                } else {
                    1.0
                };
                assert_eq!(*value, expected, "{p:?}");
            }
        }
        let sharp = position(&queries, &shape, 0.0, &Monitor::default()).unwrap();
        assert!(sharp.iter().all(|&v| v != 0.5) && sharp.contains(&0.0) && sharp.contains(&1.0));
    }

    #[test]
    fn the_border_tells_what_looking_at_everything_finds() {
        let mut s = stream(3, 9);
        let rows: Vec<[f64; 3]> = (0..1500).map(|_| [s.uniform() * 60.0 + 5.0, s.uniform() * 30.0, 0.0]).collect();
        let points = points(&rows);
        let road: Vec<bool> = rows.iter().map(|p| (p[0] - 35.0).hypot(p[1] - 15.0) > 9.0).collect();
        for (alpha, rim) in [(1.3, 1.0), (3.0, 0.2), (1e6, 2.0)] {
            let params = AlphaParams { alpha, thinning: 0.0, rim };
            let shape = AlphaShape::fit(&points, &road, &params, &Monitor::default()).unwrap();
            let found = position(&points, &shape, rim, &Monitor::default()).unwrap();
            for (p, value) in rows.iter().zip(found) {
                let at = [f64::from((p[0] - 5.0) as f32), f64::from(p[1] as f32)].map(f64::from);
                let at = [at[0] + 5.0 - shape.origin[0], at[1] - shape.origin[1]];
                let near = shape.border.iter().map(|&e| distance(vector(at), e)).fold(f64::INFINITY, f64::min);
                if (near - rim).abs() < 1e-4 {
                    continue;
                }
                let inside = shape.triangles.iter().any(|t| holds(t, at));
                assert_eq!(
                    value,
                    if near < rim {
                        0.5
                    } else if inside {
                        0.0
                    } else {
                        1.0
                    }
                );
            }
        }
    }

    #[test]
    fn without_a_road_every_point_is_outside() {
        let points = points(&[[0.0; 3], [5.0, 5.0, 1.0]]);
        let none = AlphaShape::fit(&points, &[false; 2], &AlphaParams::default(), &Monitor::default()).unwrap();
        assert_eq!(position(&points, &none, 1.0, &Monitor::default()).unwrap(), [1.0, 1.0]);
        assert!(position(&points, &none, -1.0, &Monitor::default()).is_err());
    }
}
