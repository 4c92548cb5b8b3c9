//! Opening of narrow loops.
//!
//! Candidates of one contour share most of their nodes but not all: where they part, they leave loops of few
//! centimetres. Edges are taken one after the other, those with most support first; one that closes a narrow loop is
//! left out.

use super::super::polylines::{PathUnion, distance};
use super::TidyParams;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::parallel::Monitor;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The union without edges that close a loop of at most `loop_length` whose mean width is below `loop_width`.
///
/// The width of a loop is twice the norm of its vector area by its length. O(m b log b) for b nodes within the loop
/// length of a node.
pub(super) fn opened(union: PathUnion, positions: &Positions, params: &TidyParams, monitor: &Monitor) -> Result<Graph> {
    let PathUnion { mut graph, support } = union;
    if positions.len() != graph.len() {
        return Err(Error::input(format!("{} positions for {} nodes", positions.len(), graph.len())));
    }
    if params.loop_width <= 0.0 {
        return Ok(graph);
    }
    let mut nodes: Vec<u32> = graph.edges().iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let at: Vec<[f32; 3]> = nodes.iter().map(|&node| positions.xyz(node as usize)).collect();
    let number = |node: u32| nodes.binary_search(&node).unwrap_or_default() as u32;
    let edges: Vec<[u32; 2]> = graph.edges().iter().map(|edge| edge.map(number)).collect();
    let length = |e: usize| distance(at[edges[e][0] as usize], at[edges[e][1] as usize]);
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_by(|&a, &b| support[b].total_cmp(&support[a]).then(length(a).total_cmp(&length(b))));
    let mut growing = Growing::new(&at);
    let mut kept = vec![false; edges.len()];
    for (count, e) in order.into_iter().enumerate() {
        if count % 1024 == 0 {
            monitor.check()?;
        }
        let path = growing.path(edges[e], params.loop_length - length(e));
        kept[e] = path.is_none_or(|path| width(&at, &path) >= params.loop_width);
        if kept[e] {
            growing.add(edges[e], length(e));
        }
    }
    let all = graph.edges().to_vec();
    graph.retain(|edge| all.binary_search(&edge).is_ok_and(|e| kept[e]));
    Ok(graph)
}

/// Mean width of the loop along a path and back to its start.
fn width(at: &[[f32; 3]], path: &[u32]) -> f64 {
    let Some(&first) = path.first() else { return 0.0 };
    let origin = at[first as usize].map(f64::from);
    let place = |node: u32| {
        let [x, y, z] = at[node as usize].map(f64::from);
        [x - origin[0], y - origin[1], z - origin[2]]
    };
    let (mut area, mut length) = ([0.0f64; 3], 0.0);
    for (k, &node) in path.iter().enumerate() {
        let next = path.get(k + 1).copied().unwrap_or(first);
        let ([a, b, c], [x, y, z]) = (place(node), place(next));
        let cross = [b * z - c * y, c * x - a * z, a * y - b * x];
        area.iter_mut().zip(cross).for_each(|(sum, part)| *sum += part / 2.0);
        length += distance(at[node as usize], at[next as usize]);
    }
    let area = area.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length > 0.0 { 2.0 * area / length } else { 0.0 }
}

/// A graph to which edges are added, with a search for short paths.
struct Growing {
    neighbours: Vec<Vec<(u32, f64)>>,
    /// Cost of each node in the current search and the node before it; infinite if it was not reached.
    reached: Vec<(f64, u32)>,
    touched: Vec<u32>,
    queue: BinaryHeap<Reverse<(u64, u32)>>,
}

impl Growing {
    fn new(at: &[[f32; 3]]) -> Self {
        Self {
            neighbours: vec![Vec::new(); at.len()],
            reached: vec![(f64::INFINITY, 0); at.len()],
            touched: Vec::new(),
            queue: BinaryHeap::new(),
        }
    }

    fn add(&mut self, [a, b]: [u32; 2], length: f64) {
        self.neighbours[a as usize].push((b, length));
        self.neighbours[b as usize].push((a, length));
    }

    /// The shortest path between two nodes if it is at most this long.
    fn path(&mut self, [from, to]: [u32; 2], limit: f64) -> Option<Vec<u32>> {
        self.touched.drain(..).for_each(|node| self.reached[node as usize] = (f64::INFINITY, 0));
        self.queue.clear();
        self.reached[from as usize] = (0.0, from);
        self.touched.push(from);
        self.queue.push(Reverse((0, from)));
        while let Some(Reverse((bits, node))) = self.queue.pop() {
            let cost = f64::from_bits(bits);
            if node == to {
                break;
            }
            if cost > self.reached[node as usize].0 {
                continue;
            }
            for &(next, length) in &self.neighbours[node as usize] {
                let sum = cost + length;
                let known = &mut self.reached[next as usize];
                if sum < known.0 && sum <= limit {
                    if known.0 == f64::INFINITY {
                        self.touched.push(next);
                    }
                    *known = (sum, node);
                    self.queue.push(Reverse((sum.to_bits(), next)));
                }
            }
        }
        if self.reached[to as usize].0.is_infinite() {
            return None;
        }
        let mut path = vec![to];
        let mut node = to;
        while node != from {
            node = self.reached[node as usize].1;
            path.push(node);
        }
        Some(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ladder(height: f32) -> (PathUnion, Positions) {
        // Two parallel lines of ten nodes a tenth of a metre apart, joined at their ends.
        let positions: Positions =
            (0..20).map(|i| [(i % 10) as f32 * 0.05, if i < 10 { 0.0 } else { height }, 0.0]).collect();
        let mut edges: Vec<[u32; 2]> = (0..9).flat_map(|i| [[i, i + 1], [i + 10, i + 11]]).collect();
        edges.extend([[0, 10], [9, 19]]);
        let graph = Graph::new(20, &edges, &[1.0; 20]).unwrap();
        let support = graph.edges().iter().map(|e| if e[1] < 10 { 2.0 } else { 1.0 }).collect();
        (PathUnion { graph, support }, positions)
    }

    #[test]
    fn narrow_loops_are_opened_where_the_support_is_least_and_wide_ones_stay() {
        let edges = |height: f32, params: &TidyParams| {
            let (union, positions) = ladder(height);
            opened(union, &positions, params, &Monitor::default()).unwrap().edges().to_vec()
        };
        let params = TidyParams::default();
        let narrow = edges(0.03, &params);
        assert_eq!(narrow.len(), 19);
        assert!((0..9).all(|i| narrow.contains(&[i, i + 1])));
        assert_eq!(edges(0.3, &params).len(), 20);
        assert_eq!(edges(0.03, &TidyParams { loop_length: 0.9, ..params.clone() }).len(), 20);
        assert_eq!(edges(0.03, &TidyParams { loop_width: 0.0, ..params }).len(), 20);
    }

    #[test]
    fn the_width_of_a_rectangle_is_its_area_by_half_its_length() {
        let at = [[5.0, 5.0, 1.0], [7.0, 5.0, 1.0], [7.0, 5.0, 2.0], [5.0, 5.0, 2.0]];
        assert!((width(&at, &[0, 1, 2, 3]) - 2.0 / 3.0).abs() < 1e-9);
        assert_eq!(width(&at, &[0, 1]), 0.0);
        assert_eq!(width(&at, &[]), 0.0);
    }
}
