//! Parts of the training clouds, augmented differently each time: turned, mirrored, scaled, thinned, jittered.

use super::cells::Gathered;
use super::scenes::TrainingScene;
use crate::error::{Error, Result};
use crate::random::Stream;
use crate::recipes::training::networks::NONE;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// How parts are changed before they are learned from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Augmentation {
    /// Whether parts are turned about the vertical by any angle, and half of them mirrored.
    pub turn: bool,
    /// Largest change of size, as a share, 0 to below 1.
    pub scale: f64,
    /// Standard deviation of the noise of coordinates, in cells, 0 or more.
    pub noise: f64,
    /// Half of the parts keep only a share of their points: from this one to 1; above 0, at most 1.
    pub thin: f64,
    /// Probability that a part is shown without one of its further inputs (heights, returns, intensity, colours), 0 to 1.
    pub hide: f64,
    /// Probability that a part is laid over one of another cloud (if there is one cloud, of another place), 0 to 1, after A.
    /// Nekrasov et al., *Mix3D: out-of-context data augmentation for 3D scenes*, 3DV 2021,
    /// doi:10.1109/3DV53792.2021.00022.
    pub mix: f64,
}

impl Default for Augmentation {
    fn default() -> Self {
        Self { turn: true, scale: 0.1, noise: 0.1, thin: 0.2, hide: 0.0, mix: 0.0 }
    }
}

impl Augmentation {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(&self) -> Result<()> {
        let check = |name: &'static str, value: f64, fine: bool, expected: &str| match fine {
            true => Ok(()),
            false => Err(Error::parameter(name, value, expected)),
        };
        check("augment.scale", self.scale, (0.0..1.0).contains(&self.scale), "0 to below 1")?;
        check("augment.noise", self.noise, (0.0..=2.0).contains(&self.noise), "0 to 2 cells")?;
        check("augment.thin", self.thin, self.thin > 0.0 && self.thin <= 1.0, "above 0, at most 1")?;
        check("augment.hide", self.hide, (0.0..=1.0).contains(&self.hide), "0 to 1")?;
        check("augment.mix", self.mix, (0.0..=1.0).contains(&self.mix), "0 to 1")
    }

    /// Whether the next part is laid over another one. Without mixing nothing is drawn.
    pub(super) fn mixes(&self, draws: &mut Stream) -> bool {
        self.mix > 0.0 && draws.uniform() < self.mix
    }
}

/// A part of a cloud: all points within `radius` cells of a vertical line.
pub(super) struct Crop<'a> {
    pub(super) scene: &'a TrainingScene,
    /// x and y of the line, metres.
    pub(super) centre: [f32; 2],
    /// Cells.
    pub(super) radius: f64,
    /// Edge of a cell, metres.
    pub(super) voxel: f64,
}

impl Crop<'_> {
    /// Adds the points of the part, changed by random draws, to the last sample of the batch: the line goes through the
    /// middle of the sample, and the lowest point is at its lower end.
    ///
    /// # Errors
    /// If a point lies beyond the largest cell.
    pub(super) fn gather(&self, augment: &Augmentation, batch: &mut Batch, draws: &mut Stream) -> Result<()> {
        let Self { scene, centre: [cx, cy], radius, voxel } = *self;
        let within = radius * voxel;
        let change = Change::drawn(augment, scene.width, draws);
        let place = |i: usize| {
            let [x, y, z] = scene.points.xyz(i);
            [f64::from(x - cx), f64::from(y - cy), f64::from(z)]
        };
        let inside = |i: &usize| {
            let [x, y, _] = place(*i);
            x * x + y * y < within * within
        };
        let found: Vec<usize> = (0..scene.points.len()).filter(inside).collect();
        let lowest = found.iter().map(|&i| place(i)[2]).fold(f64::INFINITY, f64::min);
        // Room for the largest scale and for noise.
        let room = radius * (1.0 + augment.scale) + 16.0;
        let shift = [draws.uniform(), draws.uniform(), draws.uniform()];
        let mut numbers = vec![0.0; scene.width];
        for i in found {
            if draws.uniform() >= change.keep {
                continue;
            }
            let [x, y, z] = place(i);
            let turned = change.turned([x, y, z - lowest]);
            let at = [0, 1, 2].map(|a: usize| {
                let noise = if augment.noise > 0.0 { augment.noise * draws.normal() } else { 0.0 };
                turned[a] / voxel + noise.clamp(-8.0, 8.0) + shift[a] + if a == 2 { 16.0 } else { room }
            });
            numbers.copy_from_slice(scene.numbers_of(i));
            change.hide(&mut numbers);
            batch.points.push(batch.sample, at, &numbers)?;
            batch.labels.push(scene.labelled.labels[i]);
            batch.origins.push(i as u32);
        }
        Ok(())
    }
}

/// Samples that are learned from together.
#[derive(Default)]
pub(super) struct Batch {
    pub(super) points: Gathered,
    /// Class of each point, [`NONE`] without one.
    pub(super) labels: Vec<u16>,
    /// Number of each point in its scene; ascending in each part.
    origins: Vec<u32>,
    /// Number of the sample to which points are added.
    pub(super) sample: u32,
}

impl Batch {
    /// Number of points so far.
    pub(super) fn len(&self) -> usize {
        self.labels.len()
    }

    /// The points of a scene that two views of a part have in common, but those that may not be used; a view is its points in
    /// the batch.
    pub(super) fn common<'a>(
        &'a self,
        [first, second]: [Range<usize>; 2],
        used: &'a [bool],
    ) -> impl Iterator<Item = [usize; 2]> + 'a {
        let mut second = second.peekable();
        let same = move |at: usize| {
            while second.next_if(|&other| self.origins[other] < self.origins[at]).is_some() {}
            second.peek().filter(|&&other| self.origins[other] == self.origins[at]).map(|&other| [at, other])
        };
        first.filter(|&at| used[self.origins[at] as usize]).filter_map(same)
    }

    /// The weight of each class in each cell, row-major: the share of its labelled points times the class's weight.
    pub(super) fn targets(&self, of_point: &[u32], cells: usize, weights: &[f32]) -> Vec<f32> {
        let classes = weights.len();
        let mut targets = vec![0.0f32; cells * classes];
        for (&cell, &label) in of_point.iter().zip(&self.labels).filter(|(_, label)| **label != NONE) {
            targets[cell as usize * classes + usize::from(label)] += 1.0;
        }
        for row in targets.chunks_exact_mut(classes) {
            let sum: f32 = row.iter().sum();
            if sum > 0.0 {
                row.iter_mut().zip(weights).for_each(|(t, w)| *t *= w / sum);
            }
        }
        targets
    }
}

/// A change of a part that was drawn at random.
struct Change {
    /// Cosine and sine of the angle, times the scale.
    turn: [f64; 2],
    mirrored: bool,
    scale: f64,
    /// Share of the points that stay.
    keep: f64,
    hidden: Option<usize>,
}

impl Change {
    fn drawn(augment: &Augmentation, width: usize, draws: &mut Stream) -> Self {
        let scale = 1.0 + augment.scale * (2.0 * draws.uniform() - 1.0);
        let angle = if augment.turn { std::f64::consts::TAU * draws.uniform() } else { 0.0 };
        let mirrored = augment.turn && draws.uniform() < 0.5;
        let thinned = draws.uniform() < 0.5;
        let keep = augment.thin + (1.0 - augment.thin) * draws.uniform();
        let hides = width > 0 && draws.uniform() < augment.hide;
        Self {
            turn: [scale * angle.cos(), scale * angle.sin()],
            mirrored,
            scale,
            keep: if thinned { keep } else { 1.0 },
            hidden: hides.then(|| draws.below(width)),
        }
    }

    fn turned(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let x = if self.mirrored { -x } else { x };
        let [cos, sin] = self.turn;
        [cos * x - sin * y, sin * x + cos * y, self.scale * z]
    }

    fn hide(&self, numbers: &mut [f32]) {
        if let Some(hidden) = self.hidden {
            numbers[hidden] = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_points_of_two_views_are_those_of_both_that_may_be_used() {
        // A view, something laid over it, another view.
        let batch = Batch { origins: vec![1, 2, 5, 7, 2, 3, 0, 2, 5, 6, 7], ..Batch::default() };
        let common = |views, unused: usize| {
            let used: Vec<bool> = (0..8).map(|i| i != unused).collect();
            batch.common(views, &used).collect::<Vec<_>>()
        };
        assert_eq!(common([0..4, 6..11], 0), [[1, 7], [2, 8], [3, 10]]);
        assert_eq!(common([0..4, 6..11], 5), [[1, 7], [3, 10]]);
        assert_eq!(common([0..1, 6..11], 0), [[0; 2]; 0]);
        assert_eq!(common([0..4, 6..6], 0), [[0; 2]; 0]);
    }
}
