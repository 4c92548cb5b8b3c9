//! The surface of the highest points: a plane through those of the cells around each cell.

use crate::error::Result;
use crate::parallel::{Monitor, concat_watched, map_ordered};
use crate::voxels::cells::index::{Walk, block_of};

/// Cells of a block.
const BLOCK: usize = 4096;

/// Cells on each side of the widest window.
const SIDE: usize = 2;

/// In place of the number of a cell: no point in it.
const EMPTY: u32 = u32::MAX;

/// The surface around a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Surface {
    /// In the window of 3 x 3 cells.
    pub(super) of3: Window,
    /// In the window of 5 x 5 cells.
    pub(super) of5: Window,
    /// The least roughness of the 3 x 3 windows around these 3 x 3 cells.
    pub(super) least: f32,
    /// Share of the 5 x 5 cells that hold points.
    pub(super) cover: f32,
}

/// Heights in a window of cells.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Window {
    pub(super) highest: f32,
    pub(super) lowest: f32,
    /// Root mean square distance in height of the highest points from their plane.
    pub(super) roughness: f32,
    /// Slope of that plane, rise over run.
    pub(super) slope: f32,
    /// Mean of the highest points.
    pub(super) mean: f32,
}

/// The surface around each cell. `keys` ascend; `ends` are the lowest and the highest point of each cell.
pub(super) fn surfaces(keys: &[[i32; 2]], ends: &[[f32; 2]], size: f64, monitor: &Monitor) -> Result<Vec<Surface>> {
    let blocks = keys.len().div_ceil(BLOCK);
    let parts = map_ordered(blocks, monitor, |b| {
        let range = block_of(b, BLOCK, keys.len());
        let mut walk = Walk::<SIDE>::new(keys, range.start);
        let around = |c: usize| {
            let near = Near::of(&mut walk, c);
            let windows = [1, SIDE].map(|side| near.window(ends, side, size));
            let cover = near.cells.iter().flatten().filter(|&&c| c != EMPTY).count() as f32 / 25.0;
            Surface { of3: windows[0], of5: windows[1], least: 0.0, cover }
        };
        Ok(range.map(around).collect::<Vec<Surface>>())
    })?;
    let mut surfaces = concat_watched(parts, monitor)?;
    let least = map_ordered(blocks, monitor, |b| {
        let range = block_of(b, BLOCK, keys.len());
        let mut walk = Walk::<1>::new(keys, range.start);
        let least = |c: usize| {
            let mut least = f32::INFINITY;
            walk.around(c, |near, _| least = least.min(surfaces[near].of3.roughness));
            least
        };
        Ok(range.map(least).collect::<Vec<f32>>())
    })?;
    surfaces.iter_mut().zip(least.into_iter().flatten()).for_each(|(surface, least)| surface.least = least);
    Ok(surfaces)
}

/// The occupied cells among the 5 x 5 around a cell, by their offset in x, then y.
struct Near {
    cells: [[u32; 5]; 5],
}

impl Near {
    fn of(walk: &mut Walk<'_, SIDE>, cell: usize) -> Self {
        let mut cells = [[EMPTY; 5]; 5];
        walk.around(cell, |near, [i, j]| cells[i][j] = near as u32);
        Self { cells }
    }

    /// Calls `each` with every occupied cell at most `side` cells away, and its offset.
    fn within(&self, side: usize, mut each: impl FnMut(usize, [i32; 2])) {
        let range = SIDE - side..=SIDE + side;
        let offset = |i: usize| i as i32 - SIDE as i32;
        for i in range.clone() {
            for j in range.clone() {
                match self.cells[i][j] {
                    EMPTY => {}
                    c => each(c as usize, [offset(i), offset(j)]),
                }
            }
        }
    }

    /// Heights and the least-squares plane of the highest points; a level plane if the cells are on one line.
    fn window(&self, ends: &[[f32; 2]], side: usize, size: f64) -> Window {
        let [mut lowest, mut highest] = [f32::INFINITY, f32::NEG_INFINITY];
        let mut sums = Sums::default();
        self.within(side, |c, at| {
            (lowest, highest) = (lowest.min(ends[c][0]), highest.max(ends[c][1]));
            sums.add(at, f64::from(ends[c][1]));
        });
        let [gradient, square] = sums.plane();
        Window {
            highest,
            lowest,
            roughness: square.max(0.0).sqrt() as f32,
            slope: (gradient / size) as f32,
            mean: (sums.z[0] / f64::from(sums.n)) as f32,
        }
    }
}

/// Sums over cells: offsets u and v, height z, and their products.
#[derive(Default)]
struct Sums {
    n: i32,
    u: i32,
    v: i32,
    uu: i32,
    uv: i32,
    vv: i32,
    /// Of z, u z, v z and z².
    z: [f64; 4],
}

impl Sums {
    fn add(&mut self, [u, v]: [i32; 2], z: f64) {
        self.n += 1;
        self.u += u;
        self.v += v;
        self.uu += u * u;
        self.uv += u * v;
        self.vv += v * v;
        let terms = [z, f64::from(u) * z, f64::from(v) * z, z * z];
        self.z.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }

    /// The length of the gradient of the least-squares plane (per cell), and the mean square of the residuals.
    fn plane(&self) -> [f64; 2] {
        let [n, u, v, uu, uv, vv] = [self.n, self.u, self.v, self.uu, self.uv, self.vv].map(f64::from);
        let [z, uz, vz, zz] = self.z;
        let (uu, uv, vv) = (uu - u * u / n, uv - u * v / n, vv - v * v / n);
        let (uz, vz, zz) = (uz - u * z / n, vz - v * z / n, zz - z * z / n);
        let determinant = uu * vv - uv * uv;
        if determinant < 1e-6 {
            return [0.0, zz / n];
        }
        let (a, b) = ((uz * vv - vz * uv) / determinant, (vz * uu - uz * uv) / determinant);
        [a.hypot(b), (zz - a * uz - b * vz) / n]
    }
}
