//! Fusion of two labellings: the better of the two, region by region.
//!
//! The nodes whose labels differ form regions that are not adjacent to each other, so that each region can take the
//! cheaper of its two labellings independently. The energy of the result is at most that of the better labelling.

use super::search::Search;
use crate::error::Result;
use crate::parallel::{Looks, Monitor};

/// The moves to the labels of `other` in all regions where they cost less. Label costs make regions depend on each
/// other; then all differences are treated as one region. O(nodes + edges).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn better_regions(search: &Search<'_>, other: &[u16], monitor: &Monitor) -> Result<Vec<(u32, u16)>> {
    let mut looks = Looks::at(monitor);
    let mut seen: Vec<bool> = search.labels.iter().zip(other).map(|(a, b)| a == b).collect();
    let label_of = |node: &u32| (*node, other[*node as usize]);
    let mut moves = Vec::new();
    let one_region = search.energy.label_costs.iter().any(|cost| *cost > 0.0);
    let mut region = Vec::new();
    for seed in 0..seen.len() {
        looks.step()?;
        if !seen[seed] {
            region.clear();
            let rise = spread((search, other), seed, (&mut seen, &mut region), &mut looks)?;
            if rise < 0.0 || one_region {
                moves.extend(region.iter().map(label_of));
            }
        }
    }
    Ok(moves)
}

/// Collects the region of `seed` and returns the change of the energy if it takes the labels of `other`.
fn spread(
    (search, other): (&Search<'_>, &[u16]),
    seed: usize,
    (seen, region): (&mut [bool], &mut Vec<u32>),
    looks: &mut Looks<'_>,
) -> Result<f64> {
    let (energy, labels) = (&search.energy, &search.labels);
    let (mut rise, mut next) = (0.0, 0);
    seen[seed] = true;
    region.push(seed as u32);
    while let Some(&node) = region.get(next) {
        next += 1;
        looks.step()?;
        let node = node as usize;
        rise += energy.cost(node, other[node]) - energy.cost(node, labels[node]);
        for (neighbour, edge) in search.adjacency.of(node) {
            let (at, edge) = (neighbour as usize, edge as usize);
            let differs = labels[at] != other[at];
            // An edge within the region is seen from both ends; the smaller end counts it.
            if !differs || node < at {
                rise += energy.edge_cost(edge, other[node], other[at]);
                rise -= energy.edge_cost(edge, labels[node], labels[at]);
            }
            if !std::mem::replace(&mut seen[at], true) {
                region.push(neighbour);
            }
        }
    }
    Ok(rise)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Graph;
    use crate::regularisation::{Energy, Pairwise};

    #[test]
    fn regions_that_do_not_touch_are_chosen_one_by_one() {
        // Nodes 0, 1 and 3 differ. Node 2 has the same label in both and separates 1 from 3.
        let graph = Graph::new(4, &[[0, 1], [1, 2], [2, 3]], &[1.0; 3]).unwrap();
        let unary = [0.0, 5.0, 0.0, 5.0, 0.0, 0.0, 5.0, 0.0];
        let energy = Energy::new(&unary, &graph, 1.0, &Pairwise::Potts).unwrap();
        let adjacency = graph.adjacency();
        let mut search = Search::new(energy, &adjacency, vec![0, 0, 0, 0], &Monitor::default()).unwrap();
        assert_eq!(better_regions(&search, &[1, 1, 0, 1], &Monitor::default()).unwrap(), [(3, 1)]);
        assert!(search.join(&[1, 1, 0, 1], &Monitor::default()).unwrap());
        assert_eq!((search.labels.clone(), search.energy.of(&search.labels)), (vec![0, 0, 0, 1], 1.0));
        assert!(!search.join(&[1, 1, 0, 1], &Monitor::default()).unwrap());
    }
}
