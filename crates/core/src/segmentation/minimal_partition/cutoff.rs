//! Merges segments that are too small into their best neighbour.

use super::links::{EdgeLinks, Link, contract};
use super::regions::{Objective, Regions, compact, renumber};
use crate::error::Result;
use crate::graph::UnionFind;
use crate::parallel::{Looks, Monitor};
use crate::segmentation::Partition;

/// Largest number of passes, as in the reference implementation; chains of small segments need several.
const PASSES: usize = 50;

/// Merges every segment whose weight is below `cutoff` into the neighbour of largest gain, even if the gain is
/// negative; segments without neighbours stay. At most 50 passes of O(m log m).
pub(super) fn absorb_small(
    objective: Objective<'_>,
    partition: Partition,
    cutoff: f64,
    monitor: &Monitor,
) -> Result<Partition> {
    let Objective { signal, graph, strength } = objective;
    let mut regions = Regions::of_segments(signal, &partition, monitor)?;
    if (0..regions.len() as u32).all(|region| regions.weight(region) >= cutoff) {
        return Ok(partition);
    }
    let mut segment = partition.segments().to_vec();
    // With an infinite strength only edges of weight 0 are left between segments, and their cost is 0.
    let strength = if strength.is_finite() { strength } else { 0.0 };
    let mut links = contract(&EdgeLinks::weighted(graph, strength), &segment, monitor)?;
    for _ in 0..PASSES {
        let Some(sets) = absorb_once(&mut regions, &links, cutoff, monitor)? else { break };
        let (number, left) = compact(&regions, sets, monitor)?;
        renumber(&mut segment, &number, monitor)?;
        links = contract(&links[..], &number, monitor)?;
        regions = left;
    }
    Partition::from_labels_watched(&segment, monitor)
}

fn absorb_once(regions: &mut Regions, links: &[Link], cutoff: f64, monitor: &Monitor) -> Result<Option<UnionFind>> {
    let mut looks = Looks::at(monitor);
    let mut best: Vec<Option<(f64, u32)>> = vec![None; regions.len()];
    for link in links {
        looks.step()?;
        let gain = link.boundary - regions.loss(link.ends);
        for (end, other) in [(link.ends[0], link.ends[1]), (link.ends[1], link.ends[0])] {
            let slot = &mut best[end as usize];
            if regions.weight(end) < cutoff && slot.is_none_or(|(most, _)| gain > most) {
                *slot = Some((gain, other));
            }
        }
    }
    let mut sets = UnionFind::new(regions.len());
    let mut any = false;
    for (region, choice) in (0u32..).zip(best) {
        looks.step()?;
        let Some((_, other)) = choice else { continue };
        let root = sets.root(region);
        // A region that has grown enough in this pass is not merged any further.
        if regions.weight(root) < cutoff
            && let Some((kept, gone)) = sets.unite(region, other)
        {
            regions.absorb(kept, gone);
            any = true;
        }
    }
    Ok(any.then_some(sets))
}

#[cfg(test)]
mod tests {
    use super::super::Signal;
    use super::*;
    use crate::graph::Graph;

    #[test]
    fn small_segments_join_the_neighbour_most_like_them() {
        let values = [0.0, 0.0, 0.0, 0.4, 1.0, 1.0, 1.0, 9.0];
        let signal = Signal::new(&values, 1).unwrap();
        let graph = Graph::new(8, &[[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [5, 6]], &[1.0; 6]).unwrap();
        let partition = Partition::from_labels(&[0, 0, 0, 1, 2, 2, 2, 3]).unwrap();
        let objective = Objective { signal: &signal, graph: &graph, strength: 1.0 };
        let kept = absorb_small(objective, partition.clone(), 1.0, &Monitor::default()).unwrap();
        assert_eq!(kept, partition);
        let joined = absorb_small(objective, partition.clone(), 2.0, &Monitor::default()).unwrap();
        assert_eq!(joined.segments(), [0, 0, 0, 0, 1, 1, 1, 2], "the lonely node has nobody to join");
        let all = absorb_small(objective, partition.clone(), 5.0, &Monitor::default()).unwrap();
        assert_eq!(all.segments(), [0, 0, 0, 0, 0, 0, 0, 1]);
    }
}
