//! Dropout (N. Srivastava et al., *Dropout: a simple way to prevent neural networks from overfitting*, JMLR 2014).

use crate::error::{Error, Result};
use crate::nn::scalar::Scalar;
use crate::random::Stream;

/// Which values were dropped, and the factor of the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Dropped<T> {
    factors: Vec<T>,
}

impl<T: Scalar> Dropped<T> {
    /// Replaces each value by 0 with probability `rate`; the others are divided by 1 - `rate`, so that the mean stays.
    ///
    /// # Errors
    /// If the rate is below 0, or 1 or more.
    pub fn apply(values: &mut [T], rate: f64, draws: &mut Stream) -> Result<Self> {
        if !(0.0..1.0).contains(&rate) {
            return Err(Error::parameter("dropout", rate, "0 to below 1"));
        }
        let kept = T::of(1.0 / (1.0 - rate));
        let factors: Vec<T> = values.iter().map(|_| if draws.uniform() < rate { T::ZERO } else { kept }).collect();
        let dropped = Self { factors };
        dropped.scale(values);
        Ok(dropped)
    }

    /// The gradient with respect to the values, given that with respect to what was kept, in place.
    pub fn scale(&self, gradient: &mut [T]) {
        gradient.iter_mut().zip(&self.factors).for_each(|(g, &factor)| *g = *g * factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn the_share_is_dropped_the_mean_stays_and_gradients_follow() {
        let mut values = vec![1.0f64; 20_000];
        let dropped = Dropped::apply(&mut values, 0.25, &mut stream(3, 0)).unwrap();
        let zeros = values.iter().filter(|v| **v == 0.0).count();
        assert!((zeros as f64 / 20_000.0 - 0.25).abs() < 0.01);
        assert!((values.iter().sum::<f64>() / 20_000.0 - 1.0).abs() < 0.02);
        let mut gradient = vec![2.0; 20_000];
        dropped.scale(&mut gradient);
        assert!(gradient.iter().zip(&values).all(|(g, v)| (g - 2.0 * v).abs() < 1e-12));
        let mut same = vec![3.0];
        Dropped::apply(&mut same, 0.0, &mut stream(3, 0)).unwrap();
        assert_eq!(same, [3.0]);
        assert!(Dropped::apply(&mut same, 1.0, &mut stream(3, 0)).is_err());
    }
}
