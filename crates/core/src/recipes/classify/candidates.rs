//! Points that may be cars: low vegetation and buildings, whose features go to the classifier of cars as well.

use crate::classification::{Classifier, ClassifierScratch, Predictor, argmax};
use crate::error::{Error, Result};
use crate::recipes::classify::rules::{BUILDING, GROUND, LOW};
use crate::recipes::trained::Trained;

/// Lowest and highest height above the ground, metres, of points that may be cars.
const HEIGHTS: [f32; 2] = [0.2, 3.0];
/// Which points may be cars, and what is done with them.
pub(in crate::recipes) struct Candidates<'a> {
    /// Whether points of each class may be.
    classes: Vec<bool>,
    /// Height of each point of the cloud above the ground, metres.
    heights: &'a [f32],
    /// Says how much they are like cars; without it their features are given.
    classifier: Option<&'a Classifier>,
}

/// The candidates among some rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::recipes) struct Found {
    /// Their places in the list of rows, ascending.
    pub(in crate::recipes) places: Vec<u32>,
    /// The probability that each is a car, if a classifier was asked.
    pub(in crate::recipes) cars: Vec<f32>,
    /// Their features, if none was.
    pub(in crate::recipes) features: Vec<f32>,
}

/// Points with their features and class probabilities, row-major.
#[derive(Clone, Copy)]
pub(in crate::recipes) struct Rows<'a> {
    /// Indices in the cloud.
    pub(in crate::recipes) points: &'a [u32],
    pub(in crate::recipes) features: &'a [f32],
    pub(in crate::recipes) probabilities: &'a [f32],
}

impl<'a> Candidates<'a> {
    /// Candidates to be rated by the classifier of cars of a model; `None` if it has none.
    ///
    /// # Errors
    /// As [`Candidates::to_learn`].
    pub(in crate::recipes) fn to_rate(model: &'a Trained, heights: &'a [f32]) -> Result<Option<Self>> {
        let Some(classifier) = &model.cars else { return Ok(None) };
        Ok(Some(Self { classifier: Some(classifier), ..Self::to_learn(model, heights)? }))
    }

    /// Candidates whose features are asked for.
    ///
    /// # Errors
    /// If the model has no class of ground, or none of vegetation or buildings.
    pub(in crate::recipes) fn to_learn(model: &Trained, heights: &'a [f32]) -> Result<Self> {
        let taken_for = |code: u8| (LOW..=BUILDING).contains(&code);
        let classes: Vec<bool> = model.classes.codes().into_iter().map(taken_for).collect();
        match classes.contains(&true) && model.classes.position(GROUND).is_some() {
            true => Ok(Self { classes, heights, classifier: None }),
            false => Err(Error::ModelMismatch(
                "cars are looked for beside ground (2) and in classes 3 to 6, which it does not have".into(),
            )),
        }
    }

    /// The candidates among some rows.
    ///
    /// # Errors
    /// If the classifier is one of other features.
    pub(in crate::recipes) fn among(&self, rows: Rows<'_>, scratch: &mut ClassifierScratch) -> Result<Found> {
        let width = rows.features.len() / rows.points.len().max(1);
        let mut found = Found::default();
        for (place, own) in rows.probabilities.chunks_exact(self.classes.len()).enumerate() {
            let height = self.heights[rows.points[place] as usize];
            if (HEIGHTS[0]..=HEIGHTS[1]).contains(&height) && self.classes[argmax(own)] {
                found.places.push(place as u32);
                found.features.extend_from_slice(&rows.features[place * width..][..width]);
            }
        }
        let Some(classifier) = self.classifier else { return Ok(found) };
        let mut rated = vec![0.0; 2 * found.places.len()];
        classifier.predict_block(&found.features, scratch, &mut rated)?;
        let cars = rated.chunks_exact(2).map(|pair| pair[1]).collect();
        Ok(Found { cars, features: Vec::new(), ..found })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn low_vegetation_and_buildings_are_candidates() {
        let heights = [0.1, 1.0, 1.0, 5.0, f32::NAN, 2.9];
        let candidates = Candidates { classes: vec![false, true, true], heights: &heights, classifier: None };
        let (ground, tree, roof) = ([0.9, 0.1, 0.0], [0.2, 0.8, 0.0], [0.1, 0.2, 0.7]);
        let rows = Rows {
            points: &[5, 0, 1, 2, 3, 4],
            features: &[5.0, 5.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5],
            probabilities: &[roof, tree, tree, ground, tree, tree].concat(),
        };
        let found = candidates.among(rows, &mut ClassifierScratch::default()).unwrap();
        assert_eq!(found, Found { places: vec![0, 2], cars: Vec::new(), features: vec![5.0, 5.5, 1.0, 1.5] });
        let none = Rows { points: &[], features: &[], probabilities: &[] };
        assert_eq!(candidates.among(none, &mut ClassifierScratch::default()).unwrap(), Found::default());
    }
}
