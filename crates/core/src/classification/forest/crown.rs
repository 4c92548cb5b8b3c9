//! The first levels of a tree, evaluated for a whole tile of rows at once: all splits, without branches or look-ups.

use super::step::Step;
use crate::classification::quantise::{CodeBlock, Column, TILE};

/// Levels of a crown. Each doubles the work, which is less than that of a descent up to here.
const LEVELS: usize = 6;

/// Number of places where rows leave a crown.
const ENDS: usize = 1 << LEVELS;

/// Ways on from three levels.
const WAYS: usize = 8;

/// The splits of three levels, level by level.
type Splits = [(u8, u8); WAYS - 1];

/// The first levels of a tree as if it had all nodes there: below a leaf, all rows go left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crown {
    /// Feature and cut of each split of the first three levels.
    top: Splits,
    /// Of the three levels below each of them.
    bottom: [Splits; WAYS],
    /// The node of the tree at each end.
    ends: [u16; ENDS],
}

impl Crown {
    /// The crown of a tree whose first node is its root.
    pub(super) fn new(steps: &[Step]) -> Self {
        let (top, ways) = three_levels(steps, 0);
        let below = ways.map(|at| three_levels(steps, at));
        let ends = std::array::from_fn(|end| below[end / WAYS].1[end % WAYS]);
        Self { top, bottom: below.map(|(splits, _)| splits), ends }
    }

    /// The node at an end.
    #[inline(always)]
    pub(super) fn end(&self, number: u8) -> u16 {
        self.ends[usize::from(number) % ENDS]
    }

    /// The end that each row of a tile reaches: from the last level up, each split chooses between the ends that the
    /// splits below it have chosen.
    #[inline(always)]
    fn tile(&self, columns: &[Column], to: &mut [u8; TILE]) {
        let mut chosen = [Column([0; TILE]); WAYS];
        for (way, (splits, Column(chosen))) in self.bottom.iter().zip(&mut chosen).enumerate() {
            choose(splits, columns, |i, _| (way * WAYS + i) as u8, chosen);
        }
        choose(&self.top, columns, |way, row| chosen[way].0[row], to);
    }
}

/// The splits of three levels from a node down, and the nodes below them.
fn three_levels(steps: &[Step], from: u16) -> (Splits, [u16; WAYS]) {
    let step = |at: u16| steps.get(usize::from(at)).copied().unwrap_or_default();
    let mut at = vec![from];
    let mut splits = Vec::new();
    while at.len() < WAYS {
        splits.extend(at.iter().map(|&at| step(at)).map(|s| if s.is_leaf() { (0, s.cut()) } else { s.split() }));
        at = at.iter().flat_map(|&at| [step(at).left(), step(at).right()]).collect();
    }
    (std::array::from_fn(|i| splits[i]), std::array::from_fn(|i| at[i]))
}

/// For each row of a tile, that of eight numbers to which three levels of splits lead.
#[inline(always)]
fn choose(splits: &Splits, columns: &[Column], from: impl Fn(usize, usize) -> u8, to: &mut [u8; TILE]) {
    let codes = splits.map(|(feature, _)| &columns.get(usize::from(feature)).unwrap_or(&Column([0; TILE])).0);
    for (row, to) in to.iter_mut().enumerate() {
        let split = |i: usize, left: u8, right: u8| {
            // Not `if`, which becomes loads from one of two places, one by one.
            let mask = u8::from(codes[i][row] > splits[i].1).wrapping_neg();
            left ^ ((left ^ right) & mask)
        };
        let end = |i: usize| from(i, row);
        let left = split(1, split(3, end(0), end(1)), split(4, end(2), end(3)));
        let right = split(2, split(5, end(4), end(5)), split(6, end(6), end(7)));
        *to = split(0, left, right);
    }
}

/// Finds the end that each row reaches; compiled for each instruction set.
pub(super) struct FindEnds<'a> {
    pub(super) crown: &'a Crown,
    pub(super) codes: &'a CodeBlock<u8>,
    /// Whole tiles.
    pub(super) ends: &'a mut [u8],
}

impl pulp::WithSimd for FindEnds<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let tiles = self.codes.by_tile.chunks_exact(self.codes.width.max(1));
        for (to, tile) in self.ends.as_chunks_mut().0.iter_mut().zip(tiles) {
            self.crown.tile(tile, to);
        }
    }
}
