//! Growth: an active node takes free neighbours into its tree, until it touches the other tree.

use super::{MaxFlow, NONE};

impl MaxFlow {
    /// Returns the arc, directed from the source tree to the sink tree, where the trees touch.
    pub(super) fn grow(&mut self, node: u32) -> Option<u32> {
        let own = self.nodes[node as usize];
        for a in self.arcs_of(node) {
            let arc = self.arcs[a];
            let residual = if own.in_sink_tree { self.arcs[arc.sister as usize].residual } else { arc.residual };
            if residual <= 0.0 {
                continue;
            }
            let other = &mut self.nodes[arc.head as usize];
            if other.parent == NONE {
                other.in_sink_tree = own.in_sink_tree;
                (other.parent, other.stamp, other.distance) = (arc.sister, own.stamp, own.distance + 1);
                self.activate(arc.head);
            } else if other.in_sink_tree != own.in_sink_tree {
                // The node may touch the other tree again: it stays active.
                self.activate(node);
                return Some(if own.in_sink_tree { arc.sister } else { a as u32 });
            } else if other.stamp <= own.stamp && other.distance > own.distance + 1 {
                // A shorter path to the root.
                (other.parent, other.stamp, other.distance) = (arc.sister, own.stamp, own.distance + 1);
            }
        }
        None
    }
}
