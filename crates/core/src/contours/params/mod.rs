//! Parameters of contour extraction.

mod checks;
mod neighbourhood;
mod parts;
mod ridge;
mod tangents;
mod tidy;

pub(super) use checks::{above_zero, at_least_one, between, zero_or_more};
pub use neighbourhood::NeighbourhoodParams;
pub use parts::PartParams;
pub use ridge::RidgeParams;
pub use tangents::TangentParams;
pub use tidy::TidyParams;

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Candidates of a piece that is solved exactly, at most.
pub(super) const MOST_EXACT: usize = 20;

/// Which neighbours suppress a seed that is less likely than they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Suppression {
    /// All the most likely points of voxels, also those that are suppressed themselves: independent of any order.
    All,
    /// Only those that remain, from the most likely one on: keeps more seeds.
    #[default]
    Survivors,
}

/// Parameters of [`seeds`](super::seeds()).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SeedParams {
    /// Edge of a voxel, metres, above 0. Larger: fewer seeds.
    pub voxel: f64,
    /// Least likelihood of a seed, 0 to 1.
    pub threshold: f64,
    /// Largest angle from the tangent at the more likely neighbour at which a seed lies along its contour, degrees, 0
    /// to 90.
    pub tangent_angle: f64,
    /// Least distance from a more likely neighbour along the contour, as a share of the voxel, 0 to 1.
    pub spacing: f64,
    /// Which neighbours suppress.
    pub suppression: Suppression,
}

impl Default for SeedParams {
    fn default() -> Self {
        Self { voxel: 0.1, threshold: 0.5, tangent_angle: 30.0, spacing: 0.5, suppression: Suppression::Survivors }
    }
}

impl SeedParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        above_zero("voxel", self.voxel)?;
        between("threshold", self.threshold, 1.0)?;
        between("tangent_angle", self.tangent_angle, 90.0)?;
        between("spacing", self.spacing, 1.0)
    }
}

/// Parameters of [`link`](super::link).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkParams {
    /// Largest number of seeds that a seed is linked with, the nearest first, 1 or more.
    pub count: usize,
    /// Largest distance of two linked seeds, metres, above 0; paths stay within twice this distance of one of them.
    pub radius: f64,
}

impl Default for LinkParams {
    fn default() -> Self {
        Self { count: 15, radius: 0.85 }
    }
}

impl LinkParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        at_least_one("count", self.count)?;
        above_zero("radius", self.radius)
    }
}

/// Parameters of [`describe`](super::describe).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DescriptorParams {
    /// Whether histograms hold counts, which grow with the number of points, in place of shares with sum 1.
    pub counts: bool,
    /// Whether the values of the shape are left out (0), so that only likelihoods remain, for comparison.
    pub without_shape: bool,
}

/// Parameters of [`candidates`](super::candidates).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CandidateParams {
    /// Likely points moved to the edge.
    pub ridge: RidgeParams,
    /// The seeds.
    pub seeds: SeedParams,
    /// The graph that paths run in.
    pub neighbourhood: NeighbourhoodParams,
    /// The links between seeds.
    pub links: LinkParams,
    /// The values of each candidate.
    pub descriptor: DescriptorParams,
}

impl CandidateParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        self.ridge.validate()?;
        self.seeds.validate()?;
        self.neighbourhood.validate()?;
        self.links.validate()
    }
}

/// Parameters of the random field on candidates, see [`Field`](super::Field).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FieldParams {
    /// Cost of every contour, nats; above 0: fewer contours, below 0: more.
    pub bias: f64,
    /// Cost of a contour without continuation at either end, nats; at least [`FieldParams::one_sided`].
    pub isolated: f64,
    /// Cost of a contour with a continuation at one end only, nats, 0 or more.
    pub one_sided: f64,
    /// Least angle between the directions in which two candidates leave a seed at which they continue each other, degrees, 0
    /// to 180; 0: any, also candidates that overlap.
    pub continuation_angle: f64,
    /// Largest number of sweeps over all candidates, 1 or more.
    pub max_sweeps: usize,
    /// Connected pieces of at most this many candidates are solved exactly, 0 to 20; each costs O(2^candidates).
    pub exact: usize,
}

impl Default for FieldParams {
    fn default() -> Self {
        Self { bias: -0.5, isolated: 2.0, one_sided: 1.0, continuation_angle: 90.0, max_sweeps: 100, exact: 0 }
    }
}

impl FieldParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !self.bias.is_finite() {
            return Err(Error::parameter("bias", self.bias, "a finite number of nats"));
        }
        between("continuation_angle", self.continuation_angle, 180.0)?;
        zero_or_more("one_sided", self.one_sided)?;
        zero_or_more("isolated", self.isolated)?;
        if self.isolated < self.one_sided {
            return Err(Error::parameter("isolated", self.isolated, format!("at least one_sided, {}", self.one_sided)));
        }
        if self.exact > MOST_EXACT {
            return Err(Error::parameter("exact", self.exact, format!("0 to {}", MOST_EXACT)));
        }
        at_least_one("max_sweeps", self.max_sweeps)
    }
}

/// Parameters of [`trace`](super::trace).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TraceParams {
    /// The random field.
    pub field: FieldParams,
    /// The lines.
    pub tidy: TidyParams,
    /// The rating of their parts.
    pub parts: PartParams,
}

impl TraceParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        self.field.validate()?;
        self.tidy.validate()?;
        self.parts.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_nonsense_is_refused() {
        CandidateParams::default().validate().unwrap();
        TraceParams::default().validate().unwrap();
        let seeds = |change: fn(&mut SeedParams)| {
            let mut params = SeedParams::default();
            change(&mut params);
            params.validate().is_err()
        };
        assert!(seeds(|p| p.voxel = 0.0) && seeds(|p| p.voxel = f64::NAN) && seeds(|p| p.threshold = 1.5));
        assert!(seeds(|p| p.tangent_angle = 91.0) && seeds(|p| p.spacing = -0.1));
        assert!(LinkParams { count: 0, ..Default::default() }.validate().is_err());
        assert!(LinkParams { radius: f64::INFINITY, ..Default::default() }.validate().is_err());
        let message = FieldParams { isolated: 0.5, ..Default::default() }.validate().unwrap_err().to_string();
        assert!(message.contains("isolated") && message.contains("0.5"), "{message}");
        assert!(FieldParams { exact: 21, ..Default::default() }.validate().is_err());
        assert!(FieldParams { max_sweeps: 0, ..Default::default() }.validate().is_err());
        let parts = |change: fn(&mut PartParams)| {
            let mut params = PartParams::default();
            change(&mut params);
            params.validate().is_err()
        };
        assert!(parts(|p| p.least = 1.5) && parts(|p| p.confidence = -0.1) && parts(|p| p.least_length = f64::NAN));
        assert!(parts(|p| p.window = f64::INFINITY) && parts(|p| p.window = -1.0));
    }
}
