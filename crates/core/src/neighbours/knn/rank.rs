//! Sorts the k smallest of a few distances by counting, for each, how many are smaller.

use super::lanes::LANES;
use pulp::Simd;

/// Up to this many candidates are ranked by counting, more are sorted.
const RANKED: usize = 256;
/// Number of vectors that are ranked together.
const TOGETHER: usize = 4;

/// Squared distance (upper half, its bit pattern) and index: ascending by (distance, index).
type Key = u64;

/// Neighbour rows of points, one after the other.
#[derive(Clone, Debug, Default)]
pub(in crate::neighbours) struct Rows {
    pub(in crate::neighbours) index: Vec<u32>,
    /// Bit patterns of the squared distances.
    pub(in crate::neighbours) squared: Vec<u32>,
}

impl Rows {
    pub(super) fn with_room(places: usize) -> Self {
        Self { index: Vec::with_capacity(places), squared: Vec::with_capacity(places) }
    }
}

/// Candidates for the nearest points, in any order, with buffers for ranking.
#[derive(Clone, Debug)]
pub(super) struct Ranking {
    /// Bit patterns of the squared distances; the first `len` are in use.
    pub(in crate::neighbours) squared: Vec<u32>,
    pub(in crate::neighbours) index: Vec<u32>,
    pub(in crate::neighbours) len: usize,
    rank: [u32; RANKED],
    ranked: [[u32; RANKED]; 2],
    keys: Vec<Key>,
}

impl Default for Ranking {
    fn default() -> Self {
        let (squared, index) = (vec![0; RANKED], vec![0; RANKED]);
        Self { squared, index, len: 0, rank: [0; RANKED], ranked: [[0; RANKED]; 2], keys: Vec::new() }
    }
}

impl Ranking {
    /// Appends the `k` nearest, ascending by (distance, index), to the rows. There are at least `k`, and `k` is above 0.
    #[inline(always)]
    pub(in crate::neighbours) fn write<S: Simd>(&mut self, simd: S, k: usize, out: &mut Rows) {
        if self.len <= RANKED {
            self.count::<S, false>(simd);
            if !self.place(k) {
                self.count::<S, true>(simd);
                self.place(k);
            }
            out.index.extend_from_slice(&self.ranked[0][..k]);
            out.squared.extend_from_slice(&self.ranked[1][..k]);
        } else {
            self.sort(k);
            out.index.extend(self.keys[..k].iter().map(|&key| key as u32));
            out.squared.extend(self.keys[..k].iter().map(|&key| (key >> 32) as u32));
        }
    }

    /// Removes all but the `k` nearest; returns the largest remaining distance. There are more than `k`.
    #[inline(never)]
    pub(super) fn shrink(&mut self, k: usize) -> f32 {
        self.take_keys();
        let farthest = *self.keys.select_nth_unstable(k - 1).1;
        for (i, &key) in self.keys[..k].iter().enumerate() {
            (self.index[i], self.squared[i]) = (key as u32, (key >> 32) as u32);
        }
        self.len = k;
        f32::from_bits((farthest >> 32) as u32)
    }

    fn take_keys(&mut self) {
        self.keys.clear();
        let pairs = self.squared.iter().zip(&self.index).take(self.len);
        self.keys.extend(pairs.map(|(&d, &i)| u64::from(d) << 32 | u64::from(i)));
    }

    #[inline(never)]
    fn sort(&mut self, k: usize) {
        self.take_keys();
        if self.keys.len() > k {
            self.keys.select_nth_unstable(k - 1);
        }
        self.keys[..k].sort_unstable();
    }

    /// Counts for each candidate how many are nearer; with `TIES` also those of equal distance and smaller index.
    #[inline(always)]
    fn count<S: Simd, const TIES: bool>(&mut self, simd: S) {
        let full = self.len.next_multiple_of(LANES);
        let all = Candidates { squared: &self.squared[..self.len], index: &self.index[..self.len] };
        let (squared, _) = S::as_simd_u32s(&self.squared[..full]);
        let (index, _) = S::as_simd_u32s(&self.index[..full]);
        let (rank, _) = S::as_mut_simd_u32s(&mut self.rank[..full]);
        let (squared, squared_rest) = squared.as_chunks::<TOGETHER>();
        let (index, index_rest) = index.as_chunks::<TOGETHER>();
        let (rank, rank_rest) = rank.as_chunks_mut::<TOGETHER>();
        for ((squared, index), rank) in squared.iter().zip(index).zip(rank) {
            *rank = nearer::<S, TOGETHER, TIES>(simd, all, Candidates { squared, index });
        }
        for ((&d, &i), rank) in squared_rest.iter().zip(index_rest).zip(rank_rest) {
            [*rank] = nearer::<S, 1, TIES>(simd, all, Candidates { squared: &[d], index: &[i] });
        }
    }

    /// Writes each candidate to the position of its rank. False if a tie left one of the first `k` positions, or the
    /// next one, empty.
    #[inline(always)]
    fn place(&mut self, k: usize) -> bool {
        let last = k.min(self.len - 1);
        let [index, squared] = &mut self.ranked;
        index[..=last].fill(u32::MAX);
        for ((&rank, &i), &d) in self.rank.iter().zip(&self.index).zip(&self.squared).take(self.len) {
            let rank = rank as usize & (RANKED - 1);
            (index[rank], squared[rank]) = (i, d);
        }
        !index[..=last].iter().fold(false, |empty, &i| empty | (i == u32::MAX))
    }
}

/// Bit patterns of squared distances, and indices.
#[derive(Clone, Copy, Debug)]
struct Candidates<T> {
    squared: T,
    index: T,
}

/// For each lane of a few vectors the number of candidates that are nearer. Distances are not negative, so that their
/// bit patterns sort like the values.
#[inline(always)]
fn nearer<S: Simd, const N: usize, const TIES: bool>(
    simd: S,
    all: Candidates<&[u32]>,
    Candidates { squared, index }: Candidates<&[S::u32s; N]>,
) -> [S::u32s; N] {
    let (one, none) = (simd.splat_u32s(1), simd.splat_u32s(0));
    let mut sum = [none; N];
    for (&d, &i) in all.squared.iter().zip(all.index) {
        let d = simd.splat_u32s(d);
        for n in 0..N {
            let mut before = simd.less_than_u32s(d, squared[n]);
            if TIES {
                let smaller = simd.less_than_u32s(simd.splat_u32s(i), index[n]);
                before = simd.or_m32s(before, simd.and_m32s(simd.equal_u32s(d, squared[n]), smaller));
            }
            sum[n] = simd.add_u32s(sum[n], simd.select_u32s(before, one, none));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use pulp::{Arch, WithSimd};

    struct Write<'a>(&'a mut Ranking, usize, &'a mut Rows);

    impl WithSimd for Write<'_> {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            self.0.write(simd, self.1, self.2);
        }
    }

    /// Few, some and many points with few or many distinct distances, compared with a sort.
    #[test]
    fn rows_are_those_of_a_sort_with_and_without_ties() {
        let mut random = stream(5, 9);
        for n in [1, 2, 15, 16, 17, 64, 65, 130, 255, 256, 257, 700] {
            for different in [1, 3, 40, 1_000_000] {
                let mut pairs: Vec<(u32, u32)> =
                    (0..n).map(|i| ((random.below(different) as f32).to_bits(), (n - i) as u32 * 3)).collect();
                let (mut ranking, mut plain) = (Ranking::default(), Ranking::default());
                for r in [&mut ranking, &mut plain] {
                    r.len = n;
                    r.squared = pairs.iter().map(|p| p.0).chain([0; LANES]).collect();
                    r.index = pairs.iter().map(|p| p.1).chain([0; LANES]).collect();
                }
                pairs.sort_unstable();
                for k in [1, n.div_ceil(2), n] {
                    let (mut fast, mut slow) = (Rows::default(), Rows::default());
                    Arch::new().dispatch(Write(&mut ranking, k, &mut fast));
                    pulp::Scalar::new().vectorize(Write(&mut plain, k, &mut slow));
                    let expected: (Vec<u32>, Vec<u32>) = pairs[..k].iter().copied().unzip();
                    assert_eq!((fast.squared, fast.index), expected, "{k} of {n}");
                    assert_eq!((slow.squared, slow.index), expected, "{k} of {n}, no vectors");
                }
                if n > 2 {
                    assert_eq!(ranking.shrink(2).to_bits(), pairs[1].0);
                    assert_eq!(ranking.len, 2);
                }
            }
        }
    }
}
