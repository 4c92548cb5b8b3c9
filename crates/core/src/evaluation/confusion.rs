//! The confusion matrix: counts by true and predicted class.

use crate::classes::{Class, ClassTable};
use crate::cloud::{ClassNames, CodeScheme};
use crate::error::{Error, Result};

/// Counts of points by true and predicted class. Row = truth, column = prediction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Confusion {
    classes: ClassTable,
    counts: Vec<u64>,
    skipped: u64,
    /// Codes of the classes that means run over; `None`: those of the truth.
    means: Option<Vec<u8>>,
    /// Code of the points that the prediction leaves open, if there are any.
    open: Option<u8>,
}

/// Name of the class of points that the prediction leaves open.
const OPEN: &str = "no prediction";

impl Confusion {
    /// An empty matrix over these classes.
    pub fn new(classes: ClassTable) -> Self {
        let n = classes.len();
        Self { classes, counts: vec![0; n * n], skipped: 0, means: None, open: None }
    }

    /// Compares codes point by point. Points without a true label (`None`) are skipped and counted as such. The classes
    /// are all codes that occur in the truth, or in the prediction of a point with a true label.
    ///
    /// # Errors
    /// If truth and prediction differ in length.
    pub fn from_options(truth: &[Option<u8>], predicted: &[u8]) -> Result<Self> {
        if truth.len() != predicted.len() {
            return Err(Error::input(format!("{} true labels for {} predicted ones", truth.len(), predicted.len())));
        }
        let mut pairs = vec![0u64; 256 * 256];
        let mut skipped = 0;
        for (t, &p) in truth.iter().zip(predicted) {
            match t {
                Some(t) => pairs[usize::from(*t) * 256 + usize::from(p)] += 1,
                None => skipped += 1,
            }
        }
        let occurs = |&c: &u8| (0..256).any(|o| pairs[usize::from(c) * 256 + o] + pairs[o * 256 + usize::from(c)] > 0);
        let codes: Vec<u8> = (0..=255).filter(occurs).collect();
        let counts = codes.iter().flat_map(|&t| codes.iter().map(move |&p| usize::from(t) * 256 + usize::from(p)));
        let counts = counts.map(|at| pairs[at]).collect();
        Ok(Self { classes: ClassTable::from_codes(&codes), counts, skipped, means: None, open: None })
    }

    /// Like [`Confusion::from_options`], with the codes that mean "no label" given.
    ///
    /// # Errors
    /// As [`Confusion::from_options`].
    pub fn from_labels(truth: &[u8], predicted: &[u8], unlabelled: &[u8]) -> Result<Self> {
        let truth: Vec<Option<u8>> = truth.iter().map(|t| Some(*t).filter(|t| !unlabelled.contains(t))).collect();
        Self::from_options(&truth, predicted)
    }

    /// Like [`Confusion::from_options`], for predictions that may be missing: such a point counts as wrong, under a
    /// code that occurs on neither side (0 if it is unused).
    ///
    /// # Errors
    /// If truth and prediction differ in length, or use all 256 codes.
    pub fn from_partial(truth: &[Option<u8>], predicted: &[Option<u8>]) -> Result<Self> {
        let mut seen = [false; 256];
        truth.iter().chain(predicted).flatten().for_each(|&code| seen[usize::from(code)] = true);
        let free = std::iter::once(0u8).chain((1..=255).rev()).find(|&code| !seen[usize::from(code)]);
        let open = match (predicted.iter().any(Option::is_none), free) {
            (false, _) => None,
            (true, Some(free)) => Some(free),
            (true, None) => return Err(Error::input("no code is left for the points that the prediction leaves open")),
        };
        let filled: Vec<u8> = predicted.iter().map(|p| p.unwrap_or(open.unwrap_or_default())).collect();
        Ok(Self { open, ..Self::from_options(truth, &filled)? }.called(|class| class.name))
    }

    /// The same matrix with the class names of a code scheme, and names of their own.
    #[must_use]
    pub fn named(self, scheme: CodeScheme, own: &ClassNames) -> Self {
        let codes = self.classes.codes();
        Self { classes: ClassTable::named(&codes, scheme, own), ..self }.called(|class| class.name)
    }

    /// The same matrix, whose means run over these classes instead of those that occur in the truth.
    #[must_use]
    pub fn with_means_over(self, codes: &[u8]) -> Self {
        Self { means: Some(codes.to_vec()), ..self }
    }

    /// Whether means run over the class of this number; classes that occur on neither side are left out.
    pub(super) fn is_in_means(&self, class: usize) -> bool {
        let (support, code) = (self.support(class), self.classes.classes()[class].code);
        match &self.means {
            None => support > 0,
            Some(codes) => codes.contains(&code) && support + self.predicted(class) > 0,
        }
    }

    /// The same matrix with other class names, except that of points which the prediction leaves open.
    #[must_use]
    pub fn called(self, name: impl Fn(Class) -> String) -> Self {
        let name = |class: Class| if Some(class.code) == self.open { OPEN.into() } else { name(class) };
        let called = self.classes.classes().iter().map(|c| Class { name: name(c.clone()), ..c.clone() });
        let table = ClassTable::new(called.collect());
        Self { classes: table.unwrap_or(self.classes), ..self }
    }

    /// Counts one point.
    ///
    /// # Errors
    /// If a code is not in the table of classes.
    pub fn add(&mut self, truth: u8, predicted: u8) -> Result<()> {
        let place = |code| {
            self.classes.position(code).ok_or_else(|| Error::input(format!("class code {code} is not in the table")))
        };
        let at = place(truth)? * self.classes.len() + place(predicted)?;
        self.counts[at] += 1;
        Ok(())
    }

    /// Adds row-major counts over the same classes, in the same order; counts of another number of classes are ignored.
    pub(crate) fn add_counts(&mut self, counts: &[u64]) {
        if counts.len() == self.counts.len() {
            self.counts.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
    }

    /// The classes of rows and columns.
    pub fn classes(&self) -> &ClassTable {
        &self.classes
    }

    /// Number of points of class `truth` that were predicted as `predicted` (positions in the table).
    pub fn count(&self, truth: usize, predicted: usize) -> u64 {
        self.counts[truth * self.classes.len() + predicted]
    }

    /// Number of points of true class `truth`.
    pub fn support(&self, truth: usize) -> u64 {
        (0..self.classes.len()).map(|p| self.count(truth, p)).sum()
    }

    /// Number of points predicted as `predicted`.
    pub fn predicted(&self, predicted: usize) -> u64 {
        (0..self.classes.len()).map(|t| self.count(t, predicted)).sum()
    }

    /// Number of points compared.
    pub fn points(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Number of points skipped because they have no true label.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// The counts without those of a part of the points, whose classes are the same.
    #[must_use]
    pub(crate) fn without(&self, part: &Self) -> Self {
        let counts = self.counts.iter().zip(&part.counts).map(|(all, part)| all.saturating_sub(*part)).collect();
        Self { counts, ..self.clone() }
    }

    /// The sum of two matrices over the union of their classes.
    pub fn merge(&self, other: &Self) -> Self {
        let codes: Vec<u8> = self.classes.classes().iter().chain(other.classes.classes()).map(|c| c.code).collect();
        let mut sum = Self::new(ClassTable::from_codes(&codes));
        sum.skipped = self.skipped + other.skipped;
        let n = sum.classes.len();
        for part in [self, other] {
            let places: Vec<usize> =
                part.classes.classes().iter().filter_map(|c| sum.classes.position(c.code)).collect();
            for (t, &row) in places.iter().enumerate() {
                places.iter().enumerate().for_each(|(p, &column)| sum.counts[row * n + column] += part.count(t, p));
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_the_truth_and_columns_the_prediction() {
        let c = Confusion::from_labels(&[2, 2, 2, 6, 0], &[2, 6, 6, 2, 5], &[0]).unwrap();
        assert_eq!(c.classes().classes().iter().map(|c| c.code).collect::<Vec<_>>(), [2, 6]);
        assert_eq!([c.count(0, 0), c.count(0, 1), c.count(1, 0), c.count(1, 1)], [1, 2, 1, 0]);
        assert_eq!((c.support(0), c.predicted(0), c.points(), c.skipped()), (3, 2, 4, 1));
        assert!(Confusion::from_labels(&[2], &[], &[]).is_err());
    }

    #[test]
    fn points_that_the_prediction_leaves_open_are_errors_under_a_code_of_their_own() {
        let truth = [Some(0), Some(0), Some(1), None];
        let c = Confusion::from_partial(&truth, &[Some(0), None, Some(1), None]).unwrap();
        assert_eq!(c.classes().classes().iter().map(|c| c.code).collect::<Vec<_>>(), [0, 1, 255]);
        assert_eq!((c.count(0, 0), c.count(0, 2), c.count(1, 1), c.points(), c.skipped()), (1, 1, 1, 3, 1));
        assert_eq!(c.classes().classes()[2].name, "no prediction");
        let usual = Confusion::from_partial(&[Some(2), Some(6)], &[Some(2), None]).unwrap();
        let called = usual.clone().named(CodeScheme::Asprs, &ClassNames::new());
        for confusion in [&usual, &called] {
            assert_eq!(confusion.classes().classes()[0].name, "no prediction");
            assert_eq!((confusion.count(1, 1), confusion.count(2, 0)), (1, 1));
        }
        let complete = Confusion::from_partial(&[Some(2), None], &[Some(2), Some(6)]).unwrap();
        assert_eq!(complete, Confusion::from_options(&[Some(2), None], &[2, 6]).unwrap());
    }

    #[test]
    fn merging_takes_the_union_of_the_classes() {
        let a = Confusion::from_labels(&[2, 6], &[2, 2], &[]).unwrap();
        let b = Confusion::from_labels(&[5, 6, 6], &[6, 6, 2], &[]).unwrap();
        let sum = a.merge(&b);
        let direct = Confusion::from_labels(&[2, 6, 5, 6, 6], &[2, 2, 6, 6, 2], &[]).unwrap();
        assert_eq!(sum, direct);
        let mut added = Confusion::new(direct.classes().clone());
        [(2, 2), (6, 2), (5, 6), (6, 6), (6, 2)].into_iter().for_each(|(t, p)| added.add(t, p).unwrap());
        assert_eq!(added, direct);
        assert!(added.add(9, 2).is_err());
    }
}
