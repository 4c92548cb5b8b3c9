//! Supervoxels on points: k-means around seeds of a grid, where each point is compared only with the seeds near it.

mod assign;
mod centres;
mod connect;
mod sorted;

use super::{NO_SUPERVOXEL, PointAttributes, SlicParams, SupervoxelLabels, Supervoxels};
use crate::cloud::Positions;
use crate::error::Result;
use crate::neighbours::nearest_of;
use crate::parallel::{Monitor, watched};
use assign::Distance;
use centres::Centre;
use sorted::Sorted;

/// Supervoxels of points: SLIC (Achanta et al. 2012, doi:10.1109/TPAMI.2012.120) on points, as in Hasanpour Zaryabi et
/// al. 2022, section 3.1.
///
/// The seeds are the centroids of the voxels of edge S with at least `min_points` points. A point p is assigned to the
/// seed of least D² = (w_s ‖p − s‖/(√3 S))² + (w_c ‖c_p − c_s‖/√3)² + (w_n ∠(n_p, n_s)/(π/2))² among those whose cube s
/// ± S contains it; the angle is unsigned (Eq. 1), ties go to the first seed. Then each seed moves to the mean of its
/// points, with their mean colour and the normal of their plane (if they lie on a line it stays, and is at first the
/// mean axis of their normals), and the points are assigned anew. Points outside all cubes join the nearest seed if it
/// is at most 2 √3 S away, else they have none.
///
/// O(rounds · n) for points of even density, 60 bytes a point besides the result. Deterministic for any number of
/// threads.
///
/// # Errors
/// If a parameter is outside its range, attributes do not fit the points, a coordinate is not finite, the points need
/// 2^21 voxels or more along an axis, or the work was cancelled.
///
/// ```
/// use scansion_core::segmentation::{PointAttributes, SlicParams, slic};
/// use scansion_core::{Cloud, cloud::Points, parallel::Monitor};
///
/// let rows: Vec<[f64; 3]> = (0..100).map(|i| [f64::from(i % 10) * 0.3, f64::from(i / 10) * 0.3, 0.0]).collect();
/// let points = Points::from_cloud(&Cloud::from_rows(&rows)?, 1.0).positions;
/// let found = slic(&points, &PointAttributes::default(), &SlicParams::default(), &Monitor::default())?;
/// assert_eq!(found.len(), 9);
/// # Ok::<(), scansion_core::Error>(())
/// ```
pub fn slic(
    points: &Positions,
    attributes: &PointAttributes<'_>,
    params: &SlicParams,
    monitor: &Monitor,
) -> Result<Supervoxels> {
    params.validate()?;
    attributes.check(points.len())?;
    monitor.stage("supervoxels", (points.len() * params.rounds) as u64);
    let scene = Sorted::new(points, attributes, params.size, monitor)?;
    let (mut found, _) = rounds(&scene, params, monitor)?;
    if params.connected {
        connect::connect(&scene, params, &mut found.labels, monitor)?;
    }
    let labels = attach(&scene, &found, params.size, monitor)?;
    if found.centres.is_empty() && scene.len() > 0 {
        let (size, least) = (params.size, params.min_points);
        monitor
            .warn(format!("no voxel of {size} m holds {least} points (min_points), so that no point has a supervoxel"));
    }
    let labels = scene.in_order_of_points(&labels, monitor)?;
    Supervoxels::new(points, attributes, SupervoxelLabels { labels, size: params.size }, monitor)
}

/// Labels of the sorted points and the centres they refer to.
struct Clusters {
    labels: Vec<u32>,
    centres: Vec<Centre>,
}

/// Alternates assignment and update; also returns the centres of the last assignment.
fn rounds(scene: &Sorted, params: &SlicParams, monitor: &Monitor) -> Result<(Clusters, Vec<Centre>)> {
    let distance = Distance::new(params);
    let (mut labels, mut centres) = centres::seeds(scene, params.min_points, monitor)?;
    let mut before = centres.clone();
    for _ in 0..params.rounds {
        labels = assign::assign(scene, &centres, &distance, monitor)?;
        before.clone_from(&centres);
        let shift = centres::update(scene, &labels, &mut centres, monitor)?;
        if shift < params.tolerance * params.size {
            break;
        }
    }
    Ok((Clusters { labels, centres }, before))
}

/// Gives each point without a label that of the nearest non-empty centre, if that is near enough.
fn attach(scene: &Sorted, found: &Clusters, size: f64, monitor: &Monitor) -> Result<Vec<u32>> {
    let mut labels = found.labels.clone();
    let mut held = vec![false; found.centres.len()];
    for piece in watched(labels.len(), monitor) {
        for &label in &labels[piece?] {
            if let Some(slot) = held.get_mut(label as usize) {
                *slot = true;
            }
        }
    }
    let mut lost: Vec<u32> = Vec::new();
    for piece in watched(labels.len(), monitor) {
        lost.extend(piece?.filter(|&i| labels[i] == NO_SUPERVOXEL).map(|i| i as u32));
    }
    let kept: Vec<u32> = (0..found.centres.len() as u32).filter(|&c| held[c as usize]).collect();
    let centres: Positions = kept.iter().map(|&c| found.centres[c as usize].place).collect();
    let near = nearest_of(&centres, &scene.positions.select(&lost, monitor)?, 1, monitor)?;
    let reach = 2.0 * 3.0f64.sqrt() * size;
    for (row, &point) in lost.iter().enumerate().take(near.len()) {
        if f64::from(near.squared_distances(row)[0]) <= reach * reach {
            labels[point as usize] = kept[near.of(row)[0] as usize];
        }
    }
    Ok(labels)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{floor_and_wall, points_of};
    use super::*;

    #[test]
    fn every_point_lies_in_the_cube_of_its_seed_when_it_is_assigned() {
        let scene = floor_and_wall();
        let params = SlicParams::default();
        let sorted = Sorted::new(&scene.points, &scene.attributes(), params.size, &Monitor::default()).unwrap();
        let (clusters, centres) = rounds(&sorted, &params, &Monitor::default()).unwrap();
        let distance = Distance::new(&params);
        let mut held = 0;
        for (i, &label) in clusters.labels.iter().enumerate().filter(|(_, l)| **l != NO_SUPERVOXEL) {
            let own = &centres[label as usize];
            assert!((0..3).all(|a| (sorted.place(i)[a] - own.place[a]).abs() <= 1.2));
            let d = distance.squared(&sorted, i, own);
            assert!(centres.iter().all(|c| !distance.reaches(&sorted, i, c) || distance.squared(&sorted, i, c) >= d));
            held += 1;
        }
        assert!(held > 4300, "{held}");
    }

    #[test]
    fn a_size_below_the_spacing_is_said_to_leave_no_supervoxel() {
        let (scene, monitor) = (floor_and_wall(), Monitor::default());
        let params = SlicParams { size: 0.001, ..SlicParams::default() };
        let found = slic(&scene.points, &PointAttributes::default(), &params, &monitor).unwrap();
        assert!(found.is_empty() && monitor.take_warnings()[0].contains("min_points"));
    }

    #[test]
    fn supervoxels_keep_to_one_surface_and_one_colour() {
        let scene = floor_and_wall();
        let found = slic(&scene.points, &scene.attributes(), &SlicParams::default(), &Monitor::default()).unwrap();
        assert!((100..160).contains(&found.len()), "{}", found.len());
        let (mut mixed, mut points) = (0, 0);
        for s in 0..found.len() {
            let members = found.members(s);
            let kinds = |key: &dyn Fn(usize) -> bool| members.iter().filter(|&&i| key(i as usize)).count();
            let wall = kinds(&|i| scene.normals[i][1] < -0.5);
            mixed += wall.min(members.len() - wall);
            points += members.len();
        }
        assert!(mixed * 100 < points, "{mixed} of {points}");
        assert_eq!(points, found.labels().iter().filter(|l| **l != NO_SUPERVOXEL).count());
    }

    #[test]
    fn far_points_without_a_seed_are_noise_and_near_ones_join() {
        let mut rows: Vec<[f64; 3]> =
            (0..400).map(|i| [f64::from(i % 20) * 0.3, f64::from(i / 20) * 0.3, 0.0]).collect();
        rows.push([3.0, 3.0, 3.0]);
        rows.push([3.0, 3.0, 30.0]);
        let points = points_of(&rows);
        let found = slic(&points, &PointAttributes::default(), &SlicParams::default(), &Monitor::default()).unwrap();
        assert!(found.labels()[400] != NO_SUPERVOXEL && found.labels()[401] == NO_SUPERVOXEL);
        assert!(found.labels()[..400].iter().all(|&l| l != NO_SUPERVOXEL));
    }

    #[test]
    fn no_points_and_no_seeds_make_no_supervoxels() {
        let none = PointAttributes::default();
        let count = |rows: &[[f64; 3]]| {
            slic(&points_of(rows), &none, &SlicParams::default(), &Monitor::default()).unwrap().len()
        };
        assert_eq!((count(&[]), count(&[[0.0; 3], [9.0; 3]])), (0, 0));
    }

    #[test]
    fn supervoxels_are_the_same_for_any_number_of_threads() {
        let scene = floor_and_wall();
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let params = SlicParams { connected: true, ..SlicParams::default() };
            pool.install(|| slic(&scene.points, &scene.attributes(), &params, &Monitor::default()).unwrap())
        };
        let expected = with(1);
        assert!((2..5).all(|threads| with(threads) == expected));
    }
}
