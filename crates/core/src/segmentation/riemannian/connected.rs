//! Splits disconnected clusters; small pieces join the cluster that they touch most.

use crate::error::Result;
use crate::graph::UnionFind;
use crate::neighbours::Neighbours;
use crate::parallel::{Looks, Monitor, map_watched, sort_watched, watched};
use std::ops::Range;

/// Splits clusters into the connected components of the graph of nearest neighbours.
///
/// The largest component of a cluster stays; of the others, those of at least `min_points` points become clusters of
/// their own, smaller ones join the cluster to which most edges lead (ties: the one of the smallest point), pass by
/// pass from the outside in; components without any neighbour stay. A cluster's label is the index of one of its
/// points. O(n k).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn connected_clusters(
    of: &[u32],
    near: &Neighbours,
    min_points: u32,
    monitor: &Monitor,
) -> Result<Vec<u32>> {
    let mut sets = UnionFind::new(of.len());
    for points in watched(near.len(), monitor) {
        for (a, b) in edges(near, points?).filter(|&(a, b)| of[a as usize] == of[b as usize]) {
            sets.unite(a, b);
        }
    }
    let mut label = sets.roots(monitor)?;
    let mut loose = small_pieces(of, &label, min_points, monitor)?;
    while attach(&mut label, &mut loose, near, monitor)? {}
    Ok(label)
}

fn edges(near: &Neighbours, points: Range<usize>) -> impl Iterator<Item = (u32, u32)> {
    points.flat_map(|i| near.of(i).iter().map(move |&j| (i as u32, j)))
}

/// For each root, whether its component is small and not the largest of its cluster.
fn small_pieces(of: &[u32], roots: &[u32], min_points: u32, monitor: &Monitor) -> Result<Vec<bool>> {
    let mut size = vec![0u32; of.len()];
    for piece in watched(roots.len(), monitor) {
        roots[piece?].iter().for_each(|&r| size[r as usize] += 1);
    }
    let mut largest = vec![u32::MAX; of.iter().max().map_or(0, |m| *m as usize + 1)];
    for piece in watched(of.len(), monitor) {
        for root in piece?.filter(|&root| size[root] > 0) {
            let best = &mut largest[of[root] as usize];
            if *best == u32::MAX || size[root] > size[*best as usize] {
                *best = root as u32;
            }
        }
    }
    let small = |root: usize| size[root] < min_points && largest[of[root] as usize] != root as u32;
    map_watched(of.len(), monitor, |root| size[root] > 0 && small(root))
}

/// One pass: every small component that touches an assigned one joins it; false if there was none.
fn attach(label: &mut [u32], loose: &mut [bool], near: &Neighbours, monitor: &Monitor) -> Result<bool> {
    let mut touches: Vec<(u32, u32)> = Vec::new();
    for points in watched(near.len(), monitor) {
        for (a, b) in edges(near, points?) {
            let (a, b) = (label[a as usize], label[b as usize]);
            match (loose[a as usize], loose[b as usize]) {
                (true, false) => touches.push((a, b)),
                (false, true) => touches.push((b, a)),
                _ => {}
            }
        }
    }
    sort_watched(&mut touches, monitor)?;
    let mut target: Vec<u32> = (0..label.len() as u32).collect();
    let mut looks = Looks::at(monitor);
    for piece in touches.chunk_by(|a, b| a.0 == b.0) {
        looks.steps(piece.len())?;
        let mut most = 0;
        for run in piece.chunk_by(|a, b| a == b) {
            if run.len() > most {
                most = run.len();
                target[run[0].0 as usize] = run[0].1;
            }
        }
        loose[piece[0].0 as usize] = false;
    }
    for piece in watched(label.len(), monitor) {
        label[piece?].iter_mut().for_each(|l| *l = target[*l as usize]);
    }
    Ok(!touches.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a line, each a neighbour of the one before and after.
    fn line(count: u32) -> Neighbours {
        let index: Vec<u32> = (0..count)
            .flat_map(|i| [if i == 0 { 2 } else { i - 1 }, if i + 1 == count { i - 2 } else { i + 1 }])
            .collect();
        Neighbours::new(2, index, vec![1.0; 2 * count as usize]).unwrap()
    }

    fn parted_by(of: &[u32], near: &Neighbours, min_points: u32) -> Vec<u32> {
        connected_clusters(of, near, min_points, &Monitor::default()).unwrap()
    }

    #[test]
    fn pieces_part_and_small_ones_join_what_they_touch() {
        //             large   other    large again, 4   other   alone, 2
        let of = [7, 7, 7, 7, 7, 3, 3, 3, 3, 7, 7, 7, 7, 3, 3, 9, 9];
        let parted = parted_by(&of, &line(17), 1);
        assert_eq!(parted, [0, 0, 0, 0, 0, 5, 5, 5, 5, 9, 9, 9, 9, 13, 13, 15, 15]);
        let joined = parted_by(&of, &line(17), 3);
        assert_eq!(joined[..13], parted[..13]);
        assert_eq!(joined[13..], [15; 4], "most edges, for the last point has two inwards; a whole cluster stays");
        let more = parted_by(&of, &line(17), 5);
        assert_eq!(more, [0, 0, 0, 0, 0, 5, 5, 5, 5, 5, 5, 5, 5, 15, 15, 15, 15]);
    }

    #[test]
    fn nothing_is_lost_without_neighbours() {
        assert_eq!(parted_by(&[4, 4], &Neighbours::default(), 3), [0, 1]);
        assert!(parted_by(&[], &Neighbours::default(), 3).is_empty());
    }
}
