//! The interface of classifiers: parameters that learn from samples ([`Learner`]), and the trained result, which
//! predicts ([`Predictor`]).
//!
//! A new classifier needs a folder with its [`Learner`] and [`Predictor`], one line in the list of `classifier.rs`, and a
//! section of parameters in the recipes that offer it.

use super::arrays::{Array, Reader};
use super::samples::Samples;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use std::fmt::Debug;

/// A kind of classifier before training. The value is its parameters.
pub trait Learner: Clone + Debug + Default + PartialEq {
    /// What training gives.
    type Trained: Predictor;

    /// Seed of all random draws; `None` if there are none.
    fn seed(&mut self) -> Option<&mut u64>;

    /// Limit of the depth of its trees; `None` if it has no trees.
    fn max_depth(&mut self) -> Option<&mut Option<usize>>;

    /// Trains a classifier. The result is the same bytes for any number of threads.
    ///
    /// # Errors
    /// If samples are inconsistent, a parameter is out of range, or the work was cancelled.
    fn train(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<Self::Trained>;

    /// As [`Learner::train`]; also returns the out-of-bag accuracy if there is one.
    ///
    /// # Errors
    /// As [`Learner::train`].
    fn train_with_score(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<(Self::Trained, Option<f64>)> {
        self.train(samples, monitor).map(|trained| (trained, None))
    }
}

/// A trained classifier: class probabilities for rows of features.
pub trait Predictor: Sized + Send + Sync {
    /// Scratch memory of [`Predictor::predict_block`], to be reused for the next block.
    type Scratch: Default + Send;

    /// Number of classes.
    fn classes(&self) -> usize;

    /// Number of features of a row.
    fn width(&self) -> usize;

    /// What it consists of, for instance trees and nodes.
    fn parts(&self) -> Vec<PartCount>;

    /// Share of each feature in what training gained; sums to 1, or all 0 if nothing was learned.
    fn importance(&self) -> &[f64];

    /// Removes the features that have no influence; also returns the features kept, at least one. Predictions do not
    /// change.
    fn retain_used(self) -> (Self, Vec<usize>);

    /// Class probabilities of `rows` (row-major, [`Predictor::width`] values a row), written row-major to `out`
    /// ([`Predictor::classes`] values a row). Runs on the calling thread; for callers that parallelise over blocks.
    ///
    /// # Errors
    /// If a length does not fit.
    fn predict_block(&self, rows: &[f32], scratch: &mut Self::Scratch, out: &mut [f32]) -> Result<()>;

    /// As [`Predictor::predict_block`], in parallel over blocks.
    ///
    /// # Errors
    /// If a length does not fit.
    fn predict_proba(&self, rows: &[f32], out: &mut [f32]) -> Result<()>;

    /// The most probable class of every row; the smaller class in a tie.
    ///
    /// # Errors
    /// If the length does not fit.
    fn predict(&self, rows: &[f32]) -> Result<Vec<u16>> {
        let mut out = vec![0.0; rows.len() / self.width().max(1) * self.classes()];
        self.predict_proba(rows, &mut out)?;
        Ok(out.chunks_exact(self.classes().max(1)).map(|row| argmax(row) as u16).collect())
    }
}

/// Number of parts of one kind that a classifier consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartCount {
    /// The kind, in the plural: `trees`, `nodes`.
    pub kind: &'static str,
    /// How many.
    pub count: usize,
}

/// A classifier that a model file can hold.
pub(crate) trait Stored: Predictor {
    /// What its bytes begin with when it stands alone.
    const TITLE: &'static str;

    /// Its arrays, each name once.
    fn arrays(&self) -> Vec<Array>;

    /// The classifier of `width` features and `classes` classes in these arrays, every index checked.
    fn from_arrays(reader: &Reader<'_>, width: usize, classes: usize) -> Result<Self>;
}

/// Fails unless `rows` and `out` are whole rows for this classifier, equally many.
pub(super) fn check_lengths(predictor: &impl Predictor, rows: &[f32], out: &[f32]) -> Result<()> {
    let (width, classes) = (predictor.width(), predictor.classes());
    let count = rows.len() / width.max(1);
    if count * width == rows.len() && count * classes == out.len() {
        return Ok(());
    }
    Err(Error::ModelMismatch(format!(
        "{} feature values and {} probabilities do not make whole rows of {width} features and {classes} classes",
        rows.len(),
        out.len()
    )))
}

/// Index of the largest value, the first of equal ones.
pub(crate) fn argmax(row: &[f32]) -> usize {
    (1..row.len()).fold(0, |best, c| if row[c] > row[best] { c } else { best })
}
