//! Cut pursuit on large graphs: cuts are made on a coarser graph, boundaries are moved on the full one.
//!
//! Nodes that a partition of low energy keeps together merge first. Merging by the values themselves would gather
//! nodes whose noise agrees, and such a gathering keeps its noise; by values smoothed over the graph it averages the
//! noise out. The coarse problem has the energy of the full one for every partition of coarse nodes, but for a constant.

use super::super::Signal;
use super::super::links::{EdgeLinks, contract};
use super::super::merge::{merge_further, merge_nodes};
use super::super::refine::move_boundary_nodes;
use super::super::regions::{Regions, energy, renumber};
use super::iterate::Pursuit;
use super::smooth::smoothed;
use super::{CutPursuit, CutPursuitParams};
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::Monitor;
use crate::segmentation::Partition;
use crate::segmentation::connected::connected_partition;

/// Nodes merge at this share of the strength first, then at twice as much, ...
const FIRST_SHARE: f64 = 1.0 / 128.0;
/// ... until this share is passed ...
const LAST_SHARE: f64 = 0.1;
/// ... or so many nodes have become one on the average, ...
const NODES_TO_ONE: usize = 16;
/// ... but so many coarse nodes to a segment are kept.
const NODES_A_SEGMENT: usize = 32;

/// A graph with its values. The incidence of a large graph is large and quickly made: only who needs it holds it.
struct Problem<'a> {
    signal: &'a Signal<'a>,
    graph: &'a Graph,
    params: &'a CutPursuitParams,
    monitor: &'a Monitor,
}

/// Cycles of cut pursuit, each from the result of the one before with other random numbers; on large graphs cycles of
/// coarsening, cut pursuit on the coarse graph and moves of boundary nodes on the full one. Only nodes of one segment
/// become one coarse node, so that no cycle raises Q.
pub(super) fn in_cycles(
    signal: &Signal,
    graph: &Graph,
    params: &CutPursuitParams,
    monitor: &Monitor,
) -> Result<CutPursuit> {
    let problem = Problem { signal, graph, params, monitor };
    let partition = connected_partition(graph, |_, _| true, monitor)?;
    let start = energy(signal, (graph, params.strength), &partition, monitor)?;
    let (centroids, trace) = (Vec::new(), vec![start]);
    let mut best = CutPursuit { partition, centroids, energy: start, iterations: 0, converged: false, trace };
    for cycle in 0..params.cycles {
        let params = CutPursuitParams { seed: params.seed.wrapping_add(cycle as u64), ..params.clone() };
        let small_segments = NODES_A_SEGMENT * best.partition.len() > graph.len() / 2;
        let found = if graph.len() > params.coarse_above && !small_segments {
            problem.coarse_cycle(&best.partition, &params)?
        } else {
            Pursuit::new((signal, graph), best.partition.clone(), &params, monitor)?.run()?
        };
        best.iterations += found.iterations;
        best.converged = found.converged;
        best.trace.extend(found.trace.into_iter().skip(1));
        let gained = best.energy - found.energy;
        if gained > 0.0 {
            (best.energy, best.partition) = (found.energy, found.partition);
        }
        if gained < params.tolerance * best.energy {
            break;
        }
    }
    Ok(best)
}

impl Problem<'_> {
    /// Cut pursuit on the coarse graph; the energy is that of the full one.
    fn coarse_cycle(&self, partition: &Partition, params: &CutPursuitParams) -> Result<CutPursuit> {
        let Self { signal, graph, monitor, .. } = *self;
        let mut found = self.coarse_pursuit(partition, params)?;
        found.partition = self.moved(std::mem::take(&mut found.partition))?;
        found.energy = energy(signal, (graph, params.strength), &found.partition, monitor)?;
        found.trace = vec![energy(signal, (graph, params.strength), partition, monitor)?, found.energy];
        Ok(found)
    }

    /// The same before nodes are moved; the coarse graph is gone when this returns.
    fn coarse_pursuit(&self, partition: &Partition, params: &CutPursuitParams) -> Result<CutPursuit> {
        let Self { signal, graph, monitor, .. } = *self;
        let merged = self.merged(partition)?;
        let regions = Regions::of_segments(signal, &merged, monitor)?;
        let weights: Vec<f32> = (0..merged.len() as u32).map(|region| regions.weight(region) as f32).collect();
        let means: Vec<f32> = regions.into_means().into_iter().map(|x| x as f32).collect();
        let coarse = {
            let links = contract(&EdgeLinks::weighted(graph, 1.0), merged.segments(), monitor)?;
            let (ends, costs): (Vec<_>, Vec<_>) = links.into_iter().map(|l| (l.ends, l.boundary as f32)).unzip();
            Graph::new_watched(merged.len(), &ends, &costs, monitor)?
        };
        let coarse_signal = Signal::new(&means, signal.width())?.with_weights(&weights)?;
        let whose: Vec<u32> = merged.iter().map(|nodes| partition.segments()[nodes[0] as usize]).collect();
        let start = Partition::from_labels(&whose)?;
        let mut found = Pursuit::new((&coarse_signal, &coarse), start, params, monitor)?.run()?;
        found.partition = merged.coarser(&found.partition, monitor)?;
        Ok(found)
    }

    fn moved(&self, partition: Partition) -> Result<Partition> {
        if !self.params.moves {
            return Ok(partition);
        }
        let at = (&partition, self.params.strength);
        move_boundary_nodes(self.signal, (self.graph, &self.graph.incidence(self.monitor)?), at, self.monitor)
    }

    /// The nodes of the coarse graph: nodes of one segment that merge when their values are smoothed.
    fn merged(&self, partition: &Partition) -> Result<Partition> {
        let values = smoothed(self.signal, self.graph, partition, self.monitor)?;
        let regions = Regions::of_nodes(&self.signal.with_values(&values), self.monitor)?;
        drop(values);
        let nodes = self.graph.len();
        let enough = (nodes / NODES_TO_ONE).max(NODES_A_SEGMENT * partition.len());
        let mut share = FIRST_SHARE * nodes as f64 / (NODES_TO_ONE * enough) as f64;
        let links = EdgeLinks::weighted(self.graph, share * self.params.strength).inside(partition.segments());
        let mut merger = merge_nodes(regions, links, 0, self.monitor)?;
        let mut labels = merger.became;
        loop {
            share *= 2.0;
            if share > LAST_SHARE || merger.regions.len() <= enough {
                return Partition::from_labels_watched(&labels, self.monitor);
            }
            merger.links.iter_mut().for_each(|link| link.boundary *= 2.0);
            merger = merge_further(merger.regions, merger.links, 0, self.monitor)?;
            renumber(&mut labels, &merger.became, self.monitor)?;
        }
    }
}
