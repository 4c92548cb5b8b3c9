//! The cells of one size: the sorted heights in each, and the surface around it.

use super::Profiles;
use super::surface::{Surface, surfaces};
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Looks, Monitor};
use crate::voxels::cells::index::CellIndex;
use crate::voxels::cells::{Cells, cell_of};

/// The occupied cells of one size.
#[derive(Clone, Debug, Default)]
pub(super) struct CellGrid {
    size: f64,
    index: CellIndex<[i32; 2]>,
    /// Where the heights of each cell begin, and the end of the last.
    starts: Vec<u32>,
    /// Heights of the points, ascending within each cell.
    heights: Vec<f32>,
    /// Standard deviation and largest difference of successive heights in each cell.
    spread: Vec<[f32; 2]>,
    surfaces: Vec<Surface>,
}

impl CellGrid {
    pub(super) fn new(points: &Positions, size: f64, monitor: &Monitor) -> Result<Self> {
        let key = |i: usize| cell_of([points.x[i], points.y[i]].map(|v| f64::from(v) / size));
        let cells = Cells::new(points.len(), key, monitor)?;
        let mut heights: Vec<f32> = cells.items.iter().map(|&i| points.z[i as usize]).collect();
        let (mut starts, mut spread, mut ends) = (vec![0], Vec::new(), Vec::new());
        let mut looks = Looks::at(monitor);
        for c in 0..cells.len() {
            let own = &mut heights[cells.range(c)];
            looks.steps(own.len())?;
            own.sort_unstable_by(f32::total_cmp);
            spread.push([deviation(own), own.windows(2).map(|w| w[1] - w[0]).fold(0.0, f32::max)]);
            ends.push([own[0], own[own.len() - 1]]);
            starts.push(cells.range(c).end as u32);
        }
        let surfaces = surfaces(&cells.keys, &ends, size, monitor)?;
        Ok(Self { size, index: CellIndex::new(cells.keys), starts, heights, spread, surfaces })
    }

    /// The features of a point; heights nearer than `own` to its own are not above or below it. `None` if its cell is
    /// empty.
    pub(super) fn profile(&self, at: [f32; 3], own: f32) -> Option<[f32; Profiles::FEATURES]> {
        let key = cell_of([at[0], at[1]].map(|v| f64::from(v) / self.size));
        let c = self.index.find(key)?;
        let heights = &self.heights[self.starts[c] as usize..self.starts[c + 1] as usize];
        let (z, last) = (at[2], heights.len() - 1);
        let (below, not_above) =
            (heights.partition_point(|&h| h < z - own), heights.partition_point(|&h| h <= z + own));
        let rank = 0.5 * (below + not_above) as f32 / heights.len() as f32;
        let gap_below = if below > 0 { z - heights[below - 1] } else { 0.0 };
        let gap_above = heights.get(not_above).map_or(0.0, |h| h - z);
        let tenth = heights.len() / 10;
        let [deviation, gap] = self.spread[c];
        let Surface { of3, of5, least, cover } = &self.surfaces[c];
        Some([
            rank,
            gap_below,
            gap_above,
            heights[last] - z,
            z - heights[0],
            z - heights[heights.len() / 2],
            deviation,
            z - heights[tenth],
            heights[last - tenth] - z,
            gap,
            of3.highest - z,
            z - of3.lowest,
            of3.highest - of3.lowest,
            of3.roughness,
            of3.slope,
            z - of3.mean,
            of5.highest - z,
            z - of5.lowest,
            of5.highest - of5.lowest,
            of5.roughness,
            of5.slope,
            z - of5.mean,
            *least,
            *cover,
        ])
    }
}

fn deviation(values: &[f32]) -> f32 {
    let count = values.len() as f64;
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / count;
    let squares: f64 = values.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum();
    (squares / count).sqrt() as f32
}
