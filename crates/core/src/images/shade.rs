//! Shading: hillshading with light from the north-west for maps, and ambient occlusion.

use super::View;
use super::raster::{NOTHING, Raster, filled};
use crate::error::Result;
use crate::parallel::Monitor;
use rayon::prelude::*;

/// Offsets, in cells, at which the surroundings are sampled.
const AROUND: [(i64, i64); 16] = [
    (2, 0),
    (-2, 0),
    (0, 2),
    (0, -2),
    (2, 2),
    (-2, 2),
    (2, -2),
    (-2, -2), // near
    (7, 0),
    (-7, 0),
    (0, 7),
    (0, -7),
    (5, 5),
    (-5, 5),
    (5, -5),
    (-5, -5), // far
];

/// Brightness factor of every cell.
pub(super) fn light(raster: &Raster, view: View, monitor: &Monitor) -> Result<Vec<f32>> {
    let lamp = view == View::Map;
    let mut light = filled(raster.points.len(), 1.0, monitor)?;
    light.par_chunks_mut(raster.width).enumerate().try_for_each(|(y, row)| {
        for (x, factor) in row.iter_mut().enumerate() {
            let at = y * raster.width + x;
            if raster.points[at] != NOTHING {
                let (x, y) = (x as i64, y as i64);
                let sun = if lamp { hillshade(raster, x, y) } else { 1.08 };
                *factor = sun * (1.0 - 0.6 * hidden(raster, [x, y], raster.depth[at]));
            }
        }
        monitor.check()
    })?;
    Ok(light)
}

fn depth(raster: &Raster, x: i64, y: i64) -> Option<f32> {
    let inside = x >= 0 && y >= 0 && (x as usize) < raster.width && (y as usize) < raster.height;
    let at = if inside { y as usize * raster.width + x as usize } else { return None };
    (raster.points[at] != NOTHING).then(|| raster.depth[at])
}

/// Ambient occlusion, 0..1: share of the surroundings that are nearer to the viewer, weighted by how much.
fn hidden(raster: &Raster, [x, y]: [i64; 2], here: f32) -> f32 {
    let sum: f32 = AROUND
        .iter()
        .filter_map(|&(dx, dy)| {
            let apart = ((dx * dx + dy * dy) as f32).sqrt() * raster.unit;
            depth(raster, x + dx, y + dy).map(|d| ((here - d) / (2.5 * apart)).clamp(0.0, 1.0))
        })
        .sum();
    (sum / 8.0).min(1.0)
}

/// Lambert's law with light from the north-west at 45°, softened: about 0.7..1.15.
fn hillshade(raster: &Raster, x: i64, y: i64) -> f32 {
    let slope = |dx: i64, dy: i64| {
        let (a, b) = (depth(raster, x + dx, y + dy), depth(raster, x - dx, y - dy));
        match (a, b) {
            // Depth increases downwards, so that height is its negative.
            (Some(a), Some(b)) => ((b - a) / (2.0 * 3.0 * raster.unit)).clamp(-2.5, 2.5),
            _ => 0.0,
        }
    };
    let (east, south) = (slope(3, 0), slope(0, 3));
    let length = (1.0 + east * east + south * south).sqrt();
    // Towards the light: west, north, up.
    let cosine = (0.5 * east + 0.5 * south + std::f32::consts::FRAC_1_SQRT_2) / length;
    0.62 + 0.58 * cosine.max(0.0) / std::f32::consts::FRAC_1_SQRT_2 * 0.72
}
