//! Taking a block of rows down a tree: together while many rows share a node, one by one where few are left.

use super::forest::{LEAF_CUT, Node};

/// A node with fewer rows than this is left to [`Walk::finish`].
const FEW: usize = 12;

/// The codes of a block of at most 65,536 rows, once by feature and once by row.
#[derive(Clone, Debug, Default)]
pub(super) struct Codes<C> {
    pub(super) by_feature: Vec<C>,
    pub(super) by_row: Vec<C>,
    pub(super) rows: usize,
    pub(super) width: usize,
}

impl<C: Copy + Default> Codes<C> {
    /// Makes room for `rows` rows of `width` codes.
    pub(super) fn resize(&mut self, rows: usize, width: usize) {
        (self.rows, self.width) = (rows, width);
        self.by_feature.resize(rows * width, C::default());
        self.by_row.resize(rows * width, C::default());
    }
}

/// Where the rows of a block stand in a tree; reused from tree to tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Walk {
    /// Rows, grouped by the node that they have reached.
    rows: Vec<u16>,
    spare: Vec<u16>,
    open: Vec<Group>,
    /// Rows that go on alone, and the node where each of them is.
    alone: Vec<(u32, u16)>,
    arrived: Vec<u16>,
    leaves: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Group {
    node: u32,
    start: usize,
    end: usize,
}

impl Walk {
    /// Takes all rows from `root` to their leaves and calls `found(rows, leaf)` for rows that share a leaf. Every row is
    /// found once.
    #[inline]
    pub(super) fn tree<C: Copy + Default + Into<u16>>(
        &mut self,
        nodes: &[Node],
        root: u32,
        codes: &Codes<C>,
        mut found: impl FnMut(&[u16], u32),
    ) {
        self.start(codes.rows, root);
        while let Some(Group { node: at, start, end }) = self.open.pop() {
            let Some(&node) = nodes.get(at as usize) else { continue };
            let Some(group) = self.rows.get_mut(start..end) else { continue };
            if node.cut == LEAF_CUT {
                found(group, node.left);
            } else if group.len() < FEW {
                self.alone.extend(group.iter().map(|&row| (at, row)));
            } else {
                let column = usize::from(node.feature).wrapping_mul(codes.rows);
                let column = codes.by_feature.get(column..column.wrapping_add(codes.rows)).unwrap_or_default();
                let middle = start.wrapping_add(partition(group, &mut self.spare, column, node.cut));
                if middle < end {
                    self.open.push(Group { node: node.left.wrapping_add(1), start: middle, end });
                }
                if start < middle {
                    self.open.push(Group { node: node.left, start, end: middle });
                }
            }
        }
        self.finish(nodes, codes, found);
    }

    fn start(&mut self, rows: usize, root: u32) {
        self.rows.clear();
        self.rows.extend((0..rows).map(|row| row as u16));
        self.spare.resize(rows, 0);
        self.leaves.resize(rows, 0);
        self.open.clear();
        self.open.push(Group { node: root, start: 0, end: rows });
        self.alone.clear();
    }

    /// Each pass takes every row that is still on its way one level down: the processor works on many at once.
    #[inline]
    fn finish<C: Copy + Default + Into<u16>>(
        &mut self,
        nodes: &[Node],
        codes: &Codes<C>,
        mut found: impl FnMut(&[u16], u32),
    ) {
        self.arrived.clear();
        self.arrived.extend(self.alone.iter().map(|step| step.1));
        let mut moving = self.alone.len();
        while moving > 0 {
            let mut kept = 0;
            for i in 0..moving {
                let Some(&(at, row)) = self.alone.get(i) else { break };
                let Some(&node) = nodes.get(at as usize) else { break };
                let place = usize::from(row).wrapping_mul(codes.width).wrapping_add(usize::from(node.feature));
                let code: u16 = codes.by_row.get(place).copied().unwrap_or_default().into();
                if let Some(leaf) = self.leaves.get_mut(usize::from(row)) {
                    *leaf = node.left;
                }
                if let Some(slot) = self.alone.get_mut(kept) {
                    *slot = (node.left.wrapping_add(u32::from(code > node.cut)), row);
                }
                kept = kept.wrapping_add(usize::from(node.cut != LEAF_CUT));
            }
            moving = kept;
        }
        for row in &self.arrived {
            found(std::slice::from_ref(row), self.leaves.get(usize::from(*row)).copied().unwrap_or_default());
        }
    }
}

/// Brings the rows whose code does not exceed `cut` to the front, in order, then the others; returns how many do not.
#[inline]
fn partition<C: Copy + Default + Into<u16>>(rows: &mut [u16], spare: &mut [u16], column: &[C], cut: u16) -> usize {
    let (mut left, mut right) = (0usize, 0usize);
    for i in 0..rows.len() {
        let row = rows[i];
        let code: u16 = column.get(usize::from(row)).copied().unwrap_or_default().into();
        if let Some(slot) = rows.get_mut(left) {
            *slot = row;
        }
        if let Some(slot) = spare.get_mut(right) {
            *slot = row;
        }
        left = left.wrapping_add(usize::from(code <= cut));
        right = right.wrapping_add(usize::from(code > cut));
    }
    if let (Some(back), Some(others)) = (rows.get_mut(left..), spare.get(..right)) {
        back.iter_mut().zip(others).for_each(|(slot, &row)| *slot = row);
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn partition_is_stable_and_loses_nothing() {
        let mut random = stream(3, 0);
        let column: Vec<u8> = (0..500).map(|_| (random.uniform() * 256.0) as u8).collect();
        let mut rows: Vec<u16> = (0..500).rev().collect();
        let before = rows.clone();
        let middle = partition(&mut rows, &mut [0; 500], &column, 100);
        let column = &column;
        let wanted = |right: bool| before.iter().copied().filter(move |&r| (column[r as usize] > 100) == right);
        assert_eq!(rows, wanted(false).chain(wanted(true)).collect::<Vec<_>>());
        assert_eq!(middle, wanted(false).count());
    }
}
