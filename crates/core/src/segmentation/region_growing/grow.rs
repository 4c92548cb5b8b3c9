//! Region growing on points.
//!
//! T. Rabbani, F. van den Heuvel, G. Vosselman, *Segmentation of point clouds using smoothness constraint*, ISPRS
//! Archives XXXVI-5, 2006, section 4.2.

use super::params::{Reference, RegionGrowingParams};
use super::result::GrownRegions;
use crate::error::{Error, Result};
use crate::features::Normals;
use crate::neighbours::Neighbours;
use crate::parallel::{Monitor, map_watched, sort_watched};

/// Number of points between two checks for cancellation.
const STEP: u64 = 1 << 16;

/// Segments points into smooth surfaces: from the flattest point that has no region yet, a region takes every neighbour
/// whose normal deviates little, and grows on from those of low surface variation.
///
/// Seeds are taken by ascending surface variation, ties by index; a region is completed before the next begins, so that
/// the result does not depend on the number of threads. Row i of `neighbours` and of `normals` belongs to point i. O(n
/// k) plus a sort. Returns the region of each point.
///
/// ```
/// use scansion_core::segmentation::{RegionGrowingParams, region_growing};
/// use scansion_core::{Cloud, cloud::Points, features::normals, neighbours::knn, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// // A floor and a wall half a metre apart.
/// let rows: Vec<[f64; 3]> = (0..800)
///     .map(|i| (f64::from(i % 20) / 10.0, f64::from(i / 20 % 20) / 10.0, i / 400))
///     .map(|(a, b, wall)| if wall == 1 { [a, -0.5, b] } else { [a, b, 0.0] })
///     .collect();
/// let (points, monitor) = (Points::from_cloud(&Cloud::from_rows(&rows)?, 1.0).positions, Monitor::default());
/// let near = knn(&points, 12, &monitor)?;
/// let found = region_growing(&near, &normals(&points, &near, &monitor)?, &RegionGrowingParams::default(), &monitor)?;
/// assert_eq!((found.count, found.labels[0], found.labels[799]), (2, 1, 2));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// If a parameter is outside its range, neighbours and normals are of different numbers of points, or the work was
/// cancelled.
pub fn region_growing(
    neighbours: &Neighbours,
    normals: &Normals,
    params: &RegionGrowingParams,
    monitor: &Monitor,
) -> Result<GrownRegions> {
    params.validate()?;
    let count = normals.directions.len();
    if normals.variation.len() != count || (neighbours.k() > 0 && neighbours.len() != count) {
        let (rows, variations) = (neighbours.len(), normals.variation.len());
        return Err(Error::input(format!(
            "neighbours of {rows} points for {count} normals and {variations} variations (allowed: as many each)"
        )));
    }
    monitor.stage("regions", count as u64);
    let growth = Growth { neighbours, normals, params, cosine: params.angle_deg.to_radians().cos() as f32 };
    let mut labels = vec![0u32; count];
    let (mut regions, mut front, mut next) = (0, Vec::new(), STEP);
    let mut done = 0u64;
    for seed in seeds(&normals.variation, monitor)? {
        if labels[seed as usize] > 0 {
            continue;
        }
        regions += 1;
        done += growth.region(seed, regions, &mut labels, &mut front);
        if done >= next {
            monitor.check()?;
            monitor.advance(done + STEP - next);
            next = done + STEP;
        }
    }
    GrownRegions::numbered(labels, regions, params.min_size..=params.max_size, monitor)
}

/// All points, the flattest first. Variations are not negative, so that their bit patterns sort like the values.
pub(super) fn seeds(variation: &[f32], monitor: &Monitor) -> Result<impl Iterator<Item = u32>> {
    let key = |i: usize| u64::from((variation[i].max(0.0) + 0.0).to_bits()) << 32 | i as u64;
    let mut keys: Vec<u64> = map_watched(variation.len(), monitor, key)?;
    sort_watched(&mut keys, monitor)?;
    Ok(keys.into_iter().map(|key| key as u32))
}

struct Growth<'a> {
    neighbours: &'a Neighbours,
    normals: &'a Normals,
    params: &'a RegionGrowingParams,
    /// Least |cosine| between normals.
    cosine: f32,
}

impl Growth<'_> {
    /// Labels the region of a seed; returns how many points it has.
    fn region(&self, seed: u32, region: u32, labels: &mut [u32], front: &mut Vec<u32>) -> u64 {
        let (directions, variation) = (&self.normals.directions[..], &self.normals.variation[..]);
        let limit = self.params.variation as f32;
        labels[seed as usize] = region;
        front.clear();
        front.push(seed);
        let (mut taken, mut at) = (1, 0);
        while let Some(&current) = front.get(at) {
            at += 1;
            let reference = if self.params.reference == Reference::Seed { seed } else { current };
            let [x, y, z] = directions[reference as usize];
            let row = if self.neighbours.k() > 0 { self.neighbours.of(current as usize) } else { &[] };
            for &next in row {
                let label = &mut labels[next as usize];
                if *label > 0 {
                    continue;
                }
                let [u, v, w] = directions[next as usize];
                if (x * u + y * v + z * w).abs() >= self.cosine {
                    *label = region;
                    taken += 1;
                    if variation[next as usize] < limit {
                        front.push(next);
                    }
                }
            }
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Positions;
    use crate::features::normals;
    use crate::neighbours::knn;
    use crate::random::stream;

    fn points(rows: &[[f32; 3]]) -> Positions {
        Positions::from_rows(rows)
    }

    /// A floor, a wall on it, and a cylinder far away, in random order; and the surface of each point.
    fn scene(count: usize) -> (Positions, Vec<u8>) {
        let mut random = stream(6, 3);
        let (rows, kinds): (Vec<[f32; 3]>, Vec<u8>) = (0..count)
            .map(|_| {
                let [a, b, c] = [0; 3].map(|_| random.uniform() as f32);
                match (c * 3.0) as u8 {
                    0 => ([4.0 * a, 4.0 * b, 0.0], 0),
                    1 => ([4.0 * a, 4.0, 0.05 + 3.0 * b], 1),
                    _ => {
                        let turn = std::f32::consts::TAU * a;
                        ([9.0 + turn.cos(), turn.sin(), 3.0 * b], 2)
                    }
                }
            })
            .unzip();
        (points(&rows), kinds)
    }

    fn run(points: &Positions, params: &RegionGrowingParams) -> GrownRegions {
        let monitor = Monitor::default();
        let near = knn(points, 15, &monitor).unwrap();
        region_growing(&near, &normals(points, &near, &monitor).unwrap(), params, &monitor).unwrap()
    }

    #[test]
    fn planes_and_a_cylinder_are_three_regions_and_flat_pieces_of_one_with_the_seed_as_reference() {
        let (points, kinds) = scene(12_000);
        let found = run(&points, &RegionGrowingParams::default());
        assert_eq!(found.count, 3);
        assert!(found.coverage() > 0.97, "{}", found.coverage());
        let mut of = [0; 3];
        kinds.iter().zip(&found.labels).filter(|(_, l)| **l > 0).for_each(|(k, l)| of[*k as usize] = *l);
        let wrong = kinds.iter().zip(&found.labels).filter(|(k, l)| **l > 0 && of[**k as usize] != **l).count();
        assert!(wrong < 60, "{wrong}");
        let flat = run(&points, &RegionGrowingParams { reference: Reference::Seed, ..Default::default() });
        assert!(flat.count > 8, "{}", flat.count);
    }

    /// The algorithm as the paper describes it, with lists and sets.
    fn slow(near: &Neighbours, normals: &Normals, params: &RegionGrowingParams) -> Vec<u32> {
        let count = normals.directions.len();
        let mut left: std::collections::BTreeSet<usize> = (0..count).collect();
        let mut labels = vec![0; count];
        let mut regions = 0;
        while let Some(&seed) = left.iter().min_by(|a, b| normals.variation[**a].total_cmp(&normals.variation[**b])) {
            left.remove(&seed);
            regions += 1;
            labels[seed] = regions;
            let mut seeds = std::collections::VecDeque::from([seed]);
            while let Some(current) = seeds.pop_front() {
                for &j in near.of(current) {
                    let (n, m) = (normals.directions[current], normals.directions[j as usize]);
                    let cosine = (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]).abs();
                    if left.contains(&(j as usize)) && cosine >= params.angle_deg.to_radians().cos() as f32 {
                        left.remove(&(j as usize));
                        labels[j as usize] = regions;
                        if normals.variation[j as usize] < params.variation as f32 {
                            seeds.push_back(j as usize);
                        }
                    }
                }
            }
        }
        GrownRegions::numbered(labels, regions, params.min_size..=params.max_size, &Monitor::default()).unwrap().labels
    }

    #[test]
    fn it_is_the_algorithm_of_the_paper() {
        let (mut points, _) = scene(1500);
        let mut random = stream(8, 3);
        points.z.iter_mut().for_each(|z| *z += 0.05 * random.uniform() as f32);
        let near = knn(&points, 10, &Monitor::default()).unwrap();
        let normals = normals(&points, &near, &Monitor::default()).unwrap();
        for (angle_deg, variation, min_size, max_size) in [(10.0, 0.03, 5, 900), (25.0, 0.01, 1, u32::MAX)] {
            let params = RegionGrowingParams { angle_deg, variation, min_size, max_size, ..Default::default() };
            let found = region_growing(&near, &normals, &params, &Monitor::default()).unwrap();
            assert_eq!(found.labels, slow(&near, &normals, &params));
            assert!(found.count > 2);
        }
    }

    #[test]
    fn nothing_and_lone_points_are_fine_and_nonsense_is_refused() {
        let monitor = Monitor::default();
        let params = RegionGrowingParams { min_size: 1, ..Default::default() };
        let none = region_growing(&Neighbours::default(), &Normals::default(), &params, &monitor).unwrap();
        assert_eq!(none, GrownRegions::default());
        let two = Normals { directions: vec![[0.0, 0.0, 1.0]; 2], variation: vec![0.1, 0.0] };
        let alone = region_growing(&Neighbours::default(), &two, &params, &monitor).unwrap();
        assert_eq!(alone.labels, [1, 2]);
        let near = Neighbours::new(1, vec![1, 0, 1], vec![1.0; 3]).unwrap();
        assert!(region_growing(&near, &two, &params, &monitor).is_err());
        monitor.cancel();
        assert!(region_growing(&Neighbours::default(), &two, &params, &monitor).is_err());
    }
}
