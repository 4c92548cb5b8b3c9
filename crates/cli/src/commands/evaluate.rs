//! `scansion evaluate`: compares a classification with the truth.

use super::labels::{LabelSource, unused};
use super::{Context, sources};
use crate::args::{Evaluate, Format};
use crate::exit_code::Failure;
use scansion_core::classes::LabelMap;
use scansion_core::cloud::{Cloud, Coordinates, MetricCloud, names};
use scansion_core::evaluation::{
    ClassEdges, Confusion, LabelledPartition, SegmentationErrorParams, no_point_to_score, report, segmentation_error,
};
use scansion_core::io::{self, atomic};
use scansion_core::recipes::{self, ClassifyParams, LabelParams, Labels, read_labels};
use scansion_core::segmentation::Partition;
use scansion_core::{Error, images};
use std::collections::BTreeSet;
use std::path::Path;

pub(crate) fn run(args: &Evaluate, context: &Context<'_>) -> Result<(), Failure> {
    args.output.iter().try_for_each(|path| kind(path).and_then(|_| Ok(io::check_output(path)?)))?;
    let inputs: Vec<&Path> = std::iter::once(&args.truth).chain(&args.prediction).map(AsRef::as_ref).collect();
    let source = LabelSource::new(&args.labels, &inputs)?;
    let maps = Maps::new(args, &source)?;
    let cloud = io::read_with(&args.truth, &context.read_options())?;
    let truth = source.read_mapped((&args.truth, &cloud), &maps.truth, context)?;
    let absent = source.absent(std::iter::once(&truth));
    absent.into_iter().chain(source.unused()).for_each(|text| context.printer.warning(&text));
    if let Some(cell) = args.segmentation_error {
        return segments((args, cell), (&cloud, &truth), context);
    }
    let predicted = predicted(args, &cloud, context)?;
    maps.unused_of(&predicted).iter().for_each(|text| context.printer.warning(text));
    let predicted = maps.predicted(&predicted, &args.labels.map.join(","))?;
    if predicted.len() != truth.codes.len() {
        let text = format!(
            "{} points in the truth, {} in the prediction; both must be the same points in the same order",
            truth.codes.len(),
            predicted.len()
        );
        return Err(Error::input(text).into());
    }
    let mut confusion = Confusion::from_partial(&truth.codes, &predicted)?.named(truth.scheme, &truth.names);
    if !args.labels.classes.is_empty() {
        confusion = confusion.with_means_over(&args.labels.classes);
    }
    confusion.check_some()?;
    args.output.iter().try_for_each(|path| write(path, &confusion, context))?;
    context.printer.data(&match context.printer.format {
        Format::Json => report::to_json(&confusion)?,
        Format::Csv => report::to_csv(&confusion),
        Format::Table => report::to_table(&confusion),
    })
}

/// The segmentation error of the segments in a dimension.
fn segments(
    (args, cell): (&Evaluate, f64),
    (cloud, truth): (&Cloud, &Labels),
    context: &Context<'_>,
) -> Result<(), Failure> {
    if let Some(path) = args.output.iter().find(|path| path.extension().is_none_or(|e| e != "json")) {
        return Err(Failure::Usage(format!("{}: write .json", path.display())));
    }
    let read = |path| io::read_with(path, &context.read_options());
    let other = args.prediction.as_deref().map(read).transpose()?;
    let other = other.as_ref().unwrap_or(cloud);
    same_places(cloud, other)?;
    let name = &args.segment_dimension;
    let column = other.column(name).filter(|column| column.values.len() == truth.codes.len()).ok_or_else(|| {
        Error::input(format!("no dimension {name} with the segments of the same points (scansion segment makes one)"))
    })?;
    let points = MetricCloud::new(cloud, context.unit, &context.monitor)?.points(&context.monitor)?;
    let index = &points.frame.index;
    let labels: Vec<u32> = index.iter().map(|&i| column.values.get(i as usize) as u32).collect();
    let codes: Vec<Option<u8>> = index.iter().map(|&i| truth.codes[i as usize]).collect();
    if codes.iter().all(Option::is_none) {
        return Err(no_point_to_score(codes.len() as u64).into());
    }
    let partition = Partition::from_labels_watched(&labels, &context.monitor)?;
    let labelled = LabelledPartition { points: &points.positions, partition: &partition, truth: &codes };
    let params = SegmentationErrorParams { cell, ..SegmentationErrorParams::default() };
    let found = segmentation_error(labelled, &params, &context.monitor)?;
    let json = serde_json::to_string_pretty(&found).map_err(|e| Error::input(format!("report: {e}")))?;
    args.output.iter().try_for_each(|path| atomic::write_bytes(path, json.as_bytes()))?;
    context.printer.data(&match context.printer.format {
        Format::Json => json,
        Format::Csv => {
            let line = |c: &ClassEdges| format!("{},{},{},{}\n", c.code, c.reference, c.error, c.precision);
            let lines = found.classes.iter().map(line);
            std::iter::once("code,boundary_cells,error,precision\n".to_string()).chain(lines).collect()
        }
        Format::Table => {
            let line =
                |c: &ClassEdges| format!("{:>5} {:>14} {:>8.3} {:>10.3}\n", c.code, c.reference, c.error, c.precision);
            let head = format!("{:>5} {:>14} {:>8} {:>10}\n", "code", "boundary cells", "error", "precision");
            let shown = |v: f64| if v.is_nan() { "-".into() } else { format!("{v:.3}") };
            let [error, precision] = [found.error, found.precision].map(shown);
            let mean = format!("segmentation error {error}, precision {precision}\n");
            std::iter::once(head).chain(found.classes.iter().map(line)).chain([mean]).collect()
        }
    })
}

/// The mappings of the codes on both sides.
struct Maps {
    truth: LabelMap,
    /// `None`: only `--map` applies.
    predicted: Option<LabelMap>,
    /// The option that the prediction's map is from.
    option: &'static str,
}

impl Maps {
    /// From `--map-of` for a single file, `--map-truth` and `--map-predicted`, or `--map`.
    fn new(args: &Evaluate, source: &LabelSource<'_>) -> Result<Self, Error> {
        let given = |flag: &[String]| (!flag.is_empty()).then(|| flag.join(","));
        let own = |input: &Path, flag: &[String], name: &'static str| match (source.own_map(input), given(flag)) {
            (Some(_), Some(text)) => Err(Error::parameter(name, text, "one map a file; --map-of gives it another")),
            (Some(map), None) => Ok(Some(map.clone())),
            (None, Some(text)) => text.parse().map(Some),
            (None, None) => Ok(None),
        };
        let truth = own(&args.truth, &args.map_truth, "map-truth")?;
        let predicted = match &args.prediction {
            Some(path) => own(path, &args.map_predicted, "map-predicted")?,
            None => given(&args.map_predicted).map(|text| text.parse()).transpose()?,
        };
        let asked = truth.is_some() || predicted.is_some();
        // If one side has its own map, the other side uses --map, or none.
        let map: LabelMap = args.labels.map.join(",").parse()?;
        let of_file = args.prediction.as_deref().is_some_and(|path| source.own_map(path).is_some());
        let option = match predicted.is_some() {
            true if of_file => "--map-of",
            true => "--map-predicted",
            false => "--map",
        };
        let predicted = predicted.or_else(|| asked.then(|| map.clone()));
        Ok(Self { truth: truth.unwrap_or(map), predicted, option })
    }

    /// The prediction's codes. A map for both sides must not change them, because the intention would be unclear.
    fn predicted(&self, codes: &[Option<u8>], map: &str) -> Result<Vec<Option<u8>>, Error> {
        if let Some(own) = &self.predicted {
            return Ok(codes.iter().map(|code| code.map(|c| own.apply(c))).collect());
        }
        check_common_map(map, &present(codes))?;
        Ok(codes.to_vec())
    }

    /// Codes in the prediction's own map that it does not have, in words.
    fn unused_of(&self, codes: &[Option<u8>]) -> Option<String> {
        self.predicted.as_ref().and_then(|map| unused(map, &present(codes), self.option))
    }
}

fn present(codes: &[Option<u8>]) -> BTreeSet<u32> {
    let mut found = [false; 256];
    codes.iter().flatten().for_each(|&code| found[usize::from(code)] = true);
    (0u32..).zip(found).filter(|(_, found)| *found).map(|(code, _)| code).collect()
}

/// Fails if a map for both sides would change one of the prediction's codes, because the intention would be unclear.
pub(super) fn check_common_map(text: &str, codes: &BTreeSet<u32>) -> Result<(), Error> {
    let map: LabelMap = text.parse()?;
    let changes = |code: &u32| map.of_value(f64::from(*code)).is_some_and(|new| u32::from(new) != *code);
    match codes.iter().copied().find(changes) {
        None => Ok(()),
        Some(code) => Err(Error::parameter(
            "map",
            text,
            format!(
                "a map that leaves the prediction's codes as they are, but it has code {code}; use --map-truth {text} to \
                 change the truth only, and --map-predicted {text} as well to change both"
            ),
        )),
    }
}

/// Codes of the prediction, none skipped; `None` where it has no class, which counts as an error of the prediction.
fn predicted(args: &Evaluate, cloud: &Cloud, context: &Context<'_>) -> Result<Vec<Option<u8>>, Failure> {
    if args.model.is_some() {
        let model = sources::model(args.model.as_deref())?;
        let params = ClassifyParams { metres_per_unit: context.unit, ..ClassifyParams::default() };
        let result = recipes::classify(cloud, &model, &params, &context.monitor)?;
        result.warnings.iter().for_each(|w| context.printer.warning(w));
        if recipes::is_builtin(&model) {
            recipes::builtin_misfit(&result).iter().for_each(|w| context.printer.warning(w));
            context.printer.note(&recipes::builtin_limits(&model.fitted.rules()));
        }
        return Ok(result.codes.into_iter().map(Some).collect());
    }
    let default = if args.prediction.is_some() { names::CLASSIFICATION } else { "PredictedClassification" };
    let dimension = args.prediction_dimension.clone().unwrap_or_else(|| default.into());
    let params = LabelParams { dimension, unlabelled: Some(Vec::new()), ..LabelParams::default() };
    let read = |path| io::read_with(path, &context.read_options());
    let other = args.prediction.as_deref().map(read).transpose()?;
    let other = other.as_ref().unwrap_or(cloud);
    same_places(cloud, other)?;
    Ok(read_labels(other, &params)?.codes)
}

/// Two files of equal length with points at different positions are not the same scan, or not in the same order.
pub(super) fn same_places(a: &Cloud, b: &Cloud) -> Result<(), Error> {
    // A centimetre; less where the steps of both are finer, as in degrees.
    let step = |cloud: &Cloud, axis: usize| match cloud.coordinates() {
        Coordinates::Scaled { scale, .. } => scale[axis],
        Coordinates::Float(_) => 0.01,
    };
    let most = [0, 1, 2].map(|axis| (20.0 * step(a, axis).max(step(b, axis))).min(0.01));
    let apart = |i: &usize| {
        let (p, q) = (a.xyz(*i), b.xyz(*i));
        (0..3).any(|axis| (p[axis] - q[axis]).abs() > most[axis])
    };
    match (0..a.len().min(b.len())).find(apart) {
        Some(i) => Err(Error::input(format!(
            "point {i} is at {:?} in the truth and at {:?} in the prediction; both must be the same points in the same \
             order",
            a.xyz(i),
            b.xyz(i)
        ))),
        None => Ok(()),
    }
}

/// The kind of an output, by its extension.
enum Kind {
    Json,
    Csv,
    Picture,
}

fn kind(path: &Path) -> Result<Kind, Failure> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("json") => Ok(Kind::Json),
        Some("csv") => Ok(Kind::Csv),
        Some("png") => Ok(Kind::Picture),
        _ => Err(Failure::Usage(format!("{}: write .json, .csv or .png", path.display()))),
    }
}

fn write(path: &Path, confusion: &Confusion, context: &Context<'_>) -> Result<(), Failure> {
    let bytes = match kind(path)? {
        Kind::Json => report::to_json(confusion)?.into_bytes(),
        Kind::Csv => report::to_csv(confusion).into_bytes(),
        Kind::Picture => images::confusion_picture(confusion).to_png(&context.monitor)?,
    };
    Ok(atomic::write_bytes(path, &bytes)?)
}
