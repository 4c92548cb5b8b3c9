//! Simplification of closed lines.

use super::polygons::{Polygon, Ring, crossing};
use crate::terrain::alpha_shape::Place;

/// Halvings of the tolerance before a polygon is left as it is.
const TRIALS: usize = 6;

/// The polygon with fewer corners; every corner of the old one is within `tolerance` of the new one.
///
/// D. H. Douglas, T. K. Peucker, *Algorithms for the reduction of the number of points required to represent a digitized
/// line or its caricature*, Cartographica 10, 1973, on the two halves of each ring. If sides would cross or a ring would
/// vanish, the tolerance of this polygon is halved, up to six times; then it stays as it is. O(corners²) at worst.
pub(super) fn simplified(polygon: &Polygon, tolerance: f64) -> Polygon {
    let tolerances = (0..TRIALS).map(|trial| tolerance / f64::from(1 << trial));
    let trials = tolerances
        .map(|tolerance| Polygon { rings: polygon.rings.iter().map(|ring| thinned(ring, tolerance)).collect() });
    let sound = |p: &Polygon| p.rings.iter().all(|ring| ring.len() > 2) && p.area() > 0.0 && !crossing(&p.rings);
    trials.into_iter().find(sound).unwrap_or_else(|| polygon.clone())
}

/// Douglas-Peucker on the two halves of a ring between its first corner's farthest corner and the one farthest from that.
fn thinned(ring: &Ring, tolerance: f64) -> Ring {
    let farthest = |from: usize| {
        let apart = |i: usize| (ring[i][0] - ring[from][0]).hypot(ring[i][1] - ring[from][1]);
        (0..ring.len()).max_by(|&i, &j| apart(i).total_cmp(&apart(j))).unwrap_or(0)
    };
    if ring.len() < 4 {
        return ring.clone();
    }
    let first = farthest(0);
    let turned: Ring = (0..=ring.len()).map(|i| ring[(first + i) % ring.len()]).collect();
    let second = (farthest(first) + ring.len() - first) % ring.len();
    let mut kept = vec![false; turned.len()];
    (kept[0], kept[second]) = (true, true);
    let mut open = vec![[0, second], [second, ring.len()]];
    while let Some([from, to]) = open.pop() {
        let away = |i: &usize| distance(turned[*i], [turned[from], turned[to]]);
        let Some(worst) = (from + 1..to).max_by(|i, j| away(i).total_cmp(&away(j))) else { continue };
        if away(&worst) > tolerance {
            kept[worst] = true;
            open.extend([[from, worst], [worst, to]]);
        }
    }
    turned.into_iter().zip(kept).take(ring.len()).filter(|&(_, kept)| kept).map(|(at, _)| at).collect()
}

/// Distance of a position from a segment.
fn distance(at: Place, [a, b]: [Place; 2]) -> f64 {
    let ([ux, uy], [vx, vy]) = ([b[0] - a[0], b[1] - a[1]], [at[0] - a[0], at[1] - a[1]]);
    let length = ux * ux + uy * uy;
    let share = if length > 0.0 { ((vx * ux + vy * uy) / length).clamp(0.0, 1.0) } else { 0.0 };
    (vx - share * ux).hypot(vy - share * uy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// The border of a rectangle with corners every 0.1 m, moved by up to `noise`.
    fn rectangle(noise: f64) -> Ring {
        let mut s = stream(5, 5);
        let mut ring = Vec::new();
        for (from, by, steps) in [([0.0, 0.0], [0.1, 0.0], 120), ([12.0, 0.0], [0.0, 0.1], 80)] {
            ring.extend((0..steps).map(|i| [from[0] + by[0] * f64::from(i), from[1] + by[1] * f64::from(i)]));
        }
        for (from, by, steps) in [([12.0, 8.0], [-0.1, 0.0], 120), ([0.0, 8.0], [0.0, -0.1], 80)] {
            ring.extend((0..steps).map(|i| [from[0] + by[0] * f64::from(i), from[1] + by[1] * f64::from(i)]));
        }
        ring.iter_mut().flatten().for_each(|v| *v += noise * (s.uniform() - 0.5));
        ring
    }

    #[test]
    fn a_rectangle_keeps_its_four_corners() {
        let exact = simplified(&Polygon { rings: vec![rectangle(0.0)] }, 0.3);
        assert_eq!(exact.rings[0].len(), 4);
        assert!((exact.area() - 96.0).abs() < 1e-9);
        let noisy = simplified(&Polygon { rings: vec![rectangle(0.2)] }, 0.3);
        assert!(noisy.rings[0].len() < 10 && (noisy.area() - 96.0).abs() < 4.0, "{noisy:?}");
    }

    #[test]
    fn no_corner_is_farther_away_than_the_tolerance() {
        let mut s = stream(5, 6);
        let corner =
            |i: i32, radius: f64| [f64::from(i).to_radians().cos() * radius, f64::from(i).to_radians().sin() * radius];
        let ring: Ring = (0..360).map(|i| corner(i, 20.0 + 3.0 * s.uniform())).collect();
        for tolerance in [0.1, 1.0, 2.5] {
            let found = simplified(&Polygon { rings: vec![ring.clone()] }, tolerance);
            let new = &found.rings[0];
            let sides: Vec<[Place; 2]> = (0..new.len()).map(|i| [new[i], new[(i + 1) % new.len()]]).collect();
            let away = |&at: &Place| sides.iter().map(|&side| distance(at, side)).fold(f64::INFINITY, f64::min);
            assert!(ring.iter().map(away).fold(0.0, f64::max) <= tolerance && new.len() < ring.len());
            assert!(!crossing(&found.rings));
        }
    }
}
