//! The nodes of the neighbourhood graph: likely points, thinned.

use super::likely::{Cells, Likely};
use super::params::NeighbourhoodParams;
use crate::error::{Error, Result};
use crate::parallel::Monitor;

/// The nodes of the neighbourhood graph.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nodes {
    /// Position, likelihood and tangent of each node.
    pub likely: Likely,
    /// The point of the cloud that each node is; ascending, but not of points that were [moved to the edge](super::ridge()).
    pub points: Vec<u32>,
}

impl Nodes {
    /// The most likely point of each voxel whose likelihood reaches `keep`, and the seeds. O(n + m log m).
    ///
    /// # Errors
    /// If a seed is not a point, a parameter is outside its range, the voxels are too small for the extent, or the work
    /// was cancelled.
    pub fn new(likely: &Likely, seeds: &[u32], params: &NeighbourhoodParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        if let Some(seed) = seeds.iter().find(|&&seed| seed as usize >= likely.len()) {
            return Err(Error::input(format!("seed {seed} is not one of {} points", likely.len())));
        }
        let winners = Cells { size: params.voxel, least: params.keep }.winners(likely, monitor)?;
        let mut points: Vec<u32> = winners.iter().map(|w| w.point).chain(seeds.iter().copied()).collect();
        points.sort_unstable();
        points.dedup();
        Ok(Self { likely: likely.select(&points, monitor)?, points })
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// True if there is no node.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The node of each of these points; both ascend.
    ///
    /// # Errors
    /// If a point is not a node.
    pub(super) fn of_points(&self, points: &[u32]) -> Result<Vec<u32>> {
        let node = |point: &u32| match self.points.binary_search(point) {
            Ok(node) => Ok(node as u32),
            Err(_) => Err(Error::input(format!("point {point} is not one of the {} nodes", self.len()))),
        };
        points.iter().map(node).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Positions;

    #[test]
    fn nodes_are_the_likeliest_points_of_voxels_and_the_seeds() {
        let rows = [[0.001, 0.0, 0.0], [0.002, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.0, 0.0]];
        let likely = Likely {
            positions: Positions::from_rows(&rows),
            likelihoods: vec![0.8, 0.9, 0.05, 0.3, 0.3],
            tangents: vec![[0.0; 3]; 5],
        };
        let params = NeighbourhoodParams::default();
        let of = |seeds: &[u32], params: &NeighbourhoodParams| Nodes::new(&likely, seeds, params, &Monitor::default());
        assert_eq!(of(&[], &params).unwrap().points, [1, 3]);
        let nodes = of(&[0], &params).unwrap();
        assert_eq!((&nodes.points[..], &nodes.likely.likelihoods[..]), (&[0, 1, 3][..], &[0.8, 0.9, 0.3][..]));
        assert_eq!(nodes.of_points(&[0, 3]).unwrap(), [0, 2]);
        assert!(nodes.of_points(&[2]).is_err() && of(&[5], &params).is_err());
        let all = NeighbourhoodParams { voxel: 0.0, keep: 0.0, ..params };
        assert_eq!(of(&[], &all).unwrap().points, [0, 1, 2, 3]);
    }
}
