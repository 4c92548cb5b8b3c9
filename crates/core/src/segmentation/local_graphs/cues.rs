//! Similarity of two supervoxels: distance, features and the connection of their surfaces.

use super::params::{LocalGraphParams, SurfaceRule};
use crate::segmentation::SupervoxelShape;
use std::f64::consts::PI;

/// The sigmoid threshold of Stein et al. 2014: height in degrees, slope in 1/degree, midpoint in degrees.
const SIGMOID: [f64; 3] = [60.0, 0.25, 25.0];
/// A cross product of two unit normals shorter than this counts as zero: the normals are parallel.
const PARALLEL: f64 = 1e-6;

/// The surface between two supervoxels i and j: angles in radians, d from the centroid of i to that of j.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Surfaces {
    /// ∠(n_i, d).
    first: f64,
    /// ∠(n_j, d).
    second: f64,
    /// ∠(n_i, n_j).
    between: f64,
    /// Angle of d and the line along n_i × n_j, 0..=π/2; π/2 for parallel normals.
    singular: f64,
}

impl Surfaces {
    /// The angles between two supervoxels at different places.
    fn new(i: &SupervoxelShape, j: &SupervoxelShape) -> Self {
        let d = unit([0, 1, 2].map(|a| f64::from(j.centroid[a]) - f64::from(i.centroid[a])));
        let (n, m) = (unit(i.normal.map(f64::from)), unit(j.normal.map(f64::from)));
        let cross = [n[1] * m[2] - n[2] * m[1], n[2] * m[0] - n[0] * m[2], n[0] * m[1] - n[1] * m[0]];
        let long = dot(cross, cross).sqrt();
        let singular = if long < PARALLEL { PI / 2.0 } else { (dot(cross, d).abs() / long).min(1.0).acos() };
        // The arc tangent stays accurate where the normals are nearly parallel.
        Self { first: angle(n, d), second: angle(m, d), between: long.atan2(dot(n, m)), singular }
    }

    /// True if both supervoxels belong to one continuous surface.
    fn connected(&self, params: &LocalGraphParams) -> bool {
        let turn = self.first - self.second;
        let [height, slope, middle] = SIGMOID;
        let sigmoid = height.to_radians() / (1.0 + (-slope * (self.between.to_degrees() - middle)).exp());
        match params.surface {
            SurfaceRule::Stein => {
                let flat = self.between < params.concavity_deg.to_radians();
                self.singular >= sigmoid && (turn >= 0.0 || flat)
            }
            SurfaceRule::Paper => turn > -sigmoid,
        }
    }

    /// (D^c)², radians² (Eq. 2).
    fn squared_distance(&self, params: &LocalGraphParams) -> f64 {
        let turn = (self.first - self.second).powi(2);
        turn + if self.connected(params) { (PI - self.first - self.second).powi(2) } else { PI * PI }
    }
}

/// The squared distances (D^p)², (D^s)², (D^c)² of two supervoxels: metres², no unit, radians².
pub(super) fn squared_distances(i: &SupervoxelShape, j: &SupervoxelShape, params: &LocalGraphParams) -> [f64; 3] {
    let place: f64 = (0..3).map(|a| (f64::from(i.centroid[a]) - f64::from(j.centroid[a])).powi(2)).sum();
    let features = |s: &SupervoxelShape| [s.linearity, s.planarity, s.scattering, s.change_of_curvature].map(f64::from);
    let feature: f64 = features(i).iter().zip(features(j)).map(|(a, b)| (a - b).powi(2)).sum();
    // Two centroids at one place define no direction d: only the angle between the normals is left.
    let surface = if place > 0.0 {
        Surfaces::new(i, j).squared_distance(params)
    } else {
        angle(i.normal.map(f64::from), j.normal.map(f64::from)).powi(2)
    };
    [place, feature, surface]
}

/// The weight of an edge (Eq. 4): Π exp(−D²/(2λ²)), in (0, 1] up to underflow.
pub(super) fn weight([place, feature, surface]: [f64; 3], size: f64, params: &LocalGraphParams) -> f64 {
    let term = |squared: f64, scale: f64| squared / (2.0 * scale * scale);
    let sum = term(place, params.distance_scale * size)
        + term(feature, params.feature_scale)
        + term(surface, params.surface_scale);
    (-sum).exp()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let long = dot(v, v).sqrt();
    if long > 0.0 { v.map(|x| x / long) } else { v }
}

/// Angle of two unit vectors, 0..=π.
fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    dot(a, b).clamp(-1.0, 1.0).acos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn shape(centroid: [f64; 3], normal: [f64; 3]) -> SupervoxelShape {
        SupervoxelShape {
            centroid: centroid.map(|v| v as f32),
            normal: unit(normal).map(|v| v as f32),
            ..SupervoxelShape::default()
        }
    }

    /// Two slopes that meet at x = 0, normals turned by ±half the angle towards or away from each other.
    fn ridge(beta: f64) -> [SupervoxelShape; 2] {
        let (s, c) = (beta / 2.0).sin_cos();
        [shape([-1.0, 0.0, 0.0], [-s, 0.0, c]), shape([1.0, 0.0, 0.0], [s, 0.0, c])]
    }

    fn surface([i, j]: [SupervoxelShape; 2], params: &LocalGraphParams) -> f64 {
        squared_distances(&i, &j, params)[2]
    }

    #[test]
    fn closed_cases_of_the_surface_cue() {
        let params = LocalGraphParams::default();
        assert!(surface(ridge(0.0), &params) < 1e-12);
        for beta in [0.1, 0.5, 1.0, 2.0] {
            assert!((surface(ridge(beta), &params) - beta * beta).abs() < 1e-5, "ridge {beta}");
        }
        for beta in [0.3, 0.5, 1.0, 2.0] {
            let expected = beta * beta + PI * PI;
            assert!((surface(ridge(-beta), &params) - expected).abs() < 1e-5, "valley {beta}");
        }
        for alpha in [0.4, 0.8, 1.2, 1.6f64] {
            let step = [shape([0.0; 3], [0.0, 0.0, 1.0]), shape([alpha.sin(), 0.0, alpha.cos()], [0.0, 0.0, 1.0])];
            assert!((surface(step, &params) - (PI - 2.0 * alpha).powi(2)).abs() < 1e-5, "step {alpha}");
        }
    }

    #[test]
    fn a_ridge_and_a_cube_edge_are_convex_a_room_corner_and_a_single_spot_are_not() {
        let params = LocalGraphParams::default();
        let joined = |[i, j]: [SupervoxelShape; 2]| Surfaces::new(&i, &j).connected(&params);
        assert!(joined(ridge(1.0)) && joined(ridge(PI / 2.0)) && joined(ridge(0.0)));
        assert!(!joined(ridge(-PI / 2.0)) && !joined(ridge(-0.3)));
        assert!(joined(ridge(-0.1)), "flat valleys count as flat: 5.7 degrees");
        // Convex: two faces of a cube seen from outside. Concave: floor and wall of a room seen from inside.
        let cube = [shape([0.5, 0.5, 1.0], [0.0, 0.0, 1.0]), shape([1.0, 0.5, 0.5], [1.0, 0.0, 0.0])];
        let room = [shape([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]), shape([1.0, 0.5, 0.5], [-1.0, 0.0, 0.0])];
        assert!(joined(cube) && !joined(room));
        // d runs along the line in which the planes meet: the supervoxels touch in a single spot.
        let spot = [shape([0.0; 3], [0.0, 0.6, 0.8]), shape([1.0, 0.0, 0.0], [0.0, -0.6, 0.8])];
        assert!(!joined(spot));
    }

    #[test]
    fn the_printed_rule_accepts_concave_edges_from_23_to_60_degrees_only() {
        let params = LocalGraphParams::paper();
        let joined = |deg: f64| {
            let [i, j] = ridge(-deg.to_radians());
            Surfaces::new(&i, &j).connected(&params)
        };
        for (deg, expected) in [(0.05, true), (0.3, false), (10.0, false), (22.5, false), (23.5, true), (59.0, true)] {
            assert_eq!(joined(deg), expected, "{deg}");
        }
        assert!(!joined(61.0) && !joined(90.0));
    }

    #[test]
    fn weights_are_symmetric_and_fall_with_each_distance() {
        let mut s = stream(31, 0);
        let mut number = || s.uniform() * 2.0 - 1.0;
        let mut shapes = Vec::new();
        for _ in 0..60 {
            let mut one = shape([number(), number(), number()], [number(), number(), number()]);
            one.linearity = number().abs() as f32;
            one.planarity = number().abs() as f32;
            shapes.push(one);
        }
        for params in [LocalGraphParams::default(), LocalGraphParams::paper()] {
            for (i, j) in shapes.iter().flat_map(|i| shapes.iter().map(move |j| (i, j))) {
                let d = squared_distances(i, j, &params);
                let w = weight(d, 1.2, &params);
                assert!(w > 0.0 && w <= 1.0);
                assert!((w - weight(squared_distances(j, i, &params), 1.2, &params)).abs() < 1e-9);
                for a in 0..3 {
                    let mut more = d;
                    more[a] += 0.1;
                    assert!(weight(more, 1.2, &params) < w);
                }
            }
        }
        assert_eq!(weight([0.0; 3], 1.2, &LocalGraphParams::default()), 1.0);
    }
}
