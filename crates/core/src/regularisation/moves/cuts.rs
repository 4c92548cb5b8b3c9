//! Solves the open part of a move: one minimum cut for each connected component of open nodes.

use super::binary_move::{BinaryMove, State};
use crate::error::Result;
use crate::graph::MaxFlow;
use crate::parallel::{Held, Looks, map_ordered_with};
use crate::regularisation::energy::Problem;

/// Connected components of open nodes, in the order of their smallest node.
#[derive(Clone, Debug, Default)]
pub(in crate::regularisation) struct Components {
    nodes: Vec<u32>,
    starts: Vec<usize>,
    /// Position of each open node within its component.
    position: Vec<u32>,
}

impl Components {
    /// Collects the components with an affected node; for the others the last result is still valid. O(nodes + edges).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::regularisation) fn collect(&mut self, binary: &BinaryMove, problem: &Problem<'_>) -> Result<()> {
        let mut looks = Looks::at(problem.monitor);
        const UNSEEN: u32 = u32::MAX;
        self.position.clear();
        self.position.resize(binary.state.len(), UNSEEN);
        self.nodes.clear();
        self.starts.clear();
        for seed in 0..binary.state.len() {
            looks.step()?;
            if binary.state[seed] != State::Open || self.position[seed] != UNSEEN {
                continue;
            }
            let start = self.nodes.len();
            let mut wanted = false;
            self.position[seed] = 0;
            self.nodes.push(seed as u32);
            let mut next = start;
            while let Some(&node) = self.nodes.get(next) {
                next += 1;
                looks.step()?;
                wanted |= binary.affected[node as usize];
                for (other, _) in problem.adjacency.of(node as usize) {
                    let at = other as usize;
                    if binary.state[at] == State::Open && self.position[at] == UNSEEN {
                        self.position[at] = (self.nodes.len() - start) as u32;
                        self.nodes.push(other);
                    }
                }
            }
            if wanted { self.starts.push(start) } else { self.nodes.truncate(start) }
        }
        Ok(())
    }

    /// All nodes of all components.
    pub(in crate::regularisation) fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    fn component(&self, c: usize) -> &[u32] {
        let end = self.starts.get(c + 1).copied().unwrap_or(self.nodes.len());
        &self.nodes[self.starts[c]..end]
    }

    /// The nodes of all components that take the label in the minimum cut of their component.
    pub(in crate::regularisation) fn minimum_cuts(
        &self,
        binary: &BinaryMove,
        problem: &Problem<'_>,
    ) -> Result<Vec<u32>> {
        /// Components that one task solves.
        const BATCH: usize = 64;
        let network = || Held::new(MaxFlow::default(), problem.monitor);
        let work = |network: &mut Held<MaxFlow>, task: usize| {
            let mut taken = Vec::new();
            for c in task * BATCH..((task + 1) * BATCH).min(self.starts.len()) {
                self.build(network, self.component(c), binary, problem)?;
                network.solve_watched(problem.monitor)?;
                let component = self.component(c).iter().enumerate();
                taken.extend(component.filter(|(at, _)| network.is_source(*at) != binary.eager).map(|(_, &node)| node));
            }
            Ok(taken)
        };
        match self.starts.len().div_ceil(BATCH) {
            // Starting another thread takes longer than a few small cuts.
            0 => Ok(Vec::new()),
            1 => work(&mut network(), 0),
            tasks => Ok(map_ordered_with(0..tasks, problem.monitor, network, work)?.concat()),
        }
    }

    /// Builds the flow network of a component. The source side takes the label; the capacity of a node's terminal edge
    /// is |θ|. The solver returns the minimum cut with the smallest source side; if `eager`, the sides are exchanged,
    /// so that as few nodes as possible keep their label.
    fn build(
        &self,
        network: &mut MaxFlow,
        component: &[u32],
        binary: &BinaryMove,
        problem: &Problem<'_>,
    ) -> Result<()> {
        let mut looks = Looks::at(problem.monitor);
        network.reset(component.len());
        for (at, &node) in component.iter().enumerate() {
            looks.step()?;
            let theta = binary.theta[node as usize];
            let gain = if binary.eager { theta } else { -theta };
            network.add_terminals(at, gain.max(0.0), (-gain).max(0.0))?;
            for (other, edge) in problem.adjacency.of(node as usize) {
                let coupling = binary.coupling[edge as usize];
                if other > node && binary.state[other as usize] == State::Open && coupling > 0.0 {
                    network.add_edge(at, self.position[other as usize] as usize, coupling, coupling)?;
                }
            }
        }
        Ok(())
    }
}
