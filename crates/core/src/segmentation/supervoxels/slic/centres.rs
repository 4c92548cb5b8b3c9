//! The cluster centres: initial positions and updates.

use super::super::NO_SUPERVOXEL;
use super::sorted::Sorted;
use crate::error::Result;
use crate::linalg::Sym3;
use crate::parallel::{Monitor, watched};
use rayon::prelude::*;

/// A cluster centre: mean position, normal of the plane and mean colour of its points. The normal is at first the mean axis of
/// theirs if they lie on a line; later it stays while they do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Centre {
    pub(super) place: [f32; 3],
    pub(super) normal: [f32; 3],
    pub(super) colour: [f32; 3],
}

/// The normal of a centre of which nothing is known yet.
const UNKNOWN: [f32; 3] = [0.0; 3];

/// Sums over the points of a centre, relative to its previous position.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: u32,
    place: [f64; 3],
    square: [f64; 3],
    mixed: [f64; 3],
    colour: [f64; 3],
}

/// The initial cell of each point, as a label, and the centres: means of the cells with at least `min_points`.
pub(super) fn seeds(scene: &Sorted, min_points: usize, monitor: &Monitor) -> Result<(Vec<u32>, Vec<Centre>)> {
    let mut labels = vec![NO_SUPERVOXEL; scene.len()];
    let mut centres = Vec::new();
    for cell in 0..scene.cells.len() {
        let range = scene.cells.range(cell);
        if range.len() >= min_points {
            let place = scene.grid.centre(scene.cells.keys[cell]);
            labels[range].fill(centres.len() as u32);
            centres.push(Centre { place, normal: UNKNOWN, colour: [0.0; 3] });
        }
    }
    update(scene, &labels, &mut centres, monitor)?;
    Ok((labels, centres))
}

/// Moves each centre to the mean of its points; centres without points stay. Returns the mean displacement, metres.
pub(super) fn update(scene: &Sorted, labels: &[u32], centres: &mut [Centre], monitor: &Monitor) -> Result<f64> {
    let mut sums = vec![Sums::default(); centres.len()];
    for piece in watched(labels.len(), monitor) {
        let piece = piece?;
        for (i, &label) in piece.clone().zip(&labels[piece]).filter(|(_, l)| **l != NO_SUPERVOXEL) {
            let (sum, centre) = (&mut sums[label as usize], &centres[label as usize]);
            sum.add(scene, i, centre.place);
        }
    }
    let moves: Vec<f64> = centres.par_iter_mut().zip(&sums).map(|(centre, sum)| centre.follow(sum)).collect();
    if centres.iter().any(|centre| centre.normal == UNKNOWN) {
        take_axes(scene, labels, centres, monitor)?;
    }
    Ok(moves.iter().sum::<f64>() / moves.len().max(1) as f64)
}

/// Gives the centres without a normal the mean axis of the normals of their points, the first eigenvector of Σ n nᵀ, which
/// does not depend on signs.
fn take_axes(scene: &Sorted, labels: &[u32], centres: &mut [Centre], monitor: &Monitor) -> Result<()> {
    if scene.normals[0].is_empty() {
        return Ok(());
    }
    let mut normals: Vec<Vec<[f64; 3]>> = vec![Vec::new(); centres.len()];
    for piece in watched(labels.len(), monitor) {
        let piece = piece?;
        for (i, &label) in piece.clone().zip(&labels[piece]).filter(|(_, l)| **l != NO_SUPERVOXEL) {
            if centres[label as usize].normal == UNKNOWN {
                normals[label as usize].push([0, 1, 2].map(|a| f64::from(scene.normals[a][i])));
            }
        }
    }
    for (centre, own) in centres.iter_mut().zip(&normals).filter(|(_, own)| !own.is_empty()) {
        centre.normal = Sym3::scatter(own, [0.0; 3], 1.0).eigen().vectors[0].map(|v| v as f32);
    }
    Ok(())
}

impl Sums {
    /// Adds point `i`, relative to the position `at`.
    #[inline]
    fn add(&mut self, scene: &Sorted, i: usize, at: [f32; 3]) {
        self.count += 1;
        let p = scene.place(i);
        let d = [0, 1, 2].map(|a| f64::from(p[a]) - f64::from(at[a]));
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            self.place[a] += d[a];
            self.square[a] += d[a] * d[a];
            self.mixed[a] += d[a] * d[b];
        }
        if let Some(colour) = scene.colour(i) {
            (0..3).for_each(|a| self.colour[a] += f64::from(colour[a]));
        }
    }
}

impl Centre {
    /// Moves the centre to the mean of its points; returns the displacement.
    fn follow(&mut self, sum: &Sums) -> f64 {
        if sum.count == 0 {
            return 0.0;
        }
        let n = f64::from(sum.count);
        let mean = sum.place.map(|v| v / n);
        let [x, y, z] = mean;
        let [xy, yz, zx] = sum.mixed;
        let scatter = Sym3 {
            diagonal: [0, 1, 2].map(|a| sum.square[a] / n - mean[a] * mean[a]),
            off: [xy / n - x * y, zx / n - x * z, yz / n - y * z],
        };
        let eigen = scatter.eigen();
        // Fewer than three points, or points on a line, define no plane: the normal stays.
        if sum.count >= 3 && eigen.values[1] > 1e-9 * eigen.values[0] {
            self.normal = eigen.vectors[2].map(|v| v as f32);
        }
        self.place = [0, 1, 2].map(|a| (f64::from(self.place[a]) + mean[a]) as f32);
        self.colour = sum.colour.map(|v| (v / n) as f32);
        (x * x + y * y + z * z).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::PointAttributes;
    use super::super::super::testing::floor_and_wall;
    use super::*;

    #[test]
    fn seeds_are_centroids_of_occupied_voxels() {
        let scene = floor_and_wall();
        let sorted = Sorted::new(&scene.points, &scene.attributes(), 1.2, &Monitor::default()).unwrap();
        let (labels, seeds) = seeds(&sorted, 3, &Monitor::default()).unwrap();
        for (s, seed) in seeds.iter().enumerate() {
            let own: Vec<usize> = (0..labels.len()).filter(|&i| labels[i] == s as u32).collect();
            assert!(own.len() >= 3);
            let keys: Vec<u64> = own.iter().map(|&i| sorted.grid.key(sorted.place(i))).collect();
            assert!(keys.iter().all(|&k| k == sorted.grid.key(seed.place)), "a box holds the mean of what it holds");
            for a in 0..3 {
                let mean = own.iter().map(|&i| f64::from(sorted.place(i)[a])).sum::<f64>() / own.len() as f64;
                assert!((f64::from(seed.place[a]) - mean).abs() < 1e-5);
            }
        }
        assert!(labels.iter().filter(|l| **l == NO_SUPERVOXEL).count() < 30);
    }

    #[test]
    fn a_centre_takes_the_normal_of_the_plane_of_its_points() {
        let rows: Vec<[f64; 3]> = (0..30).map(|i| [f64::from(i % 6), 2.0, f64::from(i / 6)]).collect();
        let points = super::super::super::testing::points_of(&rows);
        let sorted = Sorted::new(&points, &PointAttributes::default(), 10.0, &Monitor::default()).unwrap();
        let (labels, mut seeds) = seeds(&sorted, 3, &Monitor::default()).unwrap();
        assert_eq!(seeds.len(), 1);
        assert!((seeds[0].normal[1].abs() - 1.0).abs() < 1e-6);
        assert!(update(&sorted, &labels, &mut seeds, &Monitor::default()).unwrap() < 1e-6);
    }

    #[test]
    fn points_on_a_line_give_their_centre_the_mean_axis_of_their_normals() {
        // The edge of a wall that looks along y; normals of either side.
        let rows: Vec<[f64; 3]> = (0..8).map(|i| [f64::from(i), 2.0, 1.0]).collect();
        let normals: Vec<[f32; 3]> = (0..8).map(|i| [0.0, if i % 2 == 0 { 1.0 } else { -1.0 }, 0.0]).collect();
        let points = super::super::super::testing::points_of(&rows);
        let attributes = PointAttributes { normals: Some(&normals), colours: None };
        let sorted = Sorted::new(&points, &attributes, 10.0, &Monitor::default()).unwrap();
        let (_, seeds) = seeds(&sorted, 3, &Monitor::default()).unwrap();
        assert_eq!(seeds.len(), 1);
        assert!((seeds[0].normal[1].abs() - 1.0).abs() < 1e-6, "{:?}", seeds[0].normal);
    }
}
