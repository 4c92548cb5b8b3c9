//! Centroid, normal, colour and eigenvalue features of supervoxels.

use super::PointAttributes;
use crate::cloud::Positions;
use crate::csr::Csr;
use crate::error::Result;
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::Shape;
use crate::linalg::{Sym3, mean};
use crate::parallel::{Monitor, concat_watched, map_ordered_with};
use std::ops::Range;

/// Supervoxels that one task describes.
const BLOCK: usize = 64;

/// Features of one supervoxel (Hasanpour Zaryabi et al. 2022, section 3.2). With e = λ/Σλ of its points' covariance
/// (divisor n): linearity (e1 − e2)/e1, planarity (e2 − e3)/e1, scattering e3/e1, change of curvature e3; all 0 where
/// the points coincide.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SupervoxelShape {
    /// Number of points.
    pub points: u32,
    /// Mean of the points, metres relative to their origin.
    pub centroid: [f32; 3],
    /// Unit normal of the plane through the points, oriented like their own normals, or upwards. Fewer than three
    /// points or points on a line define no plane: then the mean of their normals, or straight up.
    pub normal: [f32; 3],
    /// Mean red, green and blue, 0..=1, if the points have colours.
    pub colour: Option<[f32; 3]>,
    /// 0..=1.
    pub linearity: f32,
    /// 0..=1.
    pub planarity: f32,
    /// 0..=1.
    pub scattering: f32,
    /// 0..=1/3.
    pub change_of_curvature: f32,
}

/// Shapes of groups of points, one entry a group.
pub(super) fn shapes(
    points: &Positions,
    attributes: &PointAttributes<'_>,
    groups: &Csr,
    monitor: &Monitor,
) -> Result<Vec<SupervoxelShape>> {
    let block = |b: usize| b * BLOCK..((b + 1) * BLOCK).min(groups.len());
    let parts = map_ordered_with(0..groups.len().div_ceil(BLOCK), monitor, Vec::new, |places, b| {
        let range: Range<usize> = block(b);
        Ok(range.map(|g| shape(points, attributes, groups.group(g), places)).collect::<Vec<_>>())
    })?;
    concat_watched(parts, monitor)
}

fn shape(
    points: &Positions,
    attributes: &PointAttributes<'_>,
    members: &[u32],
    places: &mut Vec<[f64; 3]>,
) -> SupervoxelShape {
    places.clear();
    places.extend(members.iter().map(|&i| {
        let i = i as usize;
        [f64::from(points.x[i]), f64::from(points.y[i]), f64::from(points.z[i])]
    }));
    let centroid = mean(places);
    let eigen = Sym3::scatter(places, centroid, places.len().max(1) as f64).eigen();
    let [l1, l2, _] = eigen.values;
    let shape = Shape::of::<Exact>(eigen.values);
    let given = attributes.normals.map(|rows| side(rows, members));
    let plane = eigen.vectors[2].map(|v| v as f32);
    // A second eigenvalue of the size of rounding errors does not define the normal of a plane.
    let has_plane = places.len() >= 3 && l2 > 1e-9 * l1;
    SupervoxelShape {
        points: members.len() as u32,
        centroid: centroid.map(|v| v as f32),
        normal: facing(if has_plane { Some(plane) } else { None }, given),
        colour: attributes.colours.map(|rows| average(rows, members)),
        linearity: shape.linearity as f32,
        planarity: shape.planarity as f32,
        scattering: shape.scattering as f32,
        change_of_curvature: shape.surface_variation as f32,
    }
}

/// Mean of rows.
fn average(rows: &[[f32; 3]], members: &[u32]) -> [f32; 3] {
    let n = members.len().max(1) as f64;
    [0, 1, 2].map(|a| (members.iter().map(|&i| f64::from(rows[i as usize][a])).sum::<f64>() / n) as f32)
}

/// Sum of the members' normals, which decides the side of the plane normal.
fn side(normals: &[[f32; 3]], members: &[u32]) -> [f32; 3] {
    average(normals, members)
}

/// The plane's normal turned to the side of the given normals (or upwards), of unit length.
fn facing(plane: Option<[f32; 3]>, given: Option<[f32; 3]>) -> [f32; 3] {
    let up = [0.0, 0.0, 1.0];
    match (plane, given.map(|g| (g, dot(g, g)))) {
        (Some(n), Some((g, long))) if long > 1e-6 => signed(n, dot(n, g)),
        (Some(n), _) => signed(n, n[2]),
        (None, Some((g, long))) if long > 1e-6 => g.map(|v| v / long.sqrt()),
        (None, _) => up,
    }
}

fn signed(n: [f32; 3], sign: f32) -> [f32; 3] {
    if sign < 0.0 { n.map(|v| -v) } else { n }
}

#[inline(always)]
pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::super::testing::points_of;
    use super::*;

    fn describe(rows: &[[f64; 3]], attributes: &PointAttributes<'_>) -> SupervoxelShape {
        let members: Vec<u32> = (0..rows.len() as u32).collect();
        shape(&points_of(rows), attributes, &members, &mut Vec::new())
    }

    #[test]
    fn a_square_is_a_plane_and_looks_to_the_side_of_its_normals() {
        let square = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [1.0, 1.0, 2.0]];
        let found = describe(&square, &PointAttributes::default());
        assert_eq!(found.centroid, [0.5, 0.5, 0.0]);
        assert!((found.normal[2] - 1.0).abs() < 1e-6 && (found.planarity - 1.0).abs() < 1e-6);
        assert!(found.linearity.abs() < 1e-6 && found.change_of_curvature < 1e-9 && found.colour.is_none());
        let down = [[0.0, 0.0, -1.0]; 4];
        let colours = [[0.0, 0.5, 1.0], [1.0, 0.5, 1.0], [0.0, 0.5, 1.0], [1.0, 0.5, 1.0]];
        let found = describe(&square, &PointAttributes { normals: Some(&down), colours: Some(&colours) });
        assert!((found.normal[2] + 1.0).abs() < 1e-6);
        assert_eq!(found.colour, Some([0.5, 0.5, 1.0]));
    }

    #[test]
    fn lines_and_single_points_take_the_normal_they_are_given() {
        let line = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let found = describe(&line, &PointAttributes::default());
        assert_eq!((found.linearity, found.planarity, found.normal), (1.0, 0.0, [0.0, 0.0, 1.0]));
        let normals = [[0.0, 1.0, 0.0]];
        let found = describe(&line[..1], &PointAttributes { normals: Some(&normals), colours: None });
        assert_eq!((found.linearity, found.scattering, found.normal), (0.0, 0.0, [0.0, 1.0, 0.0]));
    }

    #[test]
    fn a_cross_of_three_axes_scatters_evenly() {
        let cross =
            [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
        let found = describe(&cross, &PointAttributes::default());
        assert!((found.scattering - 1.0).abs() < 1e-6 && (found.change_of_curvature - 1.0 / 3.0).abs() < 1e-6);
    }
}
