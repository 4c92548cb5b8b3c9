//! Joints: the ends of lines that meet, also over small gaps, and the lines between joints.

use super::super::polylines::Strand;
use super::TidyParams;
use super::uniting::groups;
use crate::cloud::Positions;
use crate::error::Result;
use crate::graph::{Graph, connected_components};
use crate::neighbours::within;
use crate::parallel::Monitor;

/// Distance from an end over which its direction is taken, metres.
const REACH: f64 = 0.2;

/// A line between two joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Line {
    /// The nodes in order; consecutive ones need not be joined by an edge.
    pub(super) path: Vec<u32>,
    /// Mean confidence, by length.
    pub(super) confidence: f32,
    /// Joint at the start and at the end.
    pub(super) joints: [u32; 2],
}

/// The lines and their joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Lines {
    pub(super) lines: Vec<Line>,
    /// Number of joints.
    pub(super) joints: usize,
}

impl Lines {
    /// Number of lines that end at each joint.
    pub(super) fn degrees(&self) -> Vec<u32> {
        let mut degrees = vec![0; self.joints];
        self.lines.iter().flat_map(|line| line.joints).for_each(|joint| degrees[joint as usize] += 1);
        degrees
    }

    /// Joints numbered anew after some were united.
    fn united(mut self, pairs: &[[u32; 2]], monitor: &Monitor) -> Result<Self> {
        let components = connected_components(&Graph::new(self.joints, pairs, &vec![0.0; pairs.len()])?, monitor)?;
        self.lines.iter_mut().for_each(|line| line.joints = line.joints.map(|joint| components.of[joint as usize]));
        self.joints = components.count;
        Ok(self)
    }
}

/// Makes joints of the ends that are near each other or on both sides of a small gap, and joins lines that meet where
/// no other one does. O(n log n).
pub(super) fn joined(
    strands: &[Strand],
    positions: &Positions,
    params: &TidyParams,
    monitor: &Monitor,
) -> Result<Lines> {
    let lines = met(strands, positions, params, monitor)?;
    let lines = chained(lines, positions, monitor)?;
    if params.gap <= 0.0 {
        return Ok(lines);
    }
    let pairs = gaps(&lines, positions, params, monitor)?;
    chained(lines.united(&pairs, monitor)?, positions, monitor)
}

/// Ends within the distance of a corner are one joint, none wider than twice that; short lines inside of one go.
fn met(strands: &[Strand], positions: &Positions, params: &TidyParams, monitor: &Monitor) -> Result<Lines> {
    let ends =
        |strand: &Strand| [strand.path.first().copied(), strand.path.last().copied()].map(Option::unwrap_or_default);
    let mut nodes: Vec<u32> = strands.iter().flat_map(ends).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let number = |node: u32| nodes.binary_search(&node).unwrap_or_default() as u32;
    let lines = strands.iter().map(|strand| Line {
        path: strand.path.clone(),
        confidence: strand.confidence,
        joints: ends(strand).map(number),
    });
    let lines = Lines { lines: lines.collect(), joints: nodes.len() };
    if params.corner <= 0.0 {
        return Ok(lines);
    }
    let places = positions.select(&nodes, monitor)?;
    let (of, joints) = groups(&places, params.corner, monitor)?;
    let mut lines = Lines { joints, ..lines };
    lines.lines.iter_mut().for_each(|line| line.joints = line.joints.map(|joint| of[joint as usize]));
    let inside = |line: &Line| line.joints[0] == line.joints[1] && length(&line.path, positions) <= 3.0 * params.corner;
    lines.lines.retain(|line| !inside(line));
    Ok(lines)
}

fn length(path: &[u32], positions: &Positions) -> f64 {
    Strand { path: path.to_vec(), confidence: 0.0 }.length(positions)
}

/// Pairs of joints with a free end each that look at each other over a gap, every joint in at most one pair, the
/// nearest first.
fn gaps(lines: &Lines, positions: &Positions, params: &TidyParams, monitor: &Monitor) -> Result<Vec<[u32; 2]>> {
    let degrees = lines.degrees();
    let mut free: Vec<End> = Vec::new();
    for line in &lines.lines {
        for (side, &joint) in line.joints.iter().enumerate().filter(|(_, joint)| degrees[**joint as usize] == 1) {
            free.push(End::new(line, side == 1, joint, positions));
        }
    }
    let places: Positions = free.iter().map(|end| end.at.map(|v| v as f32)).collect();
    let near = within(&places, &places, params.gap, monitor)?;
    let cosine = params.gap_angle.to_radians().cos();
    let mut open: Vec<(f32, [usize; 2])> = Vec::new();
    for i in 0..free.len() {
        for (&j, &squared) in near.of(i).iter().zip(near.squared_distances(i)) {
            let j = j as usize;
            if i < j && free[i].sees(&free[j], cosine) && free[j].sees(&free[i], cosine) {
                open.push((squared, [i, j]));
            }
        }
    }
    open.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut taken = vec![false; free.len()];
    let mut pairs = Vec::new();
    for (_, [i, j]) in open {
        if !taken[i] && !taken[j] {
            (taken[i], taken[j]) = (true, true);
            pairs.push([free[i].joint, free[j].joint]);
        }
    }
    Ok(pairs)
}

/// A free end of a line.
struct End {
    joint: u32,
    at: [f64; 3],
    /// Unit vector out of the line.
    outward: [f64; 3],
}

impl End {
    fn new(line: &Line, last: bool, joint: u32, positions: &Positions) -> Self {
        let place = |node: u32| positions.xyz(node as usize).map(f64::from);
        let mut path: Vec<[f64; 3]> = line.path.iter().map(|&node| place(node)).collect();
        if last {
            path.reverse();
        }
        let at = path.first().copied().unwrap_or_default();
        let far = |from: &&[f64; 3]| norm(apart(**from, at)) >= REACH;
        let back = path.iter().find(far).or(path.last()).copied().unwrap_or_default();
        let way = apart(back, at);
        Self { joint, at, outward: way.map(|c| c / norm(way).max(f64::MIN_POSITIVE)) }
    }

    /// Whether the other end lies ahead.
    fn sees(&self, other: &Self, cosine: f64) -> bool {
        let way = apart(self.at, other.at);
        let along: f64 = way.iter().zip(self.outward).map(|(a, b)| a * b).sum();
        along >= cosine * norm(way)
    }
}

fn apart(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [b[0] - a[0], b[1] - a[1], b[2] - a[2]]
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// Joins the lines at joints where exactly two ends meet; lines that close become one from such a joint to itself.
fn chained(lines: Lines, positions: &Positions, monitor: &Monitor) -> Result<Lines> {
    let degrees = lines.degrees();
    let mut at = vec![Vec::new(); lines.joints];
    for (number, line) in lines.lines.iter().enumerate() {
        line.joints.iter().for_each(|&joint| at[joint as usize].push(number));
    }
    let mut used = vec![false; lines.lines.len()];
    let mut chains = Vec::new();
    for ends in [true, false] {
        for joint in (0..lines.joints).filter(|&joint| (degrees[joint] != 2) == ends) {
            monitor.check()?;
            for &first in &at[joint] {
                let mut chain = Line { joints: [joint as u32; 2], ..Line::default() };
                let (mut sum, mut total, mut next) = (0.0, 0.0, Some(first));
                while let Some(number) = next.filter(|&number| !used[number]) {
                    used[number] = true;
                    let line = &lines.lines[number];
                    let own = length(&line.path, positions);
                    sum += own * f64::from(line.confidence);
                    total += own;
                    append(&mut chain, line);
                    let end = chain.joints[1] as usize;
                    let goes_on = degrees[end] == 2 && end != joint;
                    next = if goes_on { at[end].iter().copied().find(|&n| !used[n]) } else { None };
                }
                chain.confidence = if total > 0.0 { (sum / total) as f32 } else { 0.0 };
                if !chain.path.is_empty() {
                    chains.push(chain);
                }
            }
        }
    }
    Ok(Lines { lines: chains, joints: lines.joints })
}

/// Appends a line that begins or ends at the end of the chain.
fn append(chain: &mut Line, line: &Line) {
    let reversed = line.joints[0] != chain.joints[1];
    let mut path = line.path.clone();
    if reversed {
        path.reverse();
    }
    let twice = usize::from(chain.path.last().is_some_and(|last| path.first() == Some(last)));
    chain.path.extend(path.into_iter().skip(twice));
    chain.joints[1] = line.joints[usize::from(!reversed)];
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rows: &[[f32; 3]], paths: &[&[u32]], params: &TidyParams) -> Lines {
        let strands: Vec<Strand> = paths.iter().map(|p| Strand { path: p.to_vec(), confidence: 0.5 }).collect();
        joined(&strands, &Positions::from_rows(rows), params, &Monitor::default()).unwrap()
    }

    fn row(from: f32, to: f32, n: usize) -> Vec<[f32; 3]> {
        (0..n).map(|i| [from + (to - from) * i as f32 / (n - 1) as f32, 0.0, 0.0]).collect()
    }

    #[test]
    fn gaps_between_lines_that_look_at_each_other_are_closed() {
        let mut rows = row(0.0, 1.0, 5);
        rows.extend(row(1.2, 2.0, 5));
        let paths: &[&[u32]] = &[&[0, 1, 2, 3, 4], &[9, 8, 7, 6, 5]];
        let params = TidyParams { corner: 0.1, ..TidyParams::default() };
        let one = of(&rows, paths, &params);
        assert_eq!((one.lines.len(), one.lines[0].path.len()), (1, 10));
        assert!((one.lines[0].confidence - 0.5).abs() < 1e-6);
        assert_eq!(of(&rows, paths, &TidyParams { gap: 0.1, ..params.clone() }).lines.len(), 2);
        assert_eq!(of(&rows, paths, &TidyParams { gap: 0.0, ..params.clone() }).lines.len(), 2);
        // Beside each other, not one behind the other.
        let beside: Vec<[f32; 3]> =
            rows.iter().enumerate().map(|(i, r)| if i < 5 { *r } else { [r[0] - 0.2, 0.15, 0.0] }).collect();
        assert_eq!(of(&beside, paths, &params).lines.len(), 2);
    }

    #[test]
    fn ends_that_are_near_are_one_joint_and_short_lines_inside_go() {
        // Two junctions 5 cm apart with two lines each are one joint of four lines.
        let rows = [[0.0; 3], [0.05, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0]];
        let found = of(&rows, &[&[0, 1], &[0, 2], &[0, 3], &[1, 4], &[1, 5]], &TidyParams::default());
        assert_eq!(found.lines.len(), 4);
        let mut degrees = found.degrees();
        degrees.sort_unstable();
        assert_eq!(degrees.last(), Some(&4));
    }

    #[test]
    fn chains_and_rings_become_one_line() {
        let rows = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let ring = of(&rows, &[&[0, 1], &[2, 1], &[2, 3], &[0, 3]], &TidyParams::default());
        assert_eq!(ring.lines.len(), 1);
        let path = &ring.lines[0].path;
        assert!(path.len() == 5 && path.first() == path.last() && ring.lines[0].joints[0] == ring.lines[0].joints[1]);
        let closed = of(&rows, &[&[0, 1, 2, 3, 0]], &TidyParams::default());
        assert_eq!(closed.lines[0].path, [0, 1, 2, 3, 0]);
        assert_eq!(of(&[], &[], &TidyParams::default()), Lines::default());
    }
}
