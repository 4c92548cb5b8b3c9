//! Auto-context: what a first classifier says about the surroundings of a point, as features of a second one.
//!
//! Z. Tu, X. Bai, *Auto-context and its application to high-level vision tasks and 3D brain image segmentation*, IEEE
//! TPAMI 32(10), 2010, doi:10.1109/TPAMI.2009.186. Here the context is the mean of the class probabilities in voxels,
//! in cells in plan, and below, above and on top of the point in its own cell.

mod blocks;
mod stacks;

use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::features::definition::{Feature, class_name};
use crate::parallel::{Monitor, map_each};
use blocks::{PlanCells, Solid};
use serde::{Deserialize, Serialize};
use stacks::Stacks;

/// Sizes of the surroundings, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContextParams {
    /// Edges of voxels; the surroundings are the 3 x 3 x 3 voxels around a point.
    pub voxels: Vec<f64>,
    /// Edges of cells in plan; the surroundings are the 3 x 3 cells around a point, at all heights.
    pub cells: Vec<f64>,
    /// Edges of cells in plan in which what lies below and above the point, and the highest point, are taken apart.
    pub stacks: Vec<f64>,
}

impl Default for ContextParams {
    fn default() -> Self {
        Self { voxels: vec![0.5, 1.0, 2.0, 4.0], cells: vec![1.0, 2.0, 4.0, 8.0], stacks: vec![1.0, 2.0] }
    }
}

impl ContextParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a size is outside its range.
    pub fn validate(&self) -> Result<()> {
        for (name, sizes) in
            [("context.voxels", &self.voxels), ("context.cells", &self.cells), ("context.stacks", &self.stacks)]
        {
            if let Some(size) = sizes.iter().find(|&&size| !(0.01..=1e4).contains(&size)) {
                return Err(Error::parameter(name, size, "0.01..10000 metres each"));
            }
        }
        Ok(())
    }

    /// Distance in plan, metres, within which points have an influence.
    pub fn reach(&self) -> f64 {
        let all = self.voxels.iter().chain(&self.cells).map(|&size| 2.0 * size).chain(self.stacks.iter().copied());
        all.fold(0.0, f64::max)
    }

    /// Names of the features of the group `context` for classes of these codes, each with the code and the size.
    pub fn names(&self, codes: &[u8]) -> Vec<String> {
        let mut names = Vec::new();
        let mut add = |feature: Feature, size: Option<f64>| {
            names.extend(codes.iter().map(|&code| class_name(feature.definition(), code, size)));
        };
        add(Feature::ContextOwn, None);
        self.voxels.iter().for_each(|&size| add(Feature::ContextVoxel, Some(size)));
        self.cells.iter().for_each(|&size| add(Feature::ContextCell, Some(size)));
        for &size in &self.stacks {
            let stack = [Feature::ContextBelow, Feature::ContextAbove, Feature::ContextTop];
            stack.into_iter().for_each(|feature| add(feature, Some(size)));
        }
        names
    }
}

/// Points with the probabilities of a first classifier.
#[derive(Clone, Copy, Debug)]
pub struct Rated<'a> {
    /// The points.
    pub points: &'a Positions,
    /// Row-major `points x classes`, 0..=1.
    pub probabilities: &'a [f32],
    /// Number of classes.
    pub classes: usize,
}

impl Rated<'_> {
    fn row(&self, point: usize) -> &[f32] {
        &self.probabilities[point * self.classes..][..self.classes]
    }

    /// Appends the sums of the probabilities of some points.
    fn add_sums(&self, points: &[u32], out: &mut Vec<f32>) {
        let sum = |class: usize| points.iter().map(|&point| f64::from(self.row(point as usize)[class])).sum::<f64>();
        out.extend((0..self.classes).map(|class| sum(class) as f32));
    }
}

/// The context of the points of a cloud, or of a part with all points within [`ContextParams::reach`].
#[derive(Clone, Debug, Default)]
pub struct Context {
    classes: usize,
    solids: Vec<Solid>,
    plans: Vec<PlanCells>,
    stacks: Vec<Stacks>,
}

impl Context {
    /// Sorts the points into cells of each size. O(n log n) a size; about (8 + 4 classes) bytes a cell, and as many a
    /// point for each size of stacks. The same bytes for any number of threads.
    ///
    /// # Errors
    /// If there is not one row of probabilities a point, a size is out of range, or the work was cancelled.
    pub fn new(rated: &Rated<'_>, params: &ContextParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        let (points, values) = (rated.points.len(), rated.probabilities.len());
        if rated.classes == 0 || points * rated.classes != values {
            return Err(Error::input(format!(
                "{values} probabilities for {points} points of {} classes",
                rated.classes
            )));
        }
        Ok(Self {
            classes: rated.classes,
            solids: map_each(&params.voxels, monitor, |&size| Solid::new(rated, size, monitor))?,
            plans: map_each(&params.cells, monitor, |&size| PlanCells::new(rated, size, monitor))?,
            stacks: map_each(&params.stacks, monitor, |&size| Stacks::new(rated, size, monitor))?,
        })
    }

    /// Number of features.
    pub fn width(&self) -> usize {
        self.classes * (1 + self.solids.len() + self.plans.len() + 3 * self.stacks.len())
    }

    /// The context of one of the points, whose own probabilities are `own`, in the order of [`ContextParams::names`].
    pub fn describe(&self, at: [f32; 3], own: &[f32], out: &mut [f32]) {
        let mut slots = out.chunks_exact_mut(self.classes);
        let mut next = || slots.next().unwrap_or_default();
        next().copy_from_slice(own);
        self.solids.iter().for_each(|solid| solid.mean(at, next()));
        self.plans.iter().for_each(|plan| plan.mean(at, next()));
        for stacks in &self.stacks {
            stacks.describe(at, [next(), next(), next()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    struct Scene {
        points: Positions,
        values: Vec<f32>,
    }

    fn scene() -> Scene {
        let mut s = stream(9, 3);
        let points: Positions = (0..4000)
            .map(|_| [s.uniform() * 20.0 - 5.0, s.uniform() * 15.0, s.uniform() * 8.0].map(|v| v as f32))
            .collect();
        let values = (0..4000).flat_map(|_| {
            let p = s.uniform() as f32;
            [p, 1.0 - p]
        });
        let values = values.collect();
        Scene { points, values }
    }

    /// Mean of the first class over the points for which `wanted` holds.
    fn mean(scene: &Scene, wanted: impl Fn([f32; 3]) -> bool) -> f32 {
        let all = scene.points.iter().zip(scene.values.chunks(2)).filter(|(p, _)| wanted(*p));
        let (sum, n) = all.fold((0.0f64, 0.0), |(sum, n), (_, v)| (sum + f64::from(v[0]), n + 1.0));
        (sum / n) as f32
    }

    #[test]
    fn means_are_those_of_looking_at_every_point() {
        let scene = scene();
        let rated = Rated { points: &scene.points, probabilities: &scene.values, classes: 2 };
        let params = ContextParams { voxels: vec![0.5, 2.0], cells: vec![1.0], stacks: vec![2.0] };
        let context = Context::new(&rated, &params, &Monitor::default()).unwrap();
        let names = params.names(&[2, 6]);
        assert_eq!((names.len(), context.width()), (14, 14));
        assert_eq!((names[0].as_str(), names[2].as_str(), names[13].as_str()), ("Own_2", "Voxel_2_r0p5", "Top_6_r2"));
        let mut out = vec![0.0; 14];
        for i in (0..4000).step_by(37) {
            let at = scene.points.xyz(i);
            context.describe(at, rated.row(i), &mut out);
            let near = |p: [f32; 3], a: usize, size: f32| ((p[a] / size).floor() - (at[a] / size).floor()).abs() <= 1.0;
            let same = |p: [f32; 3], a: usize| (p[a] / 2.0).floor() == (at[a] / 2.0).floor();
            let stack = |p: [f32; 3]| same(p, 0) && same(p, 1);
            let top = scene.points.iter().filter(|p| stack(*p)).map(|p| p[2]).fold(f32::MIN, f32::max);
            let wanted = [
                scene.values[2 * i],
                mean(&scene, |p| (0..3).all(|a| near(p, a, 0.5))),
                mean(&scene, |p| (0..3).all(|a| near(p, a, 2.0))),
                mean(&scene, |p| (0..2).all(|a| near(p, a, 1.0))),
                mean(&scene, |p| stack(p) && p[2] <= at[2]),
                mean(&scene, |p| stack(p) && p[2] >= at[2]),
                mean(&scene, |p| stack(p) && p[2] == top),
            ];
            for (k, wanted) in wanted.into_iter().enumerate() {
                assert!((out[2 * k] - wanted).abs() < 1e-4, "{i} {} {} {wanted}", names[2 * k], out[2 * k]);
                assert!((out[2 * k] + out[2 * k + 1] - 1.0).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn sizes_out_of_range_and_rows_that_are_missing_are_refused() {
        let scene = scene();
        let rated = Rated { points: &scene.points, probabilities: &scene.values[2..], classes: 2 };
        assert!(Context::new(&rated, &ContextParams::default(), &Monitor::default()).is_err());
        let wrong = ContextParams { cells: vec![0.0], ..ContextParams::default() };
        assert!(wrong.validate().unwrap_err().to_string().contains("context.cells"));
        assert_eq!(ContextParams::default().reach(), 16.0);
    }
}
