//! Features of points: the six descriptors of Guinard & Landrieu 2017, section 2, and multi-scale features.

use super::{Descriptors, WeakRecipe};
use crate::classification::{Classifier, PredictScratch};
use crate::cloud::{Cloud, Points};
use crate::error::Result;
use crate::features::{Extractor, FeatureSet, FeatureTable, Scratch, Wanted, optimal_features, table_at};
use crate::parallel::{Monitor, map_ordered_with};
use crate::terrain::{DESCRIPTORS, Terrain};

/// Section 2.1: the four local descriptors.
pub(super) fn local(points: &Points, recipe: &WeakRecipe, monitor: &Monitor) -> Result<FeatureTable> {
    monitor.stage("describe", points.len() as u64);
    Ok(optimal_features(points, &recipe.neighbourhood, monitor)?.table)
}

/// Number of blocks that are classified together: the more rows share a path through a tree, the cheaper it is.
const TOGETHER: usize = 4;

/// Number of groups of blocks whose probabilities are held at a time.
const AT_ONCE: usize = 32;

/// Section 2.2: the local descriptors, height above the road and position with respect to it.
pub(super) fn six(
    cloud: &Cloud,
    points: &Points,
    local: FeatureTable,
    recipe: &WeakRecipe,
    monitor: &Monitor,
) -> Result<FeatureTable> {
    monitor.stage("road", 0);
    let mut forest = recipe.forest.clone();
    forest.seed = forest.seed.wrapping_add(recipe.seed);
    let Terrain { elevation, position } = recipe.road.describe((cloud, points), &local, &forest, monitor)?;
    let names = local.names.iter().cloned().chain(DESCRIPTORS.iter().map(|d| d.name.to_string())).collect();
    let mut values = Vec::with_capacity(points.len() * (local.width() + 2));
    for (row, (height, place)) in local.values.chunks_exact(local.width()).zip(elevation.iter().zip(&position)) {
        values.extend_from_slice(row);
        values.extend([height, place]);
    }
    Ok(FeatureTable { names, values })
}

/// The points of a cloud and their six descriptors.
pub(super) struct Described<'a> {
    pub(super) cloud: &'a Cloud,
    pub(super) points: Points,
    pub(super) six: FeatureTable,
}

/// The features besides the six descriptors, if any.
pub(super) fn more(recipe: &WeakRecipe, metres: Option<f64>) -> Option<FeatureSet> {
    let mut set = recipe.features.clone();
    set.metres_per_unit = metres.or(set.metres_per_unit);
    (recipe.descriptors == Descriptors::MultiScale).then_some(set)
}

/// The rows of these points.
pub(super) fn select(table: &FeatureTable, at: &[u32]) -> FeatureTable {
    let values = at.iter().flat_map(|&point| table.row(point as usize)).copied().collect();
    FeatureTable { names: table.names.clone(), values }
}

/// All feature columns of some points whose six descriptors are known, and the finest scale; `places` are their indices
/// in the cloud.
pub(super) fn rows(
    cloud: &Cloud,
    (six, places): (FeatureTable, &[u32]),
    more: Option<&FeatureSet>,
    monitor: &Monitor,
) -> Result<(FeatureTable, Option<f64>)> {
    let Some(set) = more else { return Ok((six, None)) };
    let (scaled, scale) = table_at(cloud, set, places, monitor)?;
    let names: Vec<String> = six.names.iter().chain(&scaled.names).cloned().collect();
    let mut values = Vec::with_capacity(places.len() * names.len());
    for row in 0..places.len() {
        values.extend_from_slice(six.row(row));
        values.extend_from_slice(scaled.row(row));
    }
    Ok((FeatureTable { names, values }, Some(scale)))
}

impl Described<'_> {
    /// Names of all columns.
    pub(super) fn names(&self, more: Option<&FeatureSet>) -> Vec<String> {
        let scaled = more.map(|set| set.names(set.pyramid.first_scale.unwrap_or_default()));
        self.six.names.iter().cloned().chain(scaled.unwrap_or_default()).collect()
    }

    /// Class probabilities of all points, row-major; multi-scale features are computed and discarded block by block.
    pub(super) fn probabilities(
        &self,
        classifier: &Classifier,
        more: Option<&FeatureSet>,
        monitor: &Monitor,
    ) -> Result<Vec<f32>> {
        let classes = classifier.classes();
        let mut values = vec![0.0; self.points.len() * classes];
        let Some(set) = more else {
            monitor.stage("classify", self.points.len() as u64);
            classifier.predict_proba(&self.six.values, &mut values)?;
            return Ok(values);
        };
        let extractor = Extractor::prepare(self.cloud, set, (Wanted::All, None), monitor)?;
        monitor.stage("classify", extractor.len() as u64);
        let mut position = vec![0u32; self.cloud.len()];
        self.points.index.iter().zip(0..).for_each(|(&place, point)| position[place as usize] = point);
        let groups = extractor.blocks().div_ceil(TOGETHER);
        for first in (0..groups).step_by(AT_ONCE) {
            let range = first..(first + AT_ONCE).min(groups);
            let parts = map_ordered_with(range, monitor, Workspace::default, |work, group| {
                work.group(group, (self, &extractor, &position), classifier, monitor)
            })?;
            for (points, rows) in parts {
                for (&point, row) in points.iter().zip(rows.chunks_exact(classes)) {
                    values[point as usize * classes..][..classes].copy_from_slice(row);
                }
            }
        }
        Ok(values)
    }
}

#[derive(Default)]
struct Workspace {
    scratch: Scratch,
    scaled: Vec<f32>,
    rows: Vec<f32>,
    trees: PredictScratch,
}

impl Workspace {
    /// The points of a group of blocks, and their class probabilities.
    fn group(
        &mut self,
        group: usize,
        (described, extractor, position): (&Described<'_>, &Extractor<'_>, &[u32]),
        classifier: &Classifier,
        monitor: &Monitor,
    ) -> Result<(Vec<u32>, Vec<f32>)> {
        let mut points = Vec::new();
        self.rows.clear();
        for block in group * TOGETHER..((group + 1) * TOGETHER).min(extractor.blocks()) {
            monitor.check()?;
            let first = points.len();
            let places = extractor.block(block, &mut self.scratch, &mut self.scaled);
            points.extend(places.iter().map(|&place| position[place as usize]));
            for (&point, scaled) in points[first..].iter().zip(self.scaled.chunks_exact(extractor.names().len())) {
                self.rows.extend_from_slice(described.six.row(point as usize));
                self.rows.extend_from_slice(scaled);
            }
        }
        let mut found = vec![0.0; points.len() * classifier.classes()];
        classifier.predict_block(&self.rows, &mut self.trees, &mut found)?;
        monitor.advance(points.len() as u64);
        Ok((points, found))
    }
}
