//! Links between adjacent regions, and their contraction when regions merge.

use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::{Looks, Monitor};

/// Two adjacent regions and the total cost of the edges between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::segmentation) struct Link {
    pub(in crate::segmentation) ends: [u32; 2],
    pub(in crate::segmentation) boundary: f64,
}

/// A numbered set of links.
pub(in crate::segmentation) trait Links: Sync {
    /// All of them with their numbers, ascending.
    fn numbered(&self) -> impl Iterator<Item = (u32, Link)>;
    /// The link of a number.
    fn get(&self, index: u32) -> Link;
}

impl Links for [Link] {
    fn numbered(&self) -> impl Iterator<Item = (u32, Link)> {
        (0u32..).zip(self.iter().copied())
    }

    fn get(&self, index: u32) -> Link {
        self[index as usize]
    }
}

/// How the cost of an edge follows from its weight.
#[derive(Clone, Copy, Debug)]
pub(in crate::segmentation) enum Cost {
    /// The same cost for every edge.
    Each(f64),
    /// A multiple of the edge's weight.
    Weight(f64),
}

/// The edges of a graph as links between its nodes, computed on demand and not stored.
#[derive(Clone, Copy, Debug)]
pub(in crate::segmentation) struct EdgeLinks<'a> {
    graph: &'a Graph,
    cost: Cost,
    /// If given: only edges inside these segments.
    within: Option<&'a [u32]>,
}

impl<'a> EdgeLinks<'a> {
    pub(in crate::segmentation) fn new(graph: &'a Graph, cost: Cost) -> Self {
        Self { graph, cost, within: None }
    }

    /// Each costs `strength` times its weight.
    pub(super) fn weighted(graph: &'a Graph, strength: f64) -> Self {
        Self::new(graph, Cost::Weight(strength))
    }

    /// Only those whose ends have the same segment.
    pub(super) fn inside(self, segments: &'a [u32]) -> Self {
        Self { within: Some(segments), ..self }
    }
}

impl Links for EdgeLinks<'_> {
    fn numbered(&self) -> impl Iterator<Item = (u32, Link)> {
        let kept = |ends: [u32; 2]| self.within.is_none_or(|of| of[ends[0] as usize] == of[ends[1] as usize]);
        let edges = (0u32..).zip(self.graph.edges());
        edges.filter(move |(_, ends)| kept(**ends)).map(|(index, _)| (index, self.get(index)))
    }

    fn get(&self, index: u32) -> Link {
        let boundary = match self.cost {
            Cost::Each(cost) => cost,
            Cost::Weight(cost) => cost * f64::from(self.graph.weights()[index as usize]),
        };
        Link { ends: self.graph.edges()[index as usize], boundary }
    }
}

/// Up to this many links are sorted by a single thread.
const ALONE: usize = 1 << 15;

/// Contracts links: those between the segments of a partition of the linked nodes, ascending by their ends; parallel
/// links become one, their costs added in the order of the links. O(links · log of the links of one segment); 8 bytes a
/// link beside the result.
///
/// # Errors
/// If the work was cancelled.
pub(in crate::segmentation) fn contract(
    links: &(impl Links + ?Sized),
    segment: &[u32],
    monitor: &Monitor,
) -> Result<Vec<Link>> {
    let mut looks = Looks::at(monitor);
    let renamed = || {
        links.numbered().filter_map(|(index, link)| {
            let [a, b] = link.ends.map(|end| segment[end as usize]);
            (a != b).then_some((a.min(b), a.max(b), index))
        })
    };
    // Rows of links, one for each smaller end s; row s ends at ends[s] once it is filled.
    let segments = segment.iter().max().map_or(0, |&last| last as usize + 1);
    let mut ends = vec![0usize; segments + 1];
    for (smaller, ..) in renamed() {
        looks.step()?;
        ends[smaller as usize + 1] += 1;
    }
    (0..segments).for_each(|s| ends[s + 1] += ends[s]);
    let mut rows = vec![0u64; ends[segments]];
    for (smaller, larger, index) in renamed() {
        looks.step()?;
        let slot = &mut ends[smaller as usize];
        rows[*slot] = u64::from(larger) << 32 | u64::from(index);
        *slot += 1;
    }
    ends.pop();
    sort_rows(&mut rows, &ends, 0, monitor)?;
    joined(links, SortedRows { rows: &rows, ends: &ends }, &mut looks)
}

/// Sorts each row; `rows` is a part of all rows that begins at `begin`.
fn sort_rows(rows: &mut [u64], ends: &[usize], begin: usize, monitor: &Monitor) -> Result<()> {
    monitor.check()?;
    if rows.len() > ALONE && ends.len() > 1 {
        let (low, high) = ends.split_at(ends.len() / 2);
        let cut = low.last().map_or(0, |end| end - begin);
        let (first, second) = rows.split_at_mut(cut);
        let (first, second) =
            rayon::join(|| sort_rows(first, low, begin, monitor), || sort_rows(second, high, begin + cut, monitor));
        return first.and(second);
    }
    let mut start = begin;
    for &end in ends {
        rows[start - begin..end - begin].sort_unstable();
        start = end;
    }
    Ok(())
}

/// Links by their smaller end: the larger end in the upper half of a number, the index of the link in the lower.
struct SortedRows<'a> {
    rows: &'a [u64],
    /// End of the row of each smaller end.
    ends: &'a [usize],
}

/// Merges parallel links of sorted rows.
fn joined(links: &(impl Links + ?Sized), sorted: SortedRows<'_>, looks: &mut Looks<'_>) -> Result<Vec<Link>> {
    let SortedRows { rows, ends } = sorted;
    let parallel = |a: &u64, b: &u64| a >> 32 == b >> 32;
    let (mut start, mut count) = (0, 0);
    for &end in ends {
        looks.steps(end - start)?;
        count += rows[start..end].chunk_by(parallel).count();
        start = end;
    }
    let mut joined = Vec::with_capacity(count);
    let mut start = 0;
    for (smaller, &end) in (0u32..).zip(ends) {
        looks.steps(end - start)?;
        for same in rows[start..end].chunk_by(parallel) {
            let larger = same.first().map_or(0, |row| (row >> 32) as u32);
            let boundary = same.iter().map(|row| links.get(*row as u32).boundary).reduce(|sum, b| sum + b);
            joined.push(Link { ends: [smaller, larger], boundary: boundary.unwrap_or(0.0) });
        }
        start = end;
    }
    Ok(joined)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use std::collections::BTreeMap;

    #[test]
    fn parallel_links_add_up_and_inner_ones_vanish() {
        let link = |a, b, boundary| Link { ends: [a, b], boundary };
        let links = [link(0, 1, 1.0), link(0, 2, 2.0), link(1, 3, 4.0), link(2, 3, 8.0)];
        let contracted = |links: &[Link], segment: &[u32]| contract(links, segment, &Monitor::default()).unwrap();
        assert_eq!(contracted(&links, &[1, 1, 0, 0]), [link(0, 1, 6.0)]);
        assert!(contracted(&links, &[0; 4]).is_empty() && contracted(&links[..0], &[]).is_empty());
    }

    #[test]
    fn many_links_become_those_of_a_map() {
        let mut random = stream(7, 0);
        let segment: Vec<u32> = (0..4000).map(|_| random.below(700) as u32).collect();
        let links: Vec<Link> = (0..100_000)
            .map(|_| Link { ends: [random.below(4000) as u32, random.below(4000) as u32], boundary: random.uniform() })
            .collect();
        let mut expected = BTreeMap::new();
        for link in &links {
            let [a, b] = link.ends.map(|end| segment[end as usize]);
            if a != b {
                *expected.entry([a.min(b), a.max(b)]).or_insert(0.0) += link.boundary;
            }
        }
        let expected: Vec<Link> = expected.into_iter().map(|(ends, boundary)| Link { ends, boundary }).collect();
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| contract(&links[..], &segment, &Monitor::default()).unwrap()) == expected);
        }
    }
}
