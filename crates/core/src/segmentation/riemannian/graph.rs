//! The Riemannian graph: a minimum spanning tree by d_proj, and the nearest neighbours of each node.
//!
//! Li 2018, section 3.2. By "Kruskal coordinates" the paper means the spanning tree of J. B. Kruskal 1956, not his
//! multidimensional scaling of 1964: it sorts edges and adds them until all nodes are connected.

use super::arc::projected_distance;
use super::describe::Nodes;
use super::euclidean_tree::euclidean_tree;
use super::params::{Nearest, RiemannianGraphParams};
use crate::cloud::Positions;
use crate::error::Result;
use crate::graph::{Graph, minimum_spanning_tree};
use crate::neighbours::{Neighbours, knn};
use crate::parallel::{Looks, Monitor, concat_watched, map_ordered, sort_watched, sort_watched_by, watched};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Edges whose lengths one task computes.
const BLOCK: usize = 8192;

/// The graph of the supervoxels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RiemannianGraph {
    /// Edges with their weights in the optimisation.
    pub(super) graph: Graph,
    /// Number of candidate edges.
    pub(super) candidates: usize,
}

/// The candidate edges are the Euclidean nearest neighbours and the Euclidean minimum spanning tree; the graph keeps
/// the minimum spanning tree by d_proj and the nearest neighbours of each node. O(V log² V).
pub(super) fn riemannian_graph(
    nodes: &Nodes,
    params: &RiemannianGraphParams,
    monitor: &Monitor,
) -> Result<RiemannianGraph> {
    let centres = Positions::from_rows(&nodes.centres);
    let near = knn(&centres, params.candidates, monitor)?;
    let pairs = candidates(&near, euclidean_tree(&centres, &near, monitor)?, monitor)?;
    let lengths = map_ordered(pairs.len().div_ceil(BLOCK), monitor, |block| {
        let pairs = &pairs[block * BLOCK..((block + 1) * BLOCK).min(pairs.len())];
        let length = |&[a, b]: &[u32; 2]| projected_distance(nodes.tangent(a), nodes.tangent(b), params) as f32;
        Ok(pairs.iter().map(length).collect::<Vec<_>>())
    })?;
    let lengths: Vec<f32> = concat_watched(lengths, monitor)?;
    let candidates = Graph::new_watched(nodes.centres.len(), &pairs, &lengths, monitor)?;
    let graph = weighted(thinned(&candidates, params, monitor)?, params)?;
    Ok(RiemannianGraph { graph, candidates: pairs.len() })
}

/// Neighbours and tree as pairs, each once, ascending.
fn candidates(near: &Neighbours, tree: Vec<[u32; 2]>, monitor: &Monitor) -> Result<Vec<[u32; 2]>> {
    let row = |i: usize| near.of(i).iter().map(move |&j| [j.min(i as u32), j.max(i as u32)]);
    let mut pairs: Vec<[u32; 2]> = Vec::with_capacity(near.len() * near.k() + tree.len());
    for piece in watched(near.len(), monitor) {
        pairs.extend(piece?.flat_map(row));
    }
    pairs.extend(tree);
    sort_watched(&mut pairs, monitor)?;
    pairs.dedup();
    Ok(pairs)
}

/// The minimum spanning tree of the candidates and the nearest neighbours of each node; the weights are still lengths.
fn thinned(candidates: &Graph, params: &RiemannianGraphParams, monitor: &Monitor) -> Result<Graph> {
    let mut kept = vec![false; candidates.edges().len()];
    let tree = minimum_spanning_tree(candidates, monitor)?;
    tree.iter().for_each(|&e| kept[e as usize] = true);
    if params.nearest_by == Nearest::Distance {
        keep_nearest(candidates, params.nearest, &mut kept, monitor)?;
    }
    let (mut pairs, mut lengths) = (Vec::new(), Vec::new());
    for piece in watched(kept.len(), monitor) {
        for e in piece?.filter(|&e| kept[e]) {
            pairs.push(candidates.edges()[e]);
            lengths.push(candidates.weights()[e]);
        }
    }
    if params.nearest_by == Nearest::TreePath {
        let tree = Graph::new_watched(candidates.len(), &pairs, &lengths, monitor)?;
        // Adjacent nodes of the tree are already connected: their path is that edge.
        let mut looks = Looks::at(monitor);
        for (pair, length) in nearest_on_tree(&tree, params.nearest, monitor)? {
            looks.step()?;
            if tree.edges().binary_search(&pair).is_err() {
                pairs.push(pair);
                lengths.push(length);
            }
        }
    }
    Graph::new_watched(candidates.len(), &pairs, &lengths, monitor)
}

/// Marks the `count` shortest edges at each node, ties by edge index.
fn keep_nearest(graph: &Graph, count: usize, kept: &mut [bool], monitor: &Monitor) -> Result<()> {
    let adjacency = graph.adjacency_watched(monitor)?;
    let mut row: Vec<(u32, u32)> = Vec::new();
    let mut looks = Looks::at(monitor);
    for node in 0..graph.len() {
        looks.step()?;
        row.clear();
        row.extend(adjacency.of(node).map(|(_, e)| (graph.weights()[e as usize].to_bits(), e)));
        row.sort_unstable();
        row.iter().take(count).for_each(|&(_, e)| kept[e as usize] = true);
    }
    Ok(())
}

/// Each node paired with the `count` nodes nearest along a tree, each pair once, with the lengths of the paths.
fn nearest_on_tree(tree: &Graph, count: usize, monitor: &Monitor) -> Result<Vec<([u32; 2], f32)>> {
    let adjacency = tree.adjacency_watched(monitor)?;
    let rows = map_ordered(tree.len(), monitor, |node| {
        // (bits of the length, which sort like the non-negative values; node; previous node on the path)
        let mut heap = BinaryHeap::from([Reverse((0u32, node as u32, node as u32))]);
        let mut found = Vec::with_capacity(count);
        while let Some(Reverse((bits, at, from))) = heap.pop() {
            if at != from {
                found.push(([(node as u32).min(at), (node as u32).max(at)], f32::from_bits(bits)));
            }
            if found.len() == count {
                break;
            }
            for (next, e) in adjacency.of(at as usize).filter(|&(next, _)| next != from) {
                let length = f32::from_bits(bits) + tree.weights()[e as usize];
                heap.push(Reverse(((length + 0.0).to_bits(), next, at)));
            }
        }
        Ok(found)
    })?;
    let mut pairs = concat_watched(rows, monitor)?;
    // From both ends a path has the same length but for rounding.
    sort_watched_by(&mut pairs, |a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)), monitor)?;
    pairs.dedup_by_key(|(pair, _)| *pair);
    Ok(pairs)
}

/// Replaces the lengths by the edge weights of the optimisation.
fn weighted(graph: Graph, params: &RiemannianGraphParams) -> Result<Graph> {
    let lengths = graph.weights();
    let mean = lengths.iter().map(|&d| f64::from(d)).sum::<f64>() / lengths.len().max(1) as f64;
    let weights = lengths.iter().map(|&d| params.edge_weight.of(f64::from(d), mean) as f32).collect();
    graph.with_weights(weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::{EdgeWeight, connected_components};
    use crate::random::stream;
    use crate::segmentation::Sides;

    fn nodes(count: usize, bent: bool) -> Nodes {
        let mut random = stream(5, 2);
        let mut nodes = Nodes::default();
        for _ in 0..count {
            let [a, b, c] = [0; 3].map(|_| random.uniform() as f32);
            nodes.centres.push([3.0 * a, 3.0 * b, if bent { c } else { 0.0 }]);
            let normal = if bent { [a - 0.5, b - 0.5, c] } else { [0.0, 0.0, 1.0] };
            let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
            nodes.normals.push(normal.map(|v| v / length));
        }
        nodes
    }

    fn length(nodes: &Nodes, [a, b]: [u32; 2], params: &RiemannianGraphParams) -> f32 {
        projected_distance(nodes.tangent(a), nodes.tangent(b), params) as f32
    }

    /// Total length of the spanning tree of given pairs by Prim's algorithm.
    fn prim(count: usize, pairs: &[[u32; 2]], length: impl Fn([u32; 2]) -> f32) -> f64 {
        let mut inside = vec![false; count];
        inside[0] = true;
        let mut total = 0.0;
        for _ in 1..count {
            let crossing = pairs.iter().filter(|[a, b]| inside[*a as usize] != inside[*b as usize]);
            let least = crossing.min_by(|x, y| length(**x).total_cmp(&length(**y))).unwrap();
            total += f64::from(length(*least));
            least.iter().for_each(|&i| inside[i as usize] = true);
        }
        total
    }

    #[test]
    fn the_tree_spans_all_and_weighs_as_much_as_that_of_prim() {
        let (nodes, params) = (nodes(150, true), RiemannianGraphParams { nearest: 0, ..Default::default() });
        let all: Vec<[u32; 2]> = (0..150).flat_map(|b| (0..b).map(move |a| [a, b])).collect();
        let everything = RiemannianGraphParams { candidates: 149, ..params.clone() };
        let found = riemannian_graph(&nodes, &everything, &Monitor::default()).unwrap();
        assert_eq!((found.graph.edges().len(), found.candidates), (149, all.len()));
        assert_eq!(connected_components(&found.graph, &Monitor::default()).unwrap().count, 1);
        let total: f64 = found.graph.edges().iter().map(|&e| f64::from(length(&nodes, e, &params))).sum();
        assert!((total - prim(150, &all, |e| length(&nodes, e, &params))).abs() < 1e-9);
    }

    #[test]
    fn on_a_plane_the_tree_is_the_euclidean_one() {
        let (nodes, params) = (nodes(200, false), RiemannianGraphParams { nearest: 0, ..Default::default() });
        let found = riemannian_graph(&nodes, &params, &Monitor::default()).unwrap();
        let centres = Positions::from_rows(&nodes.centres);
        let tree = euclidean_tree(&centres, &Neighbours::default(), &Monitor::default()).unwrap();
        assert_eq!(found.graph.edges(), tree);
    }

    #[test]
    fn every_node_keeps_its_nearest_candidates_and_all_hang_together() {
        let nodes = nodes(300, true);
        for nearest_by in [Nearest::Distance, Nearest::TreePath] {
            let params = RiemannianGraphParams { nearest_by, ..Default::default() };
            let graph = riemannian_graph(&nodes, &params, &Monitor::default()).unwrap().graph;
            assert_eq!(connected_components(&graph, &Monitor::default()).unwrap().count, 1);
            assert!(graph.weights().iter().all(|w| *w == 1.0));
            let adjacency = graph.adjacency();
            assert!((0..300).all(|i| adjacency.of(i).count() >= 8));
        }
        let params = RiemannianGraphParams::default();
        let centres = Positions::from_rows(&nodes.centres);
        let near = knn(&centres, 16, &Monitor::default()).unwrap();
        let pairs = candidates(&near, vec![], &Monitor::default()).unwrap();
        let graph = riemannian_graph(&nodes, &params, &Monitor::default()).unwrap().graph;
        for i in 0..300u32 {
            let mut own: Vec<(f32, [u32; 2])> =
                pairs.iter().filter(|p| p.contains(&i)).map(|&p| (length(&nodes, p, &params), p)).collect();
            own.sort_by(|a, b| a.0.total_cmp(&b.0));
            assert!(own[..8].iter().all(|(_, p)| graph.edges().binary_search(p).is_ok()), "node {i}");
        }
    }

    #[test]
    fn without_sides_the_graph_does_not_depend_on_the_signs_of_normals() {
        let params = RiemannianGraphParams {
            thin_wall: true,
            edge_weight: EdgeWeight::Inverse { offset: 1.0 },
            ..Default::default()
        };
        let graph = |sides, flipped: bool| {
            let mut nodes = Nodes { sides, ..nodes(300, true) };
            nodes.normals.iter_mut().step_by(2).filter(|_| flipped).for_each(|n| *n = n.map(|c| -c));
            riemannian_graph(&nodes, &params, &Monitor::default()).unwrap().graph
        };
        assert_eq!(graph(Sides::Unsigned, false), graph(Sides::Unsigned, true));
        assert_ne!(graph(Sides::Signed, false), graph(Sides::Signed, true));
    }

    #[test]
    fn paths_along_a_tree_are_summed() {
        let tree = Graph::new(5, &[[0, 1], [1, 2], [2, 3], [1, 4]], &[1.0, 2.0, 4.0, 2.5]).unwrap();
        let found = nearest_on_tree(&tree, 2, &Monitor::default()).unwrap();
        assert_eq!(
            found,
            [([0, 1], 1.0), ([0, 2], 3.0), ([0, 4], 3.5), ([1, 2], 2.0), ([1, 3], 6.0), ([1, 4], 2.5), ([2, 3], 4.0)]
        );
    }

    #[test]
    fn weights_fall_with_the_distance_if_asked() {
        let params = RiemannianGraphParams { edge_weight: EdgeWeight::Inverse { offset: 1.0 }, ..Default::default() };
        let nodes = nodes(60, true);
        let graph = riemannian_graph(&nodes, &params, &Monitor::default()).unwrap().graph;
        let lengths: Vec<f32> = graph.edges().iter().map(|&e| length(&nodes, e, &params)).collect();
        let mean = lengths.iter().sum::<f32>() / lengths.len() as f32;
        for (length, weight) in lengths.iter().zip(graph.weights()) {
            assert!((weight - 1.0 / (1.0 + length / mean)).abs() < 1e-5);
        }
    }

    #[test]
    fn few_nodes_are_fine() {
        for count in 0..4 {
            let found = riemannian_graph(&nodes(count, true), &Default::default(), &Monitor::default()).unwrap();
            assert_eq!(found.graph.len(), count);
            assert_eq!(connected_components(&found.graph, &Monitor::default()).unwrap().count, count.min(1));
        }
    }
}
