//! Centre, normal and features of each supervoxel, a node of the graph.
//!
//! Li 2018, section 3.3: f = (n_x, n_y, n_z, a_p, a_s) with planarity a_p = (λ2 − λ3) / λ1 and scattering a_s = λ3 / λ1
//! of the covariance (divisor n) of its points.

use super::arc::Tangent;
use super::params::Sides;
use crate::cloud::Positions;
use crate::error::Result;
use crate::linalg::Moments;
use crate::linalg::arithmetic::Exact;
use crate::linalg::closed_form::eigenvalues;
use crate::linalg::shape::Shape;
use crate::parallel::{Monitor, map_ordered};
use crate::segmentation::Partition;

/// Supervoxels that one task describes.
const BLOCK: usize = 256;
/// A sum of unit vectors shorter than this share of their number counts as zero: no mean direction.
const NO_DIRECTION: f64 = 1e-6;

/// The nodes of the graph.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Nodes {
    /// Mean of the points, metres.
    pub(super) centres: Vec<[f32; 3]>,
    /// Unit mean of the normals; that of the first point if they cancel out.
    pub(super) normals: Vec<[f32; 3]>,
    /// Features, `width` a node.
    pub(super) features: Vec<f32>,
    /// Values per node: 5, or 8 for unsigned normals.
    pub(super) width: usize,
    /// Whether the signs of the normals count.
    pub(super) sides: Sides,
}

impl Nodes {
    /// The tangent plane of a node.
    pub(super) fn tangent(&self, node: u32) -> Tangent {
        let node = node as usize;
        Tangent { centre: self.centres[node], normal: self.normals[node], sides: self.sides }
    }
}

/// Points with unit normals.
#[derive(Clone, Copy)]
pub(super) struct OrientedPoints<'a> {
    pub(super) points: &'a Positions,
    /// Normal of each point.
    pub(super) normals: &'a [[f32; 3]],
    /// Whether the signs of the normals count.
    pub(super) sides: Sides,
}

/// Describes each supervoxel; planarity and scattering are multiplied by `shape_weight`. O(n).
pub(super) fn describe(
    oriented: OrientedPoints<'_>,
    supervoxels: &Partition,
    shape_weight: f64,
    monitor: &Monitor,
) -> Result<Nodes> {
    let sides = oriented.sides;
    let parts = map_ordered(supervoxels.len().div_ceil(BLOCK), monitor, |block| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(supervoxels.len());
        Ok(range.map(|s| one(oriented, supervoxels.members(s))).collect::<Vec<_>>())
    })?;
    let mut nodes = Nodes { width: if sides == Sides::Signed { 5 } else { 8 }, sides, ..Nodes::default() };
    for (centre, normal, [planarity, scattering]) in parts.into_iter().flatten() {
        nodes.centres.push(centre);
        nodes.normals.push(normal);
        match sides {
            Sides::Signed => nodes.features.extend(normal),
            Sides::Unsigned => nodes.features.extend(square(normal)),
        }
        nodes.features.extend([planarity, scattering].map(|v| (v * shape_weight) as f32));
    }
    Ok(nodes)
}

/// n nᵀ as six numbers whose Euclidean distance is the Frobenius norm of the difference.
fn square([x, y, z]: [f32; 3]) -> [f32; 6] {
    let root = std::f32::consts::SQRT_2;
    [x * x, y * y, z * z, root * x * y, root * x * z, root * y * z]
}

/// Centre, mean normal, planarity and scattering of a supervoxel.
fn one(oriented: OrientedPoints<'_>, members: &[u32]) -> ([f32; 3], [f32; 3], [f64; 2]) {
    let OrientedPoints { points, normals: directions, sides } = oriented;
    let place = |i: u32| [&points.x, &points.y, &points.z].map(|axis| f64::from(axis[i as usize]));
    let first = members.first().copied().unwrap_or(0);
    let (base, own) = (place(first), directions[first as usize]);
    let (mut moments, mut sum) = (Moments::default(), own.map(|_| 0f64));
    for &i in members {
        let (at, n) = (place(i), directions[i as usize]);
        moments.add([at[0] - base[0], at[1] - base[1], at[2] - base[2]]);
        let turned = sides == Sides::Unsigned && n[0] * own[0] + n[1] * own[1] + n[2] * own[2] < 0.0;
        let side = if turned { -1.0 } else { 1.0 };
        (0..3).for_each(|a| sum[a] += side * f64::from(n[a]));
    }
    let mean = moments.mean();
    let centre = [0, 1, 2].map(|a| (base[a] + mean[a]) as f32);
    let length = sum.iter().map(|s| s * s).sum::<f64>().sqrt();
    let normal = if length > NO_DIRECTION * members.len() as f64 { sum.map(|s| (s / length) as f32) } else { own };
    let shape = Shape::of::<Exact>(eigenvalues(&moments.covariance()));
    (centre, normal, [shape.planarity, shape.scattering])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cross() -> (Positions, Vec<[f32; 3]>) {
        let rows =
            [[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.5], [0.0, 0.0, -0.5]];
        (
            rows.iter().map(|row: &[f32; 3]| row.map(|v| v + 7.0)).collect(),
            vec![[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.0, -0.6, 0.8], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]],
        )
    }

    #[test]
    fn features_are_the_mean_normal_planarity_and_scattering() {
        let (points, mut normals) = cross();
        let whole = Partition::from_labels(&[0; 6]).unwrap();
        let run = |normals: &[[f32; 3]], sides, weight| {
            let oriented = OrientedPoints { points: &points, normals, sides };
            describe(oriented, &whole, weight, &Monitor::default()).unwrap()
        };
        let nodes = run(&normals, Sides::Signed, 1.0);
        assert_eq!((nodes.centres[0], nodes.width), ([7.0; 3], 5));
        // λ = 8/6, 2/6, 0.5/6.
        for (found, expected) in nodes.features.iter().zip([0.0, 0.0, 1.0, 0.1875, 0.0625]) {
            assert!((found - expected).abs() < 1e-6, "{:?}", nodes.features);
        }
        normals[1] = normals[1].map(|c| -c);
        let unsigned = run(&normals, Sides::Unsigned, 2.0);
        for (found, expected) in unsigned.features.iter().zip([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.375, 0.125]) {
            assert!((found - expected).abs() < 1e-6, "{:?}", unsigned.features);
        }
    }

    #[test]
    fn distances_of_squares_are_those_of_the_matrices() {
        let (n, m) = ([0.6f32, 0.0, 0.8], [0.0f32, 0.28, -0.96]);
        let frobenius: f32 = (0..9).map(|k| (n[k / 3] * n[k % 3] - m[k / 3] * m[k % 3]).powi(2)).sum();
        let entries: f32 = square(n).iter().zip(square(m)).map(|(a, b)| (a - b).powi(2)).sum();
        assert!((frobenius - entries).abs() < 1e-6);
    }

    #[test]
    fn normals_that_cancel_out_leave_that_of_the_first_point() {
        let (points, mut normals) = cross();
        normals.iter_mut().enumerate().for_each(|(i, n)| *n = [0.0, 0.0, if i % 2 == 0 { 1.0 } else { -1.0 }]);
        let whole = Partition::from_labels(&[0; 6]).unwrap();
        let oriented = OrientedPoints { points: &points, normals: &normals, sides: Sides::Signed };
        let nodes = describe(oriented, &whole, 1.0, &Monitor::default()).unwrap();
        assert_eq!(nodes.normals[0], [0.0, 0.0, 1.0]);
    }
}
