//! Lines over a cloud.

use super::camera::Camera;
use super::canvas::{FINER, Frame, Image};
use super::raster::Raster;

const COLOUR: [u8; 3] = [225, 0, 90];
/// Share of the colour of a line behind points.
const HIDDEN: f32 = 0.15;
/// Distance behind the nearest point up to which a line is not hidden, in pixels.
const DEPTH: f64 = 12.0;

/// A picture of a cloud that lines are drawn over.
pub(super) struct Over<'a> {
    pub(super) camera: &'a Camera,
    pub(super) frame: &'a Frame,
    pub(super) raster: &'a Raster,
}

impl Over<'_> {
    /// Draws lines, faint where points are in front of them; true if a part of one lies in the picture.
    pub(super) fn draw(&self, image: &mut Image, lines: &[Vec<[f64; 3]>]) -> bool {
        let mut seen = false;
        for ends in lines.iter().flat_map(|line| line.windows(2)) {
            let [a, b] = [ends[0], ends[1]].map(|at| self.place(at));
            // Half a pixel from step to step; lines far outside have few steps inside.
            let steps = (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) * 2.0;
            if !steps.is_finite() || steps > 1e6 {
                continue;
            }
            for step in 0..=steps.ceil() as usize {
                let share = step as f64 / steps.ceil().max(1.0);
                seen |= self.dot(image, std::array::from_fn(|i| a[i] + share * (b[i] - a[i])));
            }
        }
        seen
    }

    /// Pixel, from the left upper corner of the cloud's frame, and distance.
    fn place(&self, at: [f64; 3]) -> [f64; 3] {
        let (u, v, away) = self.camera.project(at);
        [(u - self.frame.corner[0]) / self.frame.unit, (v - self.frame.corner[1]) / self.frame.unit, away]
    }

    /// Draws two by two pixels.
    fn dot(&self, image: &mut Image, [x, y, away]: [f64; 3]) -> bool {
        if !(0.0..f64::from(self.frame.w)).contains(&x) || !(0.0..f64::from(self.frame.h)).contains(&y) {
            return false;
        }
        let cell = (y * FINER as f64) as usize * self.raster.width + (x * FINER as f64) as usize;
        let front = self.raster.depth.get(cell).copied().unwrap_or(f32::INFINITY);
        let hidden = away > f64::from(front) + DEPTH * self.frame.unit;
        let share = if hidden { HIDDEN } else { 1.0 };
        let corner =
            [(x - 0.5).floor() as i64 + i64::from(self.frame.x), (y - 0.5).floor() as i64 + i64::from(self.frame.y)];
        for [i, j] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            image.mix([corner[0] + i, corner[1] + j], COLOUR, share);
        }
        true
    }
}
