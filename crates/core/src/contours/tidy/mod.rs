//! Lines as they are wanted in a drawing: without braids and twigs, straight where the points are, with sharp corners
//! and without small gaps.
//!
//! Only the tolerance of the simplification is that of T. Hackel, *Large-scale Machine Learning for Point Cloud
//! Processing*, ETH Zurich, 2018, section 4.5.3; [`TidyParams::plain`] leaves the rest out.

mod axis;
mod joints;
mod loops;
mod straight;
mod twigs;

use super::likely::Likely;
use super::params::TidyParams;
use super::polylines::{Polyline, Web, strands};
use crate::error::Result;
use crate::parallel::Monitor;

/// The lines of a web; their nodes are those of the web.
///
/// # Errors
/// If a parameter is outside its range, there is not one position a node, or the work was cancelled.
pub(super) fn draw(web: Web, nodes: &Likely, params: &TidyParams, monitor: &Monitor) -> Result<Vec<Polyline>> {
    params.validate()?;
    let positions = &nodes.positions;
    let graph = loops::opened(web, positions, params, monitor)?;
    let graph = twigs::pruned(graph, positions, params, monitor)?;
    let strands = strands(&graph, positions, monitor)?;
    let lines = joints::joined(&strands, positions, params, monitor)?;
    straight::drawn(&lines, nodes, params, monitor)
}
