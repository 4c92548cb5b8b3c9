//! A sparse tensor: sorted, unique keys and their values.

use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use std::ops::Range;

/// Shape of a tensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Number of samples.
    pub samples: usize,
    /// Number of channels.
    pub channels: usize,
    /// Cells along each axis, 1 to 4 axes; the last runs fastest.
    pub extent: Vec<usize>,
}

impl Shape {
    /// A shape whose keys fit into 63 bits.
    ///
    /// # Errors
    /// If there are no axes or more than 4, a length is 0, or the keys overflow.
    pub fn new(samples: usize, channels: usize, extent: &[usize]) -> Result<Self> {
        let all = [&[samples, channels], extent].concat();
        if !(1..=4).contains(&extent.len()) || all.contains(&0) {
            return Err(Error::input(format!("a tensor of shape {all:?} (allowed: 1 to 4 axes, no length 0)")));
        }
        let keys = all.iter().try_fold(1u64, |product, &n| product.checked_mul(n as u64));
        match keys {
            Some(keys) if keys < i64::MAX as u64 => Ok(Self { samples, channels, extent: extent.to_vec() }),
            _ => Err(Error::input(format!("a tensor of shape {all:?}: its keys do not fit into 63 bits"))),
        }
    }

    /// Number of cells of a channel.
    pub fn cells(&self) -> usize {
        self.extent.iter().product()
    }

    /// Number of channels of all samples.
    pub(super) fn planes(&self) -> usize {
        self.samples * self.channels
    }

    /// The largest distance of cell numbers, within a layer along the first axis, from a cell to one that a filter reaches from it.
    pub(super) fn farthest(&self, reach: usize) -> usize {
        let strides =
            self.extent[1..].iter().rev().scan(1, |stride, &length| Some(std::mem::replace(stride, *stride * length)));
        reach * strides.sum::<usize>()
    }

    /// The position of a cell along each axis; unused axes are 0.
    pub(super) fn position(&self, cell: usize) -> [usize; 4] {
        let (mut rest, mut position) = (cell, [0; 4]);
        for (axis, &length) in self.extent.iter().enumerate().rev() {
            (position[axis], rest) = (rest % length, rest / length);
        }
        position
    }
}

/// A sparse tensor. Keys number the entries by (sample, channel, position), ascending, each once.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseTensor<T> {
    shape: Shape,
    keys: Vec<u64>,
    values: Vec<T>,
}

impl<T: Scalar> SparseTensor<T> {
    /// A tensor of these entries, in any order.
    ///
    /// # Errors
    /// If the numbers of keys and values differ, a key stands twice or lies outside the shape, or a value is not finite.
    pub fn new(shape: Shape, keys: Vec<u64>, values: Vec<T>) -> Result<Self> {
        if keys.len() != values.len() {
            return Err(Error::input(format!("{} keys and {} values", keys.len(), values.len())));
        }
        if let Some(value) = values.iter().find(|value| !value.finite()) {
            return Err(Error::input(format!("{value:?} is not finite (allowed: finite values)")));
        }
        let (keys, values) = match keys.is_sorted() {
            true => (keys, values),
            false => {
                let mut entries: Vec<(u64, T)> = keys.into_iter().zip(values).collect();
                entries.sort_by_key(|entry| entry.0);
                entries.into_iter().unzip()
            }
        };
        let end = (shape.planes() * shape.cells()) as u64;
        if let Some(key) = keys.last().filter(|key| **key >= end) {
            return Err(Error::input(format!("key {key} (allowed: below {end})")));
        }
        if let Some(twice) = keys.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::input(format!("key {} stands twice", twice[0])));
        }
        Ok(Self { shape, keys, values })
    }

    /// A tensor whose keys are known to ascend and to fit.
    pub(super) fn of_sorted(shape: Shape, keys: Vec<u64>, values: Vec<T>) -> Self {
        Self { shape, keys, values }
    }

    /// The entries of a dense array, sample by sample, channel by channel, that are not 0.
    ///
    /// # Errors
    /// If the length does not fit, or a value is not finite.
    pub fn of_dense(shape: Shape, dense: &[T]) -> Result<Self> {
        if dense.len() != shape.planes() * shape.cells() {
            let expected = shape.planes() * shape.cells();
            return Err(Error::input(format!("{} values (allowed: {expected})", dense.len())));
        }
        let stored = || dense.iter().enumerate().filter(|(_, value)| **value != T::ZERO);
        Self::new(shape, stored().map(|(key, _)| key as u64).collect(), stored().map(|(_, &value)| value).collect())
    }

    /// The dense array, 0 where there is no entry.
    pub fn to_dense(&self) -> Vec<T> {
        let mut dense = vec![T::ZERO; self.shape.planes() * self.shape.cells()];
        self.keys.iter().zip(&self.values).for_each(|(&key, &value)| dense[key as usize] = value);
        dense
    }

    /// The shape.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The keys, ascending.
    pub fn keys(&self) -> &[u64] {
        &self.keys
    }

    /// The keys, ascending, and the values in their order.
    pub fn into_parts(self) -> (Vec<u64>, Vec<T>) {
        (self.keys, self.values)
    }

    /// The values, in the order of the keys.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The same entries with other values.
    ///
    /// # Errors
    /// If their number differs.
    pub fn with_values(&self, values: Vec<T>) -> Result<Self> {
        match values.len() == self.keys.len() {
            true => Ok(Self { values, ..self.clone() }),
            false => Err(Error::input(format!("{} values for {} entries", values.len(), self.keys.len()))),
        }
    }

    /// The first entry whose key is not below this one, known to be not before another entry and likely near it.
    /// O(log(entries between them)).
    pub(super) fn entry_from(&self, key: u64, known: usize) -> usize {
        let keys = &self.keys[known..];
        let (mut below, mut length) = (0, 1);
        while keys.get(below + length - 1).is_some_and(|&own| own < key) {
            below += length;
            length *= 2;
        }
        let near = &keys[below..(below + length).min(keys.len())];
        known + below + near.partition_point(|&own| own < key)
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Share of the cells of all channels that have an entry, 0..1.
    pub fn density(&self) -> f64 {
        self.len() as f64 / (self.shape.planes() * self.shape.cells()) as f64
    }

    /// Density of each channel, meaned over the samples.
    pub fn channel_densities(&self) -> Vec<f64> {
        let Shape { samples, channels, .. } = self.shape;
        let cells = self.shape.cells();
        let count = |channel: usize| -> usize {
            (0..samples).map(|sample| self.entries(sample * channels + channel, 0..cells).len()).sum()
        };
        (0..channels).map(|channel| count(channel) as f64 / (samples * cells) as f64).collect()
    }

    /// Bytes of keys and values.
    pub fn bytes(&self) -> usize {
        self.len() * (size_of::<u64>() + size_of::<T>())
    }

    /// The entries of a channel of a sample (`plane` = sample x channels + channel) whose cells lie in a range.
    pub(super) fn entries(&self, plane: usize, cells: Range<usize>) -> Range<usize> {
        let base = (plane * self.shape.cells()) as u64;
        let place = |cell: usize| self.keys.partition_point(|&key| key < base + cell as u64);
        place(cells.start)..place(cells.end)
    }

    /// Cell of an entry in its channel.
    pub(super) fn cell(&self, entry: usize) -> usize {
        (self.keys[entry] % self.shape.cells() as u64) as usize
    }

    /// The tensor without negative values (the rectified linear unit).
    #[must_use]
    pub fn rectified(&self) -> Self {
        let kept = || self.keys.iter().zip(&self.values).filter(|(_, value)| **value > T::ZERO);
        Self {
            shape: self.shape.clone(),
            keys: kept().map(|(&key, _)| key).collect(),
            values: kept().map(|(_, &value)| value).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_stand_in_the_order_of_their_keys_whatever_order_they_come_in() {
        let shape = Shape::new(2, 3, &[4, 5]).unwrap();
        let tensor = SparseTensor::new(shape.clone(), vec![99, 3, 60], vec![3.0, 1.0, 2.0]).unwrap();
        assert_eq!((tensor.keys(), tensor.values()), (&[3, 60, 99][..], &[1.0, 2.0, 3.0][..]));
        assert_eq!(SparseTensor::of_dense(shape.clone(), &tensor.to_dense()).unwrap(), tensor);
        assert_eq!((tensor.entries(3, 0..20), tensor.entries(4, 0..20), tensor.cell(2)), (1..2, 2..3, 19));
        assert_eq!((tensor.bytes(), tensor.density()), (48, 3.0 / 120.0));
        let wrong =
            |keys: Vec<u64>, values: Vec<f64>| SparseTensor::new(shape.clone(), keys, values).unwrap_err().to_string();
        assert!(wrong(vec![1], vec![]).contains("1 keys"));
        assert!(wrong(vec![1, 1], vec![0.5, 0.5]).contains("twice"));
        assert!(wrong(vec![120], vec![0.5]).contains("below 120"));
        assert!(wrong(vec![1], vec![f64::NAN]).contains("not finite"));
        assert!(Shape::new(1, 0, &[3]).is_err() && Shape::new(1, 1, &[]).is_err());
        assert!(Shape::new(1 << 30, 1 << 10, &[1 << 15, 1 << 15]).unwrap_err().to_string().contains("63 bits"));
    }
}
