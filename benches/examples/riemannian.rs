//! Tables of supervoxels, segments and seconds by least depth of the octree, as in Li 2018, tables 1 and 2, and both
//! kinds of region growing; with the oracle accuracy of the segments, if there are classes.
//!
//! Arguments: clouds. `SCANSION_SIGMA` (0.03) is the scatter at which cells are flat, in metres; `SCANSION_RULE=paper`
//! takes the rule of the paper, octree-based growing always takes the scatter; `SCANSION_DEPTHS` (4-7) the least depths; `SCANSION_STRENGTH` (0.1); `SCANSION_OPTIONS` some of
//! unsigned, up, cube, connected, points, min, thin-wall, tree-path, inverse; `SCANSION_OUT` names
//! a folder for clouds with the column ClusterID.

#![allow(clippy::print_stdout, reason = "a program for people")]

use scansion_core::Cloud;
use scansion_core::cloud::{Column, Points, Values};
use scansion_core::features::normals;
use scansion_core::graph::{EdgeWeight, Orientation};
use scansion_core::neighbours::knn;
use scansion_core::parallel::Monitor;
use scansion_core::segmentation::{
    GrownRegions, Leftovers, Nearest, NodeWeight, OctreeGrowingParams, OctreeParams, Partition, Reference,
    RegionGrowingParams, RiemannianParams, Sides, Start, StopRule, Symmetry, multi_scale, octree_region_growing,
    oracle_accuracy, region_growing,
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
    let mut params = RiemannianParams { octree, strength, ..RiemannianParams::default() };
    for option in setting("SCANSION_OPTIONS", "").split_whitespace() {
        match option {
            "unsigned" => params.sides = Sides::Unsigned,
            "up" => params.orientation = Orientation::Up,
            "cube" => params.clusters.start = Start::Cube,
            "connected" => params.clusters.connected = true,
            "points" => params.node_weight = NodeWeight::Points,
            "min" => params.graph.symmetry = Symmetry::Min,
            "thin-wall" => params.graph.thin_wall = true,
            "tree-path" => params.graph.nearest_by = Nearest::TreePath,
            "inverse" => params.graph.edge_weight = EdgeWeight::Inverse { offset: 1.0 },
            _ => return Err(format!("unknown option {option}").into()),
        }
    }
    let depths = setting("SCANSION_DEPTHS", "4-7");
    let (first, last) = depths.split_once('-').ok_or("SCANSION_DEPTHS: first-last")?;
    println!(
        "d_min | supervoxels (oracle) | segments (oracle) | edges | iterations | s: normals, supervoxels, graph, optimisation, all"
    );
    for scale in multi_scale(points, &params, first.parse()?..=last.parse()?, &Monitor::default())? {
        let (found, s) = (&scale.found, scale.found.seconds);
        println!(
            "{} | {} ({}) | {} ({}) | {} | {} | {:.3}, {:.3}, {:.3}, {:.3}, {:.3}",
            scale.min_depth,
            found.supervoxels.len(),
            oracle(cloud, points, &found.supervoxels)?,
            found.segments.len(),
            oracle(cloud, points, &found.segments)?,
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
    let near = knn(&points.positions, 30, &monitor)?;
    println!("30 neighbours: {:.3} s", start.elapsed().as_secs_f64());
    let surface = normals(&points.positions, &near, &monitor)?;
    let residual: f64 = setting("SCANSION_SIGMA", "0.03").parse()?;
    for reference in [Reference::Current, Reference::Seed] {
        let start = Instant::now();
        let params = RegionGrowingParams { reference, ..RegionGrowingParams::default() };
        let plain = region_growing(&near, &surface, &params, &monitor)?;
        let plain_seconds = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let params =
            OctreeGrowingParams { residual, distance: 2.0 * residual, reference, ..OctreeGrowingParams::default() };
        let coarse = octree_region_growing(&points.positions, &params, &monitor)?;
        let seconds = start.elapsed().as_secs_f64();
        for (found, kind, seconds) in [(plain, "grown", plain_seconds), (coarse, "octree_grown", seconds)] {
            report(cloud, (points, name), (&found, &format!("{kind}_{reference:?}")), seconds)?;
        }
    }
    Ok(())
}

fn report(
    cloud: &mut Cloud,
    (points, name): (&Points, &str),
    found: (&GrownRegions, &str),
    seconds: f64,
) -> Fallible<()> {
    let (found, kind) = found;
    let partition = found.partition(&points.positions, Leftovers::Nearest, &Monitor::default())?;
    let (share, oracle) = (100.0 * found.coverage(), oracle(cloud, points, &partition)?);
    println!("{kind}: {} regions, {share:.1} % of the points, oracle {oracle}, {seconds:.3} s", found.count);
    write(cloud, points, &found.labels, &format!("{name}_{kind}"))
}

/// Oracle accuracy of the segments, in percent.
fn oracle(cloud: &Cloud, points: &Points, partition: &Partition) -> Fallible<String> {
    let Some(column) = cloud.column("Classification").or_else(|| cloud.column("label")) else {
        return Ok("no classes".into());
    };
    let labels: Vec<Option<u8>> =
        points.frame.index.iter().map(|&i| Some(column.values.get(i as usize) as u8)).collect();
    Ok(oracle_accuracy(partition, &labels)?.map_or("no labels".into(), |a| format!("{:.1} %", 100.0 * a)))
}

/// Writes the cloud with its segments, if a folder is given.
fn write(cloud: &mut Cloud, points: &Points, segments: &[u32], name: &str) -> Fallible<()> {
    let Ok(folder) = std::env::var("SCANSION_OUT") else { return Ok(()) };
    let mut column = vec![0u32; cloud.len()];
    points.frame.index.iter().zip(segments).for_each(|(&i, &s)| column[i as usize] = s);
    cloud.set_column(Column::new("ClusterID", Values::U32(column)))?;
    scansion_core::io::write(&Path::new(&folder).join(format!("{name}.ply")), cloud, &Default::default())?;
    Ok(())
}
