//! One round of merging for large graphs: every region names its best partner, then the pairs merge.

use super::super::links::Links;
use super::super::regions::Regions;
use crate::segmentation::connected::Sets;
use rayon::prelude::*;

/// Threads that share a round, at most: each reads all links.
const MOST_SHARES: usize = 8;

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
        for (index, link) in links.numbered() {
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
