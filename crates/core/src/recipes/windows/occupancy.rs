//! Which cells around a point are occupied, at each scale.

use super::{Placement, WindowsRecipe};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::nn::sparse::{Shape, SparseTensor};
use crate::parallel::{Monitor, map_each, sort_watched, watched};

/// Bits of a key for an axis.
const BITS: u32 = 21;
/// Empty cells on both sides of each axis, so that no window leads into another row.
const MARGIN: i64 = 64;
/// Cells are below this along each axis.
const LIMIT: i64 = (1 << BITS) - 2 * MARGIN;

/// The key of a cell; the keys of a row along z follow each other.
fn packed(cell: [i64; 3]) -> u64 {
    cell.iter().fold(0, |key, &c| key << BITS | (c + MARGIN) as u64)
}

/// The cell of a key.
fn unpacked(key: u64) -> [i64; 3] {
    [2, 1, 0].map(|axis| (key >> (BITS * axis) & ((1 << BITS) - 1)) as i64 - MARGIN)
}

/// The size of cells and windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    pub(super) placement: Placement,
    /// Edge of the finest cells, metres.
    pub(super) voxel: f64,
    /// Number of scales; the cells of each are twice as long as those of the one before.
    pub(super) scales: usize,
    /// Cells along each side of a window.
    pub(super) window: usize,
}

impl Frame {
    /// That of a recipe with finest cells of this edge.
    pub(super) fn of(recipe: &WindowsRecipe, voxel: f64) -> Self {
        Self { placement: recipe.placement, voxel, scales: recipe.network.scales, window: recipe.network.window }
    }

    /// For each place along a side of the window, which cell it shows, counted from that of the point: ascending.
    fn offsets(&self) -> Vec<i64> {
        let half = (self.window / 2) as i64;
        let offset = |place: i64| match self.placement {
            Placement::Doubled if place < half => place - half + 1,
            _ => place - half,
        };
        (0..self.window as i64).map(offset).collect()
    }
}

/// The cells of a scale.
struct Scale {
    /// Keys of the occupied cells, ascending, each once; with windows centred on points: of the cell of each point.
    keys: Vec<u64>,
    /// The point of each key, if windows are centred on points.
    points: Vec<u32>,
}

impl Scale {
    /// The places in the list of the keys of a row of cells from `first`, `count` of them along z.
    fn row(&self, first: [i64; 3], count: i64) -> std::ops::Range<usize> {
        let key = packed(first);
        let start = self.keys.partition_point(|&k| k < key);
        let end = key + count as u64;
        let length = self.keys[start..].iter().take_while(|k| **k < end).count();
        start..start + length
    }
}

/// A cloud in cells.
pub(super) struct Occupancy {
    frame: Frame,
    positions: Positions,
    /// The corner of the cell 0, 0, 0: an edge of a finest cell below the lowest coordinates.
    origin: [f64; 3],
    scales: Vec<Scale>,
}

impl Occupancy {
    /// Puts the points of a cloud into cells.
    ///
    /// # Errors
    /// If the cloud has too many cells along an axis, or the work was cancelled.
    pub(super) fn new(frame: Frame, positions: Positions, monitor: &Monitor) -> Result<Self> {
        let Positions { x, y, z } = &positions;
        let ends = |axis: &Vec<f32>| {
            axis.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], &v| [low.min(v), high.max(v)])
        };
        let ends = [x, y, z].map(ends);
        let origin = ends.map(|[low, _]| f64::from(low) - frame.voxel);
        if let Some([low, high]) = ends.iter().find(|[l, h]| f64::from(h - l) / frame.voxel >= (LIMIT - 2) as f64) {
            let found = format!("a cloud of {} m in cells of {} m", high - low, frame.voxel);
            return Err(Error::input(format!("{found} (allowed: {LIMIT} cells along an axis)")));
        }
        let mut cells = Self { frame, positions, origin, scales: Vec::with_capacity(frame.scales) };
        for scale in 0..frame.scales {
            let found = cells.scale(scale, monitor)?;
            cells.scales.push(found);
        }
        Ok(cells)
    }

    /// The cells of the next scale.
    fn scale(&self, number: usize, monitor: &Monitor) -> Result<Scale> {
        if self.frame.placement == Placement::Centred {
            let mut keyed = Vec::with_capacity(self.positions.len());
            for piece in watched(self.positions.len(), monitor) {
                keyed.extend(piece?.map(|i| (packed(self.cell(i, number)), i as u32)));
            }
            sort_watched(&mut keyed, monitor)?;
            let (keys, points) = keyed.into_iter().unzip();
            return Ok(Scale { keys, points });
        }
        let mut keys = match number.checked_sub(1).and_then(|finer| self.scales.get(finer)) {
            // Cells of a grid lie in cells of the next.
            Some(finer) => finer.keys.iter().map(|&key| packed(unpacked(key).map(|c| c >> 1))).collect(),
            None => {
                let mut keys = Vec::with_capacity(self.positions.len());
                for piece in watched(self.positions.len(), monitor) {
                    keys.extend(piece?.map(|i| packed(self.cell(i, 0))));
                }
                keys
            }
        };
        // Neighbours along the last axis often share a cell.
        keys.dedup();
        sort_watched(&mut keys, monitor)?;
        keys.dedup();
        keys.shrink_to_fit();
        Ok(Scale { keys, points: Vec::new() })
    }

    /// The cell of a point at a scale.
    fn cell(&self, point: usize, scale: usize) -> [i64; 3] {
        let at = self.positions.xyz(point);
        [0, 1, 2].map(|a: usize| ((f64::from(at[a]) - self.origin[a]) / self.frame.voxel).floor() as i64 >> scale)
    }

    /// The points whose windows are the same, all points group by group: those of a finest cell, or each point alone.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn sharing(&self, monitor: &Monitor) -> Result<Vec<(u64, u32)>> {
        let alone = self.frame.placement == Placement::Centred;
        let key = |i: usize| if alone { i as u64 } else { packed(self.cell(i, 0)) };
        let mut all: Vec<(u64, u32)> = (0..self.positions.len()).map(|i| (key(i), i as u32)).collect();
        sort_watched(&mut all, monitor)?;
        Ok(all)
    }

    /// The occupied places of the window of a point at a scale, z running fastest, ascending.
    fn window(&self, point: usize, scale: usize) -> Vec<u32> {
        let mut seen = vec![false; self.frame.window.pow(3)];
        match self.frame.placement {
            Placement::Centred => self.centred(point, scale, &mut seen),
            Placement::Grid | Placement::Doubled => self.of_grid(point, scale, &mut seen),
        }
        seen.iter().zip(0..).filter(|(seen, _)| **seen).map(|(_, place)| place).collect()
    }

    fn of_grid(&self, point: usize, scale: usize, seen: &mut [bool]) {
        let offsets = self.frame.offsets();
        let Some((&first, &last)) = offsets.first().zip(offsets.last()) else { return };
        let [x, y, z] = self.cell(point, scale);
        let cells = &self.scales[scale];
        let rows = offsets.iter().flat_map(|dx| offsets.iter().map(move |dy| [x + dx, y + dy, z + first]));
        for (row, corner) in seen.chunks_exact_mut(self.frame.window).zip(rows) {
            for &key in &cells.keys[cells.row(corner, last - first + 1)] {
                let dz = unpacked(key)[2] - z;
                let place = offsets.partition_point(|&offset| offset < dz);
                let twice = offsets[place..].iter().take_while(|offset| **offset == dz).count();
                row[place..place + twice].fill(true);
            }
        }
    }

    fn centred(&self, point: usize, scale: usize, seen: &mut [bool]) {
        let (window, cells) = (self.frame.window, &self.scales[scale]);
        let [edge, half] = [self.frame.voxel * f64::from(1u32 << scale), window as f64 / 2.0];
        let (centre, reach) = (self.positions.xyz(point), window.div_ceil(2) as i64);
        let [x, y, z] = self.cell(point, scale);
        for dx in -reach..=reach {
            for dy in -reach..=reach {
                for at in cells.row([x + dx, y + dy, z - reach], 2 * reach + 1) {
                    let other = self.positions.xyz(cells.points[at] as usize);
                    let place =
                        [0, 1, 2].map(|a: usize| ((f64::from(other[a]) - f64::from(centre[a])) / edge + half).floor());
                    if place.iter().all(|&p| (0.0..window as f64).contains(&p)) {
                        let [x, y, z] = place.map(|p| p as usize);
                        seen[(x * window + y) * window + z] = true;
                    }
                }
            }
        }
    }

    /// The occupied places of the windows of a point, scale by scale.
    pub(super) fn windows(&self, point: u32) -> Vec<Vec<u32>> {
        (0..self.frame.scales).map(|scale| self.window(point as usize, scale)).collect()
    }

    /// The windows of some points as the network takes them.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn tensors(&self, points: &[u32], monitor: &Monitor) -> Result<Vec<SparseTensor<f32>>> {
        tensors(&self.frame, &map_each(points, monitor, |&point| Ok(self.windows(point)))?)
    }
}

/// A tensor a scale of the windows of some points.
///
/// # Errors
/// If there are none.
pub(super) fn tensors(frame: &Frame, samples: &[Vec<Vec<u32>>]) -> Result<Vec<SparseTensor<f32>>> {
    let shape = Shape::new(samples.len(), 1, &[frame.window; 3])?;
    let volume = shape.cells() as u64;
    let tensor = |scale: usize| {
        let own = |(sample, windows): (u64, &Vec<Vec<u32>>)| {
            windows[scale].iter().map(|&place| sample * volume + u64::from(place)).collect::<Vec<_>>()
        };
        let keys: Vec<u64> = (0..).zip(samples).flat_map(own).collect();
        let values = vec![1.0; keys.len()];
        SparseTensor::new(shape.clone(), keys, values)
    };
    (0..frame.scales).map(tensor).collect()
}
