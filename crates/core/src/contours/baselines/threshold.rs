//! Contours of all points above a threshold.

use super::super::likely::Likely;
use super::super::nodes::Nodes;
use super::super::params::NeighbourhoodParams;
use super::super::params::between;
use super::super::polylines::Polyline;
use super::linked::{LinkedParams, lines, near};
use crate::error::Result;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Parameters of [`threshold`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThresholdParams {
    /// Least strength of a point, 0 to 1.
    pub least: f64,
    /// How points are linked.
    pub linked: LinkedParams,
}

impl Default for ThresholdParams {
    fn default() -> Self {
        Self { least: 0.5, linked: LinkedParams::default() }
    }
}

impl ThresholdParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        between("least", self.least, 1.0)?;
        self.linked.validate()
    }
}

/// Lines along all points whose strength reaches a threshold. O(n + m log m) for m of these.
///
/// # Errors
/// If lengths do not fit, a value is not finite or outside 0..1, a parameter is outside its range, or the work was
/// cancelled.
pub fn threshold(strengths: &Likely, params: &ThresholdParams, monitor: &Monitor) -> Result<Vec<Polyline>> {
    params.validate()?;
    strengths.check(monitor)?;
    let thinning =
        NeighbourhoodParams { keep: params.least, voxel: params.linked.voxel, ..NeighbourhoodParams::default() };
    let nodes = Nodes::new(strengths, &[], &thinning, monitor)?;
    let graph = near(&nodes.likely.positions, &params.linked, monitor)?;
    lines(&nodes, graph, &params.linked.tidy, monitor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Positions;

    #[test]
    fn strong_points_in_a_row_are_a_line() {
        let rows: Vec<[f32; 3]> =
            (0..50).map(|i| [i as f32 * 0.05, 0.0, 1.0]).chain((0..50).map(|i| [i as f32 * 0.05, 0.5, 1.0])).collect();
        let strengths = Likely {
            positions: Positions::from_rows(&rows),
            likelihoods: (0..100).map(|i| if i < 50 { 0.75 } else { 0.25 }).collect(),
            tangents: vec![[0.0; 3]; 100],
        };
        let found = threshold(&strengths, &ThresholdParams::default(), &Monitor::default()).unwrap();
        assert_eq!((found.len(), found[0].vertices.len(), found[0].confidence), (1, 2, 0.75));
        assert!((found[0].length() - 2.45).abs() < 1e-4);
        let all = ThresholdParams { least: 0.1, ..ThresholdParams::default() };
        assert_eq!(threshold(&strengths, &all, &Monitor::default()).unwrap().len(), 2);
        assert!(threshold(&Likely::default(), &all, &Monitor::default()).unwrap().is_empty());
        assert!(ThresholdParams { least: 1.1, ..all }.validate().is_err());
    }
}
