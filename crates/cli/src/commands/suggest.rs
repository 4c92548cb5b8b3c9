//! `scansion suggest`: suggests the segments to label next.

use super::labels::LabelSource;
use super::segment::{CLUSTER, parted};
use super::{Context, sources};
use crate::args::{Format, Suggest};
use crate::exit_code::Failure;
use scansion_core::classes::ClassTable;
use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::io::{self, Columns, Edit, atomic};
use scansion_core::neighbours::OptimalParams;
use scansion_core::recipes::{
    self, ClassifyParams, Doubt, KnownPoints, LabelFile, Labels, Model, PickedCloud, Picking, Regularise, Segmented,
    SuggestParams, Suggestion, WeakLabels,
};
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
    let model = args.model.as_deref().map(|path| sources::model(Some(path))).transpose()?;
    let offered = match (&args.offer, &model) {
        (Some(list), _) => list.clone(),
        (None, Some(model)) => model.trained.classes.clone(),
        (None, None) => ClassTable::default(),
    };
    let (cloud, own, mut segmented) = parted(&args.input, (&args.segments, &[]), &args.labels, context)?;
    segmented.describe(&OptimalParams::default(), &context.monitor)?;
    let picked = picked(args, &segmented, context)?;
    let said = match &model {
        Some(model) => {
            if recipes::is_builtin(model) {
                context.printer.note(&recipes::builtin_limits(&model.fitted.rules()));
            }
            Some((probabilities(&args.input, model, context)?, model.trained.classes.len()))
        }
        None => None,
    };
    let known = KnownPoints {
        doubt: said.as_ref().map(|(values, classes)| Doubt::Probabilities(values, *classes)),
        labels: picked.as_ref().or(own.as_ref().filter(|_| args.labelled)),
    };
    let params = SuggestParams { count: args.count, ..SuggestParams::default() };
    let found = recipes::suggest(&segmented, known, &params, &context.monitor)?;
    for (path, kind) in args.output.iter().zip(kinds) {
        match kind {
            Kind::Table => atomic::write_bytes(path, csv(&found, &cloud).as_bytes())?,
            Kind::Page => {
                let page = recipes::suggestion_page(&found, &segmented, &offered, &context.monitor)?;
                atomic::write_bytes(path, page.as_bytes())?;
            }
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

/// The labels of earlier rounds. Segments in their tables are those of the input's ClusterID if it has one, else those
/// found now, which are the same while the settings are.
fn picked(args: &Suggest, segmented: &Segmented, context: &Context<'_>) -> Result<Option<Labels>, Failure> {
    if args.weak_labels.is_empty() {
        return Ok(None);
    }
    let paths: Vec<&Path> = args.weak_labels.iter().map(AsRef::as_ref).collect();
    let source = LabelSource::new(&args.labels, &paths)?;
    let files: Vec<LabelFile> =
        paths.iter().map(|path| source.picked(path, context)).collect::<scansion_core::Result<_>>()?;
    let mut options = context.read_options();
    options.columns = Columns::Only(vec![CLUSTER.to_string()]);
    let mut cloud = io::read_with(&args.input, &options)?;
    if cloud.column(CLUSTER).is_none() {
        cloud.set_column(Column::new(CLUSTER, Values::U32(segmented.clusters.clone())))?;
    }
    let picking = Picking { metres: cloud.metres(None)?, within: WeakLabels::default().within };
    let labels = LabelFile::apply_all(&files, &[PickedCloud { cloud: &cloud, picking }], &context.monitor)?;
    Ok(labels.into_iter().next())
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

/// Class probabilities of each point, by a model without regularisation.
fn probabilities(input: &Path, model: &Model, context: &Context<'_>) -> Result<Vec<f32>, Failure> {
    let cloud = io::read_with(input, &context.read_options())?;
    let params =
        ClassifyParams { regularise: Some(Regularise::None), probabilities: true, ..ClassifyParams::default() };
    Ok(recipes::classify(&cloud, model, &params, &context.monitor)?.probabilities.unwrap_or_default())
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
