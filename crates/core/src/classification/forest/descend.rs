//! Descent of a block of rows through a tree of any size.

use crate::classification::nodes::{LEAF_CUT, Node};
use crate::classification::quantise::CodeBlock;

/// Levels that a row descends before the next row is processed, so that the processor works on several rows at once.
const LEVELS: usize = 4;

/// Current node of each row of a block; reused from tree to tree.
#[derive(Clone, Debug, Default)]
pub(in crate::classification) struct Walk {
    /// Node of every row.
    pub(in crate::classification) at: Vec<u32>,
    /// Rows that have not reached a leaf.
    moving: Vec<u16>,
}

impl Walk {
    /// Moves all rows of `codes.by_row` from `root` to their leaves, which `at` holds afterwards. A leaf has its own
    /// index in `left`.
    pub(in crate::classification) fn tree<C: Copy + Default + Into<u16>>(
        &mut self,
        nodes: &[Node],
        root: u32,
        codes: &CodeBlock<C>,
    ) {
        self.at.clear();
        self.at.resize(codes.rows, root);
        self.moving.clear();
        self.moving.extend((0..codes.rows).map(|row| row as u16));
        while !self.moving.is_empty() {
            let mut kept = 0usize;
            for i in 0..self.moving.len() {
                let Some(&row) = self.moving.get(i) else { break };
                let Some(at) = self.at.get_mut(usize::from(row)) else { break };
                let codes = codes.by_row.get(usize::from(row).wrapping_mul(codes.stride)..).unwrap_or_default();
                *at = descend(nodes, *at, codes);
                if let Some(slot) = self.moving.get_mut(kept) {
                    *slot = row;
                }
                let moves = nodes.get(*at as usize).is_some_and(|node| node.cut != LEAF_CUT);
                kept = kept.wrapping_add(usize::from(moves));
            }
            self.moving.truncate(kept);
        }
    }
}

#[inline(always)]
fn descend<C: Copy + Default + Into<u16>>(nodes: &[Node], mut at: u32, codes: &[C]) -> u32 {
    for _ in 0..LEVELS {
        let Some(&node) = nodes.get(at as usize) else { break };
        let code: u16 = codes.get(usize::from(node.feature)).copied().unwrap_or_default().into();
        at = node.left.wrapping_add(u32::from(code > node.cut));
    }
    at
}
