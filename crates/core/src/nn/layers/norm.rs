//! Batch normalisation of channels (S. Ioffe, C. Szegedy, *Batch normalization*, ICML 2015), with the rectified linear unit
//! that follows it.

use super::BLOCK;
use crate::nn::scalar::Scalar;
use crate::parallel::fold_ordered;
use rayon::prelude::*;

/// Mean and variance (divisor: the number of rows) of each channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments<T> {
    /// Means.
    pub mean: Vec<T>,
    /// Variances.
    pub variance: Vec<T>,
}

/// Normalisation of each channel to mean `shift` and standard deviation `scale`.
#[derive(Clone, Copy, Debug)]
pub struct BatchNorm<'a, T> {
    /// Factor of each channel.
    pub scale: &'a [T],
    /// Term of each channel.
    pub shift: &'a [T],
    /// Added to the variance, so that a constant channel is not divided by 0.
    pub epsilon: T,
}

/// Gradients of a loss.
#[derive(Clone, Debug, PartialEq)]
pub struct NormGradient<T> {
    /// With respect to the values.
    pub values: Vec<T>,
    /// With respect to the factors.
    pub scale: Vec<T>,
    /// With respect to the terms.
    pub shift: Vec<T>,
}

impl<T: Scalar> Moments<T> {
    /// The moments of rows of `channels` values, summed in `f64` in a fixed order.
    pub fn of(values: &[T], channels: usize) -> Self {
        let rows = values.len() / channels.max(1);
        let count = rows.max(1) as f64;
        let mean: Vec<f64> = sums(rows, channels, |row, sum| {
            let own = &values[row * channels..][..channels];
            own.iter().zip(sum).for_each(|(v, s)| *s += v.wide());
        })
        .into_iter()
        .map(|sum| sum / count)
        .collect();
        let variance = sums(rows, channels, |row, sum| {
            let own = values[row * channels..][..channels].iter().zip(&mean);
            own.zip(sum).for_each(|((v, m), s)| *s += (v.wide() - m) * (v.wide() - m));
        });
        let variance = variance.into_iter().map(|sum| T::of(sum / count)).collect();
        Self { mean: mean.into_iter().map(T::of).collect(), variance }
    }
}

/// Sums of `width` numbers over all rows, in a fixed order.
fn sums(rows: usize, width: usize, add: impl Fn(usize, &mut [f64]) + Sync) -> Vec<f64> {
    let part = |range: std::ops::Range<usize>| {
        let mut sum = vec![0.0; width];
        range.for_each(|row| add(row, &mut sum));
        sum
    };
    let join = |mut sum: Vec<f64>, part: Vec<f64>| {
        sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        sum
    };
    fold_ordered(rows, BLOCK, part, join).unwrap_or_else(|| vec![0.0; width])
}

impl<T: Scalar> BatchNorm<'_, T> {
    /// One over the standard deviation of each channel.
    fn inverse(&self, moments: &Moments<T>) -> Vec<T> {
        moments.variance.iter().map(|&v| T::ONE / (v + self.epsilon).root()).collect()
    }

    /// Normalises rows in place; then adds `beside` (as long as `values`, or empty), then replaces negative values by 0 if
    /// `rectify`.
    pub fn forward(&self, values: &mut [T], moments: &Moments<T>, beside: &[T], rectify: bool) {
        let channels = self.scale.len();
        let factors: Vec<T> = self.inverse(moments).iter().zip(self.scale).map(|(&i, &s)| i * s).collect();
        let terms: Vec<T> = moments.mean.iter().zip(&factors).zip(self.shift).map(|((&m, &f), &s)| s - m * f).collect();
        let size = (BLOCK * channels).max(1);
        values.par_chunks_mut(size).enumerate().for_each(|(block, values)| {
            for row in values.chunks_exact_mut(channels) {
                row.iter_mut().zip(&factors).zip(&terms).for_each(|((v, &f), &t)| *v = v.mul_add(f, t));
            }
            let beside = beside.get(block * size..).unwrap_or_default();
            values.iter_mut().zip(beside).for_each(|(v, &b)| *v += b);
            if rectify {
                values.iter_mut().for_each(|v| *v = if *v > T::ZERO { *v } else { T::ZERO });
            }
        });
    }

    /// The gradients, given the values before normalisation, their own moments, and the gradient with respect to the
    /// normalised values, whose memory that of the values takes.
    pub fn backward(&self, values: &[T], moments: &Moments<T>, gradient: Vec<T>) -> NormGradient<T> {
        let channels = self.scale.len();
        let rows = values.len() / channels.max(1);
        let inverse = self.inverse(moments);
        let normal = |row: usize, c: usize| (values[row * channels + c] - moments.mean[c]) * inverse[c];
        let both = sums(rows, 2 * channels, |row, sum| {
            for c in 0..channels {
                let g = gradient[row * channels + c];
                sum[c] += g.wide();
                sum[channels + c] += (g * normal(row, c)).wide();
            }
        });
        let count = rows.max(1) as f64;
        let mean: Vec<T> = both.iter().map(|sum| T::of(sum / count)).collect();
        let mut found = gradient;
        found.par_chunks_mut((BLOCK * channels).max(1)).enumerate().for_each(|(block, found)| {
            for (row, found) in (block * BLOCK..).zip(found.chunks_exact_mut(channels)) {
                for c in 0..channels {
                    let centred = found[c] - mean[c] - normal(row, c) * mean[channels + c];
                    found[c] = self.scale[c] * inverse[c] * centred;
                }
            }
        });
        let (shift, scale) = both.split_at(channels);
        let cast = |sums: &[f64]| sums.iter().map(|&s| T::of(s)).collect();
        NormGradient { values: found, scale: cast(scale), shift: cast(shift) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{differences, numbers, relative_error};

    const CHANNELS: usize = 5;

    #[test]
    fn normalised_channels_have_the_moments_that_are_asked_for() {
        let mut values = numbers(1, 3000 * CHANNELS);
        let moments = Moments::of(&values, CHANNELS);
        let scale = [2.0, 1.0, 0.5, 3.0, 1.0];
        let shift = [1.0, 0.0, -1.0, 0.5, 2.0];
        BatchNorm { scale: &scale, shift: &shift, epsilon: 0.0 }.forward(&mut values, &moments, &[], false);
        let found = Moments::of(&values, CHANNELS);
        for c in 0..CHANNELS {
            assert!((found.mean[c] - shift[c]).abs() < 1e-12 && (found.variance[c].sqrt() - scale[c]).abs() < 1e-12);
        }
        // A constant channel becomes its shift.
        let mut flat = vec![7.0; 10];
        let moments = Moments::of(&flat, 1);
        BatchNorm { scale: &[1.0], shift: &[3.0], epsilon: 1e-5 }.forward(&mut flat, &moments, &[], true);
        assert_eq!(flat, [3.0; 10]);
    }

    #[test]
    fn gradients_are_those_of_finite_differences() {
        let rows = 40;
        let (values, towards) = (numbers(1, rows * CHANNELS), numbers(2, rows * CHANNELS));
        let (scale, shift) = (numbers(3, CHANNELS), numbers(4, CHANNELS));
        let of = |values: &[f64], scale: &[f64], shift: &[f64]| -> f64 {
            let mut out = values.to_vec();
            BatchNorm { scale, shift, epsilon: 1e-3 }.forward(&mut out, &Moments::of(values, CHANNELS), &[], false);
            out.iter().zip(&towards).map(|(o, t)| o * t).sum()
        };
        let norm = BatchNorm { scale: &scale, shift: &shift, epsilon: 1e-3 };
        let found = norm.backward(&values, &Moments::of(&values, CHANNELS), towards.clone());
        assert!(relative_error(&found.values, &differences(&values, 100, |v| of(v, &scale, &shift))) < 1e-6);
        assert!(relative_error(&found.scale, &differences(&scale, 9, |s| of(&values, s, &shift))) < 1e-6);
        assert!(relative_error(&found.shift, &differences(&shift, 9, |s| of(&values, &scale, s))) < 1e-6);
    }
}
