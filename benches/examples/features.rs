//! Times the features of a cloud in one pass: `SCANSION_XYZ` names raw little-endian f64 `x y z` in metres,
//! `SCANSION_SCALE` the first scale (0.4), `SCANSION_LEVELS` the number of levels (9, as the thesis has), `SCANSION_PART`
//! one of all, covariance, contour, height.
//!
//! Prints nanoseconds per point and level, and a checksum of all values that shows whether a change altered any bit.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_benches::number;
use scansion_core::Cloud;
use scansion_core::cloud::MetricCloud;
use scansion_core::features::definition::{Feature, Group, Scope};
use scansion_core::features::{Extractor, FeatureSet, PyramidParams, Scratch, Wanted};
use scansion_core::parallel::Monitor;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bytes = std::fs::read(std::env::var("SCANSION_XYZ").map_err(|_| "SCANSION_XYZ is not set")?)?;
    let values: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let cloud = Cloud::from_rows(values.as_chunks::<3>().0)?;
    drop((bytes, values));
    let scale: f64 = std::env::var("SCANSION_SCALE").map_or(Ok(0.4), |s| s.parse())?;
    let levels = number("SCANSION_LEVELS", 9);
    let set = FeatureSet {
        pyramid: PyramidParams { first_scale: Some(scale), levels: Some(levels), ..PyramidParams::default() },
        ..FeatureSet::default()
    };
    let part = std::env::var("SCANSION_PART").unwrap_or_default();
    let only = [Group::Covariance, Group::Contour, Group::Height].into_iter().find(|group| group.name() == part);
    let wanted = |name: &String| {
        Feature::named(name, Scope::Level).is_some_and(|f| only.is_none_or(|group| f.definition().group == group))
    };
    let names: Vec<String> = set.names(scale).into_iter().filter(wanted).collect();
    let per = |seconds: f64| seconds * 1e9 / (cloud.len() * levels) as f64;
    let start = Instant::now();
    let monitor = Monitor::default();
    let scene = MetricCloud::new(&cloud, set.metres_per_unit, &monitor)?;
    let extractor = Extractor::prepare(&scene, &set, Wanted::Names(&names), &monitor)?;
    let prepare = start.elapsed().as_secs_f64();
    let (mut scratch, mut rows, mut sum, mut blocks) = (Scratch::default(), Vec::new(), 0u64, 0.0);
    for block in 0..extractor.blocks() {
        let start = Instant::now();
        extractor.block(block, &mut scratch, &mut rows);
        blocks += start.elapsed().as_secs_f64();
        sum = rows.iter().fold(sum, |s, v| s.rotate_left(5) ^ u64::from(v.to_bits()));
    }
    println!(
        "{} points, {levels} levels, {}: prepare {:.1}, blocks {:.1} ns per point and level; checksum {sum:016x}",
        cloud.len(),
        only.map_or("all", Group::name),
        per(prepare),
        per(blocks)
    );
    Ok(())
}
