//! The conditional random field: a label for each node of a graph.

use super::params::RegulariseParams;
use crate::error::Result;
use crate::graph::{Graph, connected_components};
use crate::parallel::Monitor;
use crate::regularisation::{ExpansionParams, Labelling, alpha_expansion};

/// The labelling of lowest energy found by α-expansion. `costs` are the unary costs, row-major `nodes x classes`.
pub(super) fn field(costs: &[f32], graph: &Graph, params: &RegulariseParams, monitor: &Monitor) -> Result<Labelling> {
    match params.strength.is_finite() {
        true => {
            let RegulariseParams { strength, starts, .. } = *params;
            let expansion = ExpansionParams { strength, starts, ..ExpansionParams::default() };
            alpha_expansion(costs, graph, &expansion, monitor)
        }
        false => of_components(costs, graph, monitor),
    }
}

/// The labelling of an infinitely strong field: each connected component has the label of the lowest total cost.
fn of_components(costs: &[f32], graph: &Graph, monitor: &Monitor) -> Result<Labelling> {
    let classes = (costs.len() / graph.len().max(1)).max(1);
    let components = connected_components(graph, monitor)?;
    let mut sums = vec![0.0f64; components.count * classes];
    for (row, &component) in costs.chunks_exact(classes).zip(&components.of) {
        let sum = &mut sums[component as usize * classes..][..classes];
        sum.iter_mut().zip(row).for_each(|(sum, &cost)| *sum += f64::from(cost));
    }
    let cheapest = |row: &[f64]| (1..row.len()).fold(0, |best, c| if row[c] < row[best] { c } else { best });
    let best: Vec<usize> = sums.chunks_exact(classes).map(cheapest).collect();
    let energy = best.iter().enumerate().map(|(component, &label)| sums[component * classes + label]).sum();
    let labels = components.of.iter().map(|&component| best[component as usize] as u16).collect();
    Ok(Labelling { labels, energy, trace: vec![energy], converged: true })
}
