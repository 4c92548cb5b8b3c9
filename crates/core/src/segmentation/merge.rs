//! Greedy merging of regions that touch: a segmentation of its own, and the backward step of cut pursuit.
//!
//! Two regions s, t that share a boundary of cost B_st are better merged if
//! gain = B_st − M_s M_t / (M_s + M_t) ‖x_s − x_t‖² > 0 (Landrieu, Obozinski, *Cut pursuit: fast algorithms to learn
//! piecewise constant functions on general weighted graphs*, SIAM J. Imaging Sciences 10(4), 2017, section 3).

mod batch;
mod greedy;

use super::connected::{Sets, connected_partition};
use super::cutoff::absorb_small;
use super::regions::{Link, Regions, compact, contract, energy, node_links};
use super::{Partition, Signal};
use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Up to so many links the pair of largest gain is merged first; above, all that are each other's best at once.
const GREEDY_LINKS: usize = 100_000;

/// Parameters of [`merge`].
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct MergeParams {
    /// ρ: what a boundary edge of weight 1 costs, in units of squared feature difference. Larger: fewer, larger
    /// segments. ≥ 0; infinite gives one segment per connected piece.
    pub strength: f64,
    /// Segments of less weight than this join their best neighbour, whatever it costs. ≥ 0; 0 keeps all.
    pub cutoff: f64,
}

impl Default for MergeParams {
    fn default() -> Self {
        Self { strength: 0.1, cutoff: 0.0 }
    }
}

impl MergeParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] if the strength or the cutoff is negative or not a number.
    pub fn validate(&self) -> Result<()> {
        check_not_negative("strength", self.strength)?;
        check_not_negative("cutoff", self.cutoff)
    }
}

pub(super) fn check_not_negative(name: &'static str, value: f64) -> Result<()> {
    if value >= 0.0 { Ok(()) } else { Err(Error::parameter(name, value, "0 or more")) }
}

/// Result of [`merge`].
#[derive(Clone, Debug, PartialEq)]
pub struct Merge {
    /// The segments.
    pub partition: Partition,
    /// Mean of each segment, `width` values each.
    pub centroids: Vec<f64>,
    /// Q of the partition, before the cutoff took part: fit + strength · boundary.
    pub energy: f64,
}

/// Merges single nodes into segments as long as Q = Σ m_i ‖f_i − x_c(i)‖² + ρ Σ w_ij [c(i) ≠ c(j)] falls.
///
/// With at most 100,000 edges the pair of largest gain merges first; with more, every region's best partner is found
/// at once, and these pairs merge in the order of gain, each checked again with the means of that moment. Q never
/// rises in either way.
///
/// # Returns
/// Segments that hang together in the graph, their means, and Q.
///
/// # Complexity
/// O(m log m) time for bounded degree, O(n · width + m) memory.
///
/// # Determinism
/// No randomness, one thread; equal gains merge in the order of their smallest nodes.
///
/// # Errors
/// If the signal has not a row for each node, a parameter is out of range, or the work was cancelled.
pub fn merge(signal: &Signal, graph: &Graph, params: &MergeParams, monitor: &Monitor) -> Result<Merge> {
    params.validate()?;
    signal.fits(graph.len())?;
    let partition = if params.strength.is_infinite() {
        connected_partition(graph, |e, _| graph.weights()[e] > 0.0)?
    } else {
        let links = node_links(graph, params.strength);
        Partition::from_labels(&merge_regions(Regions::of_nodes(signal), links, monitor)?)?
    };
    let energy = energy(signal, graph, params.strength, &partition);
    let partition = absorb_small(signal, graph, &partition, (params.strength, params.cutoff))?;
    let centroids = Regions::of_segments(signal, &partition).into_means();
    Ok(Merge { partition, centroids, energy })
}

/// Merges regions while a merger gains; returns for each region the number of the one it became part of.
pub(super) fn merge_regions(mut regions: Regions, mut links: Vec<Link>, monitor: &Monitor) -> Result<Vec<u32>> {
    let mut became: Vec<u32> = (0..regions.len() as u32).collect();
    let mut together = |regions: &mut Regions, links: &mut Vec<Link>, sets: Sets| {
        let (number, left) = compact(regions, sets);
        became.iter_mut().for_each(|region| *region = number[*region as usize]);
        *links = contract(links, &number);
        *regions = left;
    };
    while links.len() > GREEDY_LINKS {
        monitor.check()?;
        let Some(sets) = batch::merge_best_pairs(&mut regions, &links) else { break };
        together(&mut regions, &mut links, sets);
    }
    if links.len() <= GREEDY_LINKS {
        let sets = greedy::merge_largest_gain_first(&mut regions, &links, monitor)?;
        together(&mut regions, &mut links, sets);
    }
    Ok(became)
}
