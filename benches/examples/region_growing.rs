//! Times the k nearest neighbours, normals and region growing of a cloud on one thread, in seconds of the processor.
//!
//! `SCANSION_XYZ` names raw little-endian f32 rows, `SCANSION_ROW` numbers a row (3: x y z; 7: x y z and, for a peer that is
//! given normals, nx ny nz variation, used here as well), `SCANSION_K` the numbers of neighbours (`10,30,45`; regions are grown
//! with 29: the neighbourhoods of 30 points of a peer that counts the point itself), `SCANSION_RUNS` how often. `SCANSION_OUT`
//! names a file for rows of seven for the peer; `SCANSION_OPTIMAL` and `SCANSION_ORIENT` ask for more.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_core::cloud::{LocalFrame, Points, Positions};
use scansion_core::features::{Normals, normals};
use scansion_core::graph::Orientation;
use scansion_core::neighbours::{OptimalParams, knn, map_optimal};
use scansion_core::parallel::Monitor;
use scansion_core::segmentation::{RegionGrowingParams, region_growing};

type Outcome<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

fn main() -> Outcome<()> {
    let var = |name: &str, other: &str| std::env::var(name).unwrap_or_else(|_| other.to_owned());
    let bytes = std::fs::read(std::env::var("SCANSION_XYZ").map_err(|_| "SCANSION_XYZ is not set")?)?;
    let values: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let rows: Vec<&[f32]> = values.chunks_exact(var("SCANSION_ROW", "7").parse()?).collect();
    let positions: Positions = rows.iter().map(|r| [r[0], r[1], r[2]]).collect();
    // The orientation of normals takes points with an origin, which is 0 here.
    let frame = LocalFrame { index: (0..rows.len() as u32).collect(), origin: [0.0; 3] };
    let points = Points { positions, frame };
    let wanted: Vec<usize> = var("SCANSION_K", "10,30,45").split(',').map(str::parse).collect::<Result<_, _>>()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    for _ in 0..var("SCANSION_RUNS", "1").parse()? {
        for &k in &wanted {
            pool.install(|| search(&points.positions, k))?;
        }
        pool.install(|| grow(&points, &rows))?;
    }
    Ok(())
}

/// Seconds of the processor of all threads so far.
fn seconds() -> f64 {
    let spent = |task: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse().ok()
    };
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    tasks.filter_map(spent).sum::<f64>() * 1e-9
}

fn search(points: &Positions, k: usize) -> Outcome<()> {
    let start = seconds();
    let near = knn(points, k, &Monitor::default())?;
    let spent = seconds() - start;
    let sum = near.indices().iter().fold(0u64, |s, &v| s.rotate_left(5) ^ u64::from(v));
    println!("{k} nearest: {:.0} ns a point; checksum {sum:016x}", spent * 1e9 / points.len() as f64);
    if std::env::var("SCANSION_OPTIMAL").is_ok() {
        let params = OptimalParams { k_min: 10.min(k), k_max: k, ..OptimalParams::default() };
        let start = seconds();
        let chosen = map_optimal(points, &params, &Monitor::default(), |o| o.k)?;
        let spent = seconds() - start;
        let sum = chosen.iter().map(|&k| u64::from(k)).sum::<u64>();
        println!("optimal of 10..={k}: {:.0} ns a point; sum {sum}", spent * 1e9 / points.len() as f64);
    }
    Ok(())
}

fn grow(points: &Points, rows: &[&[f32]]) -> Outcome<()> {
    let (monitor, start) = (Monitor::default(), seconds());
    let near = knn(&points.positions, 29, &monitor)?;
    let searched = seconds();
    let own = normals(&points.positions, &near, &monitor)?;
    let described = seconds();
    let given = rows.iter().all(|r| r.len() >= 7).then(|| Normals {
        directions: rows.iter().map(|r| [r[3], r[4], r[5]]).collect(),
        variation: rows.iter().map(|r| r[6]).collect(),
    });
    let began = seconds();
    let params = RegionGrowingParams { min_size: 50, ..RegionGrowingParams::default() };
    let found = region_growing(&near, given.as_ref().unwrap_or(&own), &params, &monitor)?;
    let end = seconds();
    let inside = found.labels.iter().filter(|l| **l > 0).count();
    let sum = found.labels.iter().fold(0u64, |s, &v| s.rotate_left(5) ^ u64::from(v));
    println!("{} regions, {inside} points inside, checksum {sum:016x}", found.count);
    let [search, normal, growing] = [searched - start, described - searched, end - began];
    println!("knn {search:.3} s, normals {normal:.3} s, growing {growing:.3} s");
    println!("with given normals {:.3} s, with own {:.3} s", search + growing, search + normal + growing);
    if let Ok(path) = std::env::var("SCANSION_OUT") {
        let row = |i: usize| {
            let ([x, y, z], [u, v, w]) = (points.positions.xyz(i), own.directions[i]);
            [x, y, z, u, v, w, own.variation[i]]
        };
        let bytes: Vec<u8> = (0..points.len()).flat_map(row).flat_map(f32::to_le_bytes).collect();
        std::fs::write(path, bytes)?;
    }
    if std::env::var("SCANSION_ORIENT").is_ok() {
        let (mut directions, start) = (own.directions, seconds());
        Orientation::SpanningTree.orient(points, &near, &mut directions, &monitor)?;
        println!("orient {:.3} s", seconds() - start);
    }
    Ok(())
}
