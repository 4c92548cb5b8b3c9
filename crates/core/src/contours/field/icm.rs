//! Iterated conditional modes on candidates.

use super::state::State;
use super::{Choice, Field};
use crate::error::{Error, Result};
use crate::parallel::Monitor;

/// Changes of the energy nearer to 0 are rounding errors.
const ROUNDING: f64 = 1e-12;

/// The choice that no change of a single candidate improves.
///
/// Starts with the candidates that are more likely contours than not, and goes through all in the order of their
/// certainty, the most certain first, of equal ones the first; a candidate changes only if that lowers the energy, and is
/// tried again only after a change near it. O(n d) for d candidates at a seed, O(d³) for each change and O(n) for each
/// sweep. J. Besag, *On the statistical analysis of dirty pictures*, Journal of the Royal Statistical Society B
/// 48(3), 1986.
///
/// # Errors
/// If `max_sweeps` is 0, or the work was cancelled.
pub fn iterated_modes(field: &Field, max_sweeps: usize, monitor: &Monitor) -> Result<Choice> {
    if max_sweeps == 0 {
        return Err(Error::parameter("max_sweeps", 0, "1 or more"));
    }
    let start: Vec<bool> = field.costs.iter().map(|[off, on]| on < off).collect();
    let mut trace = vec![field.energy(&start)?];
    let mut state = State::new(field, start);
    let certainty = |i: u32| field.costs[i as usize].into_iter().reduce(|off, on| (on - off).abs()).unwrap_or(0.0);
    let mut order: Vec<u32> = (0..field.len() as u32).collect();
    order.sort_by(|&a, &b| certainty(b).total_cmp(&certainty(a)));
    let mut due = vec![true; field.len()];
    let mut converged = false;
    monitor.stage("contours", max_sweeps as u64);
    while !converged && trace.len() <= max_sweeps {
        converged = true;
        let mut energy = trace.last().copied().unwrap_or(0.0);
        for (count, &i) in order.iter().enumerate() {
            if count % 65_536 == 0 {
                monitor.check()?;
            }
            let i = i as usize;
            if !std::mem::take(&mut due[i]) || state.least_rise(i) >= 0.0 {
                continue;
            }
            let rise = state.flip(i);
            if rise < -ROUNDING {
                energy += rise;
                converged = false;
                state.depending_on(i, |other| due[other] = true);
            } else {
                state.flip(i);
            }
        }
        trace.push(energy);
        monitor.advance(1);
    }
    let energy = field.energy(&state.active)?;
    Ok(Choice { active: state.active, energy, trace, converged, exact: 0 })
}

#[cfg(test)]
mod tests {
    use super::super::testing::random;
    use super::*;

    #[test]
    fn the_energy_never_rises_and_no_single_change_improves_it() {
        let mut sweeps = 0;
        for seed in 0..60 {
            let field = random(seed, 60, 25);
            let found = iterated_modes(&field, 100, &Monitor::default()).unwrap();
            assert!(found.converged && found.trace.windows(2).all(|w| w[1] <= w[0]));
            assert!((found.trace.last().unwrap() - found.energy).abs() < 1e-9);
            assert_eq!(found.energy, field.energy(&found.active).unwrap());
            for i in 0..60 {
                let mut other = found.active.clone();
                other[i] = !other[i];
                assert!(field.energy(&other).unwrap() >= found.energy - 1e-9, "seed {seed}");
            }
            sweeps += found.trace.len() - 1;
        }
        assert!(sweeps > 120, "{sweeps}");
    }

    /// Sweeps that try every candidate.
    fn by_trying_all(field: &Field, max_sweeps: usize) -> (Vec<bool>, usize) {
        let mut active: Vec<bool> = field.costs.iter().map(|[off, on]| on < off).collect();
        let mut order: Vec<usize> = (0..field.len()).collect();
        let certainty = |i: usize| (field.costs[i][1] - field.costs[i][0]).abs();
        order.sort_by(|&a, &b| certainty(b).total_cmp(&certainty(a)));
        for sweep in 1..=max_sweeps {
            let before = active.clone();
            for &i in &order {
                let energy = field.energy(&active).unwrap();
                active[i] = !active[i];
                if field.energy(&active).unwrap() >= energy - 1e-9 {
                    active[i] = !active[i];
                }
            }
            if active == before {
                return (active, sweep);
            }
        }
        (active, max_sweeps)
    }

    #[test]
    fn candidates_that_are_not_tried_would_not_change() {
        for seed in 0..60 {
            // With few seeds, several candidates are between the same two.
            let mut field = random(seed, 60, 5 + seed as usize % 30);
            field.costs.iter_mut().for_each(|[_, on]| *on += [-1.0, 0.0, 0.7][seed as usize % 3]);
            for most in [1, 2, 100] {
                let found = iterated_modes(&field, most, &Monitor::default()).unwrap();
                let (active, sweeps) = by_trying_all(&field, most);
                assert_eq!((found.active, found.trace.len() - 1), (active, sweeps), "seed {seed}, {most} sweeps");
            }
        }
    }

    #[test]
    fn without_candidates_the_energy_is_0() {
        let found = iterated_modes(&random(0, 0, 2), 3, &Monitor::default()).unwrap();
        assert!(found.active.is_empty() && found.energy == 0.0 && found.converged);
        assert!(iterated_modes(&random(0, 2, 2), 0, &Monitor::default()).is_err());
    }
}
