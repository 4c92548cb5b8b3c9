//! One level of the pyramid prepared for queries, and the 16 features of query points on it.

mod contour;
pub(super) mod region;
pub(super) mod slots;
pub(super) mod sorted;
mod surfaces;

use super::definition::{Feature, Group};
use super::params::{Column, PyramidParams};
use super::tensor::{Batch, Convention, LANES, Lane, MOST, Tensor, covariance_features, exact_variation, tensor};
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::voxels::{self, ColumnSearch, Columns, Level, Search};
use contour::{Around, Surfaces, contour_features};
use pulp::{Arch, Simd, WithSimd};
use region::Region;
use slots::Slots;
use std::ops::Range;
use surfaces::{Packed, farthest, largest, surfaces, unpacked_variation};

/// A level, and the region in which it is complete; `None` for everywhere.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) level: Level,
    pub(super) region: Option<Region>,
}

/// A level, with everything that the selected features need.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    part: Part,
    surfaces: Vec<Packed>,
    columns: Option<Columns>,
    slots: Slots,
    /// Whether covariance or contour features are selected.
    shapes: bool,
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
    pub(super) points: &'a Positions,
    pub(super) range: Range<usize>,
    pub(super) width: usize,
    pub(super) out: &'a mut [f32],
}

impl<'a> Job<'a> {
    /// The query points of these rows.
    #[inline(always)]
    fn queries(&self, rows: &Range<usize>) -> Queries<'a> {
        let first = self.range.start;
        Queries { points: self.points, lanes: first + rows.start..first + rows.end }
    }
}

/// A block that is being computed.
struct Work<'a, 'b> {
    job: &'a mut Job<'b>,
    params: &'a PyramidParams,
    scratch: &'a mut Scratch,
}

impl Work<'_, '_> {
    /// Writes the lanes of each selected feature into its column of the rows.
    #[inline(always)]
    fn store<const N: usize>(&mut self, features: [(Feature, &Lane); N], slots: &Slots, rows: &Range<usize>) {
        let width = self.job.width;
        for (feature, values) in features {
            if let Some(column) = slots.column(feature) {
                let rows = self.job.out[rows.start * width..rows.end * width].chunks_exact_mut(width);
                rows.zip(values).for_each(|(out, &value)| out[column] = value);
            }
        }
    }
}

impl Stage {
    /// Prepares a level; normals and columns only if a selected feature needs them.
    pub(super) fn new(part: Part, slots: Slots, params: &PyramidParams, monitor: &Monitor) -> Result<Self> {
        let level = &part.level;
        let columns = slots.any(Group::Height).then(|| Columns::new(level, params.column_radius * level.size, monitor));
        let columns = columns.transpose()?;
        let (surfaces, open) = match slots.any(Group::Contour) {
            true => surfaces(level, part.region.as_ref(), params, monitor)?,
            false => (Vec::new(), Vec::new()),
        };
        let shapes = slots.any(Group::Covariance) || slots.any(Group::Contour);
        Ok(Self { part, surfaces, columns, slots, shapes, open })
    }

    /// Computes the selected features of the queries.
    pub(super) fn describe(&self, job: &mut Job<'_>, params: &PyramidParams, scratch: &mut Scratch) {
        if self.columns.is_none() && !self.shapes {
            return;
        }
        scratch.search.reset();
        scratch.columns.reset();
        Arch::new().dispatch(Describe { stage: self, work: Work { job, params, scratch } });
    }

    #[inline(always)]
    fn all_batches<S: Simd>(&self, simd: S, mut work: Work<'_, '_>) {
        let count = work.job.range.len();
        for first in (0..count).step_by(LANES) {
            let rows = first..(first + LANES).min(count);
            if let Some(columns) = &self.columns {
                self.heights(columns, &rows, &mut work);
            }
            if self.shapes {
                let source = SearchedLevel { level: &self.part.level, packed: &self.surfaces, params: work.params };
                let count = fill(simd, source, work.job.queries(&rows), work.scratch);
                if let Some(region) = &self.part.region {
                    self.note_loose(region, count, &rows, &mut work);
                }
                self.shape(simd, count, &rows, &mut work);
            }
        }
    }

    /// Covariance and contour features of the filled batch, whose neighbourhoods have `count` points.
    #[inline(always)]
    fn shape<S: Simd>(&self, simd: S, count: usize, rows: &Range<usize>, work: &mut Work<'_, '_>) {
        let params = work.params;
        let convention = Convention { centre: params.centre, divisor: params.divisor };
        // The usual size is a compile-time constant, so that its loops are unrolled.
        let tensor = if count == 10 {
            tensor(&work.scratch.batch, 10, convention)
        } else {
            tensor(&work.scratch.batch, count, convention)
        };
        let covariance = covariance_features(&tensor, params.normalise);
        work.store(covariance.keyed(), &self.slots, rows);
        if self.surfaces.is_empty() {
            return;
        }
        if params.include_query {
            let queries = work.job.queries(rows);
            let at = largest(queries.points, &queries.lanes);
            let variation = exact_variation(&work.scratch.batch, count, &tensor, &at);
            own_surface(&tensor, &variation, count - 1, &mut work.scratch.surfaces);
        }
        let near = (params.near_share * count as f64).ceil() as usize;
        let (batch, surfaces) = (&work.scratch.batch, &work.scratch.surfaces);
        let contour = if count == 10 && near == 5 {
            contour_features(simd, Around { batch, surfaces, count: 10, near: 5 }, &tensor.second)
        } else {
            contour_features(simd, Around { batch, surfaces, count, near }, &tensor.second)
        };
        work.store(contour.keyed(), &self.slots, rows);
    }

    /// Records the queries of the batch that may have nearer neighbours outside the region, or neighbours that do.
    #[inline(never)]
    fn note_loose(&self, region: &Region, count: usize, rows: &Range<usize>, work: &mut Work<'_, '_>) {
        let (params, points) = (work.params, work.job.points);
        let found = count - usize::from(params.include_query);
        let all = found == params.k.min(MOST - 1) - usize::from(params.include_query);
        for (l, row) in rows.clone().enumerate() {
            let i = work.job.range.start + row;
            let at = points.xyz(i);
            let open = |near: &[u32; LANES]| self.open.get(near[l] as usize).is_some_and(|&open| open);
            let sure = region.holds(at, farthest(&work.scratch.batch, found, l), all);
            if !sure || work.scratch.found[..found].iter().any(open) {
                work.scratch.loose.push(row as u32);
            }
        }
    }

    #[inline(always)]
    fn heights(&self, columns: &Columns, rows: &Range<usize>, work: &mut Work<'_, '_>) {
        let (mut range, mut below, mut above) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let points = work.job.points;
        for (l, row) in rows.clone().enumerate() {
            let i = work.job.range.start + row;
            let at = points.xyz(i);
            let (low, high) = match work.params.column {
                Column::Cylinder => work.scratch.columns.cylinder(columns, at),
                Column::Cell => ColumnSearch::grid_cell(columns, at),
            };
            range[l] = high - low;
            below[l] = at[2] - low;
            above[l] = high - at[2];
        }
        let features =
            [(Feature::VerticalRange, &range), (Feature::HeightBelow, &below), (Feature::HeightAbove, &above)];
        work.store(features, &self.slots, rows);
    }
}

/// Computes a block, compiled for each instruction set. (A closure would not be inlined and would remain scalar.)
struct Describe<'a, 'b> {
    stage: &'a Stage,
    work: Work<'a, 'b>,
}

impl WithSimd for Describe<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.stage.all_batches(simd, self.work);
    }
}

/// The query point itself gets the normal and variation of its own tensor.
#[inline(always)]
fn own_surface(tensor: &Tensor, variation: &[f32; LANES], row: usize, surfaces: &mut Surfaces) {
    (0..3).for_each(|a| surfaces.normal[a][row] = tensor.normal[a]);
    surfaces.variation[row] = *variation;
}

/// Up to 16 points.
#[derive(Clone, Debug)]
pub(super) struct Queries<'a> {
    pub(super) points: &'a Positions,
    /// Their indices.
    pub(super) lanes: Range<usize>,
}

/// Where the neighbourhoods of queries are taken from.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchedLevel<'a> {
    pub(super) level: &'a Level,
    /// Normals and surface variations of the level's points; none if they are not needed.
    pub(super) packed: &'a [Packed],
    pub(super) params: &'a PyramidParams,
}

/// Finds the neighbours of the queries, stores them by lanes, and returns the size of a neighbourhood.
#[inline(always)]
pub(super) fn fill<S: Simd>(simd: S, source: SearchedLevel<'_>, queries: Queries<'_>, scratch: &mut Scratch) -> usize {
    let SearchedLevel { level, packed, params } = source;
    let Queries { points, lanes } = queries;
    let wanted = params.k.min(MOST - 1) - usize::from(params.include_query);
    let mut at = [[0.0; LANES]; 3];
    for (axis, from) in at.iter_mut().zip([&points.x, &points.y, &points.z]) {
        axis[..lanes.len()].copy_from_slice(&from[lanes.clone()]);
    }
    let found = &mut scratch.found[..wanted];
    let mut count =
        scratch.search.nearest_of_batch(simd, level, voxels::Queries { at: &at, lanes: lanes.len() }, found);
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
            variation[l] = unpacked_variation(raw[3][l]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::definition::{Scope, of_scope};
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::random::stream;
    use crate::voxels::{Grid, build_levels, sorted};

    #[test]
    fn features_have_the_same_bytes_with_and_without_vector_instructions() {
        let mut s = stream(9, 0);
        let rows: Vec<[f64; 3]> = (0..2000).map(|_| [s.uniform() * 20.0, s.uniform() * 20.0, s.uniform()]).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let grid = Grid::new(&points, 0.2).unwrap();
        let points = sorted(points, &grid, &Monitor::default()).unwrap().positions;
        let params = PyramidParams::default();
        for level in build_levels(&points, &grid, 5, &Monitor::default()).unwrap() {
            let mut slots = Slots::default();
            of_scope(Scope::Level).zip(0..).for_each(|(d, column)| slots.put(d.feature, column));
            let width = of_scope(Scope::Level).count();
            let stage = Stage::new(Part { level, region: None }, slots, &params, &Monitor::default()).unwrap();
            let with = |vectors: bool| {
                let mut out = vec![0.0; points.len() * width];
                let mut job = Job { points: &points, range: 0..points.len(), width, out: &mut out };
                let mut scratch = Scratch::default();
                let work = Work { job: &mut job, params: &params, scratch: &mut scratch };
                let work = Describe { stage: &stage, work };
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
