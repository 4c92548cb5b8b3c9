//! Which input site each weight of a kernel brings to which output site (the rule book of a sparse convolution).

use super::{MARGIN, Sites};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered_with};

/// Step from output to output, at most.
const MOST_STRIDE: usize = 1 << 30;

/// Output sites of a block.
pub(super) const BLOCK: usize = 256;

/// Shape of a kernel, the same along all axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Weights along an axis, 1 to 15.
    pub size: usize,
    /// Step from output to output, in cells of the input, 1 to 2^30.
    pub stride: usize,
    /// Step from weight to weight, in cells of the input.
    pub dilation: usize,
    /// Cells by which the first weight lies before the output's own cell.
    pub padding: usize,
}

impl Kernel {
    /// A kernel centred on each site: of odd size, with stride 1.
    pub fn centred(size: usize) -> Self {
        Self { size, stride: 1, dilation: 1, padding: size / 2 }
    }

    /// A kernel that divides the grid into cubes of `size` cells.
    pub fn cubes(size: usize) -> Self {
        Self { size, stride: size, dilation: 1, padding: 0 }
    }

    /// Number of weights in `D` dimensions.
    pub fn volume<const D: usize>(self) -> usize {
        self.size.pow(D as u32)
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(self) -> Result<()> {
        let near = |cells: Option<usize>| cells.is_some_and(|cells| cells < MARGIN as usize);
        match self {
            Self { size, .. } if !(1..=15).contains(&size) => Err(Error::parameter("size", size, "1 to 15")),
            Self { stride, .. } if !(1..=MOST_STRIDE).contains(&stride) => {
                Err(Error::parameter("stride", stride, format!("1 to {MOST_STRIDE}")))
            }
            Self { dilation: 0, .. } => Err(Error::parameter("dilation", 0, "1 or more")),
            Self { size, dilation, .. } if !near(size.checked_mul(dilation)) => {
                let allowed =
                    format!("1 to {}, so that the kernel reaches below {MARGIN} cells", (MARGIN as usize - 1) / size);
                Err(Error::parameter("dilation", dilation, allowed))
            }
            Self { padding, .. } if !near(Some(padding)) => {
                Err(Error::parameter("padding", padding, format!("below {MARGIN} cells")))
            }
            _ => Ok(()),
        }
    }
}

/// Pairs of a block of [`BLOCK`] output sites, weight after weight, output sites ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Block {
    /// End of the pairs of each weight.
    ends: Vec<u32>,
    /// Output site of each pair, counted from the first of the block.
    outputs: Vec<u8>,
    /// Input site of each pair.
    inputs: Vec<u32>,
}

/// The pairs of one weight in a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pairs<'a> {
    pub(crate) outputs: &'a [u8],
    pub(crate) inputs: &'a [u32],
}

impl Block {
    /// The pairs of a weight.
    #[inline]
    pub(super) fn pairs(&self, weight: usize) -> Pairs<'_> {
        let first = if weight == 0 { 0 } else { self.ends[weight - 1] as usize };
        let range = first..self.ends[weight] as usize;
        Pairs { outputs: &self.outputs[range.clone()], inputs: &self.inputs[range] }
    }
}

/// For each weight of a kernel the pairs (output site, input site) that it connects. O(sites x weights) time, 5 bytes a
/// pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KernelMap {
    volume: usize,
    outputs: usize,
    inputs: usize,
    pub(super) blocks: Vec<Block>,
}

impl KernelMap {
    /// The map of a convolution from `inputs` to `outputs`: output o takes input o·stride − padding + dilation·k through
    /// weight k, as in dense networks (cross-correlation). Weights are numbered with the last axis running fastest. With
    /// the same sites on both sides and a centred kernel this is the sub-manifold convolution.
    ///
    /// # Errors
    /// If the kernel is out of range, there are 2^32 sites or more, or the work was cancelled.
    pub fn new<const D: usize>(
        inputs: &Sites<D>,
        outputs: &Sites<D>,
        kernel: Kernel,
        monitor: &Monitor,
    ) -> Result<Self> {
        kernel.validate()?;
        if inputs.len() > u32::MAX as usize {
            return Err(Error::input(format!("{} sites (allowed: below 2^32)", inputs.len())));
        }
        let last = |&key: &u64| Sites::<D>::unpacked(key).1.into_iter().max().unwrap_or_default();
        let reach = outputs.keys().iter().map(last).max().unwrap_or_default().saturating_mul(kernel.stride as i64);
        if kernel.stride > 1 && reach >= Sites::<D>::LIMIT {
            let found = format!("an output site whose input is at {reach}");
            return Err(Error::input(format!("{found} (allowed: up to {})", Sites::<D>::LIMIT - 1)));
        }
        let rows = rows::<D>(kernel);
        let count = outputs.len().div_ceil(BLOCK);
        let blocks = map_ordered_with(
            0..count,
            monitor,
            || vec![Block::default(); kernel.volume::<D>()],
            |by_weight, b| {
                let own = &outputs.keys()[b * BLOCK..((b + 1) * BLOCK).min(outputs.len())];
                find_pairs::<D>(own, inputs.keys(), &Window { kernel, rows: &rows }, by_weight);
                Ok(joined(by_weight))
            },
        )?;
        Ok(Self { volume: kernel.volume::<D>(), outputs: outputs.len(), inputs: inputs.len(), blocks })
    }

    /// The map in the other direction: of the transposed convolution, and of gradients with respect to inputs.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn transposed(&self, monitor: &Monitor) -> Result<Self> {
        let mut counts = vec![0u32; self.inputs.div_ceil(BLOCK) * self.volume];
        for block in &self.blocks {
            monitor.check()?;
            for weight in 0..self.volume {
                let inputs = block.pairs(weight).inputs;
                inputs.iter().for_each(|&i| counts[i as usize / BLOCK * self.volume + weight] += 1);
            }
        }
        let mut blocks: Vec<Block> = counts.chunks_exact(self.volume).map(empty).collect();
        let mut next: Vec<u32> =
            counts.chunks_exact(self.volume).zip(&blocks).flat_map(|(c, b)| starts(c, &b.ends)).collect();
        for (number, block) in self.blocks.iter().enumerate() {
            monitor.check()?;
            for weight in 0..self.volume {
                let Pairs { outputs, inputs } = block.pairs(weight);
                for (&output, &input) in outputs.iter().zip(inputs) {
                    let (to, place) = (input as usize / BLOCK, input as usize % BLOCK);
                    let slot = &mut next[to * self.volume + weight];
                    blocks[to].outputs[*slot as usize] = place as u8;
                    blocks[to].inputs[*slot as usize] = (number * BLOCK) as u32 + u32::from(output);
                    *slot += 1;
                }
            }
        }
        Ok(Self { volume: self.volume, outputs: self.inputs, inputs: self.outputs, blocks })
    }

    /// Number of weights.
    pub fn volume(&self) -> usize {
        self.volume
    }

    /// Number of output sites.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Number of input sites.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of pairs: multiply-adds a pair of channels.
    pub fn pairs(&self) -> usize {
        self.blocks.iter().map(|block| block.inputs.len()).sum()
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        self.pairs() * 5 + self.blocks.len() * self.volume * size_of::<u32>()
    }
}

/// A kernel, and the keys' differences from the first cell of its window to the first cell of each row along the last
/// axis.
struct Window<'a> {
    kernel: Kernel,
    rows: &'a [u64],
}

/// Differences of keys for all offsets along all axes but the last.
fn rows<const D: usize>(kernel: Kernel) -> Vec<u64> {
    let bits = Sites::<D>::BITS;
    (0..kernel.size.pow(D as u32 - 1))
        .map(|row| {
            let axis = |a: usize| row / kernel.size.pow(a as u32) % kernel.size * kernel.dilation;
            // Axis a from the last but one upwards.
            (0..D - 1).map(|a| (axis(a) as u64) << (bits * (a as u32 + 1))).sum()
        })
        .collect()
}

/// Sorts the pairs of output sites with these keys by weight. The windows of ascending keys ascend too, so that one
/// pointer a row moves forward only.
fn find_pairs<const D: usize>(outputs: &[u64], inputs: &[u64], window: &Window<'_>, by_weight: &mut [Block]) {
    let Kernel { size, stride, dilation, padding } = window.kernel;
    let first = |key: u64| {
        let (sample, position) = Sites::<D>::unpacked(key);
        Sites::<D>::packed(sample, position.map(|c| c * stride as i64 - padding as i64))
    };
    let length = ((size - 1) * dilation) as u64;
    for (row, &difference) in window.rows.iter().enumerate() {
        let Some(&lowest) = outputs.first() else { return };
        let start = first(lowest) + difference;
        let mut pointer = inputs.partition_point(|&key| key < start);
        for (place, &output) in outputs.iter().enumerate() {
            let start = first(output) + difference;
            while inputs.get(pointer).is_some_and(|&key| key < start) {
                pointer += 1;
            }
            let near = inputs[pointer..].iter().take_while(|&&key| key <= start + length);
            for (&key, input) in near.zip(pointer..) {
                let step = (key - start) as usize;
                if step.is_multiple_of(dilation) {
                    let own = &mut by_weight[row * size + step / dilation];
                    own.outputs.push(place as u8);
                    own.inputs.push(input as u32);
                }
            }
        }
    }
}

/// The pairs of all weights in one block; the parts are emptied.
fn joined(by_weight: &mut [Block]) -> Block {
    let mut all = Block::default();
    for own in by_weight {
        all.outputs.append(&mut own.outputs);
        all.inputs.append(&mut own.inputs);
        all.ends.push(all.inputs.len() as u32);
    }
    all
}

/// A block with room for so many pairs of each weight.
fn empty(counts: &[u32]) -> Block {
    let ends: Vec<u32> = counts
        .iter()
        .scan(0, |end, &count| {
            *end += count;
            Some(*end)
        })
        .collect();
    let pairs = ends.last().map_or(0, |&end| end as usize);
    Block { ends, outputs: vec![0; pairs], inputs: vec![0; pairs] }
}

fn starts<'a>(counts: &'a [u32], ends: &'a [u32]) -> impl Iterator<Item = u32> + 'a {
    ends.iter().zip(counts).map(|(&end, &count)| end - count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn scattered<const D: usize>(seed: u64, count: usize, extent: usize) -> Sites<D> {
        let mut s = stream(seed, 0);
        let keys = (0..count)
            .map(|_| Sites::<D>::key(s.below(2) as u32, std::array::from_fn(|_| s.below(extent) as i64)).unwrap())
            .collect();
        Sites::of_keys(keys, &Monitor::default()).unwrap()
    }

    fn listed(map: &KernelMap) -> Vec<(usize, usize, usize)> {
        let mut all = Vec::new();
        for (number, block) in map.blocks.iter().enumerate() {
            for weight in 0..map.volume {
                let Pairs { outputs, inputs } = block.pairs(weight);
                all.extend(
                    outputs.iter().zip(inputs).map(|(&o, &i)| (number * BLOCK + usize::from(o), weight, i as usize)),
                );
            }
        }
        all.sort_unstable();
        all
    }

    /// All pairs by the definition.
    fn brute<const D: usize>(inputs: &Sites<D>, outputs: &Sites<D>, kernel: Kernel) -> Vec<(usize, usize, usize)> {
        let mut all = Vec::new();
        for o in 0..outputs.len() {
            let (sample, at) = outputs.position(o);
            for weight in 0..kernel.volume::<D>() {
                let place = std::array::from_fn(|a| {
                    let step = weight / kernel.size.pow((D - 1 - a) as u32) % kernel.size;
                    at[a] * kernel.stride as i64 + (step * kernel.dilation) as i64 - kernel.padding as i64
                });
                let input = Sites::<D>::key(sample, place).ok().and_then(|key| inputs.find(key));
                all.extend(input.map(|i| (o, weight, i)));
            }
        }
        all
    }

    #[test]
    fn maps_hold_all_pairs_of_the_definition() {
        fn check<const D: usize>(count: usize, extent: usize) {
            let monitor = Monitor::default();
            let sites = scattered::<D>(D as u64, count, extent);
            let kernels = [
                Kernel::centred(1),
                Kernel::centred(3),
                Kernel { dilation: 2, padding: 2, ..Kernel::centred(3) },
                Kernel::centred(5),
                Kernel::cubes(2),
                Kernel { size: 3, stride: 2, dilation: 1, padding: 1 },
            ];
            for kernel in kernels {
                let outputs = if kernel.stride == 1 { sites.clone() } else { sites.coarser(2, &monitor).unwrap() };
                let map = KernelMap::new(&sites, &outputs, kernel, &monitor).unwrap();
                assert_eq!(listed(&map), brute(&sites, &outputs, kernel), "{kernel:?}");
                let back = map.transposed(&monitor).unwrap();
                let mut swapped: Vec<_> = listed(&back).into_iter().map(|(i, w, o)| (o, w, i)).collect();
                swapped.sort_unstable();
                assert_eq!(swapped, listed(&map), "{kernel:?}");
                assert_eq!(back.transposed(&monitor).unwrap(), map);
            }
        }
        check::<1>(300, 500);
        check::<2>(900, 50);
        check::<3>(2000, 16);
    }

    #[test]
    fn kernels_out_of_range_are_named() {
        let of = |kernel: Kernel| kernel.validate().unwrap_err().to_string();
        assert!(of(Kernel::centred(17)).contains("size"));
        assert!(of(Kernel { stride: 0, ..Kernel::centred(3) }).contains("stride"));
        assert!(of(Kernel { dilation: 20, ..Kernel::centred(3) }).contains("dilation"));
        // Products that do not fit, or would be negative.
        for dilation in [usize::MAX, usize::MAX / 3 + 1, 1 << 63, (1 << 62) + 1] {
            let message = of(Kernel { dilation, ..Kernel::centred(3) });
            assert!(message.contains("dilation") && message.contains("1 to 10"), "{message}");
        }
        assert!(of(Kernel { padding: usize::MAX, ..Kernel::centred(3) }).contains("padding"));
        assert!(of(Kernel { stride: usize::MAX, ..Kernel::centred(3) }).contains("stride"));
        assert!(Kernel { dilation: 10, ..Kernel::centred(3) }.validate().is_ok());
        let none = Sites::<3>::default();
        let map = KernelMap::new(&none, &none, Kernel::centred(3), &Monitor::default()).unwrap();
        assert_eq!((map.pairs(), map.outputs(), map.volume()), (0, 0, 27));
    }
}
