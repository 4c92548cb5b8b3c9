//! What the tests of several layers use.

use crate::random::stream;

/// Numbers between −1 and 1.
pub(crate) fn numbers(seed: u64, count: usize) -> Vec<f64> {
    let mut s = stream(seed, 0);
    (0..count).map(|_| 2.0 * s.uniform() - 1.0).collect()
}

/// A derivative by central differences, with the place of its variable.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Difference {
    place: usize,
    slope: f64,
}

/// Derivatives of `of` with respect to at most `count` of the values, evenly spread.
pub(crate) fn differences(values: &[f64], count: usize, of: impl Fn(&[f64]) -> f64) -> Vec<Difference> {
    let step = 1e-5;
    let mut moved = values.to_vec();
    (0..values.len())
        .step_by((values.len() / count).max(1))
        .map(|place| {
            let mut at = |value: f64| {
                moved[place] = value;
                of(&moved)
            };
            let slope = (at(values[place] + step) - at(values[place] - step)) / (2.0 * step);
            moved[place] = values[place];
            Difference { place, slope }
        })
        .collect()
}

/// Largest difference between a gradient and its finite differences, relative to the largest of them.
pub(crate) fn relative_error(gradient: &[f64], differences: &[Difference]) -> f64 {
    let size = differences.iter().map(|d| d.slope.abs()).fold(1e-9, f64::max);
    differences.iter().map(|d| (gradient[d.place] - d.slope).abs() / size).fold(0.0, f64::max)
}
