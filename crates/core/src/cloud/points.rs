//! The points of a cloud in local metres.

use super::{Cloud, MetricCloud, Positions};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_watched, watched};

/// Largest distance of a point, or of another origin, from the origin in metres: three squares of it still fit into
/// `f32`.
const FARTHEST: f64 = 1e18;

/// Where local positions are from: which points of a cloud they are, and the origin that was subtracted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LocalFrame {
    /// Index in the cloud of each point, ascending unless others were selected.
    pub index: Vec<u32>,
    /// The subtracted origin, in metres.
    pub origin: [f64; 3],
}

impl LocalFrame {
    /// The row of each point of a cloud of `points` points; 0 for points that have none.
    pub(crate) fn rows(&self, points: usize) -> Vec<u32> {
        let mut rows = vec![0; points];
        self.index.iter().zip(0..).for_each(|(&point, row)| rows[point as usize] = row);
        rows
    }

    /// The frame of the points in these rows, in their order. O(rows), in parallel.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn select(&self, rows: &[u32], monitor: &Monitor) -> Result<Self> {
        let index = map_watched(rows.len(), monitor, |i| self.index[rows[i] as usize])?;
        Ok(Self { index, origin: self.origin })
    }
}

/// Points of a cloud: their positions, and where these are in the cloud and in the world.
///
/// Contains only the finite points of a cloud that are not stray ([`Strays`](super::Strays)) and at most 10^15 km from the origin,
/// beyond which squares overflow `f32`. What needs only coordinates takes [`Positions`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Local coordinates in metres.
    pub positions: Positions,
    /// Index in the cloud of each position, and their origin.
    pub frame: LocalFrame,
}

impl Points {
    /// The points of a small cloud, for tests and examples: [`MetricCloud::points`] without errors. Empty if the unit is
    /// not positive.
    pub fn from_cloud(cloud: &Cloud, metres_per_unit: f64) -> Self {
        let monitor = Monitor::default();
        let scene = MetricCloud::new(cloud, Some(metres_per_unit), &monitor);
        scene.and_then(|scene| scene.points(&monitor)).unwrap_or_default()
    }

    /// The finite points of a cloud but for those with these indices (ascending).
    pub(super) fn without(scene: &MetricCloud<'_>, indices: &[u32], monitor: &Monitor) -> Result<Self> {
        let MetricCloud { cloud, metres: metres_per_unit, ref strays } = *scene;
        let Some([low, _]) = strays.bounds else { return Ok(Self::default()) };
        let origin = low.map(|v| (v * metres_per_unit).floor());
        let mut points = Self { frame: LocalFrame { origin, ..LocalFrame::default() }, ..Self::default() };
        points.positions.reserve(cloud.len());
        points.frame.index.reserve_exact(cloud.len());
        let mut without = indices.iter().peekable();
        for piece in watched(cloud.len(), monitor) {
            for i in piece? {
                if without.next_if(|&&stray| stray as usize == i).is_some() {
                    continue;
                }
                let p = cloud.xyz(i);
                let local = [0, 1, 2].map(|a| p[a] * metres_per_unit - origin[a]);
                if local.iter().all(|v| v.abs() <= FARTHEST) {
                    points.positions.push(local.map(|v| v as f32));
                    points.frame.index.push(i as u32);
                }
            }
        }
        Ok(points)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Where point `i` lies in the world: metres, not relative to the origin.
    #[inline]
    pub fn world(&self, i: usize) -> [f64; 3] {
        let at = self.positions.xyz(i);
        [0, 1, 2].map(|a| f64::from(at[a]) + self.frame.origin[a])
    }

    /// The points in these rows, in their order. O(rows), in parallel.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn select(&self, rows: &[u32], monitor: &Monitor) -> Result<Self> {
        Ok(Self { positions: self.positions.select(rows, monitor)?, frame: self.frame.select(rows, monitor)? })
    }

    /// The same points relative to another origin, in metres: moved in `f64`, rounded to `f32`. Positions of two clouds
    /// can be compared once they have one origin.
    ///
    /// # Errors
    /// If the origins are too far apart for `f32`.
    pub fn moved_to(mut self, origin: [f64; 3]) -> Result<Self> {
        let shift = [0, 1, 2].map(|a| self.frame.origin[a] - origin[a]);
        if !shift.iter().all(|v| v.abs() <= FARTHEST) {
            let found = format!("origins {origin:?} and {:?}", self.frame.origin);
            return Err(Error::input(format!("{found} are too far apart to be compared (allowed: {FARTHEST:e} m)")));
        }
        let Positions { x, y, z } = &mut self.positions;
        for (axis, shift) in [x, y, z].into_iter().zip(shift) {
            axis.iter_mut().for_each(|v| *v = (f64::from(*v) + shift) as f32);
        }
        self.frame.origin = origin;
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_place_in_f32_is_not_among_the_points() {
        let cloud = Cloud::from_rows(&[[0.0; 3], [1e300, 0.0, 0.0], [0.0, 1e19, 0.0], [1.0, 2.0, 3.0]]).unwrap();
        assert_eq!(Points::from_cloud(&cloud, 1.0).frame.index, [0, 3]);
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
        assert_eq!(points.frame.index, [0, 2]);
        assert!((points.positions.x[0] - 0.001).abs() < 1e-6 && (points.positions.z[1] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_point_at_zero_costs_the_others_no_precision() {
        let mut rows: Vec<[f64; 3]> =
            (0..500).map(|i| [500_000.0 + f64::from(i % 20) * 0.3, 5.2e6 + f64::from(i / 20) * 0.3, 400.0]).collect();
        let (clean, monitor) = (Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0), Monitor::default());
        rows.push([0.0; 3]);
        let cloud = Cloud::from_rows(&rows).unwrap();
        assert_eq!(Points::from_cloud(&cloud, 1.0), clean);
        let all = MetricCloud::new(&cloud, None, &monitor).unwrap().points_and_strays(&monitor).unwrap();
        assert_eq!((all.len(), all.frame.origin), (501, clean.frame.origin));
        assert_eq!((&all.positions.x[..500], all.positions.y[500]), (&clean.positions.x[..], -5.2e6));
    }
}
