//! Region growing on the voxels of an octree, refined at the boundary.
//!
//! A. V. Vo, L. Truong-Hong, D. F. Laefer, M. Bertolotto, *Octree-based region growing for point cloud segmentation*,
//! ISPRS Journal of Photogrammetry and Remote Sensing 104, 2015.

use super::params::{OctreeGrowingParams, Reference};
use super::refine::{Voxels, refine};
use super::result::GrownRegions;
use super::voxels::{Patch, Touching, patches};
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::segmentation::octree::Cube;
use crate::segmentation::{OctreeParams, StopRule, octree};

/// Greatest depth of an octree.
const DEEPEST: u32 = 21;

/// Segments points into flat or curved surfaces: regions of voxels first, then the points around them.
///
/// Voxels are divided until their points lie within the residual of a plane. From the flattest voxel on, regions take
/// adjacent voxels whose normal deviates little; points of the other voxels around a region join it if they are near
/// the plane of the adjacent voxel. No point normals are needed. Returns the region of each point. O(n log n).
///
/// ```
/// use scansion_core::segmentation::{OctreeGrowingParams, octree_region_growing};
/// use scansion_core::{Cloud, cloud::Points, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// // A floor and a wall that meet.
/// let rows: Vec<[f64; 3]> = (0..20_000)
///     .map(|i| (f64::from(i % 100) / 25.0, f64::from(i / 100 % 100) / 25.0, i / 10_000))
///     .map(|(a, b, wall)| if wall == 1 { [a, 0.0, b] } else { [a, b, 0.0] })
///     .collect();
/// let points = Points::from_cloud(&Cloud::from_rows(&rows)?, 1.0).positions;
/// let found = octree_region_growing(&points, &OctreeGrowingParams::default(), &Monitor::default())?;
/// assert_eq!(found.count, 2);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// If a parameter is outside its range, a coordinate is not finite, or the work was cancelled.
pub fn octree_region_growing(
    points: &Positions,
    params: &OctreeGrowingParams,
    monitor: &Monitor,
) -> Result<GrownRegions> {
    params.validate()?;
    let tree = octree(points, &division(points, params), monitor)?;
    let patches = patches(points, &tree, params.min_points, monitor)?;
    let touching = Touching::new(&tree, monitor)?;
    let (regions, count) = grow(&patches, &touching, params);
    monitor.check()?;
    let voxels = Voxels { tree: &tree, touching: &touching, patches: &patches, regions: &regions };
    let labels = refine(points, voxels, params, monitor)?;
    GrownRegions::numbered(labels, count, params.min_size..=u32::MAX, monitor)
}

/// Depths of the octree whose cells have the requested sizes.
fn division(points: &Positions, params: &OctreeGrowingParams) -> OctreeParams {
    let depth = |size: f64| (Cube::around(points).edge / size).log2().ceil().clamp(0.0, f64::from(DEEPEST)) as u32;
    let (min_depth, deepest) = (depth(params.largest_voxel), depth(params.smallest_voxel));
    OctreeParams {
        min_depth,
        extra_depth: deepest - min_depth,
        min_points: params.min_points,
        stop: StopRule::Sigma(params.residual),
    }
}

/// Region of each voxel from 1 on, 0 for none, and the number of regions.
fn grow(patches: &[Patch], touching: &Touching, params: &OctreeGrowingParams) -> (Vec<u32>, u32) {
    let cosine = params.angle_deg.to_radians().cos();
    let alike = |a: &Patch, b: &Patch| (0..3).map(|k| a.normal[k] * b.normal[k]).sum::<f64>().abs() >= cosine;
    let mut seeds: Vec<u32> =
        (0..patches.len() as u32).filter(|&l| patches[l as usize].residual <= params.residual).collect();
    seeds.sort_by(|&a, &b| patches[a as usize].residual.total_cmp(&patches[b as usize].residual).then(a.cmp(&b)));
    let (mut regions, mut count, mut front) = (vec![0u32; patches.len()], 0, Vec::new());
    for seed in seeds {
        if regions[seed as usize] > 0 {
            continue;
        }
        count += 1;
        regions[seed as usize] = count;
        front.clear();
        front.push(seed);
        let mut at = 0;
        while let Some(&current) = front.get(at) {
            at += 1;
            let reference = if params.reference == Reference::Seed { seed } else { current };
            for &next in touching.of(current as usize) {
                let patch = &patches[next as usize];
                let fits = regions[next as usize] == 0 && patch.residual <= params.residual;
                if fits && alike(&patches[reference as usize], patch) {
                    regions[next as usize] = count;
                    front.push(next);
                }
            }
        }
    }
    (regions, count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// A rough floor, two walls on it that meet, and a thin bush; and the surface of each point.
    fn scene(count: usize) -> (Positions, Vec<u32>) {
        let mut random = stream(4, 2);
        let (mut points, mut kinds) = (Positions::default(), Vec::new());
        for i in 0..count {
            let [a, b, c] = [0; 3].map(|_| random.uniform() as f32);
            let noise = 0.02 * (c - 0.5);
            let at = match i % 8 {
                0..=2 => [8.0 * a, 8.0 * b, noise],
                3 | 4 => [8.0 * a, noise, 4.0 * b],
                5 | 6 => [noise, 8.0 * a, 4.0 * b],
                _ => [4.0 + 2.0 * a, 4.0 + 2.0 * b, 1.0 + 2.0 * c],
            };
            points.push(at);
            kinds.push([0, 0, 0, 1, 1, 2, 2, 3][i % 8]);
        }
        (points, kinds)
    }

    #[test]
    fn walls_and_floor_are_regions_and_a_bush_is_none() {
        let (points, kinds) = scene(40_000);
        let found = octree_region_growing(&points, &OctreeGrowingParams::default(), &Monitor::default()).unwrap();
        let mut table = vec![vec![0u32; found.count as usize + 1]; 4];
        kinds.iter().zip(&found.labels).for_each(|(&k, &l)| table[k as usize][l as usize] += 1);
        let mut own = Vec::new();
        for row in &table[..3] {
            let (region, most) = (1..row.len()).map(|r| (r, row[r])).max_by_key(|r| r.1).unwrap();
            assert!(f64::from(most) > 0.96 * f64::from(row.iter().sum::<u32>()), "{table:?}");
            assert!(!own.contains(&region));
            own.push(region);
        }
        // The rest are points of the other planes near the edges, and voxels of the bush that happen to be flat.
        let strips: u32 =
            table.iter().flat_map(|row| (1..row.len()).filter(|r| !own.contains(r)).map(|r| row[r])).sum();
        assert!(strips < 600, "{table:?}");
        assert!(table[3][0] > 4700, "{table:?}");
        let coarse = OctreeGrowingParams { rings: 0, ..OctreeGrowingParams::default() };
        let unrefined = octree_region_growing(&points, &coarse, &Monitor::default()).unwrap();
        assert!(unrefined.coverage() < found.coverage());
    }

    #[test]
    fn any_number_of_threads_gives_the_same_regions() {
        let (points, _) = scene(20_000);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let run = || octree_region_growing(&points, &OctreeGrowingParams::default(), &Monitor::default());
            pool.install(run).unwrap()
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn depths_follow_the_sizes_asked_for() {
        let (points, _) = scene(800);
        let depths = |largest_voxel, smallest_voxel| {
            let params = OctreeGrowingParams { largest_voxel, smallest_voxel, ..OctreeGrowingParams::default() };
            let division = division(&points, &params);
            (division.min_depth, division.max_depth())
        };
        assert_eq!(depths(2.01, 0.126), (2, 6));
        assert_eq!(depths(1000.0, 1000.0), (0, 0));
        assert_eq!(depths(1e-9, 1e-9), (21, 21));
    }

    #[test]
    fn no_points_and_single_points_have_no_region() {
        let run = |count| {
            octree_region_growing(&scene(count).0, &OctreeGrowingParams::default(), &Monitor::default()).unwrap()
        };
        assert_eq!(run(0), GrownRegions::default());
        assert_eq!(run(7), GrownRegions { labels: vec![0; 7], count: 0 });
    }
}
