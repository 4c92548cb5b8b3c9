//! Level 1: planar regions, and connected sets of what is left.

use super::automatic::Prepared;
use super::params::ClusterParams;
use crate::error::Result;
use crate::linalg::Spread;
use crate::neighbours::stacks::{Ball, Stacks};
use crate::parallel::{Monitor, map_ordered_with, map_watched, watched};
use crate::segmentation::region_growing::planar::{PlanarLimits, Surface, connected_rest, planar_regions};

/// Points that one task examines.
const BLOCK: usize = 4096;
/// Label of points that belong to no segment.
pub(super) const NONE: u32 = 0;

/// A segment: its points, and whether it was grown as a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Object {
    pub(super) spread: Spread,
    pub(super) planar: bool,
}

/// Segments of points in the order of the stacks.
#[derive(Clone, Debug, Default)]
pub(super) struct First {
    /// Segment of each point, from 1 on by decreasing size (ties: the first point); [`NONE`].
    pub(super) labels: Vec<u32>,
    /// The segments in this order.
    pub(super) objects: Vec<Object>,
}

/// Planar regions; then what is left as sets of points connected by steps of ε: sets of at least τ points are segments
/// too, smaller ones join the nearest segment.
pub(super) fn first_level(prepared: &Prepared, params: &ClusterParams, monitor: &Monitor) -> Result<First> {
    let Prepared { automatic, stacks, normals, variation } = prepared;
    let limits = PlanarLimits {
        radius: automatic.radius,
        angle_deg: automatic.angle_deg,
        offset: automatic.offset,
        min_size: automatic.min_size,
        first_fit: params.first_fit,
        growth: params.growth,
    };
    let grown = planar_regions(Surface { stacks, normals, variation }, &limits, monitor)?;
    let (planes, mut labels) = (grown.count, grown.labels);
    for _ in 0..params.edge_rounds {
        adopt(stacks, &mut labels, &limits, monitor)?;
    }
    let rest = connected_rest(stacks, automatic.radius, &mut labels, monitor)?;
    let mut is_kept = vec![true; 1 + planes as usize];
    is_kept.extend(rest.iter().map(|&size| size >= automatic.min_size as usize));
    let radius = params.join_radii * automatic.radius;
    if radius > 0.0 && is_kept.iter().skip(1).any(|kept| *kept) {
        join(stacks, &mut labels, Kept { is_kept: &is_kept, radius }, monitor)?;
    }
    labels.iter_mut().filter(|l| !is_kept[**l as usize]).for_each(|l| *l = NONE);
    by_size(stacks, labels, planes, monitor)
}

/// Each point without a region joins, of the regions with a point within the radius, the one whose plane is nearest, if
/// it is within the offset: the normals at an edge are those of both sides, so that growth stops before it.
fn adopt(stacks: &Stacks, labels: &mut [u32], limits: &PlanarLimits, monitor: &Monitor) -> Result<()> {
    let count = labels.iter().copied().max().unwrap_or(0) as usize;
    let mut spreads = vec![Spread::default(); count + 1];
    for piece in watched(labels.len(), monitor) {
        for i in piece?.filter(|&i| labels[i] != NONE) {
            spreads[labels[i] as usize].join(&Spread::of(stacks.positions.xyz(i).map(f64::from)));
        }
    }
    let planes = map_watched(count + 1, monitor, |label| {
        let Spread { mean, .. } = spreads[label];
        (mean, spreads[label].eigen().vectors[2])
    })?;
    let parts = map_ordered_with(0..labels.len().div_ceil(BLOCK), monitor, Vec::new, |runs, block| {
        let mut found = Vec::new();
        for i in (block * BLOCK..((block + 1) * BLOCK).min(labels.len())).filter(|&i| labels[i] == NONE) {
            let at = stacks.positions.xyz(i);
            let mut nearest = (limits.offset, NONE);
            stacks.around(Ball { at, radius: limits.radius }, runs, |j| {
                let label = labels[j as usize];
                if label == NONE || label == nearest.1 {
                    return;
                }
                let (mean, normal) = planes[label as usize];
                let apart = (0..3).map(|a| (f64::from(at[a]) - mean[a]) * normal[a]).sum::<f64>().abs();
                let nearer = apart.total_cmp(&nearest.0).then(label.cmp(&nearest.1));
                if nearer.is_lt() || (nearest.1 == NONE && apart <= limits.offset) {
                    nearest = (apart, label);
                }
            });
            if nearest.1 != NONE {
                found.push((i, nearest.1));
            }
        }
        Ok(found)
    })?;
    parts.into_iter().flatten().for_each(|(i, label)| labels[i] = label);
    Ok(())
}

/// Which labels are kept, and how far from their points those of others may be to join them, metres.
struct Kept<'a> {
    is_kept: &'a [bool],
    radius: f64,
}

/// Gives the points of each set that is not kept the label of the nearest point of a kept one within the radius of any
/// of them.
fn join(stacks: &Stacks, labels: &mut [u32], kept: Kept<'_>, monitor: &Monitor) -> Result<()> {
    let Kept { is_kept, radius } = kept;
    let blocks = labels.len().div_ceil(BLOCK);
    let parts = map_ordered_with(0..blocks, monitor, Vec::new, |runs, block| {
        let mut found = Vec::new();
        for i in block * BLOCK..((block + 1) * BLOCK).min(labels.len()) {
            if is_kept[labels[i] as usize] {
                continue;
            }
            let at = stacks.positions.xyz(i);
            let mut nearest = (f32::INFINITY, NONE);
            stacks.around(Ball { at, radius }, runs, |j| {
                let other = stacks.positions.xyz(j as usize);
                let apart = (0..3).map(|a| (other[a] - at[a]) * (other[a] - at[a])).sum::<f32>();
                if is_kept[labels[j as usize] as usize] && apart < nearest.0 {
                    nearest = (apart, labels[j as usize]);
                }
            });
            if nearest.1 != NONE {
                found.push((labels[i], nearest));
            }
        }
        Ok(found)
    })?;
    let mut best = vec![(f32::INFINITY, NONE); is_kept.len()];
    for (set, nearest) in parts.into_iter().flatten() {
        if nearest.0 < best[set as usize].0 {
            best[set as usize] = nearest;
        }
    }
    let new: Vec<u32> = (0..is_kept.len() as u32)
        .map(|set| if is_kept[set as usize] || best[set as usize].1 == NONE { set } else { best[set as usize].1 })
        .collect();
    labels.iter_mut().for_each(|label| *label = new[*label as usize]);
    Ok(())
}

/// Numbers the segments by decreasing size; those up to `planes` were grown as planes.
fn by_size(stacks: &Stacks, mut labels: Vec<u32>, planes: u32, monitor: &Monitor) -> Result<First> {
    let largest = labels.iter().copied().max().unwrap_or(0) as usize;
    let (mut sizes, mut firsts) = (vec![0u32; largest + 1], vec![u32::MAX; largest + 1]);
    for (i, &label) in labels.iter().enumerate() {
        sizes[label as usize] += 1;
        firsts[label as usize] = firsts[label as usize].min(i as u32);
    }
    let mut order: Vec<u32> = (1..=largest as u32).filter(|&l| sizes[l as usize] > 0).collect();
    order.sort_unstable_by_key(|&l| (std::cmp::Reverse(sizes[l as usize]), firsts[l as usize]));
    let mut number = vec![NONE; largest + 1];
    order.iter().zip(1..).for_each(|(&l, n)| number[l as usize] = n);
    let mut objects: Vec<Object> = order.iter().map(|&l| Object { planar: l <= planes, ..Object::default() }).collect();
    for piece in watched(labels.len(), monitor) {
        for i in piece? {
            labels[i] = number[labels[i] as usize];
            if labels[i] != NONE {
                let at = stacks.positions.xyz(i).map(f64::from);
                objects[labels[i] as usize - 1].spread.join(&Spread::of(at));
            }
        }
    }
    Ok(First { labels, objects })
}
