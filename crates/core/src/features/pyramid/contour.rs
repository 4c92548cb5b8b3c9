//! The contour features of Hackel 2018: moments along e2 (eq. 4.1), difference of the normals on both sides of e2 (R,
//! eq. 4.2), and of the curvature near to and far from e1 (Q, eq. 4.3). 16 neighbourhoods at once, without branches.

#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes index several arrays at once; iterators hide that from the vectoriser"
)]

use crate::features::definition::Feature;
use crate::features::tensor::{Batch, LANES, Lane, MOST};
use pulp::Simd;

/// Q if only the far half is flat.
const MOST_Q: f32 = 1000.0;
/// If the spread along e2 is below this share of the total, it is a rounding error and both moments are 0.
const THIN: f32 = 1e-10;

/// Normals and surface variations of the neighbours. No row crosses a line of the cache.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Surfaces {
    pub(super) normal: [[Lane; MOST]; 3],
    pub(super) variation: [Lane; MOST],
}

impl Default for Surfaces {
    fn default() -> Self {
        let zero = [[0.0; LANES]; MOST];
        Self { normal: [zero; 3], variation: zero }
    }
}

/// 16 neighbourhoods.
#[derive(Clone, Copy, Debug)]
pub(super) struct Around<'a> {
    pub(super) batch: &'a Batch,
    pub(in crate::features) surfaces: &'a Surfaces,
    /// Number of points in a neighbourhood: the first rows.
    pub(super) count: usize,
    /// Size of the near set of Q.
    pub(super) near: usize,
}

/// The contour features of each lane.
#[derive(Clone, Debug)]
pub(super) struct ContourFeatures {
    /// O.
    pub(super) first_moment: Lane,
    /// m2.
    pub(super) second_moment: Lane,
    /// R.
    pub(super) surface_orientation: Lane,
    /// Q.
    pub(super) line: Lane,
}

impl ContourFeatures {
    /// The features with their keys.
    #[inline(always)]
    pub(super) fn keyed(&self) -> [(Feature, &Lane); 4] {
        [
            (Feature::FirstMoment, &self.first_moment),
            (Feature::SecondMoment, &self.second_moment),
            (Feature::SurfaceOrientation, &self.surface_orientation),
            (Feature::LineFeature, &self.line),
        ]
    }
}

/// The contour features; `second` is e2.
#[inline(always)]
pub(super) fn contour_features<S: Simd>(simd: S, around: Around<'_>, second: &[Lane; 3]) -> ContourFeatures {
    let Around { batch, surfaces, count, near } = around;
    let mut along = [[0.0; LANES]; MOST];
    for j in 0..count {
        for l in 0..LANES {
            along[j][l] = batch.x[j][l] * second[0][l] + batch.y[j][l] * second[1][l] + batch.z[j][l] * second[2][l];
        }
    }
    let [first_moment, second_moment] = moments(batch, &along, count);
    let surface_orientation = orientation(simd, &along, surfaces, count);
    ContourFeatures { first_moment, second_moment, surface_orientation, line: line(&along, surfaces, count, near) }
}

/// O = (Σ d)² / Σ d² and m2 = Σ d².
#[inline(always)]
fn moments(batch: &Batch, along: &[Lane; MOST], count: usize) -> [Lane; 2] {
    let (mut first, mut second, mut extent) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for j in 0..count {
        for l in 0..LANES {
            let d = along[j][l];
            first[l] += d;
            second[l] += d * d;
            extent[l] += batch.x[j][l] * batch.x[j][l] + batch.y[j][l] * batch.y[j][l] + batch.z[j][l] * batch.z[j][l];
        }
    }
    let mut out = [[0.0; LANES]; 2];
    for l in 0..LANES {
        let thick = second[l] > THIN * extent[l];
        let safe = if thick { second[l] } else { 1.0 };
        out[0][l] = if thick { first[l] * first[l] / safe } else { 0.0 };
        out[1][l] = second[l];
    }
    out
}

/// |n⁻ · n⁺| of the medoids of the normals on both sides under the distance 1 − |n · n'|; 1 if a side is empty.
#[inline(always)]
fn orientation<S: Simd>(simd: S, along: &[Lane; MOST], surfaces: &Surfaces, count: usize) -> Lane {
    let [x, y, z] = &surfaces.normal;
    let mut totals = [[0.0f32; LANES]; MOST];
    for i in 0..count {
        for j in i + 1..count {
            for l in 0..LANES {
                let apart = 1.0 - (x[i][l] * x[j][l] + y[i][l] * y[j][l] + z[i][l] * z[j][l]).abs();
                let same = (along[i][l] < 0.0) == (along[j][l] < 0.0);
                let counted = if same { apart } else { 0.0 };
                totals[i][l] += counted;
                totals[j][l] += counted;
            }
        }
    }
    let mut medoids = [Medoid { total: [f32::INFINITY; LANES], normal: [[0.0; LANES]; 3] }; 2];
    for j in 0..count {
        let on_side = by_side(simd, &along[j], &totals[j]);
        for (medoid, total) in medoids.iter_mut().zip(&on_side) {
            medoid.keep_better(simd, total, [&x[j], &y[j], &z[j]]);
        }
    }
    let mut out = [1.0; LANES];
    for l in 0..LANES {
        let [before, after] = &medoids;
        let both = (before.total[l] < f32::INFINITY) & (after.total[l] < f32::INFINITY);
        let cosine = (0..3).map(|a| before.normal[a][l] * after.normal[a][l]).sum::<f32>().abs();
        let bounded = if cosine < 1.0 { cosine } else { 1.0 };
        out[l] = if both { bounded } else { 1.0 };
    }
    out
}

/// The totals of the lanes on the negative side of the line, and of those on the other; infinity in the other lanes. (Written
/// with explicit selections, which the compiler would otherwise turn into branches.)
#[inline(always)]
fn by_side<S: Simd>(simd: S, along: &Lane, total: &Lane) -> [Lane; 2] {
    let mut sides = [[f32::INFINITY; LANES]; 2];
    let [negative, positive] = &mut sides;
    let parts = S::as_mut_simd_f32s(negative).0.iter_mut().zip(S::as_mut_simd_f32s(positive).0);
    let (zero, none) = (simd.splat_f32s(0.0), simd.splat_f32s(f32::INFINITY));
    let given = S::as_simd_f32s(along).0.iter().zip(S::as_simd_f32s(total).0);
    for ((negative, positive), (&along, &total)) in parts.zip(given) {
        let before = simd.less_than_f32s(along, zero);
        *negative = simd.select_f32s(before, total, none);
        *positive = simd.select_f32s(before, none, total);
    }
    sides
}

/// The normal with the least total of distances to the others, so far.
#[derive(Clone, Copy)]
struct Medoid {
    total: Lane,
    normal: [Lane; 3],
}

impl Medoid {
    /// Takes another normal in the lanes where its total is smaller. (Written as an explicit loop over lanes, which the
    /// compiler would otherwise turn into branches.)
    #[inline(always)]
    fn keep_better<S: Simd>(&mut self, simd: S, total: &Lane, normal: [&Lane; 3]) {
        let (total, least) = (S::as_simd_f32s(total).0, S::as_mut_simd_f32s(&mut self.total).0);
        for (axis, from) in self.normal.iter_mut().zip(normal) {
            let parts = S::as_mut_simd_f32s(axis).0.iter_mut().zip(S::as_simd_f32s(from).0);
            for ((old, &new), (&total, &least)) in parts.zip(total.iter().zip(least.iter())) {
                *old = simd.select_f32s(simd.less_than_f32s(total, least), new, *old);
            }
        }
        least.iter_mut().zip(total).for_each(|(least, &total)| *least = simd.min_f32s(*least, total));
    }
}

/// Mean variation of the `near` rows nearest to the line along e1, divided by that of the others; ties go to the
/// earlier row.
#[inline(always)]
fn line(along: &[Lane; MOST], surfaces: &Surfaces, count: usize, near: usize) -> Lane {
    let mut rank = [[0u32; LANES]; MOST];
    for i in 0..count {
        for j in i + 1..count {
            for l in 0..LANES {
                let earlier = along[i][l].abs() <= along[j][l].abs();
                rank[j][l] = rank[j][l].wrapping_add(u32::from(earlier));
                rank[i][l] = rank[i][l].wrapping_add(u32::from(!earlier));
            }
        }
    }
    let (mut close, mut far) = ([0.0; LANES], [0.0; LANES]);
    for j in 0..count {
        for l in 0..LANES {
            let v = surfaces.variation[j][l];
            let is_near = rank[j][l] < near as u32;
            close[l] += if is_near { v } else { 0.0 };
            far[l] += if is_near { 0.0 } else { v };
        }
    }
    let mut out = [1.0; LANES];
    let share = count.saturating_sub(near) as f32 / near.max(1) as f32;
    for l in 0..LANES {
        let safe = if far[l] > 0.0 { far[l] } else { 1.0 };
        let ratio = close[l] * share / safe;
        let bounded = if ratio < MOST_Q { ratio } else { MOST_Q };
        let without_far = if close[l] > 0.0 { MOST_Q } else { 1.0 };
        out[l] = if far[l] > 0.0 { bounded } else { without_far };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Scalar;

    /// e2 = y.
    const SECOND: [Lane; 3] = [[0.0; LANES], [1.0; LANES], [0.0; LANES]];

    /// The features of neighbours along the y axis.
    fn along_y(y: &[f32], surfaces: &Surfaces, near: usize) -> ContourFeatures {
        let mut batch = Batch::default();
        y.iter().enumerate().for_each(|(j, &v)| batch.y[j] = [v; LANES]);
        contour_features(Scalar::new(), Around { batch: &batch, surfaces, count: y.len(), near }, &SECOND)
    }

    #[test]
    fn points_on_one_side_give_k_minus_one_and_symmetric_ones_zero() {
        let mut y = [0.5; 10];
        y[9] = 0.0;
        let f = along_y(&y, &Surfaces::default(), 5);
        assert!((f.first_moment[0] - 9.0).abs() < 1e-5 && (f.second_moment[0] - 2.25).abs() < 1e-6);
        let f = along_y(&[1.0, -1.0, 2.0, -2.0, 0.0], &Surfaces::default(), 3);
        assert!(f.first_moment[0].abs() < 1e-6 && (f.second_moment[0] - 10.0).abs() < 1e-6);
        let f = along_y(&[0.0; 5], &Surfaces::default(), 3);
        let found = (f.first_moment[0], f.second_moment[0], f.surface_orientation[0]);
        assert_eq!(found, (0.0, 0.0, 1.0), "no spread, one side only");
    }

    #[test]
    fn a_dihedral_gives_the_cosine_of_its_angle() {
        for degrees in [0.0f32, 30.0, 90.0, 120.0] {
            let mut surfaces = Surfaces::default();
            let y = [-0.3, -0.2, -0.1, 0.1, 0.2, 0.3];
            for (j, v) in y.iter().enumerate() {
                let angle = if *v < 0.0 { 0.0 } else { degrees.to_radians() };
                // Normals are unoriented: every second one is flipped.
                let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
                surfaces.normal[1][j] = [sign * angle.sin(); LANES];
                surfaces.normal[2][j] = [sign * angle.cos(); LANES];
            }
            let f = along_y(&y, &surfaces, 3);
            assert!((f.surface_orientation[5] - degrees.to_radians().cos().abs()).abs() < 1e-6, "{degrees}");
        }
    }

    #[test]
    fn the_line_feature_is_one_on_a_plane_above_one_along_a_crease_and_capped() {
        let y = [-0.2, -0.1, 0.0, 0.1, 0.2];
        let with = |variation: [f32; 5]| {
            let mut surfaces = Surfaces::default();
            variation.iter().enumerate().for_each(|(j, &v)| surfaces.variation[j] = [v; LANES]);
            along_y(&y, &surfaces, 3).line[2]
        };
        assert_eq!(with([0.0; 5]), 1.0);
        assert!((with([1e-7; 5]) - 1.0).abs() < 1e-6, "evenly rough");
        assert!((with([0.01, 0.06, 0.06, 0.06, 0.01]) - 6.0).abs() < 1e-5);
        assert_eq!(with([0.0, 0.1, 0.1, 0.1, 0.0]), MOST_Q);
    }
}
