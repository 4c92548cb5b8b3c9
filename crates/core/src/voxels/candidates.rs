//! The points of some cells and of the ring around them: the candidates of a batch of queries.

use super::blocks::Blocks;
use super::level::Level;

/// The candidates of a batch, and their cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    cells: Option<[[u32; 3]; 2]>,
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    pub(super) z: Vec<f32>,
    pub(super) index: Vec<u32>,
    blocks: Vec<u32>,
}

impl Candidates {
    pub(super) fn reset(&mut self) {
        self.cells = None;
    }

    /// Gathers the points of the cells `low..=high` and of the ring around them, in ascending order.
    #[inline(never)]
    pub(super) fn gather(&mut self, level: &Level, [low, high]: [[u32; 3]; 2]) {
        if self.cells == Some([low, high]) {
            return;
        }
        self.cells = Some([low, high]);
        let (low, high) = (low.map(|c| c.saturating_sub(1)), high.map(|c| c + 1));
        self.blocks.clear();
        level.blocks.find_all(low.map(|c| c >> 2), high.map(|c| c >> 2), &mut self.blocks);
        [&mut self.x, &mut self.y, &mut self.z].into_iter().for_each(Vec::clear);
        self.index.clear();
        for &block in &self.blocks {
            level.blocks.cells_within(block, low, high, |range| {
                self.x.extend_from_slice(&level.x[range.clone()]);
                self.y.extend_from_slice(&level.y[range.clone()]);
                self.z.extend_from_slice(&level.z[range.clone()]);
                self.index.extend(range.start as u32..range.end as u32);
            });
        }
    }
}

impl Blocks {
    /// Occupied blocks with indices `low..=high` on each axis, ascending.
    fn find_all(&self, low: [u32; 3], high: [u32; 3], found: &mut Vec<u32>) {
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                found.extend((low[0]..=high[0]).filter_map(|x| self.find_at([x, y, z])));
            }
        }
        found.sort_unstable();
    }
}
