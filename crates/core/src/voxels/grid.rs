//! Points in the Morton order of the finest voxels.

use super::morton;
use crate::cloud::{Points, Positions};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_watched, sort_watched};

/// The voxel grid of the finest level. Cells of level l are cells of this grid with indices shifted right by l.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Edge of a finest voxel, metres.
    pub size: f64,
}

impl Grid {
    /// A grid for these points (coordinates not negative), checked to have enough indices.
    ///
    /// # Errors
    /// If the extent divided by the voxel size reaches 2^21; nothing has been allocated then.
    pub fn new(points: &Points, size: f64) -> Result<Self> {
        if !(size.is_finite() && size > 0.0) {
            return Err(Error::parameter("first_scale", size, "a voxel size in metres, above 0"));
        }
        let Positions { x, y, z } = &points.positions;
        let far = [x, y, z].map(|axis| axis.iter().fold(0.0f32, |m, &v| m.max(v)));
        let cells = f64::from(far[0].max(far[1]).max(far[2])) / size;
        if cells >= f64::from(morton::LIMIT - 64) {
            let expected = format!(
                "a size that gives fewer than {} voxels along an axis; {} needs {cells:.0}: cut the cloud (convert --bounds) or \
                 choose larger voxels (features.pyramid.first_scale)",
                morton::LIMIT,
                farthest(points)
            );
            return Err(Error::parameter("first_scale", size, expected));
        }
        Ok(Self { size })
    }

    /// Cell indices of a position.
    #[inline(always)]
    pub fn cell(&self, at: [f32; 3]) -> [u32; 3] {
        at.map(|v| (f64::from(v) / self.size) as u32)
    }

    /// Morton code of a position's cell.
    #[inline(always)]
    pub fn code(&self, at: [f32; 3]) -> u64 {
        morton::encode(self.cell(at))
    }
}

/// The point with the largest coordinate on an axis, for a message.
fn farthest(points: &Points) -> String {
    let reach = |i: usize| points.positions.xyz(i).into_iter().fold(f32::NEG_INFINITY, f32::max);
    let Some(i) = (0..points.len()).max_by(|&a, &b| reach(a).total_cmp(&reach(b))) else { return "it".into() };
    let [x, y, z] = points.world(i);
    format!(
        "point {} at {x:.1}, {y:.1}, {z:.1} m, {:.0} m from the other end of the cloud,",
        points.frame.index[i],
        reach(i)
    )
}

/// Sorts the points by (Morton code, index). O(n log n) time, 16 temporary bytes a point.
///
/// # Errors
/// If the work was cancelled.
pub fn sorted(points: Points, grid: &Grid, monitor: &Monitor) -> Result<Points> {
    let key = |i: usize| (grid.code(points.positions.xyz(i)), i as u32);
    let mut order: Vec<(u64, u32)> = map_watched(points.len(), monitor, key)?;
    sort_watched(&mut order, monitor)?;
    let rows = map_watched(order.len(), monitor, |i| order[i].1)?;
    drop(order);
    points.select(&rows, monitor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    #[test]
    fn points_of_one_voxel_stand_together_on_every_level() {
        let rows: Vec<[f64; 3]> = (0..500)
            .map(|i| [f64::from(i * 7919 % 97) * 0.1, f64::from(i * 104_729 % 89) * 0.1, f64::from(i % 13) * 0.1])
            .collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let grid = Grid::new(&points, 0.25).unwrap();
        let sorted = sorted(points.clone(), &grid, &Monitor::default()).unwrap().positions;
        for level in 0..5 {
            let codes: Vec<u64> = (0..sorted.len()).map(|i| grid.code(sorted.xyz(i)) >> (3 * level)).collect();
            assert!(codes.windows(2).all(|w| w[0] <= w[1]));
        }
    }

    #[test]
    fn a_tiny_voxel_in_a_huge_extent_is_refused() {
        let points = Points::from_cloud(&Cloud::from_rows(&[[0.0; 3], [1e6, 0.0, 0.0]]).unwrap(), 1.0);
        assert!(Grid::new(&points, 0.025).unwrap_err().to_string().contains("first_scale"));
        assert!(Grid::new(&points, 1.0).is_ok());
    }
}
