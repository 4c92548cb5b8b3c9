//! Which parts of the creases were scanned, and how densely.

use super::geometry::{Vector, between, dot, length, sub};
use super::scanner::Echo;
use super::world::Edge;
use crate::csr::Csr;
use crate::error::Result;
use crate::parallel::{Monitor, map_each, map_watched};

/// Greatest length of the pieces of an edge that are judged, in metres.
const PIECE: f64 = 0.1;
/// Greatest distance of a point to a piece that it shows, in spacings of the points.
const REACH: f64 = 1.5;

/// A part of an edge that was scanned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) ends: [Vector; 2],
    /// How many of its two surfaces have points beside it, 1 or 2.
    pub(super) surfaces: u8,
    /// Metres between the points beside it, on the surface where they are farther apart; infinite where one surface has
    /// points, but the scanner does not see the edge.
    pub(super) spacing: f64,
}

/// The parts of edges beside which points lie: on one of their two surfaces, at most 1.5 times the spacing away.
///
/// `visible` tells whether the scanner sees a place. O(points * edges of their surface + pieces), in parallel.
pub(super) fn seen(
    edges: &[Edge],
    echoes: &[Echo],
    visible: impl Fn(Vector) -> bool + Sync,
    monitor: &Monitor,
) -> Result<Vec<Part>> {
    let surfaces = edges.iter().flat_map(|edge| edge.surfaces).max().map_or(0, |last| last + 1);
    let own = |i: usize| echoes[i].surface.filter(|&surface| surface < surfaces).unwrap_or(surfaces);
    let of_surface = Csr::group_by(&map_watched(echoes.len(), monitor, own)?, surfaces as usize + 1, monitor)?;
    monitor.stage("edges", edges.len() as u64);
    let found = map_each(edges, monitor, |edge| {
        let pieces = (length(sub(edge.ends[1], edge.ends[0])) / PIECE).ceil().max(1.0) as usize;
        let mut marks = vec![[f64::INFINITY; 2]; pieces];
        for (side, &surface) in edge.surfaces.iter().enumerate() {
            for &echo in of_surface.group(surface as usize) {
                mark(edge, &echoes[echo as usize], side, &mut marks);
            }
        }
        monitor.advance(1);
        Ok(parts(edge, &marks, &visible))
    })?;
    Ok(found.concat())
}

/// Marks the pieces of an edge that a point of one side shows with its spacing, where it is less than that of others.
fn mark(edge: &Edge, echo: &Echo, side: usize, marks: &mut [[f64; 2]]) {
    let [start, end] = edge.ends;
    let (way, from) = (sub(end, start), sub(echo.met, start));
    let square = dot(way, way);
    let share = dot(from, way) / square;
    let reach = REACH * echo.spacing;
    let across = dot(from, from) - share * share * square;
    let along = reach * reach - across;
    if along < 0.0 {
        return;
    }
    let along = (along / square).sqrt();
    let count = marks.len() as f64;
    let [first, last] = [(share - along) * count, (share + along) * count];
    if last < 0.0 || first >= count {
        return;
    }
    let last = (last as usize).min(marks.len() - 1);
    marks[first.max(0.0) as usize..=last].iter_mut().for_each(|mark| mark[side] = mark[side].min(echo.spacing));
}

/// Runs of pieces that are shown by the same number of surfaces at about the same spacing.
fn parts(edge: &Edge, marks: &[[f64; 2]], visible: impl Fn(Vector) -> bool) -> Vec<Part> {
    let count = marks.len() as f64;
    let piece = |at: usize| {
        let shown: Vec<f64> = marks[at].iter().copied().filter(|spacing| spacing.is_finite()).collect();
        let surfaces = shown.len() as u8;
        let clear = surfaces == 2 || visible(between(edge.ends, (at as f64 + 0.5) / count));
        let spacing = if clear { shown.iter().copied().fold(0.0, f64::max) } else { f64::INFINITY };
        let ends = [at, at + 1].map(|at| between(edge.ends, at as f64 / count));
        (surfaces > 0).then_some(Part { ends, surfaces, spacing })
    };
    let step = |part: &Part| (2.0 * part.spacing.log2()).floor() as i64;
    let alike = |a: &Part, b: &Part| a.surfaces == b.surfaces && step(a) == step(b);
    let mut parts: Vec<Part> = Vec::new();
    let mut before: Option<Part> = None;
    for part in (0..marks.len()).map(piece) {
        match (part, before, parts.last_mut()) {
            (Some(part), Some(before), Some(last)) if alike(&before, &part) => {
                (last.ends[1], last.spacing) = (part.ends[1], last.spacing.max(part.spacing));
            }
            (Some(part), ..) => parts.push(part),
            (None, ..) => {}
        }
        before = part;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lies_beside_points_of_its_own_surfaces_is_seen() {
        let edges = [Edge { ends: [[0.0; 3], [2.0, 0.0, 0.0]], surfaces: [0, 1] }];
        let echo = |x: f64, surface| {
            let met = [x, 0.05, 0.0];
            Echo { measured: met, met, surface, spacing: 0.1 }
        };
        let found = |echoes: &[Echo]| seen(&edges, echoes, |at| at[0] < 1.0, &Monitor::default()).unwrap();
        assert!(found(&[echo(0.5, Some(2)), echo(0.5, None), echo(3.0, Some(0))]).is_empty());
        let parts = found(&[echo(0.55, Some(0)), echo(1.55, Some(0)), echo(1.55, Some(1))]);
        assert_eq!(parts.iter().map(|p| p.surfaces).collect::<Vec<_>>(), [1, 2]);
        assert!((parts[0].ends[0][0] - 0.4).abs() < 1e-9 && (parts[0].ends[1][0] - 0.7).abs() < 1e-9, "{parts:?}");
        // A part beside one surface that the scanner does not see may be found or not.
        let parts = found(&[echo(0.55, Some(0)), echo(1.55, Some(0))]);
        assert_eq!(parts.iter().map(|p| p.spacing).collect::<Vec<_>>(), [0.1, f64::INFINITY]);
    }

    #[test]
    fn the_spacing_is_that_of_the_sparser_surface_and_of_the_densest_points_there() {
        let edges = [Edge { ends: [[0.0; 3], [1.0, 0.0, 0.0]], surfaces: [0, 1] }];
        let echo = |surface, spacing| {
            let met = [0.5, 0.0, 0.0];
            Echo { measured: met, met, surface: Some(surface), spacing }
        };
        let echoes = [echo(0, 0.5), echo(0, 0.4), echo(1, 0.45), echo(1, 0.9)];
        let parts = seen(&edges, &echoes, |_| true, &Monitor::default()).unwrap();
        assert!(parts.iter().any(|part| part.spacing == 0.45 && part.surfaces == 2), "{parts:?}");
    }
}
