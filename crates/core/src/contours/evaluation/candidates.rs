//! Which candidates run along lines of a reference.

use super::super::Candidates;
use super::super::linking::Candidate;
use super::super::params::{above_zero, between, zero_or_more};
use super::super::polylines::distance;
use super::lines::{ComparedLines, Samples};
use crate::cloud::Positions;
use crate::error::Result;
use crate::neighbours::nearest_of;
use crate::parallel::{Monitor, map_each, map_watched};
use serde::{Deserialize, Serialize};

/// Parameters of [`match_candidates`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MatchParams {
    /// Largest distance of a path from a line along which it runs, metres, 0 or more.
    pub tolerance: f64,
    /// Largest angle between the directions of both, degrees, 0 to 90.
    pub angle: f64,
    /// Length to either side over which the direction of a path is taken, metres, above 0.
    pub smooth: f64,
}

impl Default for MatchParams {
    fn default() -> Self {
        Self { tolerance: 0.06, angle: 25.0, smooth: 0.06 }
    }
}

impl MatchParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        zero_or_more("tolerance", self.tolerance)?;
        between("angle", self.angle, 90.0)?;
        above_zero("smooth", self.smooth)
    }
}

/// Shares of the length of a candidate, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathMatch {
    /// Along lines of the reference.
    pub on: f32,
    /// Near unsure lines and not along those of the reference.
    pub unsure: f32,
}

/// How far each candidate runs along lines; what the comparison found does not matter here. O(n log s) for n nodes of all paths
/// and s samples of lines.
///
/// # Errors
/// If a coordinate is not finite, a parameter is outside its range, or the work was cancelled.
pub fn match_candidates(
    found: &Candidates,
    lines: &ComparedLines<'_>,
    params: &MatchParams,
    monitor: &Monitor,
) -> Result<Vec<PathMatch>> {
    params.validate()?;
    let step = (params.tolerance / 4.0).max(0.005);
    let positions = &found.nodes.likely.positions;
    let nodes = Nodes {
        positions,
        directions: near(&Samples::of(lines.reference, step)?, positions, params.tolerance, monitor)?,
        unsure: near(&Samples::of(lines.unsure, step)?, positions, 2.0 * params.tolerance, monitor)?,
        params,
    };
    map_each(&found.list, monitor, |candidate| Ok(nodes.matched(candidate)))
}

/// The direction of the nearest sample of each position, if it is within reach.
fn near(of: &Samples, positions: &Positions, reach: f64, monitor: &Monitor) -> Result<Vec<Option<[f32; 3]>>> {
    if of.places.is_empty() {
        return Ok(vec![None; positions.len()]);
    }
    let nearest = nearest_of(&of.places, positions, 1, monitor)?;
    let limit = (reach * reach * (1.0 + 1e-6)) as f32;
    map_watched(positions.len(), monitor, |i| {
        let close = nearest.squared_distances(i)[0] <= limit;
        close.then(|| of.along[nearest.of(i)[0] as usize])
    })
}

/// The nodes and the lines near each.
struct Nodes<'a> {
    positions: &'a Positions,
    directions: Vec<Option<[f32; 3]>>,
    unsure: Vec<Option<[f32; 3]>>,
    params: &'a MatchParams,
}

impl Nodes<'_> {
    fn matched(&self, candidate: &Candidate) -> PathMatch {
        let at: Vec<[f32; 3]> = candidate.path.iter().map(|&node| self.positions.xyz(node as usize)).collect();
        let mut along = vec![0.0; at.len()];
        for i in 1..at.len() {
            along[i] = along[i - 1] + distance(at[i - 1], at[i]);
        }
        let total = along.last().copied().unwrap_or(0.0);
        let cosine = self.params.angle.to_radians().cos();
        let (mut on, mut unsure) = (0.0, 0.0);
        for (i, &node) in candidate.path.iter().enumerate() {
            // Half of the pieces before and after the node are its own.
            let own = (along[(i + 1).min(at.len() - 1)] - along[i.saturating_sub(1)]) / 2.0;
            let first = along.partition_point(|&v| v < along[i] - self.params.smooth).min(i.saturating_sub(1));
            let last = along.partition_point(|&v| v <= along[i] + self.params.smooth).max(i + 2).min(at.len()) - 1;
            let follows = self.directions[node as usize].is_some_and(|line| {
                let way: [f64; 3] = std::array::from_fn(|a| f64::from(at[last][a]) - f64::from(at[first][a]));
                let dot: f64 = way.iter().zip(line).map(|(w, l)| w * f64::from(l)).sum();
                dot.abs() >= cosine * distance(at[last], at[first])
            });
            on += if follows { own } else { 0.0 };
            unsure += if !follows && self.unsure[node as usize].is_some() { own } else { 0.0 };
        }
        let share = |part: f64| if total > 0.0 { (part / total) as f32 } else { 0.0 };
        PathMatch { on: share(on), unsure: share(unsure) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::polylines::Polyline;
    use super::super::super::{Likely, nodes};
    use super::*;

    #[test]
    fn length_and_direction_decide_not_the_number_of_nodes() {
        // Nodes along x, dense in the first half; one across; one along x far away.
        let mut rows: Vec<[f32; 3]> = (0..=20).map(|i| [i as f32 * 0.025, 0.0, 0.0]).collect();
        rows.extend([
            [0.75, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.5, 0.05, 0.0],
            [0.5, -0.05, 0.0],
            [0.0, 2.0, 0.0],
            [1.0, 2.0, 0.0],
        ]);
        let path = |path: &[u32]| Candidate { path: path.to_vec(), ..Candidate::default() };
        let all: Vec<u32> = (0..23).collect();
        let found = Candidates {
            nodes: nodes::Nodes {
                likely: Likely { positions: Positions::from_rows(&rows), ..Likely::default() },
                points: vec![],
            },
            list: vec![path(&all), path(&[23, 20, 24]), path(&[25, 26])],
            ..Candidates::default()
        };
        let line = |y: f32, end: f32| Polyline { vertices: vec![[0.0, y, 0.0], [end, y, 0.0]], ..Polyline::default() };
        let lines = ComparedLines { found: &[], reference: &[line(0.02, 0.5)], unsure: &[line(2.0, 2.0)] };
        let matched = match_candidates(&found, &lines, &MatchParams::default(), &Monitor::default()).unwrap();
        assert!((matched[0].on - 0.6).abs() < 0.1, "{matched:?}");
        assert_eq!(matched[1].on, 0.0);
        assert_eq!(matched[2], PathMatch { on: 0.0, unsure: 1.0 });
        let none = match_candidates(&found, &ComparedLines::default(), &MatchParams::default(), &Monitor::default());
        assert_eq!(none.unwrap(), vec![PathMatch::default(); 3]);
    }
}
