//! Parameters of cut pursuit.

use super::super::merge::check_not_negative;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Speed presets of the reference implementation.
#[derive(Clone, Copy, Debug, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// Its speed 0: 4 cuts a split, 5 restarts of 8 steps, 20 rounds, tolerance 1e-3.
    Thorough,
    /// Its speed 1: 3 cuts, 2 restarts of 5 steps, 10 rounds, tolerance 1e-2.
    Standard,
    /// Its speed 2: 2 cuts, 2 restarts of 5 steps, 5 rounds, tolerance 5e-2.
    Fast,
    /// Its speed 3: 1 cut, 1 start of 3 steps, 5 rounds, tolerance 0.1, no merging.
    Fastest,
    /// Its speed 4, that of superpoint graphs: 3 cuts, 10 restarts of 5 steps, 15 rounds, tolerance 5e-2.
    Superpoints,
}

/// Parameters of [`cut_pursuit`](crate::segmentation::cut_pursuit()).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct CutPursuitParams {
    /// ρ: cost of a boundary edge of weight 1, in units of squared feature difference. Larger: fewer, larger segments.
    /// ≥ 0; infinite gives one segment per connected component over edges of positive weight.
    #[serde(deserialize_with = "crate::settings::number")]
    pub strength: f64,
    /// Segments of less weight than this are merged into their best neighbour at the end, at any cost. ≥ 0; 0 keeps
    /// all.
    #[serde(deserialize_with = "crate::settings::number")]
    pub cutoff: f64,
    /// Seed of the 2-means.
    pub seed: u64,
    /// What lowers Q further, and what saves time.
    pub steps: CutPursuitSteps,
}

impl Default for CutPursuitParams {
    fn default() -> Self {
        Self { strength: 0.1, cutoff: 0.0, seed: 0, steps: CutPursuitSteps::default() }
    }
}

/// The steps of cut pursuit: how much is tried, and when it ends.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct CutPursuitSteps {
    /// Graphs of more nodes than this are first cut on a coarser graph, which is many times faster if segments are not
    /// very small. `None` (`"none"` in a recipe): never, as in the paper.
    #[serde(with = "crate::settings::optional")]
    pub coarse_above: Option<usize>,
    /// Number of repetitions of the whole method, each from the result before with another seed and, on large graphs,
    /// another coarse graph; ends early when a cycle gains less than the tolerance. At least 1.
    pub cycles: usize,
    /// F: minimum cuts per split, each with the means of the cut before. At least 1.
    pub flow_steps: usize,
    /// T: Lloyd iterations of the 2-means that starts a split. At least 1.
    pub means_steps: usize,
    /// R: random starts of the 2-means, of which the best is used. At least 1.
    pub restarts: usize,
    /// Splits tried for each segment; the one of least energy is used. At least 1.
    pub attempts: usize,
    /// Largest number of iterations of splitting and merging. At least 1.
    pub max_iterations: usize,
    /// Stop when an iteration lowers Q by less than this share of it. ≥ 0.
    pub tolerance: f64,
    /// Split a segment only if that lowers Q immediately: Q then never rises, and the result is slightly worse on
    /// average.
    pub guard: bool,
    /// Merge segments after each iteration.
    pub backward: bool,
    /// After each iteration, move single nodes across boundaries where that lowers Q. Not part of the published method.
    pub moves: bool,
}

impl Default for CutPursuitSteps {
    fn default() -> Self {
        Self {
            coarse_above: Some(10_000),
            cycles: 2,
            flow_steps: 3,
            means_steps: 5,
            restarts: 3,
            attempts: 4,
            max_iterations: 10,
            tolerance: 1e-3,
            guard: false,
            backward: true,
            moves: true,
        }
    }
}

impl CutPursuitSteps {
    /// The published method: without repeated attempts, moves, cycles and coarse graphs. With more than 10,000 links
    /// between segments many pairs still merge at once, instead of the pair of largest gain first.
    pub fn paper() -> Self {
        Self { coarse_above: None, cycles: 1, attempts: 1, moves: false, ..Self::default() }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        check_not_negative("tolerance", self.tolerance)?;
        let counts = [
            ("flow_steps", self.flow_steps),
            ("means_steps", self.means_steps),
            ("restarts", self.restarts),
            ("attempts", self.attempts),
            ("max_iterations", self.max_iterations),
            ("cycles", self.cycles),
        ];
        match counts.into_iter().find(|(_, count)| *count == 0) {
            Some((name, count)) => Err(Error::parameter(name, count, "1 or more")),
            None => Ok(()),
        }
    }
}

impl CutPursuitParams {
    /// The published method: [`CutPursuitSteps::paper`].
    pub fn as_published(self) -> Self {
        Self { steps: CutPursuitSteps::paper(), ..self }
    }

    /// The same with the effort of a preset of the reference implementation.
    pub fn with_preset(self, preset: Preset) -> Self {
        let (flow_steps, means_steps, restarts, max_iterations, tolerance) = match preset {
            Preset::Thorough => (4, 8, 5, 20, 1e-3),
            Preset::Standard => (3, 5, 2, 10, 1e-2),
            Preset::Fast => (2, 5, 2, 5, 5e-2),
            Preset::Fastest => (1, 3, 1, 5, 0.1),
            Preset::Superpoints => (3, 5, 10, 15, 5e-2),
        };
        let backward = preset != Preset::Fastest;
        let steps =
            CutPursuitSteps { flow_steps, means_steps, restarts, max_iterations, tolerance, backward, ..self.steps };
        Self { steps, ..self }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        check_not_negative("strength", self.strength)?;
        check_not_negative("cutoff", self.cutoff)?;
        self.steps.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let refused = |params: CutPursuitParams| params.validate().unwrap_err().to_string();
        let default = CutPursuitParams::default;
        assert!(default().validate().is_ok());
        assert!(refused(CutPursuitParams { strength: -1.0, ..default() }).contains("strength"));
        assert!(refused(CutPursuitParams { strength: f64::NAN, ..default() }).contains("strength"));
        assert!(refused(CutPursuitParams { cutoff: -0.5, ..default() }).contains("cutoff"));
        assert!(
            refused(CutPursuitParams { steps: CutPursuitSteps { flow_steps: 0, ..Default::default() }, ..default() })
                .contains("flow_steps")
        );
    }

    #[test]
    fn presets_keep_the_problem() {
        let params = CutPursuitParams { strength: 0.7, seed: 3, ..CutPursuitParams::default() };
        let fast = params.clone().with_preset(Preset::Fastest);
        assert_eq!((fast.strength, fast.seed, fast.steps.flow_steps, fast.steps.backward), (0.7, 3, 1, false));
        assert!(fast.validate().is_ok());
    }
}
