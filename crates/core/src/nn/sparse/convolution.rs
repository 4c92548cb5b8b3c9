//! Direct sparse convolution and its gradients (algorithms 2 and 3 of Hackel 2018, chapter 6).
//!
//! The thesis adds to a dense buffer by atomic operations; here each part of the buffer belongs to one thread, and sums
//! have a fixed order. Responses that are too weak for the bound are dropped as soon as they are known.

use super::attention::Selection;
use super::filter::SparseFilter;
use super::forward::{Responses, Work};
use super::slab::{Buffer, LANES, Slabs, Taps};
use super::tensor::{Shape, SparseTensor};
use crate::error::{Error, Result};
use crate::memory;
use crate::nn::scalar::Scalar;
use crate::parallel::{Monitor, fold_ordered};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// A direct sparse convolution: stride 1, the output as large as the input, zeros around it.
#[derive(Clone, Copy, Debug)]
pub struct SparseConvolution<'a, T> {
    /// The filters.
    pub filter: &'a SparseFilter<T>,
    /// One term an output channel, added to outputs that are not 0; none if empty.
    pub bias: &'a [T],
    /// Attention; `None` keeps all responses.
    pub selection: Option<Selection>,
}

/// Gradients of a loss.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseGradient<T> {
    /// With respect to the stored inputs, in their order.
    pub values: Vec<T>,
    /// With respect to the stored weights, in their order.
    pub weights: Vec<T>,
    /// With respect to the biases.
    pub bias: Vec<T>,
}

/// A slab of a sample, for a group of output channels.
struct Task<'a, T> {
    input: &'a SparseTensor<T>,
    slabs: &'a Slabs<'a>,
    /// Weights of the group, for each input channel.
    taps: &'a [Taps<T>],
    sample: usize,
    slab: usize,
}

impl<T: Scalar> SparseConvolution<'_, T> {
    /// Number of groups of output channels.
    fn groups(&self) -> usize {
        self.filter.outputs.div_ceil(LANES)
    }

    fn check(&self, input: &SparseTensor<T>) -> Result<()> {
        let Shape { channels, extent, .. } = input.shape();
        let SparseFilter { inputs, outputs, axes, .. } = *self.filter;
        if *channels != inputs || extent.len() != axes {
            let found = format!("an input of {channels} channels and {} axes", extent.len());
            return Err(Error::input(format!("{found} (allowed: {inputs} and {axes}, as the filters)")));
        }
        if !self.bias.is_empty() && self.bias.len() != outputs {
            return Err(Error::input(format!("{} terms for {outputs} output channels", self.bias.len())));
        }
        self.selection.map_or(Ok(()), Selection::validate)
    }

    /// The responses that are kept.
    ///
    /// # Errors
    /// As [`SparseConvolution::responses`].
    pub fn forward(&self, input: &SparseTensor<T>, monitor: &Monitor) -> Result<SparseTensor<T>> {
        Ok(self.responses(input, monitor)?.tensor)
    }

    /// The responses. O((ρ_d · ρ_f · s_f^k · c_in) · s_d^k · c_out · b) (eq. 6.1), without its logarithm. With attention, memory
    /// is in proportion to the bound of the responses that are kept: about three times, and at worst 32 times it.
    ///
    /// # Errors
    /// If channels or axes do not fit, a parameter is out of range, or the work was cancelled.
    pub fn responses(&self, input: &SparseTensor<T>, monitor: &Monitor) -> Result<Responses<T>> {
        self.check(input)?;
        Work::new(self.filter, self.bias, self.selection, input)?.responses(monitor)
    }

    /// The gradients with respect to stored inputs and weights (eq. 6.3 and 6.4), given those with respect to the entries
    /// of the output.
    ///
    /// # Errors
    /// If the output is not one of this input, or the work was cancelled.
    pub fn backward(
        &self,
        input: &SparseTensor<T>,
        gradient: &SparseTensor<T>,
        monitor: &Monitor,
    ) -> Result<SparseGradient<T>> {
        self.check(input)?;
        let (shape, to) = (input.shape(), gradient.shape());
        if (to.samples, to.channels, &to.extent) != (shape.samples, self.filter.outputs, &shape.extent) {
            return Err(Error::input(format!("a gradient of shape {to:?} for an input of shape {shape:?}")));
        }
        let slabs = Slabs::new(shape, self.filter.size);
        let taps: Vec<Vec<Taps<T>>> = (0..self.groups()).map(|group| self.filter.taps(group, shape)).collect();
        let count = slabs.count();
        memory::require(Buffer::<T>::bytes(slabs.around(0).len()), "the buffer of a convolution")?;
        let part = |range: Range<usize>| {
            let mut found = Part::new(self.filter, self.groups());
            let mut buffer = Buffer::default();
            for number in range {
                if monitor.is_cancelled() {
                    break;
                }
                let (sample, slab) = (number / count, number % count);
                let start = found.values.len();
                for (group, taps) in taps.iter().enumerate() {
                    let task = Task { input, slabs: &slabs, taps, sample, slab };
                    task.add_gradients(gradient, group, &mut buffer, &mut Sums { part: &mut found, start });
                }
            }
            found
        };
        let tasks = shape.samples * count;
        let found = fold_ordered(tasks, tasks.div_ceil(PARTS).max(1), part, Part::joined);
        monitor.check()?;
        let found = found.unwrap_or_else(|| Part::new(self.filter, self.groups()));
        Ok(SparseGradient {
            values: found.in_order(input, count, &slabs),
            weights: found.stored_weights(self.filter),
            bias: self.bias_gradient(gradient),
        })
    }

    /// Sum of the gradients of each output channel.
    fn bias_gradient(&self, gradient: &SparseTensor<T>) -> Vec<T> {
        let mut found = vec![T::ZERO; self.bias.len()];
        let cells = gradient.shape().cells() as u64;
        for (&key, &value) in gradient.keys().iter().zip(gradient.values()) {
            if let Some(sum) = found.get_mut((key / cells) as usize % self.filter.outputs) {
                *sum += value;
            }
        }
        found
    }
}

/// Parts whose gradients of the weights are summed on their own, at most.
const PARTS: usize = 16;

/// Gradients of some slabs.
struct Part<T> {
    /// Of the inputs, slab after slab, channel after channel.
    values: Vec<T>,
    /// Of the weights: (group, input channel, position) with lanes.
    weights: Vec<[T; LANES]>,
    inputs: usize,
    volume: usize,
}

impl<T: Scalar> Part<T> {
    fn new(filter: &SparseFilter<T>, groups: usize) -> Self {
        let (inputs, volume) = (filter.inputs, filter.volume());
        Self { values: Vec::new(), weights: vec![[T::ZERO; LANES]; groups * inputs * volume], inputs, volume }
    }

    fn joined(mut self, mut other: Self) -> Self {
        self.values.append(&mut other.values);
        for (sums, more) in self.weights.iter_mut().zip(other.weights) {
            sums.iter_mut().zip(more).for_each(|(sum, value)| *sum += value);
        }
        self
    }

    /// The gradients of the inputs in the order of their keys.
    fn in_order(&self, input: &SparseTensor<T>, count: usize, slabs: &Slabs<'_>) -> Vec<T> {
        let (mut found, mut next) = (vec![T::ZERO; input.len()], 0);
        for number in 0..input.shape().samples * count {
            for channel in 0..self.inputs {
                let plane = number / count * self.inputs + channel;
                let entries = input.entries(plane, slabs.cells(number % count));
                let end = next + entries.len();
                found[entries].copy_from_slice(&self.values[next..end]);
                next = end;
            }
        }
        found
    }

    /// The gradients of the weights that are stored.
    fn stored_weights(&self, filter: &SparseFilter<T>) -> Vec<T> {
        let of = |&key: &u64| {
            let (plane, position) = (key as usize / self.volume, key as usize % self.volume);
            let (output, input) = (plane / self.inputs, plane % self.inputs);
            self.weights[(output / LANES * self.inputs + input) * self.volume + position][output % LANES]
        };
        filter.keys().iter().map(of).collect()
    }
}

/// Where the gradients of a slab are added: those of the inputs begin at `start`.
struct Sums<'a, T> {
    part: &'a mut Part<T>,
    start: usize,
}

impl<T: Scalar> Task<'_, T> {
    /// Adds the gradients of a group of output channels.
    fn add_gradients(&self, gradient: &SparseTensor<T>, group: usize, buffer: &mut Buffer<T>, sums: &mut Sums<'_, T>) {
        let around = self.slabs.around(self.slab);
        buffer.reserve(around.len());
        let channels = gradient.shape().channels;
        for (lane, output) in (group * LANES..channels.min((group + 1) * LANES)).enumerate() {
            for entry in gradient.entries(self.sample * channels + output, around.clone()) {
                let cell = gradient.cell(entry) - around.start;
                buffer.values[cell][lane] = gradient.values()[entry];
                buffer.mark(cell);
            }
        }
        Arch::new().dispatch(Backward { task: self, group, around, buffer, sums });
        buffer.clear();
    }
}

/// Adds the gradients of a slab; the buffer holds those of the outputs.
struct Backward<'a, 'b, 'c, T> {
    task: &'a Task<'b, T>,
    group: usize,
    around: Range<usize>,
    buffer: &'a Buffer<T>,
    sums: &'a mut Sums<'c, T>,
}

impl<T: Scalar> WithSimd for Backward<'_, '_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { task, group, around, buffer, sums } = self;
        let mut next = sums.start;
        for (channel, taps) in task.taps.iter().enumerate() {
            let plane = task.sample * task.taps.len() + channel;
            let first = (group * sums.part.inputs + channel) * sums.part.volume;
            for entry in task.input.entries(plane, task.slabs.cells(task.slab)) {
                let value = task.input.values()[entry];
                let mut own = [T::ZERO; LANES];
                task.slabs.connect(task.input.cell(entry), taps, &around, |tap, output| {
                    let gradient = &buffer.values[output - around.start];
                    let weights = &mut sums.part.weights[first + tap.position];
                    for lane in 0..LANES {
                        own[lane] = gradient[lane].mul_add(tap.target.weights[lane], own[lane]);
                        weights[lane] = gradient[lane].mul_add(value, weights[lane]);
                    }
                });
                let own = own.into_iter().sum();
                match sums.part.values.get_mut(next) {
                    Some(sum) => *sum += own,
                    None => sums.part.values.push(own),
                }
                next += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::attention::Attention;
    use super::*;
    use crate::nn::testing::{differences, numbers, relative_error};
    use crate::random::stream;

    fn sparse(shape: &Shape, density: f64, seed: u64) -> SparseTensor<f64> {
        let mut draws = stream(seed, 0);
        let count = shape.samples * shape.channels * shape.cells();
        let mut dense = numbers(seed, count);
        dense.iter_mut().for_each(|v| *v = if draws.uniform() < density { *v } else { 0.0 });
        SparseTensor::of_dense(shape.clone(), &dense).unwrap()
    }

    fn filter(channels: [usize; 2], axes: usize, density: f64) -> SparseFilter<f64> {
        let count = channels[0] * channels[1] * 3usize.pow(axes as u32);
        let whole = SparseFilter::of_dense(channels, 3, axes, numbers(8, count)).unwrap();
        let kept: Vec<bool> = numbers(9, count).into_iter().map(|v| v.abs() < density).collect();
        whole.pruned(|i, _| kept[i])
    }

    /// The convolution by its definition.
    fn brute(input: &SparseTensor<f64>, filter: &SparseFilter<f64>) -> Vec<f64> {
        let (shape, dense) = (input.shape(), input.to_dense());
        let (cells, volume, axes) = (shape.cells(), filter.volume(), shape.extent.len());
        let mut out = vec![0.0; shape.samples * filter.outputs * cells];
        for (&key, &weight) in filter.keys().iter().zip(filter.values()) {
            let (plane, position) = (key as usize / volume, key as usize % volume);
            for sample in 0..shape.samples {
                for cell in 0..cells {
                    let at = shape.position(cell);
                    let from: Option<usize> = (0..axes).try_fold(0, |index, a| {
                        let step = position / 3usize.pow((axes - 1 - a) as u32) % 3;
                        let place = (at[a] + step).checked_sub(1).filter(|&p| p < shape.extent[a])?;
                        Some(index * shape.extent[a] + place)
                    });
                    if let Some(from) = from {
                        let value = dense[(sample * filter.inputs + plane % filter.inputs) * cells + from];
                        out[(sample * filter.outputs + plane / filter.inputs) * cells + cell] += weight * value;
                    }
                }
            }
        }
        out
    }

    #[test]
    fn responses_are_those_of_the_definition_in_every_number_of_axes() {
        // The last one in strips of layers.
        for extent in [&[40][..], &[9, 300], &[70, 24, 30], &[4, 3, 5, 6], &[3, 97, 95]] {
            let shape = Shape::new(2, 3, extent).unwrap();
            let (input, filter) = (sparse(&shape, 0.2, 3), filter([3, 11], extent.len(), 0.5));
            let layer = SparseConvolution { filter: &filter, bias: &[], selection: None };
            let found = layer.forward(&input, &Monitor::default()).unwrap().to_dense();
            let expected = brute(&input, &filter);
            let error = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-12, "{extent:?}: {error}");
        }
    }

    #[test]
    fn gradients_are_those_of_finite_differences_on_what_is_stored() {
        let monitor = Monitor::default();
        // Large enough for several slabs.
        let shape = Shape::new(2, 2, &[5, 130, 90]).unwrap();
        let (input, filter) = (sparse(&shape, 0.02, 4), filter([2, 9], 3, 0.6));
        let bias = numbers(5, 9);
        for selection in [None, Some(Selection { attention: Attention::Positive, density: 0.05 })] {
            let layer = SparseConvolution { filter: &filter, bias: &bias, selection };
            let out = layer.forward(&input, &monitor).unwrap();
            let towards = numbers(6, out.len());
            // The loss of the entries that are kept: the selection is held.
            let of = |layer: &SparseConvolution<'_, f64>, input: &SparseTensor<f64>| -> f64 {
                let all = SparseConvolution { selection: None, ..*layer }.forward(input, &monitor).unwrap();
                let value = |key: &u64| all.keys().binary_search(key).map_or(0.0, |at| all.values()[at]);
                out.keys().iter().zip(&towards).map(|(key, t)| t * value(key)).sum()
            };
            let found = layer.backward(&input, &out.with_values(towards.clone()).unwrap(), &monitor).unwrap();
            let by_values =
                differences(input.values(), 12, |values| of(&layer, &input.with_values(values.to_vec()).unwrap()));
            assert!(relative_error(&found.values, &by_values) < 1e-6);
            let by_weights = differences(filter.values(), 12, |values| {
                let mut moved = filter.clone();
                moved.values_mut().copy_from_slice(values);
                of(&SparseConvolution { filter: &moved, ..layer }, &input)
            });
            assert!(relative_error(&found.weights, &by_weights) < 1e-6);
            let by_bias = differences(&bias, 9, |bias| of(&SparseConvolution { bias, ..layer }, &input));
            assert!(relative_error(&found.bias, &by_bias) < 1e-6);
        }
    }

    #[test]
    fn the_strongest_are_found_where_they_crowd_and_where_many_are_equal() {
        // All strong inputs lie in a few layers, or in one strip of them, where the parts that drop too much are computed again.
        for (extent, axis) in [([96, 9, 11], 0), ([3, 96, 86], 1)] {
            the_strongest_are_those_of_the_definition(&Shape::new(1, 2, &extent).unwrap(), axis);
        }
    }

    fn the_strongest_are_those_of_the_definition(shape: &Shape, axis: usize) {
        let mut input = sparse(shape, 0.3, 12);
        let strong = |cell: usize| (40..44).contains(&shape.position(cell)[axis]);
        let values = (0..input.len()).map(|e| if strong(input.cell(e)) { 9.0 } else { 0.1 } * input.values()[e]);
        let values: Vec<f64> = values.collect();
        input = input.with_values(values).unwrap();
        let equal = input.with_values(vec![1.0; input.len()]).unwrap();
        let filter = filter([2, 10], 3, 0.7);
        let ones = SparseFilter::of_dense([2, 10], 3, 3, vec![1.0; 540]).unwrap();
        for (input, filter) in [(&input, &filter), (&equal, &ones)] {
            for attention in [Attention::Positive, Attention::Magnitude] {
                let selection = Selection { attention, density: 0.04 };
                let layer = SparseConvolution { filter, bias: &[0.25; 10], selection: Some(selection) };
                let found = layer.responses(input, &Monitor::default()).unwrap();
                let cells = shape.cells();
                for (channel, sums) in brute(input, filter).chunks(cells).enumerate() {
                    let biased = sums.iter().map(|&sum| if sum == 0.0 { 0.0 } else { sum + 0.25 });
                    let mut entries: Vec<(usize, f64)> = biased.enumerate().filter(|(_, v)| *v != 0.0).collect();
                    let share = entries.iter().filter(|(_, v)| *v > 0.0).count() as f64 / cells as f64;
                    assert!((found.densities[channel] - share).abs() < 1e-3);
                    selection.apply(&mut entries, cells);
                    let of = found.tensor.entries(channel, 0..cells);
                    let kept: Vec<usize> = of.clone().map(|entry| found.tensor.cell(entry)).collect();
                    assert_eq!(
                        kept,
                        entries.iter().map(|entry| entry.0).collect::<Vec<_>>(),
                        "{channel} {attention:?}"
                    );
                    let near =
                        |(entry, (_, v)): (usize, &(usize, f64))| (found.tensor.values()[entry] - v).abs() < 1e-12;
                    assert!(of.zip(&entries).all(near));
                }
            }
        }
    }

    #[test]
    fn what_does_not_fit_into_memory_or_is_not_finite_is_an_error() {
        let huge = SparseTensor::new(Shape::new(1, 1, &[1, 200_000, 200_000]).unwrap(), vec![5], vec![1.0]).unwrap();
        let filter = SparseFilter::of_dense([1, 1], 3, 3, vec![1.0; 27]).unwrap();
        let layer = SparseConvolution { filter: &filter, bias: &[], selection: None };
        let monitor = Monitor::default();
        assert!(layer.forward(&huge, &monitor).unwrap_err().to_string().contains("buffer"));
        assert!(layer.backward(&huge, &huge, &monitor).unwrap_err().to_string().contains("buffer"));
        assert!(SparseFilter::of_dense([1, 1], 1, 1, vec![f64::NAN]).unwrap_err().to_string().contains("finite"));
        let large = SparseTensor::new(Shape::new(1, 1, &[1, 2, 2]).unwrap(), vec![0, 1], vec![f64::MAX; 2]).unwrap();
        assert!(layer.forward(&large, &monitor).unwrap_err().to_string().contains("inf"));
    }

    #[test]
    fn results_are_the_same_bytes_for_any_number_of_threads() {
        let monitor = Monitor::default();
        let shape = Shape::new(3, 4, &[30, 40, 50]).unwrap();
        let (input, filter) = (sparse(&shape, 0.05, 4), filter([4, 10], 3, 1.0));
        let selection = Some(Selection { attention: Attention::Magnitude, density: 0.1 });
        let layer = SparseConvolution { filter: &filter, bias: &[], selection };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let out = layer.forward(&input, &monitor).unwrap();
                let back = layer.backward(&input, &out, &monitor).unwrap();
                (out, back)
            })
        };
        let one = run(1);
        assert_eq!(one.0.len(), 3 * 10 * 6000, "the bound of the density is reached");
        assert!([2, 3, 8].into_iter().all(|threads| run(threads) == one));
    }

    #[test]
    fn a_sample_has_the_same_bytes_alone_and_beside_others() {
        let monitor = Monitor::default();
        // Layers of several strips, of several blocks, of one, and of a small part of one.
        for extent in [&[5, 90, 95][..], &[26, 40, 60], &[40, 30, 30], &[90, 7, 5], &[4000], &[50, 3, 4, 5]] {
            let shape = Shape::new(7, 3, extent).unwrap();
            let (input, filter) = (sparse(&shape, 0.1, 4), filter([3, 9], extent.len(), 0.8));
            let selection = Some(Selection { attention: Attention::Magnitude, density: 0.05 });
            let layer = SparseConvolution { filter: &filter, bias: &[], selection };
            let all = layer.forward(&input, &monitor).unwrap();
            let alone = Shape::new(1, 3, extent).unwrap();
            let cells = shape.cells();
            for sample in 0..7 {
                let first = (sample * 3 * cells) as u64;
                let inside = (0..input.len()).filter(|&i| (first..first + 3 * cells as u64).contains(&input.keys()[i]));
                let (keys, values) = inside.map(|i| (input.keys()[i] - first, input.values()[i])).unzip();
                let one = SparseTensor::new(alone.clone(), keys, values).unwrap();
                let found = layer.forward(&one, &monitor).unwrap();
                let expected: Vec<f64> =
                    (0..9).flat_map(|c| all.entries(sample * 9 + c, 0..cells)).map(|i| all.values()[i]).collect();
                assert!(found.values() == expected, "{extent:?}, sample {sample}");
            }
        }
    }

    #[test]
    fn empty_tensors_and_single_entries_are_no_special_case() {
        let monitor = Monitor::default();
        let filter = SparseFilter::of_dense([1, 1], 3, 2, (1..=9).map(f64::from).collect()).unwrap();
        let layer = SparseConvolution { filter: &filter, bias: &[], selection: None };
        let shape = Shape::new(1, 1, &[3, 3]).unwrap();
        let none = SparseTensor::new(shape.clone(), vec![], vec![]).unwrap();
        assert!(layer.forward(&none, &monitor).unwrap().is_empty());
        // Cross-correlation: one entry in the middle gives the filter turned by half a turn.
        let one = SparseTensor::new(shape, vec![4], vec![1.0]).unwrap();
        let found = layer.forward(&one, &monitor).unwrap();
        assert_eq!(found.values(), [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0]);
        let other = Shape::new(1, 2, &[3, 3]).unwrap();
        let wrong = SparseTensor::new(other, vec![], vec![]).unwrap();
        assert!(layer.forward(&wrong, &monitor).unwrap_err().to_string().contains("2 channels"));
        assert!(SparseFilter::<f64>::of_dense([1, 1], 2, 2, vec![]).is_err());
    }
}
