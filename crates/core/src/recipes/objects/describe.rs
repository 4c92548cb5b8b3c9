//! The segments of a cloud and their features (Hasanpour Zaryabi et al. 2022, section 3.6 and Table 3).

use super::{Heights, ObjectsRecipe};
use crate::cloud::{MetricCloud, Points};
use crate::error::Result;
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::segmentation::{ObjectAttributes, Partition, object_features};
use crate::terrain::{HeightParams, filtered_heights};

/// Segments of a cloud's points, with one row of features each.
pub(super) struct Objects {
    pub(super) points: Points,
    pub(super) partition: Partition,
    pub(super) features: FeatureTable,
    /// Whether colours were used.
    pub(super) coloured: bool,
}

/// Segments a cloud and computes the features of its segments.
pub(super) fn objects(scene: &MetricCloud<'_>, recipe: &ObjectsRecipe, monitor: &Monitor) -> Result<Objects> {
    let points = scene.some_points(monitor)?;
    let colours = recipe.segments.colours(scene.cloud, &points, monitor)?;
    let partition = recipe.segments.partition(&points, colours.as_deref(), monitor)?;
    let heights = match recipe.heights {
        Heights::AboveGround => {
            let params = HeightParams { filter: recipe.ground.clone(), elevation: recipe.elevation.clone() };
            Some(filtered_heights(&points, &params, monitor)?)
        }
        Heights::Datum => None,
    };
    let attributes = ObjectAttributes { colours: colours.as_deref(), heights: heights.as_deref() };
    let mut features = object_features(&points, &partition, &attributes, monitor)?;
    if heights.is_some() {
        features = without(&features, "MeanZ");
    }
    Ok(Objects { points, partition, features, coloured: colours.is_some() })
}

/// A copy of the table without one column.
fn without(table: &FeatureTable, name: &str) -> FeatureTable {
    let kept: Vec<usize> = (0..table.width()).filter(|&c| table.names[c] != name).collect();
    let rows = table.values.chunks_exact(table.width());
    FeatureTable {
        names: kept.iter().map(|&c| table.names[c].clone()).collect(),
        values: rows.flat_map(|row| kept.iter().map(move |&c| row[c])).collect(),
    }
}
