//! Clouds scaled such that their voxels have an edge of 0.1 m, to which all other lengths in the settings refer.

use super::ContoursRecipe;
use crate::cloud::{Cloud, MetricCloud};
use crate::contours::Polyline;
use crate::error::Result;
use crate::features::spacings;
use crate::parallel::Monitor;

/// The edge of a voxel of the thesis, metres.
pub(super) const VOXEL: f64 = 0.1;
/// Share of the points, those farthest from others, that say nothing about the spacing.
const STRAY: f64 = 0.02;

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
            None => {
                let spacings = spacings(&scene.some_points(monitor)?, monitor)?;
                (recipe.spacings * by_area(&spacings, recipe.area)).clamp(0.02, 5.0)
            }
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

/// The spacing that is not exceeded on a share of the scanned area, of ascending spacings of points all over the cloud. Each
/// point stands for the square of its spacing.
fn by_area(spacings: &[f64], share: f64) -> f64 {
    let kept = &spacings[..spacings.len() - (STRAY * spacings.len() as f64) as usize];
    let area: f64 = kept.iter().map(|d| d * d).sum();
    let mut sum = 0.0;
    let reached = |d: &&f64| {
        sum += *d * *d;
        sum >= share * area
    };
    kept.iter().find(reached).or(kept.last()).copied().unwrap_or(0.0)
}

/// From the coordinates of a cloud to local metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalLines {
    /// Metres per unit of the cloud, scaled or not.
    pub(super) metres: f64,
    /// The local origin in these metres.
    pub(super) origin: [f64; 3],
}

impl LocalLines {
    pub(super) fn of(self, lines: &[Vec<[f64; 3]>]) -> Vec<Polyline> {
        let place = |at: &[f64; 3]| std::array::from_fn(|axis| (at[axis] * self.metres - self.origin[axis]) as f32);
        let line =
            |line: &Vec<[f64; 3]>| Polyline { vertices: line.iter().map(place).collect(), ..Polyline::default() };
        lines.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spacings_count_by_the_area_that_they_cover() {
        // 900 points on 9 m² and 100 points on 25 m²: by number the first are most, by area the second.
        let spacings = [vec![0.1; 900], vec![0.5; 100]].concat();
        assert_eq!([0.1, 0.2, 0.5, 0.9].map(|share| by_area(&spacings, share)), [0.1, 0.1, 0.5, 0.5]);
        // Two stray points in a hundred say nothing.
        let stray = [vec![0.1; 98], vec![100.0; 2]].concat();
        assert_eq!([by_area(&stray, 0.9), by_area(&[], 0.5), by_area(&[0.2], 1.0)], [0.1, 0.0, 0.2]);
    }
}
