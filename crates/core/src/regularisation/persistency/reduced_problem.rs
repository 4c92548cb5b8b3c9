//! The reduced problem: what remains of a Potts problem once the nodes with a persistent label are fixed.
//!
//! The edges to fixed nodes become unary costs of their neighbours. With these more labels are persistent, and so on.
//! K. Alahari, P. Kohli, P. H. S. Torr, *Reduce, reuse and recycle: efficiently solving multi-label MRFs*, CVPR 2008.

use super::PartialLabelling;
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::{Held, Looks};
use crate::regularisation::energy::Problem;
use crate::regularisation::{Energy, Pairwise};

/// The remaining nodes as a problem of their own, and the labels of the fixed ones.
#[derive(Debug, Default)]
pub(in crate::regularisation) struct ReducedProblem {
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

impl ReducedProblem {
    /// The reduced problem after all rounds that fix enough nodes to save time; `None` for problems without Potts
    /// distances, to which the theory does not apply.
    pub(in crate::regularisation) fn of(problem: &Problem<'_>) -> Result<Option<Held<Self>>> {
        let (energy, monitor) = (&problem.energy, problem.monitor);
        let potts = *energy.pairwise == Pairwise::Potts && energy.label_costs.iter().all(|cost| *cost == 0.0);
        if !potts || energy.labels < 2 {
            return Ok(None);
        }
        let mut reduced = Held::new(Self::once(problem)?, monitor);
        loop {
            let before = reduced.nodes.len();
            let adjacency = reduced.graph.adjacency_watched(monitor)?;
            let inner = Self::once(&Problem { energy: reduced.energy(), adjacency: &adjacency, monitor })?;
            reduced = Held::new(reduced.into_inner().replaced(inner), monitor);
            // A round that fixes few nodes costs more than it saves.
            if reduced.nodes.len() * 10 >= before * 9 {
                return Ok(Some(reduced));
            }
        }
    }

    /// The remaining nodes as a problem of their own.
    pub(in crate::regularisation) fn energy(&self) -> Energy<'_> {
        let (graph, strength) = (&self.graph, self.strength);
        Energy { unary: &self.unary, labels: self.count, graph, strength, pairwise: &Pairwise::Potts, label_costs: &[] }
    }

    /// Labels of the whole problem from those of the remaining nodes.
    pub(in crate::regularisation) fn whole(&self, open: &[u16]) -> Vec<u16> {
        let mut labels = self.labels.clone();
        self.nodes.iter().zip(open).for_each(|(&node, &label)| labels[node as usize] = label);
        labels
    }

    /// Labels of the remaining nodes from those of the whole problem.
    pub(in crate::regularisation) fn part_of(&self, whole: &[u16]) -> Vec<u16> {
        self.nodes.iter().map(|&node| whole[node as usize]).collect()
    }

    /// The reduced problem of this reduced problem, in the numbering of the whole problem.
    fn replaced(self, inner: Self) -> Self {
        let labels = self.whole(&inner.labels);
        let nodes = inner.nodes.iter().map(|&at| self.nodes[at as usize]).collect();
        Self { nodes, labels, ..inner }
    }

    /// One round: fixes the persistent labels.
    fn once(problem: &Problem<'_>) -> Result<Self> {
        let energy = &problem.energy;
        let known = PartialLabelling::find(problem)?.into_inner().labels;
        let nodes: Vec<u32> = (0..).zip(&known).filter(|(_, label)| label.is_none()).map(|(node, _)| node).collect();
        let labels = known.iter().map(|label| label.unwrap_or(0)).collect();
        let unary = costs(problem, &known, &nodes)?;
        let graph = energy.graph.induced(&nodes, |_| true, problem.monitor)?;
        Ok(Self { nodes, labels, graph, unary, count: energy.labels, strength: energy.strength })
    }
}

/// Unary costs of the remaining nodes, with the edges to fixed nodes added.
fn costs(problem: &Problem<'_>, known: &[Option<u16>], open: &[u32]) -> Result<Vec<f32>> {
    let energy = &problem.energy;
    let mut looks = Looks::at(problem.monitor);
    let mut unary = Vec::with_capacity(open.len() * energy.labels);
    let mut row = vec![0.0; energy.labels];
    for &node in open {
        looks.step()?;
        (0..).zip(&mut row).for_each(|(label, cost)| *cost = energy.cost(node as usize, label));
        for (other, edge) in problem.adjacency.of(node as usize) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::Monitor;
    use crate::regularisation::ExpansionParams;
    use crate::regularisation::instance::{mixed, random};

    fn reduced(energy: &Energy<'_>) -> Option<Held<ReducedProblem>> {
        let adjacency = energy.graph.adjacency();
        ReducedProblem::of(&Problem { energy: *energy, adjacency: &adjacency, monitor: &Monitor::default() }).unwrap()
    }

    #[test]
    fn persistent_labels_are_those_of_a_labelling_of_least_energy() {
        let mut known = 0;
        for seed in 0..150 {
            let instance = random(seed, 7, 3);
            let params = ExpansionParams { strength: 0.25 * (1 + seed % 4) as f64, ..ExpansionParams::default() };
            let energy = instance.energy(&params);
            let smaller = reduced(&energy).unwrap();
            known += 7 - smaller.nodes.len();
            let inner = (0..3usize.pow(smaller.nodes.len() as u32)).map(|code| {
                let open: Vec<u16> =
                    (0..smaller.nodes.len()).map(|i| (code / 3usize.pow(i as u32) % 3) as u16).collect();
                energy.of(&smaller.whole(&open))
            });
            assert_eq!(inner.fold(f64::INFINITY, f64::min), instance.optimum(&params), "seed {seed}");
        }
        assert!((200..1050).contains(&known), "{known} of 1050 labels are known");
    }

    #[test]
    fn energies_of_the_reduced_problem_differ_from_those_of_the_whole_by_a_constant() {
        for seed in [0, 3, 7] {
            let (instance, params) = (mixed(seed), ExpansionParams::default());
            let energy = instance.energy(&params);
            let smaller = reduced(&energy).unwrap();
            let nodes = smaller.nodes.len() as u16;
            assert!(nodes > 0, "seed {seed}");
            let shift = |labels: &[u16]| energy.of(&smaller.whole(labels)) - smaller.energy().of(labels);
            let mixed: Vec<u16> = (0..nodes).map(|i| i % instance.labels as u16).collect();
            assert_eq!(shift(&mixed), shift(&vec![1; usize::from(nodes)]));
            assert_eq!(smaller.part_of(&smaller.whole(&mixed)), mixed);
        }
    }

    #[test]
    fn other_distances_and_costs_of_labels_leave_the_problem_whole() {
        let instance = random(1, 8, 2);
        let metric =
            ExpansionParams { pairwise: Pairwise::Metric(vec![0.0, 2.0, 2.0, 0.0]), ..ExpansionParams::default() };
        assert!(reduced(&instance.energy(&metric)).is_none());
        let costs = ExpansionParams { label_costs: vec![1.0, 0.0], ..ExpansionParams::default() };
        assert!(reduced(&instance.energy(&costs)).is_none());
    }
}
