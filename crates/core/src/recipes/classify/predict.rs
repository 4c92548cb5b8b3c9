//! The streaming predictor: multi-scale features of a cloud, tile by tile and block by block, go to a classifier and are
//! discarded.

use crate::classification::{Classifier, ClassifierScratch, Predictor};
use crate::cloud::MetricCloud;
use crate::error::{Error, Result};
use crate::features::{Extractor, FeatureSet, FeatureTable, Scratch, Tiles, Wanted};
use crate::parallel::{Monitor, map_ordered_with};
use crate::recipes::model::Model;

/// Number of blocks that are classified together: the more rows share a path through a tree, the cheaper it is.
const TOGETHER: usize = 8;

/// Number of groups of blocks whose probabilities are held at a time.
const GROUPS_AT_ONCE: usize = 32;

/// Features of a cloud that are computed while they are classified.
pub(in crate::recipes) struct CloudPredictor<'a> {
    tiles: Tiles<'a>,
    classifier: &'a Classifier,
    /// Columns before those of the tiles.
    first: Option<FirstColumns<'a>>,
}

/// Columns that were computed for all points before.
pub(in crate::recipes) struct FirstColumns<'a> {
    /// One row for each classified point.
    pub(in crate::recipes) table: &'a FeatureTable,
    /// The row of each point of the cloud.
    pub(in crate::recipes) row_of: &'a [u32],
}

/// Points of a group of blocks and their class probabilities.
struct Group {
    points: Vec<u32>,
    probabilities: Vec<f32>,
    /// Rows of the extractor that need a wider margin.
    loose: Vec<usize>,
}

#[derive(Default)]
struct Workspace {
    scratch: Scratch,
    block: Vec<f32>,
    rows: Vec<f32>,
    classifier: ClassifierScratch,
}

impl<'a> CloudPredictor<'a> {
    /// Sorts the points of a cloud and prepares the features of the set that the model uses.
    ///
    /// # Errors
    /// If the set does not have a feature of the model, or as [`Tiles::prepare`].
    pub(in crate::recipes) fn new(
        scene: &MetricCloud<'a>,
        set: &FeatureSet,
        model: &'a Model,
        monitor: &Monitor,
    ) -> Result<Self> {
        let known = set.names(set.pyramid.first_scale.unwrap_or_default());
        if let Some(name) = model.feature_names.iter().find(|name| !known.contains(name)) {
            return Err(Error::ModelMismatch(format!(
                "it needs the feature {name}; its recipe gives {} others",
                known.len()
            )));
        }
        let tiles = Tiles::prepare(scene, set, Wanted::Names(&model.feature_names), monitor)?;
        Ok(Self { tiles, classifier: &model.classifier, first: None })
    }

    /// The same for a classifier whose columns are `first`, then all features of the set.
    ///
    /// # Errors
    /// As [`Tiles::prepare`].
    pub(in crate::recipes) fn after(
        first: FirstColumns<'a>,
        scene: &MetricCloud<'a>,
        set: &FeatureSet,
        classifier: &'a Classifier,
        monitor: &Monitor,
    ) -> Result<Self> {
        let tiles = Tiles::prepare(scene, set, Wanted::All, monitor)?;
        Ok(Self { tiles, classifier, first: Some(first) })
    }

    /// Class probabilities of `rows` points, row-major; `row_of` is the row of each point of the cloud.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::recipes) fn of_points(&self, row_of: &[u32], rows: usize, monitor: &Monitor) -> Result<Vec<f32>> {
        let classes = self.classifier.classes();
        let mut values = vec![0.0; rows * classes];
        let place = |points: &[u32], rows: &[f32]| {
            for (&point, row) in points.iter().zip(rows.chunks_exact(classes)) {
                values[row_of[point as usize] as usize * classes..][..classes].copy_from_slice(row);
            }
        };
        self.run(place, monitor)?;
        Ok(values)
    }

    /// Gives `sink` the points of each group, as indices in the cloud, and their class probabilities, row-major. A point
    /// may be given more than once; its last probabilities are the valid ones.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::recipes) fn run(&self, mut sink: impl FnMut(&[u32], &[f32]), monitor: &Monitor) -> Result<()> {
        monitor.stage("classify", self.tiles.len() as u64);
        self.tiles.each(|_| true, monitor, |extractor| self.all_blocks(extractor, &mut sink, monitor))
    }

    /// Classifies the points of an extractor; returns the rows that need a wider margin.
    fn all_blocks(
        &self,
        extractor: &Extractor<'_>,
        sink: &mut impl FnMut(&[u32], &[f32]),
        monitor: &Monitor,
    ) -> Result<Vec<usize>> {
        let groups = extractor.blocks().div_ceil(TOGETHER);
        let mut loose = Vec::new();
        for first in (0..groups).step_by(GROUPS_AT_ONCE) {
            let range = first..(first + GROUPS_AT_ONCE).min(groups);
            let found = map_ordered_with(range, monitor, Workspace::default, |work, group| {
                self.group(group, extractor, work, monitor)
            })?;
            for group in found {
                sink(&group.points, &group.probabilities);
                monitor.advance((group.points.len() - group.loose.len()) as u64);
                loose.extend(group.loose);
            }
        }
        Ok(loose)
    }

    fn group(&self, group: usize, extractor: &Extractor<'_>, work: &mut Workspace, monitor: &Monitor) -> Result<Group> {
        let (mut points, mut loose) = (Vec::new(), Vec::new());
        work.rows.clear();
        for block in group * TOGETHER..((group + 1) * TOGETHER).min(extractor.blocks()) {
            monitor.check()?;
            let here = extractor.block(block, &mut work.scratch, &mut work.block);
            points.extend_from_slice(here);
            match &self.first {
                None => work.rows.extend_from_slice(&work.block),
                Some(first) => {
                    for (&point, row) in here.iter().zip(work.block.chunks_exact(extractor.names().len())) {
                        work.rows.extend_from_slice(first.table.row(first.row_of[point as usize] as usize));
                        work.rows.extend_from_slice(row);
                    }
                }
            }
            loose.extend(work.scratch.loose().iter().map(|&row| block * Extractor::BLOCK + row as usize));
        }
        let mut probabilities = vec![0.0; points.len() * self.classifier.classes()];
        self.classifier.predict_block(&work.rows, &mut work.classifier, &mut probabilities)?;
        Ok(Group { points, probabilities, loose })
    }
}
