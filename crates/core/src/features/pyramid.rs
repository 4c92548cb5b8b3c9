//! One level of the pyramid prepared for queries, and the 16 features of query points on it.

use super::contour::{Surfaces, contour_features};
use super::definition::PER_LEVEL;
use super::params::{Column, PyramidParams};
use super::region::Region;
use super::surfaces::{Packed, farthest, surfaces};
use super::tensor::{Batch, Convention, LANES, MOST, Tensor, covariance_features, tensor};
use crate::cloud::Points;
use crate::error::Result;
use crate::neighbours::{ColumnSearch, Columns, Level, Search};
use crate::parallel::Monitor;
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// The output column of each of a level's 16 features, or [`NOWHERE`].
pub(super) type Slots = [usize; PER_LEVEL];
/// Marks a feature that is not selected.
pub(super) const NOWHERE: usize = usize::MAX;

/// A level, with everything that the selected features need.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    level: Level,
    surfaces: Vec<Packed>,
    columns: Option<Columns>,
    slots: Slots,
    /// The region in which the level is complete; `None` for everywhere.
    region: Option<Region>,
    /// Whether the normal of each level point may differ from that on the complete level; empty if the level is
    /// complete.
    open: Vec<bool>,
}

/// Reusable state of one thread.
#[derive(Clone, Debug)]
pub struct Scratch {
    search: Search,
    columns: ColumnSearch,
    pub(super) batch: Batch,
    surfaces: Surfaces,
    found: [[u32; LANES]; MOST],
    loose: Vec<u32>,
}

impl Scratch {
    /// Rows of the last block whose neighbours may lie outside the loaded part of the cloud; ascending.
    pub fn loose(&self) -> &[u32] {
        &self.loose
    }

    /// To be called before the levels of a block.
    pub(super) fn begin(&mut self) {
        self.loose.clear();
    }

    /// To be called after the levels of a block.
    pub(super) fn finish(&mut self) {
        self.loose.sort_unstable();
        self.loose.dedup();
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            search: Search::default(),
            columns: ColumnSearch::default(),
            batch: Batch::default(),
            surfaces: Surfaces::default(),
            found: [[0; LANES]; MOST],
            loose: Vec::new(),
        }
    }
}

/// Query points and the output: row `r` of `out` belongs to point `range.start + r`.
pub(super) struct Job<'a> {
    pub(super) points: &'a Points,
    pub(super) range: Range<usize>,
    pub(super) width: usize,
    pub(super) out: &'a mut [f32],
}

impl Stage {
    /// Prepares a level that is complete in `region`, or everywhere; normals and columns only if a selected feature
    /// needs them.
    pub(super) fn new(
        (level, region): (Level, Option<Region>),
        slots: Slots,
        params: &PyramidParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        let wants = |range: Range<usize>| slots[range].iter().any(|&s| s != NOWHERE);
        let columns = wants(13..16).then(|| Columns::new(&level, params.column_radius * level.size, monitor));
        let columns = columns.transpose()?;
        let (surfaces, open) = match wants(9..13) {
            true => surfaces(&level, region.as_ref(), params, monitor)?,
            false => (Vec::new(), Vec::new()),
        };
        Ok(Self { level, surfaces, columns, slots, region, open })
    }

    /// Computes the selected features of the queries.
    pub(super) fn describe(&self, job: &mut Job<'_>, params: &PyramidParams, scratch: &mut Scratch) {
        if self.slots.iter().all(|&s| s == NOWHERE) {
            return;
        }
        scratch.search.reset();
        scratch.columns.reset();
        Arch::new().dispatch(Describe { stage: self, job, params, scratch });
    }

    #[inline(always)]
    fn all_batches<S: Simd>(&self, simd: S, job: &mut Job<'_>, params: &PyramidParams, scratch: &mut Scratch) {
        let points = job.points;
        for first in job.range.clone().step_by(LANES) {
            let lanes = first..(first + LANES).min(job.range.end);
            let row = first - job.range.start;
            if self.columns.is_some() {
                self.heights(lanes.clone(), job, row, (params, &mut *scratch));
            }
            if self.slots[..13].iter().any(|&s| s != NOWHERE) {
                let count = fill(simd, (&self.level, &self.surfaces), points, lanes.clone(), (params, &mut *scratch));
                if let Some(region) = &self.region {
                    self.note_loose(region, points, lanes.clone(), (count, row), (params, &mut *scratch));
                }
                self.shape(simd, count, lanes.len(), job, row, (params, &mut *scratch));
            }
        }
    }

    /// Covariance and contour features of the filled batch.
    #[inline(always)]
    fn shape<S: Simd>(
        &self,
        simd: S,
        count: usize,
        lanes: usize,
        job: &mut Job<'_>,
        row: usize,
        (params, scratch): (&PyramidParams, &mut Scratch),
    ) {
        let convention = Convention { centre: params.centre, divisor: params.divisor };
        // The usual size is a compile-time constant, so that its loops are unrolled.
        let tensor = if count == 10 {
            tensor(&scratch.batch, 10, convention)
        } else {
            tensor(&scratch.batch, count, convention)
        };
        let covariance = covariance_features(&tensor, params.normalise);
        store(&covariance.columns(), &self.slots[..9], lanes, job, row);
        if self.surfaces.is_empty() {
            return;
        }
        if params.include_query {
            own_surface(&tensor, &covariance.surface_variation, count - 1, &mut scratch.surfaces);
        }
        let near = (params.near_share * count as f64).ceil() as usize;
        let contour = if count == 10 && near == 5 {
            contour_features(simd, &scratch.batch, &scratch.surfaces, 10, &tensor.second, 5)
        } else {
            contour_features(simd, &scratch.batch, &scratch.surfaces, count, &tensor.second, near)
        };
        store(&contour.each_ref(), &self.slots[9..13], lanes, job, row);
    }

    /// Records the queries of the batch that may have nearer neighbours outside the region, or neighbours that do.
    #[inline(never)]
    fn note_loose(
        &self,
        region: &Region,
        points: &Points,
        lanes: Range<usize>,
        (count, row): (usize, usize),
        (params, scratch): (&PyramidParams, &mut Scratch),
    ) {
        let found = count - usize::from(params.include_query);
        let all = found == params.k.min(MOST - 1) - usize::from(params.include_query);
        for (l, i) in lanes.enumerate() {
            let at = [points.x[i], points.y[i], points.z[i]];
            let open = |rows: &[u32; LANES]| self.open.get(rows[l] as usize).is_some_and(|&open| open);
            let sure = region.holds(at, farthest(&scratch.batch, found, l), all);
            if !sure || scratch.found[..found].iter().any(open) {
                scratch.loose.push((row + l) as u32);
            }
        }
    }

    #[inline(always)]
    fn heights(
        &self,
        lanes: Range<usize>,
        job: &mut Job<'_>,
        row: usize,
        (params, scratch): (&PyramidParams, &mut Scratch),
    ) {
        let Some(columns) = &self.columns else { return };
        let mut features = [[0.0; LANES]; 3];
        for (l, i) in lanes.clone().enumerate() {
            let at = [job.points.x[i], job.points.y[i], job.points.z[i]];
            let (low, high) = match params.column {
                Column::Cylinder => scratch.columns.cylinder(&self.level, columns, at),
                Column::Cell => scratch.columns.grid_cell(&self.level, columns, at),
            };
            features[0][l] = high - low;
            features[1][l] = at[2] - low;
            features[2][l] = high - at[2];
        }
        store(&features.each_ref(), &self.slots[13..], lanes.len(), job, row);
    }
}

/// Computes a block, compiled for each instruction set. (A closure would not be inlined and would remain scalar.)
struct Describe<'a, 'b> {
    stage: &'a Stage,
    job: &'a mut Job<'b>,
    params: &'a PyramidParams,
    scratch: &'a mut Scratch,
}

impl WithSimd for Describe<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.stage.all_batches(simd, self.job, self.params, self.scratch);
    }
}

/// Writes the lanes of each selected feature into its column.
#[inline(always)]
fn store(features: &[&[f32; LANES]], slots: &[usize], lanes: usize, job: &mut Job<'_>, row: usize) {
    for (feature, &slot) in features.iter().zip(slots) {
        if slot != NOWHERE {
            let rows = job.out[row * job.width..].chunks_exact_mut(job.width);
            rows.zip(&feature[..lanes]).for_each(|(out, &value)| out[slot] = value);
        }
    }
}

/// The query point itself gets the normal and variation of its own tensor.
#[inline(always)]
fn own_surface(tensor: &Tensor, variation: &[f32; LANES], row: usize, surfaces: &mut Surfaces) {
    (0..3).for_each(|a| surfaces.normal[a][row] = tensor.normal[a]);
    surfaces.variation[row] = *variation;
}

/// Finds the neighbours of up to 16 points, stores them by lanes, and returns the size of a neighbourhood.
#[inline(always)]
pub(super) fn fill<S: Simd>(
    simd: S,
    (level, packed): (&Level, &[Packed]),
    points: &Points,
    lanes: Range<usize>,
    (params, scratch): (&PyramidParams, &mut Scratch),
) -> usize {
    let wanted = params.k.min(MOST - 1) - usize::from(params.include_query);
    let mut at = [[0.0; LANES]; 3];
    for (axis, from) in at.iter_mut().zip([&points.x, &points.y, &points.z]) {
        axis[..lanes.len()].copy_from_slice(&from[lanes.clone()]);
    }
    let found = &mut scratch.found[..wanted];
    let mut count = scratch.search.nearest_of_batch(simd, level, &at, lanes.len(), found);
    lay_out(level, &at, &found[..count], &mut scratch.batch);
    if !packed.is_empty() {
        unpack(packed, &found[..count], &mut scratch.surfaces);
    }
    if params.include_query {
        scratch.batch.x[count] = [0.0; LANES];
        scratch.batch.y[count] = [0.0; LANES];
        scratch.batch.z[count] = [0.0; LANES];
        count += 1;
    }
    count
}

/// Unused lanes hold the indices of an earlier query, or 0; their values are never stored.
#[inline(always)]
fn lay_out(level: &Level, at: &[[f32; LANES]; 3], found: &[[u32; LANES]], batch: &mut Batch) {
    let n = level.x.len();
    let (from_x, from_y, from_z) = (&level.x[..n], &level.y[..n], &level.z[..n]);
    let rows = batch.x.iter_mut().zip(&mut batch.y).zip(&mut batch.z);
    for (((x, y), z), indices) in rows.zip(found) {
        for (l, &i) in indices.iter().enumerate() {
            let i = (i as usize).min(n - 1);
            x[l] = from_x[i] - at[0][l];
            y[l] = from_y[i] - at[1][l];
            z[l] = from_z[i] - at[2][l];
        }
    }
}

#[inline(always)]
fn unpack(packed: &[Packed], found: &[[u32; LANES]], surfaces: &mut Surfaces) {
    let [x, y, z] = &mut surfaces.normal;
    let rows = x.iter_mut().zip(y).zip(z).zip(&mut surfaces.variation);
    for ((((x, y), z), variation), indices) in rows.zip(found) {
        let mut raw = [[0u16; LANES]; 4];
        for (l, &i) in indices.iter().enumerate() {
            let p = packed[(i as usize).min(packed.len() - 1)];
            (0..4).for_each(|part| raw[part][l] = p[part]);
        }
        for l in 0..LANES {
            x[l] = f32::from(raw[0][l] as i16) * (1.0 / 32767.0);
            y[l] = f32::from(raw[1][l] as i16) * (1.0 / 32767.0);
            z[l] = f32::from(raw[2][l] as i16) * (1.0 / 32767.0);
            variation[l] = f32::from(raw[3][l]) * (1.0 / 196_605.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::neighbours::{Grid, build_levels, sorted};
    use crate::random::stream;

    #[test]
    fn features_have_the_same_bytes_with_and_without_vector_instructions() {
        let mut s = stream(9, 0);
        let rows: Vec<[f64; 3]> = (0..2000).map(|_| [s.uniform() * 20.0, s.uniform() * 20.0, s.uniform()]).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let grid = Grid::new(&points, 0.2).unwrap();
        let points = sorted(points, &grid, &Monitor::default()).unwrap();
        let params = PyramidParams::default();
        for level in build_levels(&points, &grid, 5, &Monitor::default()).unwrap() {
            let stage = Stage::new((level, None), std::array::from_fn(|f| f), &params, &Monitor::default()).unwrap();
            let with = |vectors: bool| {
                let mut out = vec![0.0; points.len() * PER_LEVEL];
                let mut job = Job { points: &points, range: 0..points.len(), width: PER_LEVEL, out: &mut out };
                let mut scratch = Scratch::default();
                let work = Describe { stage: &stage, job: &mut job, params: &params, scratch: &mut scratch };
                match vectors {
                    true => Arch::new().dispatch(work),
                    false => pulp::Scalar::new().vectorize(work),
                }
                out.iter().map(|v| v.to_bits()).collect::<Vec<u32>>()
            };
            assert!(with(true) == with(false));
        }
    }
}
