//! The leaves of a k-d tree that can matter to the queries of one leaf.

use super::knn_tree::{LEAF, Node};

/// Leaves that matter to a leaf's queries: first point and count, and boxes axis by axis, padded to whole lanes.
#[derive(Clone, Debug, Default)]
pub(super) struct List {
    /// First point and number of points.
    pub(super) ranges: Vec<[u32; 2]>,
    low: [Vec<f32>; 3],
    high: [Vec<f32>; 3],
}

impl List {
    pub(super) fn clear(&mut self) {
        self.ranges.clear();
        self.low.iter_mut().chain(&mut self.high).for_each(Vec::clear);
    }

    #[inline(always)]
    pub(super) fn push(&mut self, leaf: &Node) {
        self.ranges.push([leaf.first, leaf.count]);
        for a in 0..3 {
            self.low[a].push(leaf.low[a]);
            self.high[a].push(leaf.high[a]);
        }
    }

    /// Fills up to whole lanes with boxes that nothing is within.
    #[inline(always)]
    pub(super) fn pad(&mut self) {
        let full = self.ranges.len().next_multiple_of(LEAF);
        self.low.iter_mut().for_each(|axis| axis.resize(full, f32::INFINITY));
        self.high.iter_mut().for_each(|axis| axis.resize(full, f32::INFINITY));
    }

    /// Appends which leaves lie within the limit of a place.
    #[inline(always)]
    pub(super) fn within(&self, at: [f32; 3], limit: f32, found: &mut Vec<u32>) {
        found.resize(self.low[0].len() + LEAF, 0);
        let mut kept = 0usize;
        for start in (0..self.low[0].len()).step_by(LEAF) {
            let mut bound = [0.0f32; LEAF];
            for ((low, high), at) in self.low.iter().zip(&self.high).zip(at) {
                let boxes = low[start..start + LEAF].iter().zip(&high[start..start + LEAF]);
                for (bound, (low, high)) in bound.iter_mut().zip(boxes) {
                    let apart = (low - at).max(at - high).max(0.0);
                    *bound += apart * apart;
                }
            }
            for (l, &b) in bound.iter().enumerate() {
                found[kept] = (start + l) as u32;
                kept = kept.wrapping_add(usize::from(b <= limit));
            }
        }
        found.truncate(kept);
    }
}
