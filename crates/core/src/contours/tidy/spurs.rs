//! Pruning of short branches and of branches along other lines.

use super::super::polylines::{Strand, strands};
use super::TidyParams;
use crate::cloud::Positions;
use crate::error::Result;
use crate::graph::Graph;
use crate::neighbours::{Within, within};
use crate::parallel::Monitor;

/// Rounds after which pruning stops; each round joins lines at junctions that are gone.
const ROUNDS: usize = 20;

/// The graph without branches that have a free end at one side, a junction at the other, and are shorter than `spur`
/// or, if loops are opened, have all their nodes within the loop width of other nodes. O(rounds · m log m).
pub(super) fn pruned(mut graph: Graph, positions: &Positions, params: &TidyParams, monitor: &Monitor) -> Result<Graph> {
    if params.spur <= 0.0 {
        return Ok(graph);
    }
    let mut nodes: Vec<u32> = graph.edges().iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let places = positions.select(&nodes, monitor)?;
    let near = within(&places, &places, params.loop_width, monitor)?;
    for _ in 0..ROUNDS {
        let mut round = Round { degree: vec![0; graph.len()], nodes: &nodes, near: &near };
        graph.edges().iter().flatten().for_each(|&node| round.degree[node as usize] += 1);
        let mut spurs: Vec<(f64, Strand)> =
            strands(&graph, positions, monitor)?.into_iter().map(|s| (s.length(positions), s)).collect();
        spurs.retain(|(length, spur)| *length <= params.spur.max(params.loop_length) && round.hangs(spur));
        spurs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut gone: Vec<[u32; 2]> = Vec::new();
        for (length, spur) in &spurs {
            if round.hangs(spur) && (*length < params.spur || (params.loop_width > 0.0 && round.follows(spur))) {
                for w in spur.path.windows(2) {
                    gone.push([w[0].min(w[1]), w[0].max(w[1])]);
                    w.iter().for_each(|&node| round.degree[node as usize] -= 1);
                }
            }
        }
        if gone.is_empty() {
            break;
        }
        gone.sort_unstable();
        graph.retain(|edge| gone.binary_search(&edge).is_err());
    }
    Ok(graph)
}

struct Round<'a> {
    /// Number of edges at each node of the graph.
    degree: Vec<u32>,
    /// The nodes that had edges at first, ascending, and those near each of them.
    nodes: &'a [u32],
    near: &'a Within,
}

impl Round<'_> {
    /// Whether one end is free and the other a junction.
    fn hangs(&self, strand: &Strand) -> bool {
        let [Some(&a), Some(&b)] = [strand.path.first(), strand.path.last()] else { return false };
        let [a, b] = [a, b].map(|node| self.degree[node as usize]);
        a != b && a.min(b) == 1 && a.max(b) > 2
    }

    /// Whether every node of a spur is near one with edges that is not on the spur.
    fn follows(&self, spur: &Strand) -> bool {
        let mut own = spur.path.clone();
        own.sort_unstable();
        let beside = |node: &u32| {
            let Ok(at) = self.nodes.binary_search(node) else { return false };
            let mut others = self.near.of(at).iter().map(|&other| self.nodes[other as usize]);
            others.any(|other| self.degree[other as usize] > 0 && own.binary_search(&other).is_err())
        };
        spur.path.iter().all(beside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line of 21 nodes along x, a branch up from its middle and one that runs beside it.
    fn scene(branch: u32) -> (Graph, Positions) {
        let mut rows: Vec<[f32; 3]> = (0..21).map(|i| [i as f32 * 0.05, 0.0, 0.0]).collect();
        rows.extend((1..=branch).map(|i| [0.5, i as f32 * 0.05, 0.0]));
        rows.extend((1..=10).map(|i| [0.25 + i as f32 * 0.05, 0.0, 0.04]));
        let mut edges: Vec<[u32; 2]> = (0..20).map(|i| [i, i + 1]).collect();
        edges.extend((0..branch).map(|i| [if i == 0 { 10 } else { 20 + i }, 21 + i]));
        let beside = 21 + branch;
        edges.extend((0..10).map(|i| [if i == 0 { 5 } else { beside + i - 1 }, beside + i]));
        (Graph::new(rows.len(), &edges, &vec![1.0; edges.len()]).unwrap(), Positions::from_rows(&rows))
    }

    #[test]
    fn short_branches_and_those_beside_a_line_go() {
        let left = |branch: u32, params: &TidyParams| {
            let (graph, positions) = scene(branch);
            pruned(graph, &positions, params, &Monitor::default()).unwrap().edges().len()
        };
        let params = TidyParams::default();
        assert_eq!(left(3, &params), 20);
        assert_eq!(left(8, &params), 28);
        assert_eq!(left(3, &TidyParams { spur: 0.0, ..params.clone() }), 33);
        assert_eq!(left(3, &TidyParams { loop_width: 0.0, ..params }), 30);
    }

    #[test]
    fn lines_without_a_junction_and_rings_stay() {
        let positions: Positions = (0..5).map(|i| [i as f32 * 0.01, (i % 2) as f32 * 0.01, 0.0]).collect();
        let graph = Graph::new(5, &[[0, 1], [2, 3], [3, 4], [2, 4]], &[1.0; 4]).unwrap();
        let found = pruned(graph.clone(), &positions, &TidyParams::default(), &Monitor::default()).unwrap();
        assert_eq!(found, graph);
    }
}
