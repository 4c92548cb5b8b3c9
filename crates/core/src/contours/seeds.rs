//! Seed points of contours: the most likely points of voxels, thinned by a non-maxima suppression on the voxel grid.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.5.1, figure 4.5.

use super::likely::{Cells, Likely, Winner, around};
use super::params::{SeedParams, Suppression};
use crate::error::Result;
use crate::parallel::{Monitor, map_watched};

/// The seed points, ascending.
///
/// Of each voxel the most likely point is taken if its likelihood reaches the threshold. It is dropped if one of those
/// of the 26 voxels around is more likely and either it does not lie along the tangent there, or it does but is nearer
/// than `spacing` voxels. Of equally likely points the first counts as the more likely one. O(n + m log m) for m points
/// above the threshold; memory O(m).
///
/// # Errors
/// If lengths do not fit, a value is not finite or not a likelihood, a parameter is outside its range, the voxels are
/// too small for the extent, or the work was cancelled.
pub fn seeds(likely: &Likely, params: &SeedParams, monitor: &Monitor) -> Result<Vec<u32>> {
    params.validate()?;
    likely.check(monitor)?;
    let winners = Cells { size: params.voxel, least: params.threshold }.winners(likely, monitor)?;
    let test = Test {
        likely,
        winners: &winners,
        least_cosine: params.tangent_angle.to_radians().cos(),
        least_distance: params.spacing * params.voxel,
    };
    let kept = match params.suppression {
        Suppression::All => map_watched(winners.len(), monitor, |at| !test.suppressed(at, |_| true))?,
        Suppression::Survivors => test.survivors(monitor)?,
    };
    let mut seeds: Vec<u32> = winners.iter().zip(kept).filter(|(_, kept)| *kept).map(|(w, _)| w.point).collect();
    seeds.sort_unstable();
    Ok(seeds)
}

struct Test<'a> {
    likely: &'a Likely,
    winners: &'a [Winner],
    /// Cosine of the largest angle from a tangent.
    least_cosine: f64,
    /// Metres.
    least_distance: f64,
}

impl Test<'_> {
    /// Whether one of the winners that `act` suppresses this one.
    fn suppressed(&self, at: usize, act: impl Fn(usize) -> bool) -> bool {
        let own = &self.winners[at];
        around(self.winners, own.cell).any(|other| act(other) && self.suppresses(&self.winners[other], own))
    }

    fn suppresses(&self, other: &Winner, own: &Winner) -> bool {
        if (other.rank, other.point) >= (own.rank, own.point) {
            return false;
        }
        let [from, to] = [other, own].map(|w| self.likely.positions.xyz(w.point as usize).map(f64::from));
        let tangent = self.likely.tangents[other.point as usize].map(f64::from);
        let apart = [0, 1, 2].map(|i| to[i] - from[i]);
        let [distance, length] = [apart, tangent].map(|v| v.iter().map(|c| c * c).sum::<f64>().sqrt());
        let along = apart.iter().zip(tangent).map(|(a, t)| a * t).sum::<f64>().abs();
        // Points at one position, and points without tangent, lie along nothing.
        let follows = distance * length > 0.0 && along >= self.least_cosine * distance * length * (1.0 - 1e-9);
        !follows || distance < self.least_distance
    }

    /// Which winners remain if only those that remain suppress others, from the most likely one on.
    fn survivors(&self, monitor: &Monitor) -> Result<Vec<bool>> {
        let mut order: Vec<usize> = (0..self.winners.len()).collect();
        order.sort_unstable_by_key(|&at| (self.winners[at].rank, self.winners[at].point));
        let mut kept = vec![false; order.len()];
        for (count, at) in order.into_iter().enumerate() {
            if count % 4096 == 0 {
                monitor.check()?;
            }
            kept[at] = !self.suppressed(at, |other| kept[other]);
        }
        Ok(kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Positions;
    use crate::random::stream;

    fn of(rows: &[[f32; 3]], likelihoods: &[f32]) -> Likely {
        Likely {
            positions: Positions::from_rows(rows),
            likelihoods: likelihoods.to_vec(),
            tangents: vec![[1.0, 0.0, 0.0]; rows.len()],
        }
    }

    fn found(likely: &Likely, params: &SeedParams) -> Vec<u32> {
        seeds(likely, params, &Monitor::default()).unwrap()
    }

    #[test]
    fn neighbours_along_the_contour_stay_and_those_beside_it_go() {
        let rows = [[0.05, 0.05, 0.05], [0.15, 0.05, 0.05], [0.05, 0.15, 0.05], [0.05, 0.05, 0.16], [0.15, 0.15, 0.05]];
        let params = SeedParams { suppression: Suppression::All, ..SeedParams::default() };
        assert_eq!(found(&of(&rows, &[0.9, 0.8, 0.7, 0.6, 0.95]), &params), [4]);
        assert_eq!(found(&of(&rows[..4], &[0.9, 0.8, 0.7, 0.6]), &params), [0, 1]);
        // Of equal points the first one is kept.
        assert_eq!(found(&of(&[rows[0], rows[2]], &[0.7, 0.7]), &params), [0]);
        // Along the contour, but too near.
        let near = [[0.08, 0.05, 0.05], [0.12, 0.05, 0.05]];
        assert_eq!(found(&of(&near, &[0.9, 0.8]), &params), [0]);
        assert_eq!(found(&of(&near, &[0.9, 0.8]), &SeedParams { spacing: 0.3, ..params.clone() }), [0, 1]);
        assert!(found(&of(&rows, &[0.4; 5]), &params).is_empty());
    }

    #[test]
    fn only_survivors_suppress_if_that_is_asked_for() {
        // A chain across the tangent: the middle one is dropped, the last one then has no neighbour.
        let likely = of(&[[0.05, 0.05, 0.05], [0.05, 0.15, 0.05], [0.05, 0.25, 0.05]], &[0.9, 0.8, 0.7]);
        assert_eq!(found(&likely, &SeedParams::default()), [0, 2]);
        let all = SeedParams { suppression: Suppression::All, ..SeedParams::default() };
        assert_eq!(found(&likely, &all), [0]);
    }

    #[test]
    fn every_voxel_has_at_most_one_seed_for_any_number_of_threads() {
        let mut random = stream(5, 5);
        let rows: Vec<[f32; 3]> = (0..20_000).map(|_| [3.0, 3.0, 0.1].map(|e| (random.uniform() * e) as f32)).collect();
        let likelihoods: Vec<f32> = rows.iter().map(|_| random.uniform() as f32).collect();
        let likely = of(&rows, &likelihoods);
        let with = |n: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| found(&likely, &SeedParams::default()))
        };
        let one = with(1);
        assert_eq!(one, with(3));
        let mut cells: Vec<[i32; 3]> =
            one.iter().map(|&i| rows[i as usize].map(|v| (f64::from(v) / 0.1) as i32)).collect();
        cells.sort_unstable();
        cells.dedup();
        assert!(cells.len() == one.len() && one.iter().all(|&i| likelihoods[i as usize] >= 0.5) && !one.is_empty());
    }

    #[test]
    fn nothing_one_point_and_copies_of_it() {
        assert!(found(&Likely::default(), &SeedParams::default()).is_empty());
        assert_eq!(found(&of(&[[0.0; 3]], &[0.5]), &SeedParams::default()), [0]);
        assert_eq!(found(&of(&[[1.0; 3]; 50], &[0.9; 50]), &SeedParams::default()), [0]);
    }
}
