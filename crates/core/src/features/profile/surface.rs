//! The surface of the highest points: a plane through those of the cells around each cell.

use crate::error::Result;
use crate::parallel::{Monitor, concat_watched, map_ordered};

/// Cells of a block.
const BLOCK: usize = 4096;

/// Cells on each side of the widest window.
const SIDE: i32 = 2;

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
    let block = |b: usize| b * BLOCK..((b + 1) * BLOCK).min(keys.len());
    let parts = map_ordered(keys.len().div_ceil(BLOCK), monitor, |b| {
        let around = |c: usize| {
            let near = Near::of(keys, c);
            let windows = [1, SIDE].map(|side| near.window(ends, side, size));
            let cover = near.cells.iter().flatten().filter(|c| c.is_some()).count() as f32 / 25.0;
            Surface { of3: windows[0], of5: windows[1], least: 0.0, cover }
        };
        Ok(block(b).map(around).collect::<Vec<Surface>>())
    })?;
    let mut surfaces = concat_watched(parts, monitor)?;
    let least = map_ordered(keys.len().div_ceil(BLOCK), monitor, |b| {
        let least = |c: usize| {
            let near = Near::of(keys, c);
            near.within(1).map(|(c, _)| surfaces[c].of3.roughness).fold(f32::INFINITY, f32::min)
        };
        Ok(block(b).map(least).collect::<Vec<f32>>())
    })?;
    surfaces.iter_mut().zip(least.into_iter().flatten()).for_each(|(surface, least)| surface.least = least);
    Ok(surfaces)
}

/// The occupied cells among the 5 x 5 around a cell, by their offset in x, then y.
struct Near {
    cells: [[Option<usize>; 5]; 5],
}

impl Near {
    fn of(keys: &[[i32; 2]], cell: usize) -> Self {
        let [x, y] = keys[cell];
        let mut cells = [[None; 5]; 5];
        for (dx, row) in (-SIDE..=SIDE).zip(&mut cells) {
            let first = [x.saturating_add(dx), y.saturating_sub(SIDE)];
            let at = keys.partition_point(|key| *key < first);
            let near = (at..keys.len()).take_while(|&c| keys[c][0] == first[0] && keys[c][1] - y <= SIDE);
            near.for_each(|c| row[(keys[c][1] - y + SIDE) as usize] = Some(c));
        }
        Self { cells }
    }

    /// The occupied cells at most `side` cells away, and their offsets.
    fn within(&self, side: i32) -> impl Iterator<Item = (usize, [f64; 2])> + '_ {
        let range = (SIDE - side) as usize..=(SIDE + side) as usize;
        let offset = |i: usize| f64::from(i as i32 - SIDE);
        range
            .clone()
            .flat_map(move |i| range.clone().filter_map(move |j| self.cells[i][j].map(|c| (c, [offset(i), offset(j)]))))
    }

    /// Heights and the least-squares plane of the highest points; a level plane if the cells are on one line.
    fn window(&self, ends: &[[f32; 2]], side: i32, size: f64) -> Window {
        let [mut lowest, mut highest] = [f32::INFINITY, f32::NEG_INFINITY];
        let mut sums = Sums::default();
        for (c, at) in self.within(side) {
            (lowest, highest) = (lowest.min(ends[c][0]), highest.max(ends[c][1]));
            sums.add(at, f64::from(ends[c][1]));
        }
        let [gradient, square] = sums.plane();
        Window {
            highest,
            lowest,
            roughness: square.max(0.0).sqrt() as f32,
            slope: (gradient / size) as f32,
            mean: (sums.z / sums.n) as f32,
        }
    }
}

/// Sums over cells: offsets u and v, height z, and their products.
#[derive(Default)]
struct Sums {
    n: f64,
    u: f64,
    v: f64,
    z: f64,
    uu: f64,
    uv: f64,
    vv: f64,
    uz: f64,
    vz: f64,
    zz: f64,
}

impl Sums {
    fn add(&mut self, [u, v]: [f64; 2], z: f64) {
        self.n += 1.0;
        self.u += u;
        self.v += v;
        self.z += z;
        self.uu += u * u;
        self.uv += u * v;
        self.vv += v * v;
        self.uz += u * z;
        self.vz += v * z;
        self.zz += z * z;
    }

    /// The length of the gradient of the least-squares plane (per cell), and the mean square of the residuals.
    fn plane(&self) -> [f64; 2] {
        let Self { n, u, v, z, .. } = *self;
        let (uu, uv, vv) = (self.uu - u * u / n, self.uv - u * v / n, self.vv - v * v / n);
        let (uz, vz, zz) = (self.uz - u * z / n, self.vz - v * z / n, self.zz - z * z / n);
        let determinant = uu * vv - uv * uv;
        if determinant < 1e-6 {
            return [0.0, zz / n];
        }
        let (a, b) = ((uz * vv - vz * uv) / determinant, (vz * uu - uz * uv) / determinant);
        [a.hypot(b), (zz - a * uz - b * vz) / n]
    }
}
