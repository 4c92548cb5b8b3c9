//! Label costs: one auxiliary node for each label that may disappear, with an edge to every node of that label.
//!
//! A. Delong, A. Osokin, H. N. Isack, Y. Boykov, *Fast approximate energy minimization with label costs*, IJCV 96,
//! 2012. If every node of label k takes α, the cost h of k is saved. With the auxiliary variable y = 1 for "k
//! disappears", this is the minimum over y of `h (1 - y) + Σ_i h y (1 - x_i)`, where `y (1 - x) = (y - x + |y - x|)/2`:
//! edges of weight h/2 from the auxiliary node to the nodes of k. The cost of α itself, if no node has it yet, does not
//! depend on which nodes move: the move is accepted only if it saves more than that.

use super::binary_move::{BinaryMove, State};
use super::move_making::MoveMaking;
use crate::error::Result;
use crate::graph::Adjacency;
use crate::parallel::Looks;
use crate::regularisation::Energy;

/// The auxiliary node of `label`, if the move may remove the label from all nodes; auxiliary nodes are numbered after
/// those of the graph.
fn auxiliary_node(energy: &Energy<'_>, label: u16, alpha: u16) -> Option<usize> {
    (label != alpha && energy.label_cost(label) > 0.0).then_some(energy.graph.len() + usize::from(label))
}

/// The adjacency with auxiliary nodes, or `None` if no label has a cost. The edge from a node to its auxiliary node has
/// the number of the node plus the number of the graph's edges. O(nodes + edges).
///
/// # Errors
/// If the work was cancelled.
pub(in crate::regularisation) fn adjacency(search: &MoveMaking<'_>, alpha: u16) -> Result<Option<Adjacency>> {
    let problem = &search.problem;
    let energy = &problem.energy;
    if energy.label_costs.iter().all(|cost| *cost == 0.0) {
        return Ok(None);
    }
    let (nodes, edges) = (energy.graph.len(), energy.graph.edges().len());
    let mut out = Adjacency { offsets: vec![0], ..Adjacency::default() };
    let mut members = vec![Vec::new(); energy.labels];
    let mut looks = Looks::at(problem.monitor);
    for (node, &label) in search.labels.iter().enumerate() {
        looks.step()?;
        for (other, edge) in problem.adjacency.of(node) {
            out.neighbours.push(other);
            out.edges.push(edge);
        }
        if let Some(auxiliary) = auxiliary_node(energy, label, alpha) {
            out.neighbours.push(auxiliary as u32);
            out.edges.push((edges + node) as u32);
            members[auxiliary - nodes].push(node as u32);
        }
        out.offsets.push(out.neighbours.len());
    }
    for nodes_of_label in members {
        out.edges.extend(nodes_of_label.iter().map(|node| (edges + *node as usize) as u32));
        out.neighbours.extend(nodes_of_label);
        out.offsets.push(out.neighbours.len());
    }
    Ok(Some(out))
}

impl BinaryMove {
    /// Adds the auxiliary nodes to the move to `alpha`. O(nodes).
    pub(super) fn add_auxiliary_nodes(&mut self, energy: &Energy<'_>, labels: &[u16], alpha: u16) {
        let nodes = labels.len();
        self.slack.resize(nodes + energy.labels, 0.0);
        self.affected.resize(nodes + energy.labels, true);
        self.coupling.resize(self.coupling.len() + nodes, 0.0);
        let first = self.coupling.len() - nodes;
        for label in 0..energy.labels as u16 {
            let open = auxiliary_node(energy, label, alpha).is_some();
            self.theta.push(if open { -energy.label_cost(label) } else { 0.0 });
            self.state.push(if open { State::Open } else { State::Stays });
        }
        for (node, &label) in labels.iter().enumerate() {
            if let Some(auxiliary) = auxiliary_node(energy, label, alpha) {
                let half = 0.5 * energy.label_cost(label);
                self.coupling[first + node] = half;
                self.theta[node] -= half;
                self.theta[auxiliary] += half;
                self.slack[node] += half;
                self.slack[auxiliary] += half;
            }
        }
    }
}
