//! One pass of merging for large graphs: every region selects its best partner, then the pairs merge.

use super::super::links::Links;
use super::super::regions::Regions;
use crate::error::Result;
use crate::graph::UnionFind;
use crate::parallel::{Looks, Monitor, sort_watched_by};
use rayon::prelude::*;

/// Most threads that share a pass: each of them reads all links.
const MOST_SHARES: usize = 8;

/// Merges pairs in the order of gain, if one is the best partner of the other; `None` if no merge has a positive gain.
///
/// A region may merge several times in a pass: the gain is then recomputed with the current means and the boundary at
/// the beginning of the pass, which can only have grown since. So every merge lowers the energy. O(m log m).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn merge_best_pairs(
    regions: &mut Regions,
    links: &(impl Links + ?Sized),
    monitor: &Monitor,
) -> Result<Option<UnionFind>> {
    let chosen = best_links(regions, links, monitor)?;
    if chosen.is_empty() {
        return Ok(None);
    }
    let mut looks = Looks::at(monitor);
    let mut sets = UnionFind::new(regions.len());
    for (_, link) in chosen {
        looks.step()?;
        let link = links.get(link);
        let ends = link.ends.map(|end| sets.root(end));
        if ends[0] != ends[1]
            && link.boundary > regions.loss(ends)
            && let Some((kept, gone)) = sets.unite(ends[0], ends[1])
        {
            regions.absorb(kept, gone);
        }
    }
    Ok(Some(sets))
}

/// Links of positive gain that are the best link of at least one end, by falling gain; ties by index.
fn best_links(regions: &Regions, links: &(impl Links + ?Sized), monitor: &Monitor) -> Result<Vec<(f64, u32)>> {
    let mut best = vec![(0.0, u32::MAX); regions.len()];
    // Every thread reads all links and keeps those of its own regions.
    let own = regions.len().div_ceil(rayon::current_num_threads().min(MOST_SHARES)).max(1);
    best.par_chunks_mut(own).enumerate().try_for_each(|(share, best)| {
        let first = (share * own) as u32;
        let mut looks = Looks::at(monitor);
        for (index, link) in links.numbered() {
            looks.step()?;
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
        Ok(())
    })?;
    best.retain(|&(_, link)| link != u32::MAX);
    sort_watched_by(&mut best, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)), monitor)?;
    best.dedup_by_key(|&mut (_, link)| link);
    Ok(best)
}
