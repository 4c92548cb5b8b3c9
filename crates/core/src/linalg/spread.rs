//! Count, mean and scatter of sets of points that grow and are joined.

use super::{Eigen3, Sym3};

/// Count, mean and scatter Σ (p − mean)(p − mean)ᵀ of a set of points. Sets are joined as in T. F. Chan, G. H. Golub,
/// R. J. LeVeque, *Algorithms for computing the sample variance*, The American Statistician 37(3), 1983,
/// doi:10.1080/00031305.1983.10483115: far from the origin too no digits are lost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spread {
    /// Number of points, or sum of their weights.
    pub(crate) count: f64,
    /// Mean of the points.
    pub(crate) mean: [f64; 3],
    scatter: Sym3,
}

impl Spread {
    /// One point.
    pub(crate) fn of(point: [f64; 3]) -> Self {
        Self::weighted(point, 1.0)
    }

    /// One point that counts as so many, 0 or more.
    pub(crate) fn weighted(point: [f64; 3], count: f64) -> Self {
        Self { count, mean: point, scatter: Sym3::default() }
    }

    /// Adds the points of another set.
    pub(crate) fn join(&mut self, other: &Self) {
        let count = self.count + other.count;
        if other.count <= 0.0 {
            return;
        }
        let apart = [0, 1, 2].map(|a| other.mean[a] - self.mean[a]);
        let (share, weight) = (other.count / count, self.count * other.count / count);
        for (a, &apart) in apart.iter().enumerate() {
            self.scatter.diagonal[a] += other.scatter.diagonal[a] + weight * apart * apart;
            self.mean[a] += share * apart;
        }
        for (i, (a, b)) in [(0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
            self.scatter.off[i] += other.scatter.off[i] + weight * apart[a] * apart[b];
        }
        self.count = count;
    }

    /// Eigenvalues and eigenvectors of the covariance, divided by the number of points.
    pub(crate) fn eigen(&self) -> Eigen3 {
        let share = if self.count > 0.0 { 1.0 / self.count } else { 1.0 };
        let Sym3 { diagonal, off } = self.scatter;
        Sym3 { diagonal: diagonal.map(|v| share * v), off: off.map(|v| share * v) }.eigen()
    }
}

#[cfg(test)]
mod tests {
    use super::super::mean;
    use super::*;
    use crate::random::stream;

    #[test]
    fn joined_sets_have_the_covariance_of_all_their_points_far_from_the_origin_too() {
        let mut random = stream(4, 4);
        let points: Vec<[f64; 3]> =
            (0..60).map(|i| [5e5, 6e6, 100.0].map(|v| v + random.uniform() * f64::from(1 + i / 20))).collect();
        let mut whole = Spread::default();
        for part in points.chunks(17) {
            let mut spread = Spread::default();
            part.iter().for_each(|p| spread.join(&Spread::of(*p)));
            whole.join(&spread);
        }
        whole.join(&Spread::default());
        let centre = mean(&points);
        let expected = Sym3::scatter(&points, centre, 60.0).eigen();
        assert_eq!(whole.count, 60.0);
        for (a, centre) in centre.iter().enumerate() {
            assert!((whole.mean[a] - centre).abs() < 1e-8);
            assert!((whole.eigen().values[a] - expected.values[a]).abs() < 1e-8 * expected.values[0]);
        }
    }
}
