//! The cells of one size: the sorted heights in each, and the surface around it.

use super::Profiles;
use super::surface::{Surface, surfaces};
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Looks, Monitor};
use crate::voxels::cells::index::CellIndex;
use crate::voxels::cells::{Cells, cell_of};
use std::ops::Range;

/// The occupied cells of one size.
#[derive(Clone, Debug, Default)]
pub(super) struct CellGrid {
    size: f64,
    index: CellIndex<[i32; 2]>,
    columns: Vec<Column>,
    /// Heights of the points, ascending within each cell.
    heights: Vec<f32>,
}

/// What is known of a cell; it fills a line of the cache.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Column {
    /// Where the heights of the cell begin and end.
    heights: Range<u32>,
    /// Standard deviation of the heights.
    deviation: f32,
    /// Largest difference of successive heights.
    gap: f32,
    surface: Surface,
}

impl Column {
    /// The column of these heights, which ascend.
    fn new(heights: &[f32], place: Range<usize>, surface: Surface) -> Self {
        Self {
            heights: place.start as u32..place.end as u32,
            deviation: deviation(heights),
            gap: heights.windows(2).map(|w| w[1] - w[0]).fold(0.0, f32::max),
            surface,
        }
    }
}

/// A point and what is known of its cell.
#[derive(Clone, Copy)]
struct Own {
    z: f32,
    /// The lowest height of its cell.
    lowest: f32,
    /// Heights nearer than this are neither above nor below the point.
    near: f32,
}

impl CellGrid {
    pub(super) fn new(points: &Positions, size: f64, monitor: &Monitor) -> Result<Self> {
        let key = |i: usize| cell_of([points.x[i], points.y[i]].map(|v| f64::from(v) / size));
        let cells = Cells::new(points.len(), key, monitor)?;
        let mut heights: Vec<f32> = cells.items.iter().map(|&i| points.z[i as usize]).collect();
        let (mut ends, mut looks) = (Vec::with_capacity(cells.len()), Looks::at(monitor));
        for c in 0..cells.len() {
            let own = &mut heights[cells.range(c)];
            looks.steps(own.len())?;
            own.sort_unstable_by(f32::total_cmp);
            ends.push([own[0], own[own.len() - 1]]);
        }
        let surfaces = surfaces(&cells.keys, &ends, size, monitor)?;
        let column = |(c, surface)| Column::new(&heights[cells.range(c)], cells.range(c), surface);
        let columns = surfaces.into_iter().enumerate().map(column).collect();
        Ok(Self { size, index: CellIndex::new(cells.keys), columns, heights })
    }

    /// Calls `each` with the number of each point and its features, `None` if its cell is empty; heights nearer than `own` to
    /// its own are not above or below it. As in [`CellIndex::find_each`], all is read before anything is compared.
    pub(super) fn profiles(
        &self,
        points: &[[f32; 3]],
        own: f32,
        mut each: impl FnMut(usize, Option<[f32; Profiles::FEATURES]>),
    ) {
        let key = |at: &[f32; 3]| cell_of([at[0], at[1]].map(|v| f64::from(v) / self.size));
        let cells = self.index.find_each(&points.iter().map(key).collect::<Vec<_>>());
        let start = |cell: &Option<u32>| cell.map_or(0, |cell| self.columns[cell as usize].heights.start);
        let starts: Vec<u32> = cells.iter().map(start).collect();
        let lowest: Vec<f32> =
            starts.iter().map(|&start| self.heights.get(start as usize).copied().unwrap_or_default()).collect();
        for (i, cell) in cells.into_iter().enumerate() {
            let own = Own { z: points[i][2], lowest: lowest[i], near: own };
            each(i, cell.map(|cell| self.profile(&self.columns[cell as usize], own)));
        }
    }

    #[inline(always)]
    fn profile(&self, column: &Column, own: Own) -> [f32; Profiles::FEATURES] {
        let Column { heights, deviation, gap, surface } = column;
        let heights = &self.heights[heights.start as usize..heights.end as usize];
        let Own { z, lowest, near } = own;
        let last = heights.len() - 1;
        let (below, not_above) =
            (heights.partition_point(|&h| h < z - near), heights.partition_point(|&h| h <= z + near));
        let rank = 0.5 * (below + not_above) as f32 / heights.len() as f32;
        let gap_below = if below > 0 { z - heights[below - 1] } else { 0.0 };
        let gap_above = heights.get(not_above).map_or(0.0, |h| h - z);
        let tenth = heights.len() / 10;
        let Surface { of3, of5, least, cover } = surface;
        [
            rank,
            gap_below,
            gap_above,
            heights[last] - z,
            z - lowest,
            z - heights[heights.len() / 2],
            *deviation,
            z - heights[tenth],
            heights[last - tenth] - z,
            *gap,
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
        ]
    }
}

fn deviation(values: &[f32]) -> f32 {
    let count = values.len() as f64;
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / count;
    let squares: f64 = values.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum();
    (squares / count).sqrt() as f32
}
