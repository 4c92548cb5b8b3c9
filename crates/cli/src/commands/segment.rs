//! `scansion segment`: part a cloud into segments.

use super::{Context, sources};
use crate::args::{Format, LabelArgs, MethodArg, Segment, SegmentArgs};
use crate::exit_code::Failure;
use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::io::{self, Columns, Edit};
use scansion_core::recipes::{self, Labels, SegmentParams, SegmentReport, Segmented, read_labels};
use scansion_core::segmentation::{Intent, Method, PartitionParams};
use std::fmt::Write;
use std::path::Path;

/// Name of the dimension.
pub(crate) const CLUSTER: &str = "ClusterID";

pub(crate) fn run(args: &Segment, context: &Context<'_>) -> Result<(), Failure> {
    sources::guard_input(&args.input, &args.output, args.overwrite)?;
    let (_, _, found) = parted(&args.input, &args.segments, &args.labels, context)?;
    let edit = Edit::Dimension(Column::new(CLUSTER, Values::U32(found.clusters)));
    let report = io::rewrite(&args.input, &args.output, &[edit], &context.write_options())?;
    context.report(&args.output, &report);
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&found.report).unwrap_or_default(),
        Format::Csv => csv(&found.report),
        Format::Table => table(&found.report),
    })
}

/// Reads a cloud, with its labels if it has any, and parts it.
pub(crate) fn parted(
    input: &Path,
    args: &SegmentArgs,
    labels: &LabelArgs,
    context: &Context<'_>,
) -> Result<(Cloud, Option<Labels>, Segmented), Failure> {
    let params = sources::labels(labels, input)?;
    let mut options = context.read_options();
    options.columns = Columns::Only(vec![params.dimension.clone()]);
    let cloud = io::read_with(input, &options)?;
    let labels = match cloud.column(&params.dimension) {
        Some(_) => Some(read_labels(&cloud, &params)?).filter(|l| l.unlabelled < cloud.len() as u64),
        None => None,
    };
    let found = recipes::segment(&cloud, labels.as_ref(), &settings(args), &context.monitor)?;
    Ok((cloud, labels, found))
}

fn settings(args: &SegmentArgs) -> SegmentParams {
    let mut params = SegmentParams::default();
    params.neighbourhood.k_min = args.k_min;
    params.neighbourhood.k_max = params.neighbourhood.k_max.max(args.k_min);
    let intent = [
        args.strength.map(Intent::Strength),
        args.segments_per_hectare.map(Intent::SegmentsPerHectare),
        args.smallest_object.map(Intent::SmallestObject),
        args.oracle_loss.map(Intent::OracleAccuracy),
    ];
    params.partition = PartitionParams {
        method: match args.method {
            MethodArg::CutPursuit => Method::CutPursuit,
            MethodArg::Merge => Method::Merge,
        },
        intent: intent.into_iter().flatten().next().unwrap_or(params.partition.intent),
        cutoff: args.cutoff,
        seed: args.seed,
        ..PartitionParams::default()
    };
    params
}

fn table(report: &SegmentReport) -> String {
    let mut text = format!("{} segments, strength {:.4}\n", report.segments, report.strength);
    if report.trials.len() > 1 {
        let _ = writeln!(text, "\n{:>12} {:>10} {:>14} {:>8}", "strength", "segments", "energy", "oracle");
        for trial in &report.trials {
            let oracle = trial.oracle_accuracy.map_or(String::new(), |a| format!("{:.2} %", 100.0 * a));
            let _ =
                writeln!(text, "{:>12.5} {:>10} {:>14.2} {oracle:>8}", trial.strength, trial.segments, trial.energy);
        }
    }
    let _ = writeln!(text, "\n{:>12} {:>10} {:>12}", "points", "segments", "in all");
    let most = report.sizes.iter().map(|bin| bin.segments).max().unwrap_or(1).max(1);
    for bin in &report.sizes {
        let bar = "#".repeat((bin.segments * 40).div_ceil(most) as usize);
        let _ = writeln!(text, "{:>12} {:>10} {:>12} {bar}", bin.from, bin.segments, bin.nodes);
    }
    if let (Some(accuracy), Some(b)) = (report.oracle_accuracy, report.boundaries) {
        let _ = write!(
            text,
            "\nnaming whole segments could reach {:.2} % of the labels; boundary recall {:.2} %, precision {:.2} %",
            100.0 * accuracy,
            100.0 * b.recall,
            100.0 * b.precision
        );
    }
    text.trim_end().to_string()
}

fn csv(report: &SegmentReport) -> String {
    let lines = report.sizes.iter().map(|bin| format!("{},{},{}\n", bin.from, bin.segments, bin.nodes));
    std::iter::once("points_from,segments,points\n".to_string()).chain(lines).collect()
}
