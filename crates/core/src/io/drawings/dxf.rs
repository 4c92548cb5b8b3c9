//! Writing DXF of AutoCAD R12: the oldest version still in use, which every program reads.
//!
//! It is written by hand, because the crate `dxf` brings a library of images and 30 other crates for these few lines.
//! R12 has neither a unit nor true colours; names of layers have upper case ASCII only.

use super::Drawing;
use crate::error::Result;
use crate::parallel::{Looks, Monitor};
use std::fmt::Write as _;

/// Longest name of a layer.
const NAME: usize = 31;

/// The text of a file: 3D polylines in layers.
pub(super) fn text(drawing: &Drawing, monitor: &Monitor) -> Result<String> {
    let (names, layers) = drawing.layers(layer_name);
    let mut looks = Looks::at(monitor);
    let mut text = String::new();
    header(&mut text, drawing);
    tables(&mut text, &layer_colours(drawing, &names, &layers));
    text += "  0\nSECTION\n  2\nBLOCKS\n  0\nENDSEC\n  0\nSECTION\n  2\nENTITIES\n";
    for (line, &layer) in drawing.lines.iter().zip(&layers) {
        looks.steps(line.vertices.len())?;
        let (layer, colour) = (&names[layer], colour_index(line.colour));
        // 8: a polyline in space; 1: closed.
        let flags = 8 + u8::from(line.closed);
        let _ = write!(text, "  0\nPOLYLINE\n  8\n{layer}\n 62\n{colour}\n 66\n1\n 70\n{flags}\n{}", place([0.0; 3]));
        for &at in &line.vertices {
            let _ = write!(text, "  0\nVERTEX\n  8\n{layer}\n{} 70\n32\n", place(at));
        }
        let _ = write!(text, "  0\nSEQEND\n  8\n{layer}\n");
    }
    text += "  0\nENDSEC\n  0\nEOF\n";
    Ok(text)
}

/// Version, and the box around the lines.
fn header(text: &mut String, drawing: &Drawing) {
    let vertices = || drawing.lines.iter().flat_map(|line| &line.vertices);
    *text += "  0\nSECTION\n  2\nHEADER\n  9\n$ACADVER\n  1\nAC1009\n";
    if vertices().next().is_some() {
        let limit = |start: f64, of: fn(f64, f64) -> f64| [0, 1, 2].map(|a| vertices().map(|at| at[a]).fold(start, of));
        let ends = [("$EXTMIN", limit(f64::INFINITY, f64::min)), ("$EXTMAX", limit(f64::NEG_INFINITY, f64::max))];
        for (name, at) in ends {
            let _ = write!(text, "  9\n{name}\n{}", place(at));
        }
    }
    *text += "  0\nENDSEC\n";
}

/// The tables of line types and of layers.
fn tables(text: &mut String, layers: &[(String, u8)]) {
    *text += "  0\nSECTION\n  2\nTABLES\n  0\nTABLE\n  2\nLTYPE\n 70\n1\n";
    *text += "  0\nLTYPE\n  2\nCONTINUOUS\n 70\n0\n  3\nSolid line\n 72\n65\n 73\n0\n 40\n0.0\n  0\nENDTAB\n";
    let own: Vec<&(String, u8)> = layers.iter().filter(|(name, _)| name != "0").collect();
    let _ = write!(text, "  0\nTABLE\n  2\nLAYER\n 70\n{}\n", own.len() + 1);
    for (name, colour) in [&("0".to_string(), 7)].into_iter().chain(own) {
        let _ = write!(text, "  0\nLAYER\n  2\n{name}\n 70\n0\n 62\n{colour}\n  6\nCONTINUOUS\n");
    }
    *text += "  0\nENDTAB\n  0\nENDSEC\n";
}

/// Each layer with the colour of its first line.
fn layer_colours(drawing: &Drawing, names: &[String], layers: &[usize]) -> Vec<(String, u8)> {
    let mut all: Vec<(String, u8)> = Vec::with_capacity(names.len());
    for (line, &layer) in drawing.lines.iter().zip(layers) {
        // Layers are numbered in the order of their first lines.
        if layer == all.len() {
            all.push((names[layer].clone(), colour_index(line.colour)));
        }
    }
    all
}

/// The group codes of a place.
fn place([x, y, z]: [f64; 3]) -> String {
    format!(" 10\n{x:.6}\n 20\n{y:.6}\n 30\n{z:.6}\n")
}

/// A name that R12 allows: upper case letters, digits, `$`, `-` and `_`; short enough for a number after it.
fn layer_name(name: &str) -> String {
    let allowed = |c: char| if c.is_ascii_alphanumeric() || "$-_".contains(c) { c.to_ascii_uppercase() } else { '_' };
    let plain: String = name.chars().map(allowed).take(NAME - 7).collect();
    if plain.is_empty() { "0".into() } else { plain }
}

/// The nearest of the colours 1 to 249 of AutoCAD's table; black is 7, which is drawn black on white.
fn colour_index(colour: [u8; 3]) -> u8 {
    if colour.iter().all(|&v| v < 20) {
        return 7;
    }
    let distance = |index: u8| (0..3).map(|a| (i32::from(table(index)[a]) - i32::from(colour[a])).pow(2)).sum::<i32>();
    (1..250).min_by_key(|&index| distance(index)).unwrap_or(7)
}

/// A colour of the table: seven basic colours, two greys, then 24 hues of five values, each pure and pale.
fn table(index: u8) -> [u8; 3] {
    const BASIC: [[u8; 3]; 9] = [
        [255, 0, 0],
        [255, 255, 0],
        [0, 255, 0],
        [0, 255, 255],
        [0, 0, 255],
        [255, 0, 255],
        [255, 255, 255],
        [128, 128, 128],
        [192, 192, 192],
    ];
    if let Some(basic) = BASIC.get(usize::from(index).wrapping_sub(1)) {
        return *basic;
    }
    let value = [255.0, 165.0, 127.0, 76.0, 38.0][usize::from(index % 10 / 2)];
    // Position on the circle of hues, of which red, green and blue lie two steps apart.
    let hue = f64::from(index / 10).max(1.0) / 4.0 - 0.25;
    [0.0, 4.0, 2.0].map(|turn: f64| {
        let position = (hue + turn) % 6.0;
        let pure = ((position - 3.0).abs() - 1.0).clamp(0.0, 1.0);
        let share = if index % 2 == 1 { (1.0 + pure) / 2.0 } else { pure };
        (value * share) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_the_table() {
        let known = [(1, [255, 0, 0]), (11, [255, 127, 127]), (20, [255, 63, 0]), (32, [165, 82, 0])];
        for (index, colour) in known {
            assert_eq!(table(index), colour, "{index}");
        }
        assert_eq!([[0, 255, 2], [255, 0, 0], [0; 3], [255; 3], [130; 3]].map(colour_index), [3, 1, 7, 7, 8]);
        assert_eq!(table(130), [0, 255, 255]);
        assert_eq!(table(170), [0, 0, 255]);
    }

    #[test]
    fn names_of_layers_have_only_what_r12_allows() {
        assert_eq!(layer_name("roof-wall"), "ROOF-WALL");
        assert_eq!(layer_name("a/b<é>\n*?"), "A_B_______".get(..9).unwrap());
        assert_eq!((layer_name(""), layer_name(&"x".repeat(99)).len()), ("0".into(), 24));
    }
}
