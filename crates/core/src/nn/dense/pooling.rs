//! Max pooling of whole grids.

use super::Grid;
use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use rayon::prelude::*;

/// A pooled grid, and where its values come from.
#[derive(Clone, Debug, PartialEq)]
pub struct DensePooled<T> {
    /// The windows.
    pub grid: Grid,
    /// The largest value of each window and channel.
    pub values: Vec<T>,
    /// Number of the value that won: gradients go there.
    winners: Vec<u32>,
    /// Number of values that were pooled.
    pooled: usize,
}

/// Pools windows of `stride` cells along each axis; of equal values the first wins. Cells beyond the last whole window are
/// dropped, as in torch.
///
/// # Errors
/// If the stride is 0, an axis is shorter than it, a length does not fit, or there are 2^32 values or more.
pub fn max_pool<T: Scalar>(grid: &Grid, values: &[T], channels: usize, stride: usize) -> Result<DensePooled<T>> {
    if stride == 0 || grid.extent.iter().any(|&length| length < stride) {
        return Err(Error::parameter("stride", stride, format!("1 up to the shortest axis of {:?}", grid.extent)));
    }
    if values.len() != grid.rows() * channels || u32::try_from(values.len()).is_err() {
        let expected = grid.rows() * channels;
        return Err(Error::input(format!("{} values (allowed: {expected}, below 2^32)", values.len())));
    }
    let extent: Vec<usize> = grid.extent.iter().map(|length| length / stride).collect();
    let to = Grid::new(grid.samples, &extent)?;
    let mut winners = vec![0u32; to.rows() * channels];
    winners.par_chunks_mut(channels.max(1)).enumerate().for_each(|(row, winners)| {
        let first = corner(grid, &to, row, stride);
        winners.iter_mut().enumerate().for_each(|(channel, winner)| *winner = (first * channels + channel) as u32);
        for_window(grid, stride, |step| {
            for (channel, winner) in winners.iter_mut().enumerate() {
                let other = (first + step) * channels + channel;
                if values[other] > values[*winner as usize] {
                    *winner = other as u32;
                }
            }
        });
    });
    let found = winners.iter().map(|&winner| values[winner as usize]).collect();
    Ok(DensePooled { grid: to, values: found, winners, pooled: values.len() })
}

/// The first cell of the window of an output cell.
fn corner(grid: &Grid, to: &Grid, row: usize, stride: usize) -> usize {
    let (mut rest, mut step, mut cell) = (row % to.cells(), 1, row / to.cells() * grid.cells());
    for (&length, &coarse) in grid.extent.iter().zip(&to.extent).rev() {
        cell += rest % coarse * stride * step;
        (rest, step) = (rest / coarse, step * length);
    }
    cell
}

/// Calls `each` with the difference of every cell of a window from its first one, ascending.
fn for_window(grid: &Grid, stride: usize, mut each: impl FnMut(usize)) {
    for number in 0..stride.pow(grid.extent.len() as u32) {
        let (mut rest, mut step, mut difference) = (number, 1, 0);
        for &length in grid.extent.iter().rev() {
            difference += rest % stride * step;
            (rest, step) = (rest / stride, step * length);
        }
        each(difference);
    }
}

impl<T: Scalar> DensePooled<T> {
    /// The gradient with respect to the values that were pooled, given that with respect to the windows.
    pub fn backward(&self, gradient: &[T]) -> Vec<T> {
        let mut found = vec![T::ZERO; self.pooled];
        self.winners.iter().zip(gradient).for_each(|(&winner, &value)| found[winner as usize] += value);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{differences, numbers, relative_error};

    #[test]
    fn the_largest_value_of_each_window_and_its_gradient() {
        // 5 columns: the last one belongs to no window.
        let grid = Grid::new(1, &[2, 5]).unwrap();
        let values = [1.0, 2.0, 8.0, 3.0, 9.0, 4.0, 4.0, 8.0, 7.0, 9.0];
        let pooled = max_pool(&grid, &values, 1, 2).unwrap();
        assert_eq!((&pooled.values[..], &pooled.grid.extent[..]), (&[4.0, 8.0][..], &[1, 2][..]));
        assert_eq!(pooled.backward(&[1.0, 2.0]), [0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(max_pool(&grid, &values, 1, 3).is_err() && max_pool(&grid, &values[1..], 1, 2).is_err());
    }

    #[test]
    fn gradients_are_those_of_finite_differences() {
        let grid = Grid::new(2, &[4, 2, 6]).unwrap();
        let (values, towards) = (numbers(1, grid.rows() * 3), numbers(2, grid.rows() / 8 * 3));
        let loss = |values: &[f64]| -> f64 {
            let pooled = max_pool(&grid, values, 3, 2).unwrap();
            pooled.values.iter().zip(&towards).map(|(v, t)| v * t).sum()
        };
        let found = max_pool(&grid, &values, 3, 2).unwrap().backward(&towards);
        assert!(relative_error(&found, &differences(&values, 288, loss)) < 1e-6);
    }
}
