//! The adjacency graph of segments, weighted by their common boundary.

use super::Partition;
use super::minimal_partition::{Cost, EdgeLinks, contract};
use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// The weight of an edge between two segments.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interface {
    /// The number of graph edges between them (w of Guinard & Landrieu 2017, section 3.2).
    #[default]
    Count,
    /// The sum of the weights of these edges.
    Weight,
}

/// The graph whose nodes are the segments and whose edges connect adjacent segments. O(m log m).
///
/// # Errors
/// If the partition is not one of the graph's nodes, or the work was cancelled.
pub fn segment_graph(graph: &Graph, partition: &Partition, interface: Interface, monitor: &Monitor) -> Result<Graph> {
    if graph.len() != partition.nodes() {
        return Err(Error::input(format!("a partition of {} nodes for a graph of {}", partition.nodes(), graph.len())));
    }
    let cost = match interface {
        Interface::Count => Cost::Each(1.0),
        Interface::Weight => Cost::Weight(1.0),
    };
    let links = EdgeLinks::new(graph, cost);
    let (ends, weights): (Vec<_>, Vec<_>) =
        contract(&links, partition.segments(), monitor)?.iter().map(|l| (l.ends, l.boundary as f32)).unzip();
    Graph::new_watched(partition.len(), &ends, &weights, monitor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn interfaces_add_up_to_the_edges_between_segments() {
        for seed in 0..20 {
            let mut random = stream(seed, 0);
            let all = (0..30u32).flat_map(|b| (0..b).map(move |a| [a, b]));
            let pairs: Vec<[u32; 2]> = all.filter(|_| random.below(4) == 0).collect();
            let weights: Vec<f32> = pairs.iter().map(|_| random.below(8) as f32).collect();
            let graph = Graph::new(30, &pairs, &weights).unwrap();
            let labels: Vec<u32> = (0..30).map(|_| random.below(6) as u32).collect();
            let partition = Partition::from_labels(&labels).unwrap();
            let between = |s: u32, t: u32| {
                let joins = move |e: &[u32; 2]| {
                    let ends = e.map(|v| partition.segments()[v as usize]);
                    ends == [s, t] || ends == [t, s]
                };
                graph.edges().iter().zip(graph.weights()).filter(move |(e, _)| joins(e))
            };
            let partition = Partition::from_labels(&labels).unwrap();
            let counted = segment_graph(&graph, &partition, Interface::Count, &Monitor::default()).unwrap();
            let weighed = segment_graph(&graph, &partition, Interface::Weight, &Monitor::default()).unwrap();
            let cut = graph.edges().iter().filter(|e| labels[e[0] as usize] != labels[e[1] as usize]).count();
            assert_eq!(counted.weights().iter().sum::<f32>(), cut as f32);
            assert_eq!((counted.len(), counted.edges()), (partition.len(), weighed.edges()));
            for (i, &[s, t]) in counted.edges().iter().enumerate() {
                assert_eq!(counted.weights()[i], between.clone()(s, t).count() as f32);
                assert_eq!(weighed.weights()[i], between.clone()(s, t).map(|(_, w)| *w).sum::<f32>());
            }
        }
    }

    #[test]
    fn a_partition_of_other_nodes_is_refused() {
        let graph = Graph::new(3, &[[0, 1]], &[1.0]).unwrap();
        let partition = Partition::from_labels(&[0, 1]).unwrap();
        assert!(segment_graph(&graph, &partition, Interface::Count, &Monitor::default()).is_err());
    }
}
