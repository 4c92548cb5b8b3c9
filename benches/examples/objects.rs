//! Prints the tables of `docs/supervoxels.md` and `docs/objects-results.md`.
//!
//! `objects CLOUD TABLE [POINTS]` where TABLE is `speed` (supervoxels alone), `modes` (both kinds by size), `sweep`
//! (parameters of the local graphs), `neighbours` (segmentation error by N), `chain` (all stages, classified by three
//! classifiers), `segments` (writes `supervoxels.laz` and `segments.laz` with a column `ClusterID`), or `dump` (writes
//! `points.f32`: x y z, normal, colour of each point, for other programs). POINTS cuts the cloud to that many around its
//! middle. `SCANSION_METRES` is the metres of a unit where the file does not say, `SCANSION_SIZE` S (1.2), `SCANSION_VOXEL` R_voxel (S/4), `SCANSION_CELL` that of the error (0.3),
//! `SCANSION_IGNORE` classes that count as unlabelled, separated by commas, `SCANSION_MAP` classes that count as others
//! (`3=5,4=5`), `SCANSION_MODE` the supervoxels of the tables that use them: slic, connected, vccs.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_core::classification::{
    BaggingParams, BoostingParams, ClassifierParams, ForestParams, Predictor, Samples,
};
use scansion_core::cloud::{Cloud, Column, Points, Values};
use scansion_core::evaluation::{
    Confusion, EmptyCells, LabelledPartition, OneVsRest, SegmentationErrorParams, oracle_accuracy, segmentation_error,
};
use scansion_core::features::normals;
use scansion_core::graph::Orientation;
use scansion_core::neighbours::knn;
use scansion_core::parallel::Monitor;
use scansion_core::random::stream;
use scansion_core::segmentation::{
    Combination, LocalGraphParams, ObjectAttributes, Partition, PointAttributes, SlicParams, Supervoxels, SurfaceRule,
    VccsParams, local_graphs, majorities, object_features, slic, vccs,
};
use scansion_core::terrain::{ElevationModel, ElevationParams, GroundParams, ground_points};
use scansion_core::{Result, io};
use std::path::Path;
use std::time::Instant;

type Outcome = std::result::Result<(), Box<dyn std::error::Error>>;

/// A cloud with what the stages need.
struct Scene {
    cloud: Cloud,
    points: Points,
    normals: Vec<[f32; 3]>,
    colours: Option<Vec<[f32; 3]>>,
    truth: Vec<Option<u8>>,
    size: f64,
    voxel: f64,
    cell: f64,
}

fn setting(name: &str, default: f64) -> std::result::Result<f64, std::num::ParseFloatError> {
    std::env::var(name).map_or(Ok(default), |s| s.parse())
}

impl Scene {
    fn read(path: &Path, most: usize) -> std::result::Result<Self, Box<dyn std::error::Error>> {
        let whole = io::read(path)?;
        let metres = setting("SCANSION_METRES", whole.metres_per_unit.unwrap_or(1.0))?;
        let cloud = whole.select(&middle(&Points::from_cloud(&whole, metres), most));
        let start = Instant::now();
        let points = Points::from_cloud(&cloud, metres);
        let monitor = Monitor::default();
        let near = knn(&points.positions, 10, &monitor)?;
        let mut found = normals(&points.positions, &near, &monitor)?;
        let described = start.elapsed().as_secs_f64();
        Orientation::Up.orient(&points, &near, &mut found.directions, &monitor)?;
        let (colours, truth) = (colours(&cloud, &points), truth(&cloud, &points));
        println!("{}: {} points, neighbours and normals in {described:.2} s", path.display(), points.len());
        let size = setting("SCANSION_SIZE", 1.2)?;
        Ok(Self {
            cloud,
            points,
            normals: found.directions,
            colours,
            truth,
            size,
            voxel: setting("SCANSION_VOXEL", size / 4.0)?,
            cell: setting("SCANSION_CELL", 0.3)?,
        })
    }

    fn attributes(&self) -> PointAttributes<'_> {
        PointAttributes { normals: Some(&self.normals), colours: self.colours.as_deref() }
    }

    fn slic(&self, connected: bool) -> Result<Supervoxels> {
        let params = SlicParams { size: self.size, connected, ..SlicParams::default() };
        slic(&self.points.positions, &self.attributes(), &params, &Monitor::default())
    }

    fn vccs(&self, refinements: usize) -> Result<Supervoxels> {
        let params = VccsParams { size: self.size, voxel: self.voxel, refinements, ..VccsParams::default() };
        vccs(&self.points.positions, &self.attributes(), &params, &Monitor::default())
    }

    /// SLIC, or what `SCANSION_MODE` asks for.
    fn supervoxels(&self) -> Result<Supervoxels> {
        match std::env::var("SCANSION_MODE").as_deref() {
            Ok("vccs") => self.vccs(1),
            Ok("connected") => self.slic(true),
            _ => self.slic(false),
        }
    }

    fn oracle(&self, partition: &Partition) -> Result<f64> {
        Ok(100.0 * oracle_accuracy(partition, &self.truth)?.unwrap_or(f64::NAN))
    }

    fn error(&self, partition: &Partition, empty: EmptyCells) -> Result<scansion_core::evaluation::SegmentationError> {
        let params = SegmentationErrorParams { cell: self.cell, empty };
        segmentation_error(
            LabelledPartition { points: &self.points.positions, partition, truth: &self.truth },
            &params,
            &Monitor::default(),
        )
    }
}

/// The points nearest to the middle by the larger of the two distances in plan, ascending.
fn middle(points: &Points, most: usize) -> Vec<u32> {
    let centre = |axis: &[f32]| {
        let (low, high) = axis.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
        (low + high) / 2.0
    };
    let (x, y) = (centre(&points.positions.x), centre(&points.positions.y));
    let far = |i: usize| (points.positions.x[i] - x).abs().max((points.positions.y[i] - y).abs());
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| far(a).total_cmp(&far(b)));
    let mut kept: Vec<u32> = order.iter().take(most).map(|&i| points.frame.index[i]).collect();
    kept.sort_unstable();
    kept
}

fn colours(cloud: &Cloud, points: &Points) -> Option<Vec<[f32; 3]>> {
    let channels = ["Red", "Green", "Blue"].map(|name| cloud.column(name).map(|c| c.values.to_f32()));
    let [Some(r), Some(g), Some(b)] = channels else { return None };
    let most = [&r, &g, &b].into_iter().flatten().fold(0.0f32, |m, &v| m.max(v));
    let full = if most < 256.0 { 255.0 } else { 65535.0 };
    Some(points.frame.index.iter().map(|&i| [&r, &g, &b].map(|c| c[i as usize] / full)).collect())
}

fn truth(cloud: &Cloud, points: &Points) -> Vec<Option<u8>> {
    let ignored = std::env::var("SCANSION_IGNORE").unwrap_or_default();
    let ignored: Vec<u8> = ignored.split(',').filter_map(|c| c.parse().ok()).collect();
    let mapped = std::env::var("SCANSION_MAP").unwrap_or_default();
    let mapped: Vec<(u8, u8)> = mapped
        .split(',')
        .filter_map(|m| m.split_once('='))
        .filter_map(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)))
        .collect();
    let codes = cloud.column("Classification").map(|c| c.values.to_f32());
    let map = |code: u8| mapped.iter().find(|m| m.0 == code).map_or(code, |m| m.1);
    let code = |i: &u32| codes.as_ref().map(|c| map(c[*i as usize] as u8)).filter(|c| !ignored.contains(c));
    points.frame.index.iter().map(code).collect()
}

fn timed<T>(work: impl FnOnce() -> Result<T>) -> Result<(T, f64)> {
    let start = Instant::now();
    let found = work()?;
    Ok((found, start.elapsed().as_secs_f64()))
}

fn speed(scene: &Scene) -> Outcome {
    for _ in 0..3 {
        for (name, run) in runs(scene) {
            let (found, seconds) = timed(run)?;
            let rate = scene.points.len() as f64 / seconds / 1e6;
            println!("{name}: {seconds:.3} s, {rate:.2} M points/s, {} supervoxels", found.len());
        }
    }
    Ok(())
}

type Run<'a> = Box<dyn FnOnce() -> Result<Supervoxels> + 'a>;

fn runs(scene: &Scene) -> Vec<(&'static str, Run<'_>)> {
    vec![
        ("slic", Box::new(|| scene.slic(false))),
        ("slic, connected", Box::new(|| scene.slic(true))),
        ("vccs, no refinement", Box::new(|| scene.vccs(0))),
        ("vccs, 1 refinement", Box::new(|| scene.vccs(1))),
        ("vccs, 3 refinements", Box::new(|| scene.vccs(3))),
    ]
}

fn modes(scene: &mut Scene) -> Outcome {
    println!("mode | S | supervoxels | points without | oracle accuracy % | error | precision | s");
    let first = scene.size;
    for factor in [0.5, 1.0, 2.0] {
        (scene.size, scene.voxel) = (first * factor, (first * factor / 4.0).max(scene.voxel));
        for (name, run) in runs(scene) {
            let (found, seconds) = timed(run)?;
            let partition = found.partition(&Monitor::default())?;
            let lost = scene.points.len() - (0..found.len()).map(|s| found.members(s).len()).sum::<usize>();
            let (oracle, error) = (scene.oracle(&partition)?, scene.error(&partition, EmptyCells::Ignored)?);
            let (size, count) = (scene.size, found.len());
            println!(
                "{name} | {size} | {count} | {lost} | {oracle:.2} | {:.4} | {:.4} | {seconds:.2}",
                error.error, error.precision
            );
        }
    }
    Ok(())
}

fn sweep(scene: &Scene) -> Outcome {
    let supervoxels = scene.supervoxels()?;
    println!(
        "{} supervoxels, oracle {:.2} %",
        supervoxels.len(),
        scene.oracle(&supervoxels.partition(&Monitor::default())?)?
    );
    println!("λp/S | λs | k | surface | combination | isolated | segments | oracle % | error | precision | largest %");
    let default = LocalGraphParams::default;
    let mut all = Vec::new();
    for (distance_scale, feature_scale, k) in [
        (1.0, 0.2, 0.5),
        (1.0, 0.2, 0.9),
        (1.0, 0.8, 0.9),
        (2.0, 0.4, 0.7),
        (2.0, 0.8, 0.7),
        (2.0, 0.8, 0.9),
        (2.0, 0.8, 1.1),
    ] {
        let params = LocalGraphParams { distance_scale, feature_scale, k, attach_isolated: false, ..default() };
        all.push(LocalGraphParams { combination: Combination::Union, ..params.clone() });
        all.push(LocalGraphParams { surface: SurfaceRule::Paper, ..params.clone() });
        all.push(LocalGraphParams { attach_isolated: true, ..params.clone() });
        all.push(params);
    }
    for params in all {
        let found = local_graphs(&supervoxels, &params, &Monitor::default())?;
        let partition = supervoxels.point_partition(&found, &Monitor::default())?;
        let error = scene.error(&partition, EmptyCells::Ignored)?;
        let largest = partition.iter().map(<[u32]>::len).max().unwrap_or(0) as f64 / partition.nodes() as f64;
        println!(
            "{} | {} | {} | {:?} | {:?} | {} | {} | {:.2} | {:.4} | {:.4} | {:.1}",
            params.distance_scale,
            params.feature_scale,
            params.k,
            params.surface,
            params.combination,
            params.attach_isolated,
            found.len(),
            scene.oracle(&partition)?,
            error.error,
            error.precision,
            100.0 * largest
        );
    }
    Ok(())
}

fn neighbours(scene: &Scene) -> Outcome {
    let supervoxels = scene.supervoxels()?;
    println!(
        "{} supervoxels, oracle {:.2} %",
        supervoxels.len(),
        scene.oracle(&supervoxels.partition(&Monitor::default())?)?
    );
    println!("isolated | N | segments | oracle % | error per class | mean | precision | mean with background | s");
    for (attach_isolated, neighbours) in [true, false].into_iter().flat_map(|a| (3..=12).map(move |n| (a, n))) {
        let params = LocalGraphParams { neighbours, attach_isolated, ..LocalGraphParams::default() };
        let (found, seconds) = timed(|| local_graphs(&supervoxels, &params, &Monitor::default()))?;
        let partition = supervoxels.point_partition(&found, &Monitor::default())?;
        let error = scene.error(&partition, EmptyCells::Ignored)?;
        let classes: Vec<String> = error.classes.iter().map(|c| format!("{}: {:.4}", c.code, c.error)).collect();
        println!(
            "{attach_isolated} | {neighbours} | {} | {:.2} | {} | {:.4} | {:.4} | {:.4} | {seconds:.3}",
            found.len(),
            scene.oracle(&partition)?,
            classes.join(" "),
            error.error,
            error.precision,
            scene.error(&partition, EmptyCells::Background)?.error
        );
    }
    Ok(())
}

fn chain(scene: &Scene) -> Outcome {
    let (supervoxels, a) = timed(|| scene.supervoxels())?;
    let (segments, b) = timed(|| local_graphs(&supervoxels, &LocalGraphParams::default(), &Monitor::default()))?;
    let partition = supervoxels.point_partition(&segments, &Monitor::default())?;
    let (heights, d) = timed(|| heights(&scene.points))?;
    let attributes = ObjectAttributes { colours: scene.colours.as_deref(), heights: Some(&heights) };
    let (table, c) = timed(|| object_features(&scene.points, &partition, &attributes, &Monitor::default()))?;
    println!(
        "supervoxels {a:.2} s, {}; local graphs {b:.2} s, {} segments; heights {d:.2} s; {} features {c:.2} s; oracle {:.2} %",
        supervoxels.len(),
        segments.len(),
        table.width(),
        scene.oracle(&partition)?
    );
    let labels: Vec<Option<u8>> = majorities(&partition, &scene.truth)?.iter().map(|m| m.code).collect();
    let chosen = stratified(&labels);
    let rows: Vec<f32> = chosen.iter().flat_map(|&s| table.row(s).to_vec()).collect();
    let classes: Vec<u16> = chosen.iter().filter_map(|&s| labels[s].map(u16::from)).collect();
    let samples = Samples { features: &rows, width: table.width(), labels: &classes, weights: None, classes: 256 };
    for params in [
        ClassifierParams::Forest(ForestParams::breiman()),
        ClassifierParams::Boosting(BoostingParams::default()),
        ClassifierParams::Bagging(BaggingParams::default()),
    ] {
        let name = params.kind().name();
        let (model, fit) = timed(|| params.train(&samples, &Monitor::default()))?;
        let (named, predict) = timed(|| model.predict(&table.values))?;
        let mut held = vec![false; table.rows()];
        chosen.iter().for_each(|&s| held[s] = true);
        let pairs = partition.iter().enumerate().filter(|(s, _)| !held[*s]);
        let pairs = pairs.flat_map(|(s, members)| members.iter().map(move |&i| (i as usize, s)));
        let (truth, found): (Vec<_>, Vec<u8>) = pairs.map(|(i, s)| (scene.truth[i], named[s] as u8)).unzip();
        let rows = Confusion::from_options(&truth, &found)?.one_vs_rest();
        let mean = |value: fn(&OneVsRest) -> f64| 100.0 * rows.iter().map(value).sum::<f64>() / rows.len() as f64;
        let classes: Vec<String> = rows.iter().map(|r| format!("{}: {:.2}", r.code, 100.0 * r.precision)).collect();
        println!(
            "{name}: fit {fit:.2} s, predict {predict:.2} s; precision {} | mean {:.2} | sensitivity {:.2} | specificity {:.2} | accuracy {:.2}",
            classes.join(" "),
            mean(|r| r.precision),
            mean(|r| r.sensitivity),
            mean(|r| r.specificity),
            mean(|r| r.accuracy)
        );
    }
    Ok(())
}

/// Height above a ground found without labels.
fn heights(points: &Points) -> Result<Vec<f32>> {
    let monitor = Monitor::default();
    let ground = ground_points(points, &GroundParams::default(), &monitor)?;
    ElevationModel::fit(points, &ground, &ElevationParams::default(), &monitor)?.heights(points, &monitor)
}

/// 30 % of the segments of each class.
fn stratified(labels: &[Option<u8>]) -> Vec<usize> {
    let mut chosen = Vec::new();
    for code in 0..=255 {
        let mut of: Vec<usize> = (0..labels.len()).filter(|&s| labels[s] == Some(code)).collect();
        stream(0, u64::from(code)).shuffle(&mut of);
        chosen.extend(of.iter().take((of.len() * 3).div_ceil(10)));
    }
    chosen.sort_unstable();
    chosen
}

fn segments(scene: &mut Scene) -> Outcome {
    let supervoxels = scene.supervoxels()?;
    let found = local_graphs(&supervoxels, &LocalGraphParams::default(), &Monitor::default())?;
    for (name, partition) in [
        ("supervoxels.laz", supervoxels.partition(&Monitor::default())?),
        ("segments.laz", supervoxels.point_partition(&found, &Monitor::default())?),
    ] {
        println!("{name}: {}", partition.len());
        let mut column = vec![0; scene.cloud.len()];
        scene.points.frame.index.iter().zip(partition.segments()).for_each(|(&i, &s)| column[i as usize] = s);
        scene.cloud.set_column(Column::new("ClusterID", Values::U32(column)))?;
        io::write(Path::new(name), &scene.cloud, &io::WriteOptions::default())?;
    }
    Ok(())
}

fn dump(scene: &Scene) -> Outcome {
    let mut bytes = Vec::new();
    for i in 0..scene.points.len() {
        let place = scene.points.positions.xyz(i);
        let colour = scene.colours.as_ref().map_or([0.0; 3], |c| c[i]);
        let row = [place, scene.normals[i], colour];
        bytes.extend(row.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    }
    std::fs::write("points.f32", bytes)?;
    Ok(())
}

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, path, table, rest @ ..] = arguments.as_slice() else {
        return Err("objects CLOUD speed|modes|sweep|neighbours|chain|segments|dump [POINTS]".into());
    };
    let most = rest.first().map_or(Ok(usize::MAX), |n| n.parse())?;
    let mut scene = Scene::read(Path::new(path), most)?;
    match table.as_str() {
        "speed" => speed(&scene),
        "modes" => modes(&mut scene),
        "sweep" => sweep(&scene),
        "neighbours" => neighbours(&scene),
        "chain" => chain(&scene),
        "segments" => segments(&mut scene),
        "dump" => dump(&scene),
        other => Err(format!("{other} is no table").into()),
    }
}
