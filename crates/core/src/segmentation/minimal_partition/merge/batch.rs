//! One round of merging for large graphs: every region names its best partner, then the pairs merge.

use super::super::regions::{Link, Regions};
use crate::graph::Graph;
use crate::segmentation::connected::Sets;
use rayon::prelude::*;

/// Threads that share a round, at most: each reads all links.
const MOST_SHARES: usize = 8;

/// Links with numbers.
pub(in super::super) trait Links: Sync {
    /// All of them with their numbers, ascending.
    fn iter(&self) -> impl Iterator<Item = (u32, Link)> + Clone;
    /// The link of a number.
    fn get(&self, index: u32) -> Link;
}

impl Links for [Link] {
    fn iter(&self) -> impl Iterator<Item = (u32, Link)> + Clone {
        (0u32..).zip(self.iter().copied())
    }

    fn get(&self, index: u32) -> Link {
        self[index as usize]
    }
}

/// The edges of a graph as links that nobody has to hold.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct EdgeLinks<'a> {
    pub(in super::super) graph: &'a Graph,
    /// Cost of an edge of weight 1.
    pub(in super::super) strength: f64,
    /// Only edges inside these segments, if given.
    pub(in super::super) within: Option<&'a [u32]>,
}

impl Links for EdgeLinks<'_> {
    fn iter(&self) -> impl Iterator<Item = (u32, Link)> + Clone {
        let kept = |ends: [u32; 2]| self.within.is_none_or(|of| of[ends[0] as usize] == of[ends[1] as usize]);
        let edges = (0u32..).zip(self.graph.edges());
        edges.filter(move |(_, ends)| kept(**ends)).map(|(index, _)| (index, self.get(index)))
    }

    fn get(&self, index: u32) -> Link {
        let weight = f64::from(self.graph.weights()[index as usize]);
        Link { ends: self.graph.edges()[index as usize], boundary: self.strength * weight }
    }
}

/// Merges pairs in the order of gain where one is the other's best; nothing if no merger gains.
///
/// A region may take part several times: the gain is then recomputed with the current means and the boundary at the
/// beginning of the round, which can only have grown since. So every merger lowers the energy. O(m log m).
pub(super) fn merge_best_pairs(regions: &mut Regions, links: &(impl Links + ?Sized)) -> Option<Sets> {
    let chosen = best_links(regions, links);
    if chosen.is_empty() {
        return None;
    }
    let mut sets = Sets::new(regions.len());
    for (_, link) in chosen {
        let link = links.get(link);
        let ends = link.ends.map(|end| sets.root(end));
        if ends[0] != ends[1]
            && link.boundary > regions.loss(ends)
            && let Some((kept, gone)) = sets.unite(ends[0], ends[1])
        {
            regions.absorb(kept, gone);
        }
    }
    Some(sets)
}

/// Links of positive gain that are the best one of an end, by falling gain; ties by index.
fn best_links(regions: &Regions, links: &(impl Links + ?Sized)) -> Vec<(f64, u32)> {
    let mut best = vec![(0.0, u32::MAX); regions.len()];
    // Every thread looks at all links and keeps those of its own regions.
    let own = regions.len().div_ceil(rayon::current_num_threads().min(MOST_SHARES)).max(1);
    best.par_chunks_mut(own).enumerate().for_each(|(share, best)| {
        let first = (share * own) as u32;
        for (index, link) in links.iter() {
            let mut slots = link.ends.map(|end| end.wrapping_sub(first) as usize);
            slots.sort_unstable();
            if slots[0] >= best.len() {
                continue;
            }
            let gain = link.boundary - regions.loss(link.ends);
            for slot in slots {
                match best.get_mut(slot) {
                    Some(slot) if gain > slot.0 => *slot = (gain, index),
                    _ => {}
                }
            }
        }
    });
    best.retain(|&(_, link)| link != u32::MAX);
    best.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    best.dedup_by_key(|&mut (_, link)| link);
    best
}
