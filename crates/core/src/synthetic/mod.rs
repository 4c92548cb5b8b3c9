//! Scenes that are made by a program, with their true edges: for training and testing a detector of contours.
//!
//! A world of flat surfaces is built (houses along a street, or a furnished room), and scanned by rays that end at the
//! first surface. Edges are the creases of the world: lines where two surfaces meet at more than 30 degrees, convex or
//! concave, such as the ridge of a roof, the frame of a window, a kerb, or where a wall stands on the ground. Only the
//! parts beside which points were scanned count. The outlines of round or thin bodies (trunks, poles, balls, leaves)
//! are no edges: they depend on the position of the scanner.
//!
//! Made for the contours of Hackel, Wegner and Schindler (2016), doi:10.1109/CVPR.2016.178, which need scenes with
//! known edges.

mod geometry;
mod ground;
mod house;
mod indoor;
mod scanner;
mod seen;
mod shapes;
#[cfg(test)]
mod tests;
mod tree;
mod urban;
mod world;

use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use geometry::Vector;
use scanner::{Pattern, Scan};
use serde::{Deserialize, Serialize};
use tree::Tree;
use world::World;

/// Class codes of the points of a scene; those below 64 are ASPRS's.
pub mod classes {
    /// Ground outdoors, and the floor of a room.
    pub const GROUND: u8 = 2;
    /// Trees and hedges: leaves and trunks.
    pub const VEGETATION: u8 = 5;
    /// Houses, garden walls; walls, ceiling and pillars of a room.
    pub const BUILDING: u8 = 6;
    /// Mixed pixels: ranges between two surfaces.
    pub const NOISE: u8 = 7;
    /// Road, kerbs and pavements.
    pub const ROAD: u8 = 11;
    /// Cars.
    pub const VEHICLE: u8 = 64;
    /// Poles along the street.
    pub const POLE: u8 = 65;
    /// Tables, chairs, shelves, bins, cabinets, a ball.
    pub const FURNITURE: u8 = 66;
}

/// What is scanned, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SceneKind {
    /// A street, from tripods.
    #[default]
    Urban,
    /// A street, from a car.
    Mobile,
    /// A room, from tripods.
    Indoor,
    /// A street, from an aircraft.
    Airborne,
}

/// How a scene is made. [`SceneParams::of`] has suitable values for each kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneParams {
    /// Equal seeds give equal scenes.
    pub seed: u64,
    /// What is scanned, and how.
    pub kind: SceneKind,
    /// Number of rays, 1000..=100,000,000, approximately; rays into the sky give no point. From an aircraft there are
    /// fewer where `density` asks for fewer.
    pub rays: usize,
    /// Number of tripods, 1..=4.
    pub positions: usize,
    /// Half of the side of the square that is built on, in metres, 4..=200. A room has at most 6 m.
    pub extent: f64,
    /// Pulses per square metre from an aircraft, above 0 and at most 1000.
    pub density: f64,
    /// Standard deviation of the ranges, in metres, 0..=1.
    pub noise: f64,
    /// What is added to it for each metre of range, 0..=0.1.
    pub noise_per_metre: f64,
    /// Share of the rays beside a jump of the range (above 0.15 m) that measure a range between both sides, 0..=1.
    pub mixed_pixels: f64,
}

impl Default for SceneParams {
    fn default() -> Self {
        Self {
            seed: 0,
            kind: SceneKind::Urban,
            rays: 1_000_000,
            positions: 3,
            extent: 40.0,
            density: 15.0,
            noise: 0.003,
            noise_per_metre: 0.0001,
            mixed_pixels: 0.2,
        }
    }
}

impl SceneParams {
    /// Suitable values for a kind: from an aircraft 3 cm of noise and no mixed pixels, in a room 2 tripods and 2 mm.
    pub fn of(kind: SceneKind) -> Self {
        let own = Self { kind, ..Self::default() };
        match kind {
            SceneKind::Urban | SceneKind::Mobile => own,
            SceneKind::Indoor => Self { positions: 2, extent: 6.0, noise: 0.002, ..own },
            SceneKind::Airborne => Self { noise: 0.03, noise_per_metre: 0.0, mixed_pixels: 0.0, ..own },
        }
    }

    /// Fails if a value is outside its range.
    ///
    /// # Errors
    /// The first such value.
    pub fn validate(&self) -> Result<()> {
        let rays = 1000..=100_000_000;
        if !rays.contains(&self.rays) {
            return Err(Error::parameter("rays", self.rays, "1000 to 100000000"));
        }
        if !(1..=4).contains(&self.positions) {
            return Err(Error::parameter("positions", self.positions, "1 to 4"));
        }
        let numbers = [
            ("extent", self.extent, [4.0, 200.0]),
            ("density", self.density, [1e-3, 1000.0]),
            ("noise", self.noise, [0.0, 1.0]),
            ("noise_per_metre", self.noise_per_metre, [0.0, 0.1]),
            ("mixed_pixels", self.mixed_pixels, [0.0, 1.0]),
        ];
        for (name, value, [low, high]) in numbers {
            if !(low..=high).contains(&value) {
                return Err(Error::parameter(name, value, format!("{low} to {high}")));
            }
        }
        Ok(())
    }
}

/// A scanned scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The points in metres, z up, around the middle of the scene, in the order of the rays.
    pub positions: Positions,
    /// Class of each point, of [`classes`].
    pub codes: Vec<u8>,
    /// Where the scanner stood: each tripod, the start and the end of a drive, or a place above on each side of a
    /// flight.
    pub scan_positions: Vec<[f32; 3]>,
    /// The true edges that were scanned: parts of creases, each with points of one of its two surfaces at most 1.5
    /// spacings away. The spacing is that of the rays on the surface.
    pub edges: Vec<[[f32; 3]; 2]>,
    /// For each edge, how many of its two surfaces have points beside it: 2 where both are scanned, 1 where the scan
    /// shows the end of one surface only.
    pub edge_surfaces: Vec<u8>,
    /// Metres between the points beside each edge, on the surface where they are farther apart; infinite where one surface
    /// has points, but the scanner does not see the edge. Where this is large, no detector can find the edge.
    pub edge_spacing: Vec<f32>,
}

/// Makes a scene. The same parameters give the same bytes, on any number of threads.
///
/// O(rays log surfaces), in parallel; 150 bytes a ray, and for each square metre of a street about 10 surfaces of 200
/// bytes.
///
/// # Errors
/// If a parameter is outside its range, memory is short, or the work was cancelled.
pub fn scene(params: &SceneParams, monitor: &Monitor) -> Result<Scene> {
    params.validate()?;
    crate::memory::require(params.rays as u64 * 150, "the rays of a scene")?;
    let (World { patches, classes, edges }, pattern) = world_of(params, monitor)?;
    monitor.check()?;
    let tree = Tree::new(patches);
    let scan = Scan { tree: &tree, classes: &classes, pattern: &pattern, params };
    let echoes = scan.run(monitor)?;
    let parts = seen::seen(&edges, &echoes, |at| scan.sees(at), monitor)?;
    let single = |at: Vector| at.map(|v| v as f32);
    let code = |surface: Option<u32>| surface.map_or(classes::NOISE, |surface| classes[surface as usize]);
    Ok(Scene {
        positions: echoes.iter().map(|echo| single(echo.measured)).collect(),
        codes: echoes.iter().map(|echo| code(echo.surface)).collect(),
        scan_positions: pattern.places().into_iter().map(single).collect(),
        edges: parts.iter().map(|part| part.ends.map(single)).collect(),
        edge_surfaces: parts.iter().map(|part| part.surfaces).collect(),
        edge_spacing: parts.iter().map(|part| part.spacing as f32).collect(),
    })
}

/// The world of a scene, and the rays that scan it.
fn world_of(params: &SceneParams, monitor: &Monitor) -> Result<(World, Pattern)> {
    let SceneParams { seed, kind, rays, positions, extent, density, .. } = *params;
    if kind == SceneKind::Indoor {
        let (world, places) = indoor::room(seed, extent);
        return Ok((world, Pattern::tripods(places.into_iter().take(positions).collect(), rays)));
    }
    let (world, ground) = urban::street(seed, extent, monitor)?;
    let above = |x: f64, y: f64, z: f64| [x, y, ground.height(x, y) + z];
    let pattern = match kind {
        SceneKind::Mobile => Pattern::drive([above(-extent * 0.9, -0.5, 2.2), above(extent * 0.9, -0.5, 2.2)], rays),
        SceneKind::Airborne => {
            let area = 4.0 * extent * extent;
            Pattern::Flight { extent, step: density.min(rays as f64 / area).sqrt().recip() }
        }
        _ => {
            let place = |i: usize| {
                let x = extent * 0.7 * (2.0 * (i as f64 + 0.5) / positions as f64 - 1.0);
                above(x, if i.is_multiple_of(2) { 0.7 } else { -0.7 }, 1.7)
            };
            Pattern::tripods((0..positions).map(place).collect(), rays)
        }
    };
    Ok((world, pattern))
}
