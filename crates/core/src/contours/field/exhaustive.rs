//! The least energy of small pieces, by trying all choices.

use super::state::State;
use super::{Choice, Field, at_seeds};
use crate::contours::params::MOST_EXACT;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};

/// The choice with the least energy in every connected piece of at most `most` candidates, and `start` in the others.
///
/// Candidates that share a seed are connected. Tells how far [`iterated_modes`](super::iterated_modes) is from the
/// minimum. Of equal choices the first in the order of a Gray code that begins with no contour is taken, or `start` if
/// nothing is better. O(2^m) for a piece of m candidates.
///
/// # Errors
/// If `start` does not fit the field, `most` is above 20, or the work was cancelled.
pub fn exhaustive(field: &Field, start: &Choice, most: usize, monitor: &Monitor) -> Result<Choice> {
    field.check(&start.active)?;
    if most > MOST_EXACT {
        return Err(Error::parameter("exact", most, format!("0 to {MOST_EXACT}")));
    }
    let pieces = field.pieces(monitor)?;
    let small: Vec<&[u32]> = pieces.groups().filter(|piece| piece.len() <= most).collect();
    monitor.stage("small pieces", small.len() as u64);
    let best = map_ordered(small.len(), monitor, |at| {
        let found = least(field, start, small[at], monitor);
        monitor.advance(1);
        found
    })?;
    let mut active = start.active.clone();
    for (piece, chosen) in small.iter().zip(&best) {
        for (at, &i) in piece.iter().enumerate() {
            active[i as usize] = chosen >> at & 1 == 1;
        }
    }
    let energy = field.energy(&active)?;
    let mut trace = start.trace.clone();
    trace.push(energy);
    Ok(Choice { active, energy, trace, converged: start.converged, exact: small.iter().map(|p| p.len()).sum() })
}

/// The best choice of a piece, candidate k in bit k.
fn least(field: &Field, start: &Choice, piece: &[u32], monitor: &Monitor) -> Result<u32> {
    let part = part(field, piece, monitor)?;
    let given: Vec<bool> = piece.iter().map(|&i| start.active[i as usize]).collect();
    let given_energy = part.energy(&given)?;
    let mut state = State::new(&part, vec![false; piece.len()]);
    let mut energy = part.energy(&state.active)?;
    let (mut best, mut bits, mut best_energy) = (0u32, 0u32, energy);
    for step in 1..1u32 << piece.len() {
        if step % 4096 == 0 {
            monitor.check()?;
        }
        let flipped = step.trailing_zeros();
        bits ^= 1 << flipped;
        energy += state.flip(flipped as usize);
        // Rounding errors of a million steps are far below this.
        if energy < best_energy - 1e-9 {
            (best, best_energy) = (bits, energy);
        }
    }
    let as_given = given.iter().enumerate().fold(0, |bits, (at, &on)| bits | u32::from(on) << at);
    Ok(if given_energy <= best_energy + 1e-9 { as_given } else { best })
}

/// The field of one piece.
fn part(field: &Field, piece: &[u32], monitor: &Monitor) -> Result<Field> {
    let mut seeds: Vec<u32> = piece.iter().flat_map(|&i| field.ends[i as usize]).collect();
    seeds.sort_unstable();
    seeds.dedup();
    let number = |seed: u32| seeds.binary_search(&seed).unwrap_or_default() as u32;
    let ends: Vec<[u32; 2]> = piece.iter().map(|&i| field.ends[i as usize].map(number)).collect();
    Ok(Field {
        at: at_seeds(&ends, seeds.len(), monitor)?,
        ends,
        seeds: seeds.len(),
        costs: piece.iter().map(|&i| field.costs[i as usize]).collect(),
        leaves: piece.iter().map(|&i| field.leaves[i as usize]).collect(),
        prior: field.prior,
    })
}

#[cfg(test)]
mod tests {
    use super::super::iterated_modes;
    use super::super::testing::random;
    use super::*;

    #[test]
    fn the_minimum_is_that_of_all_choices_and_never_above_iterated_modes() {
        let mut gaps = 0;
        for seed in 0..40 {
            let candidates = 1 + seed as usize % 12;
            let field = random(seed, candidates, 2 + seed as usize % 7);
            let start = iterated_modes(&field, 100, &Monitor::default()).unwrap();
            let found = exhaustive(&field, &start, 15, &Monitor::default()).unwrap();
            let all = 0..1u32 << candidates;
            let choice = |bits: u32| (0..candidates).map(|i| bits >> i & 1 == 1).collect::<Vec<_>>();
            let least = all.map(|bits| field.energy(&choice(bits)).unwrap()).fold(f64::INFINITY, f64::min);
            assert!((found.energy - least).abs() < 1e-9, "seed {seed}");
            assert!(found.energy <= start.energy && found.exact == candidates);
            gaps += usize::from(found.energy < start.energy - 1e-9);
        }
        assert!(gaps > 3, "{gaps}");
    }

    #[test]
    fn large_pieces_stay_as_they_are() {
        let field = random(3, 40, 60);
        let start = iterated_modes(&field, 100, &Monitor::default()).unwrap();
        let none = exhaustive(&field, &start, 0, &Monitor::default()).unwrap();
        assert_eq!((none.active, none.exact), (start.active.clone(), 0));
        let some = exhaustive(&field, &start, 5, &Monitor::default()).unwrap();
        assert!(some.exact > 0 && some.exact < 40 && some.energy <= start.energy);
        assert!(exhaustive(&field, &start, 21, &Monitor::default()).is_err());
    }
}
