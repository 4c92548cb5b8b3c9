//! What training needs to resume: the parameters and the state of the optimiser.

use super::OptimiserState;
use crate::error::{Error, Result};
use crate::nn::arrays::{Array, Arrays};
use crate::nn::parameters::Parameters;

/// What the names of the arrays of the optimiser begin with.
const MEMORY: [&str; 2] = ["first.", "second."];
/// The name of the array with the number of steps.
const STEPS: &str = "steps";

/// Stores parameters and what the optimiser remembers.
pub fn store(arrays: &mut Arrays, parameters: &Parameters<f32>, state: &OptimiserState<f32>) {
    for (number, parameter) in parameters.iter().enumerate() {
        arrays.put(&parameter.name, Array::Single(parameter.shape.clone(), parameter.values.clone()));
        for (prefix, memory) in MEMORY.iter().zip(&state.memory) {
            let values = memory.get(number).cloned().unwrap_or_default();
            arrays.put(format!("{prefix}{}", parameter.name), Array::Single(vec![values.len()], values));
        }
    }
    arrays.put(STEPS, Array::Whole(vec![state.steps]));
}

/// Reads what [`store`] stored of a network with the same parameters.
///
/// # Errors
/// Names the array that does not fit.
pub fn restore(arrays: &Arrays, parameters: &mut Parameters<f32>) -> Result<OptimiserState<f32>> {
    let &[steps] = arrays.whole(STEPS)? else {
        return Err(Error::ModelMismatch(format!("array {STEPS} (allowed: one number)")));
    };
    let mut state = OptimiserState { steps, ..Default::default() };
    for parameter in parameters.iter_mut() {
        let length = parameter.values.len();
        parameter.values.copy_from_slice(arrays.single(&parameter.name, length)?);
        for (prefix, memory) in MEMORY.iter().zip(&mut state.memory) {
            let name = format!("{prefix}{}", parameter.name);
            // Before the first step, and of statistics, nothing is remembered.
            let values = arrays.single(&name, 0).or_else(|_| arrays.single(&name, length))?;
            memory.push(values.to_vec());
        }
    }
    Ok(state)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::parameters::Role;
    use crate::nn::training::Optimiser;

    #[test]
    fn steps_after_a_checkpoint_are_those_without_one() {
        let optimisers = [
            Optimiser::default(),
            Optimiser::Sgd { momentum: 0.9, decay: 0.1 },
            Optimiser::Adadelta { rho: 0.9, epsilon: 1e-6 },
        ];
        for optimiser in optimisers {
            let mut parameters = Parameters::<f32>::default();
            parameters.constant("a.weights", 3, 0.5, Role::Weight);
            parameters.constant("a.mean", 2, 0.1, Role::Statistic);
            let mut state = OptimiserState::default();
            let gradient = |step: u32| vec![vec![0.3, -0.2 * step as f32, 0.1], vec![0.0; 2]];
            let mut again = None;
            for step in 0..6 {
                if step == 3 {
                    let mut arrays = Arrays::default();
                    store(&mut arrays, &parameters, &state);
                    let mut own = parameters.clone();
                    own.iter_mut().for_each(|p| p.values.fill(9.0));
                    let state = restore(&arrays, &mut own).unwrap();
                    again = Some((own, state));
                }
                optimiser.step(&mut parameters, &gradient(step), 0.1, &mut state).unwrap();
                if let Some((own, state)) = &mut again {
                    optimiser.step(own, &gradient(step), 0.1, state).unwrap();
                }
            }
            assert_eq!(again.unwrap(), (parameters, state));
        }
    }
}
