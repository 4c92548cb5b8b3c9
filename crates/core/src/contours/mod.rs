//! Contours: lines along the edges of objects, from the likelihood of each point to lie on one.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.5, and T. Hackel,
//! J. D. Wegner, K. Schindler, *Contour detection in unstructured 3D point clouds*, CVPR 2016.
//!
//! 1. Likely points are thinned to [`seeds`](seeds()).
//! 2. Shortest paths in a [`neighbourhood`](neighbourhood()) graph link neighbouring seeds: an over-complete set of
//!    [`Candidate`]s.
//! 3. A classifier derives a probability from the descriptor of each candidate, and a random [`Field`] chooses among
//!    them.
//! 4. The union of the chosen paths is cut at junctions and simplified; parts along unlikely points are left out.
//!
//! `Likely -> Candidates -> (probabilities) -> Traced`
//!
//! [`baselines`] has simpler methods, and [`score_lines`] compares lines with reference lines.

pub mod baselines;
mod descriptor;
mod evaluation;
mod field;
mod likely;
mod linking;
mod neighbourhood;
mod nodes;
mod params;
mod polylines;
mod ridge;
mod seeds;
mod simplify;
mod tangents;
#[cfg(test)]
mod tests;
mod tidy;

pub use descriptor::{VALUE_NAMES, VALUES, describe};
pub use evaluation::{
    ComparedLines, LineScores, Marked, MatchParams, PathMatch, ScoreParams, match_candidates, sampled, score_lines,
    score_points,
};
pub use field::{Choice, Field, choose, exhaustive, iterated_modes};
pub use likely::Likely;
pub use linking::{Candidate, Neighbourhood, link};
pub use neighbourhood::neighbourhood;
pub use nodes::Nodes;
pub use params::{
    CandidateParams, DescriptorParams, FieldParams, LinkParams, NeighbourhoodParams, PartParams, RidgeParams,
    SeedParams, Suppression, TangentParams, TidyParams, TraceParams,
};
pub use polylines::Polyline;
pub use ridge::ridge;
pub use seeds::seeds;
pub use simplify::simplify;
pub use tangents::tangents;

use crate::error::Result;
use crate::parallel::Monitor;
use polylines::{Chosen, PathUnion};

/// The candidates of contours and what they consist of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidates {
    /// The nodes that paths run along.
    pub nodes: Nodes,
    /// The nodes that are seeds, ascending.
    pub seeds: Vec<u32>,
    /// The candidates, ascending by start and end; paths are nodes.
    pub list: Vec<Candidate>,
    /// [`VALUES`] values of each candidate, row after row.
    pub descriptors: Vec<f32>,
}

/// The contours of a cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traced {
    /// The lines; their nodes are points of the cloud.
    pub polylines: Vec<Polyline>,
    /// Which candidates were chosen.
    pub choice: Choice,
}

/// The candidates of contours: seeds, the neighbourhood graph, links and descriptors.
///
/// Memory is in proportion to the points that are likely enough to be nodes. O(n + m log m) for m of these, and
/// [`link`]'s and [`describe`]'s for the seeds among them. The same bytes for any number of threads.
///
/// # Errors
/// If lengths do not fit, a value is not finite or not a likelihood, a parameter is outside its range, the voxels are
/// too small for the extent, the graph does not fit into memory, or the work was cancelled.
pub fn candidates(likely: &Likely, params: &CandidateParams, monitor: &Monitor) -> Result<Candidates> {
    params.validate()?;
    let moved = ridge::ridge(likely, &params.ridge, monitor)?;
    let seeds = seeds::seeds(&moved.likely, &params.seeds, monitor)?;
    let mut nodes = Nodes::new(&moved.likely, &seeds, &params.neighbourhood, monitor)?;
    let seeds = nodes.of_points(&seeds)?;
    nodes.points.iter_mut().for_each(|point| *point = moved.points[*point as usize]);
    let graph = neighbourhood(&nodes.likely, &params.neighbourhood, monitor)?;
    let of = Neighbourhood { positions: &nodes.likely.positions, graph: &graph };
    let list = link(&of, &seeds, &params.links, monitor)?;
    let descriptors = describe(&nodes.likely, &list, &params.descriptor, monitor)?;
    Ok(Candidates { nodes, seeds, list, descriptors })
}

/// The contours: candidates chosen by the random field from their probabilities to be one, as lines.
///
/// # Errors
/// If there is not one probability from 0 to 1 a candidate, a path does not fit the nodes, a parameter is outside its
/// range, or the work was cancelled.
pub fn trace(from: &Candidates, probabilities: &[f32], params: &TraceParams, monitor: &Monitor) -> Result<Traced> {
    params.validate()?;
    let field = Field::new(&from.list, probabilities, &params.field, monitor)?;
    let choice = choose(&field, &params.field, monitor)?;
    let chosen = Chosen { candidates: &from.list, active: &choice.active, probabilities };
    let union = PathUnion::new(from.nodes.len(), &chosen, monitor)?;
    let drawn = tidy::draw(union, &from.nodes.likely, &params.tidy, monitor)?;
    let mut polylines = tidy::likely_parts(drawn, &from.nodes.likely, &params.parts, monitor)?;
    for node in polylines.iter_mut().flat_map(|line| &mut line.nodes) {
        *node = from.nodes.points[*node as usize];
    }
    Ok(Traced { polylines, choice })
}
