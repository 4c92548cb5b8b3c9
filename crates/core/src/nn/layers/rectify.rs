//! Rectification.

use crate::nn::scalar::Scalar;
use rayon::prelude::*;

/// Values below 0 become 0.
pub fn rectify<T: Scalar>(values: &mut [T]) {
    values.iter_mut().for_each(|v| *v = if *v > T::ZERO { *v } else { T::ZERO });
}

/// The gradient with respect to values before they were rectified.
pub fn stop_below<T: Scalar>(gradient: &mut [T], rectified: &[T]) {
    gradient.par_iter_mut().zip(rectified).for_each(|(g, v)| *g = if *v > T::ZERO { *g } else { T::ZERO });
}
