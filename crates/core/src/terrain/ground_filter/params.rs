//! Parameters of the ground filter.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// How the ground is found from the lowest heights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GroundMethod {
    /// The simple morphological filter of Pingel et al. 2013, with square windows and holes filled by the nearest
    /// height. Its published parameters are [`GroundParams::published`].
    Morphological,
    /// The same with octagonal windows, smooth filling of holes, a slope that follows the terrain, removal of what
    /// stands out from the ground that was found and of roofs wider than the window, and return of what lies on it.
    #[default]
    Refined,
}

/// Parameters of [`ground_points`](super::ground_points).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GroundParams {
    /// How the ground is found.
    pub method: GroundMethod,
    /// Edge of a cell, metres; above 0.
    pub cell: f64,
    /// Slope of the steepest ground, rise over run; 0 or more. For the refined method, where the terrain is level.
    pub slope: f64,
    /// Additional slope per unit of the slope of the terrain around, at most a slope of 1; 0 or more. Only for the
    /// refined method.
    pub relief: f64,
    /// Half the width of the widest object that openings find, metres; at least a cell.
    pub window: f64,
    /// Least height of the walls around a roof of at least the area window · window, metres; 0 or more, 0: none is looked
    /// for. Walls lower than a cell edge are not seen. Only for the refined method.
    pub wall: f64,
    /// Largest distance of ground points from the height of the ground where it is level, metres; above 0.
    pub threshold: f64,
    /// Additional distance per unit of slope, metres; 0 or more.
    pub scaling: f64,
}

impl Default for GroundParams {
    fn default() -> Self {
        let method = GroundMethod::Refined;
        Self { method, cell: 1.0, slope: 0.12, relief: 0.2, window: 27.0, wall: 2.0, threshold: 0.45, scaling: 1.0 }
    }
}

impl GroundParams {
    /// The morphological method with the single set of parameters of Pingel et al. 2013.
    #[must_use]
    pub fn published() -> Self {
        let method = GroundMethod::Morphological;
        Self { method, cell: 1.0, slope: 0.15, relief: 0.0, window: 18.0, wall: 0.0, threshold: 0.5, scaling: 1.25 }
    }

    /// Largest distance of the ground's points from its height where it has this slope, metres.
    pub(super) fn tolerance(&self, slope: f64) -> f64 {
        self.threshold + self.scaling * slope
    }

    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        let wrong = |name, value: f64, expected: &str| Err(Error::parameter(name, value, expected));
        match self {
            Self { cell, .. } if !(*cell > 0.0 && cell.is_finite()) => wrong("cell", *cell, "metres, above 0"),
            Self { slope, .. } if !(*slope >= 0.0 && slope.is_finite()) => wrong("slope", *slope, "0 or more"),
            Self { relief, .. } if !(*relief >= 0.0 && relief.is_finite()) => wrong("relief", *relief, "0 or more"),
            Self { window, cell, .. } if !(window >= cell && *window <= 1000.0 * cell) => {
                wrong("window", *window, "1 to 1000 cells")
            }
            Self { wall, .. } if !(*wall >= 0.0 && wall.is_finite()) => wrong("wall", *wall, "metres, 0 or more"),
            Self { threshold, .. } if !(*threshold > 0.0 && threshold.is_finite()) => {
                wrong("threshold", *threshold, "metres, above 0")
            }
            Self { scaling, .. } if !(*scaling >= 0.0 && scaling.is_finite()) => {
                wrong("scaling", *scaling, "metres, 0 or more")
            }
            _ => Ok(()),
        }
    }
}
