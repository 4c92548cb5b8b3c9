//! Times the k nearest neighbours and the optimal neighbourhoods of a cloud on one thread: `SCANSION_XYZ` names raw
//! little-endian f64 `x y z` in metres, `SCANSION_K` the numbers of neighbours (`10,100`).
//!
//! `SCANSION_OUT` names a folder for what was found with the last of them, raw and little-endian: `near.u32` (k indices a
//! point) and `optimal.f32` (k*, linearity, planarity, scattering, verticality of every point), to compare with a peer.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_core::Cloud;
use scansion_core::cloud::{Points, Positions};
use scansion_core::features::optimal_features;
use scansion_core::neighbours::{Neighbours, OptimalParams, knn, optimal};
use scansion_core::parallel::Monitor;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bytes = std::fs::read(std::env::var("SCANSION_XYZ").map_err(|_| "SCANSION_XYZ is not set")?)?;
    let values: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let points = Points::from_cloud(&Cloud::from_rows(values.as_chunks::<3>().0)?, 1.0).positions;
    let wanted = std::env::var("SCANSION_K").unwrap_or_else(|_| "10,100".to_owned());
    let wanted: Vec<usize> = wanted.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut last = None;
    for k in wanted {
        let near = pool.install(|| search(&points, k))?;
        if k > OptimalParams::default().k_min {
            last = Some((pool.install(|| describe(&points, &near, k))?, near));
        }
    }
    if let (Ok(folder), Some((rows, near))) = (std::env::var("SCANSION_OUT"), last) {
        let folder = std::path::Path::new(&folder);
        std::fs::write(folder.join("optimal.f32"), rows.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
        let index = near.indices().iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        std::fs::write(folder.join("near.u32"), index)?;
    }
    Ok(())
}

fn rate(points: &Positions, start: Instant) -> f64 {
    points.len() as f64 / start.elapsed().as_secs_f64()
}

fn search(points: &Positions, k: usize) -> scansion_core::Result<Neighbours> {
    let start = Instant::now();
    let near = knn(points, k, &Monitor::default())?;
    let sum = near.indices().iter().fold(0u64, |s, &v| s.rotate_left(5) ^ u64::from(v));
    println!("{k} nearest: {:.0} points/s; checksum {sum:016x}", rate(points, start));
    Ok(near)
}

fn describe(points: &Positions, near: &Neighbours, k: usize) -> scansion_core::Result<Vec<f32>> {
    let params = OptimalParams { k_max: k, ..OptimalParams::default() };
    let start = Instant::now();
    let chosen = optimal(points, near, &params, &Monitor::default())?;
    println!("optimal of 10..{k}, neighbours given: {:.0} points/s", rate(points, start));
    drop(chosen);
    let start = Instant::now();
    let found = optimal_features(points, &params, &Monitor::default())?;
    println!("optimal of 10..{k} and descriptors, with the search: {:.0} points/s", rate(points, start));
    let rows = found.k.iter().zip(found.table.values.as_chunks::<4>().0);
    Ok(rows.flat_map(|(&k, row)| std::iter::once(k as f32).chain(*row)).collect())
}
