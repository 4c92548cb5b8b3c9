//! Segments from supervoxels by local graphs: each supervoxel segments its own neighbourhood, and mutual links are
//! kept.

mod cues;
mod params;

pub use params::{Combination, LocalGraphParams, SurfaceRule};

use super::{Partition, SupervoxelShape, Supervoxels, connected_partition};
use crate::cloud::Positions;
use crate::error::Result;
use crate::graph::{EdgeMeaning, FelzenszwalbMerger, FelzenszwalbParams, Graph};
use crate::neighbours::{Neighbours, knn};
use crate::parallel::{Monitor, map_ordered_with};

/// Local graphs that one task segments.
const BLOCK: usize = 256;

/// Groups supervoxels into segments by local graphs.
///
/// E. Hasanpour Zaryabi, M. Saadatseresht, E. Ghanbari Parmehr, *An object-based classification framework for ALS point
/// cloud in urban areas*, ISPRS Annals X-4/W1, 2022, sections 3.2 to 3.5; after Y. Xu, L. Hoegner, S. Tuttas, U.
/// Stilla, *Voxel- and graph-based point cloud segmentation of 3D scenes using perceptual grouping laws*, ISPRS Annals
/// IV-1/W1, 2017, doi:10.5194/isprs-annals-IV-1-W1-43-2017.
///
/// The local graph of a supervoxel consists of itself and the N supervoxels with the nearest centroids; an edge
/// connects any two of them that are less than √3 S apart, with the weight W = Π exp(−D²/(2λ²)) over distance, features
/// and surface connectivity (Eq. 2 and 4). The local graph is segmented by the method of Felzenszwalb and Huttenlocher
/// on similarities. Each supervoxel thereby selects the others in its segment; two that select each other are linked,
/// and the connected components of the links are the segments. ([`Combination`] has the paper's way too: all segments of
/// all local graphs, united where they share a supervoxel.)
///
/// Returns a partition of the supervoxels; [`Supervoxels::point_partition`] transfers it to the points. O(V (N² log N +
/// log V)).
/// The result does not depend on the order of the supervoxels (except for ties) nor on the number of threads.
///
/// # Errors
/// If a parameter is outside its range or the work was cancelled.
pub fn local_graphs(supervoxels: &Supervoxels, params: &LocalGraphParams, monitor: &Monitor) -> Result<Partition> {
    params.validate()?;
    let shapes = supervoxels.shapes();
    let centroids: Positions = shapes.iter().map(|s| s.centroid).collect();
    let near = knn(&centroids, params.neighbours, monitor)?;
    monitor.stage("local graphs", shapes.len() as u64);
    let local = Local { shapes, near: &near, size: supervoxels.size(), params };
    let blocks = shapes.len().div_ceil(BLOCK);
    let range = |block: usize| block * BLOCK..((block + 1) * BLOCK).min(shapes.len());
    let mut links: Vec<[u32; 2]> = match params.combination {
        Combination::Shared => {
            let parts = map_ordered_with(0..blocks, monitor, Scratch::default, |scratch, block| {
                let links = range(block).flat_map(|centre| local.all_links(centre, scratch)).collect::<Vec<_>>();
                monitor.advance(range(block).len() as u64);
                Ok(links)
            })?;
            parts.into_iter().flatten().collect()
        }
        combination => {
            let parts = map_ordered_with(0..blocks, monitor, Scratch::default, |scratch, block| {
                let chosen: Vec<Vec<u32>> = range(block).map(|centre| local.chosen(centre, scratch)).collect();
                monitor.advance(chosen.len() as u64);
                Ok(chosen)
            })?;
            combine(&parts.into_iter().flatten().collect::<Vec<_>>(), combination)
        }
    };
    if params.attach_isolated {
        local.attach_isolated(&mut links);
    }
    let graph = Graph::new_watched(shapes.len(), &links, &vec![1.0; links.len()], monitor)?;
    connected_partition(&graph, |_, _| true, monitor)
}

/// Scratch memory of a thread.
#[derive(Default)]
struct Scratch {
    edges: Vec<([u32; 2], f64)>,
    merger: FelzenszwalbMerger,
}

/// Everything the local graphs are built from.
struct Local<'a> {
    shapes: &'a [SupervoxelShape],
    near: &'a Neighbours,
    size: f64,
    params: &'a LocalGraphParams,
}

impl Local<'_> {
    /// Weight of the edge between two supervoxels; none if they are too far apart.
    fn weight(&self, i: u32, j: u32) -> Option<f64> {
        let (a, b) = (&self.shapes[i as usize], &self.shapes[j as usize]);
        let reach = self.params.reach * self.size;
        let apart: f64 = (0..3).map(|k| (f64::from(a.centroid[k]) - f64::from(b.centroid[k])).powi(2)).sum();
        // The arguments are ordered, so that rounding gives (i, j) and (j, i) the same weight.
        let (a, b) = if i < j { (a, b) } else { (b, a) };
        (apart < reach * reach)
            .then(|| cues::weight(cues::squared_distances(a, b, self.params), self.size, self.params))
    }

    fn neighbours(&self, centre: usize) -> &[u32] {
        if self.near.is_empty() { &[] } else { self.near.of(centre) }
    }

    /// Segments the local graph of a supervoxel; returns its members, the centre first.
    fn divide(&self, centre: usize, scratch: &mut Scratch) -> Vec<u32> {
        let others = self.neighbours(centre);
        let member = |at: usize| if at == 0 { centre as u32 } else { others[at - 1] };
        scratch.edges.clear();
        for a in 0..=others.len() {
            for b in a + 1..=others.len() {
                let weight = self.weight(member(a), member(b));
                scratch.edges.extend(weight.map(|w| ([a as u32, b as u32], w)));
            }
        }
        let form = FelzenszwalbParams { k: self.params.k, meaning: EdgeMeaning::Similarity };
        scratch.merger.merge(others.len() + 1, scratch.edges.iter().copied(), &form);
        (0..=others.len()).map(member).collect()
    }

    /// The supervoxels that `centre` selects: the others in its segment of its local graph, ascending.
    fn chosen(&self, centre: usize, scratch: &mut Scratch) -> Vec<u32> {
        let members = self.divide(centre, scratch);
        let own = scratch.merger.component(0);
        let held = (1..members.len()).filter(|&at| scratch.merger.component(at as u32) == own);
        let mut chosen: Vec<u32> = held.map(|at| members[at]).collect();
        chosen.sort_unstable();
        chosen
    }

    /// Links that hold each segment of the local graph of `centre` together.
    fn all_links(&self, centre: usize, scratch: &mut Scratch) -> Vec<[u32; 2]> {
        let members = self.divide(centre, scratch);
        let first = |at: usize, scratch: &mut Scratch| members[scratch.merger.component(at as u32) as usize];
        let pairs = (0..members.len()).map(|at| [first(at, scratch), members[at]]);
        pairs.filter(|[a, b]| a != b).collect()
    }

    /// Links each supervoxel that has no link to the most similar of those neighbours that have more than one link;
    /// ties go to the nearest.
    fn attach_isolated(&self, links: &mut Vec<[u32; 2]>) {
        let mut count = vec![0u32; self.shapes.len()];
        links.iter().flatten().for_each(|&i| count[i as usize] += 1);
        for i in (0..self.shapes.len() as u32).filter(|&i| count[i as usize] == 0) {
            let linked = self.neighbours(i as usize).iter().filter(|&&j| count[j as usize] > 1);
            let alike = linked.filter_map(|&j| Some((self.weight(i, j)?, j)));
            if let Some((_, j)) = alike.reduce(|best, row| if row.0 > best.0 { row } else { best }) {
                links.push([i, j]);
            }
        }
    }
}

/// The pairs of linked supervoxels, each once; `chosen[i]` are those that i selects, ascending.
fn combine(chosen: &[Vec<u32>], combination: Combination) -> Vec<[u32; 2]> {
    let mut links = Vec::new();
    for (i, others) in (0u32..).zip(chosen) {
        for &j in others {
            let back = chosen[j as usize].binary_search(&i).is_ok();
            match combination {
                Combination::Mutual if back && i < j => links.push([i, j]),
                Combination::Union if !back || i < j => links.push([i, j]),
                // `Shared` has links of its own.
                _ => {}
            }
        }
    }
    links
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use crate::segmentation::{PointAttributes, SupervoxelLabels};
    use std::collections::BTreeSet;

    /// Supervoxels of one point each: a floor, a wall on it, and two that stand alone; in the order of `order`.
    fn scene(order: &[usize]) -> Supervoxels {
        let mut rows: Vec<([f32; 3], [f32; 3])> = Vec::new();
        let mut s = stream(41, 0);
        let mut jitter = || s.uniform() as f32 * 0.2;
        for i in 0..100 {
            rows.push(([(i % 10) as f32 + jitter(), (i / 10) as f32 + jitter(), 0.0], [0.0, 0.0, 1.0]));
        }
        for i in 0..60 {
            rows.push(([(i % 10) as f32 + jitter(), 10.0, 0.6 + (i / 10) as f32 + jitter()], [0.0, -1.0, 0.0]));
        }
        rows.push(([50.0, 50.0, 0.0], [0.0, 0.0, 1.0]));
        rows.push(([4.5, 4.5, 0.9], [1.0, 0.0, 0.0]));
        let rows: Vec<_> = order.iter().map(|&i| rows[i]).collect();
        let points: Positions = rows.iter().map(|r| r.0).collect();
        let normals: Vec<[f32; 3]> = rows.iter().map(|r| r.1).collect();
        let attributes = PointAttributes { normals: Some(&normals), colours: None };
        let labels = (0..rows.len() as u32).collect();
        Supervoxels::new(&points, &attributes, SupervoxelLabels { labels, size: 1.0 }, &Monitor::default()).unwrap()
    }

    fn in_order() -> Vec<usize> {
        (0..162).collect()
    }

    #[test]
    fn floor_and_wall_become_segments_and_a_stranger_stays_alone() {
        let params = LocalGraphParams { attach_isolated: false, ..LocalGraphParams::default() };
        let found = local_graphs(&scene(&in_order()), &params, &Monitor::default()).unwrap();
        let of = found.segments();
        assert!(of[..100].iter().all(|&s| s == of[0]) && of[100..160].iter().all(|&s| s == of[100]));
        assert!(of[0] != of[100] && of[160] != of[0] && of[161] != of[0] && found.len() == 4);
        let params = LocalGraphParams::default();
        let found = local_graphs(&scene(&in_order()), &params, &Monitor::default()).unwrap();
        assert_eq!((found.len(), found.segments()[161]), (3, found.segments()[0]), "joins what it stands on");
    }

    #[test]
    fn the_order_of_the_supervoxels_does_not_matter() {
        let mut order = in_order();
        stream(42, 0).shuffle(&mut order);
        for combination in [Combination::Mutual, Combination::Union, Combination::Shared] {
            let params = LocalGraphParams { combination, k: 0.4, ..LocalGraphParams::default() };
            let expected = local_graphs(&scene(&in_order()), &params, &Monitor::default()).unwrap();
            let found = local_graphs(&scene(&order), &params, &Monitor::default()).unwrap();
            let back: Vec<u32> = order.iter().map(|&i| expected.segments()[i]).collect();
            assert_eq!(Partition::from_labels(&back).unwrap(), found);
        }
    }

    #[test]
    fn links_are_mutual_and_a_union_has_more_of_them() {
        let chosen = vec![vec![1, 2], vec![0], vec![3], vec![0, 2]];
        assert_eq!(combine(&chosen, Combination::Mutual), [[0, 1], [2, 3]]);
        assert_eq!(combine(&chosen, Combination::Union), [[0, 1], [0, 2], [2, 3], [3, 0]]);
    }

    #[test]
    fn local_segments_that_share_a_supervoxel_are_one() {
        // By the letter: every local graph is a list of sets, and sets that meet are united until none do.
        let supervoxels = scene(&in_order());
        for k in [0.2, 0.4, 0.9] {
            let params =
                LocalGraphParams { combination: Combination::Shared, attach_isolated: false, k, ..Default::default() };
            let found = local_graphs(&supervoxels, &params, &Monitor::default()).unwrap();
            let shapes = supervoxels.shapes();
            let centroids: Positions = shapes.iter().map(|s| s.centroid).collect();
            let near = knn(&centroids, params.neighbours, &Monitor::default()).unwrap();
            let local = Local { shapes, near: &near, size: supervoxels.size(), params: &params };
            let mut sets: Vec<BTreeSet<u32>> = Vec::new();
            for centre in 0..shapes.len() {
                let mut scratch = Scratch::default();
                let members = local.divide(centre, &mut scratch);
                for at in 0..members.len() as u32 {
                    let root = scratch.merger.component(at);
                    let one: BTreeSet<u32> = (0..members.len() as u32)
                        .filter(|&other| scratch.merger.component(other) == root)
                        .map(|other| members[other as usize])
                        .collect();
                    let (meet, apart) = sets.into_iter().partition(|set: &BTreeSet<u32>| !set.is_disjoint(&one));
                    let united = Vec::into_iter(meet).fold(one, |all, set| &all | &set);
                    sets = apart;
                    sets.push(united);
                }
            }
            let of = |i: u32| sets.iter().position(|set| set.contains(&i)).unwrap() as u32;
            let expected: Vec<u32> = (0..shapes.len() as u32).map(of).collect();
            assert_eq!(Partition::from_labels(&expected).unwrap(), found, "k {k}");
        }
    }

    #[test]
    fn few_supervoxels_are_no_trouble() {
        for n in 0..3 {
            let order: Vec<usize> = (0..n).collect();
            let found = local_graphs(&scene(&order), &LocalGraphParams::default(), &Monitor::default()).unwrap();
            assert_eq!(found.nodes(), n);
        }
    }
}
