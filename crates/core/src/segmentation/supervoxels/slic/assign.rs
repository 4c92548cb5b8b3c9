//! The assignment of points to centres: every pair of a point and a centre near its cell, many points at once.

use super::super::cells::Cells;
use super::super::{NO_SUPERVOXEL, SlicParams};
use super::centres::Centre;
use super::sorted::Sorted;
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered_with};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Cells whose points are assigned in one go.
const BLOCK: usize = 128;

/// The distance D, squared: a factor for each of the three squared differences.
#[derive(Clone, Copy, Debug)]
pub(super) struct Distance {
    reach: f32,
    spatial: f32,
    colour: f32,
    normal: f32,
}

impl Distance {
    pub(super) fn new(params: &SlicParams) -> Self {
        let squared = |factor: f64| (factor * factor) as f32;
        Self {
            reach: params.size as f32,
            spatial: squared(params.weights.spatial / params.normaliser.length(params.size)),
            colour: squared(params.weights.colour / 3.0f64.sqrt()),
            normal: squared(params.weights.normal / std::f64::consts::FRAC_PI_2),
        }
    }
}

/// Labels of the sorted points: of the centres whose cube holds it the one of least D, the first of equal ones.
pub(super) fn assign(scene: &Sorted, centres: &[Centre], distance: &Distance, monitor: &Monitor) -> Result<Vec<u32>> {
    let by_cell = Cells::new(centres.len(), |c| scene.grid.key(centres[c].place));
    let cells = scene.cells.len();
    let parts = map_ordered_with(0..cells.div_ceil(BLOCK), monitor, Vec::new, |near, block| {
        let cells = block * BLOCK..((block + 1) * BLOCK).min(cells);
        let labels = Arch::new().dispatch(Block { scene, centres, by_cell: &by_cell, distance, cells, near });
        monitor.advance(labels.len() as u64);
        Ok(labels)
    })?;
    Ok(parts.concat())
}

/// The assignment of some cells, compiled for each instruction set.
struct Block<'a> {
    scene: &'a Sorted,
    centres: &'a [Centre],
    by_cell: &'a Cells,
    distance: &'a Distance,
    cells: Range<usize>,
    near: &'a mut Vec<u32>,
}

impl WithSimd for Block<'_> {
    type Output = Vec<u32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<u32> {
        let cells = &self.scene.cells;
        let points = cells.range(self.cells.start).start..cells.range(self.cells.end - 1).end;
        let mut labels = vec![NO_SUPERVOXEL; points.len()];
        let mut best = vec![f32::INFINITY; points.len()];
        for cell in self.cells {
            let own = cells.range(cell);
            let at = own.start - points.start..own.end - points.start;
            gather(self.by_cell, cells.keys[cell], self.near);
            let (best, labels) = (&mut best[at.clone()], &mut labels[at]);
            for &c in self.near.iter() {
                compete(self.scene, own.clone(), (c, &self.centres[c as usize], self.distance), (best, labels));
            }
        }
        labels
    }
}

/// The centres in the 27 cells around a key, ascending.
#[inline(never)]
fn gather(by_cell: &Cells, key: u64, near: &mut Vec<u32>) {
    near.clear();
    by_cell.around(key).for_each(|cell| near.extend_from_slice(by_cell.of(cell)));
    near.sort_unstable();
}

/// One centre against the points of a range. Loops over plain slices of one length, which the compiler vectorises.
#[inline(always)]
fn compete(
    scene: &Sorted,
    points: Range<usize>,
    (label, centre, distance): (u32, &Centre, &Distance),
    (best, labels): (&mut [f32], &mut [u32]),
) {
    match (scene.normals[0].is_empty(), scene.colours[0].is_empty()) {
        (true, true) => run::<false, false>(scene, points, (label, centre, distance), (best, labels)),
        (true, false) => run::<false, true>(scene, points, (label, centre, distance), (best, labels)),
        (false, true) => run::<true, false>(scene, points, (label, centre, distance), (best, labels)),
        (false, false) => run::<true, true>(scene, points, (label, centre, distance), (best, labels)),
    }
}

#[inline(always)]
fn run<const NORMALS: bool, const COLOURS: bool>(
    scene: &Sorted,
    points: Range<usize>,
    (label, centre, distance): (u32, &Centre, &Distance),
    (best, labels): (&mut [f32], &mut [u32]),
) {
    let n = points.len();
    let (x, y, z) = (&scene.x[points.clone()][..n], &scene.y[points.clone()][..n], &scene.z[points.clone()][..n]);
    let [nx, ny, nz] = rows(&scene.normals, points.clone(), NORMALS);
    let [r, g, b] = rows(&scene.colours, points, COLOURS);
    let (best, labels) = (&mut best[..n], &mut labels[..n]);
    for i in 0..n {
        let d = [x[i] - centre.place[0], y[i] - centre.place[1], z[i] - centre.place[2]];
        let inside = within(d, distance.reach);
        let mut value = distance.spatial * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        if NORMALS {
            value += distance.normal * angle_squared([nx[i], ny[i], nz[i]], centre.normal);
        }
        if COLOURS {
            let d = [r[i] - centre.colour[0], g[i] - centre.colour[1], b[i] - centre.colour[2]];
            value += distance.colour * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        }
        let better = inside & (value < best[i]);
        best[i] = if better { value } else { best[i] };
        labels[i] = if better { label } else { labels[i] };
    }
}

/// Three columns over a range, or nothing.
#[inline(always)]
fn rows(columns: &[Vec<f32>; 3], points: Range<usize>, wanted: bool) -> [&[f32]; 3] {
    let n = points.len();
    let [a, b, c] = columns;
    if wanted { [&a[points.clone()][..n], &b[points.clone()][..n], &c[points][..n]] } else { [&[]; 3] }
}

#[inline(always)]
fn within(d: [f32; 3], reach: f32) -> bool {
    (d[0].abs() <= reach) & (d[1].abs() <= reach) & (d[2].abs() <= reach)
}

/// Square of the angle between two directions without sign, radians: acos²(|a · b|) by Abramowitz and Stegun 4.4.46,
/// whose square needs no root; at most 1e-6 off.
#[inline(always)]
fn angle_squared(a: [f32; 3], b: [f32; 3]) -> f32 {
    let c = (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).abs();
    let c = if c < 1.0 { c } else { 1.0 };
    let mut sum = -0.001_262_491_1f32;
    sum = sum * c + 0.006_670_09;
    sum = sum * c - 0.017_088_126;
    sum = sum * c + 0.030_891_88;
    sum = sum * c - 0.050_174_305;
    sum = sum * c + 0.088_978_99;
    sum = sum * c - 0.214_598_8;
    sum = sum * c + std::f32::consts::FRAC_PI_2;
    (1.0 - c) * (sum * sum)
}

#[cfg(test)]
impl Distance {
    /// D² of one pair, for the tests.
    pub(super) fn squared(&self, scene: &Sorted, i: usize, centre: &Centre) -> f32 {
        let square = |d: [f32; 3]| d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let less = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let mut value = self.spatial * square(less(scene.place(i), centre.place));
        if !scene.normals[0].is_empty() {
            value += self.normal * angle_squared([0, 1, 2].map(|a| scene.normals[a][i]), centre.normal);
        }
        value + scene.colour(i).map_or(0.0, |c| self.colour * square(less(c, centre.colour)))
    }

    /// True if the cube of a centre holds a point.
    pub(super) fn reaches(&self, scene: &Sorted, i: usize, centre: &Centre) -> bool {
        let p = scene.place(i);
        within([0, 1, 2].map(|a| p[a] - centre.place[a]), self.reach)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::PointAttributes;
    use super::super::super::testing::points_of;
    use super::*;
    use crate::random::stream;

    #[test]
    fn the_angle_is_that_of_the_arc_cosine() {
        for i in 0..=1000 {
            let expected = f64::from(i) / 1000.0 * std::f64::consts::FRAC_PI_2;
            let b = [expected.cos() as f32, expected.sin() as f32, 0.0];
            let found = f64::from(angle_squared([-1.0, 0.0, 0.0], b));
            assert!((found - expected * expected).abs() < 1e-6, "{expected}: {found}");
        }
        assert_eq!(angle_squared([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]), 0.0);
    }

    #[test]
    fn the_distance_is_zero_at_the_seed_only_and_bounded_by_the_weights() {
        let params = SlicParams::default();
        let distance = Distance::new(&params);
        let mut s = stream(3, 1);
        let mut unit = || {
            let v = [0; 3].map(|_| s.uniform() as f32 * 2.0 - 1.0);
            let long = v.iter().map(|x| x * x).sum::<f32>().sqrt();
            v.map(|x| x / long)
        };
        let normals: Vec<[f32; 3]> = (0..200).map(|_| unit()).collect();
        let mut s = stream(3, 2);
        let rows: Vec<[f64; 3]> = (0..200).map(|_| [0; 3].map(|_| s.uniform() * 1.2)).collect();
        let colours: Vec<[f32; 3]> = (0..200).map(|_| [0; 3].map(|_| s.uniform() as f32)).collect();
        let points = points_of(&rows);
        let attributes = PointAttributes { normals: Some(&normals), colours: Some(&colours) };
        let scene = Sorted::new(&points, &attributes, 1.2).unwrap();
        let most = 0.1f32 * 0.1 + 0.4 * 0.4 + 1.0;
        for a in 0..200 {
            let [nx, ny, nz] = &scene.normals;
            let centre =
                Centre { place: scene.place(a), normal: [nx[a], ny[a], nz[a]], colour: scene.colour(a).unwrap() };
            for b in 0..200 {
                let d = distance.squared(&scene, b, &centre);
                assert!(d <= most && (d > 1e-6 || a == b) && d >= 0.0, "{a} {b} {d}");
                assert!(a != b || d < 1e-6);
            }
        }
    }
}
