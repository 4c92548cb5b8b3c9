//! Rates the parts of lines anew, and leaves out those of a low rating.
//!
//! Many candidates overlap, and a line is drawn where one of them is chosen: the likeliest of many, which is more often a
//! false one than the probability of a single candidate says. The likelihoods of the points beside a line do not depend on
//! the number of its candidates, so that they mainly decide.

use crate::cloud::Positions;
use crate::contours::likely::Likely;
use crate::contours::params::PartParams;
use crate::contours::polylines::{Polyline, distance};
use crate::error::Result;
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use std::ops::Range;

/// Distance of the samples of a line, metres.
const STEP: f64 = 0.02;
/// Nodes that lie beside a sample: at most this many, within this distance, metres.
const NEAR: usize = 16;
const REACH: f64 = 0.08;

/// The parts of lines whose mean rating over the window is large enough, in the order of the lines. The rating of a place is
/// (1 - w) p + w c: p is the largest likelihood of a node beside it, c the confidence of the line. Nodes of a part are those
/// of its line that are nearest to one of its samples. O(s log n) for s samples and n nodes, and for each line that is cut the
/// product of its samples and nodes.
///
/// # Errors
/// If a parameter is outside its range, or the work was cancelled.
pub(in crate::contours) fn likely_parts(
    lines: Vec<Polyline>,
    nodes: &Likely,
    params: &PartParams,
    monitor: &Monitor,
) -> Result<Vec<Polyline>> {
    params.validate()?;
    if params.least <= 0.0 || lines.is_empty() {
        return Ok(lines);
    }
    let sampled: Vec<Samples> = lines.iter().map(Samples::of).collect();
    let places: Positions = sampled.iter().flat_map(|samples| samples.places.iter().copied()).collect();
    let near = nearest_of(&nodes.positions, &places, NEAR, monitor)?;
    let beside = |at: usize| {
        let found = near.of(at).iter().zip(near.squared_distances(at));
        let within = found.filter(|(_, apart)| f64::from(**apart) <= REACH * REACH);
        within.map(|(&node, _)| f64::from(nodes.likelihoods[node as usize])).fold(0.0, f64::max)
    };
    let (mut parts, mut first) = (Vec::new(), 0);
    for (line, samples) in lines.iter().zip(&sampled) {
        monitor.check()?;
        let rating = |at| (1.0 - params.confidence) * beside(at) + params.confidence * f64::from(line.confidence);
        let ratings: Vec<f64> = (first..first + samples.places.len()).map(rating).collect();
        first += samples.places.len();
        let means = smoothed(&ratings, params.reach(), line.is_closed());
        let kept: Vec<bool> = means.iter().map(|mean| *mean >= params.least).collect();
        if kept.iter().all(|kept| *kept) {
            parts.push(line.clone());
            continue;
        }
        let nearest: Vec<usize> =
            line.nodes.iter().map(|&node| samples.nearest(nodes.positions.xyz(node as usize))).collect();
        let found = runs(&kept, line.is_closed()).into_iter().map(|run| samples.part(line, run, &nearest));
        parts.extend(found.filter(|part| part.length() >= params.least_length));
    }
    Ok(parts)
}

impl PartParams {
    /// Samples to either side of one that are averaged.
    fn reach(&self) -> usize {
        (self.window / (2.0 * STEP)).round() as usize
    }
}

/// Places along a line; the last is the first if the line is closed.
struct Samples {
    places: Vec<[f32; 3]>,
    /// The segment that each place lies on.
    segments: Vec<usize>,
    /// Number of places, the last of a closed line not counted.
    turn: usize,
}

impl Samples {
    fn of(line: &Polyline) -> Self {
        let (mut places, mut segments) = (Vec::new(), Vec::new());
        for (segment, ends) in line.vertices.windows(2).enumerate() {
            let steps = (distance(ends[0], ends[1]) / STEP).ceil().max(1.0);
            for step in 0..steps as usize {
                let share = step as f64 / steps;
                let between = |a: usize| f64::from(ends[0][a]) * (1.0 - share) + f64::from(ends[1][a]) * share;
                places.push([0, 1, 2].map(|a| between(a) as f32));
                segments.push(segment);
            }
        }
        if let Some(&last) = line.vertices.last() {
            places.push(last);
            segments.push(line.vertices.len().saturating_sub(2));
        }
        let turn = places.len() - usize::from(line.is_closed());
        Self { places, segments, turn }
    }

    /// The sample nearest to a place.
    fn nearest(&self, place: [f32; 3]) -> usize {
        let apart = |at: usize| distance(self.places[at], place);
        (0..self.turn).min_by(|&a, &b| apart(a).total_cmp(&apart(b))).unwrap_or(0)
    }

    /// The part of the line from one sample to another, given the sample nearest to each node of the line; of a closed line it may
    /// run on beyond the last sample.
    fn part(&self, line: &Polyline, run: Range<usize>, nearest: &[usize]) -> Polyline {
        let turn = self.turn;
        let mut vertices: Vec<[f32; 3]> = Vec::new();
        for at in run.clone() {
            let (sample, before) = (at % turn, at.checked_sub(1).map(|before| before % turn));
            let inside = at > run.start && at + 1 < run.end;
            let is_vertex = before.is_none_or(|before| self.segments[before] != self.segments[sample]);
            if !inside || is_vertex {
                vertices.push(self.places[sample]);
            }
        }
        let own = |sample: usize| run.contains(&sample) || run.contains(&(sample + turn));
        let nodes = line.nodes.iter().zip(nearest).filter(|(_, sample)| own(**sample)).map(|(&node, _)| node);
        Polyline { nodes: nodes.collect(), vertices, confidence: line.confidence }
    }
}

/// The mean of each value and those up to `reach` places before and behind it; of a closed row, whose last value is its
/// first, also across its end.
fn smoothed(values: &[f64], reach: usize, closed: bool) -> Vec<f64> {
    let turn = values.len() - usize::from(closed && values.len() > 1);
    let reach = if closed { reach.min(turn.saturating_sub(1) / 2) } else { reach };
    // Sums of the values before each place, three turns of a closed row.
    let turns = if closed { 3 } else { 1 };
    let mut sums = vec![0.0];
    for at in 0..turns * turn {
        sums.push(sums[at] + values[at % turn]);
    }
    let mean = |at: usize| {
        let middle = if closed { at % turn + turn } else { at };
        let (low, high) = (middle.saturating_sub(reach), (middle + reach + 1).min(sums.len() - 1));
        (sums[high] - sums[low]) / (high - low) as f64
    };
    (0..values.len()).map(mean).collect()
}

/// The runs of kept samples, two or more each; in a closed row, whose last sample is its first and which has one that is not
/// kept, a run may go on beyond the end.
fn runs(kept: &[bool], closed: bool) -> Vec<Range<usize>> {
    let turn = kept.len() - usize::from(closed);
    let start = if closed { kept.iter().position(|kept| !kept).unwrap_or(0) } else { 0 };
    let mut found = Vec::new();
    let mut at = start;
    while at < start + turn {
        let end = (at..start + turn).find(|&i| !kept[i % turn]).unwrap_or(start + turn);
        if end > at + 1 {
            found.push(at..end);
        }
        at = end + 1;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes along a line from [0, 0, 0], with these likelihoods, 0.02 m apart.
    fn nodes(places: &[[f32; 3]], likelihoods: &[f32]) -> Likely {
        Likely {
            positions: Positions::from_rows(places),
            likelihoods: likelihoods.to_vec(),
            tangents: vec![[0.0; 3]; places.len()],
        }
    }

    fn line(vertices: &[[f32; 3]], nodes: usize) -> Polyline {
        Polyline { vertices: vertices.to_vec(), confidence: 0.7, nodes: (0..nodes as u32).collect() }
    }

    fn parts(line: Polyline, nodes: &Likely, params: &PartParams) -> Vec<Polyline> {
        likely_parts(vec![line], nodes, params, &Monitor::default()).unwrap()
    }

    #[test]
    fn an_unlikely_middle_divides_a_line_and_its_nodes() {
        let places: Vec<[f32; 3]> = (0..=200).map(|i| [i as f32 * 0.02, 0.0, 0.01]).collect();
        let likelihoods: Vec<f32> = (0..=200).map(|i| if (80..120).contains(&i) { 0.1 } else { 0.9 }).collect();
        let nodes = nodes(&places, &likelihoods);
        let whole = line(&[[0.0; 3], [1.0, 0.0, 0.0], [4.0, 0.0, 0.0]], 201);
        let params = PartParams { window: 0.2, ..PartParams::default() };
        let found = parts(whole.clone(), &nodes, &params);
        assert_eq!(found.len(), 2);
        let ends: Vec<[f32; 2]> =
            found.iter().map(|part| [part.vertices[0][0], part.vertices.last().unwrap()[0]]).collect();
        for (end, expected) in ends.as_flattened().iter().zip([0.0, 1.6, 2.4, 4.0]) {
            assert!((end - expected).abs() < 0.15, "{ends:?}");
        }
        assert_eq!(found[0].vertices[1], [1.0, 0.0, 0.0]);
        assert_eq!((found[1].vertices.len(), found[1].confidence), (2, 0.7));
        for part in &found {
            let (low, high) = (part.vertices[0][0], part.vertices.last().unwrap()[0]);
            assert!(part.nodes.len() > 70);
            assert!(part.nodes.iter().all(|&n| (low - 0.011..=high + 0.011).contains(&places[n as usize][0])));
        }
        assert_eq!(parts(whole.clone(), &nodes, &PartParams { least: 0.0, ..params.clone() }), vec![whole.clone()]);
        assert!(parts(whole.clone(), &nodes, &PartParams { least: 0.95, ..params.clone() }).is_empty());
        assert!(parts(whole, &nodes, &PartParams { least_length: 2.0, ..params }).is_empty());
    }

    #[test]
    fn a_closed_line_is_cut_where_it_is_unlikely_and_not_where_it_begins() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]];
        let side = |i: usize| {
            (0..50)
                .map(move |s| [0, 1, 2].map(|a| corners[i][a] + (corners[i + 1][a] - corners[i][a]) * s as f32 / 50.0))
        };
        let places: Vec<[f32; 3]> = (0..4).flat_map(side).collect();
        let all = line(&corners, places.len());
        let likely = nodes(&places, &vec![0.9; places.len()]);
        assert_eq!(parts(all.clone(), &likely, &PartParams::default()), vec![all.clone()]);
        // The side from [1, 1] to [0, 1] is unlikely.
        let likelihoods: Vec<f32> =
            (0..places.len()).map(|i| if (100..150).contains(&i) { 0.05 } else { 0.9 }).collect();
        let found = parts(all, &nodes(&places, &likelihoods), &PartParams::default());
        assert_eq!(found.len(), 1);
        let part = &found[0];
        assert!((3.0..3.4).contains(&part.length()), "{}", part.length());
        let (first, last) = (part.vertices[0], part.vertices[part.vertices.len() - 1]);
        assert!(first[0] < 0.2 && last[0] > 0.8 && first[1] == 1.0 && last[1] == 1.0);
        let inner = [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        assert_eq!(part.vertices[1..part.vertices.len() - 1], inner);
    }

    #[test]
    fn means_equal_brute_force() {
        let values: Vec<f64> = (0..23).map(|i| f64::from(i * 7 % 11)).collect();
        for (reach, closed) in [(0, false), (3, false), (40, false), (0, true), (3, true)] {
            let mut values = values.clone();
            if closed {
                values.push(values[0]);
            }
            let (turn, reach) = (values.len() as i64 - i64::from(closed), reach as i64);
            for (at, mean) in smoothed(&values, reach as usize, closed).into_iter().enumerate() {
                let around = (at as i64 - reach..=at as i64 + reach).filter(|i| closed || (0..turn).contains(i));
                let near: Vec<f64> = around.map(|i| values[i.rem_euclid(turn) as usize]).collect();
                assert!((mean - near.iter().sum::<f64>() / near.len() as f64).abs() < 1e-12, "{reach} {closed} {at}");
            }
        }
    }

    #[test]
    fn short_lines_points_and_no_nodes_are_no_trouble() {
        let none = Likely::default();
        for vertices in [vec![[0.0; 3]; 2], vec![[0.0; 3]; 4], vec![[0.0; 3], [0.001, 0.0, 0.0]]] {
            assert!(parts(line(&vertices, 0), &none, &PartParams::default()).is_empty());
        }
        assert!(likely_parts(Vec::new(), &none, &PartParams::default(), &Monitor::default()).unwrap().is_empty());
    }
}
