//! Greedy merging of adjacent regions: a segmentation method of its own, and the backward step of cut pursuit.
//!
//! Merging two regions s, t that share a boundary of cost B_st changes the energy by −gain with gain = B_st − M_s M_t /
//! (M_s + M_t) ‖x_s − x_t‖²; they merge if gain > 0 (Landrieu, Obozinski, *Cut pursuit: fast algorithms to learn
//! piecewise constant functions on general weighted graphs*, SIAM J. Imaging Sciences 10(4), 2017, section 3).

mod batch;
mod greedy;

use super::Signal;
use super::cutoff::absorb_small;
use super::links::{EdgeLinks, Link, Links, contract};
use super::regions::{Objective, Regions, compact, energy, renumber};
use crate::error::{Error, Result};
use crate::graph::{Graph, UnionFind};
use crate::parallel::Monitor;
use crate::segmentation::Partition;
use crate::segmentation::connected::connected_partition;
use serde::{Deserialize, Serialize};

/// Up to this many links the pair of largest gain merges first; with more, each region's best pair at once.
pub(super) const GREEDY_LINKS: usize = 10_000;

/// Parameters of [`merge`].
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct MergeParams {
    /// ρ: cost of a boundary edge of weight 1, in units of squared feature difference. Larger: fewer, larger segments.
    /// ≥ 0; infinite gives one segment per connected component over edges of positive weight.
    #[serde(deserialize_with = "crate::settings::number")]
    pub strength: f64,
    /// Segments of less weight than this are merged into their best neighbour, at any cost. ≥ 0; 0 keeps all.
    #[serde(deserialize_with = "crate::settings::number")]
    pub cutoff: f64,
}

impl Default for MergeParams {
    fn default() -> Self {
        Self { strength: 0.1, cutoff: 0.0 }
    }
}

impl MergeParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] if the strength or the cutoff is negative or not a number.
    pub fn validate(&self) -> Result<()> {
        check_not_negative("strength", self.strength)?;
        check_not_negative("cutoff", self.cutoff)
    }
}

pub(super) fn check_not_negative(name: &'static str, value: f64) -> Result<()> {
    if value >= 0.0 { Ok(()) } else { Err(Error::parameter(name, value, "0 or more")) }
}

/// Result of [`merge`].
#[derive(Clone, Debug, PartialEq)]
pub struct Merge {
    /// The segments.
    pub partition: Partition,
    /// Mean of each segment, `width` values each.
    pub centroids: Vec<f64>,
    /// Q of the partition: fit + strength · boundary.
    pub energy: f64,
}

/// Merges single nodes into segments as long as this lowers Q = Σ m_i ‖f_i − x_c(i)‖² + ρ Σ w_ij [c(i) ≠ c(j)].
///
/// With at most 10,000 edges the pair of largest gain merges first; with more, every region's best partner is found at
/// once, and these pairs merge in the order of gain, each checked again with the current means. Q never rises in either
/// variant.
///
/// # Returns
/// Segments that are connected in the graph, the mean of each, and Q.
///
/// # Complexity
/// O(m log m) time for bounded degree, O(n · width + m) memory.
///
/// # Determinism
/// No randomness, one thread; equal gains merge in the order of their smallest nodes.
///
/// # Errors
/// If the signal has not a row for each node, a parameter is out of range, or the work was cancelled.
pub fn merge(signal: &Signal, graph: &Graph, params: &MergeParams, monitor: &Monitor) -> Result<Merge> {
    params.validate()?;
    signal.fits(graph.len())?;
    let partition = match trivial_partition(signal, graph, params.strength, monitor)? {
        Some(partition) => partition,
        None => {
            let links = EdgeLinks::weighted(graph, params.strength);
            let nodes = Regions::of_nodes(signal, monitor)?;
            Partition::from_labels_watched(&merge_nodes(nodes, links, GREEDY_LINKS, monitor)?.became, monitor)?
        }
    };
    let objective = Objective { signal, graph, strength: params.strength };
    let partition = absorb_small(objective, partition, params.cutoff, monitor)?;
    let energy = energy(objective, &partition, monitor)?;
    let centroids = Regions::of_segments(signal, &partition, monitor)?.into_means();
    Ok(Merge { partition, centroids, energy })
}

/// The partition at the limits of the strength: the connected sets of equal values at 0, the connected components over
/// edges of positive weight at infinity; `None` in between.
pub(super) fn trivial_partition(
    signal: &Signal,
    graph: &Graph,
    strength: f64,
    monitor: &Monitor,
) -> Result<Option<Partition>> {
    let same = |[a, b]: [u32; 2]| signal.row(a as usize) == signal.row(b as usize);
    if strength.is_infinite() {
        connected_partition(graph, |e, _| graph.weights()[e] > 0.0, monitor).map(Some)
    } else if strength == 0.0 {
        connected_partition(graph, |_, ends| same(ends), monitor).map(Some)
    } else {
        Ok(None)
    }
}

/// The result of merging.
pub(super) struct Merger {
    /// The region that contains each of the former regions.
    pub(super) became: Vec<u32>,
    /// The remaining regions.
    pub(super) regions: Regions,
    /// The links between the remaining regions.
    pub(super) links: Vec<Link>,
}

/// Merges regions while the gain is positive; with at most `greedy` links the largest gain first.
pub(super) fn merge_further(regions: Regions, links: Vec<Link>, greedy: usize, monitor: &Monitor) -> Result<Merger> {
    let mut merger = Merger { became: (0..regions.len() as u32).collect(), regions, links };
    while merger.links.len() > greedy {
        let Some(sets) = batch::merge_best_pairs(&mut merger.regions, &merger.links[..], monitor)? else {
            return Ok(merger);
        };
        merger.unite(sets, monitor)?;
    }
    let sets = greedy::merge_largest_gain_first(&mut merger.regions, &merger.links, monitor)?;
    merger.unite(sets, monitor)?;
    Ok(merger)
}

/// [`merge_further`] from single nodes; of the edges of a large graph only those that remain after the first pass are
/// stored.
pub(super) fn merge_nodes(
    mut regions: Regions,
    edges: EdgeLinks<'_>,
    greedy: usize,
    monitor: &Monitor,
) -> Result<Merger> {
    monitor.check()?;
    let links = || edges.numbered().map(|(_, link)| link);
    let sets = match links().nth(greedy).is_some() {
        true => batch::merge_best_pairs(&mut regions, &edges, monitor)?,
        false => None,
    };
    let Some(sets) = sets else { return merge_further(regions, links().collect(), greedy, monitor) };
    let (number, left) = compact(&regions, sets, monitor)?;
    regions = left;
    let mut merger = merge_further(regions, contract(&edges, &number, monitor)?, greedy, monitor)?;
    let mut became = number;
    renumber(&mut became, &merger.became, monitor)?;
    merger.became = became;
    Ok(merger)
}

impl Merger {
    fn unite(&mut self, sets: UnionFind, monitor: &Monitor) -> Result<()> {
        let (number, left) = compact(&self.regions, sets, monitor)?;
        self.regions = left;
        renumber(&mut self.became, &number, monitor)?;
        self.links = contract(&self.links[..], &number, monitor)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn grid(side: u32) -> Graph {
        let across = (0..side * side).filter(|v| v % side + 1 < side).map(|v| [v, v + 1]);
        let down = (0..side * (side - 1)).map(|v| [v, v + side]);
        let pairs: Vec<[u32; 2]> = across.chain(down).collect();
        Graph::new((side * side) as usize, &pairs, &vec![1.0; pairs.len()]).unwrap()
    }

    /// A chequerboard of 4 x 4 fields with noise.
    fn chequer(side: u32, seed: u64) -> Vec<f32> {
        let mut random = stream(seed, 0);
        let field = |v: u32| (v % side / (side / 4) + v / side / (side / 4)) % 2;
        (0..side * side).map(|v| field(v) as f32 + 0.3 * (random.uniform() as f32 - 0.5)).collect()
    }

    #[test]
    fn a_noisy_chequer_falls_into_its_fields() {
        let (values, graph) = (chequer(16, 1), grid(16));
        let signal = Signal::new(&values, 1).unwrap();
        let params = MergeParams { strength: 0.1, ..MergeParams::default() };
        let found = merge(&signal, &graph, &params, &Monitor::default()).unwrap();
        let fields: Vec<u32> = (0..256).map(|v| v % 16 / 4 + v / 16 / 4 * 4).collect();
        assert_eq!(found.partition, Partition::from_labels(&fields).unwrap());
        assert_eq!(
            found.energy,
            energy(Objective { signal: &signal, graph: &graph, strength: 0.1 }, &found.partition, &Monitor::default())
                .unwrap()
        );
    }

    #[test]
    fn many_at_once_and_one_by_one_both_leave_no_merger_that_gains() {
        let (values, graph) = (chequer(32, 2), grid(32));
        let signal = Signal::new(&values, 1).unwrap();
        let links: Vec<Link> = EdgeLinks::weighted(&graph, 0.03).numbered().map(|(_, link)| link).collect();
        let monitor = Monitor::default();
        let energy_of = |labels: &[u32]| {
            energy(
                Objective { signal: &signal, graph: &graph, strength: 0.03 },
                &Partition::from_labels(labels).unwrap(),
                &monitor,
            )
            .unwrap()
        };
        let start = energy_of(&(0..1024).collect::<Vec<_>>());
        let nodes = || Regions::of_nodes(&signal, &monitor).unwrap();
        let (mut regions, mut left) = (nodes(), links.clone());
        let mut became: Vec<u32> = (0..1024).collect();
        let mut last = start;
        while let Some(sets) = batch::merge_best_pairs(&mut regions, &left[..], &monitor).unwrap() {
            let (number, next) = compact(&regions, sets, &monitor).unwrap();
            became.iter_mut().for_each(|r| *r = number[*r as usize]);
            (left, regions) = (contract(&left[..], &number, &monitor).unwrap(), next);
            let now = energy_of(&became);
            assert!(now < last, "every round lowers the energy");
            last = now;
        }
        let one_by_one = merge_further(nodes(), links, GREEDY_LINKS, &monitor).unwrap().became;
        for labels in [became, one_by_one] {
            let partition = Partition::from_labels(&labels).unwrap();
            let regions = Regions::of_segments(&signal, &partition, &monitor).unwrap();
            let links = contract(&EdgeLinks::weighted(&graph, 0.03), partition.segments(), &monitor).unwrap();
            assert!(links.iter().all(|l| l.boundary - regions.loss(l.ends) < 1e-9));
        }
    }

    #[test]
    fn the_strength_may_be_nought_or_infinite() {
        let signal = Signal::new(&[1.0, 1.0, 2.0, 7.0], 1).unwrap();
        let graph = Graph::new(4, &[[0, 1], [1, 2]], &[1.0; 2]).unwrap();
        let at = |strength| {
            let params = MergeParams { strength, ..MergeParams::default() };
            merge(&signal, &graph, &params, &Monitor::default()).map(|m| m.partition.segments().to_vec())
        };
        assert_eq!(at(0.0).unwrap(), [0, 0, 1, 2]);
        assert_eq!(at(f64::INFINITY).unwrap(), [0, 0, 0, 1]);
        assert!(at(f64::NAN).is_err() && at(-1.0).is_err());
    }
}
