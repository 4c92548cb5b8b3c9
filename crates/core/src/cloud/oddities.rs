//! Warnings about a cloud before it is processed.

use super::{Bounds, Cloud, StrayParams, Strays};
use crate::error::Result;
use crate::parallel::Monitor;

/// A cloud that is higher than this multiple of its width probably has x and y in other units than z.
const TALL: f64 = 20.0;

impl Cloud {
    /// Properties that may change results, as one sentence each: stray points, which are ignored, and coordinates that
    /// look like degrees although no reference system says so.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn oddities(&self, monitor: &Monitor) -> Result<Vec<String>> {
        let strays = Strays::find(self, &StrayParams::default(), monitor)?;
        let aside = strays.warning(self).map(|text| format!("{text}; they are set aside"));
        let aside = aside.map(|text| if strays.index.len() == 1 { text.replace("they are", "it is") } else { text });
        let silent = self.metres_per_unit.is_none() && self.crs.is_none();
        let degrees = strays.bounds.filter(|bounds| silent && looks_like_degrees(bounds)).map(|_| {
            "x and y look like degrees, but distances are needed: project the cloud first, e.g. with PDAL's \
             filters.reprojection to UTM"
                .to_string()
        });
        Ok(aside.into_iter().chain(degrees).collect())
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
        let degrees = Cloud::from_rows(&rows).unwrap();
        assert_eq!(degrees.oddities(&Monitor::default()).unwrap().len(), 1);
        let known = Cloud { metres_per_unit: Some(1.0), ..degrees };
        assert!(known.oddities(&Monitor::default()).unwrap().is_empty());
        let metres: Vec<[f64; 3]> = rows.iter().map(|p| [(p[0] - 2.35) * 1e5, (p[1] - 48.85) * 1e5, p[2]]).collect();
        assert!(Cloud::from_rows(&metres).unwrap().oddities(&Monitor::default()).unwrap().is_empty());
        let strayed = [metres, vec![[9e5, 0.0, 0.0]]].concat();
        let found = Cloud::from_rows(&strayed).unwrap().oddities(&Monitor::default()).unwrap();
        assert!(
            found.len() == 1 && found[0].contains("number 400") && found[0].ends_with("it is set aside"),
            "{found:?}"
        );
    }
}
