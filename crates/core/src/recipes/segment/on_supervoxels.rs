//! Supervoxels, alone or joined by local graphs (Hasanpour Zaryabi et al. 2022).

use super::SegmentParams;
use super::interface::{Parted, PartitionMethod, SegmentScene};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::SupervoxelMode;

/// Local graphs of the supervoxels that the parameters name.
pub(super) struct LocalGraphs;

/// Supervoxels of one kind.
pub(super) struct Supervoxels(pub(super) SupervoxelMode);

impl PartitionMethod for LocalGraphs {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        let colours = params.objects.colours(scene.cloud, scene.points, monitor)?;
        let found = params.objects.supervoxels(scene.points, colours.as_deref(), monitor)?;
        let partition = params.objects.joined(&found, monitor)?;
        Ok(Parted { partition, supervoxels: Some(found.len()), ..Parted::default() })
    }

    fn reads_colours(&self) -> bool {
        true
    }

    fn set_size(&self, params: &mut SegmentParams, size: f64) -> Option<()> {
        set_size(params, size)
    }
}

impl PartitionMethod for Supervoxels {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        let mut objects = params.objects.clone();
        objects.supervoxels = self.0;
        let colours = objects.colours(scene.cloud, scene.points, monitor)?;
        let found = objects.supervoxels(scene.points, colours.as_deref(), monitor)?;
        let partition = found.partition(monitor)?;
        Ok(Parted { partition, supervoxels: Some(found.len()), ..Parted::default() })
    }

    fn reads_colours(&self) -> bool {
        true
    }

    fn set_size(&self, params: &mut SegmentParams, size: f64) -> Option<()> {
        set_size(params, size)
    }
}

fn set_size(params: &mut SegmentParams, size: f64) -> Option<()> {
    params.objects.vccs.voxel *= size / params.objects.vccs.size;
    (params.objects.slic.size, params.objects.vccs.size) = (size, size);
    Some(())
}
