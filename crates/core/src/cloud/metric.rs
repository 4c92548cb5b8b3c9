//! A cloud in metres: its unit and its stray points, decided once for all steps.

use super::{Bounds, Cloud, Points, StrayParams, Strays};
use crate::error::Result;
use crate::parallel::Monitor;

/// A cloud that is higher than this multiple of its width probably has x and y in other units than z.
const TALL: f64 = 20.0;

/// A cloud whose unit is decided and whose stray points are known.
#[derive(Clone, Debug)]
pub struct MetricCloud<'a> {
    /// The cloud.
    pub cloud: &'a Cloud,
    /// Metres per unit of its coordinates.
    pub metres: f64,
    /// Points that are left out.
    pub strays: Strays,
}

impl<'a> MetricCloud<'a> {
    /// Decides the unit by [`Cloud::metres`] (the one asked for, else the cloud's own, else metres) and finds stray
    /// points. One pass over the points.
    ///
    /// # Errors
    /// If the unit is not positive, the coordinates are degrees, or the work was cancelled.
    pub fn new(cloud: &'a Cloud, metres_per_unit: Option<f64>, monitor: &Monitor) -> Result<Self> {
        let metres = cloud.metres(metres_per_unit)?;
        Ok(Self { cloud, metres, strays: Strays::find(cloud, &StrayParams::default(), monitor)? })
    }

    /// Local points of the cloud: those that are finite and not stray, in metres, relative to the smallest corner rounded
    /// down to whole metres. The corner is subtracted in `f64` before rounding to `f32`. O(points).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn points(&self, monitor: &Monitor) -> Result<Points> {
        Points::without(self, &self.strays.index, monitor)
    }

    /// All finite points of the cloud, including stray ones; the corner is that of the others, so that they keep their
    /// precision. O(points).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn points_and_strays(&self, monitor: &Monitor) -> Result<Points> {
        Points::without(self, &[], monitor)
    }

    /// Properties that may change results, as one sentence each: stray points, which are ignored, and coordinates that
    /// look like degrees although no reference system says so.
    pub fn oddities(&self) -> Vec<String> {
        let Self { cloud, strays, .. } = self;
        let aside = strays.warning(cloud).map(|text| format!("{text}; they are set aside"));
        let aside = aside.map(|text| if strays.index.len() == 1 { text.replace("they are", "it is") } else { text });
        let silent = cloud.metres_per_unit.is_none() && cloud.crs.is_none();
        let degrees = strays.bounds.filter(|bounds| silent && looks_like_degrees(bounds)).map(|_| {
            "x and y look like degrees, but distances are needed: project the cloud first, e.g. with PDAL's \
             filters.reprojection to UTM"
                .to_string()
        });
        aside.into_iter().chain(degrees).collect()
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
}
