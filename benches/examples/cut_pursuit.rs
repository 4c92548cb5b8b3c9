//! Times merging and cut pursuit on a graph with values, for the comparison with other libraries.
//!
//! `SCANSION_VALUES` (raw little-endian f32, row-major) and `SCANSION_EDGES` (raw little-endian u32 pairs) name the
//! problem, `SCANSION_WIDTH` the values a node (4), `SCANSION_STRENGTH` the strengths, separated by commas;
//! `SCANSION_PUBLISHED` asks for the method of the paper too.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_benches::words;
use scansion_core::graph::Graph;
use scansion_core::parallel::Monitor;
use scansion_core::segmentation::{CutPursuitParams, MergeParams, Signal, cut_pursuit, merge};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let setting = |name: &str, default: &str| std::env::var(name).unwrap_or_else(|_| default.into());
    let values: Vec<f32> = words("SCANSION_VALUES")?.into_iter().map(f32::from_le_bytes).collect();
    let ends: Vec<u32> = words("SCANSION_EDGES")?.into_iter().map(u32::from_le_bytes).collect();
    let pairs: Vec<[u32; 2]> = ends.chunks_exact(2).map(|e| [e[0], e[1]]).collect();
    let signal = Signal::new(&values, setting("SCANSION_WIDTH", "4").parse()?)?;
    let graph = Graph::new(signal.len(), &pairs, &vec![1.0; pairs.len()])?;
    for strength in setting("SCANSION_STRENGTH", "0.05,0.2").split(',') {
        let strength = strength.parse()?;
        let start = Instant::now();
        let merged = merge(&signal, &graph, &MergeParams { strength, ..MergeParams::default() }, &Monitor::default())?;
        println!(
            "merge, strength {strength}: {:.3} s, {} segments, energy {:.1}",
            start.elapsed().as_secs_f64(),
            merged.partition.len(),
            merged.energy
        );
        let params = CutPursuitParams { strength, ..CutPursuitParams::default() };
        let mut runs = vec![("cut pursuit", params.clone())];
        if std::env::var("SCANSION_PUBLISHED").is_ok() {
            runs.push(("cut pursuit as published", params.as_published()));
        }
        for (name, params) in runs {
            let start = Instant::now();
            let found = cut_pursuit(&signal, &graph, &params, &Monitor::default())?;
            println!(
                "{name}, strength {strength}: {:.3} s, {} segments, energy {:.1}, trace {:.1?}",
                start.elapsed().as_secs_f64(),
                found.partition.len(),
                found.energy,
                found.trace
            );
        }
    }
    Ok(())
}
