//! Times the k nearest neighbours and the optimal neighbourhoods of a cloud: `SCANSION_XYZ` names raw little-endian f64
//! `x y z` in metres. One thread.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_core::Cloud;
use scansion_core::cloud::Points;
use scansion_core::neighbours::{OptimalParams, knn, map_optimal, optimal};
use scansion_core::parallel::Monitor;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bytes = std::fs::read(std::env::var("SCANSION_XYZ").map_err(|_| "SCANSION_XYZ is not set")?)?;
    let values: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let points = Points::from_cloud(&Cloud::from_rows(values.as_chunks::<3>().0)?, 1.0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| -> scansion_core::Result<()> {
        let rate = |start: Instant| points.len() as f64 / start.elapsed().as_secs_f64();
        for k in [0, 10, 50, 100] {
            let start = Instant::now();
            let near = knn(&points, k, &Monitor::default())?;
            let seconds = start.elapsed().as_secs_f64();
            let sum = near.indices().iter().fold(0u64, |s, &v| s.rotate_left(5) ^ u64::from(v));
            println!("knn k={k}: {seconds:.3} s, {:.0} points/s, checksum {sum:016x}", points.len() as f64 / seconds);
            if k >= 50 {
                let params = OptimalParams { k_max: k, ..OptimalParams::default() };
                let start = Instant::now();
                let chosen = optimal(&points, &near, &params, &Monitor::default())?;
                let mean = chosen.iter().map(|c| f64::from(c.k)).sum::<f64>() / points.len() as f64;
                println!("optimal k=10..{k}, neighbours given: {:.0} points/s, mean k {mean:.2}", rate(start));
                drop((near, chosen));
                let start = Instant::now();
                let chosen = map_optimal(&points, &params, &Monitor::default(), |o| o.k)?;
                println!("optimal k=10..{k}, neighbours too: {:.0} points/s, {} points", rate(start), chosen.len());
            }
        }
        Ok(())
    })?;
    Ok(())
}
