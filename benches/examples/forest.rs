//! Times training and prediction on a table of features, for comparison with other libraries.
//!
//! `SCANSION_FEATURES` (raw little-endian f32, row-major) and `SCANSION_LABELS` (one byte a row) name the table,
//! `SCANSION_WIDTH` its number of features, `SCANSION_TREES` the number of trees, `SCANSION_ROWS` (`all`, `most`,
//! `fifth`) the rows for training; the accuracy is that on the rows `5 i` (`5 i + 1` with `fifth`).

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_benches::{Table, number};
use scansion_core::classification::{Forest, ForestParams, Predictor, Samples};
use scansion_core::parallel::Monitor;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Table { values, width, labels, classes } = Table::read()?;
    let trees = number("SCANSION_TREES", 4);
    let all = Samples { features: &values, width, labels: &labels, weights: None, classes };
    let kept: Vec<f32> = (0..labels.len()).map(|i| f32::from(u8::from(i % 5 != 0))).collect();
    let most = Samples { weights: Some(&kept), ..all };
    let others: Vec<f32> = kept.iter().map(|w| 1.0 - w).collect();
    let fifth = Samples { weights: Some(&others), ..all };
    let breiman = ForestParams { trees, max_depth: Some(30), ..ForestParams::breiman() };
    let ethz = ForestParams { trees, ..ForestParams::ethz() };
    let sets = match std::env::var("SCANSION_ROWS").as_deref() {
        Ok("fifth") => vec![("breiman, 1 of 5", fifth, &breiman)],
        Ok("most") => vec![("breiman, 4 of 5", most, &breiman), ("ethz, 4 of 5", most, &ethz)],
        _ => vec![("breiman, all rows", all, &breiman)],
    };
    for (name, samples, params) in sets {
        let start = Instant::now();
        let forest = Forest::fit(&samples, params, &Monitor::default())?;
        let fit = start.elapsed().as_secs_f64();
        let mut out = vec![0.0; labels.len() * classes];
        let (mut predict, mut label) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..number("SCANSION_REPEATS", 3) {
            let start = Instant::now();
            forest.predict_proba(&values, &mut out)?;
            predict = predict.min(start.elapsed().as_secs_f64());
            let start = Instant::now();
            std::hint::black_box(forest.predict(&values)?);
            label = label.min(start.elapsed().as_secs_f64());
        }
        let best = |row: &[f32]| (1..row.len()).fold(0, |b, c| if row[c] > row[b] { c } else { b });
        let right = (usize::from(samples.weights == fifth.weights)..labels.len())
            .step_by(5)
            .filter(|&i| best(&out[i * classes..][..classes]) == usize::from(labels[i]));
        let accuracy = right.count() as f64 / labels.len().div_ceil(5) as f64;
        println!(
            "{name}: fit {:.3} s a tree, predict {:.3} s ({:.0} rows/s/tree), labels alone {label:.3} s, {} nodes, accuracy {accuracy:.4}",
            fit / trees as f64,
            predict,
            (labels.len() * trees) as f64 / predict,
            forest.nodes()
        );
    }
    Ok(())
}
