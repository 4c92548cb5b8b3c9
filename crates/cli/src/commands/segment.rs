//! `scansion segment`: divides a cloud into segments.

use super::labels::LabelSource;
use super::{Context, sources};
use crate::args::{Format, LabelArgs, Segment, SegmentArgs};
use crate::exit_code::Failure;
use crate::printer::bar;
use scansion_core::cloud::{Cloud, Column, Values, names};
use scansion_core::evaluation::report::percent;
use scansion_core::images::segment_colour;
use scansion_core::io::{self, Columns, Edit};
use scansion_core::recipes::{self, Labels, LevelReport, SegmentParams, SegmentReport, Segmented};
use scansion_core::segmentation::Intent;
use std::fmt::Write;
use std::path::Path;

/// Name of the dimension.
pub(crate) const CLUSTER: &str = "ClusterID";

pub(crate) fn run(args: &Segment, context: &Context<'_>) -> Result<(), Failure> {
    io::check_cloud_output(&args.output)?;
    io::check_holds(&args.output, "segments")?;
    let names = (0..=args.levels.len()).map(|l| if l == 0 { CLUSTER.into() } else { format!("{CLUSTER}_L{l}") });
    let params = settings(&args.segments)?;
    // `suggest` describes segments of every method by the neighbourhoods of their points.
    args.segments.k_min.iter().try_for_each(|_| params.check_neighbourhood())?;
    let own = params.method.dimensions().iter().map(ToString::to_string);
    let dimensions: Vec<Column> =
        names.chain(own).map(|name: String| Column::new(name, Values::U32(Vec::new()))).collect();
    io::check_dimensions(&args.input, &args.output, &dimensions)?;
    let (cloud, _, found) = parted(&args.input, (&args.segments, &args.levels), &args.labels, context)?;
    io::check_coordinates(&args.input, &args.output, &cloud, &context.write_options())?;
    drop(cloud);
    let mut edits = Vec::new();
    if args.colour {
        edits.push(Edit::Colour(found.clusters.iter().map(|&segment| segment_colour(segment)).collect()));
    }
    edits.push(Edit::Dimension(Column::new(CLUSTER, Values::U32(found.clusters))));
    for (level, clusters) in found.levels.into_iter().enumerate() {
        edits.push(Edit::Dimension(Column::new(format!("{CLUSTER}_L{}", level + 1), Values::U32(clusters))));
    }
    edits.extend(found.columns.into_iter().map(Edit::Dimension));
    let report = io::rewrite(&args.input, &args.output, &edits, &context.write_options())?;
    context.report(&args.output, &report);
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&found.report).unwrap_or_default(),
        Format::Csv => csv(&found.report),
        Format::Table => table(&found.report),
    })
}

/// Reads a cloud, with its labels if it has any, and divides it into segments.
pub(crate) fn parted(
    input: &Path,
    (args, levels): (&SegmentArgs, &[u32]),
    labels: &LabelArgs,
    context: &Context<'_>,
) -> Result<(Cloud, Option<Labels>, Segmented), Failure> {
    let settings = SegmentParams { levels: levels.to_vec(), ..settings(args)? };
    let source = LabelSource::new(labels, &[input])?;
    let dimension = &labels.label_dimension;
    let mut options = context.read_options();
    options.columns = Columns::Only([vec![dimension.clone()], settings.columns()].concat());
    let cloud = io::read_with(input, &options)?;
    // A dimension that was asked for must be there.
    let labels = match cloud.column(dimension).is_some() || dimension != names::CLASSIFICATION {
        true => Some(source.read(input, &cloud, context)?).filter(|l| l.unlabelled < cloud.len() as u64),
        false => None,
    };
    source.absent(labels.iter()).into_iter().chain(source.unused()).for_each(|text| context.printer.warning(&text));
    let found = recipes::segment(&cloud, labels.as_ref(), &settings, &context.monitor)?;
    Ok((cloud, labels, found))
}

/// Flags take precedence over `--set`, then the file, then the defaults.
fn settings(args: &SegmentArgs) -> Result<SegmentParams, Failure> {
    let base = match args.recipe.as_deref() {
        None => SegmentParams::default(),
        Some(path) => match path.to_str().and_then(SegmentParams::named) {
            Some(named) => named,
            None => SegmentParams::from_toml(&sources::text(path)?)?,
        },
    };
    let mut params = base.with_settings(args.set.iter().map(String::as_str))?;
    params.method = args.method.unwrap_or(params.method);
    if let Some(k_min) = args.k_min {
        params.neighbourhood.k_min = k_min;
        params.neighbourhood.k_max = params.neighbourhood.k_max.max(k_min);
    }
    if let Some(cutoff) = args.cutoff {
        params.check_cutoff()?;
        params.partition.cutoff = cutoff;
    }
    (params.partition.seed, params.riemannian.seed) =
        (args.seed.unwrap_or(params.partition.seed), args.seed.unwrap_or(params.riemannian.seed));
    params.clusters.seed = args.seed.unwrap_or(params.clusters.seed);
    Ok(aimed(args, params)?)
}

/// The aim of the segmentation, in the terms of the method.
fn aimed(args: &SegmentArgs, mut params: SegmentParams) -> scansion_core::Result<SegmentParams> {
    let aims = [
        args.strength.map(Intent::Strength),
        args.segments_per_hectare.map(Intent::SegmentsPerHectare),
        args.smallest_object.map(Intent::SmallestObject),
        args.oracle_loss.map(Intent::OracleAccuracy),
    ];
    if let Some(aim) = aims.into_iter().flatten().next() {
        params = params.aimed(aim)?;
    }
    match args.size {
        Some(size) => params.with_size(size),
        None => Ok(params),
    }
}

fn table(report: &SegmentReport) -> String {
    let mut text = format!("{} segments by {}", report.segments, report.method.name());
    for (value, what) in [
        (report.strength.map(|s| format!("{s:.4}")), "strength"),
        (report.supervoxels.map(|n| n.to_string()), "supervoxels"),
    ] {
        value.iter().for_each(|value| text += &format!(", {what} {value}"));
    }
    text.push('\n');
    if let Some(clusters) = &report.clusters {
        clusters.automatic.reasons.iter().for_each(|reason| text += &format!("  {reason}\n"));
        let [segments, merged, categories, _] = clusters.counts;
        let _ = writeln!(text, "  level 1: {segments} segments, level 2: {merged}, level 3: {categories} categories");
    }
    if !report.levels.is_empty() {
        text += &levels(&report.levels);
    }
    if report.trials.len() > 1 {
        let _ = writeln!(text, "\n{:>12} {:>10} {:>14} {:>8}", "strength", "segments", "energy", "oracle");
        for trial in &report.trials {
            let oracle = trial.oracle_accuracy.map_or(String::new(), |a| format!("{:.2} %", 100.0 * a));
            let _ =
                writeln!(text, "{:>12.5} {:>10} {:>14.2} {oracle:>8}", trial.strength, trial.segments, trial.energy);
        }
    }
    let _ = writeln!(text, "\n{:>12} {:>10} {:>12}", "points", "segments", "in all");
    let most = report.sizes.iter().map(|bin| bin.segments).max().unwrap_or(0);
    for bin in &report.sizes {
        let bar = bar(bin.segments as f64, most as f64);
        let _ = writeln!(text, "{:>12} {:>10} {:>12} {bar}", bin.from, bin.segments, bin.nodes);
    }
    if let (Some(accuracy), Some(b)) = (report.oracle_accuracy, report.boundaries) {
        let _ = write!(
            text,
            "\noracle accuracy {:.2} % (the best that classifying whole segments can reach); boundary recall {} %, \
             precision {} %",
            100.0 * accuracy,
            percent(b.recall),
            percent(b.precision)
        );
    }
    text.trim_end().to_string()
}

/// The table of Li 2018.
fn levels(levels: &[LevelReport]) -> String {
    let mut text = format!(
        "\n{:>5} {:>11} {:>9} {:>9} {:>9} {:>9} {:>9} {:>8}\n",
        "depth", "supervoxels", "segments", "normals s", "voxels s", "graph s", "cuts s", "oracle"
    );
    for l in levels {
        let oracle = l.oracle_accuracy.map_or(String::new(), |a| format!("{:.2} %", 100.0 * a));
        let s = &l.seconds;
        let _ = writeln!(
            text,
            "{:>5} {:>11} {:>9} {:>9.3} {:>9.3} {:>9.3} {:>9.3} {oracle:>8}",
            l.min_depth, l.supervoxels, l.segments, s.normals, s.supervoxels, s.graph, s.optimisation
        );
    }
    text
}

fn csv(report: &SegmentReport) -> String {
    let lines = report.sizes.iter().map(|bin| format!("{},{},{}\n", bin.from, bin.segments, bin.nodes));
    std::iter::once("points_from,segments,points\n".to_string()).chain(lines).collect()
}
