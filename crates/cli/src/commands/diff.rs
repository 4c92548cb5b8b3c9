//! `scansion diff`: the differences between two files.

use super::{Context, Naming};
use crate::args::{Diff, Format};
use crate::exit_code::Failure;
use scansion_core::classes::preset;
use scansion_core::io::{self, Changed, Difference};
use serde::Serialize;
use std::fmt::Write;

#[derive(Serialize)]
struct Answer<'a> {
    same: bool,
    summary: String,
    #[serde(flatten)]
    difference: &'a Difference,
}

pub(crate) fn run(args: &Diff, context: &Context<'_>) -> Result<(), Failure> {
    let found = io::diff(&args.a, &args.b, &context.read_options())?;
    let answer = Answer { same: found.is_empty(), summary: found.summary(), difference: &found };
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&answer).unwrap_or_default(),
        Format::Csv => csv(&found),
        Format::Table => table(&found, &context.naming),
    })?;
    if found.is_empty() { Ok(()) } else { Err(Failure::Different) }
}

fn table(found: &Difference, naming: &Naming) -> String {
    let mut text = found.summary() + "\n";
    if found.points[0] != found.points[1] {
        let _ = writeln!(
            text,
            "\npoints: {} and {}; the first {} compared",
            found.points[0], found.points[1], found.compared
        );
    }
    for (title, list) in [("header", &found.header), ("record", &found.records), ("type", &found.types)] {
        list.iter().for_each(|c| changed(&mut text, title, c));
    }
    for (names, title) in found.only_in.iter().zip(["only in the first", "only in the second"]) {
        if !names.is_empty() {
            let _ = writeln!(text, "{title}: {}", names.join(" "));
        }
    }
    let one_sided = found.fields.iter().any(|f| f.one_sided > 0);
    let more = |cell: &dyn std::fmt::Display| if one_sided { format!(" {cell:>18}") } else { String::new() };
    if !found.fields.is_empty() {
        let more = more(&"number in one only");
        let _ = writeln!(text, "\n{:<24} {:>14} {:>14} {:>14}{more}", "field", "points", "first point", "by at most");
    }
    for f in &found.fields {
        let (largest, more) = (shown(f.largest), more(&f.one_sided));
        let _ = writeln!(text, "{:<24} {:>14} {:>14} {largest:>14}{more}", f.name, f.differing, f.first);
    }
    classes(&mut text, found, naming);
    text
}

/// The largest difference of two numbers; `-` if there is none.
fn shown(largest: f64) -> String {
    if largest.is_nan() {
        return "-".into();
    }
    let rounded: f64 = format!("{largest:.6e}").parse().unwrap_or(largest);
    rounded.to_string()
}

fn changed(text: &mut String, title: &str, c: &Changed) {
    let short = |s: &str| -> String {
        if s.chars().count() > 60 { s.chars().take(57).chain("...".chars()).collect() } else { s.into() }
    };
    let _ = writeln!(text, "{title} {}: {} -> {}", c.name, short(&c.a), short(&c.b));
}

/// The pairs of class codes that changed, most points first, and the number of unchanged points.
fn classes(text: &mut String, found: &Difference, naming: &Naming) {
    if found.classes.is_empty() {
        return;
    }
    let _ = writeln!(text, "\n{:<32} {:<32} {:>14}", "class", "became", "points");
    let mut pairs: Vec<_> = found.classes.iter().filter(|c| c.from != c.to).collect();
    pairs.sort_by_key(|c| (std::cmp::Reverse(c.points), c.from, c.to));
    let list = naming.scheme.unwrap_or_default().likely();
    let named = |code: u8| format!("{code} {}", preset::named(code, list, &naming.class_names).name);
    for c in pairs {
        let _ = writeln!(text, "{:<32} {:<32} {:>14}", named(c.from), named(c.to), c.points);
    }
    let stayed: u64 = found.classes.iter().filter(|c| c.from == c.to).map(|c| c.points).sum();
    let _ = writeln!(text, "{:<65} {stayed:>14}", "the same class");
}

/// One line per difference: kind, name, points, first, largest (empty if no two numbers differ), the two values, and the points
/// of a field where only one of the two is a number.
fn csv(found: &Difference) -> String {
    let quoted = |s: &str| format!("\"{}\"", s.replace('"', "\"\""));
    let mut text = "kind,name,points,first,largest,a,b,one_sided\n".to_string();
    let _ = writeln!(text, "points,,{},,,{},{},", found.compared, found.points[0], found.points[1]);
    for (kind, list) in [("header", &found.header), ("record", &found.records), ("type", &found.types)] {
        for c in list {
            let _ = writeln!(text, "{kind},{},,,,{},{},", quoted(&c.name), quoted(&c.a), quoted(&c.b));
        }
    }
    for (side, names) in found.only_in.iter().enumerate() {
        for name in names {
            let (a, b) = if side == 0 { ("present", "absent") } else { ("absent", "present") };
            let _ = writeln!(text, "field,{},,,,{a},{b},", quoted(name));
        }
    }
    for f in &found.fields {
        let largest = if f.largest.is_nan() { String::new() } else { f.largest.to_string() };
        let _ = writeln!(text, "field,{},{},{},{largest},,,{}", quoted(&f.name), f.differing, f.first, f.one_sided);
    }
    for c in &found.classes {
        let _ = writeln!(text, "class,,{},,,{},{},", c.points, c.from, c.to);
    }
    text
}
