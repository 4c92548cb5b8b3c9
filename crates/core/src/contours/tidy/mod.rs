//! Lines as they are wanted in a drawing: without parallel duplicates and short spurs, straight where the points are, with sharp corners
//! and without small gaps.
//!
//! Only the tolerance of the simplification is that of T. Hackel, *Large-scale Machine Learning for Point Cloud
//! Processing*, ETH Zurich, 2018, section 4.5.3; [`TidyParams::plain`] leaves the rest out.

mod axis;
mod joints;
mod loops;
mod parts;
mod spurs;
mod straight;
mod uniting;

pub(super) use parts::likely_parts;

use super::likely::Likely;
use super::params::TidyParams;
use super::polylines::{PathUnion, Polyline, strands};
use crate::error::Result;
use crate::parallel::Monitor;

/// The lines of a union; their nodes are those of the union.
///
/// # Errors
/// If a parameter is outside its range, there is not one position a node, or the work was cancelled.
pub(super) fn draw(union: PathUnion, nodes: &Likely, params: &TidyParams, monitor: &Monitor) -> Result<Vec<Polyline>> {
    params.validate()?;
    let positions = &nodes.positions;
    let graph = loops::opened(union, positions, params, monitor)?;
    let graph = spurs::pruned(graph, positions, params, monitor)?;
    let strands = strands(&graph, positions, monitor)?;
    let lines = joints::joined(&strands, positions, params, monitor)?;
    straight::drawn(&lines, nodes, params, monitor)
}
