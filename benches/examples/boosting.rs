//! Times boosting on a table of features and evaluates it on held-out rows, for comparison with other libraries.
//!
//! `SCANSION_FEATURES` (raw little-endian f32, row-major) and `SCANSION_LABELS` (one byte a row) name the table,
//! `SCANSION_WIDTH` its number of features, `SCANSION_ROUNDS` the number of rounds, `SCANSION_LAMBDA` the penalty (0).
//! If `SCANSION_ROWS` is `most`, the rows `5 i` are held out; otherwise all rows are used for training and evaluation.
//! `SCANSION_OUT` names a file for the probabilities.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_benches::{Table, number};
use scansion_core::classification::{Boosting, BoostingParams, Predictor, Samples};
use scansion_core::parallel::Monitor;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Table { values, width, labels, classes } = Table::read()?;
    let most = std::env::var("SCANSION_ROWS").as_deref() == Ok("most");
    let kept: Vec<f32> = (0..labels.len()).map(|i| f32::from(u8::from(!most || i % 5 != 0))).collect();
    let samples = Samples { features: &values, width, labels: &labels, weights: Some(&kept), classes };
    let rounds = number("SCANSION_ROUNDS", 50);
    let (max_leaves, lambda) = (number("SCANSION_LEAVES", 31), number("SCANSION_LAMBDA", 0) as f64);
    let params = BoostingParams { rounds, max_leaves, lambda, ..BoostingParams::default() };
    let start = Instant::now();
    let model = Boosting::fit(&samples, &params, &Monitor::default())?;
    let fit = start.elapsed().as_secs_f64();
    let mut out = vec![0.0; labels.len() * classes];
    let mut predict = f64::INFINITY;
    for _ in 0..number("SCANSION_REPEATS", 3) {
        let start = Instant::now();
        model.predict_proba(&values, &mut out)?;
        predict = predict.min(start.elapsed().as_secs_f64());
    }
    let judged: Vec<usize> = (0..labels.len()).step_by(if most { 5 } else { 1 }).collect();
    let row = |i: usize| &out[i * classes..][..classes];
    let best = |row: &[f32]| (1..row.len()).fold(0, |b, c| if row[c] > row[b] { c } else { b });
    let right = judged.iter().filter(|&&i| best(row(i)) == usize::from(labels[i])).count();
    let loss: f64 = judged.iter().map(|&i| -f64::from(row(i)[usize::from(labels[i])].max(1e-15)).ln()).sum();
    let count = judged.len() as f64;
    println!(
        "fit {fit:.2} s, predict {predict:.3} s ({:.0} rows/s), {} nodes, loss {:.5}, accuracy {:.5}",
        labels.len() as f64 / predict,
        model.nodes(),
        loss / count,
        right as f64 / count
    );
    if let Ok(path) = std::env::var("SCANSION_OUT") {
        std::fs::write(path, out.iter().flat_map(|p| p.to_le_bytes()).collect::<Vec<_>>())?;
    }
    Ok(())
}
