//! Parameters of the octree.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Greatest depth of an octree: cell indices have 21 bits an axis.
const DEEPEST: u32 = 21;

/// The rule by which the points of a cell count as flat. λ1 ≥ λ2 ≥ λ3 are the eigenvalues of their covariance (divisor
/// n), in m².
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopRule {
    /// λ3 is below this, m² (the paper: 0.5 in the unit of its coordinates). In metres nearly every cell of less than
    /// 2.5 m passes, so that the octree is a regular grid of the least depth.
    Absolute(f64),
    /// √λ3, the standard deviation about the best plane, is below this, metres: about 0.03 indoors, 0.1 outdoors.
    Sigma(f64),
    /// λ3 / (λ1 + λ2 + λ3) is below this, independent of the size of the cell; 0.03.
    Flat(f64),
}

impl StopRule {
    /// Whether eigenvalues λ1 ≥ λ2 ≥ λ3 fulfil the rule. Coincident points always do, unless the threshold is 0.
    pub fn passes(&self, [first, second, third]: [f64; 3]) -> bool {
        match *self {
            Self::Absolute(threshold) => third < threshold,
            Self::Sigma(metres) => third < metres * metres,
            Self::Flat(share) => third < share * (first + second + third) || (first <= 0.0 && share > 0.0),
        }
    }

    fn threshold(&self) -> f64 {
        match *self {
            Self::Absolute(value) | Self::Sigma(value) | Self::Flat(value) => value,
        }
    }
}

/// Parameters of [`octree`](super::octree()).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct OctreeParams {
    /// d_min: down to this depth every cell is divided. A cell of depth d has the edge of the root cube / 2^d. At most
    /// 21.
    pub min_depth: u32,
    /// d_max − d_min: how many levels further cells may be divided. The sum is at most 21.
    pub extra_depth: u32,
    /// N_min: cells with fewer points are not divided beyond the least depth.
    pub min_points: u32,
    /// The rule by which a cell is flat enough not to be divided.
    pub stop: StopRule,
}

impl Default for OctreeParams {
    fn default() -> Self {
        Self::adaptive()
    }
}

impl OctreeParams {
    /// Cells are divided until their points scatter by less than 0.03 m about a plane. Depth 6 to 9, 10 points.
    pub fn adaptive() -> Self {
        Self { min_depth: 6, extra_depth: 3, min_points: 10, stop: StopRule::Sigma(0.03) }
    }

    /// As printed: λ3 < 0.5. The paper gives no depths and no least number of points: those of
    /// [`OctreeParams::adaptive`].
    pub fn paper() -> Self {
        Self { stop: StopRule::Absolute(0.5), ..Self::adaptive() }
    }

    /// d_max.
    pub fn max_depth(&self) -> u32 {
        self.min_depth.saturating_add(self.extra_depth)
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if self.max_depth() > DEEPEST {
            let found = format!("{} and {}", self.min_depth, self.extra_depth);
            return Err(Error::parameter("min_depth and extra_depth", found, format!("a sum of at most {DEEPEST}")));
        }
        let threshold = self.stop.threshold();
        if !(threshold >= 0.0 && threshold.is_finite()) {
            return Err(Error::parameter("stop", threshold, "0 or more, finite"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_compare_as_they_say() {
        let values = [4.0, 1.0, 0.25];
        assert!(StopRule::Absolute(0.3).passes(values) && !StopRule::Absolute(0.25).passes(values));
        assert!(StopRule::Sigma(0.51).passes(values) && !StopRule::Sigma(0.5).passes(values));
        assert!(StopRule::Flat(0.05).passes(values) && !StopRule::Flat(0.04).passes(values));
        assert!(StopRule::Flat(0.01).passes([0.0; 3]) && !StopRule::Flat(0.0).passes([0.0; 3]));
    }

    #[test]
    fn depths_and_thresholds_out_of_range_are_refused() {
        let refused = |params: OctreeParams| params.validate().unwrap_err().to_string();
        assert!(OctreeParams::paper().validate().is_ok());
        assert!(refused(OctreeParams { min_depth: 19, ..OctreeParams::default() }).contains("min_depth"));
        assert!(refused(OctreeParams { extra_depth: u32::MAX, ..OctreeParams::default() }).contains("21"));
        assert!(refused(OctreeParams { stop: StopRule::Sigma(f64::NAN), ..OctreeParams::default() }).contains("stop"));
    }

    #[test]
    fn a_recipe_can_hold_them() {
        let params = OctreeParams { stop: StopRule::Flat(0.05), ..OctreeParams::default() };
        let text = toml::to_string(&params).unwrap();
        assert_eq!(toml::from_str::<OctreeParams>(&text).unwrap(), params);
        let given: OctreeParams = toml::from_str("stop = { sigma = 0.1 }").unwrap();
        assert_eq!(given, OctreeParams { stop: StopRule::Sigma(0.1), ..OctreeParams::default() });
    }
}
