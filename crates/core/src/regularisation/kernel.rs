//! The kernel of a Potts problem: what remains of it once the nodes with a provably optimal label are fixed.
//!
//! The edges to fixed nodes become unary costs of their neighbours. With these more labels can be proved, and so on.

use super::known::Known;
use super::{Energy, Pairwise};
use crate::error::Result;
use crate::graph::{Adjacency, Graph};
use crate::parallel::{Looks, Monitor, watched};

/// The remaining nodes as a problem of their own, and the labels of the fixed ones.
#[derive(Debug)]
pub(super) struct Kernel {
    /// The remaining nodes, in the numbering of the whole problem.
    nodes: Vec<u32>,
    /// Fixed labels of the whole problem; 0 for the remaining nodes.
    labels: Vec<u16>,
    graph: Graph,
    unary: Vec<f32>,
    /// Number of labels.
    count: usize,
    strength: f64,
}

impl Kernel {
    /// The kernel after as many rounds as pay; `None` for problems without Potts distances, to which the theory does
    /// not apply.
    pub(super) fn of(energy: &Energy<'_>, adjacency: &Adjacency, monitor: &Monitor) -> Result<Option<Self>> {
        let potts = *energy.pairwise == Pairwise::Potts && energy.label_costs.iter().all(|cost| *cost == 0.0);
        if !potts || energy.labels < 2 {
            return Ok(None);
        }
        let mut kernel = Self::shrink(energy, adjacency, monitor)?;
        loop {
            let before = kernel.nodes.len();
            let inner = Self::shrink(&kernel.energy(), &kernel.graph.adjacency_watched(monitor)?, monitor)?;
            kernel = kernel.replaced(inner);
            // A round that fixes few nodes costs more than it saves.
            if kernel.nodes.len() * 10 >= before * 9 {
                return Ok(Some(kernel));
            }
        }
    }

    /// The remaining nodes as a problem of their own.
    pub(super) fn energy(&self) -> Energy<'_> {
        let (graph, strength) = (&self.graph, self.strength);
        Energy { unary: &self.unary, labels: self.count, graph, strength, pairwise: &Pairwise::Potts, label_costs: &[] }
    }

    /// Labels of the whole problem from those of the remaining nodes.
    pub(super) fn whole(&self, open: &[u16]) -> Vec<u16> {
        let mut labels = self.labels.clone();
        self.nodes.iter().zip(open).for_each(|(&node, &label)| labels[node as usize] = label);
        labels
    }

    /// Labels of the remaining nodes from those of the whole problem.
    pub(super) fn part_of(&self, whole: &[u16]) -> Vec<u16> {
        self.nodes.iter().map(|&node| whole[node as usize]).collect()
    }

    /// The kernel of this kernel, in the numbering of the whole problem.
    fn replaced(self, inner: Self) -> Self {
        let labels = self.whole(&inner.labels);
        let nodes = inner.nodes.iter().map(|&at| self.nodes[at as usize]).collect();
        Self { nodes, labels, ..inner }
    }

    fn shrink(energy: &Energy<'_>, adjacency: &Adjacency, monitor: &Monitor) -> Result<Self> {
        let known = Known::find(energy, adjacency, monitor)?.labels;
        let nodes: Vec<u32> = (0..).zip(&known).filter(|(_, label)| label.is_none()).map(|(node, _)| node).collect();
        let labels = known.iter().map(|label| label.unwrap_or(0)).collect();
        let (unary, graph) =
            (costs(energy, adjacency, (&known, &nodes), monitor)?, inner_graph(energy.graph, &known, monitor)?);
        Ok(Self { nodes, labels, graph, unary, count: energy.labels, strength: energy.strength })
    }
}

/// Unary costs of the remaining nodes, with the edges to fixed nodes added.
fn costs(
    energy: &Energy<'_>,
    adjacency: &Adjacency,
    (known, open): (&[Option<u16>], &[u32]),
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    let mut looks = Looks::at(monitor);
    let mut unary = Vec::with_capacity(open.len() * energy.labels);
    let mut row = vec![0.0; energy.labels];
    for &node in open {
        looks.step()?;
        (0..).zip(&mut row).for_each(|(label, cost)| *cost = energy.cost(node as usize, label));
        for (other, edge) in adjacency.of(node as usize) {
            if let Some(label) = known[other as usize] {
                // Subtracts the edge's cost from the fixed label instead of adding it to all others: a constant that
                // changes no choice.
                row[usize::from(label)] -= energy.strength * f64::from(energy.graph.weights()[edge as usize]);
            }
        }
        unary.extend(row.iter().map(|cost| *cost as f32));
    }
    Ok(unary)
}

/// The edges between remaining nodes, in their own numbering.
fn inner_graph(graph: &Graph, known: &[Option<u16>], monitor: &Monitor) -> Result<Graph> {
    let mut nodes = 0u32;
    let mut place = Vec::with_capacity(known.len());
    for label in known {
        place.push(nodes);
        nodes += u32::from(label.is_none());
    }
    let (mut pairs, mut weights) = (Vec::new(), Vec::new());
    for piece in watched(graph.edges().len(), monitor) {
        for e in piece? {
            let ends = graph.edges()[e];
            if ends.iter().all(|&node| known[node as usize].is_none()) {
                pairs.push(ends.map(|node| place[node as usize]));
                weights.push(graph.weights()[e]);
            }
        }
    }
    Graph::new_watched(nodes as usize, &pairs, &weights, monitor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regularisation::ExpansionParams;
    use crate::regularisation::instance::{mixed, random};

    fn kernel_of(energy: &Energy<'_>) -> Option<Kernel> {
        Kernel::of(energy, &energy.graph.adjacency(), &Monitor::default()).unwrap()
    }

    #[test]
    fn known_labels_have_a_place_in_a_labelling_of_least_energy() {
        let mut known = 0;
        for seed in 0..150 {
            let instance = random(seed, 7, 3);
            let params = ExpansionParams { strength: 0.25 * (1 + seed % 4) as f64, ..ExpansionParams::default() };
            let energy = instance.energy(&params);
            let kernel = kernel_of(&energy).unwrap();
            known += 7 - kernel.nodes.len();
            let inner = (0..3usize.pow(kernel.nodes.len() as u32)).map(|code| {
                let open: Vec<u16> =
                    (0..kernel.nodes.len()).map(|i| (code / 3usize.pow(i as u32) % 3) as u16).collect();
                energy.of(&kernel.whole(&open))
            });
            assert_eq!(inner.fold(f64::INFINITY, f64::min), instance.optimum(&params), "seed {seed}");
        }
        assert!((200..1050).contains(&known), "{known} of 1050 labels are known");
    }

    #[test]
    fn energies_of_the_kernel_differ_from_those_of_the_whole_by_a_constant() {
        for seed in [0, 3, 7] {
            let (instance, params) = (mixed(seed), ExpansionParams::default());
            let energy = instance.energy(&params);
            let kernel = kernel_of(&energy).unwrap();
            let nodes = kernel.nodes.len() as u16;
            assert!(nodes > 0, "seed {seed}");
            let shift = |labels: &[u16]| energy.of(&kernel.whole(labels)) - kernel.energy().of(labels);
            let mixed: Vec<u16> = (0..nodes).map(|i| i % instance.labels as u16).collect();
            assert_eq!(shift(&mixed), shift(&vec![1; usize::from(nodes)]));
            assert_eq!(kernel.part_of(&kernel.whole(&mixed)), mixed);
        }
    }

    #[test]
    fn other_distances_and_costs_of_labels_leave_the_problem_whole() {
        let instance = random(1, 8, 2);
        let metric =
            ExpansionParams { pairwise: Pairwise::Metric(vec![0.0, 2.0, 2.0, 0.0]), ..ExpansionParams::default() };
        assert!(kernel_of(&instance.energy(&metric)).is_none());
        let costs = ExpansionParams { label_costs: vec![1.0, 0.0], ..ExpansionParams::default() };
        assert!(kernel_of(&instance.energy(&costs)).is_none());
    }
}
