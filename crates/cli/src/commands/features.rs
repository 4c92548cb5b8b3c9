//! `scansion features`: computes or lists multi-scale features.

use super::feature_rows::{NamedRows, RowColumns, RowFile};
use super::{Context, sources};
use crate::args::{Features, Format};
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::cloud::{Column, MetricCloud, Values};
use scansion_core::features::definition::{self, Definition, Group};
use scansion_core::features::{FeatureStream, Rows, Wanted, optimal_features};
use scansion_core::io::{self, Columns, Edit, ReadOptions};
use scansion_core::neighbours::OptimalParams;
use std::path::Path;

pub(crate) fn run(args: &Features, context: &Context<'_>) -> Result<(), Failure> {
    let (Some(input), Some(output), false) = (&args.input, &args.output, args.list) else {
        return context.printer.data(&list(context.printer.format));
    };
    let table = matches!(output.extension().and_then(|e| e.to_str()), Some("npy" | "csv"));
    match table {
        true => io::check_output(output)?,
        false => io::check_cloud_output(output).map_err(or_table)?,
    }
    io::check_holds(output, "features")?;
    let files = Files { input, output };
    if args.optimal {
        return optimal(args, files, context);
    }
    let set = sources::recipe(&args.recipe)?.features;
    sources::check_unit(set.metres_per_unit, context.unit)?;
    let asked = Wanted::Asked(&args.only);
    // Names contain the first scale; if the cloud determines it, they are not known yet.
    if let (Some(scale), false) = (set.pyramid.first_scale, table) {
        io::check_dimensions(input, output, &columns(&asked.names(&set.names(scale))?))?;
    }
    let mut options = context.read_options();
    options.columns = Columns::Only(set.columns());
    let cloud = io::read_with(input, &options)?;
    io::check_coordinates(input, output, &cloud, &context.write_options())?;
    let stream = FeatureStream::prepare(&cloud, &set, asked, &context.monitor)?;
    let names = stream.names().to_vec();
    write(NamedRows { cloud: &cloud, names: &names }, files, context, |take| stream.for_each(&context.monitor, take))
}

/// Adds the tables to the formats that can be written.
fn or_table(error: Error) -> Error {
    match error {
        Error::OutputName { path, reason } => {
            Error::OutputName { path, reason: format!("{reason}; tables: .csv, .npy") }
        }
        error => error,
    }
}

/// The name of the column with the number of neighbours.
const NEIGHBOURS: &str = "Neighbours";

/// The cloud that is read, and where its features go.
#[derive(Clone, Copy)]
struct Files<'a> {
    input: &'a Path,
    output: &'a Path,
}

/// The local descriptors of the neighbourhoods of lowest entropy, and their sizes.
fn optimal(args: &Features, files: Files<'_>, context: &Context<'_>) -> Result<(), Failure> {
    let mut params = OptimalParams::default();
    match args.neighbours[..] {
        [] => {}
        [k_min, k_max] => (params.k_min, params.k_max) = (k_min, k_max),
        _ => return Err(Failure::Usage("--neighbours takes MIN,MAX".into())),
    }
    let own = Group::Optimal.names().chain([NEIGHBOURS.to_string()]);
    let names = Wanted::Asked(&args.only).names(&own.collect::<Vec<_>>())?;
    let options = ReadOptions { columns: Columns::Only(Vec::new()), ..context.read_options() };
    let cloud = io::read_with(files.input, &options)?;
    io::check_coordinates(files.input, files.output, &cloud, &context.write_options())?;
    let scene = MetricCloud::new(&cloud, args.unit.unit, &context.monitor)?;
    scene.oddities().into_iter().for_each(|text| context.monitor.warn(text));
    let points = scene.points(&context.monitor)?;
    let found = optimal_features(&points.positions, &params, &context.monitor)?;
    let mut all = Rows { points: (0..cloud.len() as u32).collect(), ..Rows::default() };
    all.values = vec![f32::NAN; cloud.len() * names.len()];
    let sources: Vec<Option<usize>> =
        names.iter().map(|name| found.table.names.iter().position(|known| known == name)).collect();
    for (i, &point) in points.frame.index.iter().enumerate() {
        let row = all.values.chunks_exact_mut(names.len()).nth(point as usize).into_iter().flatten();
        let value = |source: &Option<usize>| source.map_or(found.k[i] as f32, |column| found.table.row(i)[column]);
        row.zip(&sources).for_each(|(slot, source)| *slot = value(source));
    }
    write(NamedRows { cloud: &cloud, names: &names }, files, context, |take| take(&all))
}

fn columns(names: &[String]) -> Vec<Column> {
    names.iter().map(|name| Column::new(name, Values::F32(Vec::new()))).collect()
}

/// Writes the features that `rows` passes on, as a matrix, a table, or dimensions of the cloud.
fn write(
    named: NamedRows<'_>,
    Files { input, output }: Files<'_>,
    context: &Context<'_>,
    rows: impl FnOnce(&mut dyn FnMut(&Rows) -> scansion_core::Result<()>) -> scansion_core::Result<()>,
) -> Result<(), Failure> {
    let (points, width) = (named.cloud.len(), named.names.len());
    match output.extension().and_then(|e| e.to_str()) {
        Some("npy") => {
            let mut file = RowFile::create(output, &npy_header(points, width), width)?;
            rows(&mut |rows| file.put(rows))?;
            file.finish()?;
        }
        Some("csv") => {
            let mut file = RowFile::create(output, &[], width)?;
            rows(&mut |rows| file.put(rows))?;
            file.write_csv(output, named, &context.monitor)?;
        }
        _ => {
            let mut columns = RowColumns::new(points, width)?;
            rows(&mut |rows| {
                columns.put(rows);
                Ok(())
            })?;
            let edits: Vec<Edit> = columns.named(named.names).map(Edit::Dimension).collect();
            let report = io::rewrite(input, output, &edits, &context.write_options())?;
            context.report(output, &report);
        }
    }
    context.printer.note(&format!("{}: {width} features of {points} points", output.display()));
    Ok(())
}

/// The header of a NumPy array file, version 1.0: little-endian f4, C order.
fn npy_header(points: usize, width: usize) -> Vec<u8> {
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({points}, {width}), }}");
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes
}

/// The registry of features, in the requested format.
fn list(format: Format) -> String {
    match format {
        Format::Json => serde_json::to_string_pretty(definition::ALL).unwrap_or_default(),
        Format::Csv => {
            let line = |d: &Definition| {
                let texts =
                    [d.formula, d.range, d.unit, d.missing, d.reach].map(|text| format!("\"{text}\"")).join(",");
                format!("{},{},{texts}\n", d.name, d.group.name())
            };
            let head = "name,group,formula,range,unit,missing,reach\n".to_string();
            std::iter::once(head).chain(definition::ALL.iter().map(line)).collect()
        }
        Format::Table => {
            let line = |[name, group, formula, range, unit, missing]: [&str; 6]| {
                format!("{name:<22} {group:<15} {formula:<58} {range:<10} {unit:<5} {missing}\n")
            };
            let row = |d: &Definition| line([d.name, d.group.name(), d.formula, d.range, d.unit, d.missing]);
            let head = line(["name", "group", "formula", "range", "unit", "missing"]);
            std::iter::once(head).chain(definition::ALL.iter().map(row)).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_of_npy_is_aligned_and_tells_the_shape() {
        let bytes = npy_header(1_234_567, 144);
        let length = u16::from_le_bytes([bytes[8], bytes[9]]) as usize;
        assert_eq!(((10 + length) % 64, bytes.len()), (0, 10 + length));
        assert!(String::from_utf8_lossy(&bytes).contains("'shape': (1234567, 144)"));
    }
}
