//! Weights and means of the segments of a partition, the boundaries between them, and the energy of the whole.

use super::Signal;
use crate::error::Result;
use crate::graph::{Graph, UnionFind};
use crate::parallel::{Looks, Monitor, watched};
use crate::segmentation::Partition;

/// Weight M and mean x of each region; f64 throughout, so that thousands of merges lose no accuracy.
#[derive(Clone, Debug)]
pub(super) struct Regions {
    width: usize,
    weights: Vec<f64>,
    means: Vec<f64>,
}

impl Regions {
    /// Every node a region of its own.
    pub(super) fn of_nodes(signal: &Signal, monitor: &Monitor) -> Result<Self> {
        let (nodes, width) = (signal.len(), signal.width());
        let mut regions = Self { width, weights: Vec::with_capacity(nodes), means: Vec::with_capacity(nodes * width) };
        for piece in watched(nodes, monitor) {
            let piece = piece?;
            regions.weights.extend(piece.clone().map(|v| signal.weight(v)));
            regions.means.extend(piece.flat_map(|v| signal.row(v)).map(|&f| f64::from(f)));
        }
        Ok(regions)
    }

    /// The segments of a partition.
    pub(super) fn of_segments(signal: &Signal, partition: &Partition, monitor: &Monitor) -> Result<Self> {
        let (width, mut looks) = (signal.width(), Looks::at(monitor));
        let mut regions =
            Self { width, weights: Vec::with_capacity(partition.len()), means: vec![0.0; partition.len() * width] };
        for (members, mean) in partition.iter().zip(regions.means.chunks_exact_mut(width)) {
            let nodes = members.iter().map(|&v| (signal.row(v as usize), signal.weight(v as usize)));
            regions.weights.push(weighted_mean(nodes, mean, &mut looks)?);
        }
        Ok(regions)
    }

    pub(super) fn len(&self) -> usize {
        self.weights.len()
    }

    pub(super) fn weight(&self, region: u32) -> f64 {
        self.weights[region as usize]
    }

    pub(super) fn mean(&self, region: u32) -> &[f64] {
        &self.means[region as usize * self.width..][..self.width]
    }

    pub(super) fn into_means(self) -> Vec<f64> {
        self.means
    }

    /// By how much the fit gets worse if two regions share one mean: M_s M_t / (M_s + M_t) ‖x_s − x_t‖².
    #[inline]
    pub(super) fn loss(&self, [s, t]: [u32; 2]) -> f64 {
        let (m, n) = (self.weight(s), self.weight(t));
        m * n / (m + n) * square_between(self.mean(s), self.mean(t))
    }

    /// ‖f − x‖² of a row.
    pub(super) fn square_distance(&self, region: u32, row: &[f32]) -> f64 {
        self.mean(region).iter().zip(row).map(|(x, &f)| (f64::from(f) - x).powi(2)).sum()
    }

    /// Moves a node from one region, which keeps others, to another.
    pub(super) fn shift(&mut self, row: &[f32], weight: f64, [from, to]: [u32; 2]) {
        for (region, change) in [(from, -weight), (to, weight)] {
            let region = region as usize;
            self.weights[region] += change;
            let share = change / self.weights[region];
            let mean = &mut self.means[region * self.width..][..self.width];
            mean.iter_mut().zip(row).for_each(|(x, &f)| *x += share * (f64::from(f) - *x));
        }
    }

    /// Moves everything of `gone` into `kept`.
    pub(super) fn absorb(&mut self, kept: u32, gone: u32) {
        let (m, n) = (self.weight(kept), self.weight(gone));
        let share = n / (m + n);
        for i in 0..self.width {
            let from = self.means[gone as usize * self.width + i];
            let mean = &mut self.means[kept as usize * self.width + i];
            *mean += share * (from - *mean);
        }
        self.weights[kept as usize] = m + n;
        self.weights[gone as usize] = 0.0;
    }
}

/// ‖a − b‖²; for four descriptors with a length known to the compiler, with the same result.
#[inline]
fn square_between(a: &[f64], b: &[f64]) -> f64 {
    let square = |(a, b): (&f64, &f64)| (a - b) * (a - b);
    match (a.as_array::<4>(), b.as_array::<4>()) {
        (Some(a), Some(b)) => a.iter().zip(b).map(square).sum(),
        _ => a.iter().zip(b).map(square).sum(),
    }
}

/// Writes the weighted mean of rows into `mean` and returns the sum of weights.
pub(super) fn weighted_mean<'a>(
    rows: impl Iterator<Item = (&'a [f32], f64)>,
    mean: &mut [f64],
    looks: &mut Looks<'_>,
) -> Result<f64> {
    mean.fill(0.0);
    let mut total = 0.0;
    for (row, weight) in rows {
        looks.step()?;
        total += weight;
        mean.iter_mut().zip(row).for_each(|(m, &f)| *m += weight * f64::from(f));
    }
    if total > 0.0 {
        mean.iter_mut().for_each(|m| *m /= total);
    }
    Ok(total)
}

/// The roots of `sets` renumbered 0, 1, ... in order, and the regions that remain, in the same order.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn compact(regions: &Regions, mut sets: UnionFind, monitor: &Monitor) -> Result<(Vec<u32>, Regions)> {
    let roots = sets.roots(monitor)?;
    let mut number = vec![0u32; roots.len()];
    let mut left = Regions { width: regions.width, weights: Vec::new(), means: Vec::new() };
    for piece in watched(roots.len(), monitor) {
        for region in piece?.filter(|&region| region == roots[region] as usize) {
            number[region] = left.len() as u32;
            left.weights.push(regions.weight(region as u32));
            left.means.extend_from_slice(regions.mean(region as u32));
        }
    }
    let mut numbers = roots;
    renumber(&mut numbers, &number, monitor)?;
    Ok((numbers, left))
}

/// Replaces each label by `number[label]`.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn renumber(labels: &mut [u32], number: &[u32], monitor: &Monitor) -> Result<()> {
    for piece in watched(labels.len(), monitor) {
        labels[piece?].iter_mut().for_each(|label| *label = number[*label as usize]);
    }
    Ok(())
}

/// What a partition minimises: Q = Σ m_i ‖f_i − x_c(i)‖² + strength · Σ w over the edges that join different segments.
#[derive(Clone, Copy)]
pub(super) struct Objective<'a> {
    /// f and m: the values of the nodes and their weights.
    pub(super) signal: &'a Signal<'a>,
    /// The edges and their weights w.
    pub(super) graph: &'a Graph,
    /// ρ, 0 or more.
    pub(super) strength: f64,
}

/// Q of a partition. O((n + m) · width).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn energy(objective: Objective<'_>, partition: &Partition, monitor: &Monitor) -> Result<f64> {
    let Objective { signal, graph, strength } = objective;
    let regions = Regions::of_segments(signal, partition, monitor)?;
    let (mut fit, mut cut) = (0.0, 0.0);
    for piece in watched(signal.len(), monitor) {
        for v in piece? {
            let mean = regions.mean(partition.segments()[v]);
            let square: f64 = signal.row(v).iter().zip(mean).map(|(&f, x)| (f64::from(f) - x).powi(2)).sum();
            fit += signal.weight(v) * square;
        }
    }
    let segment = |end: u32| partition.segments()[end as usize];
    for piece in watched(graph.edges().len(), monitor) {
        for e in piece? {
            let [a, b] = graph.edges()[e];
            if segment(a) != segment(b) {
                cut += f64::from(graph.weights()[e]);
            }
        }
    }
    // strength · 0 would be NaN for an infinite strength; no boundary costs nothing.
    Ok(fit + if cut > 0.0 { strength * cut } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::super::links::{EdgeLinks, contract};
    use super::*;
    use crate::random::stream;

    #[test]
    fn merging_two_regions_changes_the_energy_by_exactly_the_gain() {
        for seed in 0..20 {
            let mut random = stream(seed, 0);
            let values: Vec<f32> = (0..24).map(|_| random.uniform() as f32).collect();
            let weights: Vec<f32> = (0..8).map(|_| 0.5 + random.uniform() as f32).collect();
            let signal = Signal::new(&values, 3).unwrap().with_weights(&weights).unwrap();
            let pairs: Vec<[u32; 2]> = (0..8).flat_map(|a| (0..a).map(move |b| [b, a])).collect();
            let graph = Graph::new(8, &pairs, &vec![0.25; pairs.len()]).unwrap();
            let before = Partition::from_labels(&[0, 0, 1, 1, 2, 2, 2, 1]).unwrap();
            let after = Partition::from_labels(&[0, 0, 1, 1, 1, 1, 1, 1]).unwrap();
            let links = contract(&EdgeLinks::weighted(&graph, 0.3), before.segments(), &Monitor::default()).unwrap();
            let mut regions = Regions::of_segments(&signal, &before, &Monitor::default()).unwrap();
            let link = links.iter().find(|l| l.ends == [1, 2]).unwrap();
            let gain = link.boundary - regions.loss(link.ends);
            let energy = |partition| {
                energy(Objective { signal: &signal, graph: &graph, strength: 0.3 }, partition, &Monitor::default())
                    .unwrap()
            };
            let difference = energy(&before) - energy(&after);
            assert!((gain - difference).abs() < 1e-12, "{gain} {difference}");
            regions.absorb(1, 2);
            let merged = Regions::of_segments(&signal, &after, &Monitor::default()).unwrap();
            assert!(regions.mean(1).iter().zip(merged.mean(1)).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }
}
