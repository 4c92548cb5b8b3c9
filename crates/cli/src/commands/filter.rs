//! `scansion filter`: removes noise, and points by class, height and place.

use super::Context;
use super::convert::bounds;
use super::terrain::product_params;
use crate::args::{Filter, Format, GroundArgs, NoiseArgs, OutlierMethod};
use crate::exit_code::Failure;
use scansion_core::filters::{Area, FilterParams, FilterReport, RadiusParams, StatisticalParams, filter_file};
use scansion_core::terrain::{ProductParams, noise_classes};
use scansion_core::{Error, Result};
use std::fmt::Write;

pub(crate) fn run(args: &Filter, context: &Context<'_>) -> std::result::Result<(), Failure> {
    let params = FilterParams { bounds: bounds(&args.bounds)?, ..params(args, context)? };
    if params.is_empty() {
        let all = "--classes, --drop-classes, --outliers, --height, --bounds or --polygon";
        return Err(Failure::Usage(format!("filter: nothing to do; give {all}")));
    }
    if args.height.is_none() && finds_ground(&args.ground) {
        let text = "filter: --cell, --window and others about the ground need --height";
        return Err(Failure::Usage(text.into()));
    }
    let report = filter_file(&args.input, &args.output, &params, &context.write_options())?;
    report.notes.iter().for_each(|text| context.printer.note(text));
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&report).unwrap_or_default(),
        Format::Csv => csv(&report),
        Format::Table => table(&report),
    })
}

/// Whether any setting about the ground is given.
fn finds_ground(args: &GroundArgs) -> bool {
    let GroundArgs { cell, ground_classes, ground_filter, window, slope, wall, noise_classes, .. } = args;
    let numbers = [cell, window, slope, wall].into_iter().any(Option::is_some);
    numbers || !ground_classes.is_empty() || *ground_filter || noise_classes.is_some()
}

fn params(args: &Filter, context: &Context<'_>) -> Result<FilterParams> {
    let NoiseArgs { neighbours, multiplier, radius, min_neighbours, mark, .. } = args.noise;
    let (statistical, sparse) = (StatisticalParams::default(), RadiusParams::default());
    let statistical = StatisticalParams {
        neighbours: neighbours.unwrap_or(statistical.neighbours),
        multiplier: multiplier.unwrap_or(statistical.multiplier),
    };
    let sparse = RadiusParams {
        radius: radius.unwrap_or(sparse.radius),
        min_neighbours: min_neighbours.unwrap_or(sparse.min_neighbours),
    };
    Ok(FilterParams {
        classes: args.classes.clone(),
        drop_classes: args.drop_classes.clone(),
        statistical: has(args, OutlierMethod::Statistical, neighbours.is_some() || multiplier.is_some())?
            .then_some(statistical),
        radius: has(args, OutlierMethod::Radius, radius.is_some() || min_neighbours.is_some())?.then_some(sparse),
        mark,
        height: args.height,
        find_ground: finds_ground(&args.ground),
        ground: ground(args, context)?,
        polygon: polygon(args)?,
        outside: args.outside,
        metres_per_unit: context.unit,
        ..FilterParams::default()
    })
}

/// How the ground is found; what is noise depends on the meaning of the classes that the user gives.
fn ground(args: &Filter, context: &Context<'_>) -> Result<ProductParams> {
    let own = product_params(&args.ground)?;
    let noise = own.noise.clone().or_else(|| context.naming.scheme.map(|scheme| noise_classes(scheme).to_vec()));
    Ok(ProductParams { noise, ..own })
}

/// Whether noise is searched for by this method; settings of a method that is not used are refused.
fn has(args: &Filter, method: OutlierMethod, set: bool) -> Result<bool> {
    let used = args.noise.outliers.contains(&method);
    match (method, set && !used) {
        (_, false) => Ok(used),
        (OutlierMethod::Statistical, true) => {
            Err(Error::parameter("outliers", "radius", "statistical with --neighbours and --multiplier"))
        }
        (OutlierMethod::Radius, true) => {
            Err(Error::parameter("outliers", "statistical", "radius with --radius and --min-neighbours"))
        }
    }
}

fn polygon(args: &Filter) -> Result<Option<Area>> {
    match (args.polygon_file(), &args.polygon) {
        (Some(path), _) => Area::read(path).map(Some),
        (None, Some(text)) => text.to_str().unwrap_or_default().parse().map(Some),
        (None, None) => Ok(None),
    }
}

fn table(report: &FilterReport) -> String {
    let mut text = format!("{:<22} {:>12} {:>12} {:>12}\n", "", "points", "removed", "marked");
    let mut left = report.points;
    let _ = writeln!(text, "{:<22} {left:>12}", "input");
    for step in &report.steps {
        left -= step.removed;
        let _ = writeln!(text, "{:<22} {left:>12} {:>12} {:>12}", step.filter, step.removed, step.marked);
    }
    let _ = writeln!(text, "{:<22} {:>12} {:>12}", "output", report.kept, report.points - report.kept);
    text
}

fn csv(report: &FilterReport) -> String {
    let mut left = report.points;
    let mut text = format!("filter,points,removed,marked\ninput,{left},0,0\n");
    for step in &report.steps {
        left -= step.removed;
        let _ = writeln!(text, "{},{left},{},{}", step.filter, step.removed, step.marked);
    }
    text
}
