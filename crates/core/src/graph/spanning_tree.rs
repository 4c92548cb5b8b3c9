//! Minimum spanning tree, or forest if the graph is not connected.

use super::Graph;
use super::union_find::UnionFind;
use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// Largest number of weight ranges that are sorted one after the other.
const RANGES: u32 = 1 << 16;

/// The edges of the minimum spanning forest, ascending; of equal weights the edge of smaller index is taken.
///
/// Returns indices into [`Graph::edges`], as many as there are nodes less components. J. B. Kruskal 1956. O(m log m); 8
/// bytes an edge.
///
/// ```
/// use scansion_core::graph::{Graph, minimum_spanning_tree};
/// use scansion_core::parallel::Monitor;
///
/// let graph = Graph::new(3, &[[0, 1], [0, 2], [1, 2]], &[1.0, 3.0, 2.0])?;
/// assert_eq!(minimum_spanning_tree(&graph, &Monitor::default())?, [0, 2]);
/// # Ok::<(), scansion_core::Error>(())
/// ```
///
/// # Errors
/// If the work was cancelled.
pub fn minimum_spanning_tree(graph: &Graph, monitor: &Monitor) -> Result<Vec<u32>> {
    let order = ascending(graph.weights(), monitor)?;
    let mut sets = UnionFind::new(graph.len());
    let mut chosen = vec![false; order.len()];
    let mut missing = graph.len().saturating_sub(1);
    for piece in watched(order.len(), monitor) {
        for &key in &order[piece?] {
            let [a, b] = graph.edges()[key as u32 as usize];
            if sets.unite(a, b).is_some() {
                chosen[key as u32 as usize] = true;
                missing -= 1;
            }
        }
        if missing == 0 {
            break;
        }
    }
    Ok((0..).zip(chosen).filter(|(_, chosen)| *chosen).map(|(edge, _)| edge).collect())
}

/// (bits of the weight, index) of each edge, ascending: edges are first distributed to narrow ranges of weights, then
/// each range is sorted.
fn ascending(weights: &[f32], monitor: &Monitor) -> Result<Vec<u64>> {
    // Weights are not negative, so that their bit patterns sort like the values (adding 0 turns -0 into 0).
    let bits = |edge: usize| (weights[edge] + 0.0).to_bits();
    let (mut least, mut most) = (u32::MAX, 0);
    for piece in watched(weights.len(), monitor) {
        piece?.for_each(|edge| (least, most) = (least.min(bits(edge)), most.max(bits(edge))));
    }
    let shift = (most.saturating_sub(least) / RANGES).checked_ilog2().map_or(0, |log| log + 1);
    let range = |edge: usize| ((bits(edge) - least) >> shift) as usize;
    let mut ends = vec![0usize; RANGES as usize + 1];
    for piece in watched(weights.len(), monitor) {
        piece?.for_each(|edge| ends[range(edge) + 1] += 1);
    }
    (1..ends.len()).for_each(|r| ends[r] += ends[r - 1]);
    let mut order = vec![0u64; weights.len()];
    for piece in watched(weights.len(), monitor) {
        for edge in piece? {
            let slot = &mut ends[range(edge)];
            order[*slot] = u64::from(bits(edge)) << 32 | edge as u64;
            *slot += 1;
        }
    }
    let mut first = 0;
    for &end in &ends {
        monitor.check()?;
        order[first..end].sort_unstable();
        first = end;
    }
    Ok(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::connected_components;
    use crate::random::stream;

    fn random(seed: u64, nodes: u32, edges: usize) -> Graph {
        let mut random = stream(seed, 5);
        let mut draw = |bound: u32| (random.uniform() * f64::from(bound)) as u32;
        let pairs: Vec<[u32; 2]> = (0..edges).map(|_| [draw(nodes), draw(nodes)]).filter(|[a, b]| a != b).collect();
        let weights: Vec<f32> = pairs.iter().map(|_| draw(6) as f32).collect();
        Graph::new(nodes as usize, &pairs, &weights).unwrap()
    }

    /// Total weight by Prim's algorithm from every node that is not reached yet.
    fn prim(graph: &Graph) -> f64 {
        let mut inside = vec![false; graph.len()];
        let mut total = 0.0;
        for start in 0..graph.len() {
            if inside[start] {
                continue;
            }
            inside[start] = true;
            loop {
                let crossing = graph.edges().iter().zip(graph.weights());
                let crossing = crossing.filter(|([a, b], _)| inside[*a as usize] != inside[*b as usize]);
                let Some((&[a, b], weight)) = crossing.min_by(|x, y| x.1.total_cmp(y.1)) else { break };
                (inside[a as usize], inside[b as usize]) = (true, true);
                total += f64::from(*weight);
            }
        }
        total
    }

    #[test]
    fn the_forest_spans_every_component_and_weighs_as_much_as_that_of_prim() {
        for seed in 0..60 {
            let graph = random(seed, 30, 20 + seed as usize);
            let tree = minimum_spanning_tree(&graph, &Monitor::default()).unwrap();
            let total: f64 = tree.iter().map(|&e| f64::from(graph.weights()[e as usize])).sum();
            assert_eq!(total, prim(&graph), "seed {seed}");
            let pairs: Vec<[u32; 2]> = tree.iter().map(|&e| graph.edges()[e as usize]).collect();
            let forest = Graph::new(graph.len(), &pairs, &vec![1.0; pairs.len()]).unwrap();
            let components = connected_components(&graph, &Monitor::default()).unwrap();
            assert_eq!(connected_components(&forest, &Monitor::default()).unwrap(), components);
            assert_eq!(tree.len(), graph.len() - components.count);
        }
    }

    #[test]
    fn of_equal_edges_the_first_are_taken() {
        let graph = Graph::new(3, &[[0, 1], [0, 2], [1, 2]], &[0.0, -0.0, 0.0]).unwrap();
        let tree = |graph: &Graph| minimum_spanning_tree(graph, &Monitor::default()).unwrap();
        assert_eq!(tree(&graph), [0, 1]);
        assert!(tree(&Graph::default()).is_empty());
    }

    #[test]
    fn weights_of_all_sizes_are_put_in_order() {
        let mut random = stream(3, 5);
        for high in [0.0f64, 1.0, 1e-30, 1e38] {
            let mut weights: Vec<f32> = (0..3000).map(|_| (high * random.uniform().powi(9)) as f32).collect();
            weights.extend([0.0, -0.0, f32::MAX, f32::MIN_POSITIVE / 8.0]);
            let order: Vec<usize> =
                ascending(&weights, &Monitor::default()).unwrap().iter().map(|&key| key as u32 as usize).collect();
            let mut expected: Vec<usize> = (0..weights.len()).collect();
            expected.sort_by(|&a, &b| weights[a].partial_cmp(&weights[b]).unwrap());
            assert_eq!(order, expected);
        }
    }
}
