//! Level 2: adjacent segments with similar properties are merged, the most similar first.

use super::automatic::Automatic;
use super::first::Object;
use super::params::ClusterParams;
use crate::error::Result;
use crate::graph::Graph;
use crate::linalg::Eigen3;
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::Shape;
use crate::parallel::{Looks, Monitor};
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// Groups of segments.
#[derive(Clone, Debug, Default)]
pub(super) struct Second {
    /// Group of each segment, from 0 on by decreasing number of points (ties: the first segment).
    pub(super) group: Vec<u32>,
    /// The groups in this order.
    pub(super) objects: Vec<Object>,
}

/// What two segments must share to be merged.
pub(super) struct Limits {
    cosine: f64,
    offset: f64,
    variation: f64,
    angle: f64,
}

/// A segment while it is merged.
struct Growing {
    object: Object,
    eigen: Eigen3,
    near: BTreeSet<u32>,
    /// Number of merges; merged into another: `None`.
    version: Option<u32>,
}

/// A merge that was possible when both segments had these versions; of least cost first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Merge {
    /// Bits of the cost, which is not negative, so that they sort like it.
    cost: u64,
    segments: [u32; 2],
    versions: [u32; 2],
}

/// Merges adjacent segments while two are similar: planes by angle and offsets, others by surface variation; properties
/// are found again after each merge. O(m log m) for m edges that are examined.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn second_level(objects: &[Object], contacts: &Graph, limits: &Limits, monitor: &Monitor) -> Result<Second> {
    let grow = |object: &Object| Growing {
        object: *object,
        eigen: object.spread.eigen(),
        near: BTreeSet::new(),
        version: Some(0),
    };
    let mut all: Vec<Growing> = objects.iter().map(grow).collect();
    for &[a, b] in contacts.edges() {
        all[a as usize].near.insert(b);
        all[b as usize].near.insert(a);
    }
    let mut heap: BinaryHeap<Reverse<Merge>> =
        contacts.edges().iter().filter_map(|&pair| limits.merge(&all, pair)).map(Reverse).collect();
    let mut into: Vec<u32> = (0..objects.len() as u32).collect();
    let mut looks = Looks::at(monitor);
    while let Some(Reverse(Merge { segments: [a, b], versions, .. })) = heap.pop() {
        looks.steps(8)?;
        let now = [all[a as usize].version, all[b as usize].version];
        if now != versions.map(Some) {
            continue;
        }
        into[b as usize] = a;
        let gone = &mut all[b as usize];
        gone.version = None;
        let (near, spread) = (std::mem::take(&mut gone.near), gone.object.spread);
        for &other in near.iter().filter(|other| **other != a) {
            all[other as usize].near.remove(&b);
            all[other as usize].near.insert(a);
            all[a as usize].near.insert(other);
        }
        let kept = &mut all[a as usize];
        kept.near.remove(&b);
        kept.object.spread.join(&spread);
        kept.eigen = kept.object.spread.eigen();
        kept.version = Some(versions[0] + 1);
        let found: Vec<Merge> =
            all[a as usize].near.iter().filter_map(|&other| limits.merge(&all, [a.min(other), a.max(other)])).collect();
        looks.steps(16 * all[a as usize].near.len())?;
        heap.extend(found.into_iter().map(Reverse));
    }
    Ok(numbered(&all, into))
}

impl Limits {
    pub(super) fn new(automatic: &Automatic, params: &ClusterParams) -> Self {
        let angle = (params.merge_angles * automatic.angle_deg).min(90.0).to_radians();
        let offset = params.merge_offsets * automatic.offset;
        Self { cosine: angle.cos(), angle, offset, variation: params.merge_variation }
    }

    /// The merge of two segments, if they are similar.
    fn merge(&self, all: &[Growing], segments: [u32; 2]) -> Option<Merge> {
        let [a, b] = segments.map(|s| &all[s as usize]);
        let cost = self.cost(a, b)?;
        Some(Merge { cost: cost.to_bits(), segments, versions: [a.version?, b.version?] })
    }

    /// How far two segments are from the limits, 0..=1; `None` beyond.
    fn cost(&self, a: &Growing, b: &Growing) -> Option<f64> {
        if a.object.planar != b.object.planar {
            return None;
        }
        if !a.object.planar {
            let variation = |g: &Growing| Shape::of::<Exact>(g.eigen.values).surface_variation;
            let apart = (variation(a) - variation(b)).abs();
            return (apart <= self.variation).then(|| share(apart, self.variation));
        }
        let (n, m) = (a.eigen.vectors[2], b.eigen.vectors[2]);
        let cosine = (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]).abs().min(1.0);
        let (p, q) = (a.object.spread.mean, b.object.spread.mean);
        let across = |normal: [f64; 3]| (0..3).map(|i| (q[i] - p[i]) * normal[i]).sum::<f64>().abs();
        let offset = across(n).max(across(m));
        let similar = cosine >= self.cosine && offset <= self.offset;
        similar.then(|| share(cosine.acos(), self.angle).max(share(offset, self.offset)))
    }
}

fn share(value: f64, limit: f64) -> f64 {
    if limit > 0.0 { value / limit } else { 0.0 }
}

/// Numbers what is left by decreasing size. Segments are merged into smaller numbers only.
fn numbered(all: &[Growing], mut into: Vec<u32>) -> Second {
    for s in 0..into.len() {
        into[s] = into[into[s] as usize];
    }
    let mut order: Vec<u32> = (0..all.len() as u32).filter(|&s| into[s as usize] == s).collect();
    order.sort_by(|&a, &b| {
        let size = |s: u32| all[s as usize].object.spread.count;
        size(b).total_cmp(&size(a)).then(a.cmp(&b))
    });
    let mut number = vec![0; all.len()];
    order.iter().zip(0..).for_each(|(&s, n)| number[s as usize] = n);
    let objects = order.iter().map(|&s| all[s as usize].object).collect();
    Second { group: into.iter().map(|&s| number[s as usize]).collect(), objects }
}
