//! The occupied voxels and their adjacency.

use super::super::PointAttributes;
use super::mean::{Sum, Voxel, means};
use crate::cloud::Positions;
use crate::csr::Csr;
use crate::error::{Error, Result};
use crate::parallel::{Held, Monitor, resize_watched};
use crate::voxels::cells::Cells;
use crate::voxels::rows::{RowGrid, adjacency};
use rayon::prelude::*;

/// Voxels that one task describes.
const BLOCK: usize = 4096;

/// All occupied voxels.
#[derive(Default)]
pub(super) struct Voxels {
    /// Points by voxel.
    pub(super) points: Csr,
    pub(super) voxels: Vec<Voxel>,
    /// For each voxel the occupied ones among the 26 around it.
    pub(super) near: Csr,
}

impl Voxels {
    pub(super) fn new(
        points: &Positions,
        attributes: &PointAttributes<'_>,
        size: f64,
        monitor: &Monitor,
    ) -> Result<Held<Self>> {
        let grid = RowGrid::new(points.iter(), size, "voxel")?;
        let cells = Cells::new(points.len(), |i| grid.key(points.xyz(i)), monitor)?;
        let mut found = Held::new(Self { near: adjacency(&cells.keys, monitor)?, ..Self::default() }, monitor);
        found.points = cells.into_groups(points.len())?;
        let Self { points: points_of, voxels, .. } = &mut *found;
        resize_watched(voxels, points_of.len(), &Voxel::default(), monitor)?;
        voxels.par_chunks_mut(BLOCK).enumerate().try_for_each(|(b, block)| {
            monitor.check()?;
            let members = (b * BLOCK..).take(block.len()).map(|v| points_of.group(v));
            let sums: Vec<Sum> = members.map(|members| sum(points, attributes, members)).collect();
            means(&sums, block);
            Ok::<(), Error>(())
        })?;
        Ok(found)
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.voxels.len()
    }
}

/// The sums of the points of one voxel.
fn sum(points: &Positions, attributes: &PointAttributes<'_>, members: &[u32]) -> Sum {
    let mut sum = Sum::default();
    for &i in members {
        let i = i as usize;
        sum.add(&Voxel {
            place: points.xyz(i),
            normal: attributes.normals.map_or([0.0; 3], |n| n[i]),
            colour: attributes.colours.map_or([0.0; 3], |c| c[i]),
        });
    }
    sum
}
