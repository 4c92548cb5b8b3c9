//! Max pooling of stored entries (Hackel 2018, section 6.3.3).

use super::tensor::{Shape, SparseTensor};
use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;

/// A pooled tensor, and where its values come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Pooled<T> {
    /// The largest stored value of each window that has one.
    pub tensor: SparseTensor<T>,
    /// Number of the entry that won each window: gradients go there.
    pub winners: Vec<u32>,
    /// Entries of the tensor that was pooled.
    entries: usize,
}

/// Pools windows of `stride` cells along each axis; only stored entries count, of equal ones the first wins. Cells beyond
/// the last whole window are dropped, as in dense networks. O(entries · log entries).
///
/// # Errors
/// If the stride is 0, an axis is shorter than it, or there are 2³² entries or more.
pub fn max_pool<T: Scalar>(tensor: &SparseTensor<T>, stride: usize) -> Result<Pooled<T>> {
    let shape = tensor.shape();
    if stride == 0 || shape.extent.iter().any(|&length| length < stride) {
        let expected = format!("1 up to the shortest axis of {:?}", shape.extent);
        return Err(Error::parameter("stride", stride, expected));
    }
    if u32::try_from(tensor.len()).is_err() {
        return Err(Error::input(format!("{} entries to pool (allowed: below 2^32)", tensor.len())));
    }
    let extent: Vec<usize> = shape.extent.iter().map(|length| length / stride).collect();
    let to = Shape::new(shape.samples, shape.channels, &extent)?;
    let cells = shape.cells() as u64;
    let window = |entry: usize| {
        let plane = tensor.keys()[entry] / cells;
        let position = shape.position(tensor.cell(entry));
        let mut cell = 0;
        for (axis, &length) in extent.iter().enumerate() {
            let at = position[axis] / stride;
            if at >= length {
                return None;
            }
            cell = cell * length + at;
        }
        Some(plane * to.cells() as u64 + cell as u64)
    };
    let mut all: Vec<(u64, u32)> =
        (0..tensor.len()).filter_map(|entry| window(entry).map(|key| (key, entry as u32))).collect();
    all.sort_unstable();
    let (mut keys, mut winners) = (Vec::new(), Vec::new());
    for group in all.chunk_by(|a, b| a.0 == b.0) {
        let value = |entry: u32| tensor.values()[entry as usize];
        let best = group.iter().map(|pair| pair.1).reduce(|a, b| if value(b) > value(a) { b } else { a });
        keys.push(group[0].0);
        winners.extend(best);
    }
    let values = winners.iter().map(|&entry| tensor.values()[entry as usize]).collect();
    Ok(Pooled { tensor: SparseTensor::of_sorted(to, keys, values), winners, entries: tensor.len() })
}

impl<T: Scalar> Pooled<T> {
    /// The gradient with respect to the entries that were pooled, given that with respect to the pooled ones.
    pub fn backward(&self, gradient: &[T]) -> Vec<T> {
        let mut found = vec![T::ZERO; self.entries];
        self.winners.iter().zip(gradient).for_each(|(&winner, &value)| found[winner as usize] += value);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::numbers;

    #[test]
    fn pooling_of_values_that_are_not_negative_is_that_of_the_dense_tensor() {
        let shape = Shape::new(2, 3, &[5, 7]).unwrap();
        let dense: Vec<f64> = numbers(1, 2 * 3 * 35).into_iter().map(|v| v.max(0.0)).collect();
        let pooled = max_pool(&SparseTensor::of_dense(shape, &dense).unwrap(), 2).unwrap();
        let mut expected = Vec::new();
        for plane in dense.chunks(35) {
            for (y, x) in (0..2).flat_map(|y| (0..3).map(move |x| (y, x))) {
                let window = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(a, b)| plane[(2 * y + a) * 7 + 2 * x + b]);
                expected.push(window.into_iter().fold(0.0, f64::max));
            }
        }
        assert_eq!(pooled.tensor.to_dense(), expected);
        // Each gradient goes to its winner.
        let gradient: Vec<f64> = (1..=pooled.tensor.len()).map(|g| g as f64).collect();
        let back = pooled.backward(&gradient);
        assert_eq!(back.iter().sum::<f64>(), gradient.iter().sum::<f64>());
        assert_eq!(back.iter().filter(|g| **g != 0.0).count(), pooled.tensor.len());
    }

    #[test]
    fn negative_entries_win_if_there_are_no_others() {
        let shape = Shape::new(1, 1, &[4]).unwrap();
        let tensor = SparseTensor::new(shape, vec![0, 1, 2], vec![-2.0, -1.0, -3.0]).unwrap();
        let pooled = max_pool(&tensor, 2).unwrap();
        assert_eq!((pooled.tensor.values(), &pooled.winners[..]), (&[-1.0, -3.0][..], &[1, 2][..]));
        assert!(max_pool(&tensor, 0).is_err() && max_pool(&tensor, 5).is_err());
    }
}
