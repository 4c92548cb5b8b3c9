//! Features of many points as a table.

use super::extractor::stream::{Rows, blocks};
use super::extractor::tiles::Tiles;
use super::extractor::{Extractor, Scratch, Wanted};
use super::params::FeatureSet;
use crate::cloud::{Cloud, MetricCloud};
use crate::error::{Error, Result};
use crate::memory;
use crate::parallel::{Monitor, map_ordered_with};

/// Feature values, one row a point, with the name of each column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureTable {
    /// Name of each column, e.g. `Planarity_r0p4`.
    pub names: Vec<String>,
    /// Row-major: `values[row * names.len() + column]`.
    pub values: Vec<f32>,
}

impl FeatureTable {
    /// Number of columns.
    pub fn width(&self) -> usize {
        self.names.len()
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        if self.names.is_empty() { 0 } else { self.values.len() / self.names.len() }
    }

    /// The rows with these numbers, in their order.
    pub(crate) fn select(&self, rows: &[u32]) -> Self {
        let values = rows.iter().flat_map(|&row| self.row(row as usize)).copied().collect();
        Self { names: self.names.clone(), values }
    }

    /// This table's columns, then those of another with as many rows.
    pub(crate) fn beside(&self, other: &Self) -> Self {
        let names: Vec<String> = self.names.iter().chain(&other.names).cloned().collect();
        let mut values = Vec::with_capacity(self.values.len() + other.values.len());
        for row in 0..self.rows() {
            values.extend_from_slice(self.row(row));
            values.extend_from_slice(other.row(row));
        }
        Self { names, values }
    }

    /// Values of one row.
    pub fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.width()..(row + 1) * self.width()]
    }
}

/// Features of all points in the cloud's order; rows of points that are not finite, or stray, are NaN.
///
/// Takes 4 bytes a point and feature; classification does not use it.
///
/// # Errors
/// As [`Extractor::prepare`], or if the table does not fit into memory.
pub fn table(cloud: &Cloud, set: &FeatureSet, monitor: &Monitor) -> Result<FeatureTable> {
    let scene = MetricCloud::new(cloud, set.metres_per_unit, monitor)?;
    let extractor = Extractor::prepare(&scene, set, Wanted::All, monitor)?;
    scene.oddities().into_iter().for_each(|text| monitor.warn(text));
    collect(&extractor, cloud.len(), monitor)
}

/// Features of the points `at` (indices into the cloud, each once) in that order, and the first scale. They are computed
/// part by part: only the pyramid of one part is held at a time.
///
/// # Errors
/// As [`table`], or if an index is not that of a point or is there twice.
pub fn table_at(
    scene: &MetricCloud<'_>,
    set: &FeatureSet,
    at: &[u32],
    monitor: &Monitor,
) -> Result<(FeatureTable, f64)> {
    let row_of = row_numbers(at, scene.cloud.len())?;
    let tiles = Tiles::prepare(scene, set, Wanted::All, monitor)?;
    let width = tiles.names().len();
    let mut values = memory::filled(f32::NAN, at.len() * width, &format!("{width} features of {} points", at.len()))?;
    monitor.stage("features", at.len() as u64);
    let mut place = |rows: &Rows| {
        monitor.check()?;
        for (&point, row) in rows.points.iter().zip(rows.values.chunks_exact(width)) {
            values[row_of[point as usize] as usize * width..][..width].copy_from_slice(row);
        }
        Ok(())
    };
    let wanted = |point: u32| row_of[point as usize] != NO_ROW;
    tiles.each(wanted, monitor, |extractor| blocks(extractor, monitor, &mut place))?;
    Ok((FeatureTable { names: tiles.names().to_vec(), values }, tiles.first_scale()))
}

/// Points that have no row.
const NO_ROW: u32 = u32::MAX;

/// The row of each of `points` points.
fn row_numbers(at: &[u32], points: usize) -> Result<Vec<u32>> {
    let mut row_of = vec![NO_ROW; points];
    for (&point, row) in at.iter().zip(0..) {
        match row_of.get_mut(point as usize) {
            Some(slot) if *slot == NO_ROW => *slot = row,
            Some(_) => {
                return Err(Error::input(format!("point {point} is asked for twice; each point once is allowed")));
            }
            None => return Err(Error::input(format!("point {point} of a cloud of {points}"))),
        }
    }
    Ok(row_of)
}

/// Blocks per thread that are held until their rows have been stored.
const AT_ONCE: usize = 16;

fn collect(extractor: &Extractor<'_>, rows: usize, monitor: &Monitor) -> Result<FeatureTable> {
    let names = extractor.names().to_vec();
    let width = names.len();
    let mut values = memory::filled(f32::NAN, rows * width, &format!("{width} features of {rows} points"))?;
    monitor.stage("features", extractor.len() as u64);
    let at_once = AT_ONCE * rayon::current_num_threads();
    for first in (0..extractor.blocks()).step_by(at_once) {
        let range = first..(first + at_once).min(extractor.blocks());
        let parts = map_ordered_with(range, monitor, Scratch::default, |scratch, block| {
            let mut rows = Vec::new();
            let points = extractor.block(block, scratch, &mut rows);
            monitor.advance(points.len() as u64);
            Ok((points, rows))
        })?;
        for (points, rows) in parts {
            monitor.check()?;
            for (&point, row) in points.iter().zip(rows.chunks_exact(width)) {
                values[point as usize * width..][..width].copy_from_slice(row);
            }
        }
    }
    Ok(FeatureTable { names, values })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn the_table_has_the_same_bytes_for_any_number_of_threads() {
        let mut s = stream(8, 0);
        let rows: Vec<[f64; 3]> = (0..9000).map(|_| [s.uniform() * 40.0, s.uniform() * 30.0, s.uniform()]).collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        let mut set = FeatureSet::default();
        (set.pyramid.first_scale, set.pyramid.levels) = (Some(0.2), Some(9));
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let table = pool.install(|| table(&cloud, &set, &Monitor::default())).unwrap();
            table.values.iter().map(|v| v.to_bits()).collect::<Vec<u32>>()
        };
        let expected = with(1);
        assert_eq!(expected.len(), 9000 * 144);
        for threads in [2, 3, 8] {
            assert!(with(threads) == expected, "{threads} threads");
        }
    }
}
