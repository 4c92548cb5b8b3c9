//! Solves the open part of a move: one minimum cut for each connected component of open nodes.

use super::reduce::{Question, State};
use crate::error::Result;
use crate::graph::{Adjacency, MaxFlow};
use crate::parallel::{Looks, Monitor, map_ordered_with};

/// Connected components of open nodes, in the order of their smallest node.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces {
    nodes: Vec<u32>,
    starts: Vec<usize>,
    /// Position of each open node within its component.
    place: Vec<u32>,
}

impl Pieces {
    /// Collects the components with a fresh node; in the others the last result still holds. O(nodes + edges).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn collect(&mut self, question: &Question, adjacency: &Adjacency, monitor: &Monitor) -> Result<()> {
        let mut looks = Looks::at(monitor);
        const UNSEEN: u32 = u32::MAX;
        self.place.clear();
        self.place.resize(question.state.len(), UNSEEN);
        self.nodes.clear();
        self.starts.clear();
        for seed in 0..question.state.len() {
            looks.step()?;
            if question.state[seed] != State::Open || self.place[seed] != UNSEEN {
                continue;
            }
            let start = self.nodes.len();
            let mut wanted = false;
            self.place[seed] = 0;
            self.nodes.push(seed as u32);
            let mut next = start;
            while let Some(&node) = self.nodes.get(next) {
                next += 1;
                looks.step()?;
                wanted |= question.fresh[node as usize];
                for (other, _) in adjacency.of(node as usize) {
                    let at = other as usize;
                    if question.state[at] == State::Open && self.place[at] == UNSEEN {
                        self.place[at] = (self.nodes.len() - start) as u32;
                        self.nodes.push(other);
                    }
                }
            }
            if wanted { self.starts.push(start) } else { self.nodes.truncate(start) }
        }
        Ok(())
    }

    /// All nodes of all components.
    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    fn piece(&self, p: usize) -> &[u32] {
        let end = self.starts.get(p + 1).copied().unwrap_or(self.nodes.len());
        &self.nodes[self.starts[p]..end]
    }

    /// The nodes of all components that take the label in the minimum cut of their component.
    pub(super) fn answer(&self, question: &Question, adjacency: &Adjacency, monitor: &Monitor) -> Result<Vec<u32>> {
        /// Components that one task solves.
        const BATCH: usize = 64;
        let work = |network: &mut MaxFlow, task: usize| {
            let mut taken = Vec::new();
            for p in task * BATCH..((task + 1) * BATCH).min(self.starts.len()) {
                self.ask((self.piece(p), question), adjacency, network, monitor)?;
                network.solve_watched(monitor)?;
                let piece = self.piece(p).iter().enumerate();
                taken.extend(piece.filter(|(at, _)| network.is_source(*at) != question.eager).map(|(_, &node)| node));
            }
            Ok(taken)
        };
        match self.starts.len().div_ceil(BATCH) {
            // Waking another thread costs more than a few small cuts.
            0 => Ok(Vec::new()),
            1 => work(&mut MaxFlow::default(), 0),
            tasks => Ok(map_ordered_with(0..tasks, monitor, MaxFlow::default, work)?.concat()),
        }
    }

    /// Builds the flow network. The source side takes the label: such a node pays θ, or gains -θ. The solver returns
    /// the minimum cut with the smallest source side; if `eager`, the sides are exchanged, so that as few nodes as
    /// possible keep their label.
    fn ask(
        &self,
        (piece, question): (&[u32], &Question),
        adjacency: &Adjacency,
        network: &mut MaxFlow,
        monitor: &Monitor,
    ) -> Result<()> {
        let mut looks = Looks::at(monitor);
        network.reset(piece.len());
        for (at, &node) in piece.iter().enumerate() {
            looks.step()?;
            let theta = question.theta[node as usize];
            let gain = if question.eager { theta } else { -theta };
            network.add_terminals(at, gain.max(0.0), (-gain).max(0.0))?;
            for (other, edge) in adjacency.of(node as usize) {
                let coupling = question.coupling[edge as usize];
                if other > node && question.state[other as usize] == State::Open && coupling > 0.0 {
                    network.add_edge(at, self.place[other as usize] as usize, coupling, coupling)?;
                }
            }
        }
        Ok(())
    }
}
