//! What the classes of a model become in the end: vegetation by its height, and points that the model does not know.

use crate::classes::ClassTable;
use crate::cloud::MetricCloud;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::Classified;
use crate::terrain::{HeightParams, heights_above};
use serde::{Deserialize, Serialize};

/// ASPRS codes.
const GROUND: u8 = 2;
const LOW: u8 = 3;
const MEDIUM: u8 = 4;
const HIGH: u8 = 5;

/// Rules for the final codes of a model with ASPRS classes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClassRules {
    /// Heights above the ground, metres, ascending: vegetation (5) below the first becomes low (3), below the second
    /// medium (4). Empty: not divided. Only for models with the classes 2 and 5, but neither 3 nor 4.
    pub vegetation: Vec<f64>,
    /// Points of less confidence become unclassified; 0..1.
    pub abstain: f64,
}

impl ClassRules {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        let two = self.vegetation.len() == 2 && self.vegetation[0] <= self.vegetation[1];
        if !(self.vegetation.is_empty() || two && self.vegetation.iter().all(|h| h.is_finite())) {
            let found = format!("{:?}", self.vegetation);
            return Err(Error::parameter("classes.vegetation", found, "two heights in metres, ascending, or none"));
        }
        match (0.0..=1.0).contains(&self.abstain) {
            true => Ok(()),
            false => Err(Error::parameter("classes.abstain", self.abstain, "a confidence, 0 to 1")),
        }
    }

    /// Whether these rules divide the vegetation of a model with these classes.
    pub fn divides(&self, classes: &ClassTable) -> bool {
        let has = |code| classes.position(code).is_some();
        self.vegetation.len() == 2 && has(GROUND) && has(HIGH) && !has(LOW) && !has(MEDIUM)
    }

    /// All classes that can occur in the result of a model with these classes.
    pub fn given(&self, classes: &ClassTable) -> ClassTable {
        match self.divides(classes) {
            false => classes.clone(),
            true => {
                let more = ClassTable::from_codes(&[LOW, MEDIUM]);
                let all = classes.classes().iter().chain(more.classes()).cloned().collect();
                ClassTable::new(all).unwrap_or_else(|_| classes.clone())
            }
        }
    }

    /// Applies the rules to a result.
    pub(in crate::recipes) fn apply(
        &self,
        result: &mut Classified,
        classes: &ClassTable,
        scene: &MetricCloud<'_>,
        monitor: &Monitor,
    ) -> Result<()> {
        if self.divides(classes) && result.codes.contains(&HIGH) {
            self.divide(result, scene, monitor)?;
        }
        if self.abstain > 0.0 {
            let free = classes.free_code();
            let unsure = result.codes.iter_mut().zip(&result.confidence).filter(|(_, c)| f64::from(**c) < self.abstain);
            unsure.for_each(|(code, _)| *code = free);
        }
        Ok(())
    }

    /// Divides vegetation by its height above the points that are named ground.
    fn divide(&self, result: &mut Classified, scene: &MetricCloud<'_>, monitor: &Monitor) -> Result<()> {
        let points = scene.points(monitor)?;
        let index = &points.frame.index;
        let ground: Vec<bool> = index.iter().map(|&point| result.codes[point as usize] == GROUND).collect();
        let heights = heights_above(&points, &ground, &HeightParams::default(), monitor)?;
        for (&point, height) in index.iter().zip(heights) {
            let code = &mut result.codes[point as usize];
            if *code == HIGH {
                *code = match f64::from(height) {
                    h if h < self.vegetation[0] => LOW,
                    h if h < self.vegetation[1] => MEDIUM,
                    _ => HIGH,
                };
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    #[test]
    fn vegetation_is_divided_by_its_height_and_unsure_points_are_set_free() {
        let mut rows: Vec<[f64; 3]> = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), 100.0]).collect();
        rows.extend([[5.2, 5.2, 100.3], [5.2, 6.2, 101.0], [5.2, 7.2, 107.0], [8.2, 8.2, 104.0]]);
        let cloud = Cloud::from_rows(&rows).unwrap();
        let scene = MetricCloud::new(&cloud, None, &Monitor::default()).unwrap();
        let mut result = Classified {
            codes: [vec![2; 400], vec![5, 5, 5, 6]].concat(),
            confidence: [vec![0.9; 403], vec![0.4]].concat(),
            ..Classified::default()
        };
        let classes = ClassTable::from_codes(&[2, 5, 6]);
        let rules = ClassRules { vegetation: vec![0.5, 1.5], abstain: 0.5 };
        rules.validate().unwrap();
        rules.apply(&mut result, &classes, &scene, &Monitor::default()).unwrap();
        assert_eq!(result.codes[400..], [3, 4, 5, 1]);
        assert_eq!(rules.given(&classes).len(), 5);
        assert!(!rules.divides(&ClassTable::from_codes(&[2, 3, 5])));
        assert!(ClassRules { vegetation: vec![1.0], ..rules.clone() }.validate().is_err());
        assert!(ClassRules { abstain: 1.5, ..rules }.validate().is_err());
    }
}
