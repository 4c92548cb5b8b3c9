//! The responses of a direct sparse convolution, of which the strongest are kept.

use super::attention::Selection;
use super::filter::SparseFilter;
use super::slab::{LANES, Taps};
use super::strongest::{Collecting, Found};
use super::tensor::{Shape, SparseTensor};
use super::window::{Piece, Window};
use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use crate::parallel::{Monitor, map_ordered_with};
use std::ops::Range;

/// The output of a convolution.
#[derive(Clone, Debug, PartialEq)]
pub struct Responses<T> {
    /// The responses that are kept.
    pub tensor: SparseTensor<T>,
    /// For each output channel the share of the cells whose response is above 0 (by magnitude: not 0), before the strongest
    /// are selected, averaged over the samples: what the density regulariser follows.
    pub densities: Vec<f64>,
}

/// Parts of the outputs that are computed on their own, over all samples and groups of output channels.
const TASKS: usize = 16;
/// Fewest layers of a part, as a multiple of the layers of a filter.
const LAYERS: usize = 4;
/// A part keeps this many times the responses that it is expected to be left with.
const SLACK: f64 = 1.5;
/// And so many more; so many at the beginning.
const FEWEST: usize = 64;
/// From so many parts on it costs little to compute one again.
const MANY: usize = 4;

/// How many responses of a channel a part keeps.
#[derive(Clone, Copy, Debug)]
enum Keep {
    /// About as many as the bound of the whole leaves it.
    Expected,
    /// As many as the bound of the whole.
    Bound,
}

/// The responses of a tensor, in parts: layers of a sample for a group of output channels.
///
/// A part first keeps about as many of its strongest responses as the bound of the whole leaves it, and on the way as many as
/// the inputs so far let expect. Where some that it dropped may be among the strongest of the whole, it is computed again and
/// keeps as many as the bound. Parts hold about three times the bound in all, and 2 [`TASKS`] times at worst.
pub(super) struct Work<'a, T> {
    filter: &'a SparseFilter<T>,
    bias: &'a [T],
    selection: Option<Selection>,
    input: &'a SparseTensor<T>,
    taps: Vec<Vec<Taps<T>>>,
    /// The layers along the first axis of each part.
    layers: Vec<Range<usize>>,
    /// Most responses that a channel of a sample keeps.
    most: usize,
}

impl<'a, T: Scalar> Work<'a, T> {
    pub(super) fn new(
        filter: &'a SparseFilter<T>,
        bias: &'a [T],
        selection: Option<Selection>,
        input: &'a SparseTensor<T>,
    ) -> Self {
        let shape = input.shape();
        let taps: Vec<_> = (0..filter.outputs.div_ceil(LANES)).map(|group| filter.taps(group, shape)).collect();
        let length = shape.extent[0];
        let parts = (TASKS / (shape.samples * taps.len())).clamp(1, (length / (LAYERS * filter.size)).max(1));
        let layers = (0..parts).map(|part| part * length / parts..(part + 1) * length / parts).collect();
        let most = selection.map_or(usize::MAX, |selection| selection.most(shape.cells()));
        Self { filter, bias, selection, input, taps, layers, most }
    }

    /// The responses that are kept.
    pub(super) fn responses(&self, monitor: &Monitor) -> Result<Responses<T>> {
        let mut found = self.run(&(0..self.count()).collect::<Vec<_>>(), Keep::Expected, monitor)?;
        let short = self.short_of(&found);
        for (&number, part) in short.iter().zip(self.run(&short, Keep::Bound, monitor)?) {
            found[number] = part;
        }
        self.collected(&found)
    }

    /// Number of parts of all samples and groups.
    fn count(&self) -> usize {
        self.input.shape().samples * self.taps.len() * self.layers.len()
    }

    /// The responses of some parts.
    fn run(&self, numbers: &[usize], keep: Keep, monitor: &Monitor) -> Result<Vec<Found<T>>> {
        map_ordered_with(0..numbers.len(), monitor, Window::default, |window, i| {
            let (rest, part) = (numbers[i] / self.layers.len(), numbers[i] % self.layers.len());
            let (sample, group) = (rest / self.taps.len(), rest % self.taps.len());
            let layers = self.layers[part].clone();
            let enough = match keep {
                Keep::Expected if self.layers.len() > 1 => self.expected(sample, &layers),
                _ => self.most,
            };
            let enough_at_first = if self.layers.len() < MANY { enough } else { enough.min(FEWEST) };
            let mut bias = [T::ZERO; LANES];
            bias.iter_mut().zip(self.bias.iter().skip(group * LANES)).for_each(|(to, &from)| *to = from);
            let how = Collecting { bias, selection: self.selection, enough, enough_at_first };
            let reach = self.filter.size / 2;
            Piece { input: self.input, taps: &self.taps[group], sample, layers, reach }.responses(window, &how)
        })
    }

    /// Number of responses of a channel that a part should keep: its share of the inputs, and some more.
    fn expected(&self, sample: usize, layers: &Range<usize>) -> usize {
        let Shape { channels, extent, .. } = self.input.shape();
        let layer: usize = extent[1..].iter().product();
        let count = |layers: Range<usize>| -> usize {
            let cells = layers.start * layer..layers.end * layer;
            (0..*channels).map(|channel| self.input.entries(sample * channels + channel, cells.clone()).len()).sum()
        };
        let share = count(layers.clone()) as f64 / count(0..extent[0]).max(1) as f64;
        self.most.min((SLACK * share * self.most as f64) as usize + FEWEST)
    }

    /// The parts of a sample and a group, group after group.
    fn groups<'f>(&self, found: &'f [Found<T>]) -> impl Iterator<Item = &'f [Found<T>]> {
        found.chunks(self.layers.len())
    }

    /// Numbers of the parts that dropped responses which may be among the strongest of their channel.
    fn short_of(&self, found: &[Found<T>]) -> Vec<usize> {
        let Some(selection) = self.selection else { return Vec::new() };
        let mut short = Vec::new();
        for (number, parts) in self.groups(found).enumerate() {
            let least: [T; LANES] = std::array::from_fn(|lane| selection.least(self.most, entries(parts, lane)));
            let dropped =
                |part: &Found<T>| (0..LANES).any(|lane| part.dropped[lane] && part.least[lane] >= least[lane]);
            let first = number * self.layers.len();
            short.extend((first..).zip(parts).filter(|(_, part)| parts.len() > 1 && dropped(part)).map(|(i, _)| i));
        }
        short
    }

    /// The responses of all parts, selected, with keys.
    fn collected(&self, found: &[Found<T>]) -> Result<Responses<T>> {
        let (shape, outputs) = (self.input.shape(), self.filter.outputs);
        let to = Shape::new(shape.samples, outputs, &shape.extent)?;
        let (mut keys, mut values) = (Vec::new(), Vec::new());
        let mut densities = vec![0.0; outputs];
        for (number, parts) in self.groups(found).enumerate() {
            let (sample, first) = (number / self.taps.len(), number % self.taps.len() * LANES);
            for (lane, output) in (first..outputs.min(first + LANES)).enumerate() {
                let counted: usize = parts.iter().map(|part| part.counted[lane]).sum();
                densities[output] += counted as f64 / (shape.samples * to.cells()) as f64;
                let mut kept: Vec<(usize, T)> = entries(parts, lane).copied().collect();
                if let Some(selection) = self.selection {
                    selection.apply(&mut kept, to.cells());
                }
                if let Some((_, response)) = kept.iter().find(|(_, response)| !response.finite()) {
                    return Err(Error::input(format!("a response of {response:?} of channel {output}")));
                }
                let base = ((sample * outputs + output) * to.cells()) as u64;
                keys.extend(kept.iter().map(|entry| base + entry.0 as u64));
                values.extend(kept.iter().map(|entry| entry.1));
            }
        }
        Ok(Responses { tensor: SparseTensor::of_sorted(to, keys, values), densities })
    }
}

/// The entries of an output channel in some parts.
fn entries<T>(parts: &[Found<T>], lane: usize) -> impl Iterator<Item = &(usize, T)> {
    parts.iter().flat_map(move |part| &part.entries[lane])
}
