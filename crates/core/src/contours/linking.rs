//! Candidates of contours: shortest paths between neighbouring seeds.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.5.1. The paths are
//! found by the algorithm of E. W. Dijkstra, *A note on two problems in connexion with graphs*, Numerische Mathematik
//! 1, 1959.

use super::params::LinkParams;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::graph::Graph;
use crate::neighbours::knn;
use crate::parallel::{Monitor, concat_watched, map_ordered_with, map_watched, sort_watched, watched};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Seeds that one task links.
const SEEDS: usize = 64;

/// Distance from a seed over which the direction is taken in which a path leaves it, metres.
const AWAY: f64 = 0.1;

/// A candidate of a contour: the shortest path between two seeds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidate {
    /// Node of the seed at the start.
    pub start: u32,
    /// Node of the seed at the end, above `start`.
    pub end: u32,
    /// The nodes from the start to the end, both included.
    pub path: Vec<u32>,
    /// Sum of the costs of the path's edges.
    pub cost: f64,
    /// Directions in which the path leaves the start and the end, unit vectors; zeros if all nodes are at one position.
    pub leaves: [[f32; 3]; 2],
}

/// The neighbourhood graph and the positions of its nodes.
#[derive(Clone, Copy, Debug)]
pub struct Neighbourhood<'a> {
    /// Position of each node, metres.
    pub positions: &'a Positions,
    /// Edges with their costs, not negative.
    pub graph: &'a Graph,
}

/// Links every seed with its nearest seeds, ascending by (start, end).
///
/// Each seed is linked with at most `count` seeds within `radius`, each pair once, from the smaller node on. Its path
/// is a shortest one among the nodes within `2 · radius` of the start; pairs without such a path give no candidate. O(s
/// (b log b)) for s seeds and b nodes in a ball. Memory 4 bytes a node and O(b) for each thread, 32 bytes an edge, and the
/// result, which holds 4 bytes for each node of each path and 80 for each candidate: with the default parameters about 200
/// bytes a candidate, of which a seed has about eight.
///
/// # Errors
/// If seeds are not ascending nodes, there is not one position a node, a parameter is outside its range, or the work
/// was cancelled.
pub fn link(of: &Neighbourhood<'_>, seeds: &[u32], params: &LinkParams, monitor: &Monitor) -> Result<Vec<Candidate>> {
    params.validate()?;
    let nodes = of.graph.len();
    if of.positions.len() != nodes {
        return Err(Error::input(format!("{} positions for {nodes} nodes", of.positions.len())));
    }
    if seeds.windows(2).any(|w| w[0] >= w[1]) || seeds.last().is_some_and(|&last| last as usize >= nodes) {
        return Err(Error::input(format!("seeds are not ascending numbers of the {nodes} nodes")));
    }
    let pairs = pairs(of.positions, seeds, params, monitor)?;
    let starts: Vec<&[[u32; 2]]> = pairs.chunk_by(|a, b| a[0] == b[0]).collect();
    let search = Search { of, steps: &Steps::new(of.graph, monitor)?, limit: 4.0 * params.radius * params.radius };
    monitor.stage("links", starts.len() as u64);
    let count = starts.len().div_ceil(SEEDS);
    let parts = map_ordered_with(0..count, monitor, Scratch::default, |scratch, block| {
        let mut found = Vec::new();
        for links in &starts[block * SEEDS..starts.len().min((block + 1) * SEEDS)] {
            monitor.check()?;
            search.links(scratch, links, &mut found);
        }
        monitor.advance(SEEDS as u64);
        Ok(found)
    })?;
    concat_watched(parts, monitor)
}

/// The pairs of seeds (as nodes) that are linked, the smaller one first, ascending.
fn pairs(positions: &Positions, seeds: &[u32], params: &LinkParams, monitor: &Monitor) -> Result<Vec<[u32; 2]>> {
    let near = knn(&positions.select(seeds, monitor)?, params.count, monitor)?;
    let limit = (params.radius * params.radius) as f32;
    let mut pairs = Vec::new();
    for piece in watched(near.len(), monitor) {
        for i in piece? {
            let row = near.of(i).iter().zip(near.squared_distances(i));
            let close = row.take_while(|(_, squared)| **squared <= limit).map(|(&j, _)| j as usize);
            pairs.extend(close.map(|j| [seeds[i.min(j)], seeds[i.max(j)]]));
        }
    }
    sort_watched(&mut pairs, monitor)?;
    pairs.dedup();
    Ok(pairs)
}

/// The edges of each node with their costs, side by side in memory.
#[derive(Debug, Default)]
struct Steps {
    /// Where the edges of each node begin; one more than there are nodes.
    offsets: Vec<usize>,
    steps: Vec<Step>,
}

/// An edge from a node to another.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    to: u32,
    cost: f32,
}

impl Steps {
    fn new(graph: &Graph, monitor: &Monitor) -> Result<Self> {
        let adjacency = graph.adjacency_watched(monitor)?;
        let step =
            |at: usize| Step { to: adjacency.neighbours[at], cost: graph.weights()[adjacency.edges[at] as usize] };
        let steps = map_watched(adjacency.neighbours.len(), monitor, step)?;
        Ok(Self { steps, offsets: adjacency.into_inner().offsets })
    }

    fn of(&self, node: u32) -> &[Step] {
        &self.steps[self.offsets[node as usize]..self.offsets[node as usize + 1]]
    }
}

/// The number of a node that a search has not reached.
const UNKNOWN: u32 = u32::MAX;

/// The number of a node whose path is found.
const SETTLED: u32 = u32::MAX - 1;

/// What is known of a node that a search has reached, or looks for.
#[derive(Clone, Copy, Debug)]
struct Reached {
    cost: f64,
    node: u32,
    /// Number of the reached node before it; that of the start is its own.
    before: u32,
    settled: bool,
    /// Whether a path to it is wanted.
    end: bool,
}

#[derive(Debug, Default)]
struct Scratch {
    /// Number of each node among those reached, [`UNKNOWN`] or [`SETTLED`].
    number: Vec<u32>,
    reached: Vec<Reached>,
    /// Reached nodes by their costs, see [`key`]; a node is queued again when its cost falls.
    queue: BinaryHeap<Reverse<u64>>,
}

impl Scratch {
    /// Forgets the last search.
    fn clear(&mut self, nodes: usize) {
        // Once a thread.
        self.number.resize(nodes, UNKNOWN);
        for at in self.reached.drain(..) {
            self.number[at.node as usize] = UNKNOWN;
        }
        self.queue.clear();
    }

    /// Adds a node that no path is known to; returns its number.
    fn add(&mut self, node: u32, end: bool) -> u32 {
        let number = self.reached.len() as u32;
        self.number[node as usize] = number;
        self.reached.push(Reached { node, before: number, cost: f64::INFINITY, settled: false, end });
        number
    }
}

/// A cost, which is not negative, and the number of a reached node in one word that sorts like the cost: its bits without the
/// sign, the last of which give way to the number. With a million nodes, costs that differ by less than 1e-10 of themselves
/// sort like the numbers.
fn key(cost: f64, number: u32, mask: u64) -> u64 {
    (cost.to_bits() << 1) & !mask | u64::from(number)
}

struct Search<'a> {
    of: &'a Neighbourhood<'a>,
    steps: &'a Steps,
    /// Square of the ball's radius.
    limit: f64,
}

impl Search<'_> {
    /// Appends the candidates of some pairs of one start, in their order.
    fn links(&self, scratch: &mut Scratch, links: &[[u32; 2]], found: &mut Vec<Candidate>) {
        let Some(&[start, _]) = links.first() else { return };
        self.run(scratch, links, start);
        for (link, &[_, end]) in links.iter().enumerate() {
            let mut at = scratch.reached[link + 1];
            if !at.settled {
                continue;
            }
            let (mut path, cost) = (vec![end], at.cost);
            while at.node != start {
                at = scratch.reached[at.before as usize];
                path.push(at.node);
            }
            path.reverse();
            let leaves = self.leaves(&path);
            found.push(Candidate { start, end, path, cost, leaves });
        }
    }

    /// Settles nodes in the order of their costs until all ends are settled or the ball is. The start has number 0, the ends
    /// follow in their order.
    fn run(&self, scratch: &mut Scratch, links: &[[u32; 2]], start: u32) {
        scratch.clear(self.of.graph.len());
        let centre = self.of.positions.xyz(start as usize);
        let first = scratch.add(start, false);
        links.iter().for_each(|&[_, end]| _ = scratch.add(end, true));
        scratch.reached[first as usize].cost = 0.0;
        // No more nodes are reached than there are.
        let mask = (self.of.graph.len() as u64 + 1).next_power_of_two() - 1;
        scratch.queue.push(Reverse(key(0.0, first, mask)));
        let mut missing = links.len();
        while let Some(Reverse(next)) = scratch.queue.pop() {
            let number = (next & mask) as u32;
            let at = &mut scratch.reached[number as usize];
            if std::mem::replace(&mut at.settled, true) {
                continue;
            }
            let Reached { node, cost: so_far, end, .. } = *at;
            scratch.number[node as usize] = SETTLED;
            missing -= usize::from(end);
            if missing == 0 {
                return;
            }
            for &Step { to, cost } in self.steps.of(node) {
                let known = match scratch.number[to as usize] {
                    SETTLED => continue,
                    UNKNOWN if self.apart(centre, to) > self.limit => continue,
                    UNKNOWN => scratch.add(to, false),
                    known => known,
                };
                let cost = so_far + f64::from(cost);
                let at = &mut scratch.reached[known as usize];
                if cost < at.cost {
                    (at.cost, at.before) = (cost, number);
                    scratch.queue.push(Reverse(key(cost, known, mask)));
                }
            }
        }
    }

    /// Directions from both ends of a path to its first nodes that are [`AWAY`] or more from them, else to the other end.
    fn leaves(&self, path: &[u32]) -> [[f32; 3]; 2] {
        let place = |node: u32| self.of.positions.xyz(node as usize);
        let from = |end: u32, others: &mut dyn Iterator<Item = u32>| {
            let at = place(end);
            let mut to = at;
            for node in others {
                to = place(node);
                if self.apart(at, node) >= AWAY * AWAY {
                    break;
                }
            }
            let way: [f64; 3] = std::array::from_fn(|axis| f64::from(to[axis]) - f64::from(at[axis]));
            let length = way.iter().map(|c| c * c).sum::<f64>().sqrt();
            if length > 0.0 { way.map(|c| (c / length) as f32) } else { [0.0; 3] }
        };
        let [Some(&start), Some(&end)] = [path.first(), path.last()] else { return [[0.0; 3]; 2] };
        [from(start, &mut path.iter().copied()), from(end, &mut path.iter().rev().copied())]
    }

    /// Squared distance of a node from a position.
    fn apart(&self, from: [f32; 3], node: u32) -> f64 {
        let to = self.of.positions.xyz(node as usize);
        from.iter().zip(to).map(|(a, b)| (f64::from(*a) - f64::from(b)).powi(2)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    struct Case {
        positions: Positions,
        graph: Graph,
    }

    fn random(seed: u64) -> Case {
        let mut random = stream(seed, 4);
        let rows: Vec<[f32; 3]> = (0..60).map(|_| [0.0; 3].map(|_: f32| random.uniform() as f32 * 2.0)).collect();
        let pairs: Vec<[u32; 2]> =
            (0..150).map(|_| [random.below(60) as u32, random.below(60) as u32]).filter(|[a, b]| a != b).collect();
        let weights: Vec<f32> = pairs.iter().map(|_| random.below(9) as f32 / 8.0).collect();
        Case { positions: Positions::from_rows(&rows), graph: Graph::new(60, &pairs, &weights).unwrap() }
    }

    impl Case {
        fn links(&self, seeds: &[u32], params: &LinkParams) -> Vec<Candidate> {
            let of = Neighbourhood { positions: &self.positions, graph: &self.graph };
            link(&of, seeds, params, &Monitor::default()).unwrap()
        }

        fn apart(&self, a: u32, b: u32) -> f64 {
            let [a, b] = [a, b].map(|i| self.positions.xyz(i as usize).map(f64::from));
            a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        }

        /// Costs from a node by Bellman's and Ford's algorithm, within a ball.
        fn costs(&self, start: u32, radius: f64) -> Vec<f64> {
            let mut costs = vec![f64::INFINITY; 60];
            costs[start as usize] = 0.0;
            for _ in 0..60 {
                for (&[a, b], &w) in self.graph.edges().iter().zip(self.graph.weights()) {
                    for (from, to) in [(a, b), (b, a)] {
                        if self.apart(start, to) <= radius {
                            let cost = costs[from as usize] + f64::from(w);
                            costs[to as usize] = costs[to as usize].min(cost);
                        }
                    }
                }
            }
            costs
        }
    }

    #[test]
    fn paths_are_as_short_as_those_of_bellman_and_ford() {
        let mut count = 0;
        for seed in 0..40 {
            let case = random(seed);
            let seeds: Vec<u32> = (0..60).step_by(3).collect();
            let params = LinkParams { count: 6, radius: 0.85 };
            let found = case.links(&seeds, &params);
            for &a in &seeds {
                let nearest = |i: u32| {
                    let mut others: Vec<u32> = seeds.iter().copied().filter(|&j| j != i).collect();
                    others.sort_by(|&x, &y| case.apart(i, x).total_cmp(&case.apart(i, y)));
                    others.into_iter().take(6).filter(|&j| case.apart(i, j) <= 0.85).collect::<Vec<_>>()
                };
                let costs = case.costs(a, 1.7);
                for &b in seeds.iter().filter(|&&b| b > a) {
                    let linked = nearest(a).contains(&b) || nearest(b).contains(&a);
                    let expected = Some(costs[b as usize]).filter(|cost| linked && cost.is_finite());
                    let candidate: Vec<&Candidate> = found.iter().filter(|c| c.start == a && c.end == b).collect();
                    assert_eq!(candidate.first().map(|c| c.cost), expected, "seed {seed}");
                    assert!(candidate.len() <= 1);
                }
            }
            for candidate in &found {
                let path = &candidate.path;
                assert_eq!([path.first(), path.last()], [Some(&candidate.start), Some(&candidate.end)]);
                let edge = |w: &[u32]| case.graph.edges().binary_search(&[w[0].min(w[1]), w[0].max(w[1])]).unwrap();
                let sum: f64 = path.windows(2).map(|w| f64::from(case.graph.weights()[edge(w)])).sum();
                assert_eq!(sum, candidate.cost);
                assert!(path.iter().all(|&node| case.apart(candidate.start, node) <= 1.7));
            }
            count += found.len();
        }
        assert!(count > 500);
    }

    #[test]
    fn links_of_many_seeds_are_the_same_for_any_number_of_threads() {
        let mut random = stream(3, 4);
        let mut aside = || random.uniform() as f32 * 0.05;
        let rows: Vec<[f32; 3]> = (0..3000).map(|i| [i as f32 * 0.02, aside(), aside()]).collect();
        let pairs: Vec<[u32; 2]> =
            (0..3000).flat_map(|i| [1, 2, 7].map(|step| [i, i + step])).filter(|pair| pair[1] < 3000).collect();
        let weights: Vec<f32> = pairs.iter().map(|_| random.uniform() as f32).collect();
        let case = Case { positions: Positions::from_rows(&rows), graph: Graph::new(3000, &pairs, &weights).unwrap() };
        let seeds: Vec<u32> = (0..3000).step_by(2).collect();
        let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        let with = |n| pool(n).install(|| case.links(&seeds, &LinkParams::default()));
        let one = with(1);
        assert!(one.len() > 5000 && one == with(3), "{}", one.len());
    }

    #[test]
    fn links_are_the_same_for_any_number_of_threads() {
        let case = random(7);
        let seeds: Vec<u32> = (0..60).collect();
        let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        let with = |n| pool(n).install(|| case.links(&seeds, &LinkParams::default()));
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn without_edges_or_seeds_there_are_no_links() {
        let case = Case { graph: Graph::new(60, &[], &[]).unwrap(), ..random(1) };
        assert!(case.links(&[], &LinkParams::default()).is_empty());
        assert!(case.links(&[1], &LinkParams::default()).is_empty());
        assert!(case.links(&[1, 2, 3], &LinkParams::default()).is_empty());
        let of = Neighbourhood { positions: &case.positions, graph: &case.graph };
        for seeds in [&[2, 1][..], &[1, 1], &[60]] {
            assert!(link(&of, seeds, &LinkParams::default(), &Monitor::default()).is_err());
        }
    }
}
