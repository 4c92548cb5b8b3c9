//! `scansion info`: what a file holds.

use super::Context;
use crate::args::{Format, Info};
use crate::exit_code::Failure;
use scansion_core::classes::preset;
use scansion_core::cloud::names;
use scansion_core::io::{self, Columns, FileInfo, ReadOptions};
use scansion_core::recipes::planar_density;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;

/// What only the points can tell.
#[derive(Debug, Serialize)]
struct Stats {
    not_finite: u64,
    points_per_square_metre: f64,
    classes: Vec<(u8, String, u64)>,
}

#[derive(Debug, Serialize)]
struct Described {
    #[serde(flatten)]
    info: FileInfo,
    #[serde(skip_serializing_if = "Option::is_none")]
    stats: Option<Stats>,
}

pub(crate) fn run(args: &Info, context: &Context<'_>) -> Result<(), Failure> {
    let mut described = Vec::new();
    for path in &args.inputs {
        let mut info = io::inspect(path)?;
        let stats = if args.stats { Some(stats(path, &mut info, context)?) } else { None };
        described.push(Described { info, stats });
    }
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&described).unwrap_or_default(),
        Format::Csv => csv(&described),
        Format::Table => described.iter().map(table).collect::<Vec<_>>().join("\n"),
    })
}

fn stats(path: &Path, info: &mut FileInfo, context: &Context<'_>) -> Result<Stats, Failure> {
    let columns = Columns::Only(vec![names::CLASSIFICATION.into()]);
    let cloud = io::read_with(path, &ReadOptions { columns, monitor: context.monitor.clone(), ..Default::default() })?;
    // Headers of other formats than LAS do not tell the bounds.
    info.bounds = info.bounds.or_else(|| cloud.bounds());
    let finite = (0..cloud.len()).filter(|&i| cloud.xyz(i).iter().all(|v| v.is_finite())).count();
    let mut counts = [0u64; 256];
    if let Some(column) = cloud.column(names::CLASSIFICATION) {
        (0..cloud.len()).for_each(|i| counts[usize::from(column.values.get(i) as u8)] += 1);
    }
    let classes = (0..=255u8).filter(|&c| counts[usize::from(c)] > 0);
    Ok(Stats {
        not_finite: (cloud.len() - finite) as u64,
        points_per_square_metre: planar_density(&cloud, info.metres_per_unit.unwrap_or(1.0)),
        classes: classes.map(|c| (c, preset::asprs(c).name, counts[usize::from(c)])).collect(),
    })
}

fn table(described: &Described) -> String {
    let info = &described.info;
    let mut text = format!("{}\n", info.path.display());
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "  {name:<14} {value}");
    };
    let version = info.version.as_deref().map(|v| format!(" {v}")).unwrap_or_default();
    let point_format = info.point_format.map(|f| format!(", point format {f}")).unwrap_or_default();
    line("format", format!("{}{version}{point_format}", info.format));
    line("points", info.points.to_string());
    if let Some((low, high)) = info.bounds {
        ["x", "y", "z"]
            .iter()
            .zip(low.iter().zip(high))
            .for_each(|(axis, (l, h))| line(axis, format!("{l} .. {h}  ({:.3})", h - l)));
    }
    if let Some(scale) = info.scale {
        line("scale", format!("{} {} {}", scale[0], scale[1], scale[2]));
    }
    line("CRS", info.crs.as_deref().map_or("unknown".into(), |c| c.chars().take(100).collect()));
    line("unit", info.metres_per_unit.map_or("unknown, taken as metres".into(), |m| format!("{m} m")));
    line("dimensions", info.dimensions.join(" "));
    if let Some(octree) = &info.octree {
        let points: Vec<String> = octree.points_per_level.iter().map(ToString::to_string).collect();
        line(
            "octree",
            format!("{} nodes, spacing {}, points of its levels {}", octree.nodes, octree.spacing, points.join(" ")),
        );
    }
    if !info.vlrs.is_empty() {
        line("VLRs", info.vlrs.join(", "));
    }
    if let Some(stats) = &described.stats {
        line("density", format!("{:.1} points per square metre", stats.points_per_square_metre));
        line("not finite", stats.not_finite.to_string());
        stats.classes.iter().for_each(|(code, name, n)| line(&format!("class {code}"), format!("{n}  {name}")));
    }
    info.warnings.iter().for_each(|w| line("warning", w.clone()));
    text
}

fn csv(described: &[Described]) -> String {
    let mut text = "path,format,version,point_format,points\n".to_string();
    for d in described {
        let info = &d.info;
        let version = info.version.as_deref().unwrap_or("");
        let format = info.point_format.map(|f| f.to_string()).unwrap_or_default();
        let _ = writeln!(text, "{},{},{version},{format},{}", info.path.display(), info.format, info.points);
    }
    text
}
