//! Projection from the cloud's coordinates to the picture plane: u to the right, v downwards, and the distance from the
//! viewer.

use super::View;
use crate::cloud::Bounds;

/// A parallel projection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    centre: [f64; 3],
    right: [f64; 3],
    down: [f64; 3],
    away: [f64; 3],
    /// Extent of the cloud's bounding box on the picture plane.
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Camera {
    pub(super) fn new(view: View, [low, high]: Bounds) -> Self {
        let (azimuth, elevation) = match view {
            View::Map => (0.0, 90.0f64),
            View::Oblique { azimuth_deg, elevation_deg } => (azimuth_deg, elevation_deg),
        };
        let (sin_a, cos_a) = azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = elevation.to_radians().sin_cos();
        let mut camera = Self {
            centre: [0, 1, 2].map(|a| 0.5 * (low[a] + high[a])),
            right: [cos_a, -sin_a, 0.0],
            down: [-sin_a * sin_e, -cos_a * sin_e, -cos_e],
            away: [sin_a * cos_e, cos_a * cos_e, -sin_e],
            low: [f64::INFINITY; 2],
            high: [f64::NEG_INFINITY; 2],
        };
        for corner in 0..8 {
            let p = [0, 1, 2].map(|a| if corner >> a & 1 == 0 { low[a] } else { high[a] });
            let (u, v, _) = camera.project(p);
            camera.low = [camera.low[0].min(u), camera.low[1].min(v)];
            camera.high = [camera.high[0].max(u), camera.high[1].max(v)];
        }
        camera
    }

    /// Position on the picture plane, and distance.
    pub(super) fn project(&self, p: [f64; 3]) -> (f64, f64, f64) {
        let d = [0, 1, 2].map(|a| p[a] - self.centre[a]);
        (dot(d, self.right), dot(d, self.down), dot(d, self.away))
    }

    /// Coordinates of a position on a map's picture plane.
    pub(super) fn map_place(&self, u: f64, v: f64) -> (f64, f64) {
        (self.centre[0] + u, self.centre[1] - v)
    }
}
