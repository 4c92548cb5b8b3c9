//! Occupied cells of a sparse grid, and the points in them.
//!
//! Cells are stored in blocks of 4 x 4 x 4: one bit a cell in a 64-bit word, in Morton order, and the number of occupied
//! cells before the block. Blocks are found by a hash table with open addressing.

use super::morton;
use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// Occupied cells of a grid over points in Morton order.
#[derive(Clone, Debug, Default)]
pub(super) struct Blocks {
    keys: Vec<u64>,
    masks: Vec<u64>,
    /// Number of occupied cells before each block.
    first: Vec<u32>,
    /// First point of each occupied cell; one more entry than cells.
    starts: Vec<u32>,
    table: Vec<u32>,
}

/// In place of a block: none.
pub(super) const NONE: u32 = u32::MAX;
/// Mask of the cells of a block whose index on that axis is 0.
const SLAB: [u64; 3] = [0x0055_0055_0055_0055, 0x0000_3333_0000_3333, 0x0f0f_0f0f];

impl Blocks {
    /// Cells are `codes >> (3 * shift)`; codes ascend.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn new(codes: &[u64], shift: u32, monitor: &Monitor) -> Result<Self> {
        let mut blocks = Self::default();
        let mut last = u64::MAX;
        for piece in watched(codes.len(), monitor) {
            for i in piece? {
                let cell = codes[i] >> (3 * shift);
                if cell == last {
                    continue;
                }
                last = cell;
                if blocks.keys.last() != Some(&(cell >> 6)) {
                    blocks.keys.push(cell >> 6);
                    blocks.masks.push(0);
                    blocks.first.push(blocks.starts.len() as u32);
                }
                if let Some(mask) = blocks.masks.last_mut() {
                    *mask |= 1 << (cell & 63);
                }
                blocks.starts.push(i as u32);
            }
        }
        blocks.starts.push(codes.len() as u32);
        blocks.index(monitor)?;
        Ok(blocks)
    }

    fn index(&mut self, monitor: &Monitor) -> Result<()> {
        let size = (2 * self.keys.len()).next_power_of_two().max(2);
        self.table = vec![NONE; size];
        for piece in watched(self.keys.len(), monitor) {
            for b in piece? {
                let mut slot = hash(self.keys[b]) & (size - 1);
                while self.table[slot] != NONE {
                    slot = (slot + 1) & (size - 1);
                }
                self.table[slot] = b as u32;
            }
        }
        Ok(())
    }

    /// Groups of 8 x 8 x 8 blocks: Morton key of the group and range of its blocks.
    pub(super) fn groups(&self) -> impl Iterator<Item = (u64, std::ops::Range<usize>)> {
        let mut first = 0;
        self.keys.chunk_by(|a, b| a >> 9 == b >> 9).map(move |keys| {
            let range = first..first + keys.len();
            first = range.end;
            (keys[0] >> 9, range)
        })
    }

    /// Morton key of a block (the code of its cells without the last 6 bits).
    pub(super) fn key(&self, block: usize) -> u64 {
        self.keys[block]
    }

    /// The points of a block.
    pub(super) fn points(&self, block: usize) -> std::ops::Range<usize> {
        let end = self.first.get(block + 1).map_or(self.starts.len() - 1, |&f| f as usize);
        self.starts[self.first[block] as usize] as usize..self.starts[end] as usize
    }

    /// The block with that key.
    pub(super) fn find(&self, key: u64) -> Option<u32> {
        let mask = self.table.len() - 1;
        let mut slot = hash(key) & mask;
        loop {
            match self.table[slot] {
                NONE => return None,
                b if self.keys[b as usize] == key => return Some(b),
                _ => slot = (slot + 1) & mask,
            }
        }
    }

    /// The block with these indices.
    pub(super) fn find_at(&self, block: [u32; 3]) -> Option<u32> {
        if block.iter().all(|&b| b < morton::LIMIT) { self.find(morton::encode(block)) } else { None }
    }

    /// The points of the occupied cells of a block that are in `low..=high` on every axis, ascending; those of cells that
    /// follow each other together.
    #[inline(always)]
    pub(super) fn cells_within(
        &self,
        block: u32,
        low: [u32; 3],
        high: [u32; 3],
        mut visit: impl FnMut(std::ops::Range<usize>),
    ) {
        let corner = morton::decode(self.keys[block as usize]).map(|c| c << 2);
        let mask = self.masks[block as usize];
        let mut wanted = (0..3).fold(mask, |bits, a| {
            let slabs = (0..4u32).filter(|i| (low[a]..=high[a]).contains(&(corner[a] + i)));
            bits & slabs.fold(0, |sum, i| sum | SLAB[a] << ((i & 1) * (1 << a)) << ((i >> 1) * (8 << a)))
        });
        let mut run = 0..0;
        while wanted != 0 {
            let bit = wanted.trailing_zeros();
            wanted &= wanted - 1;
            let rank = (self.first[block as usize] + (mask & ((1u64 << bit) - 1)).count_ones()) as usize;
            let [start, end] = [self.starts[rank], self.starts[rank + 1]].map(|start| start as usize);
            if start != run.end {
                visit(run);
                run = start..start;
            }
            run.end = end;
        }
        visit(run);
    }

    /// The points of the cell with Morton index `bit` within a block; an empty range if it is not occupied.
    #[inline(always)]
    pub(super) fn cell(&self, block: u32, bit: u32) -> std::ops::Range<usize> {
        let mask = self.masks[block as usize];
        if mask >> bit & 1 == 0 {
            return 0..0;
        }
        let rank = self.first[block as usize] + (mask & ((1u64 << bit) - 1)).count_ones();
        self.starts[rank as usize] as usize..self.starts[rank as usize + 1] as usize
    }
}

fn hash(key: u64) -> usize {
    (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize
}

/// The 27 blocks around a block, looked up once for all its queries.
#[derive(Clone, Debug)]
pub(super) struct Around {
    centre: [u32; 3],
    blocks: [u32; 27],
}

impl Default for Around {
    fn default() -> Self {
        Self { centre: [u32::MAX; 3], blocks: [NONE; 27] }
    }
}

impl Around {
    /// Moves to the block that holds `cell`.
    #[inline(always)]
    pub(super) fn move_to(&mut self, blocks: &Blocks, cell: [u32; 3]) {
        let centre = cell.map(|c| c >> 2);
        if centre == self.centre {
            return;
        }
        self.centre = centre;
        for (i, slot) in self.blocks.iter_mut().enumerate() {
            let offset = [i % 3, i / 3 % 3, i / 9];
            let key = [0, 1, 2].map(|a| (centre[a] + offset[a] as u32).wrapping_sub(1));
            let inside = key.iter().all(|&k| k < morton::LIMIT);
            *slot = if inside { blocks.find(morton::encode(key)).unwrap_or(NONE) } else { NONE };
        }
    }

    /// The points of a cell at most 4 cells away from the current block. Indices outside the grid wrap around and find
    /// nothing.
    #[inline(always)]
    pub(super) fn cell(&self, blocks: &Blocks, cell: [u32; 3]) -> std::ops::Range<usize> {
        let offset = [0, 1, 2].map(|a| (cell[a] >> 2).wrapping_add(1).wrapping_sub(self.centre[a]));
        if offset.iter().any(|&o| o > 2) {
            return 0..0;
        }
        match self.blocks[(offset[0] + 3 * offset[1] + 9 * offset[2]) as usize] {
            NONE => 0..0,
            block => blocks.cell(block, (morton::encode(cell.map(|c| c & 3))) as u32),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_gives_back_its_points() {
        let mut codes: Vec<u64> = (0..4000u64).map(|i| i.wrapping_mul(2_654_435_761) % 30_000).collect();
        codes.sort_unstable();
        for shift in 0..3 {
            let blocks = Blocks::new(&codes, shift, &Monitor::default()).unwrap();
            let mut around = Around::default();
            for cell in (0..30_000u64).map(|c| c >> (3 * shift)) {
                let expected = codes.partition_point(|c| c >> (3 * shift) < cell)
                    ..codes.partition_point(|c| c >> (3 * shift) <= cell);
                around.move_to(&blocks, morton::decode(cell));
                let found = around.cell(&blocks, morton::decode(cell));
                assert!(found == expected || (found.is_empty() && expected.is_empty()), "{cell} {shift}");
            }
        }
    }

    #[test]
    fn blocks_hold_all_points_once() {
        let codes: Vec<u64> = (0..1000).map(|i| i * 17).collect();
        let blocks = Blocks::new(&codes, 1, &Monitor::default()).unwrap();
        let all: Vec<usize> = blocks.groups().flat_map(|(_, group)| group).flat_map(|b| blocks.points(b)).collect();
        assert_eq!(all, (0..1000).collect::<Vec<_>>());
        assert!(blocks.find(u64::MAX).is_none());
    }
}
