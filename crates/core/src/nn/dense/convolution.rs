//! Convolution of whole grids: stride 1, the output as large as the input, zeros around it.

use super::Grid;
use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use crate::nn::sites::{Matrix, Pairs, add_outer_products, add_products};
use crate::parallel::{Monitor, fold_ordered};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Cells of a run along the last axis that are computed together, at most.
const RUN: usize = 128;
/// Runs that one task takes, at least.
const RUNS: usize = 4;
/// Parts whose gradients of the weights are summed on their own, at most.
const PARTS: usize = 16;

/// Numbers of the cells of a run.
const PLACES: [u8; RUN] = {
    let mut places = [0; RUN];
    let mut i = 0;
    while i < RUN {
        places[i] = i as u8;
        i += 1;
    }
    places
};

/// A dense convolution, as `conv1d` to `conv3d` of torch with padding `size / 2`.
#[derive(Clone, Copy, Debug)]
pub struct DenseConvolution<'a, T> {
    /// The cells.
    pub grid: &'a Grid,
    /// Weights along an axis, odd.
    pub size: usize,
    /// Output channels x input channels x positions (the last axis fastest), as in torch.
    pub weights: &'a [T],
    /// One term an output channel.
    pub bias: &'a [T],
}

/// Gradients of a loss.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseGradient<T> {
    /// With respect to the values.
    pub values: Vec<T>,
    /// With respect to the weights.
    pub weights: Vec<T>,
    /// With respect to the biases.
    pub bias: Vec<T>,
}

impl<T: Scalar> DenseConvolution<'_, T> {
    /// Positions of the weights.
    fn volume(&self) -> usize {
        self.size.pow(self.grid.extent.len() as u32)
    }

    /// Input channels.
    fn inputs(&self) -> usize {
        self.weights.len() / (self.volume() * self.bias.len()).max(1)
    }

    fn check(&self, values: usize) -> Result<()> {
        if self.size.is_multiple_of(2) || self.size > 15 {
            return Err(Error::parameter("size", self.size, "an odd number from 1 to 15"));
        }
        let (inputs, outputs) = (self.inputs(), self.bias.len());
        if inputs == 0 || inputs * outputs * self.volume() != self.weights.len() {
            let found = format!("{} weights for {outputs} output channels", self.weights.len());
            return Err(Error::input(format!("{found} (allowed: a multiple of {})", outputs * self.volume())));
        }
        match values == self.grid.rows() * inputs {
            true => Ok(()),
            false => Err(Error::input(format!("{values} values (allowed: {})", self.grid.rows() * inputs))),
        }
    }

    /// The values of the output channels. O(cells · positions · input channels · output channels).
    ///
    /// # Errors
    /// If a length does not fit, or the work was cancelled.
    pub fn forward(&self, values: &[T], monitor: &Monitor) -> Result<Vec<T>> {
        self.check(values.len())?;
        let mut out: Vec<T> = std::iter::repeat_n(self.bias, self.grid.rows()).flatten().copied().collect();
        let weights = self.matrices(|position, input, output| self.weight(position, input, output));
        self.add(values, Matrix { values: &weights, columns: self.bias.len() }, &mut out, monitor)?;
        Ok(out)
    }

    /// The gradients, given that with respect to the outputs.
    ///
    /// # Errors
    /// If a length does not fit, or the work was cancelled.
    pub fn backward(&self, values: &[T], gradient: &[T], monitor: &Monitor) -> Result<DenseGradient<T>> {
        self.check(values.len())?;
        let (inputs, outputs) = (self.inputs(), self.bias.len());
        if gradient.len() != self.grid.rows() * outputs {
            let expected = self.grid.rows() * outputs;
            return Err(Error::input(format!("{} gradients (allowed: {expected})", gradient.len())));
        }
        let last = self.volume() - 1;
        // The same convolution from outputs to inputs, with the weights in the opposite order.
        let mut turned = Vec::with_capacity(self.weights.len());
        for position in 0..=last {
            for output in 0..outputs {
                turned.extend((0..inputs).map(|input| self.weight(last - position, input, output)));
            }
        }
        let mut found = vec![T::ZERO; values.len()];
        self.add(gradient, Matrix { values: &turned, columns: inputs }, &mut found, monitor)?;
        let weights = self.weight_gradient(values, gradient, monitor)?;
        let mut bias = vec![0.0; outputs];
        gradient.chunks_exact(outputs).for_each(|row| bias.iter_mut().zip(row).for_each(|(b, g)| *b += g.wide()));
        Ok(DenseGradient { values: found, weights, bias: bias.into_iter().map(T::of).collect() })
    }

    fn weight(&self, position: usize, input: usize, output: usize) -> T {
        self.weights[(output * self.inputs() + input) * self.volume() + position]
    }

    /// For each position a matrix of input channels by output channels.
    fn matrices(&self, weight: impl Fn(usize, usize, usize) -> T) -> Vec<T> {
        let (inputs, outputs) = (self.inputs(), self.bias.len());
        let all = (0..self.volume()).flat_map(|p| (0..inputs).map(move |i| [p, i]));
        all.flat_map(|[p, i]| (0..outputs).map(move |o| [p, i, o])).map(|[p, i, o]| weight(p, i, o)).collect()
    }

    /// Adds to `out` the products of the values around each cell with the matrices.
    fn add(&self, values: &[T], weights: Matrix<'_, T>, out: &mut [T], monitor: &Monitor) -> Result<()> {
        let inputs = weights.values.len() / (self.volume() * weights.columns);
        let runs = Runs::new(self.grid, self.size);
        let length = *self.grid.extent.last().unwrap_or(&1);
        let lines = RUNS * RUN.div_ceil(length);
        out.par_chunks_mut(lines * length * weights.columns).enumerate().try_for_each(|(part, out)| {
            monitor.check()?;
            let x = Matrix { values, columns: inputs };
            Arch::new().dispatch(Forward { runs: &runs, first: part * lines, x, weights, out });
            Ok(())
        })
    }

    fn weight_gradient(&self, values: &[T], gradient: &[T], monitor: &Monitor) -> Result<Vec<T>> {
        let (inputs, outputs, volume) = (self.inputs(), self.bias.len(), self.volume());
        let runs = Runs::new(self.grid, self.size);
        let lines = self.grid.rows() / runs.length;
        let part = |range: Range<usize>| {
            let mut sum = vec![T::ZERO; self.weights.len()];
            if !monitor.is_cancelled() {
                let (x, y) = (Matrix { values, columns: inputs }, Matrix { values: gradient, columns: outputs });
                Arch::new().dispatch(Weights { runs: &runs, lines: range, x, y, sum: &mut sum });
            }
            sum
        };
        let add = |mut sum: Vec<T>, part: Vec<T>| {
            sum.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
            sum
        };
        let size = lines.div_ceil(PARTS).max(RUNS);
        let sums = fold_ordered(lines, size, part, add).unwrap_or_else(|| vec![T::ZERO; self.weights.len()]);
        monitor.check()?;
        let mut found = vec![T::ZERO; sums.len()];
        for (number, &sum) in sums.iter().enumerate() {
            let (rest, output) = (number / outputs, number % outputs);
            let (position, input) = (rest / inputs, rest % inputs);
            found[(output * inputs + input) * volume + position] = sum;
        }
        Ok(found)
    }
}

/// Work on a link. A trait and not a closure: its method is compiled for the instruction set of the caller.
trait OnLink {
    fn link(&mut self, link: Link);
}

/// The lines of cells along the last axis, and the lines that a filter connects with each.
struct Runs<'a> {
    extent: &'a [usize],
    /// Cells of a line.
    length: usize,
    /// Lines of a sample.
    lines: usize,
    size: usize,
}

/// A run of output cells, the run of input cells that a position of the filter connects with it, and that position.
struct Link {
    position: usize,
    outputs: Range<usize>,
    /// First cell of the inputs.
    input: usize,
}

impl<'a> Runs<'a> {
    fn new(grid: &'a Grid, size: usize) -> Self {
        let length = *grid.extent.last().unwrap_or(&1);
        Self { extent: &grid.extent, length, lines: grid.cells() / length, size }
    }

    /// The line that a row of the filter's positions connects with a line, if it lies inside.
    #[inline(always)]
    fn other(&self, line: usize, row: usize) -> Option<usize> {
        let (mut rest, mut steps) = (line % self.lines, row);
        let (mut other, mut stride) = (line - rest, 1);
        for &length in self.extent[..self.extent.len() - 1].iter().rev() {
            let at = (rest % length + steps % self.size).checked_sub(self.size / 2).filter(|&at| at < length)?;
            other += at * stride;
            (rest, steps, stride) = (rest / length, steps / self.size, stride * length);
        }
        Some(other)
    }

    /// Gives `work` all links of a line, position after position.
    #[inline(always)]
    fn links(&self, line: usize, mut work: impl OnLink) {
        let reach = self.size / 2;
        for row in 0..self.size.pow(self.extent.len() as u32 - 1) {
            let Some(other) = self.other(line, row) else { continue };
            for step in 0..self.size {
                let (first, end) = (reach.saturating_sub(step), (self.length + reach).saturating_sub(step));
                let end = end.min(self.length);
                let mut start = first;
                while start < end {
                    let outputs = start..end.min(start + RUN);
                    start = outputs.end;
                    let input = other * self.length + outputs.start + step - reach;
                    work.link(Link { position: row * self.size + step, outputs, input });
                }
            }
        }
    }
}

struct Forward<'a, T> {
    runs: &'a Runs<'a>,
    /// Number of the first line of `out`.
    first: usize,
    x: Matrix<'a, T>,
    weights: Matrix<'a, T>,
    out: &'a mut [T],
}

impl<T: Scalar> WithSimd for Forward<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { runs, first, x, weights, out } = self;
        let inputs: [u32; RUN] = PLACES.map(u32::from);
        for (line, out) in (first..).zip(out.chunks_exact_mut(runs.length * weights.columns)) {
            runs.links(line, OutputLine { inputs: &inputs, x, weights, out });
        }
    }
}

/// A line of output cells.
struct OutputLine<'a, T> {
    /// Numbers of the rows of a run.
    inputs: &'a [u32; RUN],
    x: Matrix<'a, T>,
    weights: Matrix<'a, T>,
    out: &'a mut [T],
}

impl<T: Scalar> OnLink for OutputLine<'_, T> {
    #[inline(always)]
    fn link(&mut self, Link { position, outputs, input }: Link) {
        let Self { inputs, x, weights, out } = self;
        let size = x.columns * weights.columns;
        let pairs = Pairs { outputs: &PLACES[..outputs.len()], inputs: &inputs[..outputs.len()] };
        let x = Matrix { values: &x.values[input * x.columns..], ..*x };
        let values = &weights.values[position * size..][..size];
        add_products(pairs, x, Matrix { values, ..*weights }, &mut out[outputs.start * weights.columns..]);
    }
}

struct Weights<'a, T> {
    runs: &'a Runs<'a>,
    lines: Range<usize>,
    x: Matrix<'a, T>,
    y: Matrix<'a, T>,
    sum: &'a mut [T],
}

impl<T: Scalar> WithSimd for Weights<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { runs, lines, x, y, sum } = self;
        let inputs: [u32; RUN] = PLACES.map(u32::from);
        for line in lines {
            let y = Matrix { values: &y.values[line * runs.length * y.columns..], ..y };
            runs.links(line, GradientLine { inputs: &inputs, x, y, sum: &mut *sum });
        }
    }
}

/// The gradients of a line of output cells.
struct GradientLine<'a, T> {
    /// Numbers of the rows of a run.
    inputs: &'a [u32; RUN],
    x: Matrix<'a, T>,
    y: Matrix<'a, T>,
    sum: &'a mut [T],
}

impl<T: Scalar> OnLink for GradientLine<'_, T> {
    #[inline(always)]
    fn link(&mut self, Link { position, outputs, input }: Link) {
        let Self { inputs, x, y, sum } = self;
        let size = x.columns * y.columns;
        let pairs = Pairs { outputs: &PLACES[..outputs.len()], inputs: &inputs[..outputs.len()] };
        let x = Matrix { values: &x.values[input * x.columns..], ..*x };
        let y = Matrix { values: &y.values[outputs.start * y.columns..], ..*y };
        add_outer_products(pairs, x, y, &mut sum[position * size..][..size]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{differences, numbers, relative_error};

    /// The convolution by its definition.
    fn plain(layer: &DenseConvolution<'_, f64>, values: &[f64]) -> Vec<f64> {
        let (inputs, outputs, extent) = (layer.inputs(), layer.bias.len(), &layer.grid.extent);
        let position = |mut cell: usize| -> Vec<usize> {
            let mut all: Vec<usize> = extent.iter().rev().map(|&n| (cell % n, cell /= n).0).collect();
            all.reverse();
            all
        };
        let cells = layer.grid.cells();
        let mut out: Vec<f64> = std::iter::repeat_n(layer.bias, layer.grid.rows()).flatten().copied().collect();
        for (sample, cell, other) in
            (0..layer.grid.samples).flat_map(|s| (0..cells).flat_map(move |c| (0..cells).map(move |o| (s, c, o))))
        {
            let steps = position(cell).into_iter().zip(position(other));
            let steps: Vec<isize> = steps.map(|(c, o)| o as isize - c as isize + (layer.size / 2) as isize).collect();
            if steps.iter().any(|&step| step < 0 || step >= layer.size as isize) {
                continue;
            }
            let weight = steps.iter().fold(0, |all, &step| all * layer.size + step as usize);
            for (o, i) in (0..outputs).flat_map(|o| (0..inputs).map(move |i| (o, i))) {
                let w = layer.weights[(o * inputs + i) * layer.volume() + weight];
                out[(sample * cells + cell) * outputs + o] += w * values[(sample * cells + other) * inputs + i];
            }
        }
        out
    }

    #[test]
    fn values_and_gradients_are_those_of_the_definition() {
        let monitor = Monitor::default();
        for (extent, size, inputs, outputs) in [
            (&[7][..], 3usize, 2, 3),
            (&[5, 6], 5, 1, 9),
            (&[4, 3, 5], 3, 3, 2),
            (&[300], 3, 1, 1),
            (&[2, 2, 2], 3, 9, 17),
        ] {
            let grid = Grid::new(2, extent).unwrap();
            let volume = size.pow(extent.len() as u32);
            let (weights, bias) = (numbers(1, volume * inputs * outputs), numbers(2, outputs));
            let (values, towards) = (numbers(3, grid.rows() * inputs), numbers(4, grid.rows() * outputs));
            let layer = DenseConvolution { grid: &grid, size, weights: &weights, bias: &bias };
            let found = layer.forward(&values, &monitor).unwrap();
            let close = |(found, plain): (&f64, f64)| (found - plain).abs() < 1e-12;
            assert!(found.iter().zip(plain(&layer, &values)).all(close), "{extent:?}");
            let loss = |layer: DenseConvolution<'_, f64>, values: &[f64]| -> f64 {
                layer.forward(values, &monitor).unwrap().iter().zip(&towards).map(|(o, t)| o * t).sum()
            };
            let slopes = layer.backward(&values, &towards, &monitor).unwrap();
            let by_values = differences(&values, 40, |values| loss(layer, values));
            let by_weights = differences(&weights, 40, |w| loss(DenseConvolution { weights: w, ..layer }, &values));
            let by_bias = differences(&bias, 40, |b| loss(DenseConvolution { bias: b, ..layer }, &values));
            assert!(relative_error(&slopes.values, &by_values) < 1e-6);
            assert!(relative_error(&slopes.weights, &by_weights) < 1e-6);
            assert!(relative_error(&slopes.bias, &by_bias) < 1e-6);
        }
    }

    #[test]
    fn results_are_the_same_bytes_for_any_number_of_threads() {
        let (grid, monitor) = (Grid::new(3, &[16, 16, 16]).unwrap(), Monitor::default());
        let cast = |values: Vec<f64>| -> Vec<f32> { values.into_iter().map(|v| v as f32).collect() };
        let (weights, bias) = (cast(numbers(1, 27 * 8 * 12)), cast(numbers(2, 12)));
        let (values, towards) = (cast(numbers(3, grid.rows() * 8)), cast(numbers(4, grid.rows() * 12)));
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let layer = DenseConvolution { grid: &grid, size: 3, weights: &weights, bias: &bias };
            pool.install(|| {
                (layer.forward(&values, &monitor).unwrap(), layer.backward(&values, &towards, &monitor).unwrap())
            })
        };
        let one = run(1);
        assert!([2, 3, 8].into_iter().all(|threads| run(threads) == one));
    }

    #[test]
    fn lengths_that_do_not_fit_are_named() {
        let (grid, monitor) = (Grid::new(1, &[4]).unwrap(), Monitor::default());
        let layer = DenseConvolution { grid: &grid, size: 3, weights: &[1.0f32; 6], bias: &[0.0; 2] };
        assert!(layer.forward(&[0.0; 3], &monitor).unwrap_err().to_string().contains("3 values (allowed: 4)"));
        let even = DenseConvolution { size: 2, ..layer };
        assert!(even.forward(&[0.0; 4], &monitor).unwrap_err().to_string().contains("size"));
        let odd = DenseConvolution { weights: &[1.0; 7], ..layer };
        assert!(odd.forward(&[0.0; 4], &monitor).unwrap_err().to_string().contains("7 weights"));
        assert!(layer.backward(&[0.0; 4], &[0.0; 4], &monitor).unwrap_err().to_string().contains("gradients"));
        assert!(Grid::new(1, &[3, 0]).is_err() && Grid::new(1, &[]).is_err());
    }
}
