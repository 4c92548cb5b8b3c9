//! The Euclidean minimum spanning tree of points.
//!
//! Borůvka's algorithm (O. Borůvka 1926): every tree of the forest is connected to its nearest other tree, until only
//! one tree is left. The nearest point of another tree is taken from the nearest neighbours where these decide it,
//! otherwise from a bounding-box hierarchy in which boxes with points of the same tree only are skipped. Edges are
//! ordered by (squared distance, ends), so that no two are equal.

use super::boxes::{Bounds, Boxes, Visitor};
use crate::cloud::Positions;
use crate::error::Result;
use crate::graph::UnionFind;
use crate::neighbours::Neighbours;
use crate::parallel::{Looks, Monitor, map_watched, sort_watched};
use crate::segmentation::{OctreeParams, octree};
use std::ops::Range;

/// An edge as (bits of the squared distance, smaller end, larger end): squared distances are not negative, so that
/// their bit patterns sort like the values.
type Edge = (u32, u32, u32);

const NO_EDGE: Edge = (u32::MAX, u32::MAX, u32::MAX);
/// Tree index of a box that holds points of several trees.
const MIXED: u32 = u32::MAX;
/// Number of points between two checks for cancellation.
const STEP: usize = 1024;

/// The edges of the tree as `[smaller, larger]`, ascending: one less than there are points.
///
/// `near` are the nearest neighbours of the points, any number of them. O(n log² n) for points of even density.
pub(super) fn euclidean_tree(points: &Positions, near: &Neighbours, monitor: &Monitor) -> Result<Vec<[u32; 2]>> {
    let fine = OctreeParams { min_depth: 20, extra_depth: 0, ..OctreeParams::default() };
    let order = octree(points, &fine, monitor)?.points.items().to_vec();
    let at = |i: u32| points.xyz(i as usize);
    let places: Vec<[f32; 3]> = map_watched(order.len(), monitor, |i| at(order[i]))?;
    let boxes = Boxes::new(&places);
    let mut forest = Forest { order: &order, places: &places, boxes: &boxes, near, sets: UnionFind::new(points.len()) };
    let mut tree = Vec::with_capacity(points.len().saturating_sub(1));
    while tree.len() + 1 < points.len() {
        for (_, a, b) in forest.round(monitor)? {
            if forest.sets.unite(a, b).is_some() {
                tree.push([a, b]);
            }
        }
    }
    sort_watched(&mut tree, monitor)?;
    Ok(tree)
}

/// The forest during the iterations.
struct Forest<'a> {
    /// The points in spatial order.
    order: &'a [u32],
    places: &'a [[f32; 3]],
    boxes: &'a Boxes,
    near: &'a Neighbours,
    sets: UnionFind,
}

impl Forest<'_> {
    /// The shortest edge that leaves each tree; two trees may name the same edge.
    fn round(&mut self, monitor: &Monitor) -> Result<Vec<Edge>> {
        let root = self.sets.roots(monitor)?;
        let tree: Vec<u32> = map_watched(self.order.len(), monitor, |i| root[self.order[i] as usize])?;
        let mut looks = Looks::at(monitor);
        let same = |a: u32, b: u32| if a == b { a } else { MIXED };
        let trees = self.boxes.summarise(|r| tree[r].iter().copied().reduce(same).unwrap_or(MIXED), same);
        let mut best = vec![NO_EDGE; root.len()];
        let mut open = Vec::new();
        for (position, &i) in self.order.iter().enumerate() {
            looks.step()?;
            let least = &mut best[root[i as usize] as usize];
            match self.among_neighbours(i, &root) {
                Ok(edge) => *least = edge.min(*least),
                Err(beyond) => open.push((position, beyond)),
            }
        }
        for (n, (position, beyond)) in open.into_iter().enumerate() {
            if n % STEP == 0 {
                monitor.check()?;
            }
            let i = self.order[position];
            let least = &mut best[tree[position] as usize];
            if beyond <= least.0 {
                let from = (i, self.places[position]);
                let own = tree[position];
                self.boxes.visit(&mut Foreign { forest: self, tree: &tree, trees: &trees, own, from, least });
            }
        }
        best.retain(|edge| *edge != NO_EDGE);
        Ok(best)
    }

    /// The shortest edge from a point to another tree if the neighbour list decides it, otherwise a lower bound of its
    /// length.
    fn among_neighbours(&self, i: u32, root: &[u32]) -> std::result::Result<Edge, u32> {
        if self.near.k() == 0 {
            return Err(0);
        }
        let (row, distances) = (self.near.of(i as usize), self.near.squared_distances(i as usize));
        let edges = row.iter().zip(distances).filter(|(j, _)| root[**j as usize] != root[i as usize]);
        let farthest = distances.last().map_or(0, |d| d.to_bits());
        let least = edges.map(|(&j, d)| (d.to_bits(), i.min(j), i.max(j))).min();
        // Other points may lie exactly at the distance of the last neighbour without being in the list.
        least.filter(|edge| edge.0 < farthest || row.len() + 1 == self.order.len()).ok_or(farthest)
    }
}

/// The search for the nearest point of another tree.
struct Foreign<'a> {
    forest: &'a Forest<'a>,
    tree: &'a [u32],
    trees: &'a [Vec<u32>],
    /// The tree of the query point.
    own: u32,
    from: (u32, [f32; 3]),
    least: &'a mut Edge,
}

impl Visitor for Foreign<'_> {
    fn wants(&mut self, level: usize, index: usize, bounds: &Bounds) -> bool {
        self.trees[level][index] != self.own && bounds.gap(&Bounds::at(self.from.1)).to_bits() <= self.least.0
    }

    fn take(&mut self, places: Range<usize>) {
        let (i, at) = self.from;
        for position in places.filter(|&p| self.tree[p] != self.own) {
            let [x, y, z] = self.forest.places[position];
            let (x, y, z) = (x - at[0], y - at[1], z - at[2]);
            let j = self.forest.order[position];
            let edge = ((x * x + y * y + z * z).to_bits(), i.min(j), i.max(j));
            *self.least = edge.min(*self.least);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neighbours::knn;
    use crate::random::stream;

    fn points(rows: &[[f32; 3]]) -> Positions {
        Positions::from_rows(rows)
    }

    /// Kruskal on all pairs, in the same order of edges.
    fn kruskal(points: &Positions) -> Vec<[u32; 2]> {
        let apart = |a: usize, b: usize| {
            let (x, y, z) = (points.x[a] - points.x[b], points.y[a] - points.y[b], points.z[a] - points.z[b]);
            (x * x + y * y + z * z).to_bits()
        };
        let mut pairs: Vec<Edge> = (0..points.len())
            .flat_map(|b| (0..b).map(move |a| (a, b)))
            .map(|(a, b)| (apart(a, b), a as u32, b as u32))
            .collect();
        pairs.sort_unstable();
        let mut sets = UnionFind::new(points.len());
        let mut tree: Vec<[u32; 2]> =
            pairs.into_iter().filter(|&(_, a, b)| sets.unite(a, b).is_some()).map(|(_, a, b)| [a, b]).collect();
        tree.sort_unstable();
        tree
    }

    fn check(rows: &[[f32; 3]]) {
        let points = points(rows);
        for k in [0, 1, 4, 16] {
            let near = knn(&points, k, &Monitor::default()).unwrap();
            let tree = euclidean_tree(&points, &near, &Monitor::default()).unwrap();
            assert_eq!(tree, kruskal(&points), "{} places, k {k}", rows.len());
        }
    }

    #[test]
    fn the_tree_is_that_of_kruskal_on_all_pairs() {
        let mut random = stream(2, 7);
        for (count, extent) in [(2, 1.0), (17, 5.0), (400, 8.0)] {
            let rows: Vec<[f32; 3]> = (0..count).map(|_| [0; 3].map(|_| (random.uniform() * extent) as f32)).collect();
            check(&rows);
        }
        let lattice: Vec<[f32; 3]> = (0..343u16).map(|i| [i % 7, i / 7 % 7, i / 49].map(f32::from)).collect();
        check(&lattice);
    }

    #[test]
    fn distant_clumps_and_equal_places_are_joined() {
        let mut random = stream(2, 8);
        let mut rows: Vec<[f32; 3]> =
            (0..300).map(|i| [0; 3].map(|_| (random.uniform() as f32) * 0.5 + 20.0 * (i % 4) as f32)).collect();
        rows.extend([[20.0; 3]; 30]);
        rows.push([900.0, -5.0, 3.0]);
        check(&rows);
        check(&[[1.0, 2.0, 3.0]; 12]);
        check(&[]);
        check(&[[0.0; 3]]);
    }
}
