//! Heights above ground for the filter.

use super::FilterParams;
use crate::cloud::{Cloud, MetricCloud, names};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::terrain::{ProductParams, Survey, heights_above_ground};

/// The height of each point, and where it is from.
pub(super) struct Heights {
    /// Metres; NaN for points without.
    pub(super) metres: Vec<f32>,
    /// For the user.
    pub(super) note: String,
}

impl Heights {
    /// The dimension `HeightAboveGround` of the cloud if it has one and the ground is not to be found anew, else heights
    /// above the ground of all points that are not noise.
    pub(super) fn of(cloud: &Cloud, noise: &[bool], params: &FilterParams, monitor: &Monitor) -> Result<Self> {
        if let Some(column) = cloud.column(names::HEIGHT_ABOVE_GROUND).filter(|_| !params.find_ground) {
            let metres = cloud.metres(params.metres_per_unit)?;
            let heights = (0..cloud.len()).map(|i| (column.values.get(i) * metres) as f32).collect();
            return Ok(Self { metres: heights, note: format!("heights: of the dimension {}", column.name) });
        }
        if !noise.contains(&true) {
            let scene = MetricCloud::new(cloud, params.metres_per_unit, monitor)?;
            return Self::found(&scene, &params.ground, monitor);
        }
        let rest: Vec<u32> = (0..cloud.len() as u32).filter(|&i| !noise[i as usize]).collect();
        let part = cloud.select(&rest);
        let scene = MetricCloud::new(&part, params.metres_per_unit, monitor)?;
        let found = Self::found(&scene, &params.ground, monitor)?;
        let mut metres = vec![f32::NAN; cloud.len()];
        rest.iter().zip(found.metres).for_each(|(&i, height)| metres[i as usize] = height);
        Ok(Self { metres, ..found })
    }

    fn found(scene: &MetricCloud<'_>, ground: &ProductParams, monitor: &Monitor) -> Result<Self> {
        let survey = Survey::new(scene, ground, monitor)?;
        Ok(Self { metres: heights_above_ground(scene, &survey, ground, monitor)?, note: survey.note })
    }
}
