//! A choice of candidates whose energy is known after each change.

use super::Field;

/// A choice that can be changed one candidate at a time in O(1).
#[derive(Debug)]
pub(super) struct State<'a> {
    field: &'a Field,
    pub(super) active: Vec<bool>,
    /// Number of active candidates at each seed.
    count: Vec<u32>,
    /// Exclusive or of the numbers of these candidates: of a single one, its number.
    mixed: Vec<u32>,
}

impl<'a> State<'a> {
    pub(super) fn new(field: &'a Field, active: Vec<bool>) -> Self {
        let mut state =
            Self { field, active: vec![false; active.len()], count: vec![0; field.seeds], mixed: vec![0; field.seeds] };
        for (i, _) in active.iter().enumerate().filter(|(_, active)| **active) {
            state.put(i);
        }
        state
    }

    /// Changes a candidate; returns by how much the energy rises.
    pub(super) fn flip(&mut self, i: usize) -> f64 {
        let [start, end] = self.field.ends[i];
        let [first, second] = [start, end].map(|seed| self.dependent(i, seed));
        let second = second.filter(|_| second != first);
        let all = |state: &Self| [Some(i), first, second].into_iter().flatten().map(|at| state.own(at)).sum::<f64>();
        let before = all(self);
        self.put(i);
        all(self) - before
    }

    /// Changes a candidate without asking for its energy.
    fn put(&mut self, i: usize) {
        self.active[i] = !self.active[i];
        for seed in self.field.ends[i].map(|seed| seed as usize) {
            self.mixed[seed] ^= i as u32;
            match self.active[i] {
                true => self.count[seed] += 1,
                false => self.count[seed] -= 1,
            }
        }
    }

    /// The other candidate that goes on at a seed only because of candidate `i`, or would: the only other active one.
    fn dependent(&self, i: usize, seed: u32) -> Option<usize> {
        let (count, mixed) = (self.count[seed as usize], self.mixed[seed as usize]);
        match self.active[i] {
            true if count == 2 => Some((mixed ^ i as u32) as usize),
            false if count == 1 => Some(mixed as usize),
            _ => None,
        }
    }

    /// The terms of the energy that belong to a candidate.
    fn own(&self, i: usize) -> f64 {
        let active = self.active[i];
        let goes_on = |seed: u32| self.count[seed as usize] > 1;
        let prior = if active { self.field.prior(self.field.ends[i].map(goes_on)) } else { 0.0 };
        self.field.costs[i][usize::from(active)] + prior
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::random;
    use super::*;
    use crate::random::stream;

    #[test]
    fn changes_of_the_energy_equal_those_from_scratch() {
        for seed in 0..40 {
            let field = random(seed, 30, 4 + seed as usize % 20);
            let mut random = stream(seed, 7);
            let mut state = State::new(&field, (0..30).map(|_| random.below(2) == 1).collect());
            let mut energy = field.energy(&state.active).unwrap();
            for _ in 0..200 {
                energy += state.flip(random.below(30));
                assert!((energy - field.energy(&state.active).unwrap()).abs() < 1e-9, "seed {seed}");
            }
        }
    }
}
