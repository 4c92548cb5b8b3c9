//! Smoothed paths, and straight lines through their points.

use super::super::polylines::distance;
use std::ops::Range;

/// A position or a direction, metres.
pub(super) type Vector = [f64; 3];

/// Least number of points of a straight line.
const POINTS: usize = 4;

/// The product of a symmetric matrix and a vector.
pub(super) fn times(&[a, b, c, d, e, f]: &[f64; 6], [x, y, z]: Vector) -> Vector {
    [a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z]
}

/// A straight line.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) point: Vector,
    /// Unit vector.
    pub(super) direction: Vector,
}

impl Axis {
    /// Distance of a position from the line, metres.
    pub(super) fn distance(&self, at: [f32; 3]) -> f64 {
        let apart = [0, 1, 2].map(|i| f64::from(at[i]) - self.point[i]);
        let along: f64 = apart.iter().zip(self.direction).map(|(a, d)| a * d).sum();
        apart.iter().zip(self.direction).map(|(a, d)| (a - along * d).powi(2)).sum::<f64>().sqrt()
    }
}

/// The nodes of a line.
#[derive(Debug)]
pub(super) struct Path {
    pub(super) places: Vec<[f32; 3]>,
    /// Squares of the likelihoods.
    pub(super) weights: Vec<f64>,
}

impl Path {
    /// Weighted means over some length to either side, the same to both, so that the ends stay.
    pub(super) fn smoothed(&self, length: f64) -> Vec<[f32; 3]> {
        if length <= 0.0 {
            return self.places.clone();
        }
        let mut along = vec![0.0];
        for w in self.places.windows(2) {
            along.push(along.last().copied().unwrap_or(0.0) + distance(w[0], w[1]));
        }
        let end = along.last().copied().unwrap_or(0.0);
        let mean = |at: usize| {
            let here = along[at];
            let half = length.min(here).min(end - here);
            let first = along.partition_point(|&v| v < here - half - 1e-9);
            let last = along.partition_point(|&v| v <= here + half + 1e-9);
            let inner = 0 < at && at + 1 < along.len();
            let (sum, total) = self.mean(first..last);
            if inner && total > 0.0 { sum.map(|v| v as f32) } else { self.places[at] }
        };
        (0..self.places.len()).map(mean).collect()
    }

    /// Weighted mean of some nodes, and the sum of their weights.
    fn mean(&self, range: Range<usize>) -> (Vector, f64) {
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for (place, weight) in self.places[range.clone()].iter().zip(&self.weights[range]) {
            sum.iter_mut().zip(place).for_each(|(sum, &v)| *sum += weight * f64::from(v));
            total += weight;
        }
        (sum.map(|v| v / total), total)
    }

    /// The line with the least weighted squared distances from some nodes, if there are enough and these are small.
    pub(super) fn axis(&self, range: Range<usize>, residual: f64) -> Option<Axis> {
        let (places, weights) = (&self.places[range.clone()], &self.weights[range.clone()]);
        let (point, total) = self.mean(range);
        let (Some(first), Some(last)) = (places.first(), places.last()) else { return None };
        if places.len() < POINTS || total <= 0.0 {
            return None;
        }
        let mut spread = [0.0; 6];
        for (place, weight) in places.iter().zip(weights) {
            let [x, y, z] = [0, 1, 2].map(|i| f64::from(place[i]) - point[i]);
            spread.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]).for_each(|(sum, v)| *sum += weight * v);
        }
        // Repeated products turn the chord into the direction of the largest spread.
        let mut direction = unit([0, 1, 2].map(|i| f64::from(last[i]) - f64::from(first[i])))?;
        for _ in 0..32 {
            direction = unit(times(&spread, direction))?;
        }
        let along: f64 = times(&spread, direction).iter().zip(direction).map(|(a, b)| a * b).sum();
        let across = (spread[0] + spread[3] + spread[5] - along) / total;
        (across <= residual * residual).then_some(Axis { point, direction })
    }
}

fn unit(v: Vector) -> Option<Vector> {
    let norm = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    (norm > 0.0 && norm.is_finite()).then(|| v.map(|c| c / norm))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_need_points_that_are_near_them() {
        let of = |places: Vec<[f32; 3]>| Path { weights: vec![0.25; places.len()], places };
        let line = of((0..9).map(|i| [i as f32, 1.0, 2.0 * i as f32]).collect());
        let axis = line.axis(0..9, 1e-6).unwrap();
        assert!((axis.direction[2] / axis.direction[0] - 2.0).abs() < 1e-9 && axis.direction[1].abs() < 1e-12);
        assert!(line.axis(0..3, 1.0).is_none());
        let bent = of((0..9).map(|i| [i as f32, (i * i) as f32 * 0.1, 0.0]).collect());
        assert!(bent.axis(0..9, 0.1).is_none() && bent.axis(0..9, 1.0).is_some());
        assert!(of(vec![[1.0; 3]; 9]).axis(0..9, 1.0).is_none());
        // Only likely points count.
        let mut aside = line;
        (aside.places[4][1], aside.weights[4]) = (5.0, 0.0);
        assert!(aside.axis(0..9, 1e-6).is_some());
    }

    #[test]
    fn smoothing_keeps_the_ends_and_straight_lines() {
        let straight: Vec<[f32; 3]> = (0..40).map(|i| [i as f32 * 0.03125, 1.0, 2.0]).collect();
        let path = Path { places: straight.clone(), weights: vec![0.5; 40] };
        for (a, b) in path.smoothed(0.2).iter().zip(&straight) {
            assert!(distance(*a, *b) < 1e-6);
        }
        let zigzag: Vec<[f32; 3]> = (0..40).map(|i| [i as f32 * 0.03, (i % 2) as f32 * 0.04, 0.0]).collect();
        let path = Path { places: zigzag.clone(), weights: vec![0.5; 40] };
        let smooth = path.smoothed(0.2);
        assert!(smooth[0] == zigzag[0] && smooth[39] == zigzag[39]);
        assert!(smooth[8..32].iter().all(|v| (v[1] - 0.02).abs() < 0.01));
        assert_eq!(path.smoothed(0.0), zigzag);
        assert!(Path { places: vec![], weights: vec![] }.smoothed(0.2).is_empty());
    }
}
