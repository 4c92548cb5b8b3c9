//! Augmentation: sends the bottleneck capacity along the path through the connecting arc; saturated arcs make orphans.

use super::{MaxFlow, ORPHAN, TERMINAL};

impl MaxFlow {
    pub(super) fn augment(&mut self, bridge: u32) {
        let (sink_end, sister) = (self.arcs[bridge as usize].head, self.arcs[bridge as usize].sister);
        let source_end = self.arcs[sister as usize].head;
        let sent = self.arcs[bridge as usize].residual.min(self.bottleneck(source_end)).min(self.bottleneck(sink_end));
        self.arcs[bridge as usize].residual -= sent;
        self.arcs[sister as usize].residual += sent;
        self.send(source_end, sent);
        self.send(sink_end, sent);
        self.flow += sent;
    }

    /// Least residual capacity between a node and its terminal.
    fn bottleneck(&self, mut node: u32) -> f64 {
        let mut least = f64::INFINITY;
        loop {
            let at = self.nodes[node as usize];
            if at.parent == TERMINAL {
                return least.min(at.terminal.abs());
            }
            least = least.min(self.residual_from_parent(at.parent, at.in_sink_tree));
            node = self.arcs[at.parent as usize].head;
        }
    }

    fn send(&mut self, mut node: u32, sent: f64) {
        loop {
            let at = self.nodes[node as usize];
            if at.parent == TERMINAL {
                let slot = &mut self.nodes[node as usize];
                slot.terminal += if at.in_sink_tree { sent } else { -sent };
                if slot.terminal == 0.0 {
                    self.orphan(node);
                }
                return;
            }
            let towards = at.parent as usize;
            let sister = self.arcs[towards].sister as usize;
            let (from, to) = if at.in_sink_tree { (towards, sister) } else { (sister, towards) };
            self.arcs[from].residual -= sent;
            self.arcs[to].residual += sent;
            if self.arcs[from].residual <= 0.0 {
                self.orphan(node);
            }
            node = self.arcs[towards].head;
        }
    }

    pub(super) fn orphan(&mut self, node: u32) {
        self.nodes[node as usize].parent = ORPHAN;
        self.orphans.push_back(node);
    }
}
