//! Makes supervoxels connected.

use super::super::{NO_SUPERVOXEL, SlicParams};
use super::sorted::Sorted;
use crate::csr::Csr;
use crate::error::Result;
use crate::graph::{Components, Graph, connected_components};
use crate::parallel::Monitor;
use crate::voxels::cells::Cells;
use crate::voxels::rows::{RowGrid, adjacency};

/// Edge of the voxels by which connectivity is decided, as a share of S.
const FINE: f64 = 0.25;

/// The points of one label in one fine voxel.
struct Node {
    voxel: u32,
    label: u32,
    points: u32,
}

/// Splits labels into the connected components of voxels of edge S/4 (26 neighbours). The largest component keeps the
/// label, the first of equal ones; components of at least `min_points` get new labels; smaller ones take the label of
/// the adjacent component with most points in adjacent voxels, or none.
pub(super) fn connect(scene: &Sorted, params: &SlicParams, labels: &mut [u32], monitor: &Monitor) -> Result<()> {
    let grid = RowGrid::new(scene.positions.iter(), params.size * FINE, "size")?;
    let voxels = Cells::new(scene.len(), |i| grid.key(scene.place(i)), monitor)?;
    let near = adjacency(&voxels.keys, monitor)?;
    let (nodes, of_voxel, of_point) = nodes(&voxels, labels);
    let touching = |node: usize| {
        let voxel = nodes[node].voxel as usize;
        let voxels = std::iter::once(voxel as u32).chain(near.group(voxel).iter().copied());
        voxels.flat_map(|v| of_voxel[v as usize]..of_voxel[v as usize + 1]).map(|n| n as usize)
    };
    let mut pairs = Vec::new();
    for a in 0..nodes.len() {
        let alike = |&b: &usize| b > a && nodes[b].label == nodes[a].label;
        pairs.extend(touching(a).filter(alike).map(|b| [a as u32, b as u32]));
    }
    monitor.check()?;
    let pieces =
        connected_components(&Graph::new_watched(nodes.len(), &pairs, &vec![1.0; pairs.len()], monitor)?, monitor)?;
    let names = names(&nodes, &pieces, params.min_points);
    let members = Csr::group_by(&pieces.of, pieces.count, monitor)?;
    let label_of = |piece: usize| match names[piece] {
        NO_SUPERVOXEL => adopt(members.group(piece), touching, |n| (names[pieces.of[n] as usize], nodes[n].points)),
        name => name,
    };
    let found: Vec<u32> = (0..pieces.count).map(label_of).collect();
    for (label, node) in labels.iter_mut().zip(of_point).filter(|(l, _)| **l != NO_SUPERVOXEL) {
        *label = found[pieces.of[node as usize] as usize];
    }
    Ok(())
}

/// The nodes voxel by voxel, the first node of each voxel, and the node of each point; points without a label have
/// none.
fn nodes(voxels: &Cells<u64>, labels: &[u32]) -> (Vec<Node>, Vec<u32>, Vec<u32>) {
    let (mut nodes, mut of_voxel) = (Vec::<Node>::new(), vec![0u32]);
    let mut of_point = vec![NO_SUPERVOXEL; labels.len()];
    for voxel in 0..voxels.len() {
        let first = nodes.len();
        for &i in voxels.of(voxel) {
            let label = labels[i as usize];
            if label == NO_SUPERVOXEL {
                continue;
            }
            let at = nodes[first..].iter().position(|n| n.label == label).map_or(nodes.len(), |at| first + at);
            if at == nodes.len() {
                nodes.push(Node { voxel: voxel as u32, label, points: 0 });
            }
            nodes[at].points += 1;
            of_point[i as usize] = at as u32;
        }
        of_voxel.push(nodes.len() as u32);
    }
    (nodes, of_voxel, of_point)
}

/// The label of each component; none for small ones that are not the largest of their label.
fn names(nodes: &[Node], pieces: &Components, min_points: usize) -> Vec<u32> {
    let mut sizes = vec![0u32; pieces.count];
    let mut labels = vec![0u32; pieces.count];
    for (node, &piece) in nodes.iter().zip(&pieces.of) {
        sizes[piece as usize] += node.points;
        labels[piece as usize] = node.label;
    }
    let mut next = labels.iter().max().map_or(0, |&l| l + 1);
    let mut largest = vec![NO_SUPERVOXEL; next as usize];
    for (piece, &label) in labels.iter().enumerate() {
        let best = &mut largest[label as usize];
        if *best == NO_SUPERVOXEL || sizes[piece] > sizes[*best as usize] {
            *best = piece as u32;
        }
    }
    let name = |(piece, &label): (usize, &u32)| {
        if largest[label as usize] == piece as u32 {
            label
        } else if sizes[piece] as usize >= min_points {
            next += 1;
            next - 1
        } else {
            NO_SUPERVOXEL
        }
    };
    labels.iter().enumerate().map(name).collect()
}

/// The label with most points adjacent to a component, the smallest of equal ones, or none.
fn adopt<I: Iterator<Item = usize>>(
    members: &[u32],
    touching: impl Fn(usize) -> I,
    label_of: impl Fn(usize) -> (u32, u32),
) -> u32 {
    let mut around: Vec<usize> = members.iter().flat_map(|&n| touching(n as usize)).collect();
    around.sort_unstable();
    around.dedup();
    let mut votes: Vec<(u32, u32)> = around.into_iter().map(label_of).filter(|v| v.0 != NO_SUPERVOXEL).collect();
    votes.sort_unstable();
    let counted = votes.chunk_by(|a, b| a.0 == b.0).map(|same| (same.iter().map(|v| v.1).sum::<u32>(), same[0].0));
    counted.reduce(|best, v| if v.0 > best.0 { v } else { best }).map_or(NO_SUPERVOXEL, |best| best.1)
}

#[cfg(test)]
mod tests {
    use super::super::super::PointAttributes;
    use super::super::super::testing::points_of;
    use super::*;

    /// Two strips of points 3 m apart and a third that touches the first.
    fn strips() -> (Sorted, Vec<u32>) {
        let strip = |y: f64, n: i32| (0..n).map(move |i| [f64::from(i) * 0.2, y, 0.1]);
        let rows: Vec<[f64; 3]> = strip(0.1, 20).chain(strip(3.1, 10)).chain(strip(0.4, 4)).collect();
        let sorted = Sorted::new(&points_of(&rows), &PointAttributes::default(), 1.2, &Monitor::default()).unwrap();
        let given: Vec<u32> = (0..34).map(|i| u32::from(i >= 30) * 7).collect();
        let labels = sorted.cells.items.iter().map(|&i| given[i as usize]).collect();
        (sorted, labels)
    }

    #[test]
    fn parts_that_do_not_touch_are_parted_and_large_ones_stay() {
        let (sorted, mut labels) = strips();
        connect(&sorted, &SlicParams::default(), &mut labels, &Monitor::default()).unwrap();
        let labels = sorted.in_order_of_points(&labels, &Monitor::default()).unwrap();
        assert!(labels[..20].iter().all(|&l| l == 0) && labels[30..].iter().all(|&l| l == 7));
        assert!(labels[20..30].iter().all(|&l| l == 8));
    }

    #[test]
    fn small_parts_join_what_they_touch_or_nothing() {
        let (sorted, mut labels) = strips();
        // The third strip has the label of the second one.
        let given: Vec<u32> = (0..34).map(|i| u32::from(i >= 20)).collect();
        labels.iter_mut().zip(&sorted.cells.items).for_each(|(l, &i)| *l = given[i as usize]);
        let params = SlicParams { min_points: 5, ..SlicParams::default() };
        connect(&sorted, &params, &mut labels, &Monitor::default()).unwrap();
        let labels = sorted.in_order_of_points(&labels, &Monitor::default()).unwrap();
        assert!(labels[..20].iter().all(|&l| l == 0) && labels[20..30].iter().all(|&l| l == 1));
        assert!(labels[30..].iter().all(|&l| l == 0), "the part that touched the first strip joined it");
    }
}
