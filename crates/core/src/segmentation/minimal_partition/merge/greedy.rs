//! The pair of largest gain merges first: a priority queue in which outdated pairs are skipped.

use super::super::links::Link;
use super::super::regions::Regions;
use crate::error::Result;
use crate::graph::UnionFind;
use crate::parallel::Monitor;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A candidate pair; outdated once one of its ends has changed.
#[derive(PartialEq)]
struct Candidate {
    gain: f64,
    ends: [u32; 2],
    ages: [u32; 2],
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.gain.total_cmp(&other.gain).then_with(|| other.ends.cmp(&self.ends)).then(self.ages.cmp(&other.ages))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

struct Queue<'a> {
    regions: &'a mut Regions,
    sets: UnionFind,
    heap: BinaryHeap<Candidate>,
    /// Neighbours of each region with the cost of the boundary; entries may name regions that have been absorbed since.
    neighbours: Vec<Vec<(u32, f64)>>,
    /// How often each region has grown; `u32::MAX` once it is absorbed.
    ages: Vec<u32>,
    /// Place of a neighbour in the list under construction.
    place: Vec<u32>,
}

/// Merges the pair of largest gain until no merge has a positive gain. O(merges · degree · log m).
pub(super) fn merge_largest_gain_first(regions: &mut Regions, links: &[Link], monitor: &Monitor) -> Result<UnionFind> {
    let count = regions.len();
    let mut queue = Queue {
        regions,
        sets: UnionFind::new(count),
        heap: BinaryHeap::new(),
        neighbours: vec![Vec::new(); count],
        ages: vec![0; count],
        place: vec![u32::MAX; count],
    };
    for &Link { ends, boundary } in links {
        queue.neighbours[ends[0] as usize].push((ends[1], boundary));
        queue.neighbours[ends[1] as usize].push((ends[0], boundary));
        queue.offer(ends, boundary);
    }
    let mut steps = 0u32;
    while let Some(Candidate { ends, ages, .. }) = queue.heap.pop() {
        steps = steps.wrapping_add(1);
        if steps.is_multiple_of(256) {
            monitor.check()?;
        }
        if ends.map(|end| queue.ages[end as usize]) == ages {
            queue.merge(ends);
        }
    }
    Ok(queue.sets)
}

impl Queue<'_> {
    fn offer(&mut self, ends: [u32; 2], boundary: f64) {
        let gain = boundary - self.regions.loss(ends);
        if gain > 0.0 {
            let ages = ends.map(|end| self.ages[end as usize]);
            self.heap.push(Candidate { gain, ends, ages });
        }
    }

    fn merge(&mut self, ends: [u32; 2]) {
        let Some((kept, gone)) = self.sets.unite(ends[0], ends[1]) else { return };
        self.regions.absorb(kept, gone);
        self.ages[kept as usize] += 1;
        self.ages[gone as usize] = u32::MAX;
        let around = self.joined_neighbours(kept, gone);
        for &(other, boundary) in &around {
            self.offer([kept.min(other), kept.max(other)], boundary);
        }
        self.neighbours[kept as usize] = around;
    }

    /// The neighbours of both regions under their current numbers, each once with the sum of boundaries.
    fn joined_neighbours(&mut self, kept: u32, gone: u32) -> Vec<(u32, f64)> {
        let lists = [kept, gone].map(|region| std::mem::take(&mut self.neighbours[region as usize]));
        let mut joined: Vec<(u32, f64)> = Vec::with_capacity(lists[0].len() + lists[1].len());
        for &(name, boundary) in lists.iter().flatten() {
            let other = self.sets.root(name);
            if other == kept {
                continue;
            }
            let place = &mut self.place[other as usize];
            if let Some(entry) = joined.get_mut(*place as usize) {
                entry.1 += boundary;
            } else {
                *place = joined.len() as u32;
                joined.push((other, boundary));
            }
        }
        joined.iter().for_each(|&(other, _)| self.place[other as usize] = u32::MAX);
        joined
    }
}
