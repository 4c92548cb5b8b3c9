//! Outlines of buildings from their points.

use super::polygons::{Polygon, key, polygons};
use super::simplify::simplified;
use super::survey::{Codes, Withheld, listed};
use crate::cloud::{Cloud, MetricCloud, Points};
use crate::error::{Error, Result};
use crate::io::Outline;
use crate::parallel::{Monitor, map_ordered};
use crate::terrain::alpha_shape::{AlphaParams, AlphaShape, Place};
use crate::voxels::planar_density;
use parry2d_f64::bounding_volume::Aabb;
use parry2d_f64::math::Vector;
use parry2d_f64::partitioning::{Bvh, BvhBuildStrategy};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::HashMap;

/// Points of a block.
const BLOCK: usize = 16_384;

/// Smallest α that is chosen automatically, metres.
const LEAST: f64 = 1.0;

/// Share of α in which points are thinned before the triangulation: finer than the spacing of usual airborne scans.
const THINNING: f64 = 0.1;

/// Parameters of [`footprints`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FootprintParams {
    /// Classes of the points of buildings.
    pub classes: Vec<u8>,
    /// Radius α of the α-shape, metres, above 0: gaps wider than 2α separate buildings. It must exceed the point spacing.
    /// `None`: twice the spacing of the buildings' points, at least 1 m.
    pub alpha: Option<f64>,
    /// Simplified outlines of a smaller area, without their holes, are left out and smaller holes are closed, m²; 0 or more.
    pub min_area: f64,
    /// Tolerance of the simplification, metres; 0 or more. 0 keeps all corners.
    pub tolerance: f64,
}

impl Default for FootprintParams {
    /// Our choice.
    fn default() -> Self {
        Self { classes: vec![6], alpha: None, min_area: 10.0, tolerance: 0.5 }
    }
}

impl FootprintParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        shape(self.alpha.unwrap_or(LEAST)).validate()?;
        for (name, value) in [("min_area", self.min_area), ("tolerance", self.tolerance)] {
            if !(0.0..=1e9).contains(&value) {
                return Err(Error::parameter(name, value, "0..1e9"));
            }
        }
        match self.classes.is_empty() {
            true => Err(Error::parameter("classes", "no class", "at least one class of buildings")),
            false => Ok(()),
        }
    }

    /// Fails if a cloud has no point of a building. To be called before long work. O(points).
    ///
    /// # Errors
    /// If no point has one of the classes.
    pub fn check(&self, cloud: &Cloud) -> Result<()> {
        let codes = Codes::of(cloud);
        match (0..cloud.len() as u32).any(|i| codes.among(i, &self.classes)) {
            true => Ok(()),
            false => Err(Error::input(format!(
                "no point of {}: classify the cloud first, or name the classes of buildings",
                listed(&self.classes)
            ))),
        }
    }
}

fn shape(alpha: f64) -> AlphaParams {
    AlphaParams { alpha, thinning: THINNING, ..AlphaParams::default() }
}

/// Twice the spacing of the points, at least [`LEAST`].
fn automatic(points: &Points, monitor: &Monitor) -> Result<f64> {
    Ok((2.0 / planar_density(&points.positions, monitor)?.sqrt()).clamp(LEAST, 1e9))
}

/// The outline of a building, and what its points tell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Footprint {
    /// Corners of the outer ring (counter-clockwise), then of each hole (clockwise), not repeated at the end; metres, not
    /// relative to an origin.
    pub rings: Vec<Vec<[f64; 2]>>,
    /// Area of the simplified outline without its holes, m².
    pub area: f64,
    /// Median height of its points above ground, metres.
    pub height_median: f32,
    /// Greatest height of its points above ground, metres.
    pub height_max: f32,
    /// Number of points of the building inside the outline before its simplification.
    pub points: u64,
}

/// The footprints as outlines for a map: coordinates in the unit of a cloud with that many metres per unit; `area` in m²,
/// `height_median` and `height_max` in metres to the millimetre, `points`, and an `id` from 1.
pub fn outlines(footprints: &[Footprint], metres: f64) -> Vec<Outline> {
    let thousandths = |v: f64| (v * 1000.0).round() / 1000.0;
    let outline = |(footprint, id): (&Footprint, usize)| {
        let properties = [
            ("id", json!(id)),
            ("area", json!(thousandths(footprint.area))),
            ("height_median", json!(thousandths(f64::from(footprint.height_median)))),
            ("height_max", json!(thousandths(f64::from(footprint.height_max)))),
            ("points", json!(footprint.points)),
        ];
        let ring = |ring: &Vec<[f64; 2]>| ring.iter().map(|at| at.map(|v| v / metres)).collect();
        Outline {
            rings: footprint.rings.iter().map(ring).collect(),
            properties: properties.into_iter().map(|(name, value)| (name.to_string(), value)).collect(),
        }
    };
    footprints.iter().zip(1..).map(outline).collect()
}

/// Outlines of the buildings, largest first, from the points of their classes, unless they are withheld, and the heights
/// of all points of the cloud above ground ([`heights_above_ground`](super::heights_above_ground)).
///
/// The connected parts of the points' α-shape are simplified (Douglas and Peucker 1973). O(n log n).
///
/// # Errors
/// If no point has one of the classes, lengths differ, a parameter is out of range, or the work was cancelled.
pub fn footprints(
    scene: &MetricCloud<'_>,
    heights: &[f32],
    params: &FootprintParams,
    monitor: &Monitor,
) -> Result<Vec<Footprint>> {
    params.validate()?;
    if heights.len() != scene.cloud.len() {
        return Err(Error::input(format!("{} heights for {} points", heights.len(), scene.cloud.len())));
    }
    let all = scene.points(monitor)?;
    let codes = Codes::of(scene.cloud);
    let withheld = Withheld::of(scene.cloud);
    let of_building = |point: u32| codes.among(point, &params.classes) && !withheld.has(point);
    let building = |&row: &u32| of_building(all.frame.index[row as usize]);
    let points = all.select(&(0..all.len() as u32).filter(building).collect::<Vec<u32>>(), monitor)?;
    if points.is_empty() {
        // Of the classes perhaps, but withheld or without finite coordinates.
        return params.check(scene.cloud).map(|()| Vec::new());
    }
    monitor.stage("buildings", points.len() as u64);
    let alpha = params.alpha.map_or_else(|| automatic(&points, monitor), Ok)?;
    let shape = AlphaShape::fit(&points, &vec![true; points.len()], &shape(alpha), monitor)?;
    let found = polygons(&shape.border, params.min_area);
    let members = members(&points, &found, heights, monitor)?;
    let shown = |i: usize| Ok(footprint(&simplest(&found[i], params), &members[i], &points));
    let mut footprints = map_ordered(found.len(), monitor, shown)?;
    footprints.retain(|footprint| footprint.area >= params.min_area);
    footprints.sort_by(|a, b| b.area.total_cmp(&a.area));
    Ok(footprints)
}

/// The simplified polygon; its holes that have become too small are closed.
fn simplest(polygon: &Polygon, params: &FootprintParams) -> Polygon {
    let mut simple = simplified(polygon, params.tolerance);
    simple.close_holes(params.min_area);
    simple
}

fn footprint(simple: &Polygon, heights: &[f32], points: &Points) -> Footprint {
    let [x, y, _] = points.frame.origin;
    let world = |ring: &Vec<Place>| ring.iter().map(|at| [at[0] + x, at[1] + y]).collect();
    let middle = heights.len() / 2;
    let median = match heights.len() {
        0 => f32::NAN,
        n if n % 2 == 1 => heights[middle],
        _ => 0.5 * (heights[middle - 1] + heights[middle]),
    };
    Footprint {
        area: simple.area(),
        rings: simple.rings.iter().map(world).collect(),
        height_median: median,
        height_max: heights.last().copied().unwrap_or(f32::NAN),
        points: heights.len() as u64,
    }
}

/// The heights of the points of each polygon, ascending.
fn members(points: &Points, polygons: &[Polygon], heights: &[f32], monitor: &Monitor) -> Result<Vec<Vec<f32>>> {
    let corners = polygons.iter().map(|polygon| polygon.rings[0].iter().map(|&at| vector(at)));
    let boxes: Vec<Aabb> = corners.map(Aabb::from_points).collect();
    let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    let numbered = polygons.iter().zip(0..polygons.len() as u32);
    // Whether a corner is inside is a matter of rounding. A corner where two meet is the larger one's, which comes last here.
    let corners: HashMap<[u64; 2], u32> =
        numbered.rev().flat_map(|(polygon, n)| polygon.rings.iter().flatten().map(move |&at| (key(at), n))).collect();
    let of = |row: usize| {
        let at = [f64::from(points.positions.x[row]), f64::from(points.positions.y[row])];
        let around = Aabb::new(vector(at), vector(at));
        let inside = || tree.intersect_aabb(&around).filter(|&n| polygons[n as usize].holds(at)).min();
        corners.get(&key(at)).copied().into_iter().chain(inside()).min()
    };
    let parts = map_ordered(points.len().div_ceil(BLOCK), monitor, |block| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(points.len());
        monitor.advance(range.len() as u64);
        Ok(range.map(of).collect::<Vec<Option<u32>>>())
    })?;
    let mut members = vec![Vec::new(); polygons.len()];
    for (polygon, &index) in parts.into_iter().flatten().zip(&points.frame.index) {
        if let Some(n) = polygon {
            members[n as usize].push(heights[index as usize]);
        }
    }
    members.iter_mut().for_each(|heights| heights.sort_unstable_by(f32::total_cmp));
    Ok(members)
}

fn vector(place: Place) -> Vector {
    Vector::new(place[0], place[1])
}
