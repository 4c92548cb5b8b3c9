//! Times α-expansion on a Potts problem on one thread, for the comparison with other libraries.
//!
//! `SCANSION_COSTS` (raw little-endian f32, nodes x labels) and `SCANSION_EDGES` (raw little-endian u32 pairs) name the
//! problem, `SCANSION_LABELS` the number of labels (8), `SCANSION_STRENGTH` the weight of every edge (0.3),
//! `SCANSION_STARTS` the number of initial labellings (2), `SCANSION_ROUNDS` the largest number of rounds, separated by
//! commas (1,100). `SCANSION_OUT` names a file for the labels (raw u16).

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_benches::words;
use scansion_core::graph::Graph;
use scansion_core::parallel::Monitor;
use scansion_core::regularisation::{ExpansionParams, Labelling, alpha_expansion};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let setting = |name: &str, default: &str| std::env::var(name).unwrap_or_else(|_| default.into());
    let costs: Vec<f32> = words("SCANSION_COSTS")?.into_iter().map(f32::from_le_bytes).collect();
    let ends: Vec<u32> = words("SCANSION_EDGES")?.into_iter().map(u32::from_le_bytes).collect();
    let pairs = ends.as_chunks::<2>().0;
    let labels: usize = setting("SCANSION_LABELS", "8").parse()?;
    let strength = setting("SCANSION_STRENGTH", "0.3").parse()?;
    let starts = setting("SCANSION_STARTS", "2").parse()?;
    let graph = Graph::new(costs.len() / labels, pairs, &vec![1.0; pairs.len()])?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(setting("SCANSION_THREADS", "1").parse()?).build()?;
    let mut last = Labelling::default();
    for rounds in setting("SCANSION_ROUNDS", "1,100").split(',') {
        let params = ExpansionParams { strength, starts, max_rounds: rounds.parse()?, ..ExpansionParams::default() };
        let start = Instant::now();
        last = pool.install(|| alpha_expansion(&costs, &graph, &params, &Monitor::default()))?;
        println!(
            "alpha-expansion, {} edges, at most {rounds} rounds: {:.3} s, energy {:.1}, converged {}, trace {:.1?}",
            graph.edges().len(),
            start.elapsed().as_secs_f64(),
            last.energy,
            last.converged,
            last.trace
        );
    }
    if let Ok(path) = std::env::var("SCANSION_OUT") {
        std::fs::write(path, last.labels.iter().flat_map(|l| l.to_le_bytes()).collect::<Vec<u8>>())?;
    }
    Ok(())
}
