//! The fusion move: the better of two labellings, region by region.
//!
//! V. Lempitsky, C. Rother, S. Roth, A. Blake, *Fusion moves for Markov random field optimization*, IEEE PAMI 32(8),
//! 2010. The nodes whose labels differ form regions that are not adjacent to each other, so that each region can take
//! the cheaper of its two labellings independently. The energy of the result is at most that of the better labelling.

use super::move_making::{MoveMaking, Outcome};
use crate::error::Result;
use crate::parallel::Looks;

impl MoveMaking<'_> {
    /// Fuses another labelling into this one, region by region; true if that lowers the energy.
    pub(in crate::regularisation) fn fuse(&mut self, other: &[u16]) -> Result<bool> {
        self.begin_move();
        let moves = fusion_move(self, other)?;
        let moved = self.apply(&moves)? == Outcome::Moved;
        self.record_energy()?;
        Ok(moved)
    }
}

/// The changes to the labels of `other` in all regions where they cost less. Label costs make regions depend on each
/// other; then all differences are treated as one region. O(nodes + edges).
///
/// # Errors
/// If the work was cancelled.
fn fusion_move(search: &MoveMaking<'_>, other: &[u16]) -> Result<Vec<(u32, u16)>> {
    let mut regions = Regions {
        search,
        other,
        seen: search.labels.iter().zip(other).map(|(a, b)| a == b).collect(),
        region: Vec::new(),
        looks: Looks::at(search.problem.monitor),
    };
    let label_of = |node: &u32| (*node, other[*node as usize]);
    let mut moves = Vec::new();
    let one_region = search.problem.energy.label_costs.iter().any(|cost| *cost > 0.0);
    for seed in 0..other.len() {
        regions.looks.step()?;
        if !regions.seen[seed] {
            let rise = regions.grow(seed)?;
            if rise < 0.0 || one_region {
                moves.extend(regions.region.iter().map(label_of));
            }
        }
    }
    Ok(moves)
}

/// The regions in which two labellings differ, collected one after the other.
struct Regions<'a> {
    search: &'a MoveMaking<'a>,
    /// The labelling that `search` is compared with.
    other: &'a [u16],
    /// Nodes that are in a region already or have the same label in both.
    seen: Vec<bool>,
    /// Nodes of the last region.
    region: Vec<u32>,
    looks: Looks<'a>,
}

impl Regions<'_> {
    /// Collects the region of `seed` and returns the change of the energy if it takes the labels of `other`.
    fn grow(&mut self, seed: usize) -> Result<f64> {
        let (problem, labels, other) = (&self.search.problem, &self.search.labels, self.other);
        let energy = &problem.energy;
        let (mut rise, mut next) = (0.0, 0);
        self.seen[seed] = true;
        self.region.clear();
        self.region.push(seed as u32);
        while let Some(&node) = self.region.get(next) {
            next += 1;
            self.looks.step()?;
            let node = node as usize;
            rise += energy.cost(node, other[node]) - energy.cost(node, labels[node]);
            for (neighbour, edge) in problem.adjacency.of(node) {
                let (at, edge) = (neighbour as usize, edge as usize);
                let differs = labels[at] != other[at];
                // An edge within the region is seen from both ends; the smaller end counts it.
                if !differs || node < at {
                    rise += energy.edge_cost(edge, other[node], other[at]);
                    rise -= energy.edge_cost(edge, labels[node], labels[at]);
                }
                if !std::mem::replace(&mut self.seen[at], true) {
                    self.region.push(neighbour);
                }
            }
        }
        Ok(rise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Graph;
    use crate::parallel::Monitor;
    use crate::regularisation::energy::Problem;
    use crate::regularisation::{Energy, Pairwise};

    #[test]
    fn regions_that_do_not_touch_are_chosen_one_by_one() {
        // Nodes 0, 1 and 3 differ. Node 2 has the same label in both and separates 1 from 3.
        let graph = Graph::new(4, &[[0, 1], [1, 2], [2, 3]], &[1.0; 3]).unwrap();
        let unary = [0.0, 5.0, 0.0, 5.0, 0.0, 0.0, 5.0, 0.0];
        let energy = Energy::new(&unary, &graph, 1.0, &Pairwise::Potts).unwrap();
        let adjacency = graph.adjacency();
        let problem = Problem { energy, adjacency: &adjacency, monitor: &Monitor::default() };
        let mut search = MoveMaking::new(problem, vec![0, 0, 0, 0]).unwrap();
        assert_eq!(fusion_move(&search, &[1, 1, 0, 1]).unwrap(), [(3, 1)]);
        assert!(search.fuse(&[1, 1, 0, 1]).unwrap());
        assert_eq!((search.labels.clone(), search.problem.energy.of(&search.labels)), (vec![0, 0, 0, 1], 1.0));
        assert!(!search.fuse(&[1, 1, 0, 1]).unwrap());
    }
}
