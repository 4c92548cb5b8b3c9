//! Region growing on points: planar regions, which are compared with the plane of the region, and connected sets, which
//! grow from point to point without a plane.
//!
//! F. Poux, C. Mattes, L. Kobbelt, *Unsupervised segmentation of indoor 3D point cloud: application to object-based
//! classification*, ISPRS Archives XLIV-4/W1, 2020, name the parameters ε, τ, α; the order of the seeds and the growth
//! are as in Rabbani et al. 2006.

use super::grow::seeds;
use super::result::GrownRegions;
use crate::error::{Error, Result};
use crate::linalg::Spread;
use crate::neighbours::stacks::{Ball, Stacks};
use crate::parallel::{Looks, Monitor};
use std::ops::Range;

/// Limits of [`planar_regions`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlanarLimits {
    /// Points within this distance are neighbours, metres.
    pub(crate) radius: f64,
    /// Largest angle between the normal of a point and that of the region's plane, degrees.
    pub(crate) angle_deg: f64,
    /// Largest distance of a point from the plane, metres.
    pub(crate) offset: f64,
    /// Regions of fewer points are dissolved.
    pub(crate) min_size: u32,
    /// The plane is fitted to the region's points from this number on; before, it is that of the seed.
    pub(crate) first_fit: u32,
    /// It is fitted again when the region has grown by this factor; above 1.
    pub(crate) growth: f64,
}

/// Points with their normals and surface variations, in the order of the stacks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<'a> {
    pub(crate) stacks: &'a Stacks,
    pub(crate) normals: &'a [[f32; 3]],
    pub(crate) variation: &'a [f32],
}

/// Plane of a region.
struct Plane {
    at: [f64; 3],
    normal: [f64; 3],
}

/// Segments points into planar regions: from the flattest point that has no region yet, a region takes every neighbour
/// whose normal is within the angle of the normal of the region's plane, and that is within the offset of this plane. The
/// plane is fitted again as the region grows.
///
/// One region after the other, so that the result does not depend on the number of threads. Regions are numbered by
/// their first point in the order of the stacks. O(m) for m neighbours of all points.
///
/// # Errors
/// If there are not as many normals as points, or the work was cancelled.
pub(crate) fn planar_regions(surface: Surface<'_>, limits: &PlanarLimits, monitor: &Monitor) -> Result<GrownRegions> {
    let Surface { stacks, normals, variation } = surface;
    let count = stacks.len();
    if [normals.len(), variation.len()] != [count; 2] {
        let found = [normals.len(), variation.len()];
        return Err(Error::input(format!("{} normals and {} variations of {count} points", found[0], found[1])));
    }
    monitor.stage("planar regions", count as u64);
    let cosine = limits.angle_deg.to_radians().cos();
    let mut spreading = Spreading::new(stacks, limits.radius, monitor);
    let mut labels = vec![0u32; count];
    let mut regions = 0;
    for seed in seeds(variation, monitor)? {
        if labels[seed as usize] > 0 {
            continue;
        }
        regions += 1;
        let place = |i: u32| stacks.positions.xyz(i as usize).map(f64::from);
        let mut spread = Spread::default();
        let mut plane = Plane { at: place(seed), normal: normals[seed as usize].map(f64::from) };
        let mut next_fit = f64::from(limits.first_fit);
        let taken = spreading.from(seed, regions, &mut labels, |i| {
            let (at, normal) = (place(i), normals[i as usize].map(f64::from));
            let turned = dot(normal, plane.normal).abs() < cosine;
            if turned || dot(difference(at, plane.at), plane.normal).abs() > limits.offset {
                return false;
            }
            spread.join(&Spread::of(at));
            if spread.count >= next_fit {
                plane = Plane { at: spread.mean, normal: spread.eigen().vectors[2] };
                next_fit = (spread.count * limits.growth).max(spread.count + 1.0);
            }
            true
        })?;
        monitor.advance(taken as u64);
    }
    GrownRegions::numbered(labels, regions, limits.min_size..=u32::MAX, monitor)
}

/// The sets of points without a label that are connected by steps of at most `radius`, as labels from `labels`' largest
/// on; returns how many points each has. O(m) for m neighbours of these points.
///
/// # Errors
/// If the work was cancelled.
pub(crate) fn connected_rest(
    stacks: &Stacks,
    radius: f64,
    labels: &mut [u32],
    monitor: &Monitor,
) -> Result<Vec<usize>> {
    let first = labels.iter().copied().max().unwrap_or(0);
    let mut spreading = Spreading::new(stacks, radius, monitor);
    let mut sizes = Vec::new();
    for seed in 0..labels.len() as u32 {
        if labels[seed as usize] == 0 {
            let region = first + 1 + sizes.len() as u32;
            sizes.push(spreading.from(seed, region, labels, |_| true)?);
        }
    }
    Ok(sizes)
}

/// Labels what can be reached from a seed.
struct Spreading<'a> {
    stacks: &'a Stacks,
    radius: f64,
    front: Vec<u32>,
    runs: Vec<Range<u32>>,
    looks: Looks<'a>,
}

impl<'a> Spreading<'a> {
    fn new(stacks: &'a Stacks, radius: f64, monitor: &'a Monitor) -> Self {
        Self { stacks, radius, front: Vec::new(), runs: Vec::new(), looks: Looks::at(monitor) }
    }

    /// Labels the seed and every point without a label that `takes` accepts and that a chain of neighbours joins with
    /// the seed; returns how many.
    fn from(&mut self, seed: u32, label: u32, labels: &mut [u32], mut takes: impl FnMut(u32) -> bool) -> Result<usize> {
        let Self { stacks, radius, front, runs, looks } = self;
        takes(seed);
        labels[seed as usize] = label;
        front.clear();
        front.push(seed);
        let mut at = 0;
        while let Some(&current) = front.get(at) {
            at += 1;
            let ball = Ball { at: stacks.positions.xyz(current as usize), radius: *radius };
            looks.steps(64)?;
            stacks.around(ball, runs, |i| {
                if labels[i as usize] == 0 && takes(i) {
                    labels[i as usize] = label;
                    front.push(i);
                }
            });
        }
        Ok(front.len())
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}
