//! Lines along points: the minimum spanning forest of neighbouring points.

use super::super::nodes::Nodes;
use super::super::params::{TidyParams, above_zero, at_least_one};
use super::super::polylines::{PathUnion, Polyline};
use super::super::tidy::draw;
use crate::cloud::Positions;
use crate::error::Result;
use crate::graph::{Graph, Parallel, WeightedPairs, minimum_spanning_tree};
use crate::neighbours::knn;
use crate::parallel::{Monitor, map_watched, watched};
use serde::{Deserialize, Serialize};

/// How points are linked to lines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkedParams {
    /// Edge of the voxels of which the strongest point is taken, metres; 0: all points.
    pub voxel: f64,
    /// Number of nearest points that a point may be linked with, 1 or more.
    pub k: usize,
    /// Largest distance of linked points, metres, above 0.
    pub radius: f64,
    /// The lines.
    pub tidy: TidyParams,
}

impl Default for LinkedParams {
    fn default() -> Self {
        Self { voxel: 0.025, k: 8, radius: 0.15, tidy: TidyParams::default() }
    }
}

impl LinkedParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        super::super::params::zero_or_more("voxel", self.voxel)?;
        at_least_one("k", self.k)?;
        above_zero("radius", self.radius)?;
        self.tidy.validate()
    }
}

/// Joins each position with its nearest ones within the radius; weights are distances.
pub(super) fn near(positions: &Positions, params: &LinkedParams, monitor: &Monitor) -> Result<Graph> {
    let near = knn(positions, params.k, monitor)?;
    let limit = (params.radius * params.radius) as f32;
    let (mut pairs, mut weights) = (Vec::new(), Vec::new());
    for piece in watched(near.len(), monitor) {
        for i in piece? {
            let row = near.of(i).iter().zip(near.squared_distances(i));
            for (&j, &squared) in row.take_while(|(_, squared)| **squared <= limit) {
                pairs.push([i as u32, j]);
                weights.push(squared.sqrt());
            }
        }
    }
    Graph::from_pairs(
        positions.len(),
        &WeightedPairs { pairs: &pairs, weights: &weights, parallel: Parallel::Least },
        monitor,
    )
}

/// The lines of a graph on nodes: its minimum spanning forest, cut at junctions and tidied. Their confidence is the
/// mean strength.
pub(super) fn lines(nodes: &Nodes, graph: Graph, tidy: &TidyParams, monitor: &Monitor) -> Result<Vec<Polyline>> {
    let tree = minimum_spanning_tree(&graph, monitor)?;
    let chosen: Vec<[u32; 2]> = tree.iter().map(|&e| graph.edges()[e as usize]).collect();
    let strength = |node: u32| nodes.likely.likelihoods[node as usize];
    let mean = |e: usize| f32::midpoint(strength(chosen[e][0]), strength(chosen[e][1]));
    let weights = map_watched(chosen.len(), monitor, mean)?;
    let forest = Graph::new_watched(nodes.len(), &chosen, &weights, monitor)?;
    let union = PathUnion { support: forest.weights().to_vec(), graph: forest };
    let mut lines = draw(union, &nodes.likely, tidy, monitor)?;
    lines.iter_mut().flat_map(|line| &mut line.nodes).for_each(|node| *node = nodes.points[*node as usize]);
    Ok(lines)
}
