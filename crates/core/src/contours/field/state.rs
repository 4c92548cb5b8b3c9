//! A choice of candidates whose energy is known after each change.

use super::Field;

/// A choice that can be changed one candidate at a time, in O(d) for d candidates at its seeds.
#[derive(Debug)]
pub(super) struct State<'a> {
    field: &'a Field,
    pub(super) active: Vec<bool>,
    /// Number of active candidates in which each candidate, active or not, goes on at its start and at its end.
    count: Vec<[u32; 2]>,
    /// Number of active candidates at each seed.
    at_seed: Vec<u32>,
}

impl<'a> State<'a> {
    pub(super) fn new(field: &'a Field, active: Vec<bool>) -> Self {
        let at_seed = vec![0; field.seeds];
        let mut state = Self { field, active: vec![false; active.len()], count: vec![[0; 2]; active.len()], at_seed };
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
        let changed = |count: u32| if self.active[i] { count + 1 } else { count - 1 };
        for side in 0..2 {
            let seed = &mut self.at_seed[field.ends[i][side] as usize];
            *seed = changed(*seed);
            for [j, of_other] in field.continuations(i, side) {
                let before = self.prior(j);
                self.count[j][of_other] = changed(self.count[j][of_other]);
                rise += self.prior(j) - before;
            }
        }
        rise
    }

    /// An amount that the energy rises by at least if a candidate changes, O(1): no contour at its seeds gains more than a
    /// continuation at a side is worth.
    pub(super) fn least_rise(&self, i: usize) -> f64 {
        let [off, on] = self.field.costs[i];
        let prior = self.field.prior;
        match self.active[i] {
            true => off - on - prior.isolated,
            false => {
                let contours: u32 = self.field.ends[i].iter().map(|&seed| self.at_seed[seed as usize]).sum();
                on - off - f64::from(contours) * prior.most_gain()
            }
        }
    }

    /// Calls a function with every candidate whose change may raise the energy by another amount after `i` has changed: those
    /// that `i` goes on in, and those that go on in one of them that is active.
    pub(super) fn depending_on(&self, i: usize, mut each: impl FnMut(usize)) {
        let next = |i: usize| (0..2).flat_map(move |side| self.field.continuations(i, side).map(|[j, _]| j));
        for j in next(i) {
            each(j);
            if self.active[j] {
                next(j).for_each(&mut each);
            }
        }
    }

    /// The terms of the energy that belong to a candidate.
    fn own(&self, i: usize) -> f64 {
        self.field.costs[i][usize::from(self.active[i])] + self.prior(i)
    }

    /// What a candidate costs because it does not go on, if it is active.
    fn prior(&self, i: usize) -> f64 {
        if self.active[i] { self.field.prior.of(self.count[i].map(|count| count > 0)) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::random;
    use super::*;
    use crate::random::stream;

    #[test]
    fn changes_of_the_energy_equal_those_from_scratch_and_are_not_below_their_bound() {
        let mut close = 0;
        for seed in 0..40 {
            let field = random(seed, 30, 4 + seed as usize % 20);
            let mut random = stream(seed, 7);
            let mut state = State::new(&field, (0..30).map(|_| random.below(2) == 1).collect());
            let mut energy = field.energy(&state.active).unwrap();
            for _ in 0..200 {
                let changed = random.below(30);
                let least = state.least_rise(changed);
                let rise = state.flip(changed);
                energy += rise;
                assert!((energy - field.energy(&state.active).unwrap()).abs() < 1e-9, "seed {seed}");
                assert!(least <= rise + 1e-9, "seed {seed}");
                close += usize::from(least > rise - 1.0);
            }
        }
        assert!(close > 500, "{close}");
    }

    #[test]
    fn changes_that_do_not_depend_on_another_stay_as_they_were() {
        let mut spared = 0;
        for seed in 0..40 {
            let field = random(seed, 30, 10 + seed as usize % 20);
            let mut random = stream(seed, 8);
            let mut state = State::new(&field, (0..30).map(|_| random.below(3) == 0).collect());
            let rises =
                |state: &mut State<'_>| -> Vec<f64> { (0..30).map(|i| [state.flip(i), state.flip(i)][0]).collect() };
            for _ in 0..30 {
                let (changed, before) = (random.below(30), rises(&mut state));
                state.flip(changed);
                let mut due = [false; 30];
                state.depending_on(changed, |other| due[other] = true);
                due[changed] = true;
                let after = rises(&mut state);
                for i in (0..30).filter(|&i| !due[i]) {
                    assert_eq!(before[i], after[i], "seed {seed}");
                    spared += 1;
                }
            }
        }
        assert!(spared > 10_000, "{spared}");
    }
}
