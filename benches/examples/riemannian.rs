//! Tables of supervoxels, segments and seconds by least depth of the octree, as tables 1 and 2 of document 001, and
//! both ways of region growing.
//!
//! Arguments: clouds. `SCANSION_SIGMA` (0.03) is the scatter at which cells are flat, in metres; `SCANSION_RULE=paper`
//! takes the rule of the paper; `SCANSION_DEPTHS` (4-7) the least depths; `SCANSION_STRENGTH` (0.1); `SCANSION_OUT` names
//! a folder for clouds with the column ClusterID.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_core::Cloud;
use scansion_core::cloud::{Column, Points, Values};
use scansion_core::features::normals;
use scansion_core::neighbours::knn;
use scansion_core::parallel::Monitor;
use scansion_core::segmentation::{
    GrownRegions, Leftovers, OctreeGrowingParams, OctreeParams, RegionGrowingParams, RiemannianParams, StopRule,
    multi_scale, octree_region_growing, region_growing,
};
use std::path::Path;
use std::time::Instant;

type Fallible<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Fallible<()> {
    for path in std::env::args().skip(1) {
        let mut cloud = scansion_core::io::read(Path::new(&path))?;
        let points = Points::from_cloud(&cloud, cloud.metres_per_unit.unwrap_or(1.0));
        println!("{path}: {} points", points.len());
        let name = Path::new(&path).file_stem().map_or("cloud".into(), |s| s.to_string_lossy().into_owned());
        scales(&mut cloud, &points, &name)?;
        growing(&mut cloud, &points, &name)?;
    }
    Ok(())
}

fn setting(name: &str, default: &str) -> String {
    std::env::var(name).unwrap_or_else(|_| default.into())
}

fn scales(cloud: &mut Cloud, points: &Points, name: &str) -> Fallible<()> {
    let sigma: f64 = setting("SCANSION_SIGMA", "0.03").parse()?;
    let octree = match setting("SCANSION_RULE", "sigma").as_str() {
        "paper" => OctreeParams::paper(),
        _ => OctreeParams { stop: StopRule::Sigma(sigma), ..OctreeParams::adaptive() },
    };
    let strength = setting("SCANSION_STRENGTH", "0.1").parse()?;
    let params = RiemannianParams { octree, strength, ..RiemannianParams::default() };
    let depths = setting("SCANSION_DEPTHS", "4-7");
    let (first, last) = depths.split_once('-').ok_or("SCANSION_DEPTHS: first-last")?;
    println!("d_min | supervoxels | segments | edges | iterations | s: normals, supervoxels, graph, optimisation, all");
    for scale in multi_scale(points, &params, first.parse()?..=last.parse()?, &Monitor::default())? {
        let (found, s) = (&scale.found, scale.found.seconds);
        println!(
            "{} | {} | {} | {} | {} | {:.3}, {:.3}, {:.3}, {:.3}, {:.3}",
            scale.min_depth,
            found.supervoxels.len(),
            found.segments.len(),
            found.sizes.edges,
            found.iterations,
            s.normals,
            s.supervoxels,
            s.graph,
            s.optimisation,
            s.normals + s.supervoxels + s.graph + s.optimisation
        );
        write(cloud, points, found.segments.segments(), &format!("{name}_segments_{}", scale.min_depth))?;
        write(cloud, points, found.supervoxels.segments(), &format!("{name}_supervoxels_{}", scale.min_depth))?;
    }
    Ok(())
}

fn growing(cloud: &mut Cloud, points: &Points, name: &str) -> Fallible<()> {
    let monitor = Monitor::default();
    let start = Instant::now();
    let near = knn(points, 30, &monitor)?;
    let surface = normals(points, &near, &monitor)?;
    let ready = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let plain = region_growing(&near, &surface, &RegionGrowingParams::default(), &monitor)?;
    report("region growing", &plain, start);
    println!("  normals before: {ready:.3} s");
    let start = Instant::now();
    let coarse = octree_region_growing(points, &OctreeGrowingParams::default(), &monitor)?;
    report("octree-based region growing", &coarse, start);
    for (found, kind) in [(plain, "grown"), (coarse, "octree_grown")] {
        let partition = found.partition(points, Leftovers::Nearest, &monitor)?;
        write(cloud, points, partition.segments(), &format!("{name}_{kind}"))?;
        write(cloud, points, &found.labels, &format!("{name}_{kind}_only"))?;
    }
    Ok(())
}

fn report(name: &str, found: &GrownRegions, start: Instant) {
    let seconds = start.elapsed().as_secs_f64();
    println!("{name}: {} regions, {:.1} % of the points, {seconds:.3} s", found.count, 100.0 * found.coverage());
}

/// Writes the cloud with its segments, if a folder is named.
fn write(cloud: &mut Cloud, points: &Points, segments: &[u32], name: &str) -> Fallible<()> {
    let Ok(folder) = std::env::var("SCANSION_OUT") else { return Ok(()) };
    let mut column = vec![0u32; cloud.len()];
    points.index.iter().zip(segments).for_each(|(&i, &s)| column[i as usize] = s);
    cloud.set_column(Column::new("ClusterID", Values::U32(column)))?;
    scansion_core::io::write(&Path::new(&folder).join(format!("{name}.ply")), cloud, &Default::default())?;
    Ok(())
}
