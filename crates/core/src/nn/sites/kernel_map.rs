//! Which input site each weight of a kernel brings to which output site (the rule book of a sparse convolution).

use super::Sites;
use super::block::{BLOCK, Block, Pairs};
use super::kernel::Kernel;
use super::search::{Scratch, Search, first_cell, rows};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered_with};
use pulp::Arch;

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
        if kernel.stride > 1 {
            check_reach(outputs, kernel.stride)?;
        }
        let rows = rows::<D>(kernel);
        let count = outputs.len().div_ceil(BLOCK);
        let blocks = map_ordered_with(
            0..count,
            monitor,
            || Scratch::new(kernel.size),
            |scratch, b| {
                let own = &outputs.keys()[b * BLOCK..((b + 1) * BLOCK).min(outputs.len())];
                let firsts: Vec<u64> = own.iter().map(|&key| first_cell::<D>(key, kernel)).collect();
                let search = Search { kernel, rows: &rows, firsts: &firsts, inputs: inputs.keys(), scratch };
                Ok(Arch::new().dispatch(search))
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
        let mut blocks: Vec<Block> = counts.chunks_exact(self.volume).map(Block::with_room).collect();
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

/// Fails if an output's window lies beyond the limit of the inputs.
fn check_reach<const D: usize>(outputs: &Sites<D>, stride: usize) -> Result<()> {
    let last = |&key: &u64| Sites::<D>::unpacked(key).1.into_iter().max().unwrap_or_default();
    let reach = outputs.keys().iter().map(last).max().unwrap_or_default().saturating_mul(stride as i64);
    match reach < Sites::<D>::LIMIT {
        true => Ok(()),
        false => Err(Error::input(format!(
            "an output site whose input is at {reach} (allowed: up to {})",
            Sites::<D>::LIMIT - 1
        ))),
    }
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
        check::<1>(2000, 1_000_000);
        check::<2>(900, 50);
        check::<3>(2000, 16);
        // Every cell of a cube: each output of a block has all pairs.
        check::<3>(9000, 9);
    }

    #[test]
    fn no_sites_have_no_pairs() {
        let none = Sites::<3>::default();
        let map = KernelMap::new(&none, &none, Kernel::centred(3), &Monitor::default()).unwrap();
        assert_eq!((map.pairs(), map.outputs(), map.volume()), (0, 0, 27));
    }
}
