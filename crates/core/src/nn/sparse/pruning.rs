//! One-warning-shot pruning (Hackel 2018, section 6.3.6).

use super::filter::SparseFilter;
use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;

/// Removes weights that are small at two consecutive ends of epochs. A weight that passes through 0 at one of them stays.
#[derive(Clone, Debug, PartialEq)]
pub struct Pruning {
    /// Weights of smaller magnitude are small: 1e-4 for ModelNet40, 5e-3 for MNIST.
    threshold: f64,
    /// Keys of the weights that were small at the last end of an epoch, ascending.
    warned: Vec<u64>,
}

impl Pruning {
    /// Pruning of weights below a threshold.
    ///
    /// # Errors
    /// If the threshold is negative or not finite.
    pub fn new(threshold: f64) -> Result<Self> {
        match (0.0..f64::INFINITY).contains(&threshold) {
            true => Ok(Self { threshold, warned: Vec::new() }),
            false => Err(Error::parameter("threshold", threshold, "0 or more")),
        }
    }

    /// Keys of the weights that were small at the last end of an epoch, ascending.
    pub fn warned(&self) -> &[u64] {
        &self.warned
    }

    /// The same with other warned weights, to go on from a checkpoint.
    #[must_use]
    pub fn with_warned(self, warned: Vec<u64>) -> Self {
        Self { warned, ..self }
    }

    /// The filters after an epoch: those weights are removed for good that were small at the end of the last epoch too.
    pub fn end_epoch<T: Scalar>(&mut self, filter: &SparseFilter<T>) -> SparseFilter<T> {
        let small = |weight: T| weight.magnitude().wide() < self.threshold;
        let twice = |i: usize, weight: T| small(weight) && self.warned.binary_search(&filter.keys()[i]).is_ok();
        let left = filter.pruned(|i, weight| !twice(i, weight));
        self.warned = left.keys().iter().zip(left.values()).filter(|(_, w)| small(**w)).map(|(&key, _)| key).collect();
        left
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn filter(values: &[f64]) -> SparseFilter<f64> {
        SparseFilter::of_dense([1, 1], values.len(), 1, values.to_vec()).unwrap()
    }

    #[test]
    fn a_weight_is_removed_at_the_second_warning_in_a_row() {
        let mut pruning = Pruning::new(0.1).unwrap();
        let mut filters = filter(&[0.05, 0.5, 0.05]);
        filters = pruning.end_epoch(&filters);
        assert_eq!(filters.keys(), [0, 1, 2]);
        // The last one was passing through 0.
        filters.values_mut()[2] = -0.5;
        filters = pruning.end_epoch(&filters);
        assert_eq!(filters.keys(), [1, 2]);
        // A warning that is not in a row counts anew.
        filters.values_mut()[1] = 0.01;
        filters = pruning.end_epoch(&filters);
        assert_eq!(filters.keys(), [1, 2]);
        filters = pruning.end_epoch(&filters);
        assert_eq!(filters.keys(), [1]);
        assert!(Pruning::new(-1.0).is_err() && Pruning::new(f64::NAN).is_err());
    }

    #[test]
    fn weights_never_return() {
        let mut draws = stream(4, 0);
        let (mut pruning, mut filters) = (Pruning::new(0.3).unwrap(), filter(&[0.0; 15]));
        let mut before = filters.keys().to_vec();
        for _ in 0..40 {
            filters.values_mut().iter_mut().for_each(|w| *w = draws.normal());
            filters = pruning.end_epoch(&filters);
            assert!(filters.keys().iter().all(|key| before.contains(key)));
            before = filters.keys().to_vec();
        }
        assert!(before.len() < 15);
    }
}
