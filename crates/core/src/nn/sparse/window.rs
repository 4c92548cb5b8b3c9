//! The dense buffer of the responses: it slides along the first axis of a tensor, so that it stays in the cache while every
//! input is visited once.

use super::slab::{LANES, Place, Taps};
use super::strongest::{Collecting, Found, Strongest};
use super::tensor::SparseTensor;
use crate::error::Result;
use crate::memory;
use crate::nn::scalar::Scalar;
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Cells that are marked together when one of them is written to.
const MARKED: usize = 8;
/// Cells of the inputs of a step, at least one layer along the first axis.
const STEP: usize = 1 << 12;
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
    /// The responses. Sums have a fixed order: steps of layers, input channel, input cell.
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
    /// Layers of a step.
    step: usize,
    /// Input layers of the piece.
    inputs: Range<usize>,
}

impl Layout {
    fn new<T: Scalar>(part: &Piece<'_, T>) -> Self {
        let extent = &part.input.shape().extent;
        let layer: usize = extent[1..].iter().product();
        let inputs = part.layers.start.saturating_sub(part.reach)..(part.layers.end + part.reach).min(extent[0]);
        let step = (STEP / layer).clamp(1, inputs.len().max(1));
        Self { layer, slot: layer.next_multiple_of(MARKED), ring: step + 2 * part.reach, step, inputs }
    }
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
        let Layout { step, inputs, .. } = self.layout.clone();
        let mut drained = self.part.layers.start;
        for first in inputs.clone().step_by(step) {
            let end = (first + step).min(inputs.end);
            for channel in 0..self.part.taps.len() {
                self.add(channel, first..end);
            }
            let complete = if end == inputs.end { self.part.layers.end } else { end.saturating_sub(self.part.reach) };
            while drained < complete {
                self.drain(drained);
                drained += 1;
            }
        }
    }
}

impl<T: Scalar> Pass<'_, '_, T> {
    /// Adds what an input channel gives in some of its layers.
    #[inline(always)]
    fn add(&mut self, channel: usize, layers: Range<usize>) {
        let (part, layer) = (self.part, self.layout.layer);
        let (input, taps) = (part.input, &part.taps[channel]);
        let plane = part.sample * part.taps.len() + channel;
        let base = (plane * input.shape().cells()) as u64;
        let entries = input.entries(plane, layers.start * layer..layers.end * layer);
        let mut rest = input.keys()[entries.clone()].iter().zip(&input.values()[entries]).peekable();
        let mut bases = [OUTSIDE; 16];
        for z in layers {
            self.place(z, &mut bases);
            let start = base + (z * layer) as u64;
            let here = start..start + layer as u64;
            while let Some((&key, &value)) = rest.next_if(|(key, _)| here.contains(key)) {
                self.scatter((key - start) as usize, value, taps, &bases);
            }
        }
    }

    /// Where the layers that an input layer reaches begin in the buffer, the first one `reach` before it.
    #[inline(always)]
    fn place(&self, z: usize, bases: &mut [usize; 16]) {
        let Layout { slot, ring, .. } = self.layout;
        for (step, base) in bases.iter_mut().enumerate().take(2 * self.part.reach + 1) {
            let output = (z + step).checked_sub(self.part.reach).filter(|z| self.part.layers.contains(z));
            *base = output.map_or(OUTSIDE, |output| output % ring * slot);
        }
    }

    /// Adds an input to all outputs that its weights lead to.
    #[inline(always)]
    fn scatter(&mut self, cell: usize, value: T, taps: &Taps<T>, bases: &[usize; 16]) {
        let Window { values, written } = &mut *self.window;
        let (shape, reach) = (self.part.input.shape(), self.part.reach);
        let place = Place::new(cell, shape, reach, 1);
        for tap in &taps.taps {
            let base = bases[tap.layer];
            if base == OUTSIDE || !tap.stays(&place, shape, 1) {
                continue;
            }
            let at = (base + cell).wrapping_add_signed(tap.within);
            // Copies, so that the compiler sees that they do not overlap.
            let (weights, mut sums) = (tap.weights, values[at]);
            for lane in 0..LANES {
                sums[lane] = value.mul_add(weights[lane], sums[lane]);
            }
            values[at] = sums;
            written[at / MARKED] = true;
        }
    }

    /// Hands on the responses of a layer and clears it.
    #[inline(always)]
    fn drain(&mut self, z: usize) {
        let Layout { layer, slot, ring, .. } = self.layout;
        let base = z % ring * slot;
        let marks = base / MARKED..(base + slot) / MARKED;
        let blocks = self.window.values[base..base + slot].chunks_exact_mut(MARKED);
        for ((written, cells), first) in self.window.written[marks].iter_mut().zip(blocks).zip((0..).step_by(MARKED)) {
            if !std::mem::take(written) {
                continue;
            }
            self.strongest.take(z * layer + first, cells);
            cells.fill([T::ZERO; LANES]);
        }
    }
}
