//! Refinement: points beside the coarse regions join them where they lie on the plane of an adjacent voxel.

use super::params::OctreeGrowingParams;
use super::voxels::{Patch, Touching, place};
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered};
use crate::segmentation::Octree;

/// Result for a voxel: the regions of its points, and the region that received most of them, with the plane of that
/// voxel.
type Taken = (Vec<u32>, Option<(u32, Patch)>);

/// The leaves of an octree after coarse region growing.
#[derive(Clone, Copy)]
pub(super) struct Voxels<'a> {
    pub(super) tree: &'a Octree,
    /// Which leaves touch each other.
    pub(super) touching: &'a Touching,
    /// Plane of each leaf.
    pub(super) patches: &'a [Patch],
    /// Region of each leaf; 0 for none.
    pub(super) regions: &'a [u32],
}

/// Region of each point from the regions of the voxels; 0 for none.
///
/// Works ring by ring: every point of a voxel without a region that touches a region is compared with the planes of the
/// adjacent voxels, and joins the region of the nearest plane within `distance` (ties: the first voxel). For the next
/// ring the voxel counts as part of the region that received most of its points, with that region's plane.
pub(super) fn refine(
    points: &Positions,
    voxels: Voxels<'_>,
    params: &OctreeGrowingParams,
    monitor: &Monitor,
) -> Result<Vec<u32>> {
    let Voxels { tree, touching, patches, regions } = voxels;
    let mut labels = vec![0u32; points.len()];
    for (members, &region) in tree.points.groups().zip(regions) {
        members.iter().for_each(|&i| labels[i as usize] = region);
    }
    let (mut patches, mut regions) = (patches.to_vec(), regions.to_vec());
    let mut seen: Vec<bool> = regions.iter().map(|r| *r > 0).collect();
    for _ in 0..params.rings {
        let ring: Vec<usize> =
            (0..seen.len()).filter(|&l| !seen[l] && touching.of(l).iter().any(|&o| regions[o as usize] > 0)).collect();
        if ring.is_empty() {
            break;
        }
        let found = map_ordered(ring.len(), monitor, |r| {
            let members = tree.points.group(ring[r]);
            let near = planes(touching.of(ring[r]), &patches, &regions);
            Ok(nearest_planes(points, members, &near, params.distance))
        })?;
        for (&l, (own, most)) in ring.iter().zip(found) {
            seen[l] = true;
            tree.points.group(l).iter().zip(own).for_each(|(&i, region)| labels[i as usize] = region);
            if let Some((region, patch)) = most {
                (regions[l], patches[l]) = (region, patch);
            }
        }
    }
    Ok(labels)
}

/// Region and plane of those of the voxels `around` that have a region.
fn planes(around: &[u32], patches: &[Patch], regions: &[u32]) -> Vec<(u32, Patch)> {
    around.iter().map(|&o| (regions[o as usize], patches[o as usize])).filter(|(region, _)| *region > 0).collect()
}

/// Compares the points of a voxel with the planes around it, `near`.
fn nearest_planes(points: &Positions, members: &[u32], near: &[(u32, Patch)], distance: f64) -> Taken {
    let mut votes = vec![0u32; near.len()];
    let mut own = Vec::with_capacity(members.len());
    for &i in members {
        let at = place(points, i);
        let mut best = (distance, None);
        for (n, (_, patch)) in near.iter().enumerate() {
            let apart = patch.distance(at);
            if apart < best.0 || (best.1.is_none() && apart <= distance) {
                best = (apart, Some(n));
            }
        }
        if let Some(n) = best.1 {
            votes[n] += 1;
        }
        own.push(best.1.map_or(0, |n| near[n].0));
    }
    // The planes of a region are counted together; the voxel inherits the plane of that region with the most points.
    let total = |region: u32| near.iter().zip(&votes).filter(|(n, _)| n.0 == region).map(|(_, v)| *v).sum::<u32>();
    let most =
        (0..near.len()).filter(|&n| votes[n] > 0).max_by_key(|&n| (total(near[n].0), votes[n], std::cmp::Reverse(n)));
    (own, most.map(|n| near[n]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_join_the_nearest_plane_within_reach() {
        let x = vec![0.1, 0.5, 0.02, 0.9, 0.03];
        let points = Positions { x, y: vec![0.0; 5], z: vec![0.05, 0.01, 0.5, 0.9, 0.04] };
        let floor = Patch { centre: [1.0, 0.0, 0.0], normal: [0.0, 0.0, 1.0], residual: 0.0 };
        let wall = Patch { centre: [0.0, 0.0, 1.0], normal: [1.0, 0.0, 0.0], residual: 0.0 };
        let none = Patch { residual: f64::INFINITY, ..Patch::default() };
        let near = planes(&[0, 1, 2], &[none, wall, floor], &[0, 7, 4]);
        let (own, most) = nearest_planes(&points, &[0, 1, 2, 3, 4], &near, 0.06);
        assert_eq!(own, [4, 4, 7, 0, 7]);
        assert_eq!(most, Some((7, wall)), "two votes each: the first");
        let (own, most) = nearest_planes(&points, &[3], &near, 0.06);
        assert_eq!((own, most), (vec![0], None));
    }
}
