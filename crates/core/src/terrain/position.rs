//! On which side of the road's border a point stands.

use super::alpha_shape::{AlphaShape, Place};
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};
use rayon::prelude::*;
use std::collections::HashMap;

/// Points of a block.
const BLOCK: usize = 16_384;

/// What lies in each cell of a grid: ranges of `items`. The map is only asked, never walked through.
struct Cells {
    ranges: HashMap<[i32; 2], [u32; 2]>,
    items: Vec<u32>,
}

impl Cells {
    /// Puts every item into all cells that its extent (lowest, highest corner) touches.
    fn new(size: f64, extents: impl Iterator<Item = [Place; 2]>) -> Self {
        let mut keyed: Vec<([i32; 2], u32)> = Vec::new();
        for (i, [low, high]) in extents.enumerate() {
            let ([x0, y0], [x1, y1]) = (cell(size, low), cell(size, high));
            keyed.extend((y0..=y1).flat_map(|y| (x0..=x1).map(move |x| ([x, y], i as u32))));
        }
        keyed.par_sort_unstable();
        let mut ranges = HashMap::new();
        let mut first = 0;
        for group in keyed.chunk_by(|a, b| a.0 == b.0) {
            let end = first + group.len() as u32;
            ranges.insert(group[0].0, [first, end]);
            first = end;
        }
        Self { ranges, items: keyed.iter().map(|k| k.1).collect() }
    }

    fn at(&self, cell: [i32; 2]) -> &[u32] {
        self.ranges.get(&cell).map_or(&[], |&[first, end]| &self.items[first as usize..end as usize])
    }
}

fn cell(size: f64, at: Place) -> [i32; 2] {
    at.map(|v| (v / size).floor() as i32)
}

/// Position of every point with respect to the road: 0.5 within `rim` metres of its border on either side, else 0 inside and 1
/// outside (document 000, section 2.1). O(n + triangles).
///
/// # Errors
/// If `rim` is negative or not finite, the extent is too large for cells of the size of the triangles, or the work was
/// cancelled.
pub fn position(points: &Points, shape: &AlphaShape, rim: f64, monitor: &Monitor) -> Result<Vec<f32>> {
    if !(0.0..=1e9).contains(&rim) {
        return Err(Error::parameter("rim", rim, "metres, 0..1e9"));
    }
    let index = Index::new(shape, rim)?;
    let shift = [0, 1].map(|a| points.origin[a] - shape.origin[a]);
    let parts = map_ordered(points.len().div_ceil(BLOCK), monitor, |block| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(points.len());
        let place = |i: usize| [f64::from(points.x[i]) + shift[0], f64::from(points.y[i]) + shift[1]];
        Ok(range.map(|i| index.position(place(i))).collect::<Vec<f32>>())
    })?;
    Ok(parts.concat())
}

/// The shape with a grid over its triangles and over the strip around its border.
struct Index<'a> {
    shape: &'a AlphaShape,
    rim: f64,
    size: f64,
    triangles: Cells,
    border: Cells,
}

impl<'a> Index<'a> {
    fn new(shape: &'a AlphaShape, rim: f64) -> Result<Self> {
        // Mean extent of the triangles: a triangle lies in few cells and a cell holds few triangles.
        let extents = shape.triangles.iter().map(|t| extent(t, 0.0));
        let sum: f64 = extents.map(|[low, high]| (high[0] - low[0]).max(high[1] - low[1])).sum();
        let size = (2.0 * sum / shape.triangles.len().max(1) as f64).max(rim).max(1e-3);
        let far = shape.triangles.iter().flatten().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
        if (far + rim) / size >= f64::from(i32::MAX) {
            return Err(Error::input(format!(
                "the road reaches {far} m from the origin, too far for cells of {size} m"
            )));
        }
        Ok(Self {
            shape,
            rim,
            size,
            triangles: Cells::new(size, shape.triangles.iter().map(|t| extent(t, 0.0))),
            border: Cells::new(size, shape.border.iter().map(|e| extent(e, rim))),
        })
    }

    fn position(&self, at: Place) -> f32 {
        let cell = cell(self.size, at);
        let on = |e: &u32| squared_distance(at, &self.shape.border[*e as usize]) <= self.rim * self.rim;
        if self.border.at(cell).iter().any(on) {
            return 0.5;
        }
        let inside = |t: &u32| holds(&self.shape.triangles[*t as usize], at);
        if self.triangles.at(cell).iter().any(inside) { 0.0 } else { 1.0 }
    }
}

/// Lowest and highest corner of some places, widened.
fn extent(places: &[Place], by: f64) -> [Place; 2] {
    let fold = |a: usize, start: f64, pick: fn(f64, f64) -> f64| places.iter().fold(start, |m, p| pick(m, p[a]));
    let low = [0, 1].map(|a| fold(a, f64::INFINITY, f64::min) - by);
    [low, [0, 1].map(|a| fold(a, f64::NEG_INFINITY, f64::max) + by)]
}

/// Whether a triangle (border included) holds a place.
fn holds([a, b, c]: &[Place; 3], p: Place) -> bool {
    let side = |a: &Place, b: &Place| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let sides = [side(a, b), side(b, c), side(c, a)];
    sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
}

/// Squared distance of a place to a segment.
fn squared_distance(p: Place, [a, b]: &[Place; 2]) -> f64 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = along[0] * along[0] + along[1] * along[1];
    let share = if length > 0.0 { ((to[0] * along[0] + to[1] * along[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
    let apart = [to[0] - share * along[0], to[1] - share * along[1]];
    apart[0] * apart[0] + apart[1] * apart[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;
    use crate::terrain::AlphaParams;

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
    fn the_grid_finds_what_looking_at_everything_finds() {
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
                let near = shape.border.iter().map(|e| squared_distance(at, e).sqrt()).fold(f64::INFINITY, f64::min);
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
