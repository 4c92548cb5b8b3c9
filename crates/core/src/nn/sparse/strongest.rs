//! The strongest responses of several output channels, collected while a convolution passes over a part of its outputs.

use super::attention::{Attention, Selection};
use super::slab::LANES;
use crate::nn::scalar::Scalar;
use std::cmp::Ordering;

/// Cells after which counts are taken over, while `f32` still holds them exactly.
const UNCOUNTED: usize = 1 << 20;

/// The responses of a part of the outputs.
#[derive(Clone, Debug)]
pub(super) struct Found<T> {
    /// Entries (cell, response) of each output channel, by ascending cells.
    pub(super) entries: [Vec<(usize, T)>; LANES],
    /// Number of responses of each output channel that count for its density, also of those that are not kept.
    pub(super) counted: [usize; LANES],
    /// Whether responses of each output channel were dropped to have no more than enough.
    pub(super) dropped: [bool; LANES],
    /// Strength of the weakest that was left then; none that was dropped is stronger.
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
}

/// Collects responses cell after cell.
///
/// A channel holds up to twice as many as are enough, and then drops the weaker half: O(1) a response on average.
#[derive(Debug)]
pub(super) struct Strongest<T> {
    bias: [T; LANES],
    attention: Option<Attention>,
    enough: usize,
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
        Self {
            bias: how.bias,
            attention: how.selection.map(|selection| selection.attention),
            enough: if how.selection.is_some() { how.enough } else { usize::MAX },
            least: [T::ZERO; LANES],
            dropped: [false; LANES],
            counting: [T::ZERO; LANES],
            counted: [0; LANES],
            cells: 0,
            entries: Default::default(),
            strengths: Vec::new(),
        }
    }

    /// Takes the sums of neighbouring cells, which become responses; cells come in ascending order.
    #[inline(always)]
    pub(super) fn take(&mut self, first: usize, cells: &mut [[T; LANES]]) {
        let (all, positive) = (|response: T| response != T::ZERO, |response: T| response > T::ZERO);
        let over = match self.attention {
            Some(Attention::Positive) => self.responses(cells, |response| response, positive),
            Some(Attention::Magnitude) => self.responses(cells, T::magnitude, all),
            None => self.responses(cells, T::magnitude, positive),
        };
        if over.iter().any(|&over| over > T::ZERO) {
            self.keep(first, cells);
        }
        self.cells += cells.len();
        if self.cells > UNCOUNTED {
            self.count();
        }
    }

    /// Turns sums into responses and counts them; the largest distance of a strength above the least, for each
    /// channel. Plain loops over local copies, which the compiler turns into operations on all channels at once.
    #[inline(always)]
    fn responses(
        &mut self,
        cells: &mut [[T; LANES]],
        strength: impl Fn(T) -> T,
        counts: impl Fn(T) -> bool,
    ) -> [T; LANES] {
        let (bias, least, mut counted) = (self.bias, self.least, self.counting);
        let mut over = [T::ZERO; LANES];
        for cell in cells {
            let mut values = *cell;
            for lane in 0..LANES {
                let moved = values[lane] + bias[lane];
                values[lane] = if values[lane] == T::ZERO { T::ZERO } else { moved };
            }
            for lane in 0..LANES {
                counted[lane] += if counts(values[lane]) { T::ONE } else { T::ZERO };
            }
            for lane in 0..LANES {
                let above = strength(values[lane]) - least[lane];
                over[lane] = if above > over[lane] { above } else { over[lane] };
            }
            *cell = values;
        }
        self.counting = counted;
        over
    }

    fn count(&mut self) {
        self.cells = 0;
        for (sum, count) in self.counted.iter_mut().zip(&mut self.counting) {
            *sum += std::mem::take(count).wide() as usize;
        }
    }

    fn keep(&mut self, first: usize, cells: &[[T; LANES]]) {
        for (cell, responses) in (first..).zip(cells) {
            let mut strong = 0u32;
            for (lane, (&response, &least)) in responses.iter().zip(&self.least).enumerate() {
                strong |= u32::from(strength(self.attention, response) > least) << lane;
            }
            while strong != 0 {
                let lane = strong.trailing_zeros() as usize;
                strong &= strong - 1;
                self.entries[lane].push((cell, responses[lane]));
                if self.entries[lane].len() / 2 >= self.enough {
                    self.drop_weak(lane);
                }
            }
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
        entries.retain(|entry| {
            let own = strength(entry.1);
            let kept = own > least || (own == least && equal > 0);
            equal -= usize::from(kept && own == least);
            kept
        });
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
