//! Input channels: numbers of each point, from which those of the cells are made.

use crate::cloud::{Cloud, Points, names};
use crate::error::{Error, Result};
use crate::features::colours;
use crate::parallel::Monitor;
use crate::terrain::{HeightParams, filtered_heights};
use serde::{Deserialize, Serialize};

/// Channels that every cell has: 1, the mean place of its points in it along three axes, and their number.
pub(super) const OWN: usize = 5;

/// Input channels of the network besides the places of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UNetInputs {
    /// Height above the ground.
    pub height: bool,
    /// Number of the return divided by the number of returns of its pulse; the cloud needs both columns.
    pub returns: bool,
    /// Intensity, divided by the cloud's mean; the cloud needs the column.
    pub intensity: bool,
    /// Red, green and blue; the cloud needs the columns.
    pub colour: bool,
}

impl Default for UNetInputs {
    fn default() -> Self {
        Self { height: true, returns: false, intensity: false, colour: false }
    }
}

impl UNetInputs {
    /// Number of numbers of a point.
    pub(super) fn width(self) -> usize {
        [self.height, self.returns, self.intensity, self.colour, self.colour, self.colour].map(usize::from).iter().sum()
    }

    /// Columns of the cloud that are read.
    pub(super) fn columns(self) -> Vec<String> {
        let mut columns = Vec::new();
        if self.returns {
            columns.extend([names::RETURN_NUMBER, names::NUMBER_OF_RETURNS]);
        }
        if self.intensity {
            columns.push(names::INTENSITY);
        }
        if self.colour {
            columns.extend(names::COLOUR);
        }
        columns.into_iter().map(String::from).collect()
    }

    /// The numbers of each point, row-major, all of the order of 1. Heights come first.
    ///
    /// # Errors
    /// If a column is absent, or the work was cancelled.
    pub(super) fn of_points(
        self,
        cloud: &Cloud,
        points: &Points,
        ground: &HeightParams,
        monitor: &Monitor,
    ) -> Result<Vec<f32>> {
        let index = &points.frame.index;
        let mut channels: Vec<Vec<f32>> = Vec::new();
        if self.height {
            let heights = filtered_heights(points, ground, monitor)?;
            channels.push(heights.into_iter().map(squeezed).collect());
        }
        if self.returns {
            let (number, all) = (column(cloud, names::RETURN_NUMBER)?, column(cloud, names::NUMBER_OF_RETURNS)?);
            let share = |&i: &u32| (number(i as usize) / all(i as usize).max(1.0)) as f32;
            channels.push(index.iter().map(share).collect());
        }
        if self.intensity {
            let intensity = column(cloud, names::INTENSITY)?;
            let sum: f64 = index.iter().map(|&i| intensity(i as usize)).sum();
            let mean = (sum / index.len().max(1) as f64).max(f64::MIN_POSITIVE);
            channels.push(index.iter().map(|&i| ((intensity(i as usize) / mean).min(8.0) * 0.5) as f32).collect());
        }
        if self.colour {
            let found = colours(cloud, index, monitor)?;
            channels.extend((0..3).map(|c| found.iter().map(|rgb| rgb[c]).collect()));
        }
        monitor.check()?;
        Ok((0..points.len()).flat_map(|i| channels.iter().map(move |channel| finite(channel[i]))).collect())
    }
}

/// A height of metres as a number of the order of 1 that tells 0.2 m from 1 m and 10 m from 20 m.
pub(super) fn squeezed(height: f32) -> f32 {
    0.5 * height.asinh()
}

fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

fn column<'a>(cloud: &'a Cloud, name: &str) -> Result<impl Fn(usize) -> f64 + 'a> {
    let found = cloud.column(name).ok_or_else(|| Error::input(format!("an input needs the column {name}")))?;
    Ok(|i| found.values.get(i))
}
