//! Scanners: the pattern of their rays, what the rays meet, and the errors of the ranges.

use super::SceneParams;
use super::classes;
use super::geometry::{Ray, Vector, add, between, dot, scaled};
use super::tree::{Hit, Tree};
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered};
use crate::random::{Stream, stream};
use std::f64::consts::{PI, TAU};

/// Ranges in metres that a scanner on the ground measures.
const RANGES: [f64; 2] = [0.4, 100.0];
/// Elevations of a terrestrial scanner.
const ELEVATIONS: [f64; 2] = [-PI / 3.0, PI / 2.0];
/// Height of the aircraft above the middle of the scene.
const HEIGHT: f64 = 500.0;
/// Angle from the vertical at which its pulses come from one side, then from the other.
const SLANT: f64 = 0.25;
/// Least difference of two ranges between which a mixed pixel falls.
const JUMP: f64 = 0.15;
/// Least cosine of the angle to the normal at which something comes back.
const GRAZING: f64 = 0.03;
/// Metres before a place within which a surface does not hide it.
const CLEAR: f64 = 0.03;
/// Share of the pulses from above that pass a leaf.
const THROUGH: f64 = 0.5;

/// Rays, line by line.
#[derive(Clone, Debug)]
pub(super) enum Pattern {
    /// Scanners that turn on a tripod; `step` radians between rays and between lines.
    Tripods { at: Vec<Vector>, step: f64 },
    /// A scanner that drives from one place to another and measures whole circles across, `ahead` metres apart.
    Drive { path: [Vector; 2], ahead: f64, step: f64 },
    /// Parallel pulses from above over a square, from two sides; `step` metres between pulses and between lines of all.
    Flight { extent: f64, step: f64 },
}

/// A measured point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    /// Where it was measured.
    pub(super) measured: Vector,
    /// Where the ray met the surface.
    pub(super) met: Vector,
    /// The surface; none for a mixed pixel.
    pub(super) surface: Option<u32>,
    /// Metres to the points around it on the surface, as the pattern makes them.
    pub(super) spacing: f64,
}

impl Pattern {
    /// Scanners on tripods that send this number of rays in all.
    pub(super) fn tripods(at: Vec<Vector>, rays: usize) -> Self {
        let step = (TAU * (ELEVATIONS[1] - ELEVATIONS[0]) * at.len() as f64 / rays as f64).sqrt();
        Self::Tripods { at, step }
    }

    /// A drive with this number of rays in all, and points as far apart along as across at 8 m.
    pub(super) fn drive(path: [Vector; 2], rays: usize) -> Self {
        let length = super::geometry::length(super::geometry::sub(path[1], path[0]));
        let step = (TAU * length / (8.0 * rays as f64)).sqrt();
        Self::Drive { path, ahead: 8.0 * step, step }
    }

    /// Places of the scanner: each tripod, or where it started and ended.
    pub(super) fn places(&self) -> Vec<Vector> {
        match self {
            Self::Tripods { at, .. } => at.clone(),
            Self::Drive { path, .. } => path.to_vec(),
            Self::Flight { .. } => [-1.0, 1.0].map(|side| scaled(flight(side), -HEIGHT)).to_vec(),
        }
    }

    /// Where a scanner is while one of its rays may end at a place.
    fn views(&self, at: Vector) -> Vec<Vector> {
        match self {
            Self::Tripods { at, .. } => at.clone(),
            Self::Drive { path, .. } => {
                let way = super::geometry::sub(path[1], path[0]);
                let [x, y, _] = super::geometry::unit(way);
                let across = turned([x, y]);
                // The normal of the plane in which the scanner turns.
                let normal = [across[1], -across[0], 0.0];
                let share = dot(super::geometry::sub(at, path[0]), normal) / dot(way, normal);
                if (0.0..=1.0).contains(&share) { vec![between(*path, share)] } else { Vec::new() }
            }
            Self::Flight { .. } => [-1.0, 1.0].map(|side| add(at, scaled(flight(side), -HEIGHT))).to_vec(),
        }
    }

    /// Number of lines of one place or pass, and of rays in a line.
    fn size(&self) -> [usize; 2] {
        let count = |size: f64, step: f64| ((size / step).floor() as usize).max(1);
        match *self {
            Self::Tripods { step, .. } => [count(TAU, step), count(ELEVATIONS[1] - ELEVATIONS[0], step)],
            Self::Drive { path: [a, b], ahead, step } => {
                [count(super::geometry::length(super::geometry::sub(b, a)), ahead), count(TAU, step)]
            }
            // Each pass has half of the density.
            Self::Flight { extent, step } => [count(2.0 * extent, step * 2f64.sqrt()); 2],
        }
    }

    pub(super) fn lines(&self) -> usize {
        let passes = match self {
            Self::Tripods { at, .. } => at.len(),
            Self::Drive { .. } => 1,
            Self::Flight { .. } => 2,
        };
        passes * self.size()[0]
    }

    fn ray(&self, line: usize, number: usize, random: &mut Stream) -> Ray {
        let [lines, count] = self.size();
        let (pass, line) = (line / lines, line % lines);
        match self {
            Self::Tripods { at, step } => {
                let (around, up) = (line as f64 * TAU / lines as f64, ELEVATIONS[0] + (number as f64 + 0.5) * step);
                Ray::new(at[pass], [up.cos() * around.cos(), up.cos() * around.sin(), up.sin()])
            }
            Self::Drive { path, ahead, step } => {
                let angle = number as f64 * step;
                let way = super::geometry::sub(path[1], path[0]);
                let [x, y, _] = super::geometry::unit(way);
                let origin = add(path[0], scaled([x, y, 0.0], (line as f64 + number as f64 / count as f64) * ahead));
                Ray::new(origin, add(scaled(turned([x, y]), angle.cos()), [0.0, 0.0, angle.sin()]))
            }
            Self::Flight { extent, step } => {
                let step = step * 2f64.sqrt();
                let mut place = |number: usize| (number as f64 + 0.3 + 0.4 * random.uniform()) * step - extent;
                let direction = flight(if pass == 0 { -1.0 } else { 1.0 });
                let ground = [place(number), place(line), 0.0];
                Ray::new(add(ground, scaled(direction, -HEIGHT)), direction)
            }
        }
    }

    /// Metres between points on a surface that is met at a range and at an angle of this cosine.
    fn spacing(&self, range: f64, cosine: f64) -> f64 {
        let across = match *self {
            Self::Tripods { step, .. } => range * step,
            Self::Drive { ahead, step, .. } => (range * step * ahead).sqrt(),
            Self::Flight { step, .. } => step,
        };
        across / cosine.max(0.05).sqrt()
    }

    fn ranges(&self) -> [f64; 2] {
        match self {
            Self::Flight { .. } => [0.0, 2.0 * HEIGHT],
            _ => RANGES,
        }
    }
}

/// The horizontal direction in which a scanner on a car looks, given its way: turned by 55 degrees, so that facades across the
/// way are seen too.
fn turned([x, y]: [f64; 2]) -> Vector {
    [x * 0.574 - y * 0.819, x * 0.819 + y * 0.574, 0.0]
}

/// Direction of the pulses from one side.
fn flight(side: f64) -> Vector {
    [0.0, side * SLANT.sin(), -SLANT.cos()]
}

/// What a scanner measures.
pub(super) struct Scan<'a> {
    pub(super) tree: &'a Tree,
    pub(super) classes: &'a [u8],
    pub(super) pattern: &'a Pattern,
    pub(super) params: &'a SceneParams,
}

impl Scan<'_> {
    /// All points, in the order of the rays. O(rays log patches), in parallel.
    pub(super) fn run(&self, monitor: &Monitor) -> Result<Vec<Echo>> {
        let lines = self.pattern.lines();
        monitor.stage("scanning", lines as u64);
        let all = map_ordered(lines, monitor, |line| {
            let echoes = self.line(line);
            monitor.advance(1);
            Ok(echoes)
        })?;
        crate::parallel::concat_watched(all, monitor)
    }

    /// Whether nothing is between a scanner and a place, up to [`CLEAR`] before the place.
    pub(super) fn sees(&self, at: Vector) -> bool {
        self.pattern.views(at).into_iter().any(|from| {
            let ray = Ray::new(from, super::geometry::sub(at, from));
            let range = super::geometry::length(super::geometry::sub(at, from));
            self.tree.first(&ray, [0.0, range - CLEAR]).is_none()
        })
    }

    fn line(&self, line: usize) -> Vec<Echo> {
        let mut random = stream(self.params.seed ^ 0x5ca0_0000_0000, line as u64);
        let hits: Vec<(Ray, Option<Hit>)> = (0..self.pattern.size()[1])
            .map(|number| {
                let ray = self.pattern.ray(line, number, &mut random);
                (ray, self.trace(&ray, &mut random))
            })
            .collect();
        let mut echoes = Vec::with_capacity(hits.len());
        for (i, (ray, hit)) in hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            let next = hits.get(i + 1).and_then(|(_, hit)| *hit);
            echoes.push(self.echo(ray, [Some(*hit), next], &mut random));
        }
        echoes.into_iter().flatten().collect()
    }

    /// The first surface that a ray meets; pulses from above pass some of the leaves.
    fn trace(&self, ray: &Ray, random: &mut Stream) -> Option<Hit> {
        let [mut near, far] = self.pattern.ranges();
        let above = matches!(self.pattern, Pattern::Flight { .. });
        loop {
            let hit = self.tree.first(ray, [near, far])?;
            let leaf = self.classes[hit.surface as usize] == classes::VEGETATION;
            if !(above && leaf && random.uniform() < THROUGH) {
                return Some(hit).filter(|hit| hit.cosine >= GRAZING);
            }
            near = hit.range + 0.01;
        }
    }

    /// The point of a ray, with errors; the second hit is that of the next ray.
    fn echo(&self, ray: &Ray, [hit, next]: [Option<Hit>; 2], random: &mut Stream) -> Option<Echo> {
        let Hit { range, surface, cosine } = hit?;
        let params = self.params;
        let noise = random.normal() * (params.noise + params.noise_per_metre * range.min(RANGES[1]));
        let [chance, share] = [random.uniform(), random.uniform()];
        let jump = next.map(|next| next.range - range).filter(|jump| jump.abs() > JUMP && chance < params.mixed_pixels);
        Some(Echo {
            measured: ray.at(range + noise + jump.unwrap_or(0.0) * share),
            met: ray.at(range),
            surface: if jump.is_some() { None } else { Some(surface) },
            spacing: self.pattern.spacing(range, cosine),
        })
    }
}
