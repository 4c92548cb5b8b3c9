//! Sparse tensors whose occupied positions (sites) have all channels: sites, kernel maps, convolution.
//!
//! The operations are those of spconv and MinkowskiEngine: sub-manifold convolution (B. Graham, M. Engelcke, L. van der
//! Maaten, *3D semantic segmentation with submanifold sparse convolutional networks*, CVPR 2018,
//! doi:10.1109/CVPR.2018.00961), strided and transposed convolution, pooling.

mod block;
mod convolution;
mod kernel;
mod kernel_map;
mod order;
mod product;
mod search;

pub(crate) use block::Pairs;
pub use convolution::{Connections, Convolution, ConvolutionGradient};
pub use kernel::Kernel;
pub use kernel_map::KernelMap;
pub(crate) use product::{Matrix, add_outer_products, add_outer_products_of_rows, add_products, add_products_of_rows};

use crate::error::{Error, Result};
use crate::parallel::Monitor;

/// Bits of a key for the number of the sample.
const SAMPLE_BITS: u32 = 12;
/// Empty cells on both sides of each axis, so that no offset of a kernel leads into another row.
pub(crate) const MARGIN: i64 = 32;

/// The occupied positions of a batch of sparse tensors of `D` dimensions (1 to 4), ascending by sample, then by position,
/// the last axis running fastest. Each position once.
///
/// A position is a vector of integers from 0 up to [`Sites::LIMIT`] (2^17 − 64 in 3-D, 2^26 − 64 in 2-D), a sample a number
/// below 4096.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sites<const D: usize> {
    keys: Vec<u64>,
}

/// Sites of keys in any order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ranked<const D: usize> {
    /// The sites.
    pub sites: Sites<D>,
    /// Site of each key.
    pub site_of: Vec<u32>,
}

impl<const D: usize> Sites<D> {
    /// Bits of a key for an axis.
    const BITS: u32 = (64 - SAMPLE_BITS) / D as u32;
    /// Positions are below this along each axis.
    pub const LIMIT: i64 = (1 << Self::BITS) - 2 * MARGIN;

    /// The key of a position.
    ///
    /// # Errors
    /// If a coordinate is below 0 or not below [`Sites::LIMIT`], or the sample is 4096 or more.
    pub fn key(sample: u32, position: [i64; D]) -> Result<u64> {
        if sample >= 1 << SAMPLE_BITS {
            return Err(Error::input(format!("sample {sample} (allowed: below {})", 1 << SAMPLE_BITS)));
        }
        if let Some(wrong) = position.iter().find(|c| !(0..Self::LIMIT).contains(*c)) {
            return Err(Error::input(format!("position {wrong} of a site (allowed: 0 up to {})", Self::LIMIT - 1)));
        }
        Ok(Self::packed(sample, position))
    }

    /// The key of a position that is inside the range, the margin included.
    #[inline(always)]
    fn packed(sample: u32, position: [i64; D]) -> u64 {
        position.iter().fold(u64::from(sample), |key, &c| key << Self::BITS | (c + MARGIN) as u64)
    }

    /// Sample and position of a key.
    #[inline(always)]
    fn unpacked(key: u64) -> (u32, [i64; D]) {
        let mask = (1u64 << Self::BITS) - 1;
        let axis = |a: usize| (key >> (Self::BITS * (D - 1 - a) as u32) & mask) as i64 - MARGIN;
        ((key >> (Self::BITS * D as u32)) as u32, std::array::from_fn(axis))
    }

    /// The sites of these keys, sorted, each once.
    ///
    /// # Errors
    /// If there are 2^32 keys or more, or the work was cancelled.
    pub fn of_keys(keys: Vec<u64>, monitor: &Monitor) -> Result<Self> {
        Ok(Self { keys: order::sorted(keys, monitor)? })
    }

    /// The same, and which site each key is.
    ///
    /// # Errors
    /// As [`Sites::of_keys`].
    pub fn ranked(keys: &[u64], monitor: &Monitor) -> Result<Ranked<D>> {
        let order::Ranks { keys, of } = order::ranked(keys, monitor)?;
        Ok(Ranked { sites: Self { keys }, site_of: of })
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// The keys, ascending.
    pub fn keys(&self) -> &[u64] {
        &self.keys
    }

    /// Sample and position of a site.
    pub fn position(&self, site: usize) -> (u32, [i64; D]) {
        Self::unpacked(self.keys[site])
    }

    /// The site of a key.
    pub fn find(&self, key: u64) -> Option<usize> {
        self.keys.binary_search(&key).ok()
    }

    /// The sites of the cells of a grid that is coarser by `stride` along each axis: those in which any site lies.
    ///
    /// # Errors
    /// If the stride is 0, or the work was cancelled.
    pub fn coarser(&self, stride: usize, monitor: &Monitor) -> Result<Self> {
        if stride == 0 {
            return Err(Error::parameter("stride", stride, "1 or more"));
        }
        let coarse = |key: &u64| {
            let (sample, position) = Self::unpacked(*key);
            Self::packed(sample, position.map(|c| c / stride as i64))
        };
        let mut keys: Vec<u64> = self.keys.iter().map(coarse).collect();
        // Neighbours along the last axis often share a cell.
        keys.dedup();
        Self::of_keys(keys, monitor)
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        self.keys.len() * size_of::<u64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn keys_keep_position_and_sample_and_their_order_in_every_dimension() {
        fn check<const D: usize>() {
            let mut s = stream(1, D as u64);
            let last = Sites::<D>::LIMIT - 1;
            let mut places: Vec<(u32, [i64; D])> = (0..500)
                .map(|_| (s.below(4096) as u32, std::array::from_fn(|_| s.below(last as usize + 1) as i64)))
                .collect();
            places.push((4095, [last; D]));
            places.push((0, [0; D]));
            places.sort_unstable();
            places.dedup();
            let keys: Vec<u64> = places.iter().map(|&(sample, at)| Sites::<D>::key(sample, at).unwrap()).collect();
            let sites = Sites::<D>::of_keys(keys.iter().rev().chain(&keys).copied().collect(), &Monitor::default());
            let sites = sites.unwrap();
            assert_eq!(sites.keys(), keys);
            assert!((0..sites.len()).map(|i| sites.position(i)).eq(places));
            assert!(Sites::<D>::key(0, [last + 1; D]).unwrap_err().to_string().contains("allowed"));
            assert!(Sites::<D>::key(0, [-1; D]).is_err() && Sites::<D>::key(4096, [0; D]).is_err());
        }
        check::<1>();
        check::<2>();
        check::<3>();
        check::<4>();
    }

    #[test]
    fn coarser_sites_are_the_cells_that_hold_any() {
        let mut s = stream(2, 0);
        let keys =
            (0..3000).map(|_| Sites::<3>::key(s.below(3) as u32, [0; 3].map(|_: i64| s.below(40) as i64)).unwrap());
        let sites = Sites::<3>::of_keys(keys.collect(), &Monitor::default()).unwrap();
        for stride in [1, 2, 3, 5] {
            let found = sites.coarser(stride, &Monitor::default()).unwrap();
            let cells: std::collections::BTreeSet<(u32, [i64; 3])> = (0..sites.len())
                .map(|i| (sites.position(i).0, sites.position(i).1.map(|c| c / stride as i64)))
                .collect();
            assert!((0..found.len()).map(|i| found.position(i)).eq(cells));
        }
        assert!(sites.coarser(0, &Monitor::default()).is_err());
    }
}
