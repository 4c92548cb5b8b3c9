//! Cut pursuit on large graphs: minimum cuts on a coarser graph, then moves of boundary nodes on the full one.
//!
//! The coarse graph merges nodes that a partition of low energy would keep together anyway. Merging by the values
//! themselves would group nodes with similar noise, and the mean of such a group keeps that noise; merging by values
//! that were smoothed over the graph averages it out. For every partition of coarse nodes the coarse problem has the
//! energy of the full problem, up to a constant.

use super::super::Signal;
use super::super::links::{EdgeLinks, contract};
use super::super::merge::{merge_further, merge_nodes};
use super::super::refine::move_boundary_nodes;
use super::super::regions::{Objective, Regions, energy, renumber};
use super::iterate::Pursuit;
use super::smooth::smoothed;
use super::{CutPursuit, CutPursuitParams};
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::Monitor;
use crate::segmentation::Partition;
use crate::segmentation::connected::connected_partition;

/// Largest share of the strength at which nodes merge in the first pass of coarsening; it doubles with each pass.
const FIRST_SHARE: f64 = 1.0 / 128.0;
/// Coarsening ends once this share of the strength is passed.
const LAST_SHARE: f64 = 0.1;
/// Coarsening ends at this many nodes in a coarse node, on average.
const NODES_TO_ONE: usize = 16;
/// Least number of coarse nodes in a segment, on average.
const NODES_A_SEGMENT: usize = 32;

/// A partition problem. The incidence lists of a large graph take much memory and are quick to build: each step that
/// needs them builds its own.
struct CoarseToFine<'a> {
    signal: &'a Signal<'a>,
    graph: &'a Graph,
    params: &'a CutPursuitParams,
    monitor: &'a Monitor,
}

/// Runs cycles of cut pursuit, each starting from the result of the one before with another seed. On large graphs a
/// cycle is: coarsen, run cut pursuit on the coarse graph, move boundary nodes on the full one. Only nodes of one
/// segment become one coarse node, so that no cycle raises Q.
pub(super) fn in_cycles(
    signal: &Signal,
    graph: &Graph,
    params: &CutPursuitParams,
    monitor: &Monitor,
) -> Result<CutPursuit> {
    let problem = CoarseToFine { signal, graph, params, monitor };
    let partition = connected_partition(graph, |_, _| true, monitor)?;
    let start = energy(problem.objective(), &partition, monitor)?;
    let (centroids, trace) = (Vec::new(), vec![start]);
    let mut best = CutPursuit { partition, centroids, energy: start, iterations: 0, converged: false, trace };
    for cycle in 0..params.steps.cycles {
        let params = CutPursuitParams { seed: params.seed.wrapping_add(cycle as u64), ..params.clone() };
        let small_segments = NODES_A_SEGMENT * best.partition.len() > graph.len() / 2;
        let found = if params.steps.coarse_above.is_some_and(|most| graph.len() > most) && !small_segments {
            problem.coarse_cycle(&best.partition, &params)?
        } else {
            Pursuit::new(problem.objective(), best.partition.clone(), &params, monitor)?.run()?
        };
        best.iterations += found.iterations;
        best.converged = found.converged;
        best.trace.extend(found.trace.into_iter().skip(1));
        let gained = best.energy - found.energy;
        if gained > 0.0 {
            (best.energy, best.partition) = (found.energy, found.partition);
        }
        if gained < params.steps.tolerance * best.energy {
            break;
        }
    }
    Ok(best)
}

impl CoarseToFine<'_> {
    /// Q on the full graph.
    fn objective(&self) -> Objective<'_> {
        Objective { signal: self.signal, graph: self.graph, strength: self.params.strength }
    }

    /// One cycle on the coarse graph; the energies are those of the full graph.
    fn coarse_cycle(&self, partition: &Partition, params: &CutPursuitParams) -> Result<CutPursuit> {
        let (objective, monitor) = (self.objective(), self.monitor);
        let mut found = self.coarse_pursuit(partition, params)?;
        found.partition = self.moved(std::mem::take(&mut found.partition))?;
        found.energy = energy(objective, &found.partition, monitor)?;
        found.trace = vec![energy(objective, partition, monitor)?, found.energy];
        Ok(found)
    }

    /// The coarse part of the cycle, without the moves; frees the coarse graph before it returns.
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
        let objective = Objective { signal: &coarse_signal, graph: &coarse, strength: params.strength };
        let mut found = Pursuit::new(objective, start, params, monitor)?.run()?;
        found.partition = merged.coarser(&found.partition, monitor)?;
        Ok(found)
    }

    fn moved(&self, partition: Partition) -> Result<Partition> {
        if !self.params.steps.moves {
            return Ok(partition);
        }
        let incidence = self.graph.incidence(self.monitor)?;
        move_boundary_nodes(self.objective(), &incidence, &partition, self.monitor)
    }

    /// The nodes of the coarse graph: nodes of one segment that merge by their smoothed values.
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
