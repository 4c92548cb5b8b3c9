//! Cut pursuit on a coarser graph: nodes that any partition of interest keeps together are merged first.

use super::super::merge::merge_regions;
use super::super::regions::{Regions, contract, node_links};
use super::super::{Partition, Signal};
use super::iterate::Pursuit;
use super::{CutPursuitParams, Start};
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::Monitor;

/// Share of the strength at which nodes merge into those of the coarse graph.
const SHARE: f64 = 0.1;

/// The partition that cut pursuit finds when nodes have merged at a tenth of the strength. The coarse problem has the
/// same energy for every partition of coarse nodes, but for a constant.
pub(super) fn coarse_partition(
    signal: &Signal,
    graph: &Graph,
    params: &CutPursuitParams,
    monitor: &Monitor,
) -> Result<Partition> {
    let links = node_links(graph, SHARE * params.strength);
    let merged = Partition::from_labels(&merge_regions(Regions::of_nodes(signal), links, monitor)?)?;
    let regions = Regions::of_segments(signal, &merged);
    let weights: Vec<f32> = (0..merged.len() as u32).map(|region| regions.weight(region) as f32).collect();
    let means: Vec<f32> = regions.into_means().into_iter().map(|x| x as f32).collect();
    let (ends, costs): (Vec<_>, Vec<_>) =
        contract(&node_links(graph, 1.0), merged.segments()).iter().map(|l| (l.ends, l.boundary as f32)).unzip();
    let graph = Graph::new(merged.len(), &ends, &costs)?;
    let signal = Signal::new(&means, signal.width())?.with_weights(&weights)?;
    let params = CutPursuitParams { start: Start::Pieces, ..params.clone() };
    let found = Pursuit::new(&signal, &graph, &params, monitor)?.run()?.partition;
    let labels: Vec<u32> = merged.segments().iter().map(|&s| found.segments()[s as usize]).collect();
    Partition::from_labels(&labels)
}
