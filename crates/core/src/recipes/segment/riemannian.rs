//! Supervoxels of an adaptive octree, joined on their Riemannian graph (Li 2018).

use super::SegmentParams;
use super::interface::{Level, Parted, PartitionMethod, SegmentScene};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::segmentation::{Intent, multi_scale};

pub(super) struct Riemannian;

impl PartitionMethod for Riemannian {
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted> {
        // The normals are the same at all depths: a single call computes the segments and the levels.
        let depths = std::iter::once(params.riemannian.octree.min_depth).chain(params.levels.iter().copied());
        let scales = multi_scale(scene.points, &params.riemannian, depths, monitor)?;
        let mut levels = scales.into_iter().map(Level::from);
        let Some(found) = levels.next() else { return Ok(Parted::default()) };
        Ok(Parted {
            partition: found.segments,
            strength: Some(params.riemannian.strength),
            supervoxels: Some(found.supervoxels),
            levels: levels.collect(),
            ..Parted::default()
        })
    }

    fn has_levels(&self) -> bool {
        true
    }

    fn aim(&self, params: &mut SegmentParams, aim: Intent) -> Option<()> {
        match aim {
            Intent::Strength(strength) => params.riemannian.strength = strength,
            _ => return None,
        }
        Some(())
    }
}
