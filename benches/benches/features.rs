//! Time of the features: all 16 of a level, by group, on a synthetic street and on a cloud of one's own.
//!
//! `SCANSION_XYZ` may name a file of raw little-endian f64 `x y z` in metres; `SCANSION_SCALE` its first scale (0.4).
//! Threads are those of `RAYON_NUM_THREADS`; throughput is points times levels.

#![allow(missing_docs, reason = "criterion's macro writes an undocumented function")]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use scansion_core::Cloud;
use scansion_core::cloud::MetricCloud;
use scansion_core::features::definition::{Feature, Group, Scope};
use scansion_core::features::{Extractor, FeatureSet, PyramidParams, Scratch, Wanted};
use scansion_core::parallel::Monitor;
use scansion_core::random::stream;

type Failure = Box<dyn std::error::Error>;

/// A road, two facades, poles and crowns, 200 m long.
fn street(points: usize) -> Vec<[f64; 3]> {
    let mut s = stream(11, 0);
    (0..points)
        .map(|i| {
            let (along, noise) = (s.uniform() * 200.0, (s.uniform() - 0.5) * 0.02);
            match i % 20 {
                0..10 => [along, s.uniform() * 20.0, 0.01 * along + noise],
                10..13 => [along, noise, s.uniform() * 12.0],
                13..16 => [along, 20.0 + noise, s.uniform() * 15.0],
                16 => [(along / 20.0).floor() * 20.0 + noise, 4.0 + 3.0 * noise, s.uniform() * 7.0],
                _ => {
                    let tree = (along / 10.0).floor() * 10.0;
                    [tree + s.uniform() * 5.0, 14.0 + s.uniform() * 5.0, 3.0 + s.uniform() * 5.0]
                }
            }
        })
        .collect()
}

fn own_cloud() -> Result<Option<(Cloud, f64)>, Failure> {
    let Ok(path) = std::env::var("SCANSION_XYZ") else { return Ok(None) };
    let bytes = std::fs::read(path)?;
    let values: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let scale = std::env::var("SCANSION_SCALE").map_or(Ok(0.4), |s| s.parse())?;
    Ok(Some((Cloud::from_rows(values.as_chunks::<3>().0)?, scale)))
}

/// Names of the features of these groups on all levels.
fn some(set: &FeatureSet, scale: f64, groups: &[Group]) -> Vec<String> {
    let wanted = |name: &String| {
        Feature::named(name, Scope::Level).is_some_and(|feature| groups.contains(&feature.definition().group))
    };
    set.names(scale).into_iter().filter(wanted).collect()
}

fn measure(criterion: &mut Criterion, name: &str, (cloud, scale): (&Cloud, f64)) -> Result<(), Failure> {
    let set = FeatureSet {
        pyramid: PyramidParams { first_scale: Some(scale), ..PyramidParams::default() },
        ..FeatureSet::default()
    };
    let monitor = Monitor::default();
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10).throughput(Throughput::Elements(
        (cloud.len() * set.pyramid.count(set.pyramid.first_scale.unwrap_or_default())) as u64,
    ));
    let parts: [(&str, &[Group]); 4] = [
        ("all", &[Group::Covariance, Group::Contour, Group::Height]),
        ("covariance", &[Group::Covariance]),
        ("contour", &[Group::Contour]),
        ("height", &[Group::Height]),
    ];
    let scene = MetricCloud::new(cloud, set.metres_per_unit, &monitor)?;
    for (part, groups) in parts {
        let names = some(&set, scale, groups);
        let wanted = Wanted::Names(&names);
        group.bench_function(BenchmarkId::new("prepare", part), |b| {
            b.iter(|| Extractor::prepare(&scene, &set, wanted, &monitor).map(|e| e.len()));
        });
        let extractor = Extractor::prepare(&scene, &set, wanted, &monitor)?;
        group.bench_function(BenchmarkId::new("blocks", part), |b| {
            let (mut scratch, mut rows) = (Scratch::default(), Vec::new());
            b.iter(|| {
                (0..extractor.blocks()).map(|i| extractor.block(i, &mut scratch, &mut rows).len()).sum::<usize>()
            });
        });
    }
    group.finish();
    Ok(())
}

fn features(criterion: &mut Criterion) {
    let run = |criterion: &mut Criterion| -> Result<(), Failure> {
        measure(criterion, "street", (&Cloud::from_rows(&street(200_000))?, 0.1))?;
        match own_cloud()? {
            Some((cloud, scale)) => measure(criterion, "own", (&cloud, scale)),
            None => Ok(()),
        }
    };
    if let Err(error) = run(criterion) {
        eprintln!("no features were timed: {error}");
    }
}

criterion_group!(benches, features);
criterion_main!(benches);
