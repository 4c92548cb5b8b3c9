//! Wires: long thin lines high above the ground.

use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::graph::UnionFind;
use crate::linalg::Moments;
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::Shape;
use crate::parallel::{Monitor, map_ordered};
use crate::voxels::cells::Cells;
use crate::voxels::rows::{RowGrid, adjacency, neighbours};
use serde::{Deserialize, Serialize};

/// Voxels of a block.
const BLOCK: usize = 4096;

/// What a wire is.
///
/// Points high above the ground are put into voxels. A voxel is a piece of a wire if the points in the 27 voxels around it
/// lie along a line that is not steep; touching pieces make a wire if they reach far enough.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WireParams {
    /// Least distance between the ends of a wire, metres. 0: no wires are looked for.
    pub length: f64,
    /// Least height above the ground, metres; 0 or more.
    pub height: f64,
    /// Edge of the voxels, metres; above 0.
    pub voxel: f64,
    /// Least linearity (λ1 − λ2) / λ1 of the points around a voxel; 0..1.
    pub linearity: f64,
    /// Largest standard deviation across the line, √λ2, metres.
    pub width: f64,
    /// Largest vertical part of the line's direction, |e1z|; 0..=1.
    pub slope: f64,
    /// Points around a voxel, at least.
    pub points: usize,
}

impl Default for WireParams {
    fn default() -> Self {
        Self { length: 15.0, height: 3.5, voxel: 1.5, linearity: 0.95, width: 0.35, slope: 0.5, points: 4 }
    }
}

impl WireParams {
    /// The same, but without effect.
    pub fn none() -> Self {
        Self { length: 0.0, ..Self::default() }
    }

    pub(super) fn validate(&self) -> Result<()> {
        let lengths = [
            ("classes.wires.length", self.length),
            ("classes.wires.height", self.height),
            ("classes.wires.width", self.width),
        ];
        for (name, value) in lengths {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::parameter(name, value, "metres, 0 or more"));
            }
        }
        for (name, value) in [("classes.wires.linearity", self.linearity), ("classes.wires.slope", self.slope)] {
            if !(0.0..=1.0).contains(&value) {
                return Err(Error::parameter(name, value, "0 to 1"));
            }
        }
        match self.voxel > 0.0 && self.voxel.is_finite() {
            true => Ok(()),
            false => Err(Error::parameter("classes.wires.voxel", self.voxel, "metres, above 0")),
        }
    }

    /// Those of some rows of the points that belong to wires, ascending by voxel. O(n log n).
    pub(super) fn among(&self, rows: &[u32], points: &Points, monitor: &Monitor) -> Result<Vec<u32>> {
        let at = |i: usize| points.positions.xyz(rows[i] as usize);
        let grid = RowGrid::new((0..rows.len()).map(at), self.voxel, "classes.wires.voxel")?;
        let voxels = Cells::new(rows.len(), |i| grid.key(at(i)), monitor)?;
        let block = |b: usize| b * BLOCK..((b + 1) * BLOCK).min(voxels.len());
        let pieces = map_ordered(voxels.len().div_ceil(BLOCK), monitor, |b| {
            let mut around = vec![Moments::default(); block(b).len()];
            neighbours(&voxels.keys, block(b), |place, near| {
                let centre = grid.centre(voxels.keys[block(b).start + place]);
                for &i in voxels.of(near as usize) {
                    let at = at(i as usize);
                    around[place].add([0, 1, 2].map(|a| f64::from(at[a]) - f64::from(centre[a])));
                }
            });
            let line = |(voxel, around): (usize, &Moments)| self.is_line(around).then_some(voxel);
            Ok(block(b).zip(&around).filter_map(line).collect::<Vec<usize>>())
        })?
        .concat();
        let keys: Vec<u64> = pieces.iter().map(|&voxel| voxels.keys[voxel]).collect();
        let long = self.long(&keys, &grid, monitor)?;
        let wires = pieces.iter().zip(long).filter(|(_, long)| *long);
        Ok(wires.flat_map(|(&voxel, _)| voxels.of(voxel)).map(|&i| rows[i as usize]).collect())
    }

    /// Whether points lie along a line that is not steep.
    fn is_line(&self, points: &Moments) -> bool {
        if points.count() < self.points.max(2) as f64 {
            return false;
        }
        let eigen = points.covariance().eigen();
        Shape::of::<Exact>(eigen.values).linearity >= self.linearity
            && eigen.values[1].sqrt() <= self.width
            && eigen.vectors[0][2].abs() <= self.slope
    }

    /// Whether each of these voxels (ascending keys) belongs to a chain of touching ones that reaches far enough.
    fn long(&self, keys: &[u64], grid: &RowGrid, monitor: &Monitor) -> Result<Vec<bool>> {
        let touching = adjacency(keys, monitor)?;
        let mut chains = UnionFind::new(keys.len());
        for (voxel, near) in touching.groups().enumerate() {
            near.iter().for_each(|&other| _ = chains.unite(voxel as u32, other));
        }
        let roots = chains.roots(monitor)?;
        let mut bounds = vec![[[f32::MAX; 3], [f32::MIN; 3]]; keys.len()];
        for (&root, &key) in roots.iter().zip(keys) {
            let (centre, [low, high]) = (grid.centre(key), &mut bounds[root as usize]);
            (0..3).for_each(|a| (low[a], high[a]) = (low[a].min(centre[a]), high[a].max(centre[a])));
        }
        let reach =
            |[low, high]: [[f32; 3]; 2]| (0..3).map(|a| f64::from(high[a] - low[a]).powi(2)).sum::<f64>().sqrt();
        Ok(roots.iter().map(|&root| reach(bounds[root as usize]) >= self.length).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;

    #[test]
    fn wires_are_found_and_crowns_poles_and_short_lines_are_not() {
        let mut s = stream(1, 4);
        let mut noisy = |at: [f64; 3]| at.map(|v| v + 0.03 * (s.uniform() - 0.5));
        // A sagging wire of 60 m with a point each 0.4 m, and one beside it 5 m away.
        let sag = |t: f64| 12.0 + 4.0 * (t / 60.0 - 0.5).powi(2);
        let mut rows: Vec<[f64; 3]> =
            (0..150).map(|i| 0.4 * f64::from(i)).map(|t| noisy([t, 0.3 * t, sag(t)])).collect();
        rows.extend((0..150).map(|i| 0.4 * f64::from(i)).map(|t| noisy([t, 0.3 * t + 5.0, sag(t)])));
        let wires = rows.len() as u32;
        // A cable of 8 m, a pole, and a crown.
        rows.extend((0..20).map(|i| noisy([80.0 + 0.4 * f64::from(i), 10.0, 9.0])));
        rows.extend((0..60).map(|i| noisy([100.0, 10.0, 4.0 + 0.4 * f64::from(i)])));
        let mut s = stream(2, 4);
        rows.extend((0..4000).map(|_| [30.0 + 20.0 * s.uniform(), 40.0 + 20.0 * s.uniform(), 5.0 + 6.0 * s.uniform()]));
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let mut found = WireParams::default().among(&all, &points, &Monitor::default()).unwrap();
        found.sort_unstable();
        assert!(found.iter().all(|&row| row < wires), "{found:?}");
        // Ends of a wire may lie alone in their voxel.
        assert!(found.len() as u32 >= wires - 8, "{}", found.len());
        let longer = WireParams { length: 80.0, ..WireParams::default() };
        assert!(longer.among(&all, &points, &Monitor::default()).unwrap().is_empty());
        assert!(WireParams::default().among(&[], &points, &Monitor::default()).unwrap().is_empty());
    }

    #[test]
    fn ranges_are_checked() {
        let wrong = [
            WireParams { length: -1.0, ..WireParams::default() },
            WireParams { voxel: 0.0, ..WireParams::default() },
            WireParams { linearity: 1.5, ..WireParams::default() },
            WireParams { width: f64::NAN, ..WireParams::default() },
        ];
        assert!(wrong.iter().all(|params| params.validate().is_err()));
        assert!(WireParams::none().validate().is_ok());
    }
}
