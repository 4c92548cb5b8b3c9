//! Straight segments through their points, and vertices where these meet.

use super::super::likely::Likely;
use super::super::polylines::{Polyline, distance};
use super::super::simplify::simplify;
use super::TidyParams;
use super::axis::{Axis, Path, Vector, times};
use super::joints::{Line, Lines};
use crate::error::Result;
use crate::parallel::{Monitor, map_each};

/// Share of the pull towards the place where a vertex was, for directions in which no line holds it.
const PULL: f64 = 0.01;

/// The lines with simplified and, where the points allow, straightened segments. Nearly O(n log n).
pub(super) fn drawn(lines: &Lines, nodes: &Likely, params: &TidyParams, monitor: &Monitor) -> Result<Vec<Polyline>> {
    let outlines = map_each(&lines.lines, monitor, |line| Outline::new(line, nodes, params))?;
    let mut joints = vec![Vertex::default(); lines.joints];
    for (line, outline) in lines.lines.iter().zip(&outlines) {
        for (joint, vertex) in line.joints.iter().zip([outline.vertices.first(), outline.vertices.last()]) {
            if let Some(vertex) = vertex {
                joints[*joint as usize].add(vertex);
            }
        }
    }
    let reach = 2.0 * params.corner.max(params.residual);
    let degrees = lines.degrees();
    let mut drawn = Vec::with_capacity(outlines.len());
    for (line, outline) in lines.lines.iter().zip(&outlines) {
        monitor.check()?;
        let last = outline.vertices.len().saturating_sub(1);
        let place = |at: usize| match at {
            0 => joints[line.joints[0] as usize].placed(reach),
            _ if at == last => joints[line.joints[1] as usize].placed(reach),
            _ => outline.vertices[at].placed(reach),
        };
        let vertices: Vec<[f32; 3]> = (0..=last).map(place).collect();
        let kept = simplify(&vertices, params.tolerance)?;
        let vertices: Vec<[f32; 3]> = kept.into_iter().map(|at| vertices[at]).collect();
        let polyline = Polyline { vertices, confidence: line.confidence, nodes: line.path.clone() };
        let free = line.joints.iter().any(|&joint| degrees[joint as usize] == 1);
        let length = polyline.length();
        if length > 0.0 && !(free && length < params.least_length) {
            drawn.push(polyline);
        }
    }
    Ok(drawn)
}

/// Cosine of the smallest angle of two lines that meet in a sharp corner.
const SHARP: f64 = 0.94;

/// The vertices of a line that remain after simplification.
#[derive(Clone, Debug, Default)]
struct Outline {
    vertices: Vec<Vertex>,
}

impl Outline {
    fn new(line: &Line, nodes: &Likely, params: &TidyParams) -> Result<Self> {
        let at = |&node: &u32| node as usize;
        let path = Path {
            places: line.path.iter().map(|node| nodes.positions.xyz(at(node))).collect(),
            weights: line.path.iter().map(|node| f64::from(nodes.likelihoods[at(node)]).powi(2)).collect(),
        };
        let places = path.smoothed(params.smooth);
        let kept = simplify(&places, params.tolerance)?;
        let mut vertices: Vec<Vertex> = kept.iter().map(|&at| Vertex::at(places[at])).collect();
        if params.residual <= 0.0 {
            return Ok(Self { vertices });
        }
        let ways = kept.windows(2);
        let mut axes: Vec<Option<Axis>> = ways.map(|w| path.axis(w[0]..w[1] + 1, params.residual)).collect();
        let mut at = 0;
        while at < axes.len() {
            let short = distance(vertices[at].old(), vertices[at + 1].old()) < 2.0 * params.corner;
            if !short || axes.len() == 1 || !cuts(&axes, at, &vertices, params.corner) {
                at += 1;
                continue;
            }
            // The corner that was cut off: the ends of the short segment become one vertex.
            axes.remove(at);
            match at {
                0 => vertices.remove(1),
                _ if at == axes.len() => vertices.remove(at),
                _ => {
                    let gone = vertices.remove(at + 1);
                    vertices[at].add(&gone);
                    gone
                }
            };
        }
        for (at, axis) in axes.iter().enumerate() {
            if let Some(axis) = axis {
                vertices[at].hold(axis);
                vertices[at + 1].hold(axis);
            }
        }
        Ok(Self { vertices })
    }
}

/// Whether a short segment only cuts off the corner of straight ones: of those before and after it, or, at an end of
/// the line, of the only neighbour and another line, if that neighbour goes on to the end.
fn cuts(axes: &[Option<Axis>], at: usize, vertices: &[Vertex], corner: f64) -> bool {
    let before = at.checked_sub(1).and_then(|before| axes[before].as_ref());
    let after = axes.get(at + 1).and_then(Option::as_ref);
    match [before, after] {
        [Some(a), Some(b)] => a.direction.iter().zip(b.direction).map(|(a, b)| a * b).sum::<f64>().abs() < SHARP,
        [None, Some(axis)] if at == 0 => axis.distance(vertices[0].old()) <= corner,
        [Some(axis), None] if at + 1 == axes.len() => axis.distance(vertices[at + 1].old()) <= corner,
        _ => false,
    }
}

/// A vertex: where it was, and the straight lines that hold it.
#[derive(Clone, Debug, Default)]
struct Vertex {
    /// Sum of the places where it was, and their number.
    sum: Vector,
    count: f64,
    /// Sums of `I − u uᵀ` (xx, xy, xz, yy, yz, zz) and of its product with a point, over the lines, and their number.
    matrix: [f64; 6],
    right: Vector,
    lines: f64,
}

impl Vertex {
    fn at(place: [f32; 3]) -> Self {
        Self { sum: place.map(f64::from), count: 1.0, ..Self::default() }
    }

    fn hold(&mut self, axis: &Axis) {
        let [x, y, z] = axis.direction;
        let matrix = [1.0 - x * x, -x * y, -x * z, 1.0 - y * y, -y * z, 1.0 - z * z];
        let right = times(&matrix, axis.point);
        self.matrix.iter_mut().zip(matrix).for_each(|(sum, v)| *sum += v);
        self.right.iter_mut().zip(right).for_each(|(sum, v)| *sum += v);
        self.lines += 1.0;
    }

    fn add(&mut self, other: &Self) {
        self.sum.iter_mut().zip(other.sum).for_each(|(sum, v)| *sum += v);
        self.matrix.iter_mut().zip(other.matrix).for_each(|(sum, v)| *sum += v);
        self.right.iter_mut().zip(other.right).for_each(|(sum, v)| *sum += v);
        self.count += other.count;
        self.lines += other.lines;
    }

    /// Where the vertex was.
    fn old(&self) -> [f32; 3] {
        self.sum.map(|v| (v / self.count.max(1.0)) as f32)
    }

    /// The place nearest to all lines, if it is within reach of where the vertex was.
    fn placed(&self, reach: f64) -> [f32; 3] {
        let was = self.sum.map(|v| v / self.count.max(1.0));
        let old = self.old();
        let pull = PULL * self.lines;
        let [a, b, c, d, e, f] = self.matrix;
        let matrix = [a + pull, b, c, d + pull, e, f + pull];
        let right = [0, 1, 2].map(|i| self.right[i] + pull * was[i]);
        match solve(&matrix, right).map(|v| v.map(|c| c as f32)) {
            Some(new) if self.lines > 0.0 && distance(new, old) <= reach => new,
            _ => old,
        }
    }
}

/// The solution of three equations with a symmetric matrix, by Cramer's rule.
fn solve(&[a, b, c, d, e, f]: &[f64; 6], right: Vector) -> Option<Vector> {
    let adjoint = [d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b];
    let determinant = a * adjoint[0] + b * adjoint[1] + c * adjoint[2];
    let found = times(&adjoint, right).map(|v| v / determinant);
    found.iter().all(|v| v.is_finite()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn noisy_sides_of_a_corner_become_two_segments_that_meet_in_it() {
        let mut random = stream(2, 2);
        let mut noise = || (0.01 * random.normal()) as f32;
        let mut rows: Vec<[f32; 3]> = (0..50).map(|i| [i as f32 * 0.02, noise(), noise()]).collect();
        rows.extend((0..50).map(|i| [1.0 + noise(), i as f32 * 0.02, noise()]));
        let nodes = Likely {
            positions: rows.iter().copied().collect(),
            likelihoods: vec![0.5; 100],
            tangents: vec![[0.0; 3]; 100],
        };
        let lines =
            Lines { lines: vec![Line { path: (0..100).collect(), confidence: 1.0, joints: [0, 1] }], joints: 2 };
        let drawn = |params: &TidyParams| drawn(&lines, &nodes, params, &Monitor::default()).unwrap();
        let found = drawn(&TidyParams::default());
        assert_eq!((found.len(), found[0].vertices.len(), found[0].nodes.len()), (1, 3, 100));
        assert!(distance(found[0].vertices[1], [1.0, 0.0, 0.0]) < 0.01, "{:?}", found[0].vertices);
        assert!(drawn(&TidyParams { least_length: 5.0, ..TidyParams::default() }).is_empty());
        // By the letter, vertices are points.
        let plain = drawn(&TidyParams::plain(0.05));
        assert!(plain[0].vertices.iter().all(|v| rows.contains(v)));
    }
}
