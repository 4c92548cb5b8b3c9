//! Convolution of sites by a kernel map, forward and backward.

use super::block::{BLOCK, Block};
use super::kernel_map::KernelMap;
use super::product::{Matrix, add_outer_products, add_products};
use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use crate::nn::workspace::Workspace;
use crate::parallel::{Monitor, fold_ordered};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Parts whose gradients of the weights are summed on their own, at most.
const PARTS: usize = 32;
/// Blocks of such a part, at least.
const PART: usize = 8;

/// Which sites a convolution connects, in both directions.
#[derive(Clone, Copy, Debug)]
pub struct Connections<'a> {
    forward: &'a KernelMap,
    backward: &'a KernelMap,
    /// Whether weight k of the backward map is the last but k of the forward map.
    mirrored: bool,
}

impl<'a> Connections<'a> {
    /// Of a sub-manifold convolution with a centred kernel: the map is its own inverse, with the weights in the opposite
    /// order.
    pub fn centred(map: &'a KernelMap) -> Self {
        Self { forward: map, backward: map, mirrored: true }
    }

    /// Of a map and its transposed one ([`KernelMap::transposed`]).
    pub fn directed(forward: &'a KernelMap, backward: &'a KernelMap) -> Self {
        Self { forward, backward, mirrored: false }
    }

    /// From the outputs to the inputs: the transposed convolution.
    #[must_use]
    pub fn reversed(self) -> Self {
        Self { forward: self.backward, backward: self.forward, ..self }
    }

    /// The pairs of sites.
    pub fn map(&self) -> &'a KernelMap {
        self.forward
    }
}

/// A convolution: which sites are connected, and the weights.
#[derive(Clone, Copy, Debug)]
pub struct Convolution<'a, T> {
    /// The connected sites.
    pub connections: Connections<'a>,
    /// For each weight of the kernel a matrix of input channels by output channels, row-major.
    pub weights: &'a [T],
    /// Input channels.
    pub inputs: usize,
    /// Output channels.
    pub outputs: usize,
}

/// Gradients of a loss.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvolutionGradient<T> {
    /// With respect to the values of the input sites.
    pub values: Vec<T>,
    /// With respect to the weights.
    pub weights: Vec<T>,
}

impl<T: Scalar> Convolution<'_, T> {
    /// The values of the output sites, one row of channels a site; `values` are those of the input sites.
    ///
    /// # Errors
    /// If a length does not fit, or the work was cancelled.
    pub fn forward(&self, values: &[T], monitor: &Monitor) -> Result<Vec<T>> {
        self.forward_in(values, &Workspace::default(), monitor)
    }

    /// As [`Convolution::forward`], in a buffer of a workspace.
    ///
    /// # Errors
    /// As [`Convolution::forward`].
    pub fn forward_in(&self, values: &[T], workspace: &Workspace<T>, monitor: &Monitor) -> Result<Vec<T>> {
        let map = self.connections.forward;
        self.check(values.len(), map.inputs() * self.inputs, "values of the input sites")?;
        self.apply(map, values, workspace.zeros(map.outputs() * self.outputs), monitor)
    }

    /// The gradients of a loss, given those with respect to the output sites.
    ///
    /// # Errors
    /// If a length does not fit, or the work was cancelled.
    pub fn backward(&self, values: &[T], gradient: &[T], monitor: &Monitor) -> Result<ConvolutionGradient<T>> {
        self.backward_in(values, gradient, &Workspace::default(), monitor)
    }

    /// As [`Convolution::backward`], in buffers of a workspace.
    ///
    /// # Errors
    /// As [`Convolution::backward`].
    pub fn backward_in(
        &self,
        values: &[T],
        gradient: &[T],
        workspace: &Workspace<T>,
        monitor: &Monitor,
    ) -> Result<ConvolutionGradient<T>> {
        let map = self.connections.forward;
        self.check(values.len(), map.inputs() * self.inputs, "values of the input sites")?;
        self.check(gradient.len(), map.outputs() * self.outputs, "gradients of the output sites")?;
        let weights = self.turned_weights();
        let turned = Convolution { weights: &weights, inputs: self.outputs, outputs: self.inputs, ..*self };
        let found = workspace.zeros(map.inputs() * self.inputs);
        Ok(ConvolutionGradient {
            values: turned.apply(self.connections.backward, gradient, found, monitor)?,
            weights: self.weight_gradient(values, gradient, monitor)?,
        })
    }

    /// Fails unless there are so many values as the maps and channels tell.
    fn check(&self, found: usize, expected: usize, what: &str) -> Result<()> {
        let weights = self.connections.forward.volume() * self.inputs * self.outputs;
        match (found == expected, self.weights.len() == weights) {
            (true, true) => Ok(()),
            (true, false) => Err(Error::input(format!(
                "{} weights (allowed: {weights}, for {} positions, {} input and {} output channels)",
                self.weights.len(),
                self.connections.forward.volume(),
                self.inputs,
                self.outputs
            ))),
            (false, _) => Err(Error::input(format!("{found} {what} (allowed: {expected})"))),
        }
    }

    /// Adds to `out`, which is all 0; each output site is summed weight after weight by one thread.
    fn apply(&self, map: &KernelMap, values: &[T], mut out: Vec<T>, monitor: &Monitor) -> Result<Vec<T>> {
        if self.outputs == 0 {
            return Ok(out);
        }
        let x = Matrix { values, columns: self.inputs };
        out.par_chunks_mut(BLOCK * self.outputs).zip(&map.blocks).try_for_each(|(out, block)| {
            monitor.check()?;
            Arch::new().dispatch(Outputs {
                block,
                x,
                weights: Matrix { values: self.weights, columns: self.outputs },
                out,
            });
            Ok::<(), Error>(())
        })?;
        Ok(out)
    }

    /// The matrix of each weight transposed, in the order of the backward map.
    fn turned_weights(&self) -> Vec<T> {
        let mut turned = Vec::with_capacity(self.weights.len());
        let size = self.inputs * self.outputs;
        let volume = self.connections.forward.volume();
        for weight in 0..volume {
            let own = if self.connections.mirrored { volume - 1 - weight } else { weight };
            let matrix = &self.weights[own * size..][..size];
            for output in 0..self.outputs {
                turned.extend((0..self.inputs).map(|input| matrix[input * self.outputs + output]));
            }
        }
        turned
    }

    /// Sums over parts of fixed size, added in order.
    fn weight_gradient(&self, values: &[T], gradient: &[T], monitor: &Monitor) -> Result<Vec<T>> {
        let blocks = &self.connections.forward.blocks;
        let x = Matrix { values, columns: self.inputs };
        let part = blocks.len().div_ceil(PARTS).max(PART);
        let kernel = |range: std::ops::Range<usize>| {
            let mut sum = vec![T::ZERO; self.weights.len()];
            if monitor.is_cancelled() {
                return sum;
            }
            for number in range {
                let y = Matrix { values: &gradient[number * BLOCK * self.outputs..], columns: self.outputs };
                Arch::new().dispatch(WeightGradient { block: &blocks[number], x, y, sum: &mut sum });
            }
            sum
        };
        let add = |mut sum: Vec<T>, part: Vec<T>| {
            sum.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
            sum
        };
        let sum = fold_ordered(blocks.len(), part, kernel, add);
        monitor.check()?;
        Ok(sum.unwrap_or_else(|| vec![T::ZERO; self.weights.len()]))
    }
}

/// The output sites of a block.
struct Outputs<'a, T> {
    block: &'a Block,
    x: Matrix<'a, T>,
    /// The matrices of all weights, one after the other.
    weights: Matrix<'a, T>,
    out: &'a mut [T],
}

impl<T: Scalar> WithSimd for Outputs<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let size = self.x.columns * self.weights.columns;
        for (weight, values) in self.weights.values.chunks_exact(size.max(1)).enumerate() {
            let matrix = Matrix { values, ..self.weights };
            add_products(self.block.pairs(weight), self.x, matrix, self.out);
        }
    }
}

/// What a block adds to the gradients of the weights.
struct WeightGradient<'a, T> {
    block: &'a Block,
    x: Matrix<'a, T>,
    y: Matrix<'a, T>,
    sum: &'a mut [T],
}

impl<T: Scalar> WithSimd for WeightGradient<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let size = self.x.columns * self.y.columns;
        for (weight, sum) in self.sum.chunks_exact_mut(size.max(1)).enumerate() {
            add_outer_products(self.block.pairs(weight), self.x, self.y, sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Kernel, Sites};
    use super::*;
    use crate::nn::testing::{differences, numbers, relative_error};
    use crate::random::stream;

    fn sites(count: usize, extent: usize) -> Sites<3> {
        let mut s = stream(4, 0);
        let keys = (0..count)
            .map(|_| Sites::<3>::key(s.below(2) as u32, [0; 3].map(|_: i64| s.below(extent) as i64)).unwrap())
            .collect();
        Sites::of_keys(keys, &Monitor::default()).unwrap()
    }

    /// The connections of sub-manifold, strided, and transposed convolutions of the same fine sites.
    fn with_connections(fine: &Sites<3>, mut check: impl FnMut(Connections<'_>)) {
        let monitor = Monitor::default();
        let coarse = fine.coarser(2, &monitor).unwrap();
        let own = KernelMap::new(fine, fine, Kernel::centred(3), &monitor).unwrap();
        check(Connections::centred(&own));
        for kernel in [Kernel::cubes(2), Kernel { size: 3, stride: 2, dilation: 1, padding: 1 }] {
            let down = KernelMap::new(fine, &coarse, kernel, &monitor).unwrap();
            let up = down.transposed(&monitor).unwrap();
            check(Connections::directed(&down, &up));
            check(Connections::directed(&down, &up).reversed());
        }
    }

    #[test]
    fn gradients_are_those_of_finite_differences() {
        let monitor = Monitor::default();
        with_connections(&sites(400, 8), |connections| {
            let map = connections.map();
            for (inputs, outputs) in [(3, 2), (9, 25)] {
                let values = numbers(1, map.inputs() * inputs);
                let weights = numbers(2, map.volume() * inputs * outputs);
                let towards = numbers(3, map.outputs() * outputs);
                let of = |weights: &[f64], values: &[f64]| -> f64 {
                    let layer = Convolution { connections, weights, inputs, outputs };
                    let out = layer.forward(values, &monitor).unwrap();
                    out.iter().zip(&towards).map(|(o, t)| o * t).sum()
                };
                let layer = Convolution { connections, weights: &weights, inputs, outputs };
                let found = layer.backward(&values, &towards, &monitor).unwrap();
                let by_values = differences(&values, 40, |values| of(&weights, values));
                let by_weights = differences(&weights, 40, |weights| of(weights, &values));
                assert!(relative_error(&found.values, &by_values) < 1e-6);
                assert!(relative_error(&found.weights, &by_weights) < 1e-6);
            }
        });
    }

    #[test]
    fn results_are_the_same_bytes_for_any_number_of_threads() {
        let monitor = Monitor::default();
        let sites = sites(6000, 24);
        let map = KernelMap::new(&sites, &sites, Kernel::centred(3), &monitor).unwrap();
        let connections = Connections::centred(&map);
        let cast = |values: Vec<f64>| -> Vec<f32> { values.into_iter().map(|v| v as f32).collect() };
        let (values, weights) = (cast(numbers(1, sites.len() * 20)), cast(numbers(2, 27 * 20 * 18)));
        let towards = cast(numbers(3, sites.len() * 18));
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let layer = Convolution { connections, weights: &weights, inputs: 20, outputs: 18 };
            pool.install(|| {
                let out = layer.forward(&values, &monitor).unwrap();
                (out, layer.backward(&values, &towards, &monitor).unwrap())
            })
        };
        let one = run(1);
        assert!([2, 3, 8].into_iter().all(|threads| run(threads) == one));
        assert!(one.0.iter().any(|v| *v != 0.0));
    }

    #[test]
    fn lengths_that_do_not_fit_are_named() {
        with_connections(&sites(50, 6), |connections| {
            let weights = vec![0.0f32; connections.map().volume()];
            let layer = Convolution { connections, weights: &weights, inputs: 1, outputs: 1 };
            let message = layer.forward(&[1.0], &Monitor::default()).unwrap_err().to_string();
            assert!(message.contains("values of the input sites"), "{message}");
            let wrong = Convolution { weights: &weights[1..], ..layer };
            let values = vec![0.0; connections.map().inputs()];
            let message = wrong.forward(&values, &Monitor::default()).unwrap_err().to_string();
            assert!(message.contains(&format!("{} weights", weights.len() - 1)), "{message}");
        });
    }
}
