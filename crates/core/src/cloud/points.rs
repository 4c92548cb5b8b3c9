//! Local coordinates in metres, as the algorithms use them.

use super::{Cloud, StrayParams, Strays};
use crate::error::Result;
use crate::parallel::{Monitor, watched};

/// Largest distance from the origin in metres: three squares of it still fit into `f32`.
const FARTHEST: f64 = 1e18;

/// `f32` coordinates relative to an origin, axis by axis.
///
/// Contains only the finite points of a cloud that are not stray ([`Strays`]) and at most 10^15 km from the origin,
/// beyond which squares overflow `f32`; `index[i]` is the index in the cloud of local point `i`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Metres east of the origin.
    pub x: Vec<f32>,
    /// Metres north of the origin.
    pub y: Vec<f32>,
    /// Metres above the origin.
    pub z: Vec<f32>,
    /// Index in the cloud of each point, ascending.
    pub index: Vec<u32>,
    /// The subtracted origin, in metres.
    pub origin: [f64; 3],
}

/// What becomes of stray points.
#[derive(Clone, Copy, PartialEq)]
enum StrayPoints {
    LeftOut,
    Kept,
}

impl Points {
    /// Local points of a cloud: those that are finite and not stray, in metres, relative to the smallest corner rounded
    /// down to whole metres. The corner is subtracted in `f64` before rounding to `f32`.
    pub fn from_cloud(cloud: &Cloud, metres_per_unit: f64) -> Self {
        // A new monitor cannot have been cancelled.
        Self::from_cloud_watched(cloud, metres_per_unit, &Monitor::default()).unwrap_or_default()
    }

    /// Like [`Points::from_cloud`], and can be cancelled.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn from_cloud_watched(cloud: &Cloud, metres_per_unit: f64, monitor: &Monitor) -> Result<Self> {
        Self::new(cloud, metres_per_unit, StrayPoints::LeftOut, monitor)
    }

    /// All finite points of a cloud, including stray ones; the corner is that of the others, so that they keep their
    /// precision.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn with_strays(cloud: &Cloud, metres_per_unit: f64, monitor: &Monitor) -> Result<Self> {
        Self::new(cloud, metres_per_unit, StrayPoints::Kept, monitor)
    }

    fn new(cloud: &Cloud, metres_per_unit: f64, stray: StrayPoints, monitor: &Monitor) -> Result<Self> {
        let strays = Strays::find(cloud, &StrayParams::default(), monitor)?;
        let Some([low, _]) = strays.bounds else { return Ok(Self::default()) };
        let origin = low.map(|v| (v * metres_per_unit).floor());
        let mut points = Self { origin, ..Self::default() };
        points.reserve(cloud.len());
        let without = if stray == StrayPoints::LeftOut { &strays.index[..] } else { &[] };
        let mut without = without.iter().peekable();
        for piece in watched(cloud.len(), monitor) {
            for i in piece? {
                if without.next_if(|&&stray| stray as usize == i).is_some() {
                    continue;
                }
                let p = cloud.xyz(i);
                let local = [0, 1, 2].map(|a| p[a] * metres_per_unit - origin[a]);
                if local.iter().all(|v| v.abs() <= FARTHEST) {
                    points.x.push(local[0] as f32);
                    points.y.push(local[1] as f32);
                    points.z.push(local[2] as f32);
                    points.index.push(i as u32);
                }
            }
        }
        Ok(points)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// The local coordinates of each point.
    pub(crate) fn places(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        self.x.iter().zip(&self.y).zip(&self.z).map(|((&x, &y), &z)| [x, y, z])
    }

    fn reserve(&mut self, n: usize) {
        self.x.reserve_exact(n);
        self.y.reserve_exact(n);
        self.z.reserve_exact(n);
        self.index.reserve_exact(n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_place_in_f32_is_not_among_the_points() {
        let cloud = Cloud::from_rows(&[[0.0; 3], [1e300, 0.0, 0.0], [0.0, 1e19, 0.0], [1.0, 2.0, 3.0]]).unwrap();
        assert_eq!(Points::from_cloud(&cloud, 1.0).index, [0, 3]);
        assert!(Points::from_cloud(&Cloud::from_rows(&[[1e300; 3]]).unwrap(), 1e300).is_empty());
    }

    #[test]
    fn large_coordinates_keep_millimetres() {
        let cloud = Cloud::from_rows(&[
            [652_000.001, 6_862_000.002, 5e6],
            [652_001.004, f64::INFINITY, 0.0],
            [652_003.0, 6_862_001.0, 5e6 + 0.5],
        ])
        .unwrap();
        let points = Points::from_cloud(&cloud, 1.0);
        assert_eq!(points.index, [0, 2]);
        assert!((points.x[0] - 0.001).abs() < 1e-6 && (points.z[1] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_point_at_zero_costs_the_others_no_precision() {
        let mut rows: Vec<[f64; 3]> =
            (0..500).map(|i| [500_000.0 + f64::from(i % 20) * 0.3, 5.2e6 + f64::from(i / 20) * 0.3, 400.0]).collect();
        let clean = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        rows.push([0.0; 3]);
        let cloud = Cloud::from_rows(&rows).unwrap();
        assert_eq!(Points::from_cloud(&cloud, 1.0), clean);
        let all = Points::with_strays(&cloud, 1.0, &Monitor::default()).unwrap();
        assert_eq!((all.len(), all.origin), (501, clean.origin));
        assert_eq!((&all.x[..500], all.y[500]), (&clean.x[..], -5.2e6));
    }
}
