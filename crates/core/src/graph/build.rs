//! The graph of nearest neighbours.

use super::{EdgeWeight, Graph};
use crate::error::{Error, Result};
use crate::neighbours::Neighbours;
use crate::parallel::{Monitor, map_ordered, sort_watched_by, watched};
use serde::{Deserialize, Serialize};
use std::borrow::Borrow;
use std::ops::Range;

/// Nodes whose edges one task builds.
const BLOCK: usize = 8192;

/// Blocks per thread that are held until their edges have been stored.
const AT_ONCE: usize = 4;

/// Treatment of two points that are neighbours of each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Multiplicity {
    /// One edge, like any other.
    #[default]
    Once,
    /// One edge of twice the weight, which also counts twice in the mean length, as in superpoint graphs (Landrieu &
    /// Simonovsky 2018).
    Count,
}

/// Parameters of [`knn_graph`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KnnGraphParams {
    /// Weights of the edges.
    pub weight: EdgeWeight,
    /// Treatment of two points that are neighbours of each other.
    pub multiplicity: Multiplicity,
    /// Edges longer than this multiple of the mean length are removed; above 0. The mean is taken before. `None`
    /// removes none.
    pub prune: Option<f64>,
}

impl KnnGraphParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if let Some(prune) = self.prune.filter(|p| !(*p > 0.0 && p.is_finite())) {
            return Err(Error::parameter("prune", prune, "above 0, finite"));
        }
        self.weight.validate()
    }
}

/// One end of a pair: the larger node and the squared length.
type Half = (u32, f32);

/// An edge before weights are computed: 12 bytes, because there are many.
struct Edge {
    ends: [u32; 2],
    /// Squared length; negative (-0 too) if both points are neighbours of each other and that counts.
    squared: f32,
}

fn length(squared: f32) -> f64 {
    f64::from(squared.abs()).sqrt()
}

/// How often the pair counts.
fn times(squared: f32) -> f64 {
    if squared.is_sign_negative() { 2.0 } else { 1.0 }
}

/// The undirected graph of nearest neighbours: i and j are connected if one is among the nearest of the other.
///
/// `nodes` is the number of points. Lengths are in metres, like the neighbours' distances. O(n k²), where the factor k²
/// is a scan of few cache lines; about 20 bytes an edge during the construction. Pass `near` by value to have it freed
/// before the graph is assembled.
///
/// ```
/// use scansion_core::graph::{KnnGraphParams, knn_graph};
/// use scansion_core::{neighbours::Neighbours, parallel::Monitor};
///
/// let near = Neighbours::new(1, vec![1, 0, 1], vec![1.0, 1.0, 4.0])?;
/// let graph = knn_graph(3, &near, &KnnGraphParams::default(), &Monitor::default())?;
/// assert_eq!(graph.edges(), [[0, 1], [1, 2]]);
/// # Ok::<(), scansion_core::Error>(())
/// ```
///
/// # Errors
/// If there is not a row of neighbours for each node, a distance is negative or not finite, a parameter is outside its
/// range, or the work was cancelled.
pub fn knn_graph(
    nodes: usize,
    near: impl Borrow<Neighbours>,
    params: &KnnGraphParams,
    monitor: &Monitor,
) -> Result<Graph> {
    params.validate()?;
    if near.borrow().k() > 0 && near.borrow().len() != nodes {
        return Err(Error::input(format!("neighbours of {} points for {nodes} nodes", near.borrow().len())));
    }
    let (mut edges, mut squared) = all_edges(near.borrow(), params.multiplicity, monitor)?;
    drop(near);
    let mean = mean_length(&squared, monitor)?;
    if let Some(cap) = params.prune {
        let mut rest = squared.iter().map(|&s| length(s) <= cap * mean);
        edges.retain(|_| rest.next().unwrap_or(true));
        squared.retain(|&s| length(s) <= cap * mean);
    }
    let mut weights = squared;
    for piece in watched(weights.len(), monitor) {
        weights[piece?].iter_mut().for_each(|w| *w = (times(*w) * params.weight.of(length(*w), mean)) as f32);
    }
    Ok(Graph { nodes, edges, weights })
}

/// Mean length of all edges, 0 if there is none.
fn mean_length(squared: &[f32], monitor: &Monitor) -> Result<f64> {
    let (mut total, mut sum) = (0.0, 0.0);
    for piece in watched(squared.len(), monitor) {
        for &s in &squared[piece?] {
            total += times(s);
            sum += times(s) * length(s);
        }
    }
    Ok(if total > 0.0 { sum / total } else { 0.0 })
}

/// The edges, ascending, and their squared lengths, negative if each end is a neighbour of the other and that counts.
fn all_edges(near: &Neighbours, multiplicity: Multiplicity, monitor: &Monitor) -> Result<(Vec<[u32; 2]>, Vec<f32>)> {
    let block = |b: usize| b * BLOCK..((b + 1) * BLOCK).min(near.len());
    let blocks = near.len().div_ceil(BLOCK);
    let mut one_sided = map_ordered(blocks, monitor, |b| Ok(one_sided(block(b), near)))?.concat();
    sort_watched_by(&mut one_sided, |a, b| (a.0, a.1).cmp(&(b.0, b.1)), monitor)?;
    let larger = |b: usize| block(b).map(|i| near.of(i).iter().filter(|j| **j as usize > i).count()).sum::<usize>();
    let count = map_ordered(blocks, monitor, |b| Ok(larger(b)))?.iter().sum::<usize>() + one_sided.len();
    let (mut edges, mut squared) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let at_once = AT_ONCE * rayon::current_num_threads();
    for begin in (0..blocks).step_by(at_once) {
        let parts = map_ordered(at_once.min(blocks - begin), monitor, |b| {
            let range = block(begin + b);
            let first = one_sided.partition_point(|half| (half.0 as usize) < range.start);
            unite(range, near, &one_sided[first..], multiplicity)
        })?;
        edges.extend(parts.iter().flatten().map(|edge| edge.ends));
        squared.extend(parts.iter().flatten().map(|edge| edge.squared));
    }
    Ok((edges, squared))
}

/// Pairs in which only the larger end has the other as a neighbour: smaller end, larger end, squared distance.
fn one_sided(nodes: Range<usize>, near: &Neighbours) -> Vec<(u32, u32, f32)> {
    let mut found = Vec::new();
    for node in nodes {
        let row = near.of(node).iter().zip(near.squared_distances(node));
        let smaller = row.filter(|(other, _)| (**other as usize) < node);
        let alone = smaller.filter(|(other, _)| !near.of(**other as usize).contains(&(node as u32)));
        found.extend(alone.map(|(&other, &squared)| (other, node as u32, squared)));
    }
    found
}

/// The edges of some nodes to larger ones, each pair once. `one_sided` begins with the pairs of the first node or of a
/// later one.
fn unite(
    nodes: Range<usize>,
    near: &Neighbours,
    one_sided: &[(u32, u32, f32)],
    multiplicity: Multiplicity,
) -> Result<Vec<Edge>> {
    let mut edges: Vec<Edge> = Vec::with_capacity(nodes.len() * near.k() / 2);
    let (mut row, mut rest) = (Vec::new(), one_sided);
    for node in nodes {
        let own = near.of(node).iter().copied().zip(near.squared_distances(node).iter().copied());
        row.clear();
        row.extend(own.filter(|half| half.0 as usize > node));
        for at in 0..row.len() {
            // The same pair seen from the other end; counted once even if the row has it twice.
            let other = row[at].0;
            let seen = row[..at].iter().any(|half| half.0 == other);
            let back = near.of(other as usize).iter().zip(near.squared_distances(other as usize));
            let mutual = back.filter(|(i, _)| !seen && **i as usize == node);
            row.extend(mutual.map(|(_, &squared)| (other, squared)));
        }
        let count = rest.iter().take_while(|half| half.0 as usize == node).count();
        row.extend(rest[..count].iter().map(|half| (half.1, half.2)));
        rest = &rest[count..];
        push_row(node, &mut row, multiplicity, &mut edges)?;
    }
    Ok(edges)
}

/// The edges of one node to larger ones.
fn push_row(node: usize, row: &mut [Half], multiplicity: Multiplicity, edges: &mut Vec<Edge>) -> Result<()> {
    row.sort_unstable_by(|a: &Half, b: &Half| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    for &(other, squared) in row.iter() {
        let ends = [node as u32, other];
        if !(squared >= 0.0 && squared.is_finite()) {
            return Err(Error::input(format!("squared distance {squared} of points {node} and {other}")));
        }
        match edges.last_mut().filter(|last| last.ends == ends) {
            Some(last) if multiplicity == Multiplicity::Count => last.squared = -last.squared.abs(),
            Some(_) => {}
            None => edges.push(Edge { ends, squared: squared.abs() }),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points, Positions};
    use crate::neighbours::knn;
    use crate::random::stream;
    use std::collections::BTreeMap;

    fn points(seed: u64, count: usize) -> Positions {
        let mut random = stream(seed, 1);
        let rows: Vec<[f64; 3]> =
            (0..count).map(|_| std::array::from_fn(|_| (random.uniform() * 9.0).floor())).collect();
        Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions
    }

    #[test]
    fn every_pair_is_one_edge_and_weights_follow_the_formula() {
        let near = knn(&points(1, 300), 6, &Monitor::default()).unwrap();
        let mut pairs: BTreeMap<[u32; 2], (f64, u32)> = BTreeMap::new();
        for i in 0..300 {
            for (&j, d) in near.of(i).iter().zip(near.squared_distances(i)) {
                let i = i as u32;
                pairs.entry([i.min(j), i.max(j)]).or_insert((f64::from(*d).sqrt(), 0)).1 += 1;
            }
        }
        for multiplicity in [Multiplicity::Once, Multiplicity::Count] {
            let times = |count: u32| if multiplicity == Multiplicity::Count { f64::from(count) } else { 1.0 };
            let total: f64 = pairs.values().map(|p| times(p.1)).sum();
            let mean = pairs.values().map(|p| times(p.1) * p.0).sum::<f64>() / total;
            let weight = EdgeWeight::Inverse { offset: 0.5 };
            let params = KnnGraphParams { weight, multiplicity, prune: Some(1.2) };
            let graph = knn_graph(300, &near, &params, &Monitor::default()).unwrap();
            let kept: Vec<_> = pairs.iter().filter(|(_, (d, _))| *d <= 1.2 * mean).collect();
            assert!(kept.len() < pairs.len());
            assert_eq!(graph.edges(), kept.iter().map(|(pair, _)| **pair).collect::<Vec<_>>());
            for ((_, (d, count)), w) in kept.iter().zip(graph.weights()) {
                assert!((f64::from(*w) - times(*count) / (0.5 + d / mean)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_graph_is_that_of_pairs_in_any_order() {
        let near = knn(&points(2, 20_000), 5, &Monitor::default()).unwrap();
        let pairs: Vec<[u32; 2]> = (0..20_000).flat_map(|i| near.of(i).iter().map(move |&j| [i as u32, j])).collect();
        let graph = Graph::new(20_000, &pairs, &vec![1.0; pairs.len()]).unwrap();
        let params = KnnGraphParams { multiplicity: Multiplicity::Count, ..KnnGraphParams::default() };
        assert_eq!(knn_graph(20_000, &near, &params, &Monitor::default()).unwrap(), graph);
    }

    #[test]
    fn a_point_alone_is_a_node_without_edges() {
        let none = Neighbours::default();
        let graph = knn_graph(1, &none, &KnnGraphParams::default(), &Monitor::default()).unwrap();
        assert_eq!((graph.len(), graph.edges().len()), (1, 0));
        assert!(knn_graph(0, &none, &KnnGraphParams::default(), &Monitor::default()).unwrap().is_empty());
    }

    #[test]
    fn points_in_one_place_have_edges_of_the_largest_weight() {
        let near = Neighbours::new(1, vec![1, 0], vec![0.0, 0.0]).unwrap();
        let params = KnnGraphParams { weight: EdgeWeight::Inverse { offset: 2.0 }, ..KnnGraphParams::default() };
        assert_eq!(knn_graph(2, &near, &params, &Monitor::default()).unwrap().weights(), [0.5]);
    }

    #[test]
    fn nonsense_is_refused() {
        let near = Neighbours::new(1, vec![1, 0], vec![1.0, f32::NAN]).unwrap();
        let run = |nodes: usize, near: &Neighbours, params: &KnnGraphParams| {
            knn_graph(nodes, near, params, &Monitor::default()).map(|_| ())
        };
        assert!(run(2, &near, &KnnGraphParams { prune: Some(f64::NAN), ..KnnGraphParams::default() }).is_err());
        assert!(run(3, &near, &KnnGraphParams::default()).is_err());
        let nan = Neighbours::new(1, vec![1, 0], vec![f32::NAN, f32::NAN]).unwrap();
        assert!(run(2, &nan, &KnnGraphParams::default()).is_err());
    }
}
