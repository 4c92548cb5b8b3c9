//! The lowest and highest point of a level within a vertical column.

use super::blocks::{Blocks, NONE};
use super::level::Level;
use super::morton;
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Monitor, map_watched, sort_watched};
use std::ops::Range;

/// A level's points sorted by the cells of a horizontal grid with edge equal to the radius of the column.
#[derive(Clone, Debug)]
pub struct Columns {
    radius: f64,
    /// Of 8 x 8 cells.
    blocks: Blocks,
    /// Points sorted by cell.
    order: Vec<u32>,
}

impl Columns {
    /// Prepares columns of that radius in metres (also the edge of the grid cells). O(n log n).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn new(level: &Level, radius: f64, monitor: &Monitor) -> Result<Self> {
        let key = |i: usize| (morton::encode_plane(cell_of([level.x[i], level.y[i]], radius)), i as u32);
        let mut keyed: Vec<(u64, u32)> = map_watched(level.len(), monitor, key)?;
        sort_watched(&mut keyed, monitor)?;
        let order = map_watched(keyed.len(), monitor, |i| keyed[i].1)?;
        let codes = map_watched(keyed.len(), monitor, |i| keyed[i].0)?;
        drop(keyed);
        Ok(Self { radius, blocks: Blocks::new(&codes, 0, monitor)?, order })
    }

    /// Whether the indices of all cells fit into a key.
    pub fn fits(points: &Positions, radius: f64) -> bool {
        let far = points.x.iter().chain(&points.y).fold(0.0f32, |m, &v| m.max(v));
        f64::from(far) / radius < f64::from(morton::LIMIT - 64)
    }
}

/// The cell of a place.
#[inline(always)]
fn cell_of(at: [f32; 2], radius: f64) -> [u32; 2] {
    at.map(|v| (f64::from(v) / radius) as u32)
}

/// The nine blocks around a block, looked up once for all its queries.
#[derive(Clone, Debug)]
struct Near {
    centre: [u32; 2],
    blocks: [u32; 9],
}

impl Default for Near {
    fn default() -> Self {
        Self { centre: [u32::MAX; 2], blocks: [NONE; 9] }
    }
}

impl Near {
    /// Moves to the block that holds `cell`.
    #[inline(always)]
    fn move_to(&mut self, blocks: &Blocks, cell: [u32; 2]) {
        let centre = cell.map(|c| c >> 3);
        if centre == self.centre {
            return;
        }
        self.centre = centre;
        for (i, slot) in self.blocks.iter_mut().enumerate() {
            let key = [centre[0] + i as u32 % 3, centre[1] + i as u32 / 3].map(|c| c.wrapping_sub(1));
            let inside = key.iter().all(|&c| c < morton::LIMIT);
            *slot = if inside { blocks.find(morton::encode_plane(key)).unwrap_or(NONE) } else { NONE };
        }
    }

    /// The points of a cell at most 8 cells away from the current block. Indices outside the grid wrap around and find
    /// nothing.
    #[inline(always)]
    fn cell(&self, blocks: &Blocks, cell: [u32; 2]) -> Range<usize> {
        let offset = [0, 1].map(|a| (cell[a] >> 3).wrapping_add(1).wrapping_sub(self.centre[a]));
        if offset.iter().any(|&o| o > 2) {
            return 0..0;
        }
        match self.blocks[(offset[0] + 3 * offset[1]) as usize] {
            NONE => 0..0,
            block => blocks.cell(block, morton::encode_plane(cell.map(|c| c & 7)) as u32),
        }
    }
}

/// Scratch memory for the column searches of one thread.
#[derive(Clone, Debug, Default)]
pub struct ColumnSearch {
    around: Near,
    cell: Option<[u32; 2]>,
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    /// Range of z in the query's own cell.
    own: (f32, f32),
}

impl ColumnSearch {
    /// Discards the gathered cells; to be called before another level is searched.
    pub fn reset(&mut self) {
        self.cell = None;
        self.around = Near::default();
    }

    /// Lowest and highest z of the level's points within the radius of `at` horizontally, and of `at` itself.
    #[inline(always)]
    pub fn cylinder(&mut self, level: &Level, columns: &Columns, at: [f32; 3]) -> (f32, f32) {
        self.move_to(level, columns, at);
        let limit = (columns.radius * columns.radius) as f32;
        let (mut low, mut high) = ([at[2]; 8], [at[2]; 8]);
        let chunks = self.x.chunks_exact(8).zip(self.y.chunks_exact(8)).zip(self.z.chunks_exact(8));
        for ((x, y), z) in chunks {
            for l in 0..8 {
                let (dx, dy) = (x[l] - at[0], y[l] - at[1]);
                let inside = dx * dx + dy * dy <= limit;
                low[l] = if inside & (z[l] < low[l]) { z[l] } else { low[l] };
                high[l] = if inside & (z[l] > high[l]) { z[l] } else { high[l] };
            }
        }
        for half in [4, 2, 1] {
            for l in 0..half {
                low[l] = if low[l + half] < low[l] { low[l + half] } else { low[l] };
                high[l] = if high[l + half] > high[l] { high[l + half] } else { high[l] };
            }
        }
        (low[0], high[0])
    }

    /// Lowest and highest z of the level's points in the grid cell of `at`, and of `at` itself.
    #[inline(always)]
    pub fn grid_cell(&mut self, level: &Level, columns: &Columns, at: [f32; 3]) -> (f32, f32) {
        self.move_to(level, columns, at);
        (self.own.0.min(at[2]), self.own.1.max(at[2]))
    }

    #[inline(always)]
    fn move_to(&mut self, level: &Level, columns: &Columns, at: [f32; 3]) {
        let cell = cell_of([at[0], at[1]], columns.radius);
        if self.cell != Some(cell) {
            self.cell = Some(cell);
            self.gather(level, columns, cell);
        }
    }

    #[inline(never)]
    fn gather(&mut self, level: &Level, columns: &Columns, cell: [u32; 2]) {
        self.around.move_to(&columns.blocks, cell);
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.own = (f32::INFINITY, f32::NEG_INFINITY);
        for i in 0..9u32 {
            let near = [(cell[0] + i % 3).wrapping_sub(1), (cell[1] + i / 3).wrapping_sub(1)];
            for &p in &columns.order[self.around.cell(&columns.blocks, near)] {
                let (x, y, z) = (level.x[p as usize], level.y[p as usize], level.z[p as usize]);
                self.x.push(x);
                self.y.push(y);
                self.z.push(z);
                if i == 4 {
                    self.own = (self.own.0.min(z), self.own.1.max(z));
                }
            }
        }
        // Padding outside every column, so that the loop runs over whole vectors.
        let full = self.x.len().next_multiple_of(8);
        self.x.resize(full, f32::INFINITY);
        self.y.resize(full, f32::INFINITY);
        self.z.resize(full, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::parallel::Monitor;
    use crate::random::stream;
    use crate::voxels::{Grid, build_levels, sorted};

    #[test]
    fn columns_equal_brute_force() {
        let mut s = stream(5, 0);
        let rows: Vec<[f64; 3]> =
            (0..3000).map(|_| [s.uniform() * 30.0, s.uniform() * 20.0, s.uniform() * 9.0]).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let grid = Grid::new(&points, 0.5).unwrap();
        let points = sorted(points, &grid, &Monitor::default()).unwrap().positions;
        for level in build_levels(&points, &grid, 4, &Monitor::default()).unwrap() {
            for radius in [level.size, 1.7 * level.size] {
                let columns = Columns::new(&level, radius, &Monitor::default()).unwrap();
                let mut search = ColumnSearch::default();
                for i in (0..points.len()).step_by(11) {
                    let at = points.xyz(i);
                    let inside = |j: &usize| {
                        let (dx, dy) = (level.x[*j] - at[0], level.y[*j] - at[1]);
                        dx * dx + dy * dy <= (radius * radius) as f32
                    };
                    let zs = (0..level.len()).filter(inside).map(|j| level.z[j]);
                    let expected = zs.fold((at[2], at[2]), |(lo, hi), z| (z.min(lo), z.max(hi)));
                    assert_eq!(search.cylinder(&level, &columns, at), expected);
                    let own = search.grid_cell(&level, &columns, at);
                    assert!(own.0 <= at[2] && own.1 >= at[2]);
                }
            }
        }
    }
}
