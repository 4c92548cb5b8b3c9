//! Splits one segment in two: 2-means, then minimum cuts that alternate with updates of the two means.

use super::params::CutPursuitParams;
use super::piece::Piece;
use super::two_means::{Means, means_of_sides, starts, two_means};
use crate::error::Result;
use crate::graph::MaxFlow;
use crate::parallel::{Looks, Monitor, map_ordered_with};
use crate::random::Stream;
use std::ops::Range;

/// Buffers of a split, reused from segment to segment.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) piece: Piece,
    network: MaxFlow,
}

/// Sizes of segments whose attempts run in parallel with each other. Smaller segments are numerous enough to run in
/// parallel as segments, and in larger ones several flow networks at once would need too much memory.
const SHARED: Range<usize> = 4096..1 << 18;

impl Scratch {
    /// The parts into which the segment splits, given for each node as the smallest node of its part; `None` if it
    /// stays whole. Of several attempts the one of least energy is returned. O(attempts · (means + flow_steps · cut)).
    pub(super) fn split(
        &mut self,
        params: &CutPursuitParams,
        random: &mut Stream,
        monitor: &Monitor,
    ) -> Result<Option<Vec<u32>>> {
        let Self { piece, network } = self;
        // The first attempt takes the best of several random starts, the others one each: the best start often leads to
        // the same cut again.
        let restarts = |attempt| if attempt == 0 { params.steps.restarts } else { 1 };
        let starts =
            (0..params.steps.attempts).map(|attempt| starts(piece, restarts(attempt), random, monitor).transpose());
        let Some(starts) = starts.collect::<Option<Result<Vec<_>>>>().transpose()? else { return Ok(None) };
        let cuts = Cuts { piece, steps: params.steps.flow_steps, monitor };
        let attempt = |network: &mut MaxFlow, i: usize| {
            let sides = two_means(piece, &starts[i], params.steps.means_steps, monitor)?;
            let parts = cuts.parts(sides, network)?;
            parts.map(|parts| Ok((piece.energy(&parts, monitor)?, parts))).transpose()
        };
        let attempts = match SHARED.contains(&piece.len()) {
            true => map_ordered_with(0..starts.len(), monitor, MaxFlow::default, attempt)?,
            false => (0..starts.len()).map(|i| attempt(network, i)).collect::<Result<Vec<_>>>()?,
        };
        let mut best = None;
        let mut least = f64::INFINITY;
        if params.steps.guard {
            least = piece.energy(&vec![0; piece.len()], monitor)?;
        }
        for (energy, parts) in attempts.into_iter().flatten() {
            if energy < least {
                (least, best) = (energy, Some(parts));
            }
        }
        Ok(best)
    }
}

/// Minimum cuts of a segment, each with the means of the cut before.
struct Cuts<'a> {
    piece: &'a Piece,
    /// Largest number of cuts.
    steps: usize,
    monitor: &'a Monitor,
}

impl Cuts<'_> {
    /// The connected parts of the two sides after the cuts; `None` if one side is empty.
    fn parts(&self, mut sides: Vec<bool>, network: &mut MaxFlow) -> Result<Option<Vec<u32>>> {
        let Self { piece, steps, monitor } = *self;
        for _ in 0..steps {
            let Some(means) = means_of_sides(piece, &sides, monitor)? else { return Ok(None) };
            let next = cheapest_sides(network, piece, &means, monitor)?;
            let settled = next == sides;
            sides = next;
            if settled {
                break;
            }
        }
        let parted = sides.iter().any(|s| *s != sides[0]);
        parted.then(|| piece.parts(&sides, monitor)).transpose()
    }
}

/// The two sides of least energy (fit and boundary) for fixed means; true for the second side.
fn cheapest_sides(network: &mut MaxFlow, piece: &Piece, means: &Means, monitor: &Monitor) -> Result<Vec<bool>> {
    let mut looks = Looks::at(monitor);
    network.reset(piece.len());
    for (node, preference) in preferences(piece, means).enumerate() {
        looks.step()?;
        network.add_terminals(node, preference.max(0.0), (-preference).max(0.0))?;
    }
    for (&[a, b], &cost) in piece.edges.iter().zip(&piece.costs) {
        looks.step()?;
        network.add_edge(a as usize, b as usize, cost, cost)?;
    }
    network.solve_watched(monitor)?;
    Ok((0..piece.len()).map(|node| !network.is_source(node)).collect())
}

/// Difference of the fit costs, m (‖f − x_1‖² − ‖f − x_0‖²), of each node; linear in f.
fn preferences<'a>(piece: &'a Piece, [zero, one]: &Means) -> impl Iterator<Item = f64> + use<'a> {
    let slope: Vec<f64> = zero.iter().zip(one).map(|(a, b)| a - b).collect();
    let middle: Vec<f64> = zero.iter().zip(one).map(|(a, b)| (a + b) / 2.0).collect();
    piece.rows().map(move |(row, weight)| {
        let product: f64 = row.iter().zip(&slope).zip(&middle).map(|((&f, s), m)| s * (f64::from(f) - m)).sum();
        2.0 * weight * product
    })
}
