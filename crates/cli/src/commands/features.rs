//! `scansion features`: computes or lists multi-scale features.

use super::feature_rows::{RowColumns, RowFile};
use super::{Context, sources};
use crate::args::{Features, Format};
use crate::exit_code::Failure;
use scansion_core::cloud::{Column, Values};
use scansion_core::features::definition::{self, Definition};
use scansion_core::features::{FeatureStream, Wanted};
use scansion_core::io::{self, Columns, Edit};

pub(crate) fn run(args: &Features, context: &Context<'_>) -> Result<(), Failure> {
    let (Some(input), Some(output), false) = (&args.input, &args.output, args.list) else {
        return context.printer.data(&list(context.printer.format));
    };
    let table = matches!(output.extension().and_then(|e| e.to_str()), Some("npy" | "csv"));
    if table {
        io::check_output(output)?
    } else {
        io::check_cloud_output(output)?
    }
    let set = sources::recipe(&args.recipe)?.features;
    let asked = Wanted::Asked(&args.only);
    // Names contain the first scale; if the cloud determines it, they are not known yet.
    if let (Some(scale), false) = (set.pyramid.first_scale, table) {
        let columns =
            asked.names(&set.names(scale))?.into_iter().map(|name| Column::new(name, Values::F32(Vec::new())));
        io::check_dimensions(input, output, &columns.collect::<Vec<_>>())?;
    }
    let mut options = context.read_options();
    options.columns = Columns::Only(set.columns());
    let cloud = io::read_with(input, &options)?;
    io::check_steps(input, output, &cloud, &context.write_options())?;
    let stream = FeatureStream::prepare(&cloud, &set, asked, &context.monitor)?;
    let (points, width) = (cloud.len(), stream.names().len());
    match output.extension().and_then(|e| e.to_str()) {
        Some("npy") => {
            let mut file = RowFile::create(output, &npy_header(points, width), width)?;
            stream.for_each(&context.monitor, |rows| file.put(rows))?;
            file.finish()?;
        }
        Some("csv") => {
            let mut file = RowFile::create(output, &[], width)?;
            stream.for_each(&context.monitor, |rows| file.put(rows))?;
            file.write_csv(output, (&cloud, stream.names()), &context.monitor)?;
        }
        _ => {
            let mut columns = RowColumns::new(points, width)?;
            stream.for_each(&context.monitor, |rows| {
                columns.put(rows);
                Ok(())
            })?;
            let names = stream.names().to_vec();
            drop(stream);
            drop(cloud);
            let edits: Vec<Edit> = columns.named(&names).map(Edit::Dimension).collect();
            io::rewrite(input, output, &edits, &context.write_options())?;
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
