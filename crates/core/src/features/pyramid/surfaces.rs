//! The first pass over a level: normal and surface variation of its points.

use super::region::Region;
use super::sorted::PlanBox;
use super::{Queries, Scratch, SearchedLevel, fill};
use crate::cloud::Positions;
use crate::error::Result;
use crate::features::params::PyramidParams;
use crate::features::tensor::{Batch, Convention, LANES, Lane, MOST, exact_variation, tensor};
use crate::parallel::{Monitor, map_ordered};
use crate::voxels::Level;
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Level points that one task processes.
const CHUNK: usize = 4096;

/// Normal (three integers in -32767..=32767) and surface variation ([`packed_variation`]) of a level point.
pub(super) type Packed = [u16; 4];

/// The exponent of 2^-32 in the bits of an `f32`, at the place that it has in a packed number.
const LEAST: u32 = 95 << 11;

/// A number below 1 as 5 bits of exponent and 11 of mantissa: 12 digits down to 2^-31, less is 0. A fixed number of decimals
/// would lose the variation of smooth surfaces, which is a millionth where the scale is a thousand times the roughness.
#[inline(always)]
fn packed_variation(value: f32) -> u16 {
    ((value.to_bits().wrapping_add(1 << 11)) >> 12).saturating_sub(LEAST).min(0xffff) as u16
}

/// The number of [`packed_variation`].
#[inline(always)]
pub(super) fn unpacked_variation(packed: u16) -> f32 {
    let value = f32::from_bits((u32::from(packed).wrapping_add(LEAST)) << 12);
    if packed > 0 { value } else { 0.0 }
}

/// First pass: normal and surface variation of every point of the level from its k nearest on the level (itself
/// included), and which of them may differ on the complete level. Points beyond the [core](Region::core) of the region are
/// among the latter: hardly any of them is needed.
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
        let part = region.map(|region| InPart { region, core: region.core(level.size), open: &mut open });
        Arch::new().dispatch(Pack { level, points: &points, params: &params, packed: &mut packed, part });
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
    part: Option<InPart<'a>>,
}

/// What is known of a level that is complete in a region only.
struct InPart<'a> {
    region: &'a Region,
    core: PlanBox<f32>,
    /// Of each point whether its neighbours may lie outside the region.
    open: &'a mut [bool],
}

impl InPart<'_> {
    /// Whether none of some points is needed; they are open then.
    #[inline(always)]
    fn skips(&mut self, points: &Positions, lanes: &Range<usize>) -> bool {
        let is_needed = |i: usize| self.core.holds([points.x[i], points.y[i]]);
        let skips = !lanes.clone().any(is_needed);
        if skips {
            self.open[lanes.clone()].fill(true);
        }
        skips
    }
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
    let Pack { level, points, params, packed, mut part } = work;
    let mut scratch = Scratch::default();
    let convention = Convention { centre: params.centre, divisor: params.divisor };
    for first in (0..points.len()).step_by(LANES) {
        let lanes = first..(first + LANES).min(points.len());
        if part.as_mut().is_some_and(|part| part.skips(points, &lanes)) {
            continue;
        }
        let source = SearchedLevel { level, packed: &[], params };
        let count = fill(simd, source, Queries { points, lanes: lanes.clone() }, &mut scratch);
        if let Some(InPart { region, open, .. }) = &mut part {
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
        let variation = exact_variation(&scratch.batch, count, &found, &largest(points, &lanes));
        for (l, slot) in packed[lanes].iter_mut().enumerate() {
            let part = |a: usize| (found.normal[a][l] * 32767.0).round() as i16 as u16;
            *slot = [part(0), part(1), part(2), packed_variation(variation[l])];
        }
    }
}

/// The largest coordinate of each of these points, by its absolute value.
#[inline(always)]
pub(super) fn largest(points: &Positions, lanes: &Range<usize>) -> Lane {
    let mut out = [0.0; LANES];
    for (most, i) in out.iter_mut().zip(lanes.clone()) {
        *most = points.xyz(i).into_iter().fold(0.0, |most, v| v.abs().max(most));
    }
    out
}

/// Squared distance of the last of the first `found` neighbours of a lane, which are sorted.
#[inline(always)]
pub(super) fn farthest(batch: &Batch, found: usize, lane: usize) -> f32 {
    match found.checked_sub(1) {
        Some(last) => batch.x[last][lane].powi(2) + batch.y[last][lane].powi(2) + batch.z[last][lane].powi(2),
        None => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variations_of_all_sizes_keep_their_digits() {
        let mut value = 1.0f32 / 3.0;
        while value > 1e-9 {
            let back = unpacked_variation(packed_variation(value));
            assert!((back - value).abs() <= value / 4096.0, "{value} {back}");
            value *= 0.93;
        }
        assert_eq!(unpacked_variation(packed_variation(0.0)), 0.0);
        assert_eq!(unpacked_variation(packed_variation(1e-12)), 0.0);
        assert!(unpacked_variation(packed_variation(2.0)) < 1.0);
    }
}
