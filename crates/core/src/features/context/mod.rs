//! Auto-context: what a first classifier says about the surroundings of a point, as features of a second one.
//!
//! Z. Tu, X. Bai, *Auto-context and its application to high-level vision tasks and 3D brain image segmentation*, IEEE
//! TPAMI 32(10), 2010, doi:10.1109/TPAMI.2009.186. Here the context is the mean of the class probabilities in voxels,
//! in cells in plan, and below, above and on top of the point in its own cell; and the shape of the band that likely points form.

mod bands;
mod blocks;
mod stacks;

use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::features::columns::{Columns, TableRows};
use crate::features::definition::{Feature, class_name};
use crate::parallel::{Monitor, map_each};
use bands::Bands;
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
    /// Edges of voxels; of each class, the shape of the points in the 3 x 3 x 3 voxels around a point is taken, each with
    /// the weight of its probability, and the place of the point in it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bands: Vec<f64>,
}

impl Default for ContextParams {
    fn default() -> Self {
        Self {
            voxels: vec![0.5, 1.0, 2.0, 4.0],
            cells: vec![1.0, 2.0, 4.0, 8.0],
            stacks: vec![1.0, 2.0],
            bands: Vec::new(),
        }
    }
}

impl ContextParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a size is outside its range.
    pub fn validate(&self) -> Result<()> {
        for (name, sizes) in [
            ("context.voxels", &self.voxels),
            ("context.cells", &self.cells),
            ("context.stacks", &self.stacks),
            ("context.bands", &self.bands),
        ] {
            if let Some(size) = sizes.iter().find(|&&size| !(0.01..=1e4).contains(&size)) {
                return Err(Error::parameter(name, size, "0.01..10000 metres each"));
            }
        }
        Ok(())
    }

    /// Distance in plan, metres, within which points have an influence.
    pub fn reach(&self) -> f64 {
        let all = self
            .voxels
            .iter()
            .chain(&self.cells)
            .chain(&self.bands)
            .map(|&size| 2.0 * size)
            .chain(self.stacks.iter().copied());
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
        for &size in &self.bands {
            BAND.into_iter().for_each(|feature| add(feature, Some(size)));
        }
        names
    }
}

/// What is described of a band, in the order of [`Bands::describe`].
const BAND: [Feature; bands::VALUES] = [
    Feature::BandMost,
    Feature::BandLength,
    Feature::BandWidth,
    Feature::BandThickness,
    Feature::BandAcross,
    Feature::BandOffset,
    Feature::BandShare,
];

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
    bands: Vec<Bands>,
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
            bands: map_each(&params.bands, monitor, |&size| Bands::new(rated, size, monitor))?,
        })
    }

    /// Number of features.
    pub fn width(&self) -> usize {
        self.classes * self.layers().map(|layer| layer.values()).sum::<usize>()
    }

    /// The context of one of the points, in the order of [`ContextParams::names`].
    pub fn describe(&self, point: RatedPoint<'_>, out: &mut [f32]) {
        let (mut first, mut work) = (0, Vec::new());
        for layer in self.layers() {
            let slots = &mut out[first..first + self.classes * layer.values()];
            match layer.describe(point, layer.cells(&[point])[0], &mut work) {
                Some(values) => slots.copy_from_slice(values),
                None => slots.fill(f32::NAN),
            }
            first += slots.len();
        }
    }

    /// What is described, in the order of the features.
    fn layers(&self) -> impl Iterator<Item = Layer<'_>> {
        std::iter::once(Layer::Own)
            .chain(self.solids.iter().map(Layer::Solid))
            .chain(self.plans.iter().map(Layer::Plan))
            .chain(self.stacks.iter().map(Layer::Stacks))
            .chain(self.bands.iter().map(Layer::Bands))
    }
}

/// One of the points of a context.
#[derive(Clone, Copy, Debug)]
pub struct RatedPoint<'a> {
    /// Its position.
    pub at: [f32; 3],
    /// Its own probabilities, one a class.
    pub own: &'a [f32],
}

/// The point's own probabilities, or its surroundings of one size.
#[derive(Clone, Copy)]
enum Layer<'a> {
    Own,
    Solid(&'a Solid),
    Plan(&'a PlanCells),
    Stacks(&'a Stacks),
    Bands(&'a Bands),
}

impl Layer<'_> {
    /// Number of features of each class.
    const fn values(&self) -> usize {
        match self {
            Self::Own | Self::Solid(_) | Self::Plan(_) => 1,
            Self::Stacks(_) => stacks::VALUES,
            Self::Bands(_) => bands::VALUES,
        }
    }

    /// The cells of some points; `None` if there is no cell, or what is described does not depend on cells.
    fn cells(&self, points: &[RatedPoint<'_>]) -> Vec<Option<u32>> {
        match self {
            Self::Own => vec![None; points.len()],
            Self::Solid(solid) => solid.cells(points),
            Self::Plan(plan) => plan.cells(points),
            Self::Stacks(stacks) => stacks.cells(points),
            Self::Bands(bands) => bands.cells(points),
        }
    }

    /// The features of a point, whose cell is given: each for all classes, then the next. `None` if there is no point in its
    /// surroundings.
    #[inline(always)]
    fn describe<'a>(&'a self, point: RatedPoint<'a>, cell: Option<u32>, work: &'a mut Vec<f32>) -> Option<&'a [f32]> {
        match self {
            Self::Own => Some(point.own),
            Self::Solid(solid) => cell.map(|cell| solid.mean(cell)),
            Self::Plan(plan) => cell.map(|cell| plan.mean(cell)),
            Self::Stacks(stacks) => cell.map(|cell| stacks.describe(point.at[2], cell, work)),
            Self::Bands(bands) => Some(bands.describe(point, cell, work)),
        }
    }
}

/// The context of a part of a cloud, and which of its features are selected.
#[derive(Clone, Debug)]
pub(crate) struct ContextPart {
    context: Context,
    columns: Columns,
}

impl ContextPart {
    /// Selects features by their place in the order of [`ContextParams::names`]; the first stands in column `first`, the
    /// others in those after it.
    pub(crate) fn new(context: Context, features: &[usize], first: usize) -> Self {
        let widths: Vec<usize> = context.layers().map(|layer| context.classes * layer.values()).collect();
        let mut columns = Columns::default();
        for (column, &feature) in (first..).zip(features) {
            let (mut layer, mut within) = (0, feature);
            while within >= widths[layer] {
                within -= widths[layer];
                layer += 1;
            }
            columns.put(layer, within, column);
        }
        Self { context, columns }
    }

    /// Writes the selected features of points into their rows; `point` is the point of a row.
    pub(crate) fn write<'a>(&self, point: impl Fn(usize) -> RatedPoint<'a>, rows: TableRows<'_>) {
        let (width, mut work) = (rows.width, Vec::new());
        rows.together(|places, rows| {
            let points: Vec<RatedPoint<'_>> = places.map(&point).collect();
            for (number, layer) in self.context.layers().enumerate().filter(|(number, _)| self.columns.any(*number)) {
                let cells = layer.cells(&points);
                for ((&point, cell), row) in points.iter().zip(cells).zip(rows.chunks_exact_mut(width)) {
                    self.columns.write(number, layer.describe(point, cell, &mut work), row);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{Eigen3, Sym3};
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
        let params = ContextParams { voxels: vec![0.5, 2.0], cells: vec![1.0], stacks: vec![2.0], bands: Vec::new() };
        let context = Context::new(&rated, &params, &Monitor::default()).unwrap();
        let names = params.names(&[2, 6]);
        assert_eq!((names.len(), context.width()), (14, 14));
        assert_eq!((names[0].as_str(), names[2].as_str(), names[13].as_str()), ("Own_2", "Voxel_2_r0p5", "Top_6_r2"));
        let mut out = vec![0.0; 14];
        for i in (0..4000).step_by(37) {
            let at = scene.points.xyz(i);
            context.describe(RatedPoint { at, own: rated.row(i) }, &mut out);
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
    fn bands_have_the_shape_of_all_points_around_weighted_by_their_probabilities() {
        let Scene { points, mut values } = scene();
        // No point of one corner is likely.
        (0..4000).filter(|&i| points.x[i] > 8.0).for_each(|i| values[2 * i] = 0.0);
        let params = ContextParams { voxels: vec![], cells: vec![], stacks: vec![], bands: vec![2.0] };
        let rated = Rated { points: &points, probabilities: &values, classes: 2 };
        let context = Context::new(&rated, &params, &Monitor::default()).unwrap();
        let names = params.names(&[2, 6]);
        assert_eq!((names.len(), context.width()), (16, 16));
        assert_eq!((names[2].as_str(), names[15].as_str()), ("BandMost_2_r2", "BandShare_6_r2"));
        let (mut out, mut none) = (vec![0.0; 16], 0);
        for i in (0..4000).step_by(37) {
            let at = points.xyz(i);
            context.describe(RatedPoint { at, own: rated.row(i) }, &mut out);
            let near = |p: [f32; 3], a: usize| ((p[a] / 2.0).floor() - (at[a] / 2.0).floor()).abs() <= 1.0;
            let around: Vec<usize> = (0..4000).filter(|&j| (0..3).all(|a| near(points.xyz(j), a))).collect();
            let weight = |j: usize| f64::from(values[2 * j]);
            let sum: f64 = around.iter().map(|&j| weight(j)).sum();
            if sum == 0.0 {
                assert!((1..8).all(|value| out[2 * value].is_nan()), "{i}");
                none += 1;
                continue;
            }
            let place = |j: usize| points.xyz(j).map(f64::from);
            let mean: [f64; 3] =
                std::array::from_fn(|a| around.iter().map(|&j| weight(j) * place(j)[a]).sum::<f64>() / sum);
            let covariance = |a: usize, b: usize| {
                around.iter().map(|&j| weight(j) * (place(j)[a] - mean[a]) * (place(j)[b] - mean[b])).sum::<f64>() / sum
            };
            let shape = Sym3 {
                diagonal: std::array::from_fn(|a| covariance(a, a)),
                off: [covariance(0, 1), covariance(0, 2), covariance(1, 2)],
            };
            let Eigen3 { values: squares, vectors } = shape.eigen();
            let apart: [f64; 3] = std::array::from_fn(|a| f64::from(at[a]) - mean[a]);
            // The length of the cross product with a unit vector is the distance from its line.
            let cross = |a: usize, b: usize| apart[a] * vectors[0][b] - apart[b] * vectors[0][a];
            let across = (cross(0, 1).powi(2) + cross(0, 2).powi(2) + cross(1, 2).powi(2)).sqrt();
            let offset = apart.iter().map(|v| v * v).sum::<f64>().sqrt();
            let most = around.iter().map(|&j| weight(j)).fold(0.0, f64::max);
            let [length, width, thickness] = squares.map(|square| square.max(0.0).sqrt() / 2.0);
            let wanted = [most, length, width, thickness, across / 2.0, offset / 2.0, weight(i) / most];
            for (k, wanted) in wanted.into_iter().enumerate() {
                let (name, found) = (&names[2 * (k + 1)], f64::from(out[2 * (k + 1)]));
                assert!((found - wanted).abs() < 2e-4, "{i} {name} {found} {wanted}");
            }
        }
        assert!(none > 3, "{none}");
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
