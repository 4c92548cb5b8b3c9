//! The streaming predictor: multi-scale features of a cloud, tile by tile and block by block, go to a classifier and are
//! discarded.

use crate::classification::{Classifier, ClassifierScratch, Fingerprint, Predictor};
use crate::cloud::MetricCloud;
use crate::error::{Error, Result};
use crate::features::{
    Context, ContextParams, ContextPart, Extractor, FeatureSet, FeatureTable, Middle, Rated, RatedPoint, Scratch,
    TableRows, Tiles, Wanted,
};
use crate::parallel::{Monitor, map_ordered_with};
use crate::recipes::classify::FeatureFit;
use crate::recipes::classify::candidates::{Candidates, Found, Rows};
use crate::recipes::trained::Stage;
use crate::voxels::cells::index::block_of;
use std::borrow::Cow;

/// Number of blocks that are classified together: the more rows share a path through a tree, the cheaper it is.
const TOGETHER: usize = 8;

/// Number of groups of blocks whose probabilities are held at a time.
const GROUPS_AT_ONCE: usize = 32;

/// Features of a cloud that are computed while they are classified.
pub(in crate::recipes) struct CloudPredictor<'a> {
    tiles: Tiles<'a>,
    classifier: &'a Classifier,
    /// Columns of the classifier.
    names: &'a [String],
    /// Summary of the samples that it was trained on.
    training: Option<&'a Fingerprint>,
    beside: Beside<'a>,
    /// Edge of the voxels, metres, of which only the point in the middle is rated; `None` if all points are.
    voxel: Option<f64>,
    /// Of each point of the cloud, whether it is rated; empty if all points are.
    only: Vec<bool>,
    /// Points that may be cars, if cars are looked for.
    candidates: Option<Candidates<'a>>,
}

/// Columns beside those of the tiles.
enum Beside<'a> {
    Nothing,
    /// Before them.
    First(FirstColumns<'a>),
    /// After them.
    Context(ContextColumns<'a>),
}

/// A classifier whose first columns were computed for all points before; all features of a set follow them.
pub(in crate::recipes) struct FirstColumns<'a> {
    pub(in crate::recipes) classifier: &'a Classifier,
    /// One row for each classified point.
    pub(in crate::recipes) table: &'a FeatureTable,
    /// The row of each point of the cloud.
    pub(in crate::recipes) row_of: &'a [u32],
}

/// Columns of what a first classifier says about the surroundings.
pub(in crate::recipes) struct ContextColumns<'a> {
    /// Class probabilities of the first classifier for each point of the cloud, row-major.
    pub(in crate::recipes) probabilities: &'a [f32],
    /// Sizes of the surroundings.
    pub(in crate::recipes) params: &'a ContextParams,
    /// Class codes, for the names.
    pub(in crate::recipes) codes: &'a [u8],
}

impl ContextColumns<'_> {
    /// The context of the points of an extractor; the features `names` stand after the extractor's own.
    ///
    /// # Errors
    /// If a name is unknown, or the work was cancelled.
    fn of_part(
        &self,
        tiles: &Tiles<'_>,
        extractor: &Extractor<'_>,
        names: &[String],
        monitor: &Monitor,
    ) -> Result<ContextPart> {
        let all = self.params.names(self.codes);
        let position = |name: &String| {
            let unknown =
                || Error::ModelMismatch(format!("it needs the feature {name}, which its recipe does not give"));
            all.iter().position(|other| other == name).ok_or_else(unknown)
        };
        let features = names.iter().map(position).collect::<Result<Vec<_>>>()?;
        let near = tiles.around(&extractor.points().positions, self.params.reach(), monitor)?;
        let mut probabilities = Vec::with_capacity(near.len() * self.codes.len());
        near.frame.index.iter().for_each(|&point| probabilities.extend_from_slice(self.of(point)));
        let rated = Rated { points: &near.positions, probabilities: &probabilities, classes: self.codes.len() };
        let context = Context::new(&rated, self.params, monitor)?;
        Ok(ContextPart::new(context, &features, extractor.names().len()))
    }

    /// The probabilities of a point of the cloud.
    fn of(&self, point: u32) -> &[f32] {
        &self.probabilities[point as usize * self.codes.len()..][..self.codes.len()]
    }
}

/// How many feature values of a cloud lie where few or none of the training samples are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::recipes) struct Fit {
    /// Values looked at.
    values: u64,
    /// Those below the 5 % quantile or above the 95 % quantile of the training samples.
    outside: u64,
    /// Those below the lowest or above the highest of the training samples.
    beyond: u64,
}

impl Fit {
    fn add(&mut self, other: Self) {
        self.values += other.values;
        self.outside += other.outside;
        self.beyond += other.beyond;
    }

    /// Counts the values of a row.
    pub(in crate::recipes) fn look(&mut self, row: &[f32], training: &Fingerprint) {
        let levels = training.quantiles.chunks_exact(Fingerprint::LEVELS.len());
        for (value, levels) in row.iter().zip(levels).filter(|(value, _)| value.is_finite()) {
            self.values += 1;
            self.outside += u64::from(*value < levels[1] || *value > levels[3]);
            self.beyond += u64::from(*value < levels[0] || *value > levels[4]);
        }
    }

    /// The shares of the values; `None` if none was looked at.
    pub(in crate::recipes) fn shares(&self) -> Option<FeatureFit> {
        let share = |count: u64| count as f64 / self.values as f64;
        (self.values > 0).then(|| FeatureFit { outside: share(self.outside), beyond: share(self.beyond) })
    }
}

/// What a classifier says about points.
pub(in crate::recipes) struct Rating {
    /// Class probabilities, row-major.
    pub(in crate::recipes) probabilities: Vec<f32>,
    /// The probability of each point to be a car, 0 for those that are no candidates; empty if cars were not looked for.
    pub(in crate::recipes) cars: Vec<f32>,
    /// How the features compare with those of the training.
    pub(in crate::recipes) fit: Fit,
}

/// One point of this many is compared with the training samples.
pub(in crate::recipes) const LOOKED_AT: u32 = 16;

/// Points of a group of blocks and their class probabilities.
pub(in crate::recipes) struct Group {
    /// Indices in the cloud.
    pub(in crate::recipes) points: Vec<u32>,
    /// Row-major.
    pub(in crate::recipes) probabilities: Vec<f32>,
    /// Those that may be cars.
    pub(in crate::recipes) candidates: Found,
    /// Rows of the extractor that need a wider margin.
    loose: Vec<usize>,
    fit: Fit,
}

impl Group {
    /// Puts the probability that it is a car at the place of each point, 0 for those that are no candidates; nothing if
    /// `cars` is empty.
    pub(in crate::recipes) fn place_cars(&self, cars: &mut [f32], place: impl Fn(u32) -> usize) {
        if cars.is_empty() {
            return;
        }
        self.points.iter().for_each(|&point| cars[place(point)] = 0.0);
        for (&candidate, &car) in self.candidates.places.iter().zip(&self.candidates.cars) {
            cars[place(self.points[candidate as usize])] = car;
        }
    }
}

/// Points of a part, and what a first classifier says about their surroundings.
struct Part<'a> {
    extractor: &'a Extractor<'a>,
    context: Option<&'a ContextPart>,
}

#[derive(Default)]
struct Workspace {
    scratch: Scratch,
    block: Vec<f32>,
    rows: Vec<f32>,
    classifier: ClassifierScratch,
    cars: ClassifierScratch,
}

impl<'a> CloudPredictor<'a> {
    /// Sorts the points of a cloud and prepares the features of the set that a classifier uses.
    ///
    /// # Errors
    /// If the set does not have a feature of the classifier, or as [`Tiles::prepare`].
    pub(in crate::recipes) fn new(
        scene: &MetricCloud<'a>,
        set: &FeatureSet,
        stage: Stage<'a>,
        monitor: &Monitor,
    ) -> Result<Self> {
        let known = set.names(set.pyramid.first_scale.unwrap_or_default());
        if let Some(name) = stage.names.iter().find(|name| !known.contains(name)) {
            return Err(Error::ModelMismatch(format!(
                "it needs the feature {name}; its recipe gives {} others",
                known.len()
            )));
        }
        let tiles = Tiles::prepare(scene, set, Wanted::Names(stage.names), monitor)?;
        Ok(Self {
            tiles,
            classifier: stage.classifier,
            names: stage.names,
            training: stage.training,
            beside: Beside::Nothing,
            voxel: None,
            only: Vec::new(),
            candidates: None,
        })
    }

    /// The same for a classifier with columns before those of the set.
    ///
    /// # Errors
    /// As [`Tiles::prepare`].
    pub(in crate::recipes) fn after(
        first: FirstColumns<'a>,
        scene: &MetricCloud<'a>,
        set: &FeatureSet,
        monitor: &Monitor,
    ) -> Result<Self> {
        let (tiles, classifier) = (Tiles::prepare(scene, set, Wanted::All, monitor)?, first.classifier);
        Ok(Self {
            tiles,
            classifier,
            names: &[],
            training: None,
            beside: Beside::First(first),
            voxel: None,
            only: Vec::new(),
            candidates: None,
        })
    }

    /// The same points for the second of two classifiers, whose columns are features of the set, then those of the
    /// context; it may use only some of both.
    ///
    /// # Errors
    /// As [`CloudPredictor::new`].
    pub(in crate::recipes) fn second(
        self,
        scene: &MetricCloud<'a>,
        stage: Stage<'a>,
        context: ContextColumns<'a>,
        monitor: &Monitor,
    ) -> Result<Self> {
        let known = self.tiles.offered();
        let own = stage.names.iter().take_while(|name| known.contains(name)).count();
        let tiles = self.tiles.reselect(scene, Wanted::Names(&stage.names[..own]), monitor)?;
        Ok(Self {
            tiles,
            classifier: stage.classifier,
            names: stage.names,
            training: stage.training,
            beside: Beside::Context(context),
            voxel: None,
            only: Vec::new(),
            candidates: None,
        })
    }

    /// Rates only the point in the middle of each voxel of this edge, metres; the others get its probabilities. 0: rates
    /// every point.
    pub(in crate::recipes) fn by_voxel(self, edge: f64) -> Self {
        Self { voxel: Some(edge).filter(|&edge| edge > 0.0), ..self }
    }

    /// Rates only these points of the cloud; the others get zeros. Not together with [`CloudPredictor::by_voxel`].
    pub(in crate::recipes) fn only(self, only: Vec<bool>) -> Self {
        Self { only, ..self }
    }

    /// Looks for points that may be cars as well.
    pub(in crate::recipes) fn with_candidates(self, candidates: Option<Candidates<'a>>) -> Self {
        Self { candidates, ..self }
    }

    /// Of each voxel, the only point that is rated; nothing if all points are. The voxels are found anew, because a thin cloud
    /// has nearly as many as points.
    fn middles(&self) -> impl Iterator<Item = Middle> {
        self.voxel.into_iter().flat_map(|edge| self.tiles.middles(edge))
    }

    /// Gives each point the probabilities of the point in the middle of its voxel.
    fn spread(&self, values: &mut [f32], row_of: impl Fn(u32) -> usize) {
        let (classes, index) = (self.classifier.classes(), self.tiles.indices());
        let mut first = 0;
        for middle in self.middles() {
            let from = row_of(index[middle.place as usize]) * classes;
            for place in (first..middle.end).filter(|&place| place != middle.place) {
                values.copy_within(from..from + classes, row_of(index[place as usize]) * classes);
            }
            first = middle.end;
        }
    }

    /// Class probabilities of all `points` points of the cloud; 0 for those that have no features.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::recipes) fn of_cloud(&self, points: usize, monitor: &Monitor) -> Result<Rating> {
        let classes = self.classifier.classes();
        let mut values = vec![0.0; points * classes];
        let place = |group: &Group| {
            for (&point, row) in group.points.iter().zip(group.probabilities.chunks_exact(classes)) {
                values[point as usize * classes..][..classes].copy_from_slice(row);
            }
        };
        let fit = self.run(place, monitor)?;
        self.spread(&mut values, |point| point as usize);
        Ok(Rating { probabilities: values, cars: Vec::new(), fit })
    }

    /// Class probabilities of `rows` points, row-major; `row_of` is the row of each point of the cloud.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::recipes) fn of_points(&self, row_of: &[u32], rows: usize, monitor: &Monitor) -> Result<Rating> {
        let classes = self.classifier.classes();
        let mut values = vec![0.0; rows * classes];
        let mut cars = vec![0.0; if self.candidates.is_some() { rows } else { 0 }];
        let row = |point: u32| row_of[point as usize] as usize;
        let place = |group: &Group| {
            for (&point, own) in group.points.iter().zip(group.probabilities.chunks_exact(classes)) {
                values[row(point) * classes..][..classes].copy_from_slice(own);
            }
            group.place_cars(&mut cars, row);
        };
        let fit = self.run(place, monitor)?;
        self.spread(&mut values, row);
        Ok(Rating { probabilities: values, cars, fit })
    }

    /// Gives `sink` each group of points. A point may be given more than once; what is given last is valid. Returns how
    /// the features compare with those of the training.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::recipes) fn run(&self, mut sink: impl FnMut(&Group), monitor: &Monitor) -> Result<Fit> {
        let rated = self.rated();
        let count = if rated.is_empty() { self.tiles.len() } else { rated.iter().filter(|&&rated| rated).count() };
        monitor.stage("classify", count as u64);
        let (mut around, mut fit) = (None, Fit::default());
        self.tiles.each(
            |point| rated.is_empty() || rated[point as usize],
            monitor,
            |extractor| {
                if let Beside::Context(columns) = &self.beside
                    && around.as_ref().is_none_or(|(part, _)| *part != extractor.part())
                {
                    let names = &self.names[self.tiles.names().len()..];
                    around = Some((extractor.part(), columns.of_part(&self.tiles, extractor, names, monitor)?));
                }
                let part = Part { extractor, context: around.as_ref().map(|(_, context)| context) };
                let mut sink = |group: &Group| {
                    fit.add(group.fit);
                    sink(group);
                };
                let loose = self.all_blocks(&part, &mut sink, monitor)?;
                if loose.is_empty() {
                    // Most likely done with this part: its context is dropped before anything of the next is built.
                    around = None;
                }
                Ok(loose)
            },
        )?;
        Ok(fit)
    }

    /// For each point of the cloud, whether it is rated; empty if all are.
    fn rated(&self) -> Cow<'_, [bool]> {
        if self.voxel.is_none() {
            return Cow::Borrowed(&self.only);
        }
        let index = self.tiles.indices();
        let mut rated = vec![false; index.iter().max().map_or(0, |&last| last as usize + 1)];
        self.middles().for_each(|middle| rated[index[middle.place as usize] as usize] = true);
        Cow::Owned(rated)
    }

    /// Classifies the points of an extractor; returns the rows that need a wider margin.
    fn all_blocks(&self, part: &Part<'_>, sink: &mut impl FnMut(&Group), monitor: &Monitor) -> Result<Vec<usize>> {
        let groups = part.extractor.blocks().div_ceil(TOGETHER);
        let mut loose = Vec::new();
        for first in (0..groups).step_by(GROUPS_AT_ONCE) {
            let range = first..(first + GROUPS_AT_ONCE).min(groups);
            let found = map_ordered_with(range, monitor, Workspace::default, |work, group| {
                self.group(group, part, work, monitor)
            })?;
            for group in found {
                sink(&group);
                monitor.advance((group.points.len() - group.loose.len()) as u64);
                loose.extend(group.loose);
            }
        }
        Ok(loose)
    }

    fn group(&self, group: usize, part: &Part<'_>, work: &mut Workspace, monitor: &Monitor) -> Result<Group> {
        let extractor = part.extractor;
        let (mut points, mut loose) = (Vec::new(), Vec::new());
        work.rows.clear();
        for block in block_of(group, TOGETHER, extractor.blocks()) {
            monitor.check()?;
            let here = extractor.block(block, &mut work.scratch, &mut work.block);
            let (first, width) = (points.len(), extractor.names().len());
            let own = |r: usize| &work.block[r * width..(r + 1) * width];
            match (&self.beside, part.context) {
                (Beside::First(before), _) => {
                    for (r, &point) in here.iter().enumerate() {
                        work.rows.extend_from_slice(before.table.row(before.row_of[point as usize] as usize));
                        work.rows.extend_from_slice(own(r));
                    }
                }
                (Beside::Context(columns), Some(context)) => {
                    let wide = self.names.len();
                    work.rows.resize((first + here.len()) * wide, 0.0);
                    let rows = &mut work.rows[first * wide..];
                    let each = rows.chunks_exact_mut(wide).enumerate();
                    each.for_each(|(r, row)| row[..width].copy_from_slice(own(r)));
                    let rated = |r: usize| RatedPoint {
                        at: extractor.points().positions.xyz(block * Extractor::BLOCK + r),
                        own: columns.of(here[r]),
                    };
                    context.write(rated, TableRows { values: rows, width: wide });
                }
                _ => work.rows.extend_from_slice(&work.block),
            }
            points.extend_from_slice(here);
            loose.extend(work.scratch.loose().iter().map(|&row| block * Extractor::BLOCK + row as usize));
        }
        let mut probabilities = vec![0.0; points.len() * self.classifier.classes()];
        self.classifier.predict_block(&work.rows, &mut work.classifier, &mut probabilities)?;
        let mut fit = Fit::default();
        if let Some(training) = self.training {
            let rows = work.rows.chunks_exact(self.names.len());
            let looked_at = points.iter().zip(rows).filter(|(point, _)| *point % LOOKED_AT == 0);
            looked_at.for_each(|(_, row)| fit.look(row, training));
        }
        let candidates = match &self.candidates {
            Some(wanted) => {
                let rows = Rows { points: &points, features: &work.rows, probabilities: &probabilities };
                wanted.among(rows, &mut work.cars)?
            }
            None => Found::default(),
        };
        Ok(Group { points, probabilities, candidates, loose, fit })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_last_is_valid() {
        let group = |points: &[u32], places: &[u32], cars: &[f32]| Group {
            points: points.to_vec(),
            probabilities: Vec::new(),
            candidates: Found { places: places.to_vec(), cars: cars.to_vec(), features: Vec::new() },
            loose: Vec::new(),
            fit: Fit::default(),
        };
        let mut cars = vec![0.0; 4];
        group(&[3, 1, 0], &[0, 1], &[0.9, 0.8]).place_cars(&mut cars, |point| point as usize);
        assert_eq!(cars, [0.0, 0.8, 0.0, 0.9]);
        group(&[2, 1], &[0], &[0.7]).place_cars(&mut cars, |point| point as usize);
        assert_eq!(cars, [0.0, 0.0, 0.7, 0.9]);
        group(&[2, 1], &[0], &[0.7]).place_cars(&mut [], |point| point as usize);
    }
}
