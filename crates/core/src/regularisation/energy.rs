//! What is minimised: costs of labels at nodes, and of different labels at the ends of edges.

use crate::error::{Error, Result};
use crate::graph::Graph;

/// Distance of two labels.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pairwise {
    /// 0 for equal labels, 1 for different ones.
    #[default]
    Potts,
    /// Row-major `labels x labels`: 0 on the diagonal, symmetric, no detour shorter than the direct way.
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

    /// Verifies that the distances are a metric on `labels` labels. O(labels³).
    ///
    /// # Errors
    /// Names the labels that break a rule.
    pub fn check(&self, labels: usize) -> Result<()> {
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
            let slack = 1e-6 * v(a, b);
            if let Some(c) = (0..labels).find(|&c| v(a, c) + v(c, b) + slack < v(a, b)) {
                return Err(Error::input(format!("labels {a} and {b} are nearer by way of {c}: no metric")));
            }
        }
        Ok(())
    }
}

/// The costs of a labelling problem.
#[derive(Clone, Copy, Debug)]
pub struct Energy<'a> {
    /// Row-major `nodes x labels`: what each label costs at each node; finite, of any sign.
    pub unary: &'a [f32],
    /// Number of labels.
    pub labels: usize,
    /// Edges between nodes and their weights.
    pub graph: &'a Graph,
    /// Factor of all weights, 0 or more.
    pub strength: f64,
    /// Distance of labels.
    pub pairwise: &'a Pairwise,
}

impl Energy<'_> {
    /// Verifies that the parts fit together. O(nodes · labels + labels³).
    ///
    /// # Errors
    /// Lengths that do not fit, a cost that is not finite, a strength below 0 or not finite, distances that are no metric.
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
        if !(self.strength >= 0.0 && self.strength.is_finite()) {
            return Err(Error::parameter("strength", self.strength, "0 or more, finite"));
        }
        self.pairwise.check(self.labels)
    }

    /// Cost of `label` at `node`.
    #[inline]
    pub fn cost(&self, node: usize, label: u16) -> f64 {
        f64::from(self.unary[node * self.labels + usize::from(label)])
    }

    /// Cost of edge `edge` if its ends have labels `a` and `b`.
    #[inline]
    pub fn edge_cost(&self, edge: usize, a: u16, b: u16) -> f64 {
        self.strength * f64::from(self.graph.weights()[edge]) * self.pairwise.distance(a, b, self.labels)
    }

    /// Energy of a labelling, summed in the order of nodes, then edges.
    pub fn of(&self, labels: &[u16]) -> f64 {
        let nodes: f64 = labels.iter().enumerate().map(|(node, &label)| self.cost(node, label)).sum();
        let edges = self.graph.edges().iter().enumerate();
        nodes + edges.map(|(e, &[i, j])| self.edge_cost(e, labels[i as usize], labels[j as usize])).sum::<f64>()
    }

    /// The cheapest label of every node by itself, the first of equals.
    pub fn cheapest(&self) -> Vec<u16> {
        let best = |row: &[f32]| (1..row.len()).fold(0, |best, l| if row[l] < row[best] { l } else { best }) as u16;
        self.unary.chunks_exact(self.labels).map(best).collect()
    }
}
