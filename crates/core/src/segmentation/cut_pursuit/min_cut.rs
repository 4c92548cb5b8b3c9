//! Minimum cut of a segment in two: one structure for all cuts of a split, only the terminals change.
//!
//! Y. Boykov, V. Kolmogorov, *An experimental comparison of min-cut/max-flow algorithms for energy minimization in
//! vision*, IEEE PAMI 26(9), 2004: two search trees grow from the terminals, and what a saturated path leaves without a
//! parent is adopted again. Every path saturates one arc exactly (its residual becomes 0 by subtraction from itself),
//! so that no tolerance is needed in f64.

use crate::error::Result;
use crate::parallel::Monitor;
use std::collections::VecDeque;

/// No parent: the node is in no tree.
const FREE: u32 = u32::MAX;
/// The parent is the terminal itself.
const ROOT: u32 = u32::MAX - 1;
/// The parent was lost and none is found yet.
const ORPHAN: u32 = u32::MAX - 2;

#[derive(Clone, Copy)]
struct Arc {
    to: u32,
    sister: u32,
    residual: f64,
}

#[derive(Clone, Copy)]
struct Node {
    first: u32,
    /// Arc to the parent, or one of the marks above.
    parent: u32,
    /// Steps to the terminal, known at time `seen`.
    distance: u32,
    seen: u32,
    /// What is left of the terminal's capacity: from the source if positive, to the sink if negative.
    excess: f64,
    source: bool,
    active: bool,
}

/// Buffers for the cuts of one segment, reused from segment to segment.
#[derive(Default)]
pub(super) struct MinCut {
    nodes: Vec<Node>,
    arcs: Vec<Arc>,
    active: VecDeque<u32>,
    orphans: VecDeque<u32>,
    time: u32,
}

impl MinCut {
    /// Lays out `nodes` nodes and edges that may be cut in both directions. O(n + m).
    pub(super) fn build(&mut self, nodes: usize, edges: &[[u32; 2]]) {
        let empty = Node { first: 0, parent: FREE, distance: 0, seen: 0, excess: 0.0, source: false, active: false };
        self.nodes.clear();
        self.nodes.resize(nodes + 1, empty);
        for &end in edges.iter().flatten() {
            self.nodes[end as usize].first += 1;
        }
        let mut sum = 0;
        for node in &mut self.nodes {
            sum += node.first;
            node.first = sum;
        }
        self.arcs.clear();
        self.arcs.resize(2 * edges.len(), Arc { to: 0, sister: 0, residual: 0.0 });
        for &[a, b] in edges {
            let slots = [a, b].map(|end| {
                let first = &mut self.nodes[end as usize].first;
                *first -= 1;
                *first
            });
            self.arcs[slots[0] as usize] = Arc { to: b, sister: slots[1], residual: 0.0 };
            self.arcs[slots[1] as usize] = Arc { to: a, sister: slots[0], residual: 0.0 };
        }
    }

    /// Sides of the minimum cut: false on the source's side, the smallest such set.
    ///
    /// `preference[v]` is the cost of the sink's side minus that of the source's; `costs` are those of the edges in
    /// the order of [`MinCut::build`].
    pub(super) fn solve(
        &mut self,
        preference: impl Iterator<Item = f64>,
        (edges, costs): (&[[u32; 2]], &[f64]),
        monitor: &Monitor,
    ) -> Result<Vec<bool>> {
        self.reset(preference, edges, costs);
        let mut steps = 0u32;
        while let Some(&node) = self.active.front() {
            steps = steps.wrapping_add(1);
            if steps.is_multiple_of(4096) {
                monitor.check()?;
            }
            match self.grow(node) {
                Some(bridge) => {
                    self.augment(bridge);
                    self.adopt_orphans();
                }
                None => {
                    self.active.pop_front();
                    self.nodes[node as usize].active = false;
                }
            }
        }
        let nodes = self.nodes.split_last().map_or(&[][..], |(_, nodes)| nodes);
        Ok(nodes.iter().map(|node| node.parent == FREE || !node.source).collect())
    }

    fn reset(&mut self, preference: impl Iterator<Item = f64>, edges: &[[u32; 2]], costs: &[f64]) {
        self.active.clear();
        self.orphans.clear();
        self.time = 0;
        for (v, (node, excess)) in (0u32..).zip(self.nodes.iter_mut().zip(preference)) {
            let parent = if excess == 0.0 { FREE } else { ROOT };
            let active = parent == ROOT;
            *node = Node { parent, distance: 1, seen: 0, excess, source: excess > 0.0, active, ..*node };
            if active {
                self.active.push_back(v);
            }
        }
        // The layout filled every node's slots from the last to the first: walk the edges the same way.
        let mut next: Vec<u32> = self.nodes.iter().skip(1).map(|node| node.first).collect();
        for (&[a, b], &cost) in edges.iter().zip(costs) {
            for end in [a, b] {
                let slot = &mut next[end as usize];
                *slot -= 1;
                self.arcs[*slot as usize].residual = cost;
            }
        }
    }

    fn arcs_of(&self, node: u32) -> std::ops::Range<u32> {
        self.nodes[node as usize].first..self.nodes[node as usize + 1].first
    }

    /// Residual capacity in the direction of the flow if `arc` leads from a node of the tree to one further out.
    fn outward(&self, arc: Arc, source: bool) -> f64 {
        if source { arc.residual } else { self.arcs[arc.sister as usize].residual }
    }

    /// Adds the free neighbours of a node to its tree, until a bridge (an arc into the other tree) is met.
    fn grow(&mut self, node: u32) -> Option<u32> {
        let Node { parent, source, distance, seen, .. } = self.nodes[node as usize];
        if parent == FREE {
            return None;
        }
        for index in self.arcs_of(node) {
            let arc = self.arcs[index as usize];
            if self.outward(arc, source) <= 0.0 {
                continue;
            }
            let other = &mut self.nodes[arc.to as usize];
            if other.parent == FREE {
                (other.parent, other.source) = (arc.sister, source);
                (other.distance, other.seen) = (distance + 1, seen);
                if !other.active {
                    other.active = true;
                    self.active.push_back(arc.to);
                }
            } else if other.source != source {
                return Some(if source { index } else { arc.sister });
            } else if other.seen <= seen && other.distance > distance + 1 {
                (other.parent, other.distance, other.seen) = (arc.sister, distance + 1, seen);
            }
        }
        None
    }

    /// Sends as much as possible over the path through `bridge`.
    fn augment(&mut self, bridge: u32) {
        let Arc { to, sister, residual } = self.arcs[bridge as usize];
        let ends = [self.arcs[sister as usize].to, to];
        let mut amount = residual;
        for end in ends {
            let narrow = |cut: &Self, arc: u32, _| amount = amount.min(cut.arcs[arc as usize].residual);
            if let Some(excess) = self.walk(end, narrow, |excess| excess) {
                amount = amount.min(excess.abs());
            }
        }
        self.push(bridge, amount);
        for end in ends {
            self.send(end, amount);
        }
    }

    /// Visits the arcs in the direction of the flow between a node and its terminal; gives the terminal's excess.
    fn walk(&self, mut node: u32, mut visit: impl FnMut(&Self, u32, u32), root: impl Fn(f64) -> f64) -> Option<f64> {
        loop {
            let Node { parent, source, excess, .. } = self.nodes[node as usize];
            if parent >= ORPHAN {
                return (parent == ROOT).then(|| root(excess));
            }
            let arc = self.arcs[parent as usize];
            visit(self, if source { arc.sister } else { parent }, node);
            node = arc.to;
        }
    }

    fn push(&mut self, arc: u32, amount: f64) {
        let sister = self.arcs[arc as usize].sister;
        self.arcs[arc as usize].residual -= amount;
        self.arcs[sister as usize].residual += amount;
    }

    /// Moves `amount` along the path to the terminal and orphans what hangs on saturated arcs.
    fn send(&mut self, mut node: u32, amount: f64) {
        loop {
            let Node { parent, source, .. } = self.nodes[node as usize];
            if parent == ROOT {
                let excess = &mut self.nodes[node as usize].excess;
                *excess -= if source { amount } else { -amount };
                if *excess == 0.0 {
                    self.orphan(node);
                }
                return;
            }
            let Arc { to, sister, .. } = self.arcs[parent as usize];
            let along = if source { sister } else { parent };
            self.push(along, amount);
            if self.arcs[along as usize].residual <= 0.0 {
                self.orphan(node);
            }
            node = to;
        }
    }

    fn orphan(&mut self, node: u32) {
        self.nodes[node as usize].parent = ORPHAN;
        self.orphans.push_back(node);
    }

    fn adopt_orphans(&mut self) {
        self.time += 1;
        while let Some(node) = self.orphans.pop_front() {
            match self.best_parent(node) {
                Some((parent, distance)) => {
                    let orphan = &mut self.nodes[node as usize];
                    (orphan.parent, orphan.distance, orphan.seen) = (parent, distance, self.time);
                }
                None => self.release(node),
            }
        }
    }

    /// The neighbour of the same tree that is nearest to the terminal, if one has a way to it.
    fn best_parent(&mut self, node: u32) -> Option<(u32, u32)> {
        let source = self.nodes[node as usize].source;
        let mut best: Option<(u32, u32)> = None;
        for index in self.arcs_of(node) {
            let arc = self.arcs[index as usize];
            let inward = if source { self.arcs[arc.sister as usize].residual } else { arc.residual };
            let other = self.nodes[arc.to as usize];
            if inward <= 0.0 || other.parent == FREE || other.source != source {
                continue;
            }
            if let Some(distance) = self.distance_to_terminal(arc.to)
                && best.is_none_or(|(_, least)| distance + 1 < least)
            {
                best = Some((index, distance + 1));
            }
        }
        best
    }

    /// Steps from a node to its terminal, or nothing if an orphan stands between; remembers what it learns.
    fn distance_to_terminal(&mut self, start: u32) -> Option<u32> {
        let (mut node, mut steps) = (start, 0);
        let total = loop {
            let Node { parent, distance, seen, .. } = self.nodes[node as usize];
            if seen == self.time && parent != ORPHAN {
                break steps + distance;
            }
            match parent {
                ROOT => break steps + 1,
                ORPHAN | FREE => return None,
                arc => (node, steps) = (self.arcs[arc as usize].to, steps + 1),
            }
        };
        let (mut node, mut left) = (start, total);
        while self.nodes[node as usize].seen != self.time {
            let here = &mut self.nodes[node as usize];
            (here.seen, here.distance) = (self.time, left);
            left -= 1;
            match here.parent {
                ROOT => break,
                arc => node = self.arcs[arc as usize].to,
            }
        }
        Some(total)
    }

    /// Frees a node that no neighbour can adopt; its children become orphans, its neighbours may grow again.
    fn release(&mut self, node: u32) {
        let source = self.nodes[node as usize].source;
        self.nodes[node as usize].parent = FREE;
        for index in self.arcs_of(node) {
            let arc = self.arcs[index as usize];
            let inward = if source { self.arcs[arc.sister as usize].residual } else { arc.residual };
            let other = &mut self.nodes[arc.to as usize];
            if other.parent == FREE || other.source != source {
                continue;
            }
            if inward > 0.0 && !other.active {
                other.active = true;
                self.active.push_back(arc.to);
            }
            if other.parent == arc.sister {
                self.orphan(arc.to);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn cost(sides: impl Fn(usize) -> bool, preference: &[f64], (edges, costs): (&[[u32; 2]], &[f64])) -> f64 {
        let unary: f64 = (0..preference.len()).filter(|&v| sides(v)).map(|v| preference[v]).sum();
        let cut = edges.iter().zip(costs).filter(|(e, _)| sides(e[0] as usize) != sides(e[1] as usize));
        unary + cut.map(|(_, c)| c).sum::<f64>()
    }

    #[test]
    fn no_other_sides_of_a_small_graph_cost_less() {
        let mut cut = MinCut::default();
        for seed in 0..400 {
            let mut random = stream(seed, 0);
            let n = 2 + random.below(10);
            let preference: Vec<f64> = (0..n).map(|_| random.below(9) as f64 - 4.0).collect();
            let all = (0..n as u32).flat_map(|b| (0..b).map(move |a| [a, b]));
            let edges: Vec<[u32; 2]> = all.filter(|_| random.below(3) == 0).collect();
            let costs: Vec<f64> = edges.iter().map(|_| random.below(5) as f64).collect();
            cut.build(n, &edges);
            let problem = (&edges[..], &costs[..]);
            let sides = cut.solve(preference.iter().copied(), problem, &Monitor::default()).unwrap();
            let found = cost(|v| sides[v], &preference, problem);
            let values = (0..1u32 << n).map(|set| cost(|v| set >> v & 1 == 1, &preference, problem));
            assert_eq!(found, values.fold(f64::INFINITY, f64::min), "seed {seed}");
            // The smallest source set: no optimum has fewer nodes there.
            let fewest = (0..1u32 << n)
                .filter(|set| cost(|v| set >> v & 1 == 1, &preference, problem) == found)
                .map(|set| n as u32 - set.count_ones())
                .min();
            assert_eq!(fewest, Some(sides.iter().filter(|s| !**s).count() as u32), "seed {seed}");
            let again = cut.solve(preference.iter().copied(), problem, &Monitor::default()).unwrap();
            assert_eq!(sides, again);
        }
    }
}
