//! A classifier of any kind as named arrays of a model file.

use super::classifier::{Classifier, ClassifierKind};
use super::codec::{Array, Reader};
use super::{boosting_codec, forest_codec};
use crate::error::Result;

/// The arrays of a classifier.
pub(crate) fn encode(classifier: &Classifier) -> Vec<Array> {
    match classifier {
        Classifier::Forest(forest) | Classifier::Bagging(forest) => forest_codec::encode(forest),
        Classifier::Boosting(trees) => boosting_codec::encode(trees),
    }
}

impl Reader<'_> {
    /// The classifier of that kind, of `width` features and `classes` classes, every index checked.
    pub(crate) fn classifier(&self, kind: ClassifierKind, width: usize, classes: usize) -> Result<Classifier> {
        Ok(match kind {
            ClassifierKind::Forest => Classifier::Forest(self.forest(width, classes)?),
            ClassifierKind::Bagging => Classifier::Bagging(self.forest(width, classes)?),
            ClassifierKind::Boosting => Classifier::Boosting(self.boosting(width, classes)?),
        })
    }
}
