//! The responses of a direct sparse convolution, of which the strongest are kept.

use super::attention::{Limit, Selection};
use super::filter::SparseFilter;
use super::slab::{LANES, Place, Taps};
use super::strongest::{Collecting, Found};
use super::tensor::{Shape, SparseTensor};
use super::window::{Piece, Window};
use crate::error::{Error, Result};
use crate::memory;
use crate::nn::scalar::Scalar;
use crate::parallel::{Monitor, map_ordered, map_ordered_with};
use std::array;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The output of a convolution.
#[derive(Clone, Debug, PartialEq)]
pub struct Responses<T> {
    /// The responses that are kept.
    pub tensor: SparseTensor<T>,
    /// For each output channel the share of the cells whose response is above 0, before the strongest are selected, averaged
    /// over the samples: what the density regulariser follows.
    pub densities: Vec<f64>,
}

/// Parts of the outputs that are computed on their own, over all samples and groups of output channels; strips of layers, at most,
/// of each sample and group.
const TASKS: usize = 16;
/// Fewest layers of a part, as a multiple of the layers of a filter.
const LAYERS: usize = 4;
/// Cells of a strip of a layer, about: the buffer of a part, at least three strips, then stays in the second cache. Whole blocks
/// of [`Window`].
const STRIP: usize = 4096;
/// A part keeps this many times the responses that it is expected to be left with.
const SLACK: f64 = 1.5;
/// And so many more; so many at the beginning.
const FEWEST: usize = 64;
/// What the first part makes known leaves a part about this many times its share, and [`FEWEST`] more.
const EXPECTED: f64 = 1.25;
/// From so many parts on it costs little to compute one again.
const MANY: usize = 4;

/// How many responses of a channel a part keeps.
#[derive(Clone, Copy, Debug)]
enum Keep<'l, T> {
    /// About as many as the bound of the whole leaves it.
    Expected,
    /// As many as the bound of the whole, of those within the limits of what was kept before, which with more responses only
    /// rise: for each sample, group and channel.
    Bound(&'l [Limit<T>]),
}

/// The share of a part in the responses of a channel that are kept.
#[derive(Clone, Copy, Debug)]
struct Share {
    /// By its inputs.
    fair: f64,
    /// Number of responses of which the others may be dropped.
    enough: usize,
}

/// Cells of a sample: the same strip of some layers along the first axis.
#[derive(Clone, Debug)]
struct Part {
    layers: Range<usize>,
    /// Cells within a layer.
    strip: Range<usize>,
}

/// The responses of a tensor, in parts: layers of a sample, or strips of them, for a group of output channels.
///
/// A part first keeps about as many of its strongest responses as the bound of the whole leaves it, and on the way as many as
/// the inputs so far let expect, of those that exceed what parts before it let expect. Where some that it dropped may be among
/// the strongest of the whole, it is computed again and keeps as many as the bound: which parts are done before does not change
/// the result. Parts hold about three times the bound in all, and 2 [`TASKS`] times at worst.
pub(super) struct Work<'a, T> {
    filter: &'a SparseFilter<T>,
    bias: &'a [T],
    selection: Option<Selection>,
    input: &'a SparseTensor<T>,
    taps: Vec<Vec<Taps<T>>>,
    /// The parts of a sample and a group: layers, and within them strip after strip.
    parts: Vec<Part>,
    /// Strips of a layer.
    strips: usize,
    /// For each cell of a layer whether it is as far from the ends of all axes but the first as filters reach.
    interior: Vec<bool>,
    /// Most responses that a channel of a sample keeps.
    most: usize,
    /// For each sample and group what a response of each output channel has to exceed, as the parts that are computed let
    /// expect; 0: unknown.
    bars: Vec<Mutex<[T; LANES]>>,
}

impl<'a, T: Scalar> Work<'a, T> {
    pub(super) fn new(
        filter: &'a SparseFilter<T>,
        bias: &'a [T],
        selection: Option<Selection>,
        input: &'a SparseTensor<T>,
    ) -> Result<Self> {
        let shape = input.shape();
        let taps: Vec<_> = (0..filter.outputs.div_ceil(LANES)).map(|group| filter.taps(group, shape)).collect();
        let (length, layer) = (shape.extent[0], shape.extent[1..].iter().product::<usize>());
        // Long enough that few inputs belong to two.
        let strip = STRIP.max(8 * shape.farthest(filter.size / 2));
        let strips = (layer / strip).clamp(1, TASKS);
        let along = (TASKS / (shape.samples * taps.len() * strips)).clamp(1, (length / (LAYERS * filter.size)).max(1));
        let piece = |part: usize, parts: usize, length: usize| part * length / parts..(part + 1) * length / parts;
        let part = |i| Part { layers: piece(i / strips, along, length), strip: piece(i % strips, strips, layer) };
        let parts = (0..along * strips).map(part).collect();
        let mut interior = Vec::new();
        memory::reserve(&mut interior, layer, "the buffer of a convolution")?;
        interior.extend((0..layer).map(|cell| Place::new(cell, shape, filter.size / 2, 1).interior));
        let most = selection.map_or(usize::MAX, |selection| selection.most(shape.cells()));
        let bars = (0..shape.samples * taps.len()).map(|_| Mutex::new([T::ZERO; LANES])).collect();
        Ok(Self { filter, bias, selection, input, taps, parts, strips, interior, most, bars })
    }

    /// The responses that are kept.
    pub(super) fn responses(&self, monitor: &Monitor) -> Result<Responses<T>> {
        let mut found = self.run(&(0..self.count()).collect::<Vec<_>>(), Keep::Expected, monitor)?;
        let Some(selection) = self.selection else { return self.collected(&found, None) };
        let mut limits = self.limits(&found, selection, monitor)?;
        let short = self.short_of(&found, &limits);
        if !short.is_empty() {
            for (&number, part) in short.iter().zip(self.run(&short, Keep::Bound(&limits), monitor)?) {
                found[number] = part;
            }
            limits = self.limits(&found, selection, monitor)?;
        }
        self.collected(&found, Some((selection, &limits)))
    }

    /// Number of parts of all samples and groups.
    fn count(&self) -> usize {
        self.input.shape().samples * self.taps.len() * self.parts.len()
    }

    /// The responses of some parts.
    fn run(&self, numbers: &[usize], keep: Keep<'_, T>, monitor: &Monitor) -> Result<Vec<Found<T>>> {
        map_ordered_with(0..numbers.len(), monitor, Window::default, |window, i| {
            let (rest, part) = (numbers[i] / self.parts.len(), numbers[i] % self.parts.len());
            let (sample, group) = (rest / self.taps.len(), rest % self.taps.len());
            let Part { layers, strip } = self.parts[part].clone();
            let inputs = self.inputs(sample, &layers, &strip);
            let share = self.share(sample, inputs, keep);
            let many = self.parts.len() >= MANY;
            let enough_at_first = if many { share.enough.min(FEWEST) } else { share.enough };
            let learns = self.selection.filter(|_| many && matches!(keep, Keep::Expected));
            let least = match keep {
                Keep::Expected => learns.map_or([T::ZERO; LANES], |_| *self.bar(rest)),
                Keep::Bound(limits) => array::from_fn(|lane| limits[rest * LANES + lane].below()),
            };
            let mut bias = [T::ZERO; LANES];
            bias.iter_mut().zip(self.bias.iter().skip(group * LANES)).for_each(|(to, &from)| *to = from);
            let how = Collecting { bias, selection: self.selection, enough: share.enough, enough_at_first, least };
            let (taps, reach, interior) = (&self.taps[group][..], self.filter.size / 2, &self.interior[..]);
            let piece = Piece { input: self.input, taps, sample, layers, strip, inputs, interior, reach };
            let found = piece.responses(window, &how)?;
            if let Some(selection) = learns {
                learn(&mut self.bar(rest), &found, &share, selection);
            }
            Ok(found)
        })
    }

    /// What the responses of a sample and group have to exceed.
    fn bar(&self, number: usize) -> MutexGuard<'_, [T; LANES]> {
        self.bars[number].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The share of a part with so many inputs in the responses of a channel that are kept.
    fn share(&self, sample: usize, inputs: usize, keep: Keep<'_, T>) -> Share {
        let Shape { channels, extent, .. } = self.input.shape();
        let all = sample * channels..(sample + 1) * channels;
        let all: usize = all.map(|plane| self.input.entries(plane, 0..extent.iter().product()).len()).sum();
        let fair = inputs as f64 / all.max(1) as f64 * self.most as f64;
        let enough = match keep {
            Keep::Expected if self.parts.len() > 1 => self.most.min((SLACK * fair) as usize + FEWEST),
            _ => self.most,
        };
        Share { fair, enough }
    }

    /// Number of inputs in a strip of some layers.
    fn inputs(&self, sample: usize, layers: &Range<usize>, strip: &Range<usize>) -> usize {
        let (shape, layer) = (self.input.shape(), self.interior.len());
        let in_plane = |plane: usize| -> usize {
            if strip.len() == layer {
                return self.input.entries(plane, layers.start * layer..layers.end * layer).len();
            }
            let first = (plane * shape.cells()) as u64;
            let mut next = self.input.entries(plane, layers.start * layer..layers.end * layer).start;
            let one = |z: usize| {
                let start = self.input.entry_from(first + (z * layer + strip.start) as u64, next);
                next = self.input.entry_from(first + (z * layer + strip.end) as u64, start);
                next - start
            };
            layers.clone().map(one).sum()
        };
        (sample * shape.channels..(sample + 1) * shape.channels).map(in_plane).sum()
    }

    /// The parts of a sample and a group, group after group.
    fn groups<'f>(&self, found: &'f [Found<T>]) -> impl Iterator<Item = &'f [Found<T>]> {
        found.chunks(self.parts.len())
    }

    /// The limit of the responses that are kept of each channel of each group.
    fn limits(&self, found: &[Found<T>], selection: Selection, monitor: &Monitor) -> Result<Vec<Limit<T>>> {
        let groups: Vec<&[Found<T>]> = self.groups(found).collect();
        let limit = |i: usize| Ok(selection.limit(self.most, entries(groups[i / LANES], i % LANES)));
        map_ordered(groups.len() * LANES, monitor, limit)
    }

    /// Numbers of the parts that dropped responses which may be among the strongest of their channel.
    fn short_of(&self, found: &[Found<T>], limits: &[Limit<T>]) -> Vec<usize> {
        let mut short = Vec::new();
        for ((number, parts), limits) in self.groups(found).enumerate().zip(limits.chunks(LANES)) {
            let dropped =
                |part: &Found<T>| (0..LANES).any(|lane| part.dropped[lane] && part.least[lane] >= limits[lane].least);
            let first = number * self.parts.len();
            short.extend((first..).zip(parts).filter(|(_, part)| parts.len() > 1 && dropped(part)).map(|(i, _)| i));
        }
        short
    }

    /// The entries of an output channel in the parts of a sample by ascending cells, in pieces.
    fn in_order<'f>(&self, parts: &'f [Found<T>], lane: usize) -> Vec<&'f [(usize, T)]> {
        let all = parts.iter().map(|part| &part.entries[lane][..]);
        if self.strips == 1 {
            return all.collect();
        }
        let mut pieces = Vec::new();
        let mut left: Vec<&[(usize, T)]> = all.collect();
        for (left, about) in left.chunks_mut(self.strips).zip(self.parts.chunks(self.strips)) {
            for z in about[0].layers.clone() {
                for own in left.iter_mut() {
                    let end = (z + 1) * self.interior.len();
                    let (first, rest) = own.split_at(own.iter().take_while(|entry| entry.0 < end).count());
                    pieces.push(first);
                    *own = rest;
                }
            }
        }
        pieces
    }

    /// The responses of all parts that are within the limits, with keys.
    fn collected(&self, found: &[Found<T>], limits: Option<(Selection, &[Limit<T>])>) -> Result<Responses<T>> {
        let (shape, outputs) = (self.input.shape(), self.filter.outputs);
        let to = Shape::new(shape.samples, outputs, &shape.extent)?;
        let groups: Vec<&[Found<T>]> = self.groups(found).collect();
        let places: Vec<(usize, usize)> = (0..shape.samples * outputs)
            .map(|i| (i / outputs * self.taps.len() + i % outputs / LANES, i % outputs % LANES))
            .collect();
        let most = limits.map_or(usize::MAX, |_| self.most);
        let count = |&(number, lane): &(usize, usize)| entries(groups[number], lane).count().min(most);
        let count: usize = places.iter().map(count).sum();
        // One more, which the last one that is not kept is written to.
        let (mut keys, mut values) = (vec![0; count + 1], vec![T::ZERO; count + 1]);
        let mut kept = 0;
        for (plane, &(number, lane)) in places.iter().enumerate() {
            let base = (plane * to.cells()) as u64;
            let mut limit = limits.map(|(selection, limits)| (selection, limits[number * LANES + lane]));
            for piece in self.in_order(groups[number], lane) {
                // Without branches, which the processor could not foresee.
                for &(cell, response) in piece {
                    (keys[kept], values[kept]) = (base + cell as u64, response);
                    let taken =
                        limit.as_mut().is_none_or(|(selection, limit)| limit.takes(selection.strength(response)));
                    kept += usize::from(taken);
                }
            }
        }
        keys.truncate(kept);
        values.truncate(kept);
        if let Some(entry) = values.iter().position(|response| !response.finite()) {
            let output = keys[entry] as usize / to.cells() % outputs;
            return Err(Error::input(format!("a response of {:?} of channel {output}", values[entry])));
        }
        let mut densities = vec![0.0; outputs];
        for (number, parts) in groups.iter().enumerate() {
            let first = number % self.taps.len() * LANES;
            for (lane, output) in (first..outputs.min(first + LANES)).enumerate() {
                let counted: usize = parts.iter().map(|part| part.counted[lane]).sum();
                densities[output] += counted as f64 / (shape.samples * to.cells()) as f64;
            }
        }
        Ok(Responses { tensor: SparseTensor::of_sorted(to, keys, values), densities })
    }
}

/// Sets what responses have to exceed by what a part found. A part that found less than its share makes it unknown again: it was
/// that of a part with more strong responses than others, many of which would have to be computed again.
fn learn<T: Scalar>(bar: &mut [T; LANES], found: &Found<T>, share: &Share, selection: Selection) {
    for (lane, bar) in bar.iter_mut().enumerate() {
        let entries = &found.entries[lane];
        if (entries.len() as f64) < share.fair {
            *bar = T::ZERO;
        } else if *bar == T::ZERO && found.dropped[lane] && entries.len() > share.enough {
            *bar = selection.limit((EXPECTED * share.fair) as usize + FEWEST, entries.iter()).least;
        }
    }
}

/// The entries of an output channel in some parts, part after part.
fn entries<T>(parts: &[Found<T>], lane: usize) -> impl Iterator<Item = &(usize, T)> {
    parts.iter().flat_map(move |part| &part.entries[lane])
}
