//! Adoption: an orphan takes a new parent in its tree with a path to the terminal, or becomes free.

use super::{MaxFlow, NONE, ORPHAN, TERMINAL};

impl MaxFlow {
    pub(super) fn adopt(&mut self) {
        self.time += 1;
        while let Some(node) = self.orphans.pop_front() {
            match self.nearest_parent(node) {
                Some((arc, distance)) => {
                    let slot = &mut self.nodes[node as usize];
                    (slot.parent, slot.stamp, slot.distance) = (arc, self.time, distance + 1);
                }
                None => self.release(node),
            }
        }
    }

    /// The arc to the neighbour in the same tree that is nearest to the terminal, and that neighbour's distance.
    fn nearest_parent(&mut self, node: u32) -> Option<(u32, u32)> {
        let in_sink_tree = self.nodes[node as usize].in_sink_tree;
        let mut best: Option<(u32, u32)> = None;
        for a in self.arcs_of(node) {
            if self.residual_from_parent(a as u32, in_sink_tree) <= 0.0 {
                continue;
            }
            let other = self.arcs[a].head;
            let state = self.nodes[other as usize];
            if state.in_sink_tree != in_sink_tree || state.parent == NONE {
                continue;
            }
            if let Some(distance) = self.distance_to_terminal(other)
                && best.is_none_or(|(_, least)| distance < least)
            {
                best = Some((a as u32, distance));
            }
        }
        best
    }

    /// Number of arcs to the terminal, or `None` if the path ends at an orphan. Distances on the path are stored with a
    /// time stamp.
    fn distance_to_terminal(&mut self, from: u32) -> Option<u32> {
        let (mut node, mut steps) = (from, 0);
        let end = loop {
            let at = self.nodes[node as usize];
            if at.stamp == self.time {
                break at.distance;
            }
            match at.parent {
                ORPHAN | NONE => return None,
                TERMINAL => {
                    let slot = &mut self.nodes[node as usize];
                    (slot.stamp, slot.distance) = (self.time, 1);
                    break 1;
                }
                parent => node = self.arcs[parent as usize].head,
            }
            steps += 1;
        };
        let (mut node, mut distance) = (from, end + steps);
        while self.nodes[node as usize].stamp != self.time {
            let slot = &mut self.nodes[node as usize];
            (slot.stamp, slot.distance) = (self.time, distance);
            distance -= 1;
            node = self.arcs[slot.parent as usize].head;
        }
        Some(end + steps)
    }

    /// Makes the node free; its children become orphans, neighbours that may adopt it later become active.
    fn release(&mut self, node: u32) {
        let in_sink_tree = self.nodes[node as usize].in_sink_tree;
        for a in self.arcs_of(node) {
            let arc = self.arcs[a];
            let other = self.nodes[arc.head as usize];
            if other.in_sink_tree != in_sink_tree || other.parent == NONE {
                continue;
            }
            if self.residual_from_parent(a as u32, in_sink_tree) > 0.0 {
                self.activate(arc.head);
            }
            if other.parent == arc.sister {
                self.orphan(arc.head);
            }
        }
        self.nodes[node as usize].parent = NONE;
    }
}
