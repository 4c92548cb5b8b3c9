//! A classifier of any kind as named arrays of a model file.

use super::{Array, Reader};
use crate::classification::boosting::codec as boosting_codec;
use crate::classification::classifier::{Classifier, ClassifierKind};
use crate::classification::forest::codec as forest_codec;
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
