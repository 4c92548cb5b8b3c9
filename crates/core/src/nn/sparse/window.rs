//! The dense buffer of the responses: it slides along the first axis of a tensor, so that it stays in the cache while every
//! input is visited once.

use super::slab::{LANES, Place, Taps, Target};
use super::strongest::{Collecting, Found, MARKED, Strongest};
use super::tensor::SparseTensor;
use crate::error::Result;
use crate::memory;
use crate::nn::scalar::Scalar;
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Cells of the inputs of a step, at least one layer along the first axis.
const STEP: usize = 1 << 12;
/// Cells of a block, whose input channels are added in turn, so that what they add to stays in the innermost cache. A block is a
/// piece of a layer or some whole layers.
const BLOCK: usize = 1024;
/// No layer of the buffer.
const OUTSIDE: usize = usize::MAX;

/// The responses of some layers of a sample, for a group of output channels.
pub(super) struct Piece<'a, T> {
    pub(super) input: &'a SparseTensor<T>,
    /// Weights of the group, for each input channel.
    pub(super) taps: &'a [Taps<T>],
    pub(super) sample: usize,
    /// Output layers along the first axis.
    pub(super) layers: Range<usize>,
    /// Layers that the filters reach beyond their centre.
    pub(super) reach: usize,
}

/// The buffer: as many layers as a step and its surroundings have, used in turn.
#[derive(Clone, Debug, Default)]
pub(super) struct Window<T> {
    values: Vec<[T; LANES]>,
    written: Vec<bool>,
}

impl<T: Scalar> Piece<'_, T> {
    /// The responses. Sums have a fixed order: block of a sample, input channel, input cell; it does not depend on the piece.
    ///
    /// # Errors
    /// If the buffer, some layers along the first axis, does not fit into memory.
    pub(super) fn responses(&self, window: &mut Window<T>, how: &Collecting<T>) -> Result<Found<T>> {
        let mut strongest = Strongest::new(how);
        let layout = Layout::new(self);
        window.fit(layout.ring.saturating_mul(layout.slot))?;
        Arch::new().dispatch(Pass { part: self, layout, window, strongest: &mut strongest });
        Ok(strongest.found())
    }
}

impl<T: Scalar> Window<T> {
    /// Adds an input to the output of a weight; `from` is its place in the layer of that output.
    #[inline(always)]
    fn add(&mut self, from: usize, value: T, target: &Target<T>) {
        let at = from.wrapping_add_signed(target.within);
        // Copies, so that the compiler sees that they do not overlap.
        let (weights, mut sums) = (target.weights, self.values[at]);
        for lane in 0..LANES {
            sums[lane] = value.mul_add(weights[lane], sums[lane]);
        }
        self.values[at] = sums;
        self.written[at / MARKED] = true;
    }

    /// Room for so many cells.
    fn fit(&mut self, cells: usize) -> Result<()> {
        let more = cells.saturating_sub(self.values.len());
        memory::reserve(&mut self.values, more, "the buffer of a convolution")?;
        memory::reserve(&mut self.written, more / MARKED, "the buffer of a convolution")?;
        self.values.resize(self.values.len() + more, [T::ZERO; LANES]);
        self.written.resize(self.values.len() / MARKED, false);
        Ok(())
    }
}

/// Where layers lie in the buffer.
#[derive(Clone, Debug)]
struct Layout {
    /// Cells of a layer.
    layer: usize,
    /// Cells of a layer in the buffer.
    slot: usize,
    /// Layers of the buffer.
    ring: usize,
    /// Layers of a block, or 1 if a layer has several.
    group: usize,
    /// Layers of a step, whole blocks.
    step: usize,
    /// Input layers of the piece.
    inputs: Range<usize>,
}

impl Layout {
    fn new<T: Scalar>(part: &Piece<'_, T>) -> Self {
        let extent = &part.input.shape().extent;
        let layer: usize = extent[1..].iter().product();
        let inputs = part.layers.start.saturating_sub(part.reach)..(part.layers.end + part.reach).min(extent[0]);
        let group = (BLOCK / layer).max(1);
        let step = (STEP / layer / group).max(1) * group;
        let ring = step.min(inputs.len()) + 2 * part.reach;
        Self { layer, slot: layer.next_multiple_of(MARKED), ring, group, step, inputs }
    }

    /// The end of the block that begins with an input cell.
    fn block_end(&self, cell: usize) -> usize {
        let z = cell / self.layer;
        match self.group {
            1 => z * self.layer + (cell % self.layer + BLOCK).min(self.layer),
            group => (z / group + 1) * group * self.layer,
        }
    }
}

/// Where the layers that an input layer reaches begin in the buffer, the first one `reach` before it.
#[derive(Clone, Copy, Debug, Default)]
struct Bases {
    layers: [usize; 16],
    /// Whether all of them belong to the piece; the others are [`OUTSIDE`].
    inside: bool,
}

/// Adds the responses of a piece step by step and hands on those of layers that are complete.
struct Pass<'a, 'b, T> {
    part: &'a Piece<'b, T>,
    layout: Layout,
    window: &'a mut Window<T>,
    strongest: &'a mut Strongest<T>,
}

impl<T: Scalar> WithSimd for Pass<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _simd: S) {
        let Layout { step, inputs, layer, .. } = self.layout.clone();
        let mut drained = self.part.layers.start;
        let from = self.entries();
        let mut next: Vec<usize> = from.iter().map(|entries| entries.start).collect();
        let all = from.iter().map(Range::len).sum::<usize>().max(1);
        let mut first = inputs.start;
        while first < inputs.end {
            let end = ((first / step + 1) * step).min(inputs.end);
            let mut cell = first * layer;
            while cell < end * layer {
                let block = cell..self.layout.block_end(cell).min(end * layer);
                for (channel, next) in next.iter_mut().enumerate() {
                    *next = self.add(channel, block.clone(), *next);
                }
                cell = block.end;
            }
            first = end;
            let done: usize = next.iter().zip(&from).map(|(next, from)| next - from.start).sum();
            self.strongest.set_share(done as f64 / all as f64);
            let complete = if end == inputs.end { self.part.layers.end } else { end.saturating_sub(self.part.reach) };
            while drained < complete {
                self.drain(drained);
                drained += 1;
            }
        }
    }
}

impl<T: Scalar> Pass<'_, '_, T> {
    /// The entries of each input channel in the layers of the piece.
    fn entries(&self) -> Vec<Range<usize>> {
        let (part, Layout { inputs, layer, .. }) = (self.part, &self.layout);
        let planes = (part.sample * part.taps.len()..).take(part.taps.len());
        planes.map(|plane| part.input.entries(plane, inputs.start * layer..inputs.end * layer)).collect()
    }

    /// Adds what an input channel gives in some cells, from this entry on; the entry behind them.
    #[inline(always)]
    fn add(&mut self, channel: usize, cells: Range<usize>, first: usize) -> usize {
        let (part, layer) = (self.part, self.layout.layer);
        let (input, taps) = (part.input, &part.taps[channel]);
        let start = ((part.sample * part.taps.len() + channel) * input.shape().cells()) as u64;
        let end = start + cells.end as u64;
        let entries = input.keys()[first..].iter().zip(&input.values()[first..]);
        let (mut layer_end, mut layer_start, mut bases) = (start, start, Bases::default());
        let mut count = 0;
        for (&key, &value) in entries.take_while(|(key, _)| **key < end) {
            if key >= layer_end {
                let z = (key - start) as usize / layer;
                bases = self.bases(z);
                layer_start = start + (z * layer) as u64;
                layer_end = layer_start + layer as u64;
            }
            self.scatter((key - layer_start) as usize, value, taps, &bases);
            count += 1;
        }
        first + count
    }

    /// The layers that an input layer reaches.
    #[inline(always)]
    fn bases(&self, z: usize) -> Bases {
        let Layout { slot, ring, .. } = self.layout;
        let mut bases = Bases { layers: [OUTSIDE; 16], inside: true };
        for (step, base) in bases.layers.iter_mut().enumerate().take(2 * self.part.reach + 1) {
            let output = (z + step).checked_sub(self.part.reach).filter(|z| self.part.layers.contains(z));
            *base = output.map_or(OUTSIDE, |output| output % ring * slot);
            bases.inside &= *base != OUTSIDE;
        }
        bases
    }

    /// Adds an input to all outputs that its weights lead to.
    #[inline(always)]
    fn scatter(&mut self, cell: usize, value: T, taps: &Taps<T>, bases: &Bases) {
        let (shape, reach) = (self.part.input.shape(), self.part.reach);
        let place = Place::new(cell, shape, reach, 1);
        if place.interior && bases.inside {
            for target in &taps.targets {
                self.window.add(bases.layers[target.layer] + cell, value, target);
            }
            return;
        }
        for tap in &taps.taps {
            let base = bases.layers[tap.target.layer];
            if base != OUTSIDE && tap.stays(&place, shape, 1) {
                self.window.add(base + cell, value, &tap.target);
            }
        }
    }

    /// Hands on the responses of a layer and clears it.
    #[inline(always)]
    fn drain(&mut self, z: usize) {
        let Layout { layer, slot, ring, .. } = self.layout;
        let base = z % ring * slot;
        let marks = base / MARKED..(base + slot) / MARKED;
        let (blocks, _) = self.window.values[base..base + slot].as_chunks_mut::<MARKED>();
        for ((written, cells), first) in self.window.written[marks].iter_mut().zip(blocks).zip((0..).step_by(MARKED)) {
            if std::mem::take(written) {
                self.strongest.take(z * layer + first, cells);
                *cells = [[T::ZERO; LANES]; MARKED];
            }
        }
    }
}
