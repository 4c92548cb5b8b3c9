//! A tight box around points, in any orientation.

use crate::linalg::Sym3;
use parry2d_f64::math::Vector;
use parry2d_f64::transformation::convex_hull;

/// A box of any orientation.
#[derive(Clone, Debug, PartialEq)]
pub struct OrientedBox {
    /// Centre, in metres.
    pub centre: [f64; 3],
    /// Three orthonormal directions, in the order of falling side length.
    pub axes: [[f64; 3]; 3],
    /// Length of the side along each axis, in metres, falling.
    pub sides: [f64; 3],
}

impl OrientedBox {
    /// Product of the sides, in cubic metres.
    pub fn volume(&self) -> f64 {
        self.sides.iter().product()
    }

    fn half_surface(&self) -> f64 {
        let [a, b, c] = self.sides;
        a * b + b * c + c * a
    }

    /// The one of smaller surface of two boxes: upright with a side along an edge of the convex hull in plan, or along
    /// the principal directions of the points. O(n log n).
    pub(super) fn tightest(points: &[[f64; 3]], scatter: &Sym3) -> Self {
        let [x, y] = along_the_hull(points).unwrap_or([1.0, 0.0]);
        let upright = Self::around(points, [[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]]);
        let principal = Self::around(points, scatter.eigen().vectors);
        if principal.half_surface() < upright.half_surface() { principal } else { upright }
    }

    /// The smallest box around the points in the given orthonormal directions.
    fn around(points: &[[f64; 3]], axes: [[f64; 3]; 3]) -> Self {
        let spans = axes.map(|axis| span(points.iter().map(|p| dot(*p, axis))));
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| (spans[b][1] - spans[b][0]).total_cmp(&(spans[a][1] - spans[a][0])));
        let middle = spans.map(|[low, high]| (low + high) / 2.0);
        let centre = [0, 1, 2].map(|c| (0..3).map(|a| middle[a] * axes[a][c]).sum());
        Self { centre, axes: order.map(|a| axes[a]), sides: order.map(|a| spans[a][1] - spans[a][0]) }
    }
}

/// Direction in plan of the upright box of least surface; `None` if all points coincide in plan or a number is not
/// finite.
fn along_the_hull(points: &[[f64; 3]]) -> Option<[f64; 2]> {
    if points.iter().flatten().any(|v| !v.is_finite()) {
        return None;
    }
    let [x, y, z] = [0, 1, 2].map(|a| span(points.iter().map(|p| p[a])));
    let sides = [x, y, z].map(|[low, high]| high - low);
    // There is no hull of fewer than two different positions.
    if sides[0].max(sides[1]) <= 0.0 {
        return None;
    }
    let plan: Vec<Vector> = points.iter().map(|p| Vector::new(p[0] - x[0], p[1] - y[0])).collect();
    calipers(&convex_hull(&plan), sides[2])
}

/// Of the upright boxes of this height with a side along an edge of the hull (anticlockwise), the direction of the one
/// of least surface. No other upright box has less: with sides a, b and height h half the surface is (a + h) (b + h) -
/// h^2, and a and b are concave between two edges. Rotating calipers (G. Toussaint, *Solving geometric problems with
/// the rotating calipers*, 1983): the farthest corners advance with the edges. O(corners).
fn calipers(hull: &[Vector], height: f64) -> Option<[f64; 2]> {
    let n = hull.len();
    let at = |i: usize| hull[i % n];
    let mut farthest = [1; 3];
    let mut best: Option<(f64, [f64; 2])> = None;
    for i in 0..n {
        let edge = at(i + 1) - at(i);
        let length = edge.length();
        if length <= 0.0 {
            continue;
        }
        let along = edge / length;
        let across = Vector::new(-along.y, along.x);
        let mut first = i + 1;
        for (corner, direction) in farthest.iter_mut().zip([along, across, -along]) {
            *corner = first.max(*corner);
            while *corner < i + n && direction.dot(at(*corner + 1) - at(*corner)) > 0.0 {
                *corner += 1;
            }
            first = *corner;
        }
        let [east, north, west] = farthest.map(at);
        let (a, b) = (along.dot(east - west), across.dot(north - at(i)));
        let half_surface = a * b + height * (a + b);
        if best.is_none_or(|(least, _)| half_surface < least) {
            best = Some((half_surface, [along.x, along.y]));
        }
    }
    best.map(|(_, along)| along)
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Lowest and highest value.
pub(super) fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::mean;
    use crate::random::stream;

    fn tightest(points: &[[f64; 3]]) -> OrientedBox {
        OrientedBox::tightest(points, &Sym3::scatter(points, mean(points), points.len().max(1) as f64))
    }

    fn holds(found: &OrientedBox, points: &[[f64; 3]]) -> bool {
        let off = |p: &[f64; 3], a: usize| dot([0, 1, 2].map(|c| p[c] - found.centre[c]), found.axes[a]).abs();
        points.iter().all(|p| (0..3).all(|a| off(p, a) <= found.sides[a] / 2.0 + 1e-8))
    }

    #[test]
    fn no_upright_box_has_less_surface() {
        for trial in 0..60 {
            let mut random = stream(trial, 4);
            let n = 3 + random.below(60);
            // Near the origin, and so far away that rounding matters; on a lattice many positions repeat and many are
            // collinear.
            let (away, step) = ([0.0, 3e5][trial as usize % 2], [0.0, 0.25][trial as usize / 2 % 2]);
            let mut draw = |size: f64| {
                let v = random.uniform() * size;
                if step > 0.0 { (v / step).floor() * step } else { v }
            };
            let points: Vec<[f64; 3]> = (0..n).map(|_| [away + draw(5.0), away + draw(2.0), draw(1.0)]).collect();
            let found = tightest(&points);
            assert!(holds(&found, &points), "{found:?}");
            for i in 0..720 {
                let (s, c) = (f64::from(i) * std::f64::consts::FRAC_PI_2 / 720.0).sin_cos();
                let other = OrientedBox::around(&points, [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]);
                assert!(found.half_surface() <= other.half_surface() * (1.0 + 1e-9), "trial {trial} angle {i}");
            }
        }
    }

    #[test]
    fn spots_lines_and_numbers_that_are_none_do_not_stop_it() {
        let line = |n: u32, [x, y, z]: [f64; 3]| -> Vec<[f64; 3]> {
            (0..n).map(|i| [1.0 + x * f64::from(i), 2.0 + y * f64::from(i), z * f64::from(i)]).collect()
        };
        for n in 1..6 {
            for direction in [[0.0; 3], [0.0, 0.0, 0.1], [0.1, 0.3, 0.0], [1.0, 0.0, 0.0], [1e-30, 0.0, 0.0]] {
                let points = line(n, direction);
                let found = tightest(&points);
                assert!(holds(&found, &points));
                let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt() * f64::from(n - 1);
                assert!((found.sides[0] - length).abs() < 1e-9 && found.sides[1] < 1e-9, "{found:?}");
            }
        }
        tightest(&[]);
        tightest(&[[f64::NAN; 3], [0.0, f64::INFINITY, 1.0], [1.0; 3]]);
        tightest(&[[0.0, f64::NAN, 0.0], [1.0, 5.0, 3.0], [f64::NAN, 7.0, 3.0]]);
    }

    #[test]
    fn a_circle_of_many_corners_is_boxed_too() {
        let turn = |i: u32| (f64::from(i) * std::f64::consts::TAU / 20_000.0).sin_cos();
        let points: Vec<[f64; 3]> = (0..20_000).map(|i| [turn(i).0, turn(i).1, 0.0]).collect();
        let found = tightest(&points);
        assert!(holds(&found, &points) && (found.sides[0] - 2.0).abs() < 1e-6 && (found.sides[1] - 2.0).abs() < 1e-6);
    }
}
