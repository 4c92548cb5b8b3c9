//! Finds which input sites lie in the windows of output sites.

use super::Sites;
use super::block::{BLOCK, Block};
use super::kernel::Kernel;
use pulp::{Simd, WithSimd};

/// Differences of keys for all offsets along all axes but the last.
pub(super) fn rows<const D: usize>(kernel: Kernel) -> Vec<u64> {
    let bits = Sites::<D>::BITS;
    (0..kernel.size.pow(D as u32 - 1))
        .map(|row| {
            let axis = |a: usize| row / kernel.size.pow(a as u32) % kernel.size * kernel.dilation;
            // Axis a from the last but one upwards.
            (0..D - 1).map(|a| (axis(a) as u64) << (bits * (a as u32 + 1))).sum()
        })
        .collect()
}

/// Finds the pairs of up to [`BLOCK`] output sites. The windows of ascending keys ascend too, so that one pointer a row
/// moves forward only.
pub(super) struct Search<'a> {
    pub(super) kernel: Kernel,
    /// The keys' differences from the first cell of a window to the first cell of each row along the last axis.
    pub(super) rows: &'a [u64],
    /// The key of the first cell of each output's window.
    pub(super) firsts: &'a [u64],
    pub(super) inputs: &'a [u64],
    pub(super) scratch: &'a mut Scratch,
}

/// What a thread uses again for every block.
pub(super) struct Scratch {
    block: Block,
    /// Pairs of each weight of a row.
    found: Vec<Hits>,
}

impl Scratch {
    /// For kernels of this size along each axis.
    pub(super) fn new(size: usize) -> Self {
        Self { block: Block::default(), found: vec![Hits::NONE; size] }
    }
}

/// Pairs with at most one for each output site of a block.
#[derive(Clone)]
struct Hits {
    count: usize,
    outputs: [u8; BLOCK],
    inputs: [u32; BLOCK],
}

impl Hits {
    const NONE: Self = Self { count: 0, outputs: [0; BLOCK], inputs: [0; BLOCK] };

    /// Adds a pair on this condition, without a jump.
    #[inline(always)]
    fn add_if(&mut self, condition: bool, output: usize, input: usize) {
        let slot = self.count % BLOCK;
        self.outputs[slot] = output as u8;
        self.inputs[slot] = input as u32;
        self.count = slot + usize::from(condition);
    }
}

/// Rows whose pointers move at the same time: a processor then waits for none of them.
const ABREAST: usize = 3;

impl WithSimd for Search<'_> {
    type Output = Block;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _simd: S) -> Block {
        let Block { ends, outputs, inputs } = &mut self.scratch.block;
        ends.clear();
        outputs.clear();
        inputs.clear();
        let (abreast, rest) = self.rows.as_chunks::<ABREAST>();
        for rows in abreast {
            self.search_rows(*rows);
        }
        for &row in rest {
            self.search_rows([row]);
        }
        self.scratch.block.clone()
    }
}

impl Search<'_> {
    /// Appends the pairs of the weights of some rows.
    #[inline(always)]
    fn search_rows<const R: usize>(&mut self, differences: [u64; R]) {
        let Some(&lowest) = self.firsts.first() else { return };
        let inputs = self.inputs;
        let mut pointers = differences.map(|row| inputs.partition_point(|&key| key < lowest.wrapping_add(row)));
        let length = self.length();
        let mut hits = [const { Hits::NONE }; R];
        for (output, &first) in self.firsts.iter().enumerate().take(BLOCK) {
            for r in 0..R {
                let start = first.wrapping_add(differences[r]);
                pointers[r] = forward(inputs, pointers[r], start);
                let near = inputs.get(pointers[r]).is_some_and(|key| key.wrapping_sub(start) <= length);
                hits[r].add_if(near, output, pointers[r]);
            }
        }
        for (difference, hits) in differences.into_iter().zip(&hits) {
            self.append_row(difference, hits);
        }
    }

    /// Cells from the first to the last weight of a row.
    #[inline(always)]
    fn length(&self) -> u64 {
        ((self.kernel.size - 1) * self.kernel.dilation) as u64
    }

    /// Appends the pairs of one row.
    #[inline(always)]
    fn append_row(&mut self, difference: u64, hits: &Hits) {
        let length = self.length();
        let found = &mut self.scratch.found[..self.kernel.size];
        found.iter_mut().for_each(|found| found.count = 0);
        for (&output, &place) in hits.outputs.iter().zip(&hits.inputs).take(hits.count) {
            let start = self.firsts[usize::from(output)].wrapping_add(difference);
            for (&key, input) in self.inputs[place as usize..].iter().zip(place..) {
                let step = key.wrapping_sub(start);
                if step > length {
                    break;
                }
                if let Some(weight) = self.kernel.weight_at(step as usize) {
                    found[weight].add_if(true, usize::from(output), input as usize);
                }
            }
        }
        let block = &mut self.scratch.block;
        for own in found {
            block.outputs.extend_from_slice(&own.outputs[..own.count]);
            block.inputs.extend_from_slice(&own.inputs[..own.count]);
            block.ends.push(block.inputs.len() as u32);
        }
    }
}

/// The key of the first cell of an output's window.
#[inline(always)]
pub(super) fn first_cell<const D: usize>(output: u64, kernel: Kernel) -> u64 {
    let (sample, position) = Sites::<D>::unpacked(output);
    Sites::<D>::packed(sample, position.map(|c| c * kernel.stride as i64 - kernel.padding as i64))
}

/// Keys that are compared at once.
const AHEAD: usize = 4;

/// The first place from `pointer` on whose key is not below `start`. No processor foresees how far that is, so that keys
/// are counted instead of stopping at one.
#[inline(always)]
fn forward(inputs: &[u64], mut pointer: usize, start: u64) -> usize {
    while let Some(ahead) = inputs[pointer..].first_chunk::<AHEAD>() {
        let mut below = 0u64;
        for &key in ahead {
            below += u64::from(key < start);
        }
        pointer = pointer.wrapping_add(below as usize);
        if below < AHEAD as u64 {
            return pointer;
        }
    }
    while inputs.get(pointer).is_some_and(|&key| key < start) {
        pointer += 1;
    }
    pointer
}
