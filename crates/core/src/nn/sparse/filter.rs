//! A bank of filters with sparse weights.

use super::slab::{LANES, Tap, Taps};
use super::tensor::Shape;
use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;

/// Filters from input to output channels, the same odd size along all axes. Weights that were removed by pruning are not
/// stored; a stored weight may be 0.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseFilter<T> {
    /// Input channels.
    pub inputs: usize,
    /// Output channels.
    pub outputs: usize,
    /// Weights along an axis, odd.
    pub size: usize,
    /// Number of axes.
    pub axes: usize,
    keys: Vec<u64>,
    values: Vec<T>,
}

impl<T: Scalar> SparseFilter<T> {
    /// Filters with all weights stored, sorted by (output, input, position; the last axis fastest).
    ///
    /// # Errors
    /// If the size is even or above 15, there are no axes or more than 4, the number of weights does not fit, or one is not
    /// finite.
    pub fn of_dense(channels: [usize; 2], size: usize, axes: usize, weights: Vec<T>) -> Result<Self> {
        let [inputs, outputs] = channels;
        if size.is_multiple_of(2) || size > 15 {
            return Err(Error::parameter("size", size, "an odd number from 1 to 15"));
        }
        if !(1..=4).contains(&axes) {
            return Err(Error::parameter("axes", axes, "1 to 4"));
        }
        let expected = inputs * outputs * size.pow(axes as u32);
        if weights.len() != expected {
            return Err(Error::input(format!("{} weights (allowed: {expected})", weights.len())));
        }
        if let Some(weight) = weights.iter().find(|weight| !weight.finite()) {
            return Err(Error::input(format!("a weight of {weight:?} (allowed: finite values)")));
        }
        Ok(Self { inputs, outputs, size, axes, keys: (0..expected as u64).collect(), values: weights })
    }

    /// The same filters without the weights for which `keep` is false.
    #[must_use]
    pub fn pruned(&self, keep: impl Fn(usize, T) -> bool) -> Self {
        let kept = || (0..self.values.len()).filter(|&i| keep(i, self.values[i]));
        Self {
            keys: kept().map(|i| self.keys[i]).collect(),
            values: kept().map(|i| self.values[i]).collect(),
            ..self.clone()
        }
    }

    /// The stored weights.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The stored weights.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// Number of each stored weight among all, ascending.
    pub fn keys(&self) -> &[u64] {
        &self.keys
    }

    /// Output channel of a stored weight.
    pub fn output(&self, weight: usize) -> usize {
        self.keys[weight] as usize / (self.inputs * self.volume())
    }

    /// Number of weights of a pair of channels if none is removed.
    pub fn volume(&self) -> usize {
        self.size.pow(self.axes as u32)
    }

    /// Share of the weights that are stored, 0..1.
    pub fn density(&self) -> f64 {
        self.keys.len() as f64 / (self.inputs * self.outputs * self.volume()).max(1) as f64
    }

    /// Bytes of keys and values.
    pub fn bytes(&self) -> usize {
        self.keys.len() * (size_of::<u64>() + size_of::<T>())
    }

    /// The weights of a group of [`LANES`] output channels, side by side, for each input channel.
    pub(super) fn taps(&self, group: usize, shape: &Shape) -> Vec<Taps<T>> {
        let (volume, first) = (self.volume(), group * LANES);
        let mut by_input: Vec<Vec<[T; LANES]>> = vec![vec![[T::ZERO; LANES]; volume]; self.inputs];
        let mut stored = vec![false; self.inputs * volume];
        let begin = (first * self.inputs * volume) as u64;
        let end = ((first + LANES).min(self.outputs) * self.inputs * volume) as u64;
        let range = self.keys.partition_point(|&k| k < begin)..self.keys.partition_point(|&k| k < end);
        for (&key, &value) in self.keys[range.clone()].iter().zip(&self.values[range]) {
            let (plane, position) = (key as usize / volume, key as usize % volume);
            let (output, input) = (plane / self.inputs, plane % self.inputs);
            by_input[input][position][output - first] = value;
            stored[input * volume + position] = true;
        }
        let taps = |(input, weights): (usize, Vec<[T; LANES]>)| {
            let used = weights.into_iter().enumerate().filter(|(position, _)| stored[input * volume + position]);
            Taps::new(used.map(|(position, weights)| Tap::new(position, weights, self.size, shape)).collect())
        };
        by_input.into_iter().enumerate().map(taps).collect()
    }
}
