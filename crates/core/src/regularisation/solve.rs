//! What stays open after the reduction: pieces that do not touch each other, each answered by one smallest cut.

use super::reduce::{Question, State};
use crate::error::Result;
use crate::graph::{Adjacency, MaxFlow};
use crate::parallel::{Looks, Monitor, map_ordered_with};

/// Pieces of open nodes that hang together, in the order of their smallest node.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces {
    nodes: Vec<u32>,
    starts: Vec<usize>,
    /// Place of each open node within its piece.
    place: Vec<u32>,
}

impl Pieces {
    /// Collects the pieces that hold a fresh node. O(nodes + edges).
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

    /// All nodes of all pieces.
    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    fn piece(&self, p: usize) -> &[u32] {
        let end = self.starts.get(p + 1).copied().unwrap_or(self.nodes.len());
        &self.nodes[self.starts[p]..end]
    }

    /// Nodes of all pieces that take the label, if that lowers the energy of their piece.
    pub(super) fn answer(&self, question: &Question, adjacency: &Adjacency, monitor: &Monitor) -> Result<Vec<u32>> {
        /// Pieces that one task answers.
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
            // A thread that has to be woken costs more than a few small cuts.
            0 => Ok(Vec::new()),
            1 => work(&mut MaxFlow::default(), 0),
            tasks => Ok(map_ordered_with(0..tasks, monitor, MaxFlow::default, work)?.concat()),
        }
    }

    /// The source side takes the label: a node pays θ there, or gains -θ. Of all smallest cuts the one with the smallest source
    /// side is found: the eager want the smallest number of nodes that stay, so that these are the source side for them.
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
