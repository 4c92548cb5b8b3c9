//! The neighbourhood graph that contours run in.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.5.1: the graph of
//! few nearest neighbours falls apart where the density of points differs by direction, as between the lines of a
//! scanner; a minimum spanning forest of edges to more neighbours joins its components.
//!
//! Beyond the source, only points of some likelihood are nodes, and these are thinned, so that the graph of a large
//! scan is small and its spacing does not depend on the distance to the scanner.

use super::likely::Likely;
use super::params::NeighbourhoodParams;
use crate::cloud::Positions;
use crate::error::Result;
use crate::graph::{Graph, Parallel, WeightedPairs, connected_components, minimum_spanning_tree};
use crate::neighbours::{knn, nearest_of};
use crate::parallel::{Monitor, map_watched, watched};

/// Nodes whose many neighbours are in memory at a time.
const QUERIES: usize = 1 << 20;

/// The neighbourhood graph; the weight of an edge is its cost, 0 to 2.
///
/// Nodes are joined with their `k1` nearest ones. Of the edges to the `k2` nearest nodes, those of a minimum spanning
/// forest by length join different components; components farther apart remain separate. The cost of an edge is `2 −
/// (p_i + p_j)/2 − d*/‖x_i − x_j‖` (equation 4.4) with the likelihoods p and the smaller distance d* of one of both
/// nodes from its nearest node: short edges of likely nodes are cheap. Nodes at one position are not joined. O(n log n)
/// expected time; memory O(n k1) and 8 k2 bytes for a million nodes at a time.
///
/// # Errors
/// If a parameter is outside its range, lengths do not fit, a value is not finite, the graph does not fit into memory,
/// or the work was cancelled.
pub fn neighbourhood(nodes: &Likely, params: &NeighbourhoodParams, monitor: &Monitor) -> Result<Graph> {
    params.validate()?;
    nodes.check(monitor)?;
    let near = knn(&nodes.positions, params.k1, monitor)?;
    let mut pairs = Vec::with_capacity(near.indices().len());
    for piece in watched(near.len(), monitor) {
        for i in piece? {
            let row = near.of(i).iter().zip(near.squared_distances(i));
            pairs.extend(row.filter(|(_, squared)| **squared > 0.0).map(|(&j, _)| [i as u32, j]));
        }
    }
    let nearest = map_watched(near.len(), monitor, |i| near.squared_distances(i).first().copied().unwrap_or(0.0))?;
    drop(near);
    let graph = least(nodes.len(), &pairs, &vec![0.0; pairs.len()], monitor)?;
    let graph = joined(graph, &nodes.positions, params.k2, monitor)?;
    let costs = map_watched(graph.edges().len(), monitor, |e| cost(nodes, &nearest, graph.edges()[e]))?;
    graph.with_weights(costs)
}

fn least(nodes: usize, pairs: &[[u32; 2]], weights: &[f32], monitor: &Monitor) -> Result<Graph> {
    Graph::from_pairs(nodes, &WeightedPairs { pairs, weights, parallel: Parallel::Least }, monitor)
}

/// Adds a minimum spanning forest, by length, of the edges to the `k` nearest nodes that join components of a graph
/// with weights 0.
fn joined(graph: Graph, positions: &Positions, k: usize, monitor: &Monitor) -> Result<Graph> {
    let components = connected_components(&graph, monitor)?;
    if components.count < 2 {
        return Ok(graph);
    }
    let nodes = graph.len();
    let (mut pairs, mut weights) = graph.into_edges();
    let inside = pairs.len();
    let mut first = 0;
    while first < nodes {
        let queries: Vec<u32> = (first as u32..nodes.min(first + QUERIES) as u32).collect();
        // The node itself is among its nearest ones.
        let near = nearest_of(positions, &positions.select(&queries, monitor)?, k.saturating_add(1), monitor)?;
        for piece in watched(queries.len(), monitor) {
            for at in piece? {
                let (i, own) = (queries[at], components.of[first + at]);
                for (&j, &squared) in near.of(at).iter().zip(near.squared_distances(at)) {
                    if components.of[j as usize] != own && squared > 0.0 {
                        pairs.push([i.min(j), i.max(j)]);
                        weights.push(squared.sqrt());
                    }
                }
            }
        }
        first += QUERIES;
    }
    if pairs.len() == inside {
        return least(nodes, &pairs, &weights, monitor);
    }
    // The edges of weight 0 are taken first, so that the others span the graph of the components.
    let mut all = least(nodes, &pairs, &weights, monitor)?;
    let tree = minimum_spanning_tree(&all, monitor)?;
    let chosen: Vec<[u32; 2]> = tree.iter().map(|&e| all.edges()[e as usize]).collect();
    all.retain(|edge| {
        components.of[edge[0] as usize] == components.of[edge[1] as usize] || chosen.binary_search(&edge).is_ok()
    });
    Ok(all)
}

/// Equation 4.4. `nearest` holds the squared distance of each node from its nearest one.
fn cost(nodes: &Likely, nearest: &[f32], edge: [u32; 2]) -> f32 {
    let [i, j] = edge.map(|node| node as usize);
    let [a, b] = [i, j].map(|node| nodes.positions.xyz(node));
    // As the search for neighbours computes it, so that the nearest one gives a ratio of exactly 1.
    let [x, y, z] = [0, 1, 2].map(|axis| b[axis] - a[axis]);
    let squared = f64::from(x * x + y * y + z * z);
    let closest = f64::from(nearest[i].min(nearest[j]));
    let ratio = if squared > 0.0 { (closest / squared).sqrt() } else { 0.0 };
    let likelihood = f64::midpoint(f64::from(nodes.likelihoods[i]), f64::from(nodes.likelihoods[j]));
    (2.0 - likelihood - ratio).clamp(0.0, 2.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn random(seed: u64, n: usize) -> Likely {
        let mut random = stream(seed, 8);
        // Clusters that few neighbours do not join.
        let rows: Vec<[f32; 3]> = (0..n)
            .map(|i| [(i % 6) as f64 * 1.3, (i % 3) as f64 * 0.9, 0.0].map(|c| (c + 0.2 * random.uniform()) as f32))
            .collect();
        Likely {
            likelihoods: rows.iter().map(|_| random.uniform() as f32).collect(),
            tangents: vec![[1.0, 0.0, 0.0]; n],
            positions: Positions::from_rows(&rows),
        }
    }

    fn length(nodes: &Likely, [a, b]: [u32; 2]) -> f64 {
        let [a, b] = [a, b].map(|i| nodes.positions.xyz(i as usize).map(f64::from));
        a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    }

    /// The k nearest others of each node by brute force.
    fn brute(nodes: &Likely, k: usize) -> Vec<[u32; 2]> {
        let n = nodes.len() as u32;
        let of = |i: u32| {
            let mut others: Vec<u32> = (0..n).filter(|&j| j != i).collect();
            others.sort_by(|&a, &b| length(nodes, [i, a]).total_cmp(&length(nodes, [i, b])));
            others.truncate(k);
            others.into_iter().map(move |j| [i.min(j), i.max(j)])
        };
        let mut all: Vec<[u32; 2]> = (0..n).flat_map(of).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Component of each node by repeated labelling.
    fn labels(n: usize, edges: &[[u32; 2]]) -> Vec<u32> {
        let mut of: Vec<u32> = (0..n as u32).collect();
        for _ in 0..n {
            for &[a, b] in edges {
                let least = of[a as usize].min(of[b as usize]);
                (of[a as usize], of[b as usize]) = (least, least);
            }
        }
        of
    }

    #[test]
    fn a_minimum_spanning_forest_joins_the_components() {
        for seed in 0..20 {
            let nodes = random(seed, 60);
            let params = NeighbourhoodParams { k1: 3, k2: 20, ..Default::default() };
            let graph = neighbourhood(&nodes, &params, &Monitor::default()).unwrap();
            let inside = brute(&nodes, 3);
            let component = labels(60, &inside);
            let added: Vec<[u32; 2]> =
                graph.edges().iter().copied().filter(|e| inside.binary_search(e).is_err()).collect();
            assert_eq!(graph.edges().len(), inside.len() + added.len());
            // Prim's algorithm on the components.
            let crossing: Vec<[u32; 2]> = brute(&nodes, 20)
                .into_iter()
                .filter(|[a, b]| component[*a as usize] != component[*b as usize])
                .collect();
            let (mut tree, mut weight) = (inside.clone(), 0.0);
            let mut whole = inside.clone();
            whole.extend(&crossing);
            while labels(60, &tree) != labels(60, &whole) {
                let of = labels(60, &tree);
                let open = crossing.iter().filter(|[a, b]| of[*a as usize] != of[*b as usize]);
                let best = open.min_by(|x, y| length(&nodes, **x).total_cmp(&length(&nodes, **y))).unwrap();
                weight += length(&nodes, *best);
                tree.push(*best);
            }
            let total: f64 = added.iter().map(|&e| length(&nodes, e)).sum();
            assert!((total - weight).abs() < 1e-5, "seed {seed}: {total} {weight}");
            assert_eq!(labels(60, graph.edges()), labels(60, &whole));
            assert!(!added.is_empty());
        }
    }

    #[test]
    fn costs_are_those_of_the_equation_and_lie_between_0_and_2() {
        let mut nodes = random(3, 300);
        nodes.likelihoods[..100].iter_mut().for_each(|p| *p = 1.0);
        nodes.likelihoods[100..200].iter_mut().for_each(|p| *p = 0.0);
        let graph = neighbourhood(&nodes, &NeighbourhoodParams::default(), &Monitor::default()).unwrap();
        let nearest = |i: u32| (0..300).filter(|&j| j != i).map(|j| length(&nodes, [i, j])).fold(9.0, f64::min);
        for (&[a, b], &weight) in graph.edges().iter().zip(graph.weights()) {
            let mean = f64::from(nodes.likelihoods[a as usize] + nodes.likelihoods[b as usize]) / 2.0;
            let expected = 2.0 - mean - nearest(a).min(nearest(b)) / length(&nodes, [a, b]);
            assert!((f64::from(weight) - expected).abs() < 1e-4 && (0.0..=2.0).contains(&weight));
        }
    }

    #[test]
    fn nothing_one_node_and_nodes_at_one_place_have_no_edges() {
        let params = NeighbourhoodParams::default();
        let edges = |nodes: &Likely| neighbourhood(nodes, &params, &Monitor::default()).unwrap().edges().len();
        assert_eq!(edges(&Likely::default()), 0);
        for n in [1, 2, 30] {
            let rows = vec![[1.0, 2.0, 3.0]; n];
            let same = Likely {
                positions: Positions::from_rows(&rows),
                likelihoods: vec![0.9; n],
                tangents: vec![[0.0; 3]; n],
            };
            assert_eq!(edges(&same), 0);
        }
        assert!(NeighbourhoodParams { k2: 4, ..params.clone() }.validate().is_err());
        assert!(NeighbourhoodParams { k1: 0, ..params.clone() }.validate().is_err());
        assert!(NeighbourhoodParams { keep: 2.0, ..params }.validate().is_err());
    }
}
