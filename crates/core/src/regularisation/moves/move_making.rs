//! Move-making search: a labelling, the moves that are tried on it, and for each node the last move that changed it or a
//! neighbour.

use super::binary_move::BinaryMove;
use super::cuts::Components;
use crate::error::Result;
use crate::parallel::{Held, Looks};
use crate::regularisation::Labelling;
use crate::regularisation::energy::Problem;

/// Result of a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::regularisation) enum Outcome {
    /// No node changes.
    Nothing,
    /// The changes together do not lower the energy.
    Refused,
    Moved,
}

/// A set of moves (expansions or swaps) that a search repeats.
#[derive(Clone, Debug)]
pub(in crate::regularisation) struct Moves {
    /// For each move the number of its last attempt that was not refused; 0 if there was none.
    attempted: Vec<u32>,
    /// Largest number of rounds over all moves.
    rounds: usize,
}

impl Moves {
    pub(in crate::regularisation) fn new(count: usize, rounds: usize) -> Self {
        Self { attempted: vec![0; count], rounds }
    }
}

/// Tries the move of a number; the last argument is its last attempt: nodes unchanged since then are skipped.
pub(super) type Attempt<'o, 'a> = dyn FnMut(&mut MoveMaking<'a>, usize, u32) -> Result<Outcome> + 'o;

/// A labelling during the search, with the buffers of the moves.
pub(in crate::regularisation) struct MoveMaking<'a> {
    pub(in crate::regularisation) problem: Problem<'a>,
    pub(in crate::regularisation) labels: Vec<u16>,
    pub(in crate::regularisation) binary: Held<BinaryMove>,
    pub(in crate::regularisation) components: Held<Components>,
    /// Number of nodes with each label.
    users: Vec<usize>,
    /// Number of moves so far, and that number when each node or a neighbour of it last changed.
    now: u32,
    changed: Vec<u32>,
    /// Energy after each round, beginning with the initial labelling.
    trace: Vec<f64>,
}

impl<'a> MoveMaking<'a> {
    /// From an initial labelling.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::regularisation) fn new(problem: Problem<'a>, initial: Vec<u16>) -> Result<Self> {
        Ok(Self {
            users: problem.energy.users(&initial),
            changed: vec![0; initial.len()],
            binary: Held::new(BinaryMove::default(), problem.monitor),
            components: Held::new(Components::default(), problem.monitor),
            now: 0,
            trace: vec![problem.energy.of_watched(&initial, problem.monitor)?],
            problem,
            labels: initial,
        })
    }

    pub(in crate::regularisation) fn into_labelling(self, converged: bool) -> Labelling {
        let energy = self.trace.last().copied().unwrap_or_default();
        Labelling { labels: self.labels, energy, trace: self.trace, converged }
    }

    /// Tries a move; nodes around which nothing has changed since its last attempt are skipped.
    fn attempt(&mut self, moves: &mut Moves, number: usize, attempt: &mut Attempt<'_, 'a>) -> Result<bool> {
        self.problem.monitor.check()?;
        self.begin_move();
        let outcome = attempt(self, number, moves.attempted[number])?;
        if outcome != Outcome::Refused {
            moves.attempted[number] = self.now;
        }
        self.problem.monitor.advance(1);
        Ok(outcome == Outcome::Moved)
    }

    /// Repeats all moves in turn until each had no effect once (true) or the largest number of rounds is reached.
    pub(in crate::regularisation) fn in_turn(
        &mut self,
        moves: &mut Moves,
        attempt: &mut Attempt<'_, 'a>,
    ) -> Result<bool> {
        let count = moves.attempted.len();
        self.problem.monitor.stage("labels", moves.rounds.saturating_mul(count) as u64);
        let mut idle = 0;
        for _ in 0..moves.rounds {
            for number in 0..count {
                idle = if self.attempt(moves, number, attempt)? { 0 } else { idle + 1 };
                if idle >= count {
                    break;
                }
            }
            self.record_energy()?;
            if idle >= count {
                return Ok(true);
            }
        }
        Ok(idle >= count)
    }

    /// Repeats moves in the adaptive order of gco: those that had an effect again, the others only when these are
    /// exhausted.
    pub(in crate::regularisation) fn focused(
        &mut self,
        moves: &mut Moves,
        attempt: &mut Attempt<'_, 'a>,
    ) -> Result<bool> {
        let mut order: Vec<usize> = (0..moves.attempted.len()).collect();
        self.problem.monitor.stage("labels", moves.rounds.saturating_mul(order.len()) as u64);
        // Nested sets of moves, each a prefix of the one before; the innermost is worked through from `first`.
        let mut circles = vec![order.len()];
        let mut first = 0;
        for _ in 0..moves.rounds {
            let Some(&circle) = circles.last() else { break };
            let (mut next, mut end) = (first, circle);
            while next < end {
                if self.attempt(moves, order[next], attempt)? {
                    next += 1;
                } else {
                    end -= 1;
                    order.swap(next, end);
                }
            }
            self.record_energy()?;
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

    /// Counts one more move.
    pub(super) fn begin_move(&mut self) {
        self.now = self.now.saturating_add(1);
    }

    /// Appends the energy of the labelling to the trace.
    pub(super) fn record_energy(&mut self) -> Result<()> {
        self.trace.push(self.problem.energy.of_watched(&self.labels, self.problem.monitor)?);
        Ok(())
    }

    /// Marks for the next move which nodes, or neighbours of them, changed after attempt `since`.
    pub(in crate::regularisation) fn mark_affected(&mut self, since: u32) {
        self.binary.affected.clear();
        self.binary.affected.extend(self.changed.iter().map(|changed| since == 0 || *changed > since));
    }

    /// Whether any node has `label`.
    pub(in crate::regularisation) fn is_used(&self, label: u16) -> bool {
        self.users[usize::from(label)] > 0
    }

    /// Changes labels if that lowers the energy; the check prevents endless loops by rounding.
    pub(in crate::regularisation) fn apply(&mut self, moves: &[(u32, u16)]) -> Result<Outcome> {
        if moves.is_empty() {
            return Ok(Outcome::Nothing);
        }
        let before: Vec<u16> = moves.iter().map(|&(node, _)| self.labels[node as usize]).collect();
        let (mut rise, mut looks) = (0.0, Looks::at(self.problem.monitor));
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
            self.problem.adjacency.of(node as usize).for_each(|(other, _)| self.changed[other as usize] = self.now);
        }
        Ok(Outcome::Moved)
    }

    /// Changes the label of a node and returns the change of the energy.
    fn change(&mut self, node: usize, label: u16) -> f64 {
        let old = std::mem::replace(&mut self.labels[node], label);
        let edges = self.problem.adjacency.of(node).map(|(other, edge)| {
            let (edge, other) = (edge as usize, self.labels[other as usize]);
            self.problem.energy.edge_cost(edge, label, other) - self.problem.energy.edge_cost(edge, old, other)
        });
        let rise = self.problem.energy.cost(node, label) - self.problem.energy.cost(node, old) + edges.sum::<f64>();
        self.users[usize::from(old)] -= 1;
        let saved = if self.is_used(old) { 0.0 } else { self.problem.energy.label_cost(old) };
        let paid = if self.is_used(label) { 0.0 } else { self.problem.energy.label_cost(label) };
        self.users[usize::from(label)] += 1;
        rise + paid - saved
    }
}
