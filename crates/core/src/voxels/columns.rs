//! The lowest and highest point of a level within a vertical column.

use super::cells::index::CellIndex;
use super::cells::{Cells, cell_of};
use super::level::Level;
use crate::error::Result;
use crate::parallel::{Monitor, map_watched};
use std::ops::Range;

/// A level's points sorted by the cells of a horizontal grid with edge equal to the radius of the column.
#[derive(Clone, Debug)]
pub struct Columns {
    radius: f64,
    index: CellIndex<[i32; 2]>,
    /// First point of each occupied cell; one more entry than cells.
    starts: Vec<u32>,
    /// Positions sorted by cell.
    points: Vec<[f32; 3]>,
}

impl Columns {
    /// Prepares columns of that radius in metres (also the edge of the grid cells). O(n).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn new(level: &Level, radius: f64, monitor: &Monitor) -> Result<Self> {
        let Cells { keys, starts, items } =
            Cells::new(level.len(), |i| cell([level.x[i], level.y[i]], radius), monitor)?;
        let place = |p: usize| [level.x[p], level.y[p], level.z[p]];
        let points = map_watched(items.len(), monitor, |i| place(items[i] as usize))?;
        Ok(Self { radius, index: CellIndex::new(keys), starts, points })
    }

    /// The points of the cells with these indices in x and, from the first to the last, in y.
    #[inline(always)]
    fn row(&self, x: i32, [first, last]: [i32; 2]) -> &[[f32; 3]] {
        let Range { start, end } = self.index.run([x, first], [x, last]);
        &self.points[self.starts[start] as usize..self.starts[end] as usize]
    }
}

/// The cell of a place.
#[inline(always)]
fn cell(at: [f32; 2], radius: f64) -> [i32; 2] {
    cell_of(at.map(|v| f64::from(v) / radius))
}

/// Scratch memory for the column searches of one thread.
#[derive(Clone, Debug, Default)]
pub struct ColumnSearch {
    /// The cell around which points are gathered.
    around: Option<[i32; 2]>,
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

impl ColumnSearch {
    /// Discards the gathered cells; to be called before another level is searched.
    pub fn reset(&mut self) {
        self.around = None;
    }

    /// Lowest and highest z of the level's points within the radius of `at` horizontally, and of `at` itself.
    #[inline(always)]
    pub fn cylinder(&mut self, columns: &Columns, at: [f32; 3]) -> (f32, f32) {
        let own = cell([at[0], at[1]], columns.radius);
        if self.around != Some(own) {
            self.around = Some(own);
            self.gather(columns, own);
        }
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
    pub fn grid_cell(columns: &Columns, at: [f32; 3]) -> (f32, f32) {
        let [x, y] = cell([at[0], at[1]], columns.radius);
        columns.row(x, [y, y]).iter().fold((at[2], at[2]), |(low, high), point| (low.min(point[2]), high.max(point[2])))
    }

    #[inline(never)]
    fn gather(&mut self, columns: &Columns, [x, y]: [i32; 2]) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        for x in x - 1..=x + 1 {
            for &[x, y, z] in columns.row(x, [y - 1, y + 1]) {
                self.x.push(x);
                self.y.push(y);
                self.z.push(z);
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
                    assert_eq!(search.cylinder(&columns, at), expected);
                    let same = |j: &usize| cell([level.x[*j], level.y[*j]], radius) == cell([at[0], at[1]], radius);
                    let zs = (0..level.len()).filter(same).map(|j| level.z[j]);
                    let expected = zs.fold((at[2], at[2]), |(lo, hi), z| (z.min(lo), z.max(hi)));
                    assert_eq!(ColumnSearch::grid_cell(&columns, at), expected);
                }
            }
        }
    }
}
