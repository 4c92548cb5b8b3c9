//! An edge detector for points, after J. Canny.
//!
//! J. Canny, *A computational approach to edge detection*, IEEE Transactions on Pattern Analysis and Machine
//! Intelligence 8(6), 1986: what is not the strongest across the edge is suppressed, and weak edges remain only where
//! they are connected with strong ones. The edge direction at a point is its tangent in place of that of an image's
//! gradient.

use super::super::likely::Likely;
use super::super::nodes::Nodes;
use super::super::params::NeighbourhoodParams;
use super::super::params::{above_zero, between};
use super::super::polylines::Polyline;
use super::linked::{LinkedParams, lines, near};
use crate::error::{Error, Result};
use crate::graph::connected_components;
use crate::neighbours::within;
use crate::parallel::{Monitor, map_watched};
use serde::{Deserialize, Serialize};

/// Parameters of [`canny`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CannyParams {
    /// Least strength of one point of every edge, 0 to 1.
    pub high: f64,
    /// Least strength of every point, 0 to `high`.
    pub low: f64,
    /// Distance within which a stronger point across the edge suppresses one, metres, above 0.
    pub across: f64,
    /// Smallest angle from the tangent that is across the edge, degrees, 0 to 90.
    pub angle: f64,
    /// How points are linked.
    pub linked: LinkedParams,
}

impl Default for CannyParams {
    fn default() -> Self {
        Self { high: 0.6, low: 0.3, across: 0.1, angle: 45.0, linked: LinkedParams::default() }
    }
}

impl CannyParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        between("high", self.high, 1.0)?;
        if !(0.0..=self.high).contains(&self.low) {
            return Err(Error::parameter("low", self.low, format!("0 to high, {}", self.high)));
        }
        above_zero("across", self.across)?;
        between("angle", self.angle, 90.0)?;
        self.linked.validate()
    }
}

/// Lines along points that are the strongest across the edge, with hysteresis of two thresholds along the neighbourhood
/// graph. Of equally strong points the first suppresses the others. O(n + m log m + m b) for m points above the lower
/// threshold and b of these near each.
///
/// # Errors
/// If lengths do not fit, a value is not finite or outside 0..1, a parameter is outside its range, or the work was
/// cancelled.
pub fn canny(strengths: &Likely, params: &CannyParams, monitor: &Monitor) -> Result<Vec<Polyline>> {
    params.validate()?;
    strengths.check(monitor)?;
    let thinning =
        NeighbourhoodParams { keep: params.low, voxel: params.linked.voxel, ..NeighbourhoodParams::default() };
    let nodes = Nodes::new(strengths, &[], &thinning, monitor)?;
    let nodes = ridges(nodes, params, monitor)?;
    let mut graph = near(&nodes.likely.positions, &params.linked, monitor)?;
    let components = connected_components(&graph, monitor)?;
    let mut strong = vec![false; components.count];
    for (&component, &strength) in components.of.iter().zip(&nodes.likely.likelihoods) {
        strong[component as usize] |= f64::from(strength) >= params.high;
    }
    graph.retain(|edge| strong[components.of[edge[0] as usize] as usize]);
    lines(&nodes, graph, &params.linked.tidy, monitor)
}

/// The nodes without a stronger one across the edge.
fn ridges(nodes: Nodes, params: &CannyParams, monitor: &Monitor) -> Result<Nodes> {
    let likely = &nodes.likely;
    let around = within(&likely.positions, &likely.positions, params.across, monitor)?;
    let most = params.angle.to_radians().cos();
    let weaker = |i: usize, j: usize| {
        let [own, other] = [i, j].map(|node| likely.likelihoods[node]);
        other > own || (other.to_bits() == own.to_bits() && j < i)
    };
    let across = |i: usize, j: usize| {
        let [a, b] = [i, j].map(|node| likely.positions.xyz(node).map(f64::from));
        let tangent = likely.tangents[i].map(f64::from);
        let way = [0, 1, 2].map(|axis| b[axis] - a[axis]);
        let [length, unit] = [way, tangent].map(|v| v.iter().map(|c| c * c).sum::<f64>().sqrt());
        let along = way.iter().zip(tangent).map(|(w, t)| w * t).sum::<f64>().abs();
        along <= most * length * unit
    };
    let near = |i: usize| around.of(i).iter().map(|&j| j as usize).filter(move |&j| j != i);
    let kept = map_watched(nodes.len(), monitor, |i| !near(i).any(|j| weaker(i, j) && across(i, j)))?;
    let rows: Vec<u32> = (0..).zip(kept).filter(|(_, kept)| *kept).map(|(row, _)| row).collect();
    Ok(Nodes {
        likely: likely.select(&rows, monitor)?,
        points: map_watched(rows.len(), monitor, |i| nodes.points[rows[i] as usize])?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strips of points along x, with a strength that falls across them.
    fn strips(heights: &[f32]) -> Likely {
        let mut likely = Likely::default();
        for (strip, &height) in heights.iter().enumerate() {
            for (x, y) in (0..80).flat_map(|x| (-3..=3i32).map(move |y| (x, y))) {
                let wave = 0.01 * (x % 3) as f32;
                likely.positions.push([x as f32 * 0.03, strip as f32 * 2.0 + y as f32 * 0.03, 0.0]);
                likely.likelihoods.push((height - wave) * (1.0 - 0.2 * y.abs() as f32));
                likely.tangents.push([1.0, 0.0, 0.0]);
            }
        }
        likely
    }

    #[test]
    fn a_strip_is_one_line_in_its_middle_and_weak_strips_are_none() {
        let likely = strips(&[0.9, 0.5]);
        let found = canny(&likely, &CannyParams::default(), &Monitor::default()).unwrap();
        assert_eq!(found.len(), 1, "{:?}", found.iter().map(|l| &l.vertices).collect::<Vec<_>>());
        assert!(found[0].vertices.iter().all(|v| v[1].abs() < 0.02) && (found[0].length() - 2.37).abs() < 0.1);
        let low = CannyParams { high: 0.4, ..CannyParams::default() };
        assert_eq!(canny(&likely, &low, &Monitor::default()).unwrap().len(), 2);
    }

    #[test]
    fn nothing_and_nonsense() {
        let run = |params: &CannyParams| canny(&Likely::default(), params, &Monitor::default());
        assert!(run(&CannyParams::default()).unwrap().is_empty());
        assert!(run(&CannyParams { low: 0.7, ..CannyParams::default() }).is_err());
        assert!(run(&CannyParams { across: 0.0, ..CannyParams::default() }).is_err());
    }
}
