//! Parameters of the lines.

use super::checks::{between, zero_or_more};
use crate::error::Result;
use serde::{Deserialize, Serialize};

/// Parameters of the lines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TidyParams {
    /// Largest distance of a vertex that is left out from the line, metres, 0 or more.
    pub tolerance: f64,
    /// Loops that are narrower on average are opened, metres; 0: none. Overlapping candidates run side by side at
    /// times.
    pub loop_width: f64,
    /// Longest loop that is opened, metres.
    pub loop_length: f64,
    /// Branches with a free end that are shorter go, and those along another line; metres; 0: none.
    pub spur: f64,
    /// Ends of lines that are nearer to each other become one, and segments of up to twice this length that cut off a
    /// corner go; metres; 0: none.
    pub corner: f64,
    /// Longest gap between two free ends that is closed, metres; 0: none.
    pub gap: f64,
    /// Largest angle between a line and the gap at its end, degrees, 0 to 90.
    pub gap_angle: f64,
    /// Length to either side over which a line is averaged before it is simplified, the likelier nodes more, metres; 0:
    /// none.
    pub smooth: f64,
    /// Segments whose points are nearer to the straight line through them, in the root mean square, are replaced by it,
    /// and vertices by the intersections of these lines, metres; 0: none.
    pub residual: f64,
    /// Lines with a free end that are shorter are left out, metres; 0: none.
    pub least_length: f64,
}

impl Default for TidyParams {
    fn default() -> Self {
        Self {
            tolerance: 0.03,
            loop_width: 0.05,
            loop_length: 1.7,
            spur: 0.2,
            corner: 0.1,
            gap: 0.3,
            gap_angle: 30.0,
            smooth: 0.05,
            residual: 0.05,
            least_length: 0.2,
        }
    }
}

impl TidyParams {
    /// Nothing but the simplification within a tolerance, metres.
    pub fn plain(tolerance: f64) -> Self {
        let none = 0.0;
        Self {
            tolerance,
            loop_width: none,
            loop_length: none,
            spur: none,
            corner: none,
            gap: none,
            smooth: none,
            residual: none,
            least_length: none,
            ..Self::default()
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        zero_or_more("tolerance", self.tolerance)?;
        zero_or_more("loop_width", self.loop_width)?;
        zero_or_more("loop_length", self.loop_length)?;
        zero_or_more("spur", self.spur)?;
        zero_or_more("corner", self.corner)?;
        zero_or_more("gap", self.gap)?;
        between("gap_angle", self.gap_angle, 90.0)?;
        zero_or_more("smooth", self.smooth)?;
        zero_or_more("residual", self.residual)?;
        zero_or_more("least_length", self.least_length)
    }
}
