//! Supervoxels that grow over adjacent voxels.

mod flow;
mod mean;
mod seeds;
mod voxels;

use super::{NO_SUPERVOXEL, PointAttributes, SupervoxelLabels, Supervoxels, VccsParams};
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Monitor, watched};
use flow::{Flow, Metric};
use voxels::Voxels;

/// Voxel cloud connectivity segmentation: supervoxels that never cross a gap.
///
/// J. Papon, A. Abramov, M. Schoeler, F. Wörgötter, *Voxel cloud connectivity segmentation*, CVPR 2013,
/// doi:10.1109/CVPR.2013.264. Points are averaged into voxels of edge R_voxel (mean position, colour, normal), which
/// are adjacent if they are among each other's 26 neighbours. Seeds are the voxels nearest to the centres of the
/// occupied cells of edge R_seed, except those with few voxels around them. In each step every voxel takes, among its
/// own supervoxel and those of its neighbours, the one of least D = w_n (1 − |n · n_s|) + w_c ‖c − c_s‖ + w_s ‖p −
/// p_s‖/R_seed, ties to the smaller index; then the centres move to their means. After 1.8 R_seed/R_voxel steps, or
/// when nothing changes, the growth starts again from the voxels nearest to the means, as often as `refinements` says.
/// At the end components that are separated from their supervoxel join an adjacent one. Voxels that no supervoxel
/// reaches have none.
///
/// All voxels are updated at once, so that the result does not depend on an order; the reference implementation grows
/// one supervoxel after the other. O(steps · voxels) time, at most about 150 bytes a voxel.
///
/// # Errors
/// If a parameter is outside its range, attributes do not fit the points, a coordinate is not finite, the points need
/// 2^21 voxels or more along an axis, or the work was cancelled.
pub fn vccs(
    points: &Positions,
    attributes: &PointAttributes<'_>,
    params: &VccsParams,
    monitor: &Monitor,
) -> Result<Supervoxels> {
    params.validate()?;
    attributes.check(points.len())?;
    monitor.stage("supervoxels", points.len() as u64);
    let voxels = Voxels::new(points, attributes, params.voxel, monitor)?;
    let metric = Metric::new(params, attributes);
    let mut flow = Flow::new(&voxels, metric, &seeds::seeds(&voxels, params, monitor)?);
    let steps = (params.depth * params.size / params.voxel) as usize;
    flow.expand(steps.max(1), monitor)?;
    for _ in 0..params.refinements {
        flow.restart(&flow.nearest_to_means(monitor)?);
        flow.expand(steps.max(1), monitor)?;
    }
    flow.mend(monitor)?;
    let owners = flow.into_owners();
    let mut labels = vec![NO_SUPERVOXEL; points.len()];
    for piece in watched(voxels.len(), monitor) {
        for voxel in piece? {
            voxels.points.group(voxel).iter().for_each(|&i| labels[i as usize] = owners[voxel]);
        }
    }
    drop((voxels, owners));
    monitor.advance(points.len() as u64);
    Supervoxels::new(points, attributes, SupervoxelLabels { labels, size: params.size }, monitor)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{floor_and_wall, points_of};
    use super::*;
    use crate::graph::{Graph, connected_components};
    use crate::random::stream;
    use std::collections::BTreeSet;

    fn params() -> VccsParams {
        VccsParams { voxel: 0.4, ..VccsParams::default() }
    }

    #[test]
    fn every_supervoxel_is_one_piece_of_voxels_that_touch() {
        let scene = floor_and_wall();
        let attributes = scene.attributes();
        let found = vccs(&scene.points, &attributes, &params(), &Monitor::default()).unwrap();
        let voxels = Voxels::new(&scene.points, &attributes, 0.4, &Monitor::default()).unwrap();
        let of = |v: usize| found.labels()[voxels.points.group(v)[0] as usize];
        for v in 0..voxels.len() {
            assert!(voxels.points.group(v).iter().all(|&i| found.labels()[i as usize] == of(v)));
        }
        let inside = |a: usize| voxels.near.group(a).iter().map(move |&b| [a as u32, b]);
        let alike = |p: &[u32; 2]| p[0] < p[1] && of(p[0] as usize) == of(p[1] as usize);
        let pairs: Vec<[u32; 2]> = (0..voxels.len()).flat_map(inside).filter(alike).collect();
        let pieces = connected_components(
            &Graph::new(voxels.len(), &pairs, &vec![1.0; pairs.len()]).unwrap(),
            &Monitor::default(),
        )
        .unwrap();
        let held: std::collections::BTreeSet<u32> =
            (0..voxels.len()).filter(|&v| of(v) != NO_SUPERVOXEL).map(|v| pieces.of[v]).collect();
        assert_eq!(held.len(), found.len());
    }

    #[test]
    fn the_order_of_the_points_and_the_sides_of_their_normals_do_not_matter() {
        let scene = floor_and_wall();
        let mut order: Vec<u32> = (0..scene.points.len() as u32).collect();
        stream(7, 0).shuffle(&mut order);
        let points: Positions = order.iter().map(|&i| scene.points.xyz(i as usize)).collect();
        let turned = |i: u32| scene.normals[i as usize].map(|v| if i.is_multiple_of(3) { -v } else { v });
        let normals: Vec<[f32; 3]> = order.iter().map(|&i| turned(i)).collect();
        let attributes = PointAttributes { normals: Some(&normals), colours: None };
        let plain = PointAttributes { normals: Some(&scene.normals), colours: None };
        let expected = vccs(&scene.points, &plain, &params(), &Monitor::default()).unwrap();
        let found = vccs(&points, &attributes, &params(), &Monitor::default()).unwrap();
        // Supervoxels have other numbers, but the same points.
        let pairs: BTreeSet<[u32; 2]> =
            order.iter().zip(found.labels()).map(|(&i, &s)| [expected.labels()[i as usize], s]).collect();
        assert_eq!((pairs.len(), found.len()), (expected.len() + 1, expected.len()), "three points have none");
    }

    #[test]
    fn supervoxels_keep_to_one_surface() {
        let scene = floor_and_wall();
        let found = vccs(&scene.points, &scene.attributes(), &params(), &Monitor::default()).unwrap();
        assert!((80..200).contains(&found.len()), "{}", found.len());
        let mut mixed = 0;
        for s in 0..found.len() {
            let wall = found.members(s).iter().filter(|&&i| scene.normals[i as usize][1] < -0.5).count();
            mixed += wall.min(found.members(s).len() - wall);
        }
        assert!(mixed * 50 < scene.points.len(), "{mixed}");
    }

    #[test]
    fn supervoxels_do_not_cross_a_gap() {
        let row = |y: f64| (0..60).map(move |i| [f64::from(i) * 0.1, y, 0.0]);
        let rows: Vec<[f64; 3]> = row(0.05).chain(row(0.15)).chain(row(0.55)).chain(row(0.65)).collect();
        let params = VccsParams { size: 1.0, voxel: 0.2, min_share: 0.0, ..VccsParams::default() };
        let found = vccs(&points_of(&rows), &PointAttributes::default(), &params, &Monitor::default()).unwrap();
        for s in 0..found.len() {
            let side = found.members(s).iter().filter(|&&i| i < 120).count();
            assert!(side == 0 || side == found.members(s).len());
        }
        let slic = crate::segmentation::SlicParams { size: 1.0, ..Default::default() };
        let found = super::super::slic(&points_of(&rows), &PointAttributes::default(), &slic, &Monitor::default());
        assert!(!found.unwrap().is_empty());
    }

    #[test]
    fn supervoxels_are_the_same_for_any_number_of_threads() {
        let scene = floor_and_wall();
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| vccs(&scene.points, &scene.attributes(), &params(), &Monitor::default()).unwrap())
        };
        let expected = with(1);
        assert!((2..5).all(|threads| with(threads) == expected));
    }

    #[test]
    fn no_points_make_no_supervoxels() {
        let found = vccs(&Positions::default(), &PointAttributes::default(), &params(), &Monitor::default()).unwrap();
        assert!(found.is_empty() && found.labels().is_empty());
    }
}
