//! Problems for the tests of this folder.

use super::{Energy, ExpansionParams, Labelling};
use crate::graph::Graph;
use crate::random::stream;

pub(super) struct Instance {
    pub(super) unary: Vec<f32>,
    pub(super) graph: Graph,
    pub(super) labels: usize,
}

/// Random whole-numbered costs below 20 and weights below 8; 2 random edges a node.
pub(super) fn random(seed: u64, nodes: usize, labels: usize) -> Instance {
    let mut random = stream(seed, 11);
    let mut draw = |bound: usize| (random.uniform() * bound as f64) as u32;
    let unary = (0..nodes * labels).map(|_| draw(20) as f32).collect();
    let mut pairs = Vec::new();
    for _ in 0..2 * nodes {
        let (a, b) = (draw(nodes), draw(nodes));
        if a != b {
            pairs.push([a, b]);
        }
    }
    let weights: Vec<f32> = pairs.iter().map(|_| draw(8) as f32).collect();
    Instance { unary, graph: Graph::new(nodes, &pairs, &weights).unwrap(), labels }
}

fn generator(mut state: u64) -> impl FnMut(u64) -> f32 {
    move |bound| {
        state = (1_103_515_245 * state + 12_345) % (1 << 31);
        (state / 65_536 % bound) as f32
    }
}

/// A grid of 40 x 40 nodes whose costs and weights come from a generator that is easy to repeat in another language: `s
/// = (1103515245 s + 12345) mod 2^31` from s = labels, each draw s / 65536; costs `draw mod 100`, then for every edge
/// to the right and below, node by node, `draw mod 20`.
pub(super) fn oracle(labels: usize) -> Instance {
    let mut draw = generator(labels as u64);
    let unary = (0..1600 * labels).map(|_| draw(100)).collect();
    let (mut pairs, mut weights) = (Vec::new(), Vec::new());
    for node in 0..1600u32 {
        for (other, inside) in [(node + 1, node % 40 < 39), (node + 40, node < 1560)] {
            if inside {
                pairs.push([node, other]);
                weights.push(draw(20));
            }
        }
    }
    Instance { unary, graph: Graph::new(1600, &pairs, &weights).unwrap(), labels }
}

/// Grids of 20 x 20 nodes, chains of 600, complete graphs of 30 and rings of 300 with edges to the next node, the 7th and the
/// 31st, for seeds 0, 1, 2, 3 and so on. The generator begins with seed + 1; costs `draw mod 100` node by node, then for every
/// edge, in the order of its first node, `1 + draw mod` 20, 40, 1 or 20.
pub(super) fn mixed(seed: usize) -> Instance {
    let mut draw = generator(seed as u64 + 1);
    let (kind, labels) = (seed % 4, [3, 5, 8, 4, 12, 2, 6][seed % 7]);
    let nodes = [400, 600, 30, 300][kind];
    let ends = |i: u32| -> Vec<u32> {
        match kind {
            0 => [(i + 1, i % 20 < 19), (i + 20, i < 380)].into_iter().filter(|e| e.1).map(|e| e.0).collect(),
            1 => (i + 1..600.min(i + 2)).collect(),
            2 => (i + 1..30).collect(),
            _ => [1, 7, 31].map(|step| (i + step) % 300).to_vec(),
        }
    };
    let unary = (0..nodes * labels).map(|_| draw(100)).collect();
    let pairs: Vec<[u32; 2]> = (0..nodes as u32).flat_map(|i| ends(i).into_iter().map(move |j| [i, j])).collect();
    let weights: Vec<f32> = pairs.iter().map(|_| 1.0 + draw([20, 40, 1, 20][kind])).collect();
    Instance { unary, graph: Graph::new(nodes, &pairs, &weights).unwrap(), labels }
}

/// Distance |a - b|, at most 2.
pub(super) fn truncated_linear(labels: usize) -> Vec<f32> {
    (0..labels * labels).map(|at| (at / labels).abs_diff(at % labels).min(2) as f32).collect()
}

impl Instance {
    pub(super) fn energy<'a>(&'a self, params: &'a ExpansionParams) -> Energy<'a> {
        let energy = Energy::new(&self.unary, &self.graph, params.strength, &params.pairwise).unwrap();
        assert_eq!(energy.labels, self.labels);
        energy.with_label_costs(&params.label_costs).unwrap()
    }

    /// Checks that the result reports its own energy, that the energy never rose, and that the search converged.
    pub(super) fn verify(&self, params: &ExpansionParams, result: &Labelling) {
        assert!((result.energy - self.energy(params).of(&result.labels)).abs() < 1e-9);
        assert!(result.trace.windows(2).all(|w| w[1] <= w[0]), "the energy rose: {:?}", result.trace);
        assert!(result.converged);
    }

    /// The minimum over all labellings.
    pub(super) fn optimum(&self, params: &ExpansionParams) -> f64 {
        let (n, k) = (self.graph.len(), self.labels);
        let energy = self.energy(params);
        let labelling = |code: usize| (0..n).map(|i| (code / k.pow(i as u32) % k) as u16).collect::<Vec<_>>();
        (0..k.pow(n as u32)).map(|code| energy.of(&labelling(code))).fold(f64::INFINITY, f64::min)
    }
}
