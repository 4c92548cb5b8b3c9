//! Which parts of the creases were scanned.

use super::geometry::{Vector, between, dot, length, sub};
use super::scanner::Echo;
use super::world::Edge;
use crate::error::Result;
use crate::parallel::{Monitor, watched};

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
}

/// The parts of edges beside which points lie: on one of their two surfaces, at most 1.5 times the spacing away.
///
/// O(points * edges of their surface + pieces).
pub(super) fn seen(edges: &[Edge], echoes: &[Echo], monitor: &Monitor) -> Result<Vec<Part>> {
    let surfaces = edges.iter().flat_map(|edge| edge.surfaces).max().map_or(0, |last| last as usize + 1);
    let mut of_surface: Vec<Vec<(u32, u8)>> = vec![Vec::new(); surfaces];
    for (i, edge) in edges.iter().enumerate() {
        for (side, &surface) in edge.surfaces.iter().enumerate() {
            of_surface[surface as usize].push((i as u32, 1 << side));
        }
    }
    let pieces = |edge: &Edge| (length(sub(edge.ends[1], edge.ends[0])) / PIECE).ceil().max(1.0) as usize;
    let mut marks: Vec<Vec<u8>> = edges.iter().map(|edge| vec![0; pieces(edge)]).collect();
    for range in watched(echoes.len(), monitor) {
        for echo in &echoes[range?] {
            let own = echo.surface.and_then(|surface| of_surface.get(surface as usize));
            for &(i, side) in own.into_iter().flatten() {
                mark(&edges[i as usize], echo, side, &mut marks[i as usize]);
            }
        }
    }
    Ok(edges.iter().zip(&marks).flat_map(|(edge, marks)| parts(edge, marks)).collect())
}

/// Marks the pieces of an edge that a point shows.
fn mark(edge: &Edge, echo: &Echo, side: u8, marks: &mut [u8]) {
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
    marks[first.max(0.0) as usize..=last].iter_mut().for_each(|mark| *mark |= side);
}

/// Runs of pieces that are shown by the same number of surfaces.
fn parts(edge: &Edge, marks: &[u8]) -> Vec<Part> {
    let (mut parts, mut start) = (Vec::new(), 0);
    for run in marks.chunk_by(|a, b| a.count_ones() == b.count_ones()) {
        let surfaces = run[0].count_ones() as u8;
        let ends = [start, start + run.len()].map(|at| between(edge.ends, at as f64 / marks.len() as f64));
        start += run.len();
        parts.extend((surfaces > 0).then_some(Part { ends, surfaces }));
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
        let found = |echoes: &[Echo]| seen(&edges, echoes, &Monitor::default()).unwrap();
        assert!(found(&[echo(0.5, Some(2)), echo(0.5, None), echo(3.0, Some(0))]).is_empty());
        let parts = found(&[echo(0.55, Some(0)), echo(1.55, Some(0)), echo(1.55, Some(1))]);
        assert_eq!(parts.iter().map(|p| p.surfaces).collect::<Vec<_>>(), [1, 2]);
        assert!((parts[0].ends[0][0] - 0.4).abs() < 1e-9 && (parts[0].ends[1][0] - 0.7).abs() < 1e-9, "{parts:?}");
    }
}
