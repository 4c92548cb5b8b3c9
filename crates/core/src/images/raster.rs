//! Visibility: the point seen at each cell of the fine grid, by a depth buffer with square splats.

use super::camera::Camera;
use super::canvas::{FINER, Frame, Image, PAPER};
use crate::cloud::Cloud;
use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// Marks a cell where no point is seen.
pub(super) const NOTHING: u32 = u32::MAX;
/// Largest half edge of a splat, in cells.
const MOST: f64 = 9.0;

/// Number of points between two checks for cancellation: a large splat takes a microsecond.
const LOOK: usize = 4096;

/// A vector of equal values, allocated and filled in pieces with checks for cancellation, because the largest pictures
/// need gigabytes.
pub(super) fn filled<T: Copy>(len: usize, value: T, monitor: &Monitor) -> Result<Vec<T>> {
    let mut grid = Vec::with_capacity(len);
    for piece in watched(len, monitor) {
        grid.resize(piece?.end, value);
    }
    Ok(grid)
}

/// The fine grid.
#[derive(Clone, Debug)]
pub(super) struct Raster {
    pub(super) width: usize,
    pub(super) height: usize,
    /// The point seen at each cell.
    pub(super) points: Vec<u32>,
    /// Its distance from the viewer, in units of the coordinates.
    pub(super) depth: Vec<f32>,
    /// Units of the coordinates per cell.
    pub(super) unit: f32,
}

impl Raster {
    pub(super) fn new(cloud: &Cloud, camera: &Camera, frame: &Frame, monitor: &Monitor) -> Result<Self> {
        monitor.stage("draw", cloud.len() as u64);
        let (width, height) = (frame.w as usize * FINER, frame.h as usize * FINER);
        let unit = frame.unit / FINER as f64;
        let mut raster = Self {
            width,
            height,
            points: filled(width * height, NOTHING, monitor)?,
            depth: filled(width * height, f32::INFINITY, monitor)?,
            unit: unit as f32,
        };
        let half = raster.splat(cloud, camera, frame, monitor)?;
        for points in watched(cloud.len(), monitor) {
            let points = points?;
            monitor.advance(points.len() as u64);
            for i in points {
                if i % LOOK == 0 {
                    monitor.check()?;
                }
                let p = cloud.xyz(i);
                if p.iter().all(|v| v.is_finite()) {
                    let (u, v, away) = camera.project(p);
                    let place = [(u - frame.corner[0]) / unit, (v - frame.corner[1]) / unit];
                    raster.put(place, half, away as f32, i as u32);
                }
            }
        }
        Ok(raster)
    }

    /// Half edge of the splats that closes the gaps between points, estimated from the number of occupied coarse cells.
    fn splat(&self, cloud: &Cloud, camera: &Camera, frame: &Frame, monitor: &Monitor) -> Result<i64> {
        let block = 16.0 * f64::from(self.unit);
        let (columns, rows) = (self.width / 16 + 1, self.height / 16 + 1);
        let mut counts = vec![0u32; columns * rows];
        for points in watched(cloud.len(), monitor) {
            for i in points? {
                let (u, v, _) = camera.project(cloud.xyz(i));
                let (c, r) = ((u - frame.corner[0]) / block, (v - frame.corner[1]) / block);
                if c >= 0.0 && r >= 0.0 && (c as usize) < columns && (r as usize) < rows {
                    counts[r as usize * columns + c as usize] += 1;
                }
            }
        }
        let mut held: Vec<u32> = counts.into_iter().filter(|&n| n > 0).collect();
        held.sort_unstable();
        let usual = held.get(held.len() / 2).copied().unwrap_or(1);
        let spacing = 16.0 / f64::from(usual.max(1)).sqrt();
        Ok((0.95 * spacing).ceil().clamp(1.0, MOST) as i64)
    }

    fn put(&mut self, [u, v]: [f64; 2], half: i64, depth: f32, point: u32) {
        let near = |place: f64, size: usize| (-MOST..size as f64 + MOST).contains(&place);
        if !near(u, self.width) || !near(v, self.height) {
            return;
        }
        let (u, v) = (u.floor() as i64, v.floor() as i64);
        for y in (v - half).max(0)..=(v + half).min(self.height as i64 - 1) {
            for x in (u - half).max(0)..=(u + half).min(self.width as i64 - 1) {
                // A splat is a shallow cone, so that of two adjacent points the nearer one is seen.
                let apart = ((x - u) * (x - u) + (y - v) * (y - v)) as f32;
                let at = y as usize * self.width + x as usize;
                let depth = depth + 0.3 * self.unit * apart.sqrt();
                if depth < self.depth[at] {
                    self.depth[at] = depth;
                    self.points[at] = point;
                }
            }
        }
    }

    /// Averages the fine grid into the pixels of the cloud's part.
    pub(super) fn fill(
        &self,
        image: &mut Image,
        frame: &Frame,
        colour: impl Fn(usize, u32) -> [f32; 3],
        monitor: &Monitor,
    ) -> Result<()> {
        for v in 0..frame.h as usize {
            monitor.check()?;
            for u in 0..frame.w as usize {
                let mut sum = [0.0f32; 3];
                for i in 0..FINER * FINER {
                    let at = (v * FINER + i / FINER) * self.width + u * FINER + i % FINER;
                    let c = match self.points[at] {
                        NOTHING => PAPER,
                        point => colour(at, point),
                    };
                    (0..3).for_each(|a| sum[a] += c[a].clamp(0.0, 255.0));
                }
                let at = 3 * ((v + frame.y as usize) * image.width as usize + u + frame.x as usize);
                (0..3).for_each(|a| image.rgb[at + a] = (sum[a] / (FINER * FINER) as f32).round() as u8);
            }
        }
        Ok(())
    }
}
