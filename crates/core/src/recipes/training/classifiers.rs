//! The classifiers that a recipe offers: a key for the kind, and one section of parameters for each.

/// Implements the choice of a classifier for recipes with the fields `classifier`, `forest`, `boosting`, `bagging` and
/// `linear`.
macro_rules! offers_classifiers {
    ($recipe:ty) => {
        impl $recipe {
            /// Parameters of the selected classifier.
            pub fn classifier(&self) -> crate::classification::ClassifierParams {
                use crate::classification::{ClassifierKind, ClassifierParams};
                match self.classifier {
                    ClassifierKind::Forest => ClassifierParams::Forest(self.forest.clone()),
                    ClassifierKind::Boosting => ClassifierParams::Boosting(self.boosting.clone()),
                    ClassifierKind::Bagging => ClassifierParams::Bagging(self.bagging.clone()),
                    ClassifierKind::Linear => ClassifierParams::Linear(self.linear.clone()),
                }
            }

            /// The same recipe with another classifier.
            #[must_use]
            pub fn with_classifier(mut self, params: crate::classification::ClassifierParams) -> Self {
                use crate::classification::ClassifierParams;
                self.classifier = params.kind();
                match params {
                    ClassifierParams::Forest(params) => self.forest = params,
                    ClassifierParams::Boosting(params) => self.boosting = params,
                    ClassifierParams::Bagging(params) => self.bagging = params,
                    ClassifierParams::Linear(params) => self.linear = params,
                }
                self
            }

            fn validate_classifiers(&self) -> crate::error::Result<()> {
                self.forest.validate()?;
                self.boosting.validate()?;
                self.bagging.validate()?;
                self.linear.validate()
            }
        }
    };
}

pub(in crate::recipes) use offers_classifiers;
