//! Assigns points to centres: compares each point with the centres near its cell, many points at once.

use super::super::{NO_SUPERVOXEL, SlicParams};
use super::centres::Centre;
use super::sorted::Sorted;
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered_with};
use crate::voxels::cells::Cells;
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Cells whose points one task assigns.
const BLOCK: usize = 128;

/// The squared distance D²: a factor for each of the three squared differences.
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

/// Labels of the sorted points: among the centres whose cube contains the point the one of least D, the first of equal
/// ones.
pub(super) fn assign(scene: &Sorted, centres: &[Centre], distance: &Distance, monitor: &Monitor) -> Result<Vec<u32>> {
    let by_cell = Cells::new(centres.len(), |c| scene.grid.key(centres[c].place), monitor)?;
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
    by_cell: &'a Cells<u64>,
    distance: &'a Distance,
    cells: Range<usize>,
    near: &'a mut Vec<u32>,
}

impl WithSimd for Block<'_> {
    type Output = Vec<u32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<u32> {
        match (self.scene.normals[0].is_empty(), self.scene.colours[0].is_empty()) {
            (true, true) => self.run::<false, false>(),
            (true, false) => self.run::<false, true>(),
            (false, true) => self.run::<true, false>(),
            (false, false) => self.run::<true, true>(),
        }
    }
}

impl Block<'_> {
    #[inline(always)]
    fn run<const NORMALS: bool, const COLOURS: bool>(self) -> Vec<u32> {
        let cells = &self.scene.cells;
        let points = cells.range(self.cells.start).start..cells.range(self.cells.end - 1).end;
        let mut labels = Vec::with_capacity(points.len());
        let mut groups = Vec::new();
        for cell in self.cells {
            let own = cells.range(cell);
            let rim = load(self.scene, own.clone(), &mut groups);
            gather(self.by_cell, cells.keys[cell], self.near);
            for &c in self.near.iter() {
                let centre = &self.centres[c as usize];
                if rim.is_within(centre.place, self.distance.reach) {
                    for group in &mut groups {
                        compete::<NORMALS, COLOURS>(group, c, centre, self.distance);
                    }
                }
            }
            let all = groups.iter().flat_map(|group| &group.labels);
            labels.extend(all.take(own.len()));
        }
        labels
    }
}

/// The centres in the 27 cells around a key, ascending.
#[inline(never)]
fn gather(by_cell: &Cells<u64>, key: u64, near: &mut Vec<u32>) {
    near.clear();
    by_cell.around(key).for_each(|cell| near.extend_from_slice(by_cell.of(cell)));
    near.sort_unstable();
}

/// Points that are compared at once (SIMD lanes).
const LANES: usize = 16;

/// Position, normal and colour of points, one in each lane, and their best centre so far. Unused lanes are infinitely
/// far away.
#[derive(Clone)]
struct Group {
    place: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    colour: [[f32; LANES]; 3],
    best: [f32; LANES],
    labels: [u32; LANES],
}

const EMPTY: Group = Group {
    place: [[f32::INFINITY; LANES]; 3],
    normal: [[0.0; LANES]; 3],
    colour: [[0.0; LANES]; 3],
    best: [f32::INFINITY; LANES],
    labels: [NO_SUPERVOXEL; LANES],
};

/// The bounding box of some points.
struct Rim {
    low: [f32; 3],
    high: [f32; 3],
}

impl Rim {
    /// True if the box and the cube of a centre meet.
    fn is_within(&self, centre: [f32; 3], reach: f32) -> bool {
        // The same arithmetic as for the points themselves, so that rounding cannot exclude one of them.
        (0..3).all(|a| self.low[a] - centre[a] <= reach && self.high[a] - centre[a] >= -reach)
    }
}

/// Fills the groups with the points of a range.
fn load(scene: &Sorted, points: Range<usize>, groups: &mut Vec<Group>) -> Rim {
    groups.clear();
    groups.resize(points.len().div_ceil(LANES), EMPTY);
    let mut rim = Rim { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };
    for (a, axis) in [&scene.positions.x, &scene.positions.y, &scene.positions.z].into_iter().enumerate() {
        let axis = &axis[points.clone()];
        for (group, values) in groups.iter_mut().zip(axis.chunks(LANES)) {
            group.place[a][..values.len()].copy_from_slice(values);
        }
        (rim.low[a], rim.high[a]) =
            axis.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        for (columns, pick) in [(&scene.normals, false), (&scene.colours, true)] {
            let Some(values) = columns[a].get(points.clone()) else { continue };
            for (group, values) in groups.iter_mut().zip(values.chunks(LANES)) {
                let slot = if pick { &mut group.colour } else { &mut group.normal };
                slot[a][..values.len()].copy_from_slice(values);
            }
        }
    }
    rim
}

/// Compares one centre with a group, as loops over lanes that the compiler turns into vector instructions.
#[inline(always)]
fn compete<const NORMALS: bool, const COLOURS: bool>(
    group: &mut Group,
    label: u32,
    centre: &Centre,
    distance: &Distance,
) {
    let (Distance { reach, spatial, colour, normal }, Centre { place: p, normal: m, colour: c }) = (*distance, *centre);
    let [x, y, z] = &group.place;
    let (mut value, mut far) = ([0.0f32; LANES], [0.0f32; LANES]);
    for l in 0..LANES {
        let d = [x[l] - p[0], y[l] - p[1], z[l] - p[2]];
        value[l] = spatial * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        far[l] = larger(larger(d[0].abs(), d[1].abs()), d[2].abs());
    }
    if NORMALS {
        let [x, y, z] = &group.normal;
        for l in 0..LANES {
            value[l] += normal * angle_squared([x[l], y[l], z[l]], m);
        }
    }
    if COLOURS {
        let [r, g, b] = &group.colour;
        for l in 0..LANES {
            let d = [r[l] - c[0], g[l] - c[1], b[l] - c[2]];
            value[l] += colour * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        }
    }
    for l in 0..LANES {
        let better = (far[l] <= reach) & (value[l] < group.best[l]);
        group.best[l] = if better { value[l] } else { group.best[l] };
        group.labels[l] = if better { label } else { group.labels[l] };
    }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Square of the unsigned angle between two directions, radians²: acos²(|a · b|) by Abramowitz and Stegun 4.4.46, whose
/// square needs no square root; error at most 1e-6.
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

    /// True if the cube of a centre contains a point.
    pub(super) fn reaches(&self, scene: &Sorted, i: usize, centre: &Centre) -> bool {
        let p = scene.place(i);
        (0..3).all(|a| (p[a] - centre.place[a]).abs() <= self.reach)
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
        let scene = Sorted::new(&points, &attributes, 1.2, &Monitor::default()).unwrap();
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
