//! Batch normalisation of channels (S. Ioffe, C. Szegedy, *Batch normalization*, ICML 2015), with the rectified linear unit
//! that follows it.

use super::BLOCK;
use crate::nn::scalar::Scalar;
use crate::parallel::fold_ordered;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

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
        let of = |rows: Range<usize>| &values[rows.start * channels..rows.end * channels];
        let sum = sums(rows, channels, |rows, sum| Arch::new().dispatch(Sum { values: of(rows), sum }));
        let mean: Vec<f64> = sum.into_iter().map(|sum| sum / count).collect();
        let squares = |rows, sum: &mut [f64]| Arch::new().dispatch(Squares { values: of(rows), mean: &mean, sum });
        let variance = sums(rows, channels, squares).into_iter().map(|sum| T::of(sum / count)).collect();
        Self { mean: mean.into_iter().map(T::of).collect(), variance }
    }
}

/// Sums of `width` numbers over all rows, in a fixed order; `add` adds those of some rows.
fn sums(rows: usize, width: usize, add: impl Fn(Range<usize>, &mut [f64]) + Sync) -> Vec<f64> {
    let part = |range: Range<usize>| {
        let mut sum = vec![0.0; width];
        add(range, &mut sum);
        sum
    };
    let join = |mut sum: Vec<f64>, part: Vec<f64>| {
        sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        sum
    };
    fold_ordered(rows, BLOCK, part, join).unwrap_or_else(|| vec![0.0; width])
}

/// Adds each channel of rows.
struct Sum<'a, T> {
    values: &'a [T],
    sum: &'a mut [f64],
}

impl<T: Scalar> WithSimd for Sum<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for row in self.values.chunks_exact(self.sum.len()) {
            for (sum, v) in self.sum.iter_mut().zip(row) {
                *sum += v.wide();
            }
        }
    }
}

/// Adds the squared differences of each channel from its mean.
struct Squares<'a, T> {
    values: &'a [T],
    mean: &'a [f64],
    sum: &'a mut [f64],
}

impl<T: Scalar> WithSimd for Squares<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for row in self.values.chunks_exact(self.sum.len()) {
            for ((sum, v), mean) in self.sum.iter_mut().zip(row).zip(self.mean) {
                let difference = v.wide() - mean;
                *sum += difference * difference;
            }
        }
    }
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
        let (factors, terms) = (&factors[..], &terms[..]);
        values.par_chunks_mut(size).enumerate().for_each(|(block, values)| {
            let beside = beside.get(block * size..).unwrap_or_default();
            Arch::new().dispatch(Normalise { factors, terms, beside, rectify, values });
        });
    }

    /// The gradients, given the values before normalisation, their own moments, and the gradient with respect to the
    /// normalised values, whose memory that of the values takes.
    pub fn backward(&self, values: &[T], moments: &Moments<T>, gradient: Vec<T>) -> NormGradient<T> {
        let channels = self.scale.len();
        let rows = values.len() / channels.max(1);
        let inverse = self.inverse(moments);
        let normal = Normal { values, mean: &moments.mean, inverse: &inverse };
        let both = sums(rows, 2 * channels, |rows, sum| {
            let (gradient, normal) = (&gradient[rows.start * channels..rows.end * channels], normal.rows(rows));
            Arch::new().dispatch(GradientSums { normal, gradient, sum });
        });
        let count = rows.max(1) as f64;
        let mean: Vec<T> = both.iter().map(|sum| T::of(sum / count)).collect();
        let factors: Vec<T> = self.scale.iter().zip(&inverse).map(|(&s, &i)| s * i).collect();
        let mut found = gradient;
        found.par_chunks_mut((BLOCK * channels).max(1)).enumerate().for_each(|(block, gradient)| {
            let rows = block * BLOCK..block * BLOCK + gradient.len() / channels;
            Arch::new().dispatch(Centre { normal: normal.rows(rows), factors: &factors, mean: &mean, gradient });
        });
        let (shift, scale) = both.split_at(channels);
        let cast = |sums: &[f64]| sums.iter().map(|&s| T::of(s)).collect();
        NormGradient { values: found, scale: cast(scale), shift: cast(shift) }
    }
}

/// Values times factors, plus terms, plus what stands beside; then rectified.
struct Normalise<'a, T> {
    factors: &'a [T],
    terms: &'a [T],
    beside: &'a [T],
    rectify: bool,
    values: &'a mut [T],
}

impl<T: Scalar> WithSimd for Normalise<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for row in self.values.chunks_exact_mut(self.factors.len()) {
            for ((v, &factor), &term) in row.iter_mut().zip(self.factors).zip(self.terms) {
                *v = v.mul_add(factor, term);
            }
        }
        for (v, &beside) in self.values.iter_mut().zip(self.beside) {
            *v += beside;
        }
        if self.rectify {
            for v in self.values {
                *v = if *v > T::ZERO { *v } else { T::ZERO };
            }
        }
    }
}

/// Rows that are to be normalised by channel, before scale and shift.
#[derive(Clone, Copy)]
struct Normal<'a, T> {
    values: &'a [T],
    mean: &'a [T],
    inverse: &'a [T],
}

impl<T: Scalar> Normal<'_, T> {
    /// Some of them.
    fn rows(&self, rows: Range<usize>) -> Self {
        let channels = self.mean.len();
        Self { values: &self.values[rows.start * channels..rows.end * channels], ..*self }
    }
}

/// Sums of the gradient of each channel, and of its products with the normalised values.
struct GradientSums<'a, T> {
    normal: Normal<'a, T>,
    gradient: &'a [T],
    sum: &'a mut [f64],
}

impl<T: Scalar> WithSimd for GradientSums<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Normal { values, mean, inverse } = self.normal;
        let channels = mean.len();
        let (shift, scale) = self.sum.split_at_mut(channels);
        for (row, gradient) in values.chunks_exact(channels).zip(self.gradient.chunks_exact(channels)) {
            for c in 0..channels {
                let g = gradient[c];
                shift[c] += g.wide();
                scale[c] += (g * ((row[c] - mean[c]) * inverse[c])).wide();
            }
        }
    }
}

/// Takes from the gradient what the moments of the batch make up for.
struct Centre<'a, T> {
    normal: Normal<'a, T>,
    factors: &'a [T],
    /// Means of the gradient, then of its products with the normalised values.
    mean: &'a [T],
    gradient: &'a mut [T],
}

impl<T: Scalar> WithSimd for Centre<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Normal { values, mean, inverse } = self.normal;
        let channels = mean.len();
        let (shift, scale) = self.mean.split_at(channels);
        let factors = &self.factors[..channels];
        for (row, gradient) in values.chunks_exact(channels).zip(self.gradient.chunks_exact_mut(channels)) {
            for c in 0..channels {
                let normal = (row[c] - mean[c]) * inverse[c];
                gradient[c] = factors[c] * (gradient[c] - shift[c] - normal * scale[c]);
            }
        }
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
