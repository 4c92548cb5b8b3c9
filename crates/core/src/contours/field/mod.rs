//! The random field that chooses contours among overlapping candidates.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.5.2, equations 4.7
//! and 4.8: every candidate is a variable, and a contour without a continuation at one of its ends, or at both, costs
//! more. Beyond the source, two candidates continue each other at a seed only if they leave it at some angle to each
//! other, so that candidates that overlap do not; and a constant cost (`bias`), positive or negative, can be added to
//! every contour.

mod exhaustive;
mod icm;
mod state;

pub use exhaustive::exhaustive;
pub use icm::iterated_modes;

use super::linking::Candidate;
use super::params::FieldParams;
use crate::csr::Csr;
use crate::error::{Error, Result};
use crate::graph::{Graph, connected_components};
use crate::parallel::{Monitor, map_watched};

/// Probabilities are kept this far from 0 and 1.
const MARGIN: f64 = 1e-6;

/// The energy of a choice of candidates.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// The two seeds of each candidate, numbered from 0.
    ends: Vec<[u32; 2]>,
    /// Number of seeds.
    seeds: usize,
    /// Cost of each candidate as background, and as a contour, nats.
    costs: Vec<[f64; 2]>,
    /// Directions in which each candidate leaves its seeds.
    leaves: Vec<[[f32; 3]; 2]>,
    /// The candidates at each seed.
    at: Csr,
    prior: Prior,
}

/// Costs of contours without continuation and with one on one side, nats, and what a continuation is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Prior {
    isolated: f64,
    one_sided: f64,
    /// Greatest cosine of the angle between continuations.
    cosine: f32,
}

/// A choice of candidates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// Whether each candidate is a contour.
    pub active: Vec<bool>,
    /// Energy of the choice, nats.
    pub energy: f64,
    /// Energy at the start and after each sweep; never rises.
    pub trace: Vec<f64>,
    /// Whether no change of a single candidate lowers the energy.
    pub converged: bool,
    /// Number of candidates in pieces whose energy is known to be least.
    pub exact: usize,
}

impl Field {
    /// From the probability of each candidate to be a contour, 0 to 1; it is moved to at least 10⁻⁶ from 0 and 1.
    /// O(n log n).
    ///
    /// # Errors
    /// If there is not one probability from 0 to 1 a candidate, a candidate has one seed at both ends, a parameter is
    /// outside its range, or the work was cancelled.
    pub fn new(
        candidates: &[Candidate],
        probabilities: &[f32],
        params: &FieldParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        params.validate()?;
        if candidates.len() != probabilities.len() {
            let message = format!("{} probabilities for {} candidates", probabilities.len(), candidates.len());
            return Err(Error::input(message));
        }
        if let Some(at) = probabilities.iter().position(|p| !(0.0..=1.0).contains(p)) {
            return Err(Error::input(format!("probability {} of candidate {at} (allowed: 0 to 1)", probabilities[at])));
        }
        if let Some(at) = candidates.iter().position(|c| c.start == c.end) {
            return Err(Error::input(format!("candidate {at} starts and ends at node {}", candidates[at].start)));
        }
        let mut seeds: Vec<u32> = candidates.iter().flat_map(|c| [c.start, c.end]).collect();
        seeds.sort_unstable();
        seeds.dedup();
        let number = |node: u32| seeds.binary_search(&node).unwrap_or_default() as u32;
        let ends = |i: usize| [number(candidates[i].start), number(candidates[i].end)];
        let costs = |i: usize| {
            let p = f64::from(probabilities[i]).clamp(MARGIN, 1.0 - MARGIN);
            [-(1.0 - p).ln(), params.bias - p.ln()]
        };
        let ends = map_watched(candidates.len(), monitor, ends)?;
        Ok(Self {
            at: at_seeds(&ends, seeds.len(), monitor)?,
            seeds: seeds.len(),
            costs: map_watched(candidates.len(), monitor, costs)?,
            leaves: map_watched(candidates.len(), monitor, |i| candidates[i].leaves)?,
            ends,
            prior: Prior {
                isolated: params.isolated,
                one_sided: params.one_sided,
                cosine: params.continuation_angle.to_radians().cos() as f32 + 1e-6,
            },
        })
    }

    /// Number of candidates.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// True if there is no candidate.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The energy of a choice (equation 4.8), computed from scratch. O(n).
    ///
    /// # Errors
    /// If there is not one choice a candidate.
    pub fn energy(&self, active: &[bool]) -> Result<f64> {
        self.check(active)?;
        let own = |i: usize| {
            let goes_on = |side: usize| self.continuations(i, side).any(|[j, _]| active[j]);
            let prior = if active[i] { self.prior.of([goes_on(0), goes_on(1)]) } else { 0.0 };
            self.costs[i][usize::from(active[i])] + prior
        };
        Ok((0..self.len()).map(own).sum())
    }

    /// The candidates that go on where candidate `i` has its start (0) or end (1), and which side of them is there.
    fn continuations(&self, i: usize, side: usize) -> impl Iterator<Item = [usize; 2]> + '_ {
        let seed = self.ends[i][side];
        let own = self.leaves[i][side];
        let others = self.at.group(seed as usize).iter().map(|&j| j as usize).filter(move |&j| j != i);
        let sided = others.map(move |j| [j, usize::from(self.ends[j][0] != seed)]);
        sided.filter(move |&[j, of_other]| {
            let other = self.leaves[j][of_other];
            own[0] * other[0] + own[1] * other[1] + own[2] * other[2] <= self.prior.cosine
        })
    }

    fn check(&self, active: &[bool]) -> Result<()> {
        match active.len() == self.len() {
            true => Ok(()),
            false => Err(Error::input(format!("a choice of {} for {} candidates", active.len(), self.len()))),
        }
    }

    /// The candidates of each connected piece: those that are joined by seeds.
    fn pieces(&self, monitor: &Monitor) -> Result<Csr> {
        let graph = Graph::new_watched(self.seeds, &self.ends, &vec![0.0; self.len()], monitor)?;
        let components = connected_components(&graph, monitor)?;
        let of = map_watched(self.len(), monitor, |i| components.of[self.ends[i][0] as usize])?;
        Csr::group_by(&of, components.count, monitor)
    }
}

impl Prior {
    /// The most that a contour gains by going on at one more side.
    fn most_gain(&self) -> f64 {
        self.one_sided.max(self.isolated - self.one_sided)
    }

    /// Equation 4.7 for a contour that goes on, or not, at its start and its end.
    fn of(&self, goes_on: [bool; 2]) -> f64 {
        match goes_on {
            [false, false] => self.isolated,
            [true, true] => 0.0,
            _ => self.one_sided,
        }
    }
}

/// The candidates at each seed.
fn at_seeds(ends: &[[u32; 2]], seeds: usize, monitor: &Monitor) -> Result<Csr> {
    let sides = Csr::group_by(ends.as_flattened(), seeds, monitor)?;
    let items = sides.items().iter().map(|&side| side / 2).collect();
    Csr::new(sides.offsets().to_vec(), items, ends.len())
}

/// The choice that the parameters ask for: by [`iterated_modes`], and exactly in small pieces if `exact` is above 0.
///
/// # Errors
/// If a parameter is outside its range, or the work was cancelled.
pub fn choose(field: &Field, params: &FieldParams, monitor: &Monitor) -> Result<Choice> {
    params.validate()?;
    let start = iterated_modes(field, params.max_sweeps, monitor)?;
    if params.exact == 0 { Ok(start) } else { exhaustive(field, &start, params.exact, monitor) }
}

#[cfg(test)]
pub(super) mod testing {
    use super::*;
    use crate::random::stream;

    /// The default parameters without a bias.
    pub(super) fn unbiased() -> FieldParams {
        FieldParams { bias: 0.0, ..FieldParams::default() }
    }

    /// A random field of some candidates between a few seeds.
    pub(super) fn random(seed: u64, candidates: usize, seeds: usize) -> Field {
        let mut random = stream(seed, 6);
        let mut made = Vec::new();
        while made.len() < candidates {
            let [start, end] = [random.below(seeds) as u32, random.below(seeds) as u32];
            if start != end {
                let leaves = [0; 2].map(|_| [random.normal() as f32, random.normal() as f32, 0.0]);
                let unit = |v: [f32; 3]| v.map(|c| c / (v[0] * v[0] + v[1] * v[1]).sqrt());
                made.push(Candidate { start, end, leaves: leaves.map(unit), ..Candidate::default() });
            }
        }
        let probabilities: Vec<f32> = made.iter().map(|_| 0.1 + 0.7 * random.uniform() as f32).collect();
        Field::new(&made, &probabilities, &unbiased(), &Monitor::default()).unwrap()
    }
}

#[cfg(test)]
mod tests {
    use super::testing::unbiased;
    use super::*;

    fn of(ends: &[[u32; 2]], probability: f32) -> Field {
        let candidates: Vec<Candidate> =
            ends.iter().map(|&[start, end]| Candidate { start, end, ..Candidate::default() }).collect();
        Field::new(&candidates, &vec![probability; ends.len()], &unbiased(), &Monitor::default()).unwrap()
    }

    #[test]
    fn priors_are_those_of_the_equation() {
        // At probability 1/2 every candidate costs ln 2, whatever it is.
        let prior = |ends: &[[u32; 2]], active: &[bool]| {
            of(ends, 0.5).energy(active).unwrap() - ends.len() as f64 * std::f64::consts::LN_2
        };
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        let chain = [[7, 9], [9, 11], [11, 30]];
        near(prior(&chain, &[false; 3]), 0.0);
        near(prior(&chain, &[true, false, false]), 2.0);
        near(prior(&chain, &[true, false, true]), 4.0);
        near(prior(&chain, &[true, true, false]), 2.0);
        near(prior(&chain, &[true; 3]), 2.0);
        near(prior(&[[0, 1], [1, 2], [0, 2]], &[true; 3]), 0.0);
        // Two candidates between the same seeds go on at both ends.
        near(prior(&[[0, 1], [0, 1]], &[true; 2]), 0.0);
    }

    #[test]
    fn candidates_that_leave_a_seed_side_by_side_do_not_continue_each_other() {
        let along = |start: u32, end: u32, x: f32| Candidate {
            start,
            end,
            leaves: [[x, 0.0, 0.0], [-x, 0.0, 0.0]],
            ..Candidate::default()
        };
        let energy = |candidates: &[Candidate], angle: f64, bias: f64| {
            let params = FieldParams { continuation_angle: angle, bias, ..FieldParams::default() };
            let probabilities = vec![0.5; candidates.len()];
            let field = Field::new(candidates, &probabilities, &params, &Monitor::default()).unwrap();
            let ground = candidates.len() as f64 * std::f64::consts::LN_2;
            ((field.energy(&vec![true; candidates.len()]).unwrap() - ground) * 1e6).round() / 1e6
        };
        // Both leave node 0 in one direction: two isolated contours; by the letter each goes on at one side.
        let beside = [along(0, 1, 1.0), along(0, 2, 1.0)];
        assert_eq!([energy(&beside, 60.0, 0.0), energy(&beside, 0.0, 0.0)], [4.0, 2.0]);
        let chain = [along(0, 1, 1.0), along(0, 2, -1.0)];
        assert_eq!(
            [energy(&chain, 60.0, 0.0), energy(&chain, 180.0, 0.0), energy(&chain, 60.0, 0.25)],
            [2.0, 2.0, 2.5]
        );
    }

    #[test]
    fn extreme_probabilities_cost_finite_amounts_and_nonsense_is_refused() {
        assert!((of(&[[0, 1]], 0.0).energy(&[true]).unwrap() - (2.0 - 1e-6f64.ln())).abs() < 1e-9);
        assert!(of(&[[0, 1]], 1.0).energy(&[false]).unwrap().is_finite());
        assert!(of(&[[0, 1]], 0.5).energy(&[]).is_err());
        let one = Candidate { start: 0, end: 1, ..Candidate::default() };
        let new = |candidates: &[Candidate], probabilities: &[f32]| {
            Field::new(candidates, probabilities, &FieldParams::default(), &Monitor::default())
        };
        assert!(new(std::slice::from_ref(&one), &[]).is_err());
        assert!(new(std::slice::from_ref(&one), &[f32::NAN]).is_err());
        assert!(new(&[Candidate { end: 0, ..one }], &[0.5]).is_err());
        assert!(new(&[], &[]).unwrap().is_empty());
    }
}
