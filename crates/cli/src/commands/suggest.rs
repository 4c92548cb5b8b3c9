//! `scansion suggest`: suggests the segments to label next.

use super::segment::{CLUSTER, parted};
use super::{Context, sources};
use crate::args::{Format, Suggest};
use crate::exit_code::Failure;
use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::io::{self, Edit, atomic};
use scansion_core::neighbours::OptimalParams;
use scansion_core::recipes::{self, ClassifyParams, SuggestParams, Suggestion};
use std::fmt::Write;
use std::path::Path;

pub(crate) fn run(args: &Suggest, context: &Context<'_>) -> Result<(), Failure> {
    let kinds = args.output.iter().map(|path| kind(path)).collect::<Result<Vec<_>, _>>()?;
    for (path, kind) in args.output.iter().zip(&kinds) {
        if !matches!(kind, Kind::Cloud) {
            io::check_output(path)?;
        } else {
            io::check_cloud_output(path)?;
            io::check_dimensions(&args.input, path, &[Column::new(CLUSTER, Values::U32(Vec::new()))])?;
        }
    }
    let (cloud, labels, mut segmented) = parted(&args.input, (&args.segments, &[]), &args.labels, context)?;
    segmented.describe(&OptimalParams::default(), &context.monitor)?;
    let uncertainty = args.model.as_deref().map(|model| uncertainty(&args.input, model, context)).transpose()?;
    let labels = labels.filter(|_| args.labelled);
    let params = SuggestParams { count: args.count, ..SuggestParams::default() };
    let found = recipes::suggest(&segmented, uncertainty.as_deref(), labels.as_ref(), &params)?;
    for (path, kind) in args.output.iter().zip(kinds) {
        match kind {
            Kind::Table => atomic::write_bytes(path, csv(&found, &cloud).as_bytes())?,
            Kind::Page => atomic::write_bytes(
                path,
                recipes::suggestion_page(&found, &cloud, &segmented, &context.monitor)?.as_bytes(),
            )?,
            Kind::Cloud => {
                let column = Column::new(CLUSTER, Values::U32(segmented.clusters.clone()));
                let report = io::rewrite(&args.input, path, &[Edit::Dimension(column)], &context.write_options())?;
                context.report(path, &report);
            }
        }
    }
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&found).unwrap_or_default(),
        Format::Csv => csv(&found, &cloud),
        Format::Table => table(&found),
    })
}

/// The kind of an output, by its extension.
enum Kind {
    Table,
    Page,
    Cloud,
}

fn kind(path: &Path) -> Result<Kind, Failure> {
    match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
        Some("csv") => Ok(Kind::Table),
        Some("html" | "htm") => Ok(Kind::Page),
        Some("las" | "laz" | "ply" | "pcd" | "npz") => Ok(Kind::Cloud),
        _ => Err(Failure::Usage(format!("{}: use .csv, .html, .las, .laz or .ply", path.display()))),
    }
}

/// Normalised entropy of each point, by a model without regularisation.
fn uncertainty(input: &Path, model: &Path, context: &Context<'_>) -> Result<Vec<f32>, Failure> {
    let model = sources::model(Some(model))?;
    let cloud = io::read_with(input, &context.read_options())?;
    let params = ClassifyParams { regularise: Some(recipes::Regularise::Local), ..ClassifyParams::default() };
    let found = recipes::classify(&cloud, &model, &params, &context.monitor)?;
    let most = (model.classes.len() as f32).ln().max(f32::MIN_POSITIVE);
    Ok(found.entropy.iter().map(|e| (e / most).clamp(0.0, 1.0)).collect())
}

/// The table that `scansion train --weak-labels` accepts when its last column is filled in.
fn csv(found: &[Suggestion], cloud: &Cloud) -> String {
    let mut text = String::from("cluster_id,x,y,z,points,uncertainty,score,class\n");
    for s in found {
        let [x, y, z] = cloud.xyz(s.point as usize).map(short);
        let _ = writeln!(text, "{},{x},{y},{z},{},{:.4},{:.4},", s.cluster_id, s.points, s.uncertainty, s.score);
    }
    text
}

/// A coordinate with at most seven decimals (a centimetre if the unit is degrees).
fn short(value: f64) -> String {
    let text = format!("{value:.7}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

fn table(found: &[Suggestion]) -> String {
    let mut text =
        format!("{:>10} {:>9} {:>12} {:>10} {:>10}\n", "ClusterID", "points", "uncertainty", "newness", "score");
    for s in found {
        let _ = writeln!(
            text,
            "{:>10} {:>9} {:>12.3} {:>10.3} {:>10.2}",
            s.cluster_id, s.points, s.uncertainty, s.diversity, s.score
        );
    }
    text.trim_end().to_string()
}
