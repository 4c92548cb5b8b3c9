//! d_proj: the length of the arc that leaves one supervoxel along its tangent plane and ends at the other.
//!
//! Li 2018, section 3.2, figure 4, gives no formula. The circle that touches the tangent plane at v_i and passes
//! through v_j has the radius ρ = c² / (2 h), where c is the chord and h the height of v_j above the plane; its arc is
//! d = 2 ρ asin(c / (2 ρ)) = c φ / sin φ with sin φ = h / c. On a plane d = c; always c ≤ d ≤ π c / 2. Exact on
//! spheres.

use super::params::{RiemannianGraphParams, Sides, Symmetry};

/// Below this angle (radians) the series of φ / sin φ is exact in `f64`.
const SMALL: f64 = 1e-3;

/// Length of the arc over a chord whose end is `height` above the tangent plane at the start; same unit.
pub(super) fn arc(chord: f64, height: f64) -> f64 {
    if chord <= 0.0 {
        return 0.0;
    }
    let sine = (height.abs() / chord).min(1.0);
    let angle = sine.asin();
    if angle < SMALL { chord * (1.0 + angle * angle / 6.0) } else { chord * angle / sine }
}

/// The tangent plane of a supervoxel.
#[derive(Clone, Copy)]
pub(super) struct Tangent {
    /// Centre, metres.
    pub(super) centre: [f32; 3],
    /// Unit normal.
    pub(super) normal: [f32; 3],
    /// Whether the sign of the normal counts.
    pub(super) sides: Sides,
}

/// d_proj of two supervoxels; symmetric.
pub(super) fn projected_distance(from: Tangent, to: Tangent, params: &RiemannianGraphParams) -> f64 {
    let (Tangent { centre: a, normal: n, sides }, Tangent { centre: b, normal: m, .. }) = (from, to);
    let between = [0, 1, 2].map(|k| f64::from(b[k]) - f64::from(a[k]));
    let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    let (n, m) = (n.map(f64::from), m.map(f64::from));
    let chord = dot(between, between).sqrt();
    let (there, back) = (arc(chord, dot(n, between)), arc(chord, dot(m, between)));
    let distance = match params.symmetry {
        Symmetry::Max => there.max(back),
        Symmetry::Min => there.min(back),
    };
    let cosine = if sides == Sides::Unsigned { dot(n, m).abs() } else { dot(n, m) };
    if params.thin_wall { distance * (2.0 - cosine).clamp(1.0, 3.0) } else { distance }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn arcs_of_a_sphere_are_exact() {
        for length in [1e-4, 0.001, 0.2, 1.4, 3.0] {
            let (radius, half) = (2.0, length / 2.0 / 2.0f64);
            let chord = 2.0 * radius * half.sin();
            let height = chord * half.sin();
            assert!((arc(chord, height) - length).abs() < 1e-12, "{length}");
        }
        let (n, m) = ([0.0f32, 0.0, 1.0], [(0.7f32).sin(), 0.0, (0.7f32).cos()]);
        let at = |normal: [f32; 3]| Tangent { centre: normal.map(|c| 2.0 * c), normal, sides: Sides::Signed };
        for symmetry in [Symmetry::Max, Symmetry::Min] {
            let params = RiemannianGraphParams { symmetry, ..Default::default() };
            assert!((projected_distance(at(n), at(m), &params) - 1.4).abs() < 1e-6);
        }
    }

    #[test]
    fn it_is_the_chord_on_a_plane_and_never_more_than_half_pi_times_it() {
        assert_eq!(arc(3.0, 0.0), 3.0);
        assert_eq!(arc(0.0, 0.0), 0.0);
        assert!((arc(2.0, 2.0) - std::f64::consts::PI).abs() < 1e-15);
        assert!((arc(1.0, 0.000_999) - arc(1.0, 0.001_001)).abs() < 1e-8);
        let mut random = stream(1, 6);
        for _ in 0..500 {
            let mut draw = || [0; 3].map(|_| random.uniform() as f32 - 0.5);
            let (a, b, n, m) = (draw(), draw(), draw(), draw());
            let unit = |v: [f32; 3]| v.map(|c| c / v.iter().map(|c| c * c).sum::<f32>().sqrt());
            let (n, m) = (unit(n), unit(m));
            let chord = (0..3).map(|k| f64::from(a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
            for symmetry in [Symmetry::Max, Symmetry::Min] {
                for (thin_wall, most) in [(false, 1.0), (true, 3.0)] {
                    let params = RiemannianGraphParams { symmetry, thin_wall, ..Default::default() };
                    for sides in [Sides::Signed, Sides::Unsigned] {
                        let at = |centre, normal| Tangent { centre, normal, sides };
                        let (from, to) = (at(a, n), at(b, m));
                        let d = projected_distance(from, to, &params);
                        assert_eq!(d, projected_distance(to, from, &params));
                        assert!(d >= chord - 1e-6 && d <= most * std::f64::consts::FRAC_PI_2 * chord + 1e-6);
                        let flipped = projected_distance(from, at(b, m.map(|c| -c)), &params);
                        assert_eq!(d == flipped, sides == Sides::Unsigned || !thin_wall);
                    }
                }
            }
        }
    }

    #[test]
    fn the_faces_of_a_thin_wall_are_apart_with_the_factor() {
        let sides = Sides::Signed;
        let front = Tangent { centre: [0.0; 3], normal: [0.0, -1.0, 0.0], sides };
        let back = Tangent { centre: [0.0, 0.1, 0.0], normal: [0.0, 1.0, 0.0], sides };
        let distance =
            |thin_wall| projected_distance(front, back, &RiemannianGraphParams { thin_wall, ..Default::default() });
        assert!((distance(false) - 0.1 * std::f64::consts::FRAC_PI_2).abs() < 1e-6);
        assert!((distance(true) - 0.3 * std::f64::consts::FRAC_PI_2).abs() < 1e-6);
    }
}
