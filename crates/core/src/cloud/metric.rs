//! A cloud in metres: its unit and its stray points, decided once for all steps.

use super::crs::{GEOCENTRIC, is_geocentric};
use super::{Bounds, Cloud, LocalFrame, Points, StrayParams, Strays};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, watched};

/// A cloud that is higher than this multiple of its width probably has x and y in other units than z.
const TALL: f64 = 20.0;

/// Largest distance from the origin in metres: three squares of it still fit into `f32`.
const FARTHEST: f64 = 1e18;

/// A cloud whose unit is decided and whose stray points are known.
#[derive(Clone, Debug)]
pub struct MetricCloud<'a> {
    /// The cloud.
    pub cloud: &'a Cloud,
    /// Metres per unit of its coordinates.
    pub metres: f64,
    /// Points that are left out.
    pub strays: Strays,
    /// Height of each point of the cloud above the ground, metres, if somebody has found it; NaN for points without.
    pub heights: Option<&'a [f32]>,
}

impl<'a> MetricCloud<'a> {
    /// Decides the unit by [`Cloud::metres`] (the one asked for, else the cloud's own, else metres) and finds stray
    /// points. One pass over the points.
    ///
    /// # Errors
    /// If the unit is not positive, the coordinates are degrees, or the work was cancelled.
    pub fn new(cloud: &'a Cloud, metres_per_unit: Option<f64>, monitor: &Monitor) -> Result<Self> {
        let metres = cloud.metres(metres_per_unit)?;
        Ok(Self { cloud, metres, strays: Strays::find(cloud, &StrayParams::default(), monitor)?, heights: None })
    }

    /// Local points of the cloud: those that are finite and not stray, in metres, relative to the smallest corner rounded
    /// down to whole metres. The corner is subtracted in `f64` before rounding to `f32`. O(points).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn points(&self, monitor: &Monitor) -> Result<Points> {
        self.points_without(&self.strays.index, monitor)
    }

    /// All finite points of the cloud, including stray ones; the corner is that of the others, so that they keep their
    /// precision. O(points).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn points_and_strays(&self, monitor: &Monitor) -> Result<Points> {
        self.points_without(&[], monitor)
    }

    /// As [`MetricCloud::points`]; fails if there is none.
    ///
    /// # Errors
    /// If no point has finite coordinates, or the work was cancelled.
    pub fn some_points(&self, monitor: &Monitor) -> Result<Points> {
        let points = self.points(monitor)?;
        match points.is_empty() {
            true => Err(Error::input("the cloud has no point with finite coordinates")),
            false => Ok(points),
        }
    }

    /// The finite points but for those with these indices (ascending).
    fn points_without(&self, indices: &[u32], monitor: &Monitor) -> Result<Points> {
        let Self { cloud, metres, ref strays, .. } = *self;
        let Some([low, _]) = strays.bounds else { return Ok(Points::default()) };
        let origin = low.map(|v| (v * metres).floor());
        let mut points = Points { frame: LocalFrame { origin, ..LocalFrame::default() }, ..Points::default() };
        points.positions.reserve(cloud.len());
        points.frame.index.reserve_exact(cloud.len());
        let mut without = indices.iter().peekable();
        for piece in watched(cloud.len(), monitor) {
            for i in piece? {
                if without.next_if(|&&index| index as usize == i).is_some() {
                    continue;
                }
                let p = cloud.xyz(i);
                let local = [0, 1, 2].map(|a| p[a] * metres - origin[a]);
                if local.iter().all(|v| v.abs() <= FARTHEST) {
                    points.positions.push(local.map(|v| v as f32));
                    points.frame.index.push(i as u32);
                }
            }
        }
        Ok(points)
    }

    /// Properties that may change results, as one sentence each: stray points, which are ignored, geocentric coordinates,
    /// and those that look like degrees although no reference system says so.
    pub fn oddities(&self) -> Vec<String> {
        let Self { cloud, strays, .. } = self;
        let aside = strays.warning(cloud).map(|text| format!("{text}; they are set aside"));
        let aside = aside.map(|text| if strays.index.len() == 1 { text.replace("they are", "it is") } else { text });
        let degrees = strays.bounds.filter(|bounds| cloud.unit_is_unknown() && looks_like_degrees(bounds)).map(|_| {
            "x and y look like degrees, but distances are needed: project the cloud first, e.g. with PDAL's \
             filters.reprojection to UTM"
                .to_string()
        });
        let geocentric = cloud.crs.as_deref().is_some_and(is_geocentric).then(|| GEOCENTRIC.to_string());
        aside.into_iter().chain(geocentric).chain(degrees).collect()
    }
}

impl Points {
    /// The points of a small cloud, for tests and examples: [`MetricCloud::points`] without errors. Empty if the unit is
    /// not positive.
    pub fn from_cloud(cloud: &Cloud, metres_per_unit: f64) -> Self {
        let monitor = Monitor::default();
        let scene = MetricCloud::new(cloud, Some(metres_per_unit), &monitor);
        scene.and_then(|scene| scene.points(&monitor)).unwrap_or_default()
    }
}

/// Whether the bounding box lies within the range of degrees and is far higher than wide.
fn looks_like_degrees([low, high]: &Bounds) -> bool {
    let [x, y, z] = [0, 1, 2].map(|a| high[a] - low[a]);
    let plan = x.max(y);
    let on_earth = low[0] >= -180.0 && high[0] <= 180.0 && low[1] >= -90.0 && high[1] <= 90.0;
    on_earth && plan > 0.0 && plan < 1.0 && z > TALL * plan
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strays_and_degrees_are_told_of() {
        let rows: Vec<[f64; 3]> = (0..400)
            .map(|i| [2.35 + f64::from(i % 20) * 1e-5, 48.85 + f64::from(i / 20) * 1e-5, f64::from(i % 9)])
            .collect();
        let oddities = |cloud: &Cloud| MetricCloud::new(cloud, None, &Monitor::default()).unwrap().oddities();
        let degrees = Cloud::from_rows(&rows).unwrap();
        assert_eq!(oddities(&degrees).len(), 1);
        let geocentric = Cloud { crs: Some("EPSG:4978".into()), metres_per_unit: Some(1.0), ..degrees.clone() };
        assert_eq!(oddities(&geocentric), [GEOCENTRIC]);
        let known = Cloud { metres_per_unit: Some(1.0), ..degrees };
        assert!(oddities(&known).is_empty());
        let metres: Vec<[f64; 3]> = rows.iter().map(|p| [(p[0] - 2.35) * 1e5, (p[1] - 48.85) * 1e5, p[2]]).collect();
        assert!(oddities(&Cloud::from_rows(&metres).unwrap()).is_empty());
        let strayed = [metres, vec![[9e5, 0.0, 0.0]]].concat();
        let found = oddities(&Cloud::from_rows(&strayed).unwrap());
        assert!(
            found.len() == 1 && found[0].contains("number 400") && found[0].ends_with("it is set aside"),
            "{found:?}"
        );
    }

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
