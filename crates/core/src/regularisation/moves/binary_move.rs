//! A binary move (expansion or swap) as a two-label energy, reduced to the nodes whose decision is not determined
//! locally.
//!
//! With x = 1 for "takes α", the pairwise terms are symmetric up to unary terms, `E(x) = Σ θ_i x_i + Σ c_ij |x_i -
//! x_j|`. For an edge whose ends have labels `a` and `b`, with A = V(a, b), B = V(a, α), C = V(α, b): c = (B + C -
//! A)/2, and (C - A - B)/2 and (B - A - C)/2 are added to θ of its ends.
//!
//! A node with |θ| larger than the sum of its c has the same decision for any decisions of its neighbours: it is
//! settled. Removing it changes θ of its neighbours, which may settle them too. Most nodes of a point cloud are settled
//! in this way, and the open ones form small components.

use crate::error::Result;
use crate::graph::Adjacency;
use crate::parallel::{Looks, Monitor, resize_watched, watched};
use crate::regularisation::energy::Problem;

/// Decision of a node in a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::regularisation) enum State {
    Open,
    /// Keeps its label.
    Stays,
    /// Takes the new label.
    Takes,
}

/// A binary move; its buffers are reused from label to label.
#[derive(Clone, Debug, Default)]
pub(in crate::regularisation) struct BinaryMove {
    pub(in crate::regularisation) theta: Vec<f64>,
    /// Sum of c over the edges to open neighbours.
    pub(in crate::regularisation) slack: Vec<f64>,
    pub(in crate::regularisation) state: Vec<State>,
    /// c of each edge.
    pub(in crate::regularisation) coupling: Vec<f64>,
    /// Whether the decision of a node may differ from that in the last move to the same label: the node or a neighbour
    /// has changed since, or a neighbour that was settled is itself marked.
    pub(in crate::regularisation) affected: Vec<bool>,
    settled: Vec<u32>,
    /// Choice between equal cuts: if true, nodes take the label.
    pub(in crate::regularisation) eager: bool,
    /// Number of the first auxiliary node (label costs).
    pub(in crate::regularisation) first_auxiliary: usize,
}

impl BinaryMove {
    /// Sets up the expansion of `alpha` and settles nodes; the adjacency may have auxiliary nodes. O(nodes + edges).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::regularisation) fn set_expansion(
        &mut self,
        problem: &Problem<'_>,
        labels: &[u16],
        alpha: u16,
    ) -> Result<()> {
        self.set_nodes(problem, labels, alpha)?;
        self.set_edges(problem, labels, alpha)?;
        if problem.adjacency.offsets.len() > labels.len() + 1 {
            self.add_auxiliary_nodes(&problem.energy, labels, alpha);
        }
        self.first_auxiliary = labels.len();
        self.reduce(problem.adjacency, problem.monitor)
    }

    /// Sets up the swap of `alpha` and `beta`: `Takes` means `alpha`, `Stays` means `beta`; nodes of other labels take
    /// no part.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::regularisation) fn set_swap(
        &mut self,
        problem: &Problem<'_>,
        labels: &[u16],
        [alpha, beta]: [u16; 2],
    ) -> Result<()> {
        let (energy, monitor) = (&problem.energy, problem.monitor);
        let mut looks = Looks::at(monitor);
        let inside = |node: usize| labels[node] == alpha || labels[node] == beta;
        let difference = |i: usize| if inside(i) { energy.cost(i, alpha) - energy.cost(i, beta) } else { 0.0 };
        self.theta.clear();
        self.state.clear();
        for piece in watched(labels.len(), monitor) {
            let piece = piece?;
            self.theta.extend(piece.clone().map(difference));
            self.state.extend(piece.map(|i| if inside(i) { State::Open } else { State::Stays }));
        }
        self.clear_edges(problem, labels.len())?;
        for (e, &[i, j]) in energy.graph.edges().iter().enumerate() {
            let (i, j) = (i as usize, j as usize);
            looks.step()?;
            let gain = |label| energy.edge_cost(e, alpha, label) - energy.edge_cost(e, beta, label);
            match (inside(i), inside(j)) {
                (true, true) => {
                    self.coupling[e] = energy.edge_cost(e, alpha, beta);
                    self.slack[i] += self.coupling[e];
                    self.slack[j] += self.coupling[e];
                }
                (true, false) => self.theta[i] += gain(labels[j]),
                (false, true) => self.theta[j] += gain(labels[i]),
                (false, false) => {}
            }
        }
        self.first_auxiliary = labels.len();
        self.reduce(problem.adjacency, monitor)
    }

    /// Nodes in this state; after the reduction the settled ones.
    pub(in crate::regularisation) fn settled(&self, state: State) -> impl Iterator<Item = u32> + '_ {
        self.state.iter().enumerate().filter(move |(_, s)| **s == state).map(|(node, _)| node as u32)
    }

    pub(in crate::regularisation) fn reduce(&mut self, adjacency: &Adjacency, monitor: &Monitor) -> Result<()> {
        let mut looks = Looks::at(monitor);
        self.settled.clear();
        for node in 0..self.state.len() {
            looks.step()?;
            self.settle(node);
        }
        while let Some(node) = self.settled.pop() {
            looks.step()?;
            self.tell_neighbours(node as usize, adjacency);
        }
        Ok(())
    }

    fn set_nodes(&mut self, problem: &Problem<'_>, labels: &[u16], alpha: u16) -> Result<()> {
        let energy = &problem.energy;
        self.theta.clear();
        self.state.clear();
        for piece in watched(labels.len(), problem.monitor) {
            let piece = piece?;
            self.theta.extend(piece.clone().map(|i| energy.cost(i, alpha) - energy.cost(i, labels[i])));
            // A node that already has α is settled as `Takes`; `set_edges` has its edges in favour of α.
            self.state.extend(piece.map(|i| if labels[i] == alpha { State::Takes } else { State::Open }));
        }
        Ok(())
    }

    pub(in crate::regularisation) fn clear_edges(&mut self, problem: &Problem<'_>, nodes: usize) -> Result<()> {
        self.slack.clear();
        resize_watched(&mut self.slack, nodes, &0.0, problem.monitor)?;
        self.coupling.clear();
        resize_watched(&mut self.coupling, problem.energy.graph.edges().len(), &0.0, problem.monitor)
    }

    fn set_edges(&mut self, problem: &Problem<'_>, labels: &[u16], alpha: u16) -> Result<()> {
        let energy = &problem.energy;
        let mut looks = Looks::at(problem.monitor);
        self.clear_edges(problem, labels.len())?;
        for (e, &[i, j]) in energy.graph.edges().iter().enumerate() {
            let (i, j) = (i as usize, j as usize);
            let (a, b) = (labels[i], labels[j]);
            looks.step()?;
            let there = energy.edge_cost(e, alpha, b);
            let back = energy.edge_cost(e, a, alpha);
            match (a == alpha, b == alpha) {
                (true, true) => {}
                (true, false) => self.theta[j] -= there,
                (false, true) => self.theta[i] -= back,
                (false, false) => {
                    let now = energy.edge_cost(e, a, b);
                    let coupling = (0.5 * (back + there - now)).max(0.0);
                    self.coupling[e] = coupling;
                    self.theta[i] += 0.5 * (there - now - back);
                    self.theta[j] += 0.5 * (back - now - there);
                    self.slack[i] += coupling;
                    self.slack[j] += coupling;
                }
            }
        }
        Ok(())
    }

    fn settle(&mut self, node: usize) {
        if self.state[node] != State::Open {
            return;
        }
        let (theta, slack) = (self.theta[node], self.slack[node]);
        let (stays, takes) = match self.eager {
            true => (theta > slack, theta <= -slack),
            false => (theta >= slack, theta < -slack),
        };
        self.state[node] = match (stays, takes) {
            (true, _) => State::Stays,
            (_, true) => State::Takes,
            _ => return,
        };
        self.settled.push(node as u32);
    }

    fn tell_neighbours(&mut self, node: usize, adjacency: &Adjacency) {
        let sign = if self.state[node] == State::Stays { 1.0 } else { -1.0 };
        for (neighbour, edge) in adjacency.of(node) {
            let neighbour = neighbour as usize;
            if self.state[neighbour] == State::Open {
                let coupling = self.coupling[edge as usize];
                self.theta[neighbour] += sign * coupling;
                self.slack[neighbour] -= coupling;
                self.affected[neighbour] |= self.affected[node];
                let auxiliary = neighbour >= self.first_auxiliary;
                if auxiliary && self.state[node] == State::Stays {
                    // A node keeps the label: rounding must not make the label disappear.
                    self.state[neighbour] = State::Stays;
                    self.settled.push(neighbour as u32);
                }
                self.settle(neighbour);
            }
        }
    }
}
