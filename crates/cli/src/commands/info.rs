//! `scansion info`: contents of a file, and warnings about it.

use super::{Context, sources};
use crate::args::{Format, Info};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::classes::preset;
use scansion_core::cloud::MetricCloud;
use scansion_core::cloud::crs::{Unit, Vertical, angles, unit_of};
use scansion_core::evaluation::report::csv_field;
use scansion_core::io::salvage::{self, Losses};
use scansion_core::io::{self, FileInfo, statistics};
use scansion_core::voxels::planar_density;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Results that need the points.
#[derive(Debug, Serialize)]
struct Stats {
    points_per_square_metre: f64,
    /// Mean distance of neighbours in plan, metres.
    spacing_metres: f64,
    not_finite: u64,
    duplicates: u64,
    outside_bounds: u64,
    nan_values: Vec<(String, u64)>,
    classes: Vec<(u8, String, u64)>,
}

#[derive(Debug, Serialize)]
struct Described {
    #[serde(flatten)]
    info: FileInfo,
    #[serde(skip_serializing_if = "Option::is_none")]
    stats: Option<Stats>,
}

/// The readable part of a damaged file.
#[derive(Debug, Serialize)]
struct Salvaged {
    path: PathBuf,
    lost: u64,
    #[serde(flatten)]
    losses: Losses,
}

pub(crate) fn run(args: &Info, context: &Context<'_>) -> Result<(), Failure> {
    let inputs = sources::expanded(&args.inputs)?;
    let format = if args.json { Format::Json } else { context.printer.format };
    if args.salvage {
        return salvaged(&inputs, format, context);
    }
    let (described, failed) = each(&inputs, context, |path| {
        let mut info = io::inspect_with(path, context.columns)?;
        let stats = if args.stats { Some(stats(path, &mut info, context)?) } else { None };
        Ok(Described { info, stats })
    })?;
    context.printer.data(&match format {
        Format::Json => serde_json::to_string_pretty(&described).unwrap_or_default(),
        Format::Csv => csv(&described),
        Format::Table => described.iter().map(table).collect::<Vec<_>>().join("\n"),
    })?;
    partly(failed, inputs.len())
}

/// The result of `work` for each file, and how many failed; if a single file fails, the run ends.
fn each<T>(
    inputs: &[PathBuf],
    context: &Context<'_>,
    work: impl Fn(&Path) -> Result<T, Failure>,
) -> Result<(Vec<T>, usize), Failure> {
    let (mut done, mut failed) = (Vec::new(), 0);
    for (number, path) in inputs.iter().enumerate() {
        context.monitor.file(number + 1, inputs.len());
        match work(path) {
            Ok(found) => done.push(found),
            Err(Failure::Core(Error::Interrupted)) => return Err(Error::Interrupted.into()),
            Err(failure) if inputs.len() == 1 => return Err(failure),
            Err(failure) => {
                context.printer.error(&failure.to_string());
                failed += 1;
            }
        }
    }
    Ok((done, failed))
}

fn partly(failed: usize, inputs: usize) -> Result<(), Failure> {
    if failed > 0 { Err(Failure::Partly { failed, inputs }) } else { Ok(()) }
}

fn salvaged(inputs: &[PathBuf], format: Format, context: &Context<'_>) -> Result<(), Failure> {
    let (list, failed) = each(inputs, context, |path| {
        let losses = salvage::examine(path, &context.monitor)?;
        Ok(Salvaged { path: path.to_path_buf(), lost: losses.lost(), losses })
    })?;
    let text = |s: &Salvaged| {
        let notes = s.losses.notes.iter().map(|n| format!("\n  {n}")).collect::<String>();
        format!("{}: {}{notes}", s.path.display(), s.losses.summary())
    };
    let row = |s: &Salvaged| {
        let path = csv_field(&s.path.display().to_string());
        format!("{path},{},{},{}\n", s.losses.declared, s.losses.read, s.lost)
    };
    context.printer.data(&match format {
        Format::Json => serde_json::to_string_pretty(&list).unwrap_or_default(),
        Format::Csv => format!("path,declared,read,lost\n{}", list.iter().map(row).collect::<String>()),
        Format::Table => list.iter().map(text).collect::<Vec<_>>().join("\n"),
    })?;
    partly(failed, inputs.len())
}

fn stats(path: &Path, info: &mut FileInfo, context: &Context<'_>) -> Result<Stats, Failure> {
    let (found, cloud) = statistics::statistics(path, &context.read_options())?;
    info.warnings.extend(found.warnings);
    // Headers of formats other than LAS have no bounds.
    info.bounds = info.bounds.or_else(|| cloud.bounds());
    let scene = MetricCloud::new(&cloud, Some(info.metres_per_unit.unwrap_or(1.0)), &context.monitor)?;
    let density = planar_density(&scene.points(&context.monitor)?.positions, &context.monitor)?;
    let name = |code| preset::named(code, cloud.scheme.likely(), &cloud.class_names).name;
    Ok(Stats {
        points_per_square_metre: density,
        spacing_metres: if density > 0.0 { 1.0 / density.sqrt() } else { 0.0 },
        not_finite: found.not_finite,
        duplicates: found.duplicates,
        outside_bounds: found.outside_bounds,
        nan_values: found.nan_values,
        classes: found.classes.into_iter().map(|(c, n)| (c, name(c), n)).collect(),
    })
}

/// Number of decimal places that represents every multiple of a scale like 0.01 or 0.00025.
fn places(scale: f64) -> usize {
    let whole = |steps: f64| (steps - steps.round()).abs() < 1e-6 * steps;
    (0..12).find(|&p| whole(scale * 10f64.powi(p))).unwrap_or(12) as usize
}

fn table(described: &Described) -> String {
    let info = &described.info;
    let mut text = format!("{}\n", info.path.display());
    let mut line = |name: &str, value: String| {
        // A line end in a name would look like a line of our output.
        let value = value.replace('\n', "\\u000a");
        let _ = writeln!(text, "  {name:<14} {value}");
    };
    let version = info.version.as_deref().map(|v| format!(" {v}")).unwrap_or_default();
    let point_format = info.point_format.map(|f| format!(", point format {f}")).unwrap_or_default();
    line("format", format!("{}{version}{point_format}", info.format));
    line("points", info.points.to_string());
    if let Some([low, high]) = info.bounds {
        for (a, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let places = info.scale.map(|scale| places(scale[a]));
            let shown = |v: f64| places.map_or_else(|| v.to_string(), |places| format!("{v:.places$}"));
            line(axis, format!("{} .. {}  ({:.3})", shown(low[a]), shown(high[a]), high[a] - low[a]));
        }
    }
    if let Some(scale) = info.scale {
        line("scale", format!("{} {} {}", scale[0], scale[1], scale[2]));
    }
    line("CRS", info.crs.as_deref().map_or("unknown".into(), |c| c.chars().take(100).collect()));
    line("unit", unit(info));
    if let Some(vertical) = info.vertical {
        line("heights", heights(vertical));
    }
    line("dimensions", info.dimensions.join(" "));
    if let Some(octree) = &info.octree {
        let points: Vec<String> = octree.points_per_level.iter().map(ToString::to_string).collect();
        line(
            "octree",
            format!("{} nodes, spacing {:.3}, points of its levels {}", octree.nodes, octree.spacing, points.join(" ")),
        );
    }
    if !info.vlrs.is_empty() {
        line("VLRs", info.vlrs.join(", "));
    }
    if let Some(text) = &info.provenance {
        line("classified by", text.clone());
    }
    if let Some(stats) = &described.stats {
        line("density", format!("{:.1} points per square metre", stats.points_per_square_metre));
        line("spacing", format!("{:.3} m", stats.spacing_metres));
        line("not finite", stats.not_finite.to_string());
        line("duplicates", stats.duplicates.to_string());
        line("out of bounds", stats.outside_bounds.to_string());
        stats.classes.iter().for_each(|(code, name, n)| line(&format!("class {code}"), format!("{n}  {name}")));
    }
    info.warnings.iter().for_each(|w| line("warning", w.clone()));
    text
}

/// The unit of the coordinates.
fn unit(info: &FileInfo) -> String {
    match (info.metres_per_unit, info.crs.as_deref().and_then(unit_of)) {
        (Some(metres), _) => length(metres),
        (None, Some(Unit::Angle(radians))) => format!("{}: to be projected before distances count", angles(radians)),
        (None, _) => "unknown, taken as metres".into(),
    }
}

/// The vertical system and the unit of heights.
fn heights(Vertical { code, metres_per_unit }: Vertical) -> String {
    let system = code.map_or("system without a code".into(), |code| format!("EPSG:{code}"));
    format!("{system}, unit {}", metres_per_unit.map_or("unknown".into(), length))
}

fn length(metres: f64) -> String {
    if (metres - 1.0).abs() < 1e-12 { "metre".into() } else { format!("{metres} m{}", foot(metres)) }
}

/// The name of a well-known unit of length.
fn foot(metres: f64) -> &'static str {
    let is = |other: f64| (metres / other - 1.0).abs() < 1e-9;
    match metres {
        _ if is(0.3048) => " (foot)",
        // WKT often has only ten digits of it.
        _ if (metres / (1200.0 / 3937.0) - 1.0).abs() < 1e-7 => " (US survey foot)",
        _ => "",
    }
}

fn csv(described: &[Described]) -> String {
    let with_stats = described.iter().any(|d| d.stats.is_some());
    let more =
        if with_stats { ",points_per_square_metre,spacing_metres,not_finite,duplicates,outside_bounds" } else { "" };
    let mut text = format!("path,format,version,point_format,points{more}\n");
    for Described { info, stats } in described {
        let path = csv_field(&info.path.display().to_string());
        let version = info.version.as_deref().unwrap_or("");
        let format = info.point_format.map(|f| f.to_string()).unwrap_or_default();
        let _ = write!(text, "{path},{},{version},{format},{}", info.format, info.points);
        if let Some(s) = stats {
            let (density, spacing) = (s.points_per_square_metre, s.spacing_metres);
            let _ = write!(text, ",{density},{spacing},{},{},{}", s.not_finite, s.duplicates, s.outside_bounds);
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{heights, places};
    use scansion_core::cloud::crs::Vertical;

    #[test]
    fn heights_are_told_by_code_and_unit() {
        let told = |code, metres_per_unit| heights(Vertical { code, metres_per_unit });
        assert_eq!(told(Some(8228), Some(0.3048)), "EPSG:8228, unit 0.3048 m (foot)");
        assert_eq!(told(None, Some(1.0)), "system without a code, unit metre");
        assert_eq!(told(Some(5103), None), "EPSG:5103, unit unknown");
    }

    #[test]
    fn decimal_places_follow_from_the_scale() {
        assert_eq!([1.0, 0.01, 0.001, 0.00025, 1e-7, 0.5].map(places), [0, 2, 3, 5, 7, 1]);
    }
}
