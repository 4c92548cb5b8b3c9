//! The strongest responses of several output channels, collected while a convolution passes over a part of its outputs.

use super::attention::{Attention, Selection};
use super::slab::{LANES, Sums};
use crate::nn::scalar::Scalar;
use std::cmp::Ordering;

/// Cells of a block: those whose operations the compiler writes out.
pub(super) const MARKED: usize = 8;
/// Blocks that are taken together, at most: they stay in the innermost cache until they are cleared.
pub(super) const TOGETHER: usize = 64;
/// Blocks whose cells have a bit of a word each.
const IN_WORD: usize = u32::BITS as usize / MARKED;
/// Words of an output channel for blocks that are taken together.
const WORDS: usize = TOGETHER / IN_WORD;
/// Responses of a channel for which there is room from the beginning, at most.
const ROOM: usize = 1 << 11;
/// Cells after which counts are taken over, while `f32` still holds them exactly.
const UNCOUNTED: usize = 1 << 20;

/// The responses of a part of the outputs.
#[derive(Clone, Debug)]
pub(super) struct Found<T> {
    /// Entries (cell, response) of each output channel, by ascending cells.
    pub(super) entries: [Vec<(usize, T)>; LANES],
    /// Number of responses above 0 of each output channel, also of those that are not kept.
    pub(super) counted: [usize; LANES],
    /// Whether responses of each output channel may have been dropped.
    pub(super) dropped: [bool; LANES],
    /// None that was dropped is stronger than this.
    pub(super) least: [T; LANES],
}

/// How responses are collected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Collecting<T> {
    /// Added to responses that are not 0.
    pub(super) bias: [T; LANES],
    /// Which are strong; none: all are kept.
    pub(super) selection: Option<Selection>,
    /// Number of responses of a channel that are enough; weaker ones may be dropped.
    pub(super) enough: usize,
    /// The same at the beginning; it grows with the share of the inputs that were added.
    pub(super) enough_at_first: usize,
    /// Responses of a channel that are not stronger than this are dropped from the beginning; 0: none.
    pub(super) least: [T; LANES],
}

/// Collects responses cell after cell.
///
/// A channel holds up to half as many again as are enough (twice as many where that number does not grow), and then drops the
/// weakest: O(1) a response on average.
#[derive(Debug)]
pub(super) struct Strongest<T> {
    bias: [T; LANES],
    attention: Option<Attention>,
    /// Number of responses of a channel that are enough at the beginning, how many more are at the end, and those now.
    enough_at_first: usize,
    more_enough: usize,
    enough: usize,
    /// Number of responses of a channel at which the weakest are dropped.
    full: usize,
    least: [T; LANES],
    dropped: [bool; LANES],
    /// Counts that are not taken over yet; whole numbers.
    counting: [T; LANES],
    counted: [usize; LANES],
    /// Cells since the last count was taken over.
    cells: usize,
    entries: [Vec<(usize, T)>; LANES],
    strengths: Vec<T>,
}

impl<T: Scalar> Strongest<T> {
    pub(super) fn new(how: &Collecting<T>) -> Self {
        let enough_at_first = if how.selection.is_some() { how.enough_at_first } else { usize::MAX };
        let room = if how.selection.is_some() { how.enough.min(ROOM) } else { 0 };
        let mut own = Self {
            bias: how.bias,
            attention: how.selection.map(|selection| selection.attention),
            enough_at_first,
            more_enough: how.enough.saturating_sub(enough_at_first),
            enough: enough_at_first,
            full: 0,
            least: how.least,
            dropped: how.least.map(|least| least > T::ZERO),
            counting: [T::ZERO; LANES],
            counted: [0; LANES],
            cells: 0,
            entries: std::array::from_fn(|_| Vec::with_capacity(room)),
            strengths: Vec::new(),
        };
        own.set_share(0.0);
        own
    }

    /// Sets the share of the inputs that were added.
    pub(super) fn set_share(&mut self, share: f64) {
        self.enough = self.enough_at_first.saturating_add((share * self.more_enough as f64) as usize);
        self.full = self.enough.saturating_add(self.enough_at_first.max(self.enough / 2));
    }

    /// Takes the sums of neighbouring cells, [`TOGETHER`] blocks at most, which become responses, and sets them to 0; cells come
    /// in ascending order.
    #[inline(always)]
    pub(super) fn take(&mut self, first: usize, blocks: &mut [[Sums<T>; MARKED]]) {
        match blocks.len() {
            0..=IN_WORD => self.take_words::<1>(first, blocks),
            _ => self.take_words::<WORDS>(first, blocks),
        }
        blocks.fill([Sums([T::ZERO; LANES]); MARKED]);
        self.cells += MARKED * blocks.len();
        if self.cells > UNCOUNTED {
            self.count();
        }
    }

    /// Takes cells that have up to so many words for each channel.
    #[inline(always)]
    fn take_words<const N: usize>(&mut self, first: usize, blocks: &[[Sums<T>; MARKED]]) {
        let words: [[u32; LANES]; N] = match self.attention {
            Some(Attention::Positive) => self.strong(blocks, |response| response),
            Some(Attention::Magnitude) | None => self.strong(blocks, T::magnitude),
        };
        self.keep(first, blocks.as_flattened(), &words);
    }

    /// Counts responses above 0, and finds those that are stronger than the least of their channel: words for each
    /// channel, a bit for each cell. Plain loops over local copies, which the compiler turns into operations on all channels at
    /// once; none across channels, which would cost more than all others.
    #[inline(always)]
    fn strong<const N: usize>(&mut self, blocks: &[[Sums<T>; MARKED]], strength: impl Fn(T) -> T) -> [[u32; LANES]; N] {
        let (bias, least) = (self.bias, self.least);
        let mut words = [[0; LANES]; N];
        // Of every second cell, so that no addition waits for that of the cell before.
        let mut counted = [[T::ZERO; LANES]; 2];
        for (words, blocks) in words.iter_mut().zip(blocks.chunks(IN_WORD)) {
            let mut strong = [0u32; LANES];
            for (first, cells) in (0..).step_by(MARKED).zip(blocks) {
                for (cell, &Sums(mut values)) in cells.iter().enumerate() {
                    for lane in 0..LANES {
                        let moved = values[lane] + bias[lane];
                        values[lane] = if values[lane] == T::ZERO { T::ZERO } else { moved };
                    }
                    for lane in 0..LANES {
                        counted[cell % 2][lane] += if values[lane] > T::ZERO { T::ONE } else { T::ZERO };
                    }
                    let bit = 1 << (first + cell);
                    for lane in 0..LANES {
                        strong[lane] |= if strength(values[lane]) > least[lane] { bit } else { 0 };
                    }
                }
            }
            *words = strong;
        }
        for (sum, (&even, &odd)) in self.counting.iter_mut().zip(counted[0].iter().zip(&counted[1])) {
            *sum += even + odd;
        }
        words
    }

    /// Keeps the strong responses of some cells.
    #[inline(always)]
    fn keep<const N: usize>(&mut self, first: usize, cells: &[Sums<T>], words: &[[u32; LANES]; N]) {
        let words = words.as_flattened();
        // The words with a strong response, found without branches, which the processor could not foresee.
        let (mut numbers, mut count) = ([[0u8; LANES]; N], 0);
        let numbers = numbers.as_flattened_mut();
        for (number, word) in (0..).zip(words) {
            numbers[count % (N * LANES)] = number;
            count += usize::from(*word != 0);
        }
        for number in numbers[..count].iter().map(|number| usize::from(*number)) {
            let (lane, start) = (number % LANES, number / LANES * IN_WORD * MARKED);
            let mut strong = words[number];
            while strong != 0 {
                let cell = start + strong.trailing_zeros() as usize;
                strong &= strong - 1;
                // A strong response is not 0, and so was its sum.
                self.push(lane, first + cell, cells[cell].0[lane] + self.bias[lane]);
            }
        }
    }

    #[inline(always)]
    fn push(&mut self, lane: usize, cell: usize, response: T) {
        self.entries[lane].push((cell, response));
        if self.entries[lane].len() >= self.full {
            self.drop_weak(lane);
        }
    }

    fn count(&mut self) {
        self.cells = 0;
        for (sum, count) in self.counted.iter_mut().zip(&mut self.counting) {
            *sum += std::mem::take(count).wide() as usize;
        }
    }

    /// Leaves as many of a channel as are enough, of equally strong ones those of lower cells.
    #[cold]
    fn drop_weak(&mut self, lane: usize) {
        let (entries, strengths) = (&mut self.entries[lane], &mut self.strengths);
        let attention = self.attention;
        let strength = |response: T| strength(attention, response);
        strengths.clear();
        strengths.extend(entries.iter().map(|entry| strength(entry.1)));
        let place = strengths.len() - self.enough;
        let (_, &mut least, above) =
            strengths.select_nth_unstable_by(place, |a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
        let stronger = above.iter().filter(|value| **value > least).count();
        let mut equal = self.enough - stronger;
        let mut kept = 0;
        // Without branches, which the processor could not foresee.
        for i in 0..entries.len() {
            let own = strength(entries[i].1);
            let as_weak = (own == least) & (equal > 0);
            entries[kept] = entries[i];
            kept += usize::from((own > least) | as_weak);
            equal -= usize::from(as_weak);
        }
        entries.truncate(kept);
        (self.least[lane], self.dropped[lane]) = (least, true);
    }

    /// What was found.
    pub(super) fn found(mut self) -> Found<T> {
        self.count();
        Found { entries: self.entries, counted: self.counted, dropped: self.dropped, least: self.least }
    }
}

/// Strength of a response; without attention all that are not 0 are strong.
fn strength<T: Scalar>(attention: Option<Attention>, response: T) -> T {
    if attention == Some(Attention::Positive) { response } else { response.magnitude() }
}
