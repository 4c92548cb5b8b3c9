//! Maximum flow and minimum cut between two terminals.
//!
//! Y. Boykov, V. Kolmogorov, *An experimental comparison of min-cut/max-flow algorithms for energy minimization in
//! vision*, IEEE PAMI 26(9), 2004: a search tree of residual arcs grows from each terminal; where the trees touch, flow
//! is augmented; nodes that lose the path to their terminal are adopted by another parent (with the distances and time
//! stamps of V. Kolmogorov's thesis, 2003).
//!
//! Capacities are `f64`. An augmentation subtracts the bottleneck capacity itself from its arc, so that a saturated arc
//! has exactly 0 left and no tolerance is needed.

mod adopt;
mod augment;
mod grow;

use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor, resize_watched};
use std::collections::VecDeque;

const NONE: u32 = u32::MAX;
/// Parent of a node whose parent is the terminal.
const TERMINAL: u32 = u32::MAX - 1;
/// Parent of a node that has lost its parent.
const ORPHAN: u32 = u32::MAX - 2;

#[derive(Clone, Copy, Debug, Default)]
struct Arc {
    head: u32,
    /// The arc in the other direction.
    sister: u32,
    residual: f64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// Residual capacity of the terminal arc: from the source if positive, to the sink if negative.
    terminal: f64,
    /// Arc towards the root of the tree, or `NONE` for a free node.
    parent: u32,
    stamp: u32,
    distance: u32,
    in_sink_tree: bool,
    active: bool,
}

/// An edge with a capacity for each direction.
#[derive(Clone, Copy, Debug)]
struct Edge {
    from: u32,
    to: u32,
    capacity: f64,
    reverse: f64,
}

/// A flow network; its buffers are reused from problem to problem.
///
/// ```
/// use scansion_core::graph::MaxFlow;
///
/// let mut network = MaxFlow::default();
/// network.reset(2);
/// network.add_terminals(0, 5.0, 1.0)?;
/// network.add_terminals(1, 0.0, 4.0)?;
/// network.add_edge(0, 1, 2.0, 0.0)?;
/// assert_eq!(network.solve(), 3.0);
/// assert!(network.is_source(0) && !network.is_source(1));
/// # Ok::<(), scansion_core::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct MaxFlow {
    edges: Vec<Edge>,
    nodes: Vec<Node>,
    offsets: Vec<u32>,
    arcs: Vec<Arc>,
    flow: f64,
    time: u32,
    queue: VecDeque<u32>,
    orphans: VecDeque<u32>,
}

impl MaxFlow {
    /// Removes all arcs and starts a problem of `nodes` nodes.
    pub fn reset(&mut self, nodes: usize) {
        let free = Node { terminal: 0.0, parent: NONE, stamp: 0, distance: 0, in_sink_tree: false, active: false };
        self.nodes.clear();
        self.nodes.resize(nodes, free);
        self.edges.clear();
        (self.flow, self.time) = (0.0, 0);
    }

    /// Adds capacity from the source to `node` and from `node` to the sink. The smaller of the two is sent as flow at
    /// once.
    ///
    /// # Errors
    /// If the node does not exist, or a capacity is negative or NaN, or both are infinite.
    pub fn add_terminals(&mut self, node: usize, source: f64, sink: f64) -> Result<()> {
        let valid = source >= 0.0 && sink >= 0.0 && !(source.is_infinite() && sink.is_infinite());
        let slot = self.nodes.get_mut(node).filter(|_| valid);
        let slot = slot.ok_or_else(|| refused(&format!("terminals of node {node}"), source, sink))?;
        let left = slot.terminal;
        let (source, sink) = (source + left.max(0.0), sink + (-left).max(0.0));
        slot.terminal = source - sink;
        self.flow += source.min(sink);
        Ok(())
    }

    /// Adds an edge with a capacity for each direction; parallel edges add up.
    ///
    /// # Errors
    /// If a node does not exist, both ends are the same node, or a capacity is negative or NaN.
    pub fn add_edge(&mut self, from: usize, to: usize, capacity: f64, reverse: f64) -> Result<()> {
        if from.max(to) >= self.nodes.len() || from == to || !(capacity >= 0.0 && reverse >= 0.0) {
            return Err(refused(&format!("edge {from}-{to}"), capacity, reverse));
        }
        self.edges.push(Edge { from: from as u32, to: to as u32, capacity, reverse });
        Ok(())
    }

    /// Computes a maximum flow and returns its value, which is the capacity of the minimum cut.
    ///
    /// O(nodes² · edges · cut) in the worst case, nearly linear on graphs of point clouds.
    pub fn solve(&mut self) -> f64 {
        // A new monitor cannot have been cancelled.
        self.solve_watched(&Monitor::default()).unwrap_or(self.flow)
    }

    /// Like [`MaxFlow::solve`], for networks so large that the user may want to cancel.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn solve_watched(&mut self, monitor: &Monitor) -> Result<f64> {
        self.build(monitor)?;
        self.plant(monitor)?;
        let mut steps = 0u32;
        while let Some(node) = self.next_active() {
            steps = steps.wrapping_add(1);
            if steps.is_multiple_of(1024) {
                monitor.check()?;
            }
            while let Some(bridge) = self.grow(node) {
                self.augment(bridge);
                self.adopt();
                if self.nodes[node as usize].parent == NONE {
                    break;
                }
            }
        }
        Ok(self.flow)
    }

    /// After [`MaxFlow::solve`]: whether `node` is on the source side of the minimum cut with the smallest source side.
    pub fn is_source(&self, node: usize) -> bool {
        self.nodes.get(node).is_some_and(|n| n.parent != NONE && !n.in_sink_tree)
    }

    /// Sorts the arcs by node.
    fn build(&mut self, monitor: &Monitor) -> Result<()> {
        let mut looks = Looks::at(monitor);
        self.offsets.clear();
        resize_watched(&mut self.offsets, self.nodes.len() + 2, &0, monitor)?;
        for edge in &self.edges {
            looks.step()?;
            self.offsets[edge.from as usize + 2] += 1;
            self.offsets[edge.to as usize + 2] += 1;
        }
        for node in 2..self.offsets.len() {
            self.offsets[node] += self.offsets[node - 1];
        }
        self.arcs.clear();
        resize_watched(&mut self.arcs, 2 * self.edges.len(), &Arc::default(), monitor)?;
        for edge in &self.edges {
            looks.step()?;
            let (there, back) = (self.offsets[edge.from as usize + 1], self.offsets[edge.to as usize + 1]);
            self.offsets[edge.from as usize + 1] += 1;
            self.offsets[edge.to as usize + 1] += 1;
            self.arcs[there as usize] = Arc { head: edge.to, sister: back, residual: edge.capacity };
            self.arcs[back as usize] = Arc { head: edge.from, sister: there, residual: edge.reverse };
        }
        Ok(())
    }

    /// Every node with residual capacity at a terminal becomes a root of that terminal's tree.
    fn plant(&mut self, monitor: &Monitor) -> Result<()> {
        let mut looks = Looks::at(monitor);
        self.queue.clear();
        self.orphans.clear();
        for (i, node) in self.nodes.iter_mut().enumerate() {
            looks.step()?;
            if node.terminal != 0.0 {
                (node.parent, node.distance, node.in_sink_tree) = (TERMINAL, 1, node.terminal < 0.0);
                node.active = true;
                self.queue.push_back(i as u32);
            }
        }
        Ok(())
    }

    fn activate(&mut self, node: u32) {
        let slot = &mut self.nodes[node as usize];
        if !slot.active {
            slot.active = true;
            self.queue.push_back(node);
        }
    }

    fn next_active(&mut self) -> Option<u32> {
        while let Some(node) = self.queue.pop_front() {
            self.nodes[node as usize].active = false;
            if self.nodes[node as usize].parent != NONE {
                return Some(node);
            }
        }
        None
    }

    fn arcs_of(&self, node: u32) -> std::ops::Range<usize> {
        self.offsets[node as usize] as usize..self.offsets[node as usize + 1] as usize
    }

    /// Residual capacity of an arc between a node and its parent in a tree: towards the node in the source tree, away
    /// from it in the sink tree.
    fn residual_from_parent(&self, arc: u32, in_sink_tree: bool) -> f64 {
        let arc = self.arcs[arc as usize];
        if in_sink_tree { arc.residual } else { self.arcs[arc.sister as usize].residual }
    }
}

fn refused(what: &str, first: f64, second: f64) -> Error {
    Error::input(format!(
        "{what} with capacities {first} and {second} (allowed: different nodes of the network, capacities of 0 or more)"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    type Instance = (Vec<[f64; 2]>, Vec<(usize, usize, f64, f64)>);

    fn random_instance(seed: u64, nodes: usize, edges: usize) -> Instance {
        let mut random = stream(seed, 7);
        let mut draw = |bound: f64| (random.uniform() * bound).floor();
        let terminals = (0..nodes).map(|_| [draw(10.0), draw(10.0)]).collect();
        let edges = (0..edges)
            .filter_map(|_| {
                let (a, b) = (draw(nodes as f64) as usize, draw(nodes as f64) as usize);
                (a != b).then(|| (a, b, draw(8.0), draw(8.0)))
            })
            .collect();
        (terminals, edges)
    }

    fn load(network: &mut MaxFlow, (terminals, edges): &Instance) {
        network.reset(terminals.len());
        terminals.iter().enumerate().for_each(|(i, t)| network.add_terminals(i, t[0], t[1]).unwrap());
        edges.iter().for_each(|&(a, b, there, back)| network.add_edge(a, b, there, back).unwrap());
    }

    fn cut_value((terminals, edges): &Instance, source: impl Fn(usize) -> bool) -> f64 {
        let ends: f64 = terminals.iter().enumerate().map(|(i, t)| if source(i) { t[1] } else { t[0] }).sum();
        let across = edges.iter().map(|&(a, b, there, back)| match (source(a), source(b)) {
            (true, false) => there,
            (false, true) => back,
            _ => 0.0,
        });
        ends + across.sum::<f64>()
    }

    #[test]
    fn the_flow_is_the_smallest_of_all_cuts() {
        let mut network = MaxFlow::default();
        for seed in 0..300 {
            let nodes = 1 + (seed as usize % 10);
            let instance = random_instance(seed, nodes, 3 * nodes);
            load(&mut network, &instance);
            let flow = network.solve();
            let best =
                (0..1u32 << nodes).map(|set| cut_value(&instance, |i| set >> i & 1 == 1)).fold(f64::INFINITY, f64::min);
            assert_eq!(flow, best, "seed {seed}");
            assert_eq!(cut_value(&instance, |i| network.is_source(i)), best, "seed {seed}");
        }
    }

    #[test]
    fn the_source_side_is_the_smallest_one() {
        let mut network = MaxFlow::default();
        for seed in 0..100 {
            let instance = random_instance(seed, 8, 20);
            load(&mut network, &instance);
            let flow = network.solve();
            let side: u32 = (0..8).map(|i| u32::from(network.is_source(i)) << i).sum();
            let all = (0..1u32 << 8).filter(|set| cut_value(&instance, |i| set >> i & 1 == 1) == flow);
            assert!(all.into_iter().all(|set| set & side == side), "seed {seed}");
        }
    }

    /// Shortest augmenting paths on a capacity matrix: slow but simple.
    fn edmonds_karp((terminals, edges): &Instance) -> f64 {
        let n = terminals.len() + 2;
        let (source, sink) = (n - 2, n - 1);
        let mut residual = vec![vec![0.0; n]; n];
        for (i, t) in terminals.iter().enumerate() {
            (residual[source][i], residual[i][sink]) = (t[0], t[1]);
        }
        for &(a, b, there, back) in edges {
            residual[a][b] += there;
            residual[b][a] += back;
        }
        let mut flow = 0.0;
        loop {
            let mut parent = vec![usize::MAX; n];
            let mut queue = VecDeque::from([source]);
            while let Some(at) = queue.pop_front() {
                for to in 0..n {
                    if residual[at][to] > 0.0 && parent[to] == usize::MAX && to != source {
                        parent[to] = at;
                        queue.push_back(to);
                    }
                }
            }
            if parent[sink] == usize::MAX {
                return flow;
            }
            let path = || std::iter::successors(Some(sink), |&v| (parent[v] != source).then(|| parent[v]));
            let least = path().map(|v| residual[parent[v]][v]).fold(f64::INFINITY, f64::min);
            path().for_each(|v| {
                residual[parent[v]][v] -= least;
                residual[v][parent[v]] += least;
            });
            flow += least;
        }
    }

    #[test]
    fn larger_networks_agree_with_shortest_augmenting_paths() {
        let mut network = MaxFlow::default();
        for seed in 0..40 {
            let instance = random_instance(seed, 60, 300);
            load(&mut network, &instance);
            let flow = network.solve();
            assert_eq!(flow, edmonds_karp(&instance), "seed {seed}");
            assert_eq!(cut_value(&instance, |i| network.is_source(i)), flow, "seed {seed}");
        }
    }

    #[test]
    fn infinite_capacities_hold_nodes_together_and_at_their_terminal() {
        let mut network = MaxFlow::default();
        network.reset(3);
        network.add_terminals(0, f64::INFINITY, 2.0).unwrap();
        network.add_terminals(2, 0.0, 3.5).unwrap();
        network.add_edge(0, 1, f64::INFINITY, f64::INFINITY).unwrap();
        network.add_edge(1, 2, 1.0, 0.0).unwrap();
        assert_eq!(network.solve(), 3.0);
        assert!(network.is_source(0) && network.is_source(1) && !network.is_source(2));
    }

    #[test]
    fn nothing_and_nonsense() {
        let mut network = MaxFlow::default();
        network.reset(0);
        assert_eq!(network.solve(), 0.0);
        network.reset(2);
        assert!(network.add_edge(0, 0, 1.0, 1.0).is_err());
        assert!(network.add_edge(0, 2, 1.0, 1.0).is_err());
        assert!(network.add_edge(0, 1, -1.0, 1.0).is_err());
        assert!(network.add_terminals(0, f64::NAN, 1.0).is_err());
        assert!(network.add_terminals(0, f64::INFINITY, f64::INFINITY).is_err());
    }
}
