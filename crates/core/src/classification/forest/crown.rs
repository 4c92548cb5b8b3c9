//! The first levels of a tree, evaluated for a whole tile of rows at once: all splits, without branches or look-ups.

use super::step::Step;
use crate::classification::quantise::{CodeBlock, TILE};

/// Levels of a crown. Each doubles the work, which is less than that of a descent up to here.
const LEVELS: usize = 6;

/// Number of places where rows leave a crown.
pub(super) const ENDS: usize = 1 << LEVELS;

/// Splits of the last level.
const LAST: usize = ENDS / 2;

/// The first levels of a tree as if it had all nodes there: below a leaf, all rows go left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crown {
    /// Feature and cut of each split, level by level.
    splits: [(u8, u8); ENDS - 1],
    /// The node of the tree at each end.
    ends: [u16; ENDS],
}

impl Crown {
    /// The crown of a tree whose first node is its root.
    pub(super) fn new(steps: &[Step]) -> Self {
        let step = |at: u16| steps.get(usize::from(at)).copied().unwrap_or_default();
        let mut at = vec![0u16];
        let mut splits = Vec::new();
        for _ in 0..LEVELS {
            splits.extend(at.iter().map(|&at| step(at)).map(|s| if s.is_leaf() { (0, s.cut()) } else { s.split() }));
            at = at.iter().flat_map(|&at| [step(at).left(), step(at).right()]).collect();
        }
        Self {
            splits: std::array::from_fn(|i| splits.get(i).copied().unwrap_or_default()),
            ends: std::array::from_fn(|i| at.get(i).copied().unwrap_or_default()),
        }
    }

    /// The node at an end.
    #[inline(always)]
    pub(super) fn end(&self, number: u8) -> u16 {
        self.ends[usize::from(number) % ENDS]
    }

    /// The end that each row of a tile reaches: from the last level up, each split chooses between the ends that the
    /// splits below it have chosen.
    #[inline(always)]
    fn tile(&self, columns: &[[u8; TILE]], to: &mut [u8; TILE]) {
        let split = |i: usize| {
            let (feature, cut) = self.splits.get(i).copied().unwrap_or_default();
            (columns.get(usize::from(feature)).unwrap_or(&[0; TILE]), cut)
        };
        let mut chosen = [[0u8; TILE]; LAST];
        for (i, chosen) in chosen.iter_mut().enumerate() {
            let (column, cut) = split(i + LAST - 1);
            for (chosen, &code) in chosen.iter_mut().zip(column) {
                *chosen = (2 * i as u8) | u8::from(code > cut);
            }
        }
        let mut splits = LAST / 2;
        while splits > 0 {
            for i in 0..splits {
                let (column, cut) = split(i + splits - 1);
                let (left, right) = (chosen[2 * i], chosen[2 * i + 1]);
                let sides = left.iter().zip(&right).zip(column);
                for (to, ((&left, &right), &code)) in chosen[i].iter_mut().zip(sides) {
                    // Not `if`, which becomes loads from one of two places, one by one.
                    let mask = u8::from(code > cut).wrapping_neg();
                    *to = left ^ ((left ^ right) & mask);
                }
            }
            splits /= 2;
        }
        *to = chosen[0];
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
        let tiles = self.codes.by_tile.chunks_exact(TILE * self.codes.width.max(1));
        for (to, tile) in self.ends.as_chunks_mut().0.iter_mut().zip(tiles) {
            self.crown.tile(tile.as_chunks().0, to);
        }
    }
}
