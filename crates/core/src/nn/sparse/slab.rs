//! The dense buffer of a convolution: a slab of cells that fits into the cache, with several output channels side by side.

use super::tensor::Shape;
use crate::nn::scalar::Scalar;
use std::ops::Range;

/// Output channels that are computed together.
pub(super) const LANES: usize = 8;
/// Outputs of a run of weights, at most.
pub(super) const RUN: usize = 3;
/// Cells of a slab, at least one layer along the first axis.
const CELLS: usize = 1 << 15;

/// The sums of the output channels of a cell. Aligned, so that none lies in two lines of the cache.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Sums<T>(pub(super) [T; LANES]);

/// A weight of several output channels, and where it leads.
#[derive(Clone, Debug)]
pub(super) struct Tap<T> {
    /// Number of the weight in its filter.
    pub(super) position: usize,
    /// Step along each axis from an input to the output that it adds to.
    steps: [isize; 4],
    /// The same as a difference of cell numbers.
    difference: isize,
    pub(super) target: Target<T>,
}

/// A weight and where it leads within the layers of the buffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target<T> {
    /// Layers along the first axis from the first output of an input to this one.
    pub(super) layer: usize,
    /// Difference of the cell numbers within layers along the first axis.
    pub(super) within: isize,
    pub(super) weights: [T; LANES],
}

impl<T: Scalar> Tap<T> {
    /// Output o takes input o + f − c through weight f of a filter with centre c: input p adds to output p − (f − c).
    pub(super) fn new(position: usize, weights: [T; LANES], size: usize, shape: &Shape) -> Self {
        let (mut rest, mut steps) = (position, [0; 4]);
        let (mut difference, mut stride) = (0, 1);
        for (axis, &length) in shape.extent.iter().enumerate().rev() {
            steps[axis] = (size / 2) as isize - (rest % size) as isize;
            difference += steps[axis] * stride;
            rest /= size;
            stride *= length as isize;
        }
        let layers = shape.extent[1..].iter().product::<usize>() as isize;
        let layer = (steps[0] + (size / 2) as isize) as usize;
        let target = Target { layer, within: difference - steps[0] * layers, weights };
        Self { position, steps, difference, target }
    }

    /// The output cell of an input, if it lies inside the tensor.
    #[inline(always)]
    fn output(&self, at: &Place, shape: &Shape) -> Option<usize> {
        self.stays(at, shape, 0).then(|| (at.cell as isize + self.difference) as usize)
    }

    /// Whether the output of an input lies inside the tensor along all axes from one on.
    #[inline(always)]
    pub(super) fn stays(&self, at: &Place, shape: &Shape, first: usize) -> bool {
        let inside = |axis: usize| {
            let place = at.position[axis] as isize + self.steps[axis];
            place >= 0 && (place as usize) < shape.extent[axis]
        };
        at.interior || (first..shape.extent.len()).all(inside)
    }
}

/// Weights that lead to cells side by side, so that their place is found once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run<T> {
    /// Layers along the first axis from the first output of an input to these.
    pub(super) layer: usize,
    /// Difference of the cell numbers within layers along the first axis, of the lowest output.
    pub(super) within: isize,
    /// Number of outputs, 1 to [`RUN`].
    pub(super) length: usize,
    /// The weights by ascending outputs.
    pub(super) weights: [[T; LANES]; RUN],
}

/// The weights of one input channel.
#[derive(Clone, Debug)]
pub(super) struct Taps<T> {
    pub(super) taps: Vec<Tap<T>>,
    /// The targets of the same side by side, for the loop over the inputs.
    pub(super) runs: Vec<Run<T>>,
}

impl<T: Scalar> Taps<T> {
    pub(super) fn new(taps: Vec<Tap<T>>) -> Self {
        let mut targets: Vec<Target<T>> = taps.iter().map(|tap| tap.target).collect();
        targets.sort_by_key(|target| (target.layer, target.within));
        let mut runs: Vec<Run<T>> = Vec::new();
        for Target { layer, within, weights } in targets {
            match runs.last_mut() {
                Some(run) if run.layer == layer && run.length < RUN && run.within + run.length as isize == within => {
                    run.weights[run.length] = weights;
                    run.length += 1;
                }
                _ => {
                    let mut own = [[T::ZERO; LANES]; RUN];
                    own[0] = weights;
                    runs.push(Run { layer, within, length: 1, weights: own });
                }
            }
        }
        Self { taps, runs }
    }
}

/// An input cell.
pub(super) struct Place {
    cell: usize,
    position: [usize; 4],
    /// Whether all outputs lie inside the tensor.
    pub(super) interior: bool,
}

impl Place {
    /// The place of a cell; `interior` speaks of all axes from one on.
    #[inline(always)]
    pub(super) fn new(cell: usize, shape: &Shape, reach: usize, first: usize) -> Self {
        let position = shape.position(cell);
        let inside = |axis: usize| {
            let (at, length) = (position[axis], shape.extent[axis]);
            at >= reach && at + reach < length
        };
        Self { cell, position, interior: (first..shape.extent.len()).all(inside) }
    }
}

/// How a tensor is divided into slabs along its first axis.
#[derive(Clone, Debug)]
pub(super) struct Slabs<'a> {
    pub(super) shape: &'a Shape,
    /// Cells of a layer.
    layer: usize,
    /// Layers of a slab.
    layers: usize,
    /// Layers that a filter reaches beyond its centre.
    reach: usize,
}

impl<'a> Slabs<'a> {
    pub(super) fn new(shape: &'a Shape, size: usize) -> Self {
        let layer = shape.extent[1..].iter().product::<usize>();
        Self { shape, layer, layers: (CELLS / layer).max(1), reach: size / 2 }
    }

    pub(super) fn count(&self) -> usize {
        self.shape.extent[0].div_ceil(self.layers)
    }

    /// Cells of a slab.
    pub(super) fn cells(&self, slab: usize) -> Range<usize> {
        self.range(slab * self.layers, (slab + 1) * self.layers)
    }

    /// Cells of a slab and of the layers around it that a filter connects with it.
    pub(super) fn around(&self, slab: usize) -> Range<usize> {
        self.range((slab * self.layers).saturating_sub(self.reach), (slab + 1) * self.layers + self.reach)
    }

    fn range(&self, first: usize, end: usize) -> Range<usize> {
        first * self.layer..end.min(self.shape.extent[0]) * self.layer
    }

    /// Calls `each` with every weight of an input cell and the output cell that it leads to, of those in `outputs`.
    #[inline(always)]
    pub(super) fn connect<'t, T: Scalar>(
        &self,
        cell: usize,
        taps: &'t Taps<T>,
        outputs: &Range<usize>,
        mut each: impl FnMut(&'t Tap<T>, usize),
    ) {
        let place = Place::new(cell, self.shape, self.reach, 0);
        for tap in &taps.taps {
            if let Some(output) = tap.output(&place, self.shape)
                && outputs.contains(&output)
            {
                each(tap, output);
            }
        }
    }
}

/// The buffer, and which of its cells have been written to.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffer<T> {
    pub(super) values: Vec<[T; LANES]>,
    written: Vec<u64>,
}

impl<T: Scalar> Buffer<T> {
    /// Room for so many cells, all 0.
    pub(super) fn reserve(&mut self, cells: usize) {
        if self.values.len() < cells {
            self.values.resize(cells, [T::ZERO; LANES]);
            self.written.resize(cells.div_ceil(64), 0);
        }
    }

    #[inline(always)]
    pub(super) fn mark(&mut self, cell: usize) {
        self.written[cell / 64] |= 1 << (cell % 64);
    }

    /// Sets all cells that were written to to 0.
    pub(super) fn clear(&mut self) {
        for (word, bits) in self.written.iter_mut().enumerate() {
            while *bits != 0 {
                self.values[word * 64 + bits.trailing_zeros() as usize] = [T::ZERO; LANES];
                *bits &= *bits - 1;
            }
        }
    }

    /// Bytes of so many cells.
    pub(super) fn bytes(cells: usize) -> u64 {
        (cells as u64).saturating_mul(size_of::<[T; LANES]>() as u64)
    }
}
