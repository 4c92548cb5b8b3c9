//! `scansion features`: compute multi-scale features, or list them.

use super::{Context, sources};
use crate::args::{Features, Format};
use crate::exit_code::Failure;
use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::features::{self, FeatureTable, definition};
use scansion_core::io::{self, Edit, atomic};
use std::fmt::Write;
use std::path::Path;

pub(crate) fn run(args: &Features, context: &Context<'_>) -> Result<(), Failure> {
    let (Some(input), Some(output), false) = (&args.input, &args.output, args.list) else {
        return context.printer.data(&list(context.printer.format));
    };
    sources::guard_input(input, output, args.overwrite)?;
    let set = sources::recipe(&args.recipe)?.features;
    let cloud = io::read_with(input, &context.read_options())?;
    io::check_steps(input, output, &cloud, &context.write_options())?;
    let table = features::table(&cloud, &set, &context.monitor)?;
    let wanted = wanted(&table, &args.only)?;
    match output.extension().and_then(|e| e.to_str()) {
        Some("npy") => atomic::write_bytes(output, &npy(&table, &wanted))?,
        Some("csv") => atomic::write_bytes(output, csv(&cloud, &table, &wanted).as_bytes())?,
        _ => dimensions(input, output, &table, &wanted, context)?,
    }
    context.printer.note(&format!("{}: {} features of {} points", output.display(), wanted.len(), cloud.len()));
    Ok(())
}

/// Columns whose name is one of `only`, or begins with it before the scale; all if `only` is empty.
fn wanted(table: &FeatureTable, only: &[String]) -> Result<Vec<usize>, Failure> {
    let matches =
        |name: &str, asked: &str| name == asked || name.strip_prefix(asked).is_some_and(|rest| rest.starts_with("_r"));
    if let Some(unknown) = only.iter().find(|asked| !table.names.iter().any(|n| matches(n, asked))) {
        return Err(Failure::Usage(format!("no feature {unknown}; there are: {}", table.names.join(", "))));
    }
    let named = |name: &String| only.is_empty() || only.iter().any(|asked| matches(name, asked));
    Ok((0..table.width()).filter(|&c| named(&table.names[c])).collect())
}

fn dimensions(
    input: &Path,
    output: &Path,
    table: &FeatureTable,
    wanted: &[usize],
    context: &Context<'_>,
) -> Result<(), Failure> {
    let column = |&c: &usize| (0..table.rows()).map(|row| table.row(row)[c]).collect::<Vec<f32>>();
    let edits: Vec<Edit> =
        wanted.iter().map(|c| Edit::Dimension(Column::new(table.names[*c].clone(), Values::F32(column(c))))).collect();
    io::rewrite(input, output, &edits, &context.write_options())?;
    Ok(())
}

/// NumPy's array file, version 1.0: little-endian f4, C order.
fn npy(table: &FeatureTable, wanted: &[usize]) -> Vec<u8> {
    let mut header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", table.rows(), wanted.len());
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for row in 0..table.rows() {
        wanted.iter().for_each(|&c| bytes.extend(table.row(row)[c].to_le_bytes()));
    }
    bytes
}

fn csv(cloud: &Cloud, table: &FeatureTable, wanted: &[usize]) -> String {
    let names: Vec<&str> = wanted.iter().map(|&c| table.names[c].as_str()).collect();
    let mut text = format!("x,y,z,{}\n", names.join(","));
    for row in 0..table.rows() {
        let [x, y, z] = cloud.xyz(row);
        let _ = write!(text, "{x},{y},{z}");
        wanted.iter().for_each(|&c| {
            let _ = write!(text, ",{}", table.row(row)[c]);
        });
        text.push('\n');
    }
    text
}

/// The table of definitions, in the asked form.
fn list(format: Format) -> String {
    match format {
        Format::Json => serde_json::to_string_pretty(definition::ALL).unwrap_or_default(),
        Format::Csv => {
            let lines = definition::ALL
                .iter()
                .map(|d| format!("{},{},\"{}\",\"{}\"\n", d.name, d.group.name(), d.formula, d.range));
            std::iter::once("name,group,formula,range\n".to_string()).chain(lines).collect()
        }
        Format::Table => {
            let lines = definition::ALL
                .iter()
                .map(|d| format!("{:<22} {:<11} {:<44} {}\n", d.name, d.group.name(), d.formula, d.range));
            std::iter::once(format!("{:<22} {:<11} {:<44} {}\n", "name", "group", "formula", "range"))
                .chain(lines)
                .collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> FeatureTable {
        let names = ["Planarity_r0p4", "Planarity_r0p8", "Linearity_r0p4"].map(String::from).to_vec();
        FeatureTable { names, values: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0] }
    }

    #[test]
    fn features_are_chosen_by_name_with_or_without_scale() {
        assert_eq!(wanted(&table(), &["Planarity".into()]).unwrap(), [0, 1]);
        assert_eq!(wanted(&table(), &["Linearity_r0p4".into()]).unwrap(), [2]);
        let message = wanted(&table(), &["Planar".into()]).unwrap_err().to_string();
        assert!(message.contains("Planar;") && message.contains("Planarity_r0p8"), "{message}");
    }

    #[test]
    fn npy_has_an_aligned_header_and_all_values() {
        let bytes = npy(&table(), &[0, 2]);
        let header = u16::from_le_bytes([bytes[8], bytes[9]]) as usize;
        assert_eq!((10 + header) % 64, 0);
        assert_eq!(bytes[10 + header..], [1.0f32, 3.0, 4.0, 6.0].map(f32::to_le_bytes).concat());
    }
}
