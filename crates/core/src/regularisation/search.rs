//! The labelling that a search improves, and when each node could last have changed its mind.

use super::reduce::Question;
use super::solve::Pieces;
use super::{Energy, Labelling};
use crate::error::Result;
use crate::graph::Adjacency;
use crate::parallel::Monitor;

/// A labelling on its way down, with the buffers of the moves.
pub(super) struct Search<'a> {
    pub(super) energy: Energy<'a>,
    pub(super) adjacency: Adjacency,
    pub(super) labels: Vec<u16>,
    pub(super) question: Question,
    pub(super) pieces: Pieces,
    /// How many nodes have each label.
    users: Vec<usize>,
    /// Moves offered so far, and that number when each node or a neighbour of it last changed.
    pub(super) now: u32,
    pub(super) changed: Vec<u32>,
}

impl<'a> Search<'a> {
    /// Begins where [`Energy::start`] says.
    pub(super) fn new(energy: Energy<'a>) -> Self {
        let labels = energy.start();
        Self {
            adjacency: energy.graph.adjacency(),
            users: energy.users(&labels),
            changed: vec![0; labels.len()],
            question: Question::default(),
            pieces: Pieces::default(),
            now: 0,
            energy,
            labels,
        }
    }

    /// Offers the moves `0..moves` in turn, `rounds` times at most, until each was offered once without effect.
    pub(super) fn run(
        mut self,
        moves: usize,
        rounds: usize,
        monitor: &Monitor,
        mut offer: impl FnMut(&mut Self, usize) -> Result<bool>,
    ) -> Result<Labelling> {
        let mut trace = vec![self.energy.of(&self.labels)];
        let mut idle = 0;
        monitor.stage("labels", rounds.saturating_mul(moves) as u64);
        for _ in 0..rounds {
            for number in 0..moves {
                monitor.check()?;
                self.now = self.now.saturating_add(1);
                idle = if offer(&mut self, number)? { 0 } else { idle + 1 };
                monitor.advance(1);
                if idle >= moves {
                    break;
                }
            }
            trace.push(self.energy.of(&self.labels));
            if idle >= moves {
                break;
            }
        }
        let energy = trace.last().copied().unwrap_or_default();
        Ok(Labelling { labels: self.labels, energy, trace, converged: idle >= moves })
    }

    /// Whether a node uses `label`.
    pub(super) fn is_used(&self, label: u16) -> bool {
        self.users[usize::from(label)] > 0
    }

    /// Gives nodes other labels if that lowers the energy; rounding must not send the search in circles.
    pub(super) fn apply(&mut self, moves: &[(u32, u16)]) -> bool {
        let before: Vec<u16> = moves.iter().map(|&(node, _)| self.labels[node as usize]).collect();
        let rise: f64 = moves.iter().map(|&(node, label)| self.change(node as usize, label)).sum();
        if rise >= 0.0 {
            for (&(node, label), old) in moves.iter().zip(before) {
                self.users[usize::from(label)] -= 1;
                self.users[usize::from(old)] += 1;
                self.labels[node as usize] = old;
            }
            return false;
        }
        for &(node, _) in moves {
            self.changed[node as usize] = self.now;
            self.adjacency.of(node as usize).for_each(|(other, _)| self.changed[other as usize] = self.now);
        }
        true
    }

    /// Gives a node another label and returns by how much the energy rises.
    fn change(&mut self, node: usize, label: u16) -> f64 {
        let old = std::mem::replace(&mut self.labels[node], label);
        let edges = self.adjacency.of(node).map(|(other, edge)| {
            let (edge, other) = (edge as usize, self.labels[other as usize]);
            self.energy.edge_cost(edge, label, other) - self.energy.edge_cost(edge, old, other)
        });
        let rise = self.energy.cost(node, label) - self.energy.cost(node, old) + edges.sum::<f64>();
        self.users[usize::from(old)] -= 1;
        let saved = if self.is_used(old) { 0.0 } else { self.energy.label_cost(old) };
        let paid = if self.is_used(label) { 0.0 } else { self.energy.label_cost(label) };
        self.users[usize::from(label)] += 1;
        rise + paid - saved
    }
}
