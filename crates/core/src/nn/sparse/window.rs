//! The dense buffer of the responses: it slides along the first axis of a tensor, so that it stays in the cache while every
//! input is visited once, or twice at the border of two strips.

use super::slab::{LANES, Place, RUN, Run, Sums, Taps, Target};
use super::strongest::{Collecting, Found, MARKED, Strongest, TOGETHER};
use super::tensor::SparseTensor;
use crate::error::Result;
use crate::memory;
use crate::nn::scalar::Scalar;
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Cells of the inputs of a step, at least one layer along the first axis.
const STEP: usize = 1 << 12;
/// Cells of a block, whose input channels are added in turn, so that what they add to stays in the cache. A block is a
/// piece of a layer or some whole layers.
const BLOCK: usize = 4096;
/// Cells by which layers of the buffer lie further apart than they need, so that those above each other do not compete for the same
/// places of the cache.
const APART: usize = 5 * MARKED;
/// Rows of outputs that inputs reach, for each block of outputs, below which blocks are marked.
const SPARSE: f64 = 1.0;
/// No layer of the buffer.
const OUTSIDE: usize = usize::MAX;

/// The responses of some layers of a sample, or of a strip of each, for a group of output channels.
pub(super) struct Piece<'a, T> {
    pub(super) input: &'a SparseTensor<T>,
    /// Weights of the group, for each input channel.
    pub(super) taps: &'a [Taps<T>],
    pub(super) sample: usize,
    /// Output layers along the first axis.
    pub(super) layers: Range<usize>,
    /// Output cells within each of these layers.
    pub(super) strip: Range<usize>,
    /// Number of inputs in these cells.
    pub(super) inputs: usize,
    /// For each cell of a layer whether all outputs of an input lie in the tensor along the other axes.
    pub(super) interior: &'a [bool],
    /// Layers that the filters reach beyond their centre.
    pub(super) reach: usize,
}

/// The buffer: as many layers as a step and its surroundings have, used in turn.
#[derive(Clone, Debug, Default)]
pub(super) struct Window<T> {
    values: Vec<Sums<T>>,
    /// For each block whether it was written to; empty if nearly all are.
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
        window.fit(layout.ring.saturating_mul(layout.slot), self.is_sparse())?;
        Arch::new().dispatch(Pass { part: self, layout, window, strongest: &mut strongest });
        Ok(strongest.found())
    }

    /// Whether most blocks of outputs stay empty, so that it pays to mark the others.
    fn is_sparse(&self) -> bool {
        let runs: usize = self.taps.iter().map(|taps| taps.runs.len()).sum();
        let reached = self.inputs as f64 * runs as f64 / self.taps.len() as f64;
        reached < SPARSE * (self.layers.len() * self.strip.len() / MARKED) as f64
    }
}

impl<T: Scalar> Window<T> {
    /// Adds an input to the output of a weight; `from` is its place in the layer of that output.
    #[inline(always)]
    fn add(&mut self, from: usize, value: T, target: &Target<T>) {
        let at = from.wrapping_add_signed(target.within);
        // Copies, so that the compiler sees that they do not overlap.
        let (weights, Sums(mut sums)) = (target.weights, self.values[at]);
        for lane in 0..LANES {
            sums[lane] = value.mul_add(weights[lane], sums[lane]);
        }
        self.values[at] = Sums(sums);
        self.mark(at);
    }

    /// Adds an input to the outputs of a run of weights; `from` is its place in the layer of these outputs.
    #[inline(always)]
    fn add_run(&mut self, from: usize, value: T, run: &Run<T>) {
        let at = from.wrapping_add_signed(run.within);
        if let (RUN, Some((sums, _))) = (run.length, self.values[at..].split_first_chunk_mut::<RUN>()) {
            // Cell after cell: one access to all three would often lie in two lines of the cache.
            for (to, weights) in sums.iter_mut().zip(&run.weights) {
                let Sums(mut own) = *to;
                for lane in 0..LANES {
                    own[lane] = value.mul_add(weights[lane], own[lane]);
                }
                *to = Sums(own);
            }
            self.mark(at);
            self.mark(at + RUN - 1);
            return;
        }
        for (cell, weights) in (at..).zip(&run.weights[..run.length]) {
            let Sums(mut sums) = self.values[cell];
            for lane in 0..LANES {
                sums[lane] = value.mul_add(weights[lane], sums[lane]);
            }
            self.values[cell] = Sums(sums);
            self.mark(cell);
        }
    }

    #[inline(always)]
    fn mark(&mut self, cell: usize) {
        if let Some(written) = self.written.get_mut(cell / MARKED) {
            *written = true;
        }
    }

    /// Room for so many cells, of which blocks that are written to are marked or not.
    fn fit(&mut self, cells: usize, marks: bool) -> Result<()> {
        let more = cells.saturating_sub(self.values.len());
        memory::reserve(&mut self.values, more, "the buffer of a convolution")?;
        self.values.resize(self.values.len() + more, Sums([T::ZERO; LANES]));
        self.written.clear();
        if marks {
            memory::reserve(&mut self.written, cells / MARKED, "the buffer of a convolution")?;
            self.written.resize(cells / MARKED, false);
        }
        Ok(())
    }
}

/// Where layers lie in the buffer.
#[derive(Clone, Debug)]
struct Layout {
    /// Cells of a layer.
    layer: usize,
    /// Cells of a strip of a layer in the buffer.
    slot: usize,
    /// Layers of the buffer.
    ring: usize,
    /// Layers of a block, or 1 if a layer has several.
    group: usize,
    /// Layers of a step, whole blocks.
    step: usize,
    /// Input layers of the piece.
    inputs: Range<usize>,
    /// Input cells within a layer.
    around: Range<usize>,
    /// Cells of the buffer before and behind a strip: those that inputs near it reach too, and nobody reads.
    margin: usize,
}

impl Layout {
    fn new<T: Scalar>(part: &Piece<'_, T>) -> Self {
        let extent = &part.input.shape().extent;
        let layer: usize = extent[1..].iter().product();
        let inputs = part.layers.start.saturating_sub(part.reach)..(part.layers.end + part.reach).min(extent[0]);
        let group = (BLOCK / layer).max(1);
        let step = (STEP / layer / group).max(1) * group;
        let ring = step.min(inputs.len()) + 2 * part.reach;
        let far = part.input.shape().farthest(part.reach);
        let Range { start, end } = part.strip;
        let around = start.saturating_sub(far)..(end + far).min(layer);
        let margin = if part.strip.len() == layer { 0 } else { (2 * far).next_multiple_of(MARKED) };
        Self {
            layer,
            margin,
            slot: 2 * margin + part.strip.len().next_multiple_of(MARKED) + APART,
            ring,
            group,
            step,
            inputs,
            around,
        }
    }

    /// The end of the block that begins with an input cell.
    fn block_end(&self, cell: usize) -> usize {
        let z = cell / self.layer;
        match self.group {
            1 => z * self.layer + ((cell % self.layer / BLOCK + 1) * BLOCK).min(self.layer),
            group => (z / group + 1) * group * self.layer,
        }
    }
}

/// Where the layers that an input layer reaches begin in the buffer, the first one `reach` before it; those that do not
/// belong to the piece are [`OUTSIDE`].
type Bases = [usize; 16];

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
        let Layout { step, inputs, layer, around, .. } = self.layout.clone();
        let mut drained = self.part.layers.start;
        let mut next = self.first_entries();
        let (mut done, all) = (0, self.part.inputs.max(1));
        let mut first = inputs.start;
        while first < inputs.end {
            let end = ((first / step + 1) * step).min(inputs.end);
            if around.len() == layer {
                done += self.add_all(first * layer..end * layer, &mut next);
            } else {
                for z in first..end {
                    let cells = z * layer + around.start..z * layer + around.end;
                    self.seek(cells.start, &mut next);
                    done += self.add_all(cells, &mut next);
                }
            }
            first = end;
            self.strongest.set_share((done as f64 / all as f64).min(1.0));
            let complete = if end == inputs.end { self.part.layers.end } else { end.saturating_sub(self.part.reach) };
            while drained < complete {
                self.drain(drained);
                drained += 1;
            }
        }
    }
}

impl<T: Scalar> Pass<'_, '_, T> {
    /// The first entry of each input channel in the layers of the piece.
    fn first_entries(&self) -> Vec<usize> {
        let (part, Layout { inputs, layer, .. }) = (self.part, &self.layout);
        let planes = (part.sample * part.taps.len()..).take(part.taps.len());
        planes.map(|plane| part.input.entries(plane, inputs.start * layer..inputs.end * layer).start).collect()
    }

    /// Moves on to the first entry of each input channel from a cell on.
    fn seek(&self, cell: usize, next: &mut [usize]) {
        let (input, channels) = (self.part.input, self.part.taps.len());
        for (channel, next) in next.iter_mut().enumerate() {
            let plane = self.part.sample * channels + channel;
            *next = input.entry_from((plane * input.shape().cells() + cell) as u64, *next);
        }
    }

    /// Adds what all input channels give in some cells, block by block, from these entries on; their number.
    #[inline(always)]
    fn add_all(&mut self, cells: Range<usize>, next: &mut [usize]) -> usize {
        let (mut cell, mut added) = (cells.start, 0);
        while cell < cells.end {
            let block = cell..self.layout.block_end(cell).min(cells.end);
            for (channel, next) in next.iter_mut().enumerate() {
                let behind = self.add(channel, block.clone(), *next);
                added += behind - *next;
                *next = behind;
            }
            cell = block.end;
        }
        added
    }

    /// Adds what an input channel gives in some cells, from this entry on; the entry behind them.
    #[inline(always)]
    fn add(&mut self, channel: usize, cells: Range<usize>, first: usize) -> usize {
        let (part, layer) = (self.part, self.layout.layer);
        let (input, taps) = (part.input, &part.taps[channel]);
        let start = ((part.sample * part.taps.len() + channel) * input.shape().cells()) as u64;
        let end = start + cells.end as u64;
        let entries = input.keys()[first..].iter().zip(&input.values()[first..]);
        let (mut layer_end, mut layer_start, mut bases) = (start, start, [OUTSIDE; 16]);
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
        let mut bases = [OUTSIDE; 16];
        for (step, base) in bases.iter_mut().enumerate().take(2 * self.part.reach + 1) {
            let output = (z + step).checked_sub(self.part.reach).filter(|z| self.part.layers.contains(z));
            *base = output.map_or(OUTSIDE, |output| output % ring * slot);
        }
        bases
    }

    /// Adds an input to all outputs that its weights lead to.
    #[inline(always)]
    fn scatter(&mut self, cell: usize, value: T, taps: &Taps<T>, bases: &Bases) {
        let part = self.part;
        let from = cell + self.layout.margin - part.strip.start;
        if part.interior[cell] {
            for run in &taps.runs {
                // At most 15, which the compiler does not know.
                let base = bases[run.layer & 15];
                if base != OUTSIDE {
                    self.window.add_run(base + from, value, run);
                }
            }
            return;
        }
        let shape = part.input.shape();
        let place = Place::new(cell, shape, part.reach, 1);
        for tap in &taps.taps {
            let base = bases[tap.target.layer];
            if base != OUTSIDE && tap.stays(&place, shape, 1) {
                self.window.add(base + from, value, &tap.target);
            }
        }
    }

    /// Hands on the responses of a layer and clears it.
    #[inline(always)]
    fn drain(&mut self, z: usize) {
        let Layout { layer, slot, ring, margin, .. } = self.layout;
        let (base, strip) = (z % ring * slot, &self.part.strip);
        let values = &mut self.window.values[base..base + slot];
        values[..margin].fill(Sums([T::ZERO; LANES]));
        values[margin + strip.len()..].fill(Sums([T::ZERO; LANES]));
        let (blocks, _) = values[margin..].as_chunks_mut::<MARKED>();
        let blocks = &mut blocks[..strip.len().div_ceil(MARKED)];
        let marks = (base + margin) / MARKED;
        let written = self.window.written.get_mut(marks..marks + blocks.len()).unwrap_or_default();
        let mut next = 0;
        while next < blocks.len() {
            let mut end = (next + TOGETHER).min(blocks.len());
            if !written.is_empty() {
                next += written[next..].iter().take_while(|written| !**written).count();
                end = next + written[next..].iter().take(TOGETHER).take_while(|written| **written).count();
                written[next..end].fill(false);
            }
            self.strongest.take(z * layer + strip.start + next * MARKED, &mut blocks[next..end]);
            next = end;
        }
    }
}
