//! Clouds scaled such that their voxels have an edge of 0.1 m, for which all other lengths are made.

use super::ContoursRecipe;
use crate::cloud::{Cloud, MetricCloud};
use crate::error::Result;
use crate::features::spacing;
use crate::parallel::Monitor;

/// The edge of a voxel of the thesis, metres.
pub(super) const VOXEL: f64 = 0.1;
/// Spacings of a cloud that make the edge of its voxels.
const SPACINGS: f64 = 2.0;

/// How a cloud is scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    /// Edge of a voxel, metres.
    pub(super) voxel: f64,
    /// Metres per unit of the cloud.
    pub(super) metres: f64,
}

impl Scale {
    /// The scale of a cloud: the voxel of the recipe, else that of its spacing.
    ///
    /// # Errors
    /// If the cloud has no point with finite coordinates, or the work was cancelled.
    pub(super) fn of(recipe: &ContoursRecipe, scene: &MetricCloud<'_>, monitor: &Monitor) -> Result<Self> {
        let voxel = match recipe.voxel {
            Some(voxel) => voxel,
            None => (SPACINGS * spacing(&scene.some_points(monitor)?, monitor)?).clamp(0.02, 5.0),
        };
        Ok(Self { voxel, metres: scene.metres })
    }

    /// Scaled metres per metre.
    pub(super) fn factor(self) -> f64 {
        VOXEL / self.voxel
    }

    /// The cloud with voxels of 0.1 scaled metres.
    pub(super) fn scene<'a>(self, scene: &MetricCloud<'a>) -> MetricCloud<'a> {
        MetricCloud { metres: scene.metres * self.factor(), ..scene.clone() }
    }

    /// A copy of a cloud whose unit is such that its voxels have 0.1 m.
    pub(super) fn copy(self, cloud: &Cloud) -> Cloud {
        let mut copy = cloud.clone();
        (copy.metres_per_unit, copy.crs) = (Some(self.metres * self.factor()), None);
        copy
    }
}
