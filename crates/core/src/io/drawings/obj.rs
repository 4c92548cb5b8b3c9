//! Writing Wavefront OBJ: vertices, and lines in a group for each layer.

use super::Drawing;
use crate::error::Result;
use crate::parallel::{Looks, Monitor};
use std::fmt::Write as _;

/// The text of a file; lines stand in the order of their layers.
pub(super) fn text(drawing: &Drawing, monitor: &Monitor) -> Result<String> {
    let (names, layers) = drawing.layers(group_name);
    let mut looks = Looks::at(monitor);
    let mut text = "# written by scansion\n".to_string();
    let mut of_layers: Vec<Vec<usize>> = vec![Vec::new(); names.len()];
    layers.iter().enumerate().for_each(|(line, &layer)| of_layers[layer].push(line));
    // Vertices are numbered from 1 through the whole file.
    let mut next = 1;
    for (name, lines) in names.iter().zip(&of_layers) {
        let _ = writeln!(text, "g {name}");
        for line in lines.iter().map(|&line| &drawing.lines[line]) {
            looks.steps(line.vertices.len())?;
            for [x, y, z] in &line.vertices {
                let _ = writeln!(text, "v {x:.6} {y:.6} {z:.6}");
            }
            let end = next + line.vertices.len();
            text.push('l');
            for number in (next..end).chain(line.closed.then_some(next)) {
                let _ = write!(text, " {number}");
            }
            text.push('\n');
            next = end;
        }
    }
    Ok(text)
}

/// A name of one word.
fn group_name(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
    if plain.is_empty() { "default".into() } else { plain }
}
