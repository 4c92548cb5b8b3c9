//! The smallest recipe: the example of CONTRIBUTING.md. It is registered in the tests of this crate only.

use crate::classification::{Classifier, Fingerprint, ForestParams, Learner, Predictor, Samples};
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::labels::LabelledCloud;
use crate::recipes::regularise::{Probabilities, RegulariseParams, regularise};
use crate::recipes::system::report::{ClassCount, Report};
use crate::recipes::system::{Fitted, Nothing, SharedSettings, System, TrainOptions, TrainingResult};
use crate::recipes::trained::Trained;
use crate::recipes::training::{ClassSamples, TrainingData, check_classes, mean_density};
use crate::voxels::planar_density;
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeightKind {
    #[default]
    Height,
}

/// Classifies every point by its height above the lowest one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeightRecipe {
    /// Always `height`.
    pub recipe: HeightKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// The forest.
    pub forest: ForestParams,
    /// Regularisation of the labels.
    pub regularise: RegulariseParams,
}

/// Its only feature.
const NAMES: [&str; 1] = ["Height"];

fn heights(points: &Points) -> Vec<f32> {
    let lowest = points.positions.z.iter().copied().fold(f32::INFINITY, f32::min);
    points.positions.z.iter().map(|z| z - lowest).collect()
}

impl System for HeightRecipe {
    const NAME: &'static str = "height";
    type Learned = Nothing;
    type Report = HeightReport;

    fn validate(&self) -> Result<()> {
        self.forest.validate()?;
        self.regularise.validate()
    }

    fn shared(&self) -> SharedSettings<'_> {
        SharedSettings { seed: self.seed, regularise: &self.regularise, metres_per_unit: None, densities: &[] }
    }

    fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    fn columns(&self) -> Vec<String> {
        Vec::new()
    }

    fn learn(
        &self,
        clouds: &[LabelledCloud],
        _options: &TrainOptions,
        monitor: &Monitor,
    ) -> Result<TrainingResult<Self>> {
        self.validate()?;
        let data = TrainingData::new(clouds, self.metres_per_unit(), monitor)?;
        let classes = data.labelled_classes();
        check_classes(&classes)?;
        let (mut features, mut labels, mut densities) = (Vec::new(), Vec::new(), Vec::new());
        for scene in &data.scenes {
            let points = scene.metric.some_points(monitor)?;
            let codes = scene.labels.of(&points.frame.index);
            for (height, code) in heights(&points).into_iter().zip(codes) {
                if let Some(class) = code.and_then(|code| classes.position(code)) {
                    features.push(height);
                    labels.push(class as u16);
                }
            }
            densities.push(planar_density(&points.positions, monitor)?);
        }
        let samples = Samples { features: &features, width: 1, labels: &labels, weights: None, classes: classes.len() };
        let forest = ForestParams { seed: self.seed, ..self.forest.clone() };
        let trained = Trained {
            cars: None,
            earlier: Vec::new(),
            network: None,
            fingerprint: Fingerprint::of(&samples, mean_density(densities.into_iter())),
            feature_names: NAMES.map(String::from).to_vec(),
            classifier: Classifier::Forest(forest.train(&samples, monitor)?),
            classes,
        };
        let all = |_| ClassSamples { count: labels.len() as u64, weight: 1.0 };
        let report = HeightReport { classes: data.class_counts(all) };
        Ok(TrainingResult { fitted: Fitted { recipe: self.clone(), learned: Nothing {} }, trained, report })
    }

    fn classify(_fitted: &Fitted<Self>, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
        let points = job.scene.some_points(monitor)?;
        let classes = job.model.classes.len();
        let mut values = vec![0.0; points.len() * classes];
        job.model.classifier.predict_proba(&heights(&points), &mut values)?;
        let given = Probabilities { values: &values, classes };
        let found = regularise(&points.positions, given, job.regularise, monitor)?;
        job.decided(&points, &found, monitor)
    }
}

/// What training reports.
#[derive(Clone, Debug, Serialize)]
pub struct HeightReport {
    classes: Vec<ClassCount>,
}

impl Report for HeightReport {
    fn classes(&self) -> &[ClassCount] {
        &self.classes
    }

    fn warnings(&self) -> &[String] {
        &[]
    }

    fn text(&self) -> String {
        String::new()
    }

    fn json(&self) -> Result<String> {
        serde_json::to_string(self).map_err(|e| Error::input(e.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, CodeScheme};
    use crate::recipes::{AnyRecipe, ClassifyParams, Labels, Model, classify};

    #[test]
    fn a_method_of_one_file_and_one_line_trains_is_saved_and_classifies() {
        let rows: Vec<[f64; 3]> =
            (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), if i % 3 == 0 { 5.0 } else { 0.1 }]).collect();
        let codes: Vec<u8> = (0..400).map(|i| if i % 3 == 0 { 6 } else { 2 }).collect();
        let labels = Labels::new(codes.iter().copied().map(Some).collect(), CodeScheme::Asprs);
        let clouds = [LabelledCloud { cloud: Cloud::from_rows(&rows).unwrap(), labels }];
        let recipe = AnyRecipe::from_toml("recipe = \"height\"\n[forest]\ntrees = 3\n").unwrap();
        let (model, report) = recipe.train(&clouds, &TrainOptions::default(), &Monitor::default()).unwrap();
        assert!(report.classes().len() == 2 && report.json().unwrap().contains("ground"));
        let model = Model::from_bytes(&model.to_bytes().unwrap(), "height.model".as_ref()).unwrap();
        let found = classify(&clouds[0].cloud, &model, &ClassifyParams::default(), &Monitor::default()).unwrap();
        assert_eq!(found.codes, codes);
    }
}
