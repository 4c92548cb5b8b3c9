//! Region growing on points (Rabbani et al. 2006) and on an octree (Vo et al. 2015), and clusters of regions.

mod clusters;

pub(super) use clusters::Clusters;

use super::SegmentParams;
use super::interface::{Parted, PartitionMethod, SegmentScene};
use crate::error::Result;
use crate::features::normals;
use crate::neighbours::knn;
use crate::parallel::Monitor;
use crate::segmentation::{octree_region_growing, region_growing};

pub(super) struct RegionGrowing;

pub(super) struct OctreeRegionGrowing;

impl PartitionMethod for RegionGrowing {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        let near = knn(&scene.points.positions, params.growing.neighbours, monitor)?;
        let surface = normals(&scene.points.positions, &near, monitor)?;
        let grown = region_growing(&near, &surface, &params.region_growing, monitor)?;
        let partition = grown.partition(&scene.points.positions, params.growing.leftovers, monitor)?;
        Ok(Parted { partition, ..Parted::default() })
    }
}

impl PartitionMethod for OctreeRegionGrowing {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        let grown = octree_region_growing(&scene.points.positions, &params.octree_region_growing, monitor)?;
        let partition = grown.partition(&scene.points.positions, params.growing.leftovers, monitor)?;
        Ok(Parted { partition, ..Parted::default() })
    }

    fn set_size(&self, params: &mut SegmentParams, size: f64) -> Option<()> {
        params.octree_region_growing.smallest_voxel *= size / params.octree_region_growing.largest_voxel;
        params.octree_region_growing.largest_voxel = size;
        Some(())
    }
}
