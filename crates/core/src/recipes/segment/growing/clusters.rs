//! Clusters at four levels (Grilli, Poux, Remondino 2021).

use super::super::interface::{Parted, PartitionMethod, SegmentScene};
use super::super::{ClusterReport, SegmentParams};
use crate::cloud::{Column, Values};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::segmentation::{ClusterInput, ClusterLevels, GrownRegions, cluster_levels};
use crate::terrain::{HeightParams, filtered_heights};

/// The levels' dimensions, and the centrality.
const DIMENSIONS: [&str; 5] = ["ClusterID_L1", "ClusterID_L2", "ClusterID_L3", "ClusterID_L4", "ClusterCentrality"];

pub(in super::super) struct Clusters;

impl PartitionMethod for Clusters {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        let points = scene.points;
        let heights = filtered_heights(points, &HeightParams::default(), monitor)?;
        let colours = params.objects.colours(scene.cloud, points, monitor)?;
        let input = ClusterInput { points: &points.positions, heights: Some(&heights), colours: colours.as_deref() };
        let found = cluster_levels(&input, &params.clusters, monitor)?;
        let merged = GrownRegions { labels: found.labels(2, monitor)?, count: found.counts[1] };
        Ok(Parted {
            partition: merged.partition(&points.positions, params.growing.leftovers, monitor)?,
            columns: columns(&found, scene, monitor)?,
            clusters: Some(ClusterReport { automatic: found.automatic.clone(), counts: found.counts }),
            ..Parted::default()
        })
    }

    fn dimensions(&self) -> &'static [&'static str] {
        &DIMENSIONS
    }

    fn reads_colours(&self) -> bool {
        true
    }
}

/// The levels of each point of the cloud, in the order of [`DIMENSIONS`]; 0 for points that belong to none.
fn columns(found: &ClusterLevels, scene: &SegmentScene<'_>, monitor: &Monitor) -> Result<Vec<Column>> {
    let index = &scene.points.frame.index;
    let mut columns = Vec::new();
    for (level, name) in (1..=4).zip(DIMENSIONS) {
        let mut values = vec![0u32; scene.cloud.len()];
        index.iter().zip(found.labels(level, monitor)?).for_each(|(&i, label)| values[i as usize] = label);
        columns.push(Column::new(name, Values::U32(values)));
    }
    let mut values = vec![0f32; scene.cloud.len()];
    index.iter().zip(found.centralities(monitor)?).for_each(|(&i, value)| values[i as usize] = value);
    columns.push(Column::new(DIMENSIONS[4], Values::F32(values)));
    Ok(columns)
}
