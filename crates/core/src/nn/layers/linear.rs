//! Products of rows with a matrix (fully connected layers, and convolutions of one cell).

use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use crate::nn::sites::{Matrix, add_outer_products_of_rows, add_products_of_rows};
use crate::parallel::{Monitor, fold_ordered};
use rayon::prelude::*;

/// Rows that one task takes, at most, and at least.
const ROWS: usize = 256;
const FEW: usize = 8;
/// Tasks that rows are divided among if there are not many.
const TASKS: usize = 8;
/// Input channels whose weights one task takes if there are not many rows.
const INPUTS: usize = 64;
/// Parts whose gradients of the weights are summed on their own, at most.
const PARTS: usize = 32;

/// A layer y = x·W + b.
#[derive(Clone, Copy, Debug)]
pub struct Linear<'a, T> {
    /// W, input channels by output channels, row-major.
    pub weights: &'a [T],
    /// b, one term an output channel.
    pub bias: &'a [T],
}

/// Gradients of a loss.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearGradient<T> {
    /// With respect to the values.
    pub values: Vec<T>,
    /// With respect to W.
    pub weights: Vec<T>,
    /// With respect to b.
    pub bias: Vec<T>,
}

impl<T: Scalar> Linear<'_, T> {
    /// Input channels.
    fn inputs(&self) -> usize {
        self.weights.len() / self.bias.len().max(1)
    }

    /// One row of outputs for each row of `values`.
    ///
    /// # Errors
    /// If the length does not fit, or the work was cancelled.
    pub fn forward(&self, values: &[T], monitor: &Monitor) -> Result<Vec<T>> {
        let (inputs, outputs) = (self.inputs(), self.bias.len());
        let rows = whole_rows(values.len(), inputs)?;
        let mut out: Vec<T> = std::iter::repeat_n(self.bias, rows).flatten().copied().collect();
        products(Matrix { values, columns: inputs }, Matrix { values: self.weights, columns: outputs }, &mut out);
        monitor.check()?;
        Ok(out)
    }

    /// The gradients, given that with respect to the outputs.
    ///
    /// # Errors
    /// If a length does not fit, or the work was cancelled.
    pub fn backward(&self, values: &[T], gradient: &[T], monitor: &Monitor) -> Result<LinearGradient<T>> {
        let (inputs, outputs) = (self.inputs(), self.bias.len());
        let rows = whole_rows(values.len(), inputs)?;
        if whole_rows(gradient.len(), outputs)? != rows {
            return Err(Error::input(format!("{} gradients for {rows} rows of {outputs}", gradient.len())));
        }
        let turned: Vec<T> =
            (0..outputs).flat_map(|o| (0..inputs).map(move |i| self.weights[i * outputs + o])).collect();
        let y = Matrix { values: gradient, columns: outputs };
        let mut found = vec![T::ZERO; values.len()];
        products(y, Matrix { values: &turned, columns: inputs }, &mut found);
        monitor.check()?;
        let x = Matrix { values, columns: inputs };
        let (weights, bias) = if rows <= ROWS { by_inputs(x, y) } else { by_rows(x, y, rows) };
        monitor.check()?;
        Ok(LinearGradient { values: found, weights, bias })
    }
}

/// Gradients of the weights and the bias: tasks take the weights of some input channels. The order of sums is that of the rows.
fn by_inputs<T: Scalar>(x: Matrix<'_, T>, y: Matrix<'_, T>) -> (Vec<T>, Vec<T>) {
    let (inputs, outputs) = (x.columns, y.columns);
    let mut weights = vec![T::ZERO; inputs * outputs];
    weights.par_chunks_mut(INPUTS * outputs).enumerate().for_each(|(number, weights)| {
        let (first, count) = (number * INPUTS, weights.len() / outputs);
        let own: Vec<T> = x.values.chunks_exact(inputs).flat_map(|row| &row[first..first + count]).copied().collect();
        add_outer_products_of_rows(Matrix { values: &own, columns: count }, y, weights);
    });
    (weights, sums(y))
}

/// Gradients of the weights and the bias: tasks take some rows, and their sums are added in order.
fn by_rows<T: Scalar>(x: Matrix<'_, T>, y: Matrix<'_, T>, rows: usize) -> (Vec<T>, Vec<T>) {
    let (inputs, outputs) = (x.columns, y.columns);
    // The bias is the weight of a further input that is always 1.
    let part = |range: std::ops::Range<usize>| {
        let mut sum = vec![T::ZERO; inputs * outputs];
        let own = Matrix { values: &y.values[range.start * outputs..range.end * outputs], columns: outputs };
        let values = &x.values[range.start * inputs..range.end * inputs];
        add_outer_products_of_rows(Matrix { values, columns: inputs }, own, &mut sum);
        sum.append(&mut sums(own));
        sum
    };
    let add = |mut sum: Vec<T>, part: Vec<T>| {
        sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        sum
    };
    let size = rows.div_ceil(PARTS).max(ROWS);
    let mut weights = fold_ordered(rows, size, part, add).unwrap_or_else(|| vec![T::ZERO; (inputs + 1) * outputs]);
    let bias = weights.split_off(inputs * outputs);
    (weights, bias)
}

/// Sum of each column.
fn sums<T: Scalar>(y: Matrix<'_, T>) -> Vec<T> {
    let mut sums = vec![T::ZERO; y.columns];
    y.values.chunks_exact(y.columns).for_each(|row| row.iter().zip(&mut sums).for_each(|(&g, sum)| *sum += g));
    sums
}

/// Adds x·W to the rows of `out`.
fn products<T: Scalar>(x: Matrix<'_, T>, weights: Matrix<'_, T>, out: &mut [T]) {
    if weights.columns == 0 || x.columns == 0 {
        return;
    }
    let rows = (out.len() / weights.columns).div_ceil(TASKS).clamp(FEW, ROWS);
    let parts = out.par_chunks_mut(rows * weights.columns).zip(x.values.par_chunks(rows * x.columns));
    parts.for_each(|(out, values)| {
        add_products_of_rows(Matrix { values, columns: x.columns }, weights, out);
    });
}

/// Number of rows of so many channels.
fn whole_rows(values: usize, channels: usize) -> Result<usize> {
    match channels {
        0 => Err(Error::input("a layer without channels")),
        _ if !values.is_multiple_of(channels) => {
            Err(Error::input(format!("{values} values (allowed: whole rows of {channels} channels)")))
        }
        _ => Ok(values / channels),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{differences, numbers, relative_error};

    #[test]
    fn gradients_are_those_of_finite_differences() {
        let (inputs, outputs, monitor) = (70, 11, Monitor::default());
        for rows in [1, 30, 700] {
            let (values, towards) = (numbers(1, rows * inputs), numbers(2, rows * outputs));
            let (weights, bias) = (numbers(3, inputs * outputs), numbers(4, outputs));
            let of = |values: &[f64], weights: &[f64], bias: &[f64]| -> f64 {
                let out = Linear { weights, bias }.forward(values, &monitor).unwrap();
                out.iter().zip(&towards).map(|(o, t)| o * t).sum()
            };
            let found = Linear { weights: &weights, bias: &bias }.backward(&values, &towards, &monitor).unwrap();
            assert!(relative_error(&found.values, &differences(&values, 60, |v| of(v, &weights, &bias))) < 1e-6);
            assert!(relative_error(&found.weights, &differences(&weights, 99, |w| of(&values, w, &bias))) < 1e-6);
            assert!(relative_error(&found.bias, &differences(&bias, 99, |b| of(&values, &weights, b))) < 1e-6);
            assert!(Linear { weights: &weights, bias: &bias }.forward(&values[1..], &monitor).is_err());
        }
    }
}
