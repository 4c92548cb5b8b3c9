//! A choice of candidates whose energy is known after each change.

use super::Field;

/// A choice that can be changed one candidate at a time, in O(d) for d candidates at its seeds.
#[derive(Debug)]
pub(super) struct State<'a> {
    field: &'a Field,
    pub(super) active: Vec<bool>,
    /// Number of active candidates in which each candidate, active or not, goes on at its start and at its end.
    count: Vec<[u32; 2]>,
}

impl<'a> State<'a> {
    pub(super) fn new(field: &'a Field, active: Vec<bool>) -> Self {
        let mut state = Self { field, active: vec![false; active.len()], count: vec![[0; 2]; active.len()] };
        for (i, _) in active.iter().enumerate().filter(|(_, active)| **active) {
            state.flip(i);
        }
        state
    }

    /// Changes a candidate; returns by how much the energy rises.
    pub(super) fn flip(&mut self, i: usize) -> f64 {
        let before = self.own(i);
        self.active[i] = !self.active[i];
        let mut rise = self.own(i) - before;
        let field = self.field;
        for side in 0..2 {
            for [j, of_other] in field.continuations(i, side) {
                let before = self.own(j);
                let count = &mut self.count[j][of_other];
                *count = if self.active[i] { *count + 1 } else { *count - 1 };
                rise += self.own(j) - before;
            }
        }
        rise
    }

    /// The terms of the energy that belong to a candidate.
    fn own(&self, i: usize) -> f64 {
        let active = self.active[i];
        let prior = if active { self.field.prior.of(self.count[i].map(|count| count > 0)) } else { 0.0 };
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
