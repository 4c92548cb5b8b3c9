//! What training of any method gives besides its recipe: classes, features and classifiers.

use crate::classes::ClassTable;
use crate::classification::arrays::{Array, print_arrays};
use crate::classification::{Classifier, Fingerprint, Predictor};
use crate::error::{Error, Result};
use crate::nn::parameters::Parameters;

/// Classes, features and classifiers: what is the same for every method.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The classes, in the order of the probabilities.
    pub classes: ClassTable,
    /// Feature names in the order of the classifier's columns; each once.
    pub feature_names: Vec<String>,
    /// Summary of the training samples, of the features in `feature_names`.
    pub fingerprint: Fingerprint,
    /// The classifier.
    pub classifier: Classifier,
    /// Says of vegetation and buildings how much they are like cars, from the features of `classifier`; its two classes
    /// are others and cars.
    pub cars: Option<Classifier>,
    /// The classifiers before it, if there are several stages: the probabilities of each are among what the next looks at.
    pub earlier: Vec<EarlierStage>,
    /// The parameters, in the order of their names, of the network that gives the features, if one does.
    pub network: Option<Parameters<f32>>,
}

/// A classifier before the last one.
#[derive(Clone, Debug, PartialEq)]
pub struct EarlierStage {
    /// Feature names in the order of the classifier's columns; each once.
    pub feature_names: Vec<String>,
    /// The classifier, of the same classes as the last.
    pub classifier: Classifier,
    /// Summary of its training samples; `None` in models of older programs.
    pub fingerprint: Option<Fingerprint>,
}

/// A classifier and the names of its features.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage<'a> {
    pub(super) names: &'a [String],
    pub(super) classifier: &'a Classifier,
    /// Summary of the samples that it was trained on, if it is known.
    pub(super) training: Option<&'a Fingerprint>,
}

impl EarlierStage {
    pub(super) fn stage(&self) -> Stage<'_> {
        Stage { names: &self.feature_names, classifier: &self.classifier, training: self.fingerprint.as_ref() }
    }

    /// The arrays of the classifier and of the summary.
    pub(super) fn arrays(&self) -> Vec<Array> {
        let print = self.fingerprint.as_ref().map(print_arrays);
        self.classifier.arrays().into_iter().chain(print.into_iter().flatten()).collect()
    }
}

impl Trained {
    /// Fails unless these are the features of the classifier, in their order.
    pub(super) fn check_features(&self, names: &[String]) -> Result<()> {
        match names == self.feature_names {
            true => Ok(()),
            false => Err(Error::ModelMismatch(format!(
                "it needs the features {}; its recipe gives {}",
                self.feature_names.join(", "),
                names.join(", ")
            ))),
        }
    }

    /// Fails unless names, classes, summaries and classifiers fit together.
    pub(super) fn check_shape(&self) -> Result<()> {
        let (width, classes) = (self.classifier.width(), self.classifier.classes());
        let print = &self.fingerprint;
        if self.feature_names.len() != width || self.classes.len() != classes {
            return Err(Error::input(format!(
                "{} feature names and {} classes for a classifier of {width} features and {classes} classes",
                self.feature_names.len(),
                self.classes.len()
            )));
        }
        check_print(print, &self.classifier)?;
        if let Some([cars_width, cars_classes]) = self.cars.as_ref().map(|cars| [cars.width(), cars.classes()])
            && [cars_width, cars_classes] != [width, 2]
        {
            return Err(Error::input(format!(
                "a classifier of cars of {cars_width} features and {cars_classes} classes (allowed: {width} and 2)"
            )));
        }
        if self.earlier.len() > 2 {
            return Err(Error::input(format!("{} earlier classifiers (allowed: up to 2)", self.earlier.len())));
        }
        for EarlierStage { feature_names, classifier, fingerprint } in &self.earlier {
            let found = [feature_names.len(), classifier.width(), classifier.classes()];
            if found != [classifier.width(), classifier.width(), classes] {
                return Err(Error::input(format!(
                    "an earlier classifier of {} features and {} classes with {} feature names (allowed: {classes} classes)",
                    found[1], found[2], found[0]
                )));
            }
            each_once(feature_names)?;
            fingerprint.as_ref().map_or(Ok(()), |print| check_print(print, classifier))?;
        }
        each_once(&self.feature_names)
    }

    pub(super) fn stage(&self) -> Stage<'_> {
        let training = Some(&self.fingerprint);
        Stage { names: &self.feature_names, classifier: &self.classifier, training }
    }
}

/// Fails unless a summary is one of the samples of a classifier.
fn check_print(print: &Fingerprint, classifier: &Classifier) -> Result<()> {
    let (width, classes) = (classifier.width(), classifier.classes());
    let quantiles = width * Fingerprint::LEVELS.len();
    match print.means.len() == width && print.quantiles.len() == quantiles && print.class_counts.len() == classes {
        true => Ok(()),
        false => Err(Error::input(format!(
            "a fingerprint of {} features and {} classes for a classifier of {width} and {classes}",
            print.means.len(),
            print.class_counts.len()
        ))),
    }
}

fn each_once(names: &[String]) -> Result<()> {
    let mut names: Vec<&str> = names.iter().map(String::as_str).collect();
    names.sort_unstable();
    match names.windows(2).find(|w| w[0] == w[1]) {
        Some(twice) => Err(Error::input(format!("the feature name {} stands twice", twice[0]))),
        None => Ok(()),
    }
}
