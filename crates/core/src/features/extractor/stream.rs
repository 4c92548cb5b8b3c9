//! Features of all points, passed on as they are computed, without a complete table in memory.

use super::tiles::Tiles;
use super::{Extractor, Scratch, Wanted};
use crate::cloud::{Cloud, MetricCloud};
use crate::error::Result;
use crate::features::params::FeatureSet;
use crate::memory;
use crate::parallel::{Monitor, map_ordered_with};

/// Blocks per thread that are held until their rows have been passed on.
const AT_ONCE: usize = 16;

/// Number of points without features that are passed on together.
const MISSING: usize = 4096;

/// Features of some points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Index of each point in the cloud.
    pub points: Vec<u32>,
    /// Row-major: the values of the first point, then those of the second.
    pub values: Vec<f32>,
}

/// The features of a cloud's points, computed part by part.
///
/// Takes about 40 bytes a point beside the cloud, and the features of a part of a million points.
pub struct FeatureStream<'a> {
    tiles: Tiles<'a>,
    points: usize,
}

impl<'a> FeatureStream<'a> {
    /// Sorts the points and builds the coarse levels.
    ///
    /// # Errors
    /// As [`Extractor::prepare`].
    pub fn prepare(cloud: &'a Cloud, set: &FeatureSet, wanted: Wanted<'_>, monitor: &Monitor) -> Result<Self> {
        let needed = 40 * cloud.len() as u64 + 150 * cloud.len().min(1 << 20) as u64;
        memory::require(needed, &format!("the features of {} points", cloud.len()))?;
        let scene = MetricCloud::new(cloud, set.metres_per_unit, monitor)?;
        let tiles = Tiles::prepare(&scene, set, wanted, monitor)?;
        scene.oddities().into_iter().for_each(|text| monitor.warn(text));
        Ok(Self { tiles, points: cloud.len() })
    }

    /// Names of the columns.
    pub fn names(&self) -> &[String] {
        self.tiles.names()
    }

    /// Passes on each point's row once, not in the cloud's order; rows of points that are not finite, or stray, are NaN.
    ///
    /// The rows and their order are the same for any number of threads; only the division into [`Rows`] differs.
    ///
    /// # Errors
    /// If `take` fails or the work was cancelled.
    pub fn for_each(&self, monitor: &Monitor, mut take: impl FnMut(&Rows) -> Result<()>) -> Result<()> {
        monitor.stage("features", self.tiles.len() as u64);
        self.tiles.each(|_| true, monitor, |extractor| blocks(extractor, monitor, &mut take))?;
        self.missing(&mut take)
    }

    fn missing(&self, take: &mut impl FnMut(&Rows) -> Result<()>) -> Result<()> {
        if self.tiles.len() == self.points {
            return Ok(());
        }
        let mut there = vec![false; self.points];
        self.tiles.indices().iter().for_each(|&point| there[point as usize] = true);
        let lost: Vec<u32> = (0..self.points as u32).filter(|&point| !there[point as usize]).collect();
        lost.chunks(MISSING).try_for_each(|points| {
            take(&Rows { points: points.to_vec(), values: vec![f32::NAN; points.len() * self.names().len()] })
        })
    }
}

/// Passes on the rows of an extractor; returns the numbers of those that need a wider margin.
pub(in crate::features) fn blocks(
    extractor: &Extractor<'_>,
    monitor: &Monitor,
    take: &mut impl FnMut(&Rows) -> Result<()>,
) -> Result<Vec<usize>> {
    let at_once = AT_ONCE * rayon::current_num_threads();
    let mut loose = Vec::new();
    for first in (0..extractor.blocks()).step_by(at_once) {
        let range = first..(first + at_once).min(extractor.blocks());
        let parts = map_ordered_with(range, monitor, Scratch::default, |scratch, b| Ok(block(extractor, b, scratch)))?;
        for (rows, left) in parts {
            take(&rows)?;
            monitor.advance(rows.points.len() as u64);
            loose.extend(left);
        }
    }
    Ok(loose)
}

/// The rows of a block, and the numbers of those that need a wider margin.
fn block(extractor: &Extractor<'_>, block: usize, scratch: &mut Scratch) -> (Rows, Vec<usize>) {
    let mut values = Vec::new();
    let points = extractor.block(block, scratch, &mut values);
    let loose = scratch.loose();
    if loose.is_empty() {
        return (Rows { points: points.to_vec(), values }, Vec::new());
    }
    let mut rows = Rows::default();
    for (r, row) in (0u32..).zip(values.chunks_exact(extractor.names().len())) {
        if loose.binary_search(&r).is_err() {
            rows.points.push(points[r as usize]);
            rows.values.extend_from_slice(row);
        }
    }
    (rows, loose.iter().map(|&row| block * Extractor::BLOCK + row as usize).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// A table computed as a whole is a different path through the same kernels.
    #[test]
    fn rows_are_those_of_the_table_each_once() {
        let mut s = stream(15, 0);
        let mut rows: Vec<[f64; 3]> =
            (0..9000).map(|_| [s.uniform() * 60.0, s.uniform() * 40.0, s.uniform()]).collect();
        (rows[17], rows[4000]) = ([f64::NAN, 0.0, 0.0], [f64::INFINITY; 3]);
        let cloud = Cloud::from_rows(&rows).unwrap();
        let mut set = FeatureSet::default();
        (set.pyramid.first_scale, set.pyramid.levels) = (Some(0.2), Some(4));
        let monitor = Monitor::default();
        let table = crate::features::table(&cloud, &set, &monitor).unwrap();
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        for only in [vec![], vec!["Planarity".to_string(), table.names[5].clone()]] {
            let stream = FeatureStream::prepare(&cloud, &set, Wanted::Asked(&only), &monitor).unwrap();
            let columns: Vec<usize> =
                stream.names().iter().map(|n| table.names.iter().position(|t| t == n).unwrap()).collect();
            assert!(if only.is_empty() { columns.len() == table.width() } else { columns.len() == 5 }, "{columns:?}");
            assert!(columns.is_sorted());
            let mut seen = vec![false; cloud.len()];
            let check = |rows: &Rows| {
                for (&point, row) in rows.points.iter().zip(rows.values.chunks_exact(columns.len())) {
                    let whole = table.row(point as usize);
                    assert_eq!(bits(row), bits(&columns.iter().map(|&c| whole[c]).collect::<Vec<_>>()), "{point}");
                    assert!(!std::mem::replace(&mut seen[point as usize], true));
                }
                Ok(())
            };
            stream.for_each(&monitor, check).unwrap();
            assert!(seen.iter().all(|&s| s));
        }
        let wrong = ["Flatness".to_string()];
        let message = FeatureStream::prepare(&cloud, &set, Wanted::Asked(&wrong), &monitor).err().unwrap().to_string();
        assert!(message.contains("Flatness") && message.contains("Planarity"), "{message}");
    }
}
