//! Radius, least size, angle and offset of the segments, from the cloud.

use super::params::ClusterParams;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::features::{Quantity, RadiusParams, StackedFeatures};
use crate::neighbours::nearest_of;
use crate::neighbours::stacks::{Ball, Stacks};
use crate::parallel::{Monitor, map_ordered_with, map_watched};
use crate::random::stream;
use serde::Serialize;

/// Factor from the median absolute deviation to the standard deviation of normally distributed values.
const DEVIATION: f64 = 1.4826;
/// Radius of a cloud that is a single place, metres, where it does not matter.
const NO_EXTENT: f64 = 1.0;
/// Sampled points that one task examines.
const BLOCK: usize = 256;

/// The parameters of the segmentation, and where each comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Automatic {
    /// ε: points within this distance are neighbours, metres.
    pub radius: f64,
    /// τ: least number of points of a segment.
    pub min_size: u32,
    /// α: largest angle between the normals of a point and of its region, degrees.
    pub angle_deg: f64,
    /// δ: largest distance of a point from the plane of its region, metres.
    pub offset: f64,
    /// One sentence for each, in this order.
    pub reasons: Vec<String>,
}

/// What the parameters were found in, for the levels.
pub(super) struct Prepared {
    pub(super) automatic: Automatic,
    pub(super) stacks: Stacks,
    /// In the order of the stacks, as the next.
    pub(super) normals: Vec<[f32; 3]>,
    /// Surface variation; of points with too few neighbours larger than of any other.
    pub(super) variation: Vec<f32>,
}

/// The parameters that `params` leaves to the cloud: radius, least size, angle and offset of segments.
///
/// On a sample that the seed fixes: the radius is the median distance to the 16th neighbour (of fewer points: the
/// farthest); the least size 4 times the
/// median number of points within it; the angle 2 (median + 2 · 1.4826 MAD) of the angles between the normals of
/// neighbours, 10..45°; the offset 3 times the median √λ3 in balls of this radius, 0.25..1 radius. If all coordinates
/// are scaled, radius and offset scale with them, and angle and size stay. O(n log n).
///
/// # Errors
/// If a parameter is out of range, half of the points coincide with so many others although the cloud has an extent, a
/// coordinate is not finite, or the work was cancelled.
pub fn automatic_parameters(points: &Positions, params: &ClusterParams, monitor: &Monitor) -> Result<Automatic> {
    Ok(prepare(points, params, monitor)?.automatic)
}

pub(super) fn prepare(points: &Positions, params: &ClusterParams, monitor: &Monitor) -> Result<Prepared> {
    params.validate()?;
    let first = points.iter().next();
    if points.iter().all(|at| Some(at) == first) && first.is_none_or(|at| at.iter().all(|v| v.is_finite())) {
        return Ok(without_extent(params));
    }
    let sample = stream(params.seed, 0).choose(points.len(), params.automatic.sample);
    let (radius, why_radius) = match params.radius {
        Some(radius) => (radius, given("radius", format!("{radius} m"))),
        None => found_radius(points, &sample, params, monitor)?,
    };
    let stacks = Stacks::new(points, radius, monitor)?;
    let wanted = [
        Quantity::Count,
        Quantity::NormalX,
        Quantity::NormalY,
        Quantity::NormalZ,
        Quantity::SurfaceVariation,
        Quantity::Eigenvalue3,
    ];
    let balls = RadiusParams { radii: vec![radius], ..RadiusParams::default() };
    let rows = StackedFeatures { stacks: &stacks, quantities: &wanted, params: &balls }.rows(monitor)?;
    let row = |i: usize| &rows[i * wanted.len()..][..wanted.len()];
    let normals = map_watched(stacks.len(), monitor, |i| [row(i)[1], row(i)[2], row(i)[3]])?;
    let variation =
        map_watched(stacks.len(), monitor, |i| if row(i)[0] < params.normal_points as f32 { 1.0 } else { row(i)[4] })?;
    let mut is_sampled = vec![false; points.len()];
    sample.iter().for_each(|&i| is_sampled[i as usize] = true);
    let places: Vec<u32> =
        (0..stacks.len() as u32).filter(|&i| is_sampled[stacks.index[i as usize] as usize]).collect();
    let sampled = Sampled { stacks: &stacks, normals: &normals, places: &places, radius };
    let (min_size, why_size) = match params.min_size {
        Some(size) => (size, given("least size", format!("{size} points"))),
        None => found_size(places.iter().map(|&i| row(i as usize)[0]).collect(), params),
    };
    let (angle_deg, why_angle) = match params.angle_deg {
        Some(angle) => (angle, given("angle", format!("{angle} degrees"))),
        None => sampled.angle(params, monitor)?,
    };
    let (offset, why_offset) = match params.offset {
        Some(offset) => (offset, given("offset", format!("{offset} m"))),
        None => found_offset(places.iter().map(|&i| row(i as usize)[5].sqrt()).collect(), radius, params),
    };
    let reasons = vec![why_radius, why_size, why_angle, why_offset];
    let automatic = Automatic { radius, min_size, angle_deg, offset, reasons };
    drop(rows);
    Ok(Prepared { automatic, stacks, normals, variation })
}

/// A cloud that is one place has no surfaces: its points are left out, so that they are not compared with each other.
fn without_extent(params: &ClusterParams) -> Prepared {
    let radius = params.radius.unwrap_or(NO_EXTENT);
    let a = &params.automatic;
    let automatic = Automatic {
        radius,
        min_size: params.min_size.unwrap_or(a.size_least),
        angle_deg: params.angle_deg.unwrap_or(a.angle_least_deg),
        offset: params.offset.unwrap_or(a.offset_least * radius),
        reasons: ["radius", "least size", "angle", "offset"]
            .map(|name| format!("{name}: the cloud has no extent"))
            .into(),
    };
    Prepared { automatic, stacks: Stacks::default(), normals: Vec::new(), variation: Vec::new() }
}

fn given(what: &str, value: String) -> String {
    format!("{what} {value}: given")
}

fn found_radius(
    points: &Positions,
    sample: &[u32],
    params: &ClusterParams,
    monitor: &Monitor,
) -> Result<(f64, String)> {
    let k = params.automatic.neighbour.min(points.len().saturating_sub(1));
    // A point is its own nearest.
    let near = nearest_of(points, &points.select(sample, monitor)?, k + 1, monitor)?;
    let radius = median((0..sample.len()).map(|i| near.squared_distances(i)[k].sqrt()).collect());
    if radius <= 0.0 {
        return Err(Error::input(format!(
            "half of the points coincide with {k} others, so that no radius of neighbourhoods can be found (allowed: a cloud \
             without duplicates, or a radius)"
        )));
    }
    let reason = format!("radius {radius:.4} m: median distance to neighbour {k} of {} points", sample.len());
    Ok((radius, reason))
}

fn found_size(counts: Vec<f32>, params: &ClusterParams) -> (u32, String) {
    let a = &params.automatic;
    let inside = median(counts);
    let size = ((a.size_factor * inside).round() as u32).max(a.size_least);
    let limit = if size == a.size_least { " (the least)" } else { "" };
    (size, format!("least size {size} points: {} times the median of {inside} points in a ball{limit}", a.size_factor))
}

fn found_offset(deviations: Vec<f32>, radius: f64, params: &ClusterParams) -> (f64, String) {
    let a = &params.automatic;
    let deviation = median(deviations);
    let free = a.offset_factor * deviation;
    let offset = free.clamp(a.offset_least * radius, a.offset_most * radius);
    let how = format!("{} times the median deviation across surfaces, {deviation:.4} m", a.offset_factor);
    (offset, format!("offset {offset:.4} m: {how}{}", limited([free, offset])))
}

fn limited([free, kept]: [f64; 2]) -> &'static str {
    if free < kept {
        ", raised to the least"
    } else if free > kept {
        ", reduced to the largest"
    } else {
        ""
    }
}

/// Sampled points in the order of the stacks.
struct Sampled<'a> {
    stacks: &'a Stacks,
    normals: &'a [[f32; 3]],
    places: &'a [u32],
    radius: f64,
}

impl Sampled<'_> {
    /// The angle of a region, from the angles between the normals of neighbours.
    fn angle(&self, params: &ClusterParams, monitor: &Monitor) -> Result<(f64, String)> {
        let Self { stacks, normals, places, radius } = *self;
        let parts = map_ordered_with(0..places.len().div_ceil(BLOCK), monitor, Vec::new, |runs, block| {
            let mut angles = Vec::new();
            for &i in &places[block * BLOCK..((block + 1) * BLOCK).min(places.len())] {
                let n = normals[i as usize];
                let ball = Ball { at: stacks.positions.xyz(i as usize), radius };
                stacks.around(ball, runs, |j| {
                    let m = normals[j as usize];
                    let cosine = (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]).abs().min(1.0);
                    if j != i {
                        angles.push(cosine.acos().to_degrees());
                    }
                });
            }
            Ok(angles)
        })?;
        let angles = parts.concat();
        let middle = median(angles.clone());
        let deviation = DEVIATION * median(angles.iter().map(|a| (a - middle as f32).abs()).collect());
        let a = &params.automatic;
        let free = a.angle_factor * (middle + a.angle_deviations * deviation);
        let angle = free.clamp(a.angle_least_deg, a.angle_most_deg);
        let how = format!(
            "{} times the median angle between neighbouring normals, {middle:.1}, plus {} deviations of {deviation:.1}",
            a.angle_factor, a.angle_deviations
        );
        Ok((angle, format!("angle {angle:.1} degrees: {how}{}", limited([free, angle]))))
    }
}

/// The middle value (of an even number the upper one); 0 if there is none.
fn median(mut values: Vec<f32>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}
