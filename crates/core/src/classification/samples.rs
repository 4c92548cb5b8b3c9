//! Training samples: features, class and weight.

use crate::error::{Error, Result};

/// Labelled samples, borrowed. Row `i` is `features[i * width..(i + 1) * width]`.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Row-major feature values; NaN means missing and always goes left in a forest.
    pub features: &'a [f32],
    /// Number of features, 1..=65534.
    pub width: usize,
    /// Class of every row, `0..classes`.
    pub labels: &'a [u16],
    /// Weight of every row, finite and not negative; rows of weight 0 are ignored.
    pub weights: Option<&'a [f32]>,
    /// Number of classes, 1..=65535; a class without any row is allowed and gets probability 0.
    pub classes: usize,
}

impl Samples<'_> {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// True if there is no row.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Features of row `i`.
    pub fn row(&self, i: usize) -> &[f32] {
        &self.features[i * self.width..(i + 1) * self.width]
    }

    /// Weight of row `i`; 1 if no weights are given.
    pub fn weight(&self, i: usize) -> f64 {
        self.weights.map_or(1.0, |w| f64::from(w[i]))
    }

    /// Rows of positive weight, ascending.
    pub fn active(&self) -> Vec<u32> {
        (0..self.len()).filter(|&i| self.weight(i) > 0.0).map(|i| i as u32).collect()
    }

    /// Checks that the parts fit together.
    ///
    /// # Errors
    /// If lengths do not fit, a label is not below `classes`, a weight is negative or not finite, no row has positive
    /// weight, or there are more than 2^31 rows.
    pub fn check(&self) -> Result<()> {
        self.check_shape()?;
        if let Some(label) = self.labels.iter().find(|&&l| usize::from(l) >= self.classes) {
            return Err(Error::input(format!("label {label} is not below the number of classes {}", self.classes)));
        }
        if let Some(weights) = self.weights {
            if weights.len() != self.len() {
                return Err(Error::input(format!("{} weights for {} samples", weights.len(), self.len())));
            }
            if let Some(w) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
                return Err(Error::input(format!("sample weight {w} is not a finite number from 0 up")));
            }
        }
        match (0..self.len()).any(|i| self.weight(i) > 0.0) {
            true => Ok(()),
            false => Err(Error::input("there is no sample of positive weight to learn from")),
        }
    }

    fn check_shape(&self) -> Result<()> {
        if !(1..=65_534).contains(&self.width) {
            return Err(Error::input(format!("{} features a sample; 1 to 65534 are allowed", self.width)));
        }
        if !(1..=65_535).contains(&self.classes) {
            return Err(Error::input(format!("{} classes; 1 to 65535 are allowed", self.classes)));
        }
        if self.labels.len() > 1 << 31 {
            return Err(Error::input(format!("{} samples; at most 2^31 are allowed", self.labels.len())));
        }
        if self.features.len() != self.labels.len() * self.width {
            return Err(Error::input(format!(
                "{} feature values for {} samples of {} features",
                self.features.len(),
                self.labels.len(),
                self.width
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let good = Samples { features: &[1.0, 2.0], width: 1, labels: &[0, 1], weights: None, classes: 2 };
        good.check().unwrap();
        assert!(Samples { width: 2, ..good }.check().is_err());
        assert!(Samples { classes: 1, ..good }.check().is_err());
        assert!(Samples { width: 0, ..good }.check().is_err());
        assert!(Samples { weights: Some(&[1.0]), ..good }.check().is_err());
        assert!(Samples { weights: Some(&[1.0, f32::NAN]), ..good }.check().is_err());
        assert!(Samples { weights: Some(&[0.0, 0.0]), ..good }.check().is_err());
        assert_eq!(Samples { weights: Some(&[0.0, 2.0]), ..good }.active(), [1]);
    }
}
