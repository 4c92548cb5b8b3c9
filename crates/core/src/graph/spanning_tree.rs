//! Minimum spanning tree, or forest where the graph falls into components.

use super::Graph;
use super::union_find::UnionFind;

/// The edges of the minimum spanning forest, ascending; of equal weights the edge with the smaller index is taken.
///
/// Indices into [`Graph::edges`], as many as there are nodes less components. Kruskal 1956. O(m log m).
///
/// ```
/// use scansion_core::graph::{Graph, minimum_spanning_tree};
///
/// let graph = Graph::new(3, &[[0, 1], [0, 2], [1, 2]], &[1.0, 3.0, 2.0])?;
/// assert_eq!(minimum_spanning_tree(&graph), [0, 2]);
/// # Ok::<(), scansion_core::Error>(())
/// ```
pub fn minimum_spanning_tree(graph: &Graph) -> Vec<u32> {
    // Weights are not negative: their bits are ordered as they are (adding 0 turns -0 into 0).
    let key = |(edge, weight): (usize, &f32)| u64::from((weight + 0.0).to_bits()) << 32 | edge as u64;
    let mut order: Vec<u64> = graph.weights().iter().enumerate().map(key).collect();
    order.sort_unstable();
    let mut sets = UnionFind::new(graph.len());
    let mut tree = Vec::with_capacity(graph.len().saturating_sub(1));
    for key in order {
        if tree.len() + 1 >= graph.len() {
            break;
        }
        let edge = key as u32;
        let [a, b] = graph.edges()[edge as usize];
        if sets.join(a, b) {
            tree.push(edge);
        }
    }
    tree.sort_unstable();
    tree
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
            let tree = minimum_spanning_tree(&graph);
            let total: f64 = tree.iter().map(|&e| f64::from(graph.weights()[e as usize])).sum();
            assert_eq!(total, prim(&graph), "seed {seed}");
            let pairs: Vec<[u32; 2]> = tree.iter().map(|&e| graph.edges()[e as usize]).collect();
            let forest = Graph::new(graph.len(), &pairs, &vec![1.0; pairs.len()]).unwrap();
            let components = connected_components(&graph);
            assert_eq!(connected_components(&forest), components);
            assert_eq!(tree.len(), graph.len() - components.count);
        }
    }

    #[test]
    fn of_equal_edges_the_first_are_taken() {
        let graph = Graph::new(3, &[[0, 1], [0, 2], [1, 2]], &[0.0, -0.0, 0.0]).unwrap();
        assert_eq!(minimum_spanning_tree(&graph), [0, 1]);
        assert!(minimum_spanning_tree(&Graph::default()).is_empty());
    }
}
