//! The energy of a labelling: unary costs at nodes, pairwise costs at edges, and costs of labels.

use crate::error::{Error, Result};
use crate::graph::{Adjacency, Graph};
use crate::parallel::{Monitor, watched};

/// Distance of two labels, V in the energy.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pairwise {
    /// 0 for equal labels, 1 for different ones.
    #[default]
    Potts,
    /// Row-major `labels x labels`: 0 on the diagonal, symmetric; α-expansion also needs the triangle inequality.
    Metric(Vec<f32>),
}

impl Pairwise {
    /// Distance of labels `a` and `b` of `labels`.
    #[inline]
    pub fn distance(&self, a: u16, b: u16, labels: usize) -> f64 {
        match self {
            Self::Potts => f64::from(u8::from(a != b)),
            Self::Metric(table) => f64::from(table[usize::from(a) * labels + usize::from(b)]),
        }
    }

    /// Checks that the distances are symmetric, 0 or more, and 0 from a label to itself. O(labels²).
    ///
    /// # Errors
    /// Names the labels that break a rule.
    pub fn check_symmetric(&self, labels: usize) -> Result<()> {
        let Self::Metric(table) = self else { return Ok(()) };
        if table.len() != labels * labels {
            return Err(Error::input(format!("{} label distances for {labels} x {labels} labels", table.len())));
        }
        let v = |a: usize, b: usize| table[a * labels + b];
        for (a, b) in (0..labels).flat_map(|a| (0..labels).map(move |b| (a, b))) {
            let symmetric = v(a, b).to_bits() == v(b, a).to_bits();
            let fine = v(a, b).is_finite() && v(a, b) >= 0.0 && (a != b || v(a, b) == 0.0) && symmetric;
            if !fine {
                return Err(Error::input(format!(
                    "distance {} of labels {a} and {b} (allowed: finite, symmetric, 0 only to itself)",
                    v(a, b)
                )));
            }
        }
        Ok(())
    }

    /// Checks that the distances are a metric on `labels` labels: symmetric, with the triangle inequality. O(labels³).
    ///
    /// # Errors
    /// Names the labels that break a rule.
    pub fn check_metric(&self, labels: usize) -> Result<()> {
        self.check_symmetric(labels)?;
        let Self::Metric(table) = self else { return Ok(()) };
        let v = |a: usize, b: usize| table[a * labels + b];
        for (a, b) in (0..labels).flat_map(|a| (0..labels).map(move |b| (a, b))) {
            let slack = 1e-6 * v(a, b);
            if let Some(c) = (0..labels).find(|&c| v(a, c) + v(c, b) + slack < v(a, b)) {
                return Err(Error::input(format!("labels {a} and {b} are nearer by way of {c}: no metric")));
            }
        }
        Ok(())
    }
}

/// A labelling problem.
#[derive(Clone, Copy, Debug)]
pub struct Energy<'a> {
    /// Unary costs, row-major `nodes x labels`: cost of each label at each node; finite, of any sign.
    pub unary: &'a [f32],
    /// Number of labels.
    pub labels: usize,
    /// Edges between nodes and their weights.
    pub graph: &'a Graph,
    /// Factor of all edge weights, 0 or more.
    pub strength: f64,
    /// Distance of labels.
    pub pairwise: &'a Pairwise,
    /// Cost of each label, paid once if any node has it, 0 or more; empty for none.
    pub label_costs: &'a [f32],
}

impl<'a> Energy<'a> {
    /// From unary costs (`nodes x labels`, row-major) and a graph, checked; without label costs. The number of labels
    /// follows from the length of the costs.
    ///
    /// # Errors
    /// As [`Energy::check`].
    pub fn new(unary: &'a [f32], graph: &'a Graph, strength: f64, pairwise: &'a Pairwise) -> Result<Self> {
        let labels = unary.len().checked_div(graph.len()).unwrap_or(1);
        let energy = Self { unary, labels, graph, strength, pairwise, label_costs: &[] };
        energy.check()?;
        Ok(energy)
    }

    /// The same problem with label costs.
    ///
    /// # Errors
    /// If the number of costs is neither 0 nor that of the labels, or a cost is below 0 or not finite.
    pub fn with_label_costs(self, label_costs: &'a [f32]) -> Result<Self> {
        // Without nodes the number of labels is unknown.
        if !label_costs.is_empty() && label_costs.len() != self.labels && !self.graph.is_empty() {
            return Err(Error::input(format!("{} label costs for {} labels", label_costs.len(), self.labels)));
        }
        match label_costs.iter().find(|cost| !(**cost >= 0.0 && cost.is_finite())) {
            Some(cost) => Err(Error::parameter("label_costs", cost, "0 or more, finite")),
            None => Ok(Self { label_costs, ..self }),
        }
    }

    /// Checks that the parts fit together. O(nodes · labels + labels²).
    ///
    /// # Errors
    /// Lengths that do not fit, a cost that is not finite, a strength below 0 or not finite, distances that are not
    /// symmetric.
    pub fn check(&self) -> Result<()> {
        if self.labels == 0 || self.labels > usize::from(u16::MAX) {
            return Err(Error::parameter("labels", self.labels, "1 to 65535"));
        }
        if self.unary.len() != self.graph.len() * self.labels {
            return Err(Error::input(format!(
                "{} costs for {} nodes and {} labels",
                self.unary.len(),
                self.graph.len(),
                self.labels
            )));
        }
        if let Some(at) = self.unary.iter().position(|cost| !cost.is_finite()) {
            let (node, label) = (at / self.labels, at % self.labels);
            return Err(Error::input(format!("cost {} of label {label} at node {node} is not finite", self.unary[at])));
        }
        check_strength(self.strength)?;
        // Without nodes the number of labels is unknown.
        if self.graph.is_empty() { Ok(()) } else { self.pairwise.check_symmetric(self.labels) }
    }

    /// Label cost of `label`.
    #[inline]
    pub fn label_cost(&self, label: u16) -> f64 {
        self.label_costs.get(usize::from(label)).copied().map_or(0.0, f64::from)
    }

    /// Unary cost of `label` at `node`.
    #[inline]
    pub fn cost(&self, node: usize, label: u16) -> f64 {
        f64::from(self.unary[node * self.labels + usize::from(label)])
    }

    /// Cost of edge `edge` if its ends have labels `a` and `b`.
    #[inline]
    pub fn edge_cost(&self, edge: usize, a: u16, b: u16) -> f64 {
        self.strength * f64::from(self.graph.weights()[edge]) * self.pairwise.distance(a, b, self.labels)
    }

    /// Energy of a labelling, summed in the order of nodes, then edges, then labels. O(nodes + edges + labels).
    pub fn of(&self, labels: &[u16]) -> f64 {
        // A new monitor cannot have been cancelled.
        self.of_watched(labels, &Monitor::default()).unwrap_or_default()
    }

    /// Like [`Energy::of`], and can be cancelled.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn of_watched(&self, labels: &[u16], monitor: &Monitor) -> Result<f64> {
        let (mut nodes, mut edges) = (0.0, 0.0);
        for piece in watched(labels.len(), monitor) {
            nodes = piece?.map(|node| self.cost(node, labels[node])).fold(nodes, |sum, cost| sum + cost);
        }
        let ends = self.graph.edges();
        for piece in watched(ends.len(), monitor) {
            let cost = |e: usize| self.edge_cost(e, labels[ends[e][0] as usize], labels[ends[e][1] as usize]);
            edges = piece?.map(cost).fold(edges, |sum, cost| sum + cost);
        }
        let used = self.users(labels).into_iter().enumerate().filter(|(_, users)| *users > 0);
        Ok(nodes + edges + used.map(|(label, _)| self.label_cost(label as u16)).sum::<f64>())
    }

    /// Number of nodes with each label.
    pub(super) fn users(&self, labels: &[u16]) -> Vec<usize> {
        let mut users = vec![0; self.labels];
        labels.iter().for_each(|&label| users[usize::from(label)] += 1);
        users
    }

    /// Initial labelling: the cheapest label of every node, or one label for all if that costs less.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn initial_labelling(&self, monitor: &Monitor) -> Result<Vec<u16>> {
        let cheapest = self.cheapest(monitor)?;
        let mut sums = vec![0.0; self.labels];
        for piece in watched(cheapest.len(), monitor) {
            for row in piece?.map(|node| self.row(node)) {
                sums.iter_mut().zip(row).for_each(|(sum, cost)| *sum += f64::from(*cost));
            }
        }
        let total = |label: usize| sums[label] + self.label_cost(label as u16);
        let best = (1..self.labels).fold(0, |best, label| if total(label) < total(best) { label } else { best });
        let least = self.of_watched(&cheapest, monitor)?;
        Ok(if total(best) < least { vec![best as u16; cheapest.len()] } else { cheapest })
    }

    /// Unary costs of all labels at a node.
    fn row(&self, node: usize) -> &[f32] {
        &self.unary[node * self.labels..][..self.labels]
    }

    /// The label of least unary cost at each node, the first of equal ones.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn cheapest(&self, monitor: &Monitor) -> Result<Vec<u16>> {
        let best = |row: &[f32]| (1..row.len()).fold(0, |best, l| if row[l] < row[best] { l } else { best }) as u16;
        let mut labels = Vec::with_capacity(self.graph.len());
        for piece in watched(self.unary.len() / self.labels, monitor) {
            labels.extend(piece?.map(|node| best(self.row(node))));
        }
        Ok(labels)
    }
}

/// What every step of an algorithm needs: the energy, the edges of each node, and where to report.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) energy: Energy<'a>,
    /// Adjacency of the energy's graph; in a move with label costs that of the graph with its auxiliary nodes.
    pub(super) adjacency: &'a Adjacency,
    pub(super) monitor: &'a Monitor,
}

pub(super) fn check_strength(strength: f64) -> Result<()> {
    match strength >= 0.0 && strength.is_finite() {
        true => Ok(()),
        false => Err(Error::parameter("strength", strength, "0 or more, finite")),
    }
}
