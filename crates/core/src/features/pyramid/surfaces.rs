//! The first pass over a level: normal and surface variation of its points.

use super::region::Region;
use super::{Queries, Scratch, Source, fill};
use crate::cloud::Positions;
use crate::error::Result;
use crate::features::params::PyramidParams;
use crate::features::tensor::{Batch, Convention, LANES, MOST, covariance_features, tensor};
use crate::parallel::{Monitor, map_ordered};
use crate::voxels::Level;
use pulp::{Arch, Simd, WithSimd};

/// Level points that one task processes.
const CHUNK: usize = 4096;

/// Normal (three integers in -32767..=32767) and surface variation (0..=1/3 scaled to 0..=65535) of a level point.
pub(super) type Packed = [u16; 4];

/// First pass: normal and surface variation of every point of the level from its k nearest on the level (itself
/// included), and which of them may differ on the complete level.
pub(in crate::features) fn surfaces(
    level: &Level,
    region: Option<&Region>,
    params: &PyramidParams,
    monitor: &Monitor,
) -> Result<(Vec<Packed>, Vec<bool>)> {
    let params = PyramidParams { include_query: false, ..params.clone() };
    let chunks = map_ordered(level.len().div_ceil(CHUNK), monitor, |c| {
        let range = c * CHUNK..((c + 1) * CHUNK).min(level.len());
        let points = Positions {
            x: level.x[range.clone()].to_vec(),
            y: level.y[range.clone()].to_vec(),
            z: level.z[range.clone()].to_vec(),
        };
        let mut packed = vec![[0; 4]; range.len()];
        let mut open = vec![false; if region.is_some() { range.len() } else { 0 }];
        let part = region.map(|region| (region, &mut open[..]));
        Arch::new().dispatch(Pack { level, points: &points, params: &params, packed: &mut packed, open: part });
        Ok((packed, open))
    })?;
    let (mut packed, mut open) = (Vec::new(), Vec::new());
    packed.reserve_exact(level.len());
    for chunk in chunks {
        monitor.check()?;
        packed.extend(chunk.0);
        open.extend(chunk.1);
    }
    Ok((packed, open))
}

/// The first pass over a chunk of a level, compiled for each instruction set.
struct Pack<'a> {
    level: &'a Level,
    points: &'a Positions,
    params: &'a PyramidParams,
    packed: &'a mut [Packed],
    /// The region in which the level is complete, and a flag for points whose neighbours may lie outside.
    open: Option<(&'a Region, &'a mut [bool])>,
}

impl WithSimd for Pack<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        pack_all(simd, self);
    }
}

#[inline(always)]
fn pack_all<S: Simd>(simd: S, work: Pack<'_>) {
    let Pack { level, points, params, packed, mut open } = work;
    let mut scratch = Scratch::default();
    let convention = Convention { centre: params.centre, divisor: params.divisor };
    for first in (0..points.len()).step_by(LANES) {
        let lanes = first..(first + LANES).min(points.len());
        let source = Source { level, packed: &[], params };
        let count = fill(simd, source, Queries { points, lanes: lanes.clone() }, &mut scratch);
        if let Some((region, open)) = &mut open {
            let all = count == params.k.min(MOST - 1);
            for (l, i) in lanes.clone().enumerate() {
                let at = points.xyz(i);
                open[i] = !region.holds(at, farthest(&scratch.batch, count, l), all);
            }
        }
        let found = if count == 10 {
            tensor(&scratch.batch, 10, convention)
        } else {
            tensor(&scratch.batch, count, convention)
        };
        let variation = covariance_features(&found, false).surface_variation;
        for (l, slot) in packed[lanes].iter_mut().enumerate() {
            let part = |a: usize| (found.normal[a][l] * 32767.0).round() as i16 as u16;
            *slot = [part(0), part(1), part(2), (variation[l] * 196_605.0).round() as u16];
        }
    }
}

/// Squared distance of the last of the first `found` neighbours of a lane, which are sorted.
#[inline(always)]
pub(super) fn farthest(batch: &Batch, found: usize, lane: usize) -> f32 {
    match found.checked_sub(1) {
        Some(last) => batch.x[last][lane].powi(2) + batch.y[last][lane].powi(2) + batch.z[last][lane].powi(2),
        None => 0.0,
    }
}
