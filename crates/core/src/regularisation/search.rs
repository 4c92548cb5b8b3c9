//! The labelling that a search improves, and when each node could last have changed its mind.

use super::join::better_regions;
use super::reduce::Question;
use super::solve::Pieces;
use super::{Energy, Labelling};
use crate::error::Result;
use crate::graph::Adjacency;
use crate::parallel::{Looks, Monitor};

/// What came of an offer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Nobody wants to move.
    Nothing,
    /// The moves together do not lower the energy.
    Refused,
    Moved,
}

/// Moves that are offered again and again.
#[derive(Clone, Debug)]
pub(super) struct Moves {
    /// The number of the last offer of each move that was not refused; 0 if there was none.
    asked: Vec<u32>,
    /// Most rounds over all moves.
    rounds: usize,
}

impl Moves {
    pub(super) fn new(count: usize, rounds: usize) -> Self {
        Self { asked: vec![0; count], rounds }
    }
}

/// Asks about the move of a number; the last argument is the offer after which changes count.
pub(super) type Offer<'o, 'a> = dyn FnMut(&mut Search<'a>, usize, u32) -> Result<Outcome> + 'o;

/// A labelling on its way down, with the buffers of the moves.
pub(super) struct Search<'a> {
    pub(super) energy: Energy<'a>,
    pub(super) adjacency: &'a Adjacency,
    pub(super) labels: Vec<u16>,
    pub(super) question: Question,
    pub(super) pieces: Pieces,
    /// How many nodes have each label.
    users: Vec<usize>,
    /// Offers so far, and that number when each node or a neighbour of it last changed.
    now: u32,
    changed: Vec<u32>,
    /// Energy after each round, beginning with that of the start.
    trace: Vec<f64>,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        energy: Energy<'a>,
        adjacency: &'a Adjacency,
        start: Vec<u16>,
        monitor: &Monitor,
    ) -> Result<Self> {
        Ok(Self {
            adjacency,
            users: energy.users(&start),
            changed: vec![0; start.len()],
            question: Question::default(),
            pieces: Pieces::default(),
            now: 0,
            trace: vec![energy.of_watched(&start, monitor)?],
            energy,
            labels: start,
        })
    }

    pub(super) fn into_labelling(self, converged: bool) -> Labelling {
        let energy = self.trace.last().copied().unwrap_or_default();
        Labelling { labels: self.labels, energy, trace: self.trace, converged }
    }

    /// Makes an offer, which is told since when changes of nodes can give another answer than the last time.
    fn offer(
        &mut self,
        moves: &mut Moves,
        number: usize,
        monitor: &Monitor,
        offer: &mut Offer<'_, 'a>,
    ) -> Result<bool> {
        monitor.check()?;
        self.now = self.now.saturating_add(1);
        let outcome = offer(self, number, moves.asked[number])?;
        if outcome != Outcome::Refused {
            moves.asked[number] = self.now;
        }
        monitor.advance(1);
        Ok(outcome == Outcome::Moved)
    }

    /// Offers all moves in turn, until each was offered once without effect (true) or the rounds are used up.
    pub(super) fn in_turn(&mut self, moves: &mut Moves, monitor: &Monitor, offer: &mut Offer<'_, 'a>) -> Result<bool> {
        let count = moves.asked.len();
        monitor.stage("labels", moves.rounds.saturating_mul(count) as u64);
        let mut idle = 0;
        for _ in 0..moves.rounds {
            for number in 0..count {
                idle = if self.offer(moves, number, monitor, offer)? { 0 } else { idle + 1 };
                if idle >= count {
                    break;
                }
            }
            self.trace.push(self.energy.of_watched(&self.labels, monitor)?);
            if idle >= count {
                return Ok(true);
            }
        }
        Ok(idle >= count)
    }

    /// Offers moves in the order of gco: those that had an effect again, the others only when these are exhausted.
    pub(super) fn focused(&mut self, moves: &mut Moves, monitor: &Monitor, offer: &mut Offer<'_, 'a>) -> Result<bool> {
        let mut order: Vec<usize> = (0..moves.asked.len()).collect();
        monitor.stage("labels", moves.rounds.saturating_mul(order.len()) as u64);
        // Circles of moves, each a part of the one before; the innermost is gone through from `first`.
        let mut circles = vec![order.len()];
        let mut first = 0;
        for _ in 0..moves.rounds {
            let Some(&circle) = circles.last() else { break };
            let (mut next, mut end) = (first, circle);
            while next < end {
                if self.offer(moves, order[next], monitor, offer)? {
                    next += 1;
                } else {
                    end -= 1;
                    order.swap(next, end);
                }
            }
            self.trace.push(self.energy.of_watched(&self.labels, monitor)?);
            if end == first {
                circles.pop();
                first = circle;
            } else {
                first = 0;
                if end < circle / 2 {
                    circles.push(end);
                }
            }
        }
        Ok(circles.is_empty())
    }

    /// Takes over what is better in another labelling, region by region; true if there is something.
    pub(super) fn join(&mut self, other: &[u16], monitor: &Monitor) -> Result<bool> {
        self.now = self.now.saturating_add(1);
        let moves = better_regions(self, other, monitor)?;
        let moved = self.apply(&moves, monitor)? == Outcome::Moved;
        self.trace.push(self.energy.of_watched(&self.labels, monitor)?);
        Ok(moved)
    }

    /// Tells the next question which nodes changed, or have neighbours that did, after offer `since`.
    pub(super) fn refresh(&mut self, since: u32) {
        self.question.fresh.clear();
        self.question.fresh.extend(self.changed.iter().map(|changed| since == 0 || *changed > since));
    }

    /// Whether a node uses `label`.
    pub(super) fn is_used(&self, label: u16) -> bool {
        self.users[usize::from(label)] > 0
    }

    /// Gives nodes other labels if that lowers the energy; rounding must not send the search in circles.
    pub(super) fn apply(&mut self, moves: &[(u32, u16)], monitor: &Monitor) -> Result<Outcome> {
        if moves.is_empty() {
            return Ok(Outcome::Nothing);
        }
        let before: Vec<u16> = moves.iter().map(|&(node, _)| self.labels[node as usize]).collect();
        let (mut rise, mut looks) = (0.0, Looks::at(monitor));
        for &(node, label) in moves {
            looks.step()?;
            rise += self.change(node as usize, label);
        }
        if rise >= 0.0 {
            for (&(node, label), old) in moves.iter().zip(before) {
                self.users[usize::from(label)] -= 1;
                self.users[usize::from(old)] += 1;
                self.labels[node as usize] = old;
            }
            return Ok(Outcome::Refused);
        }
        for &(node, _) in moves {
            looks.step()?;
            self.changed[node as usize] = self.now;
            self.adjacency.of(node as usize).for_each(|(other, _)| self.changed[other as usize] = self.now);
        }
        Ok(Outcome::Moved)
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
