//! Training: the convex objective is minimised by L-BFGS (J. Nocedal, *Updating quasi-Newton matrices with limited
//! storage*, Mathematics of Computation 1980).

use super::{Linear, LinearParams};
use crate::classification::samples::Samples;
use crate::error::{Error, Result};
use crate::nn::layers::{self, cross_entropy};
use crate::parallel::Monitor;
use std::collections::VecDeque;

/// Steps that L-BFGS remembers.
const MEMORY: usize = 10;
/// Halvings of a step before the search ends.
const HALVINGS: usize = 30;

/// The loss of some weights and terms, and its gradient with respect to both.
struct Loss {
    value: f64,
    gradient: Vec<f64>,
}

/// The samples as the objective takes them.
struct Problem<'a> {
    /// Standardised features, row-major.
    rows: Vec<f64>,
    /// Weight of each class, row-major.
    targets: Vec<f64>,
    classes: usize,
    /// Factor of half the sum of squares of the weights.
    penalty: f64,
    monitor: &'a Monitor,
}

/// Mean and standard deviation of each feature.
struct Standard {
    mean: Vec<f64>,
    deviation: Vec<f64>,
}

impl Standard {
    /// Of the values that are not missing; a constant feature has deviation 1.
    fn of(samples: &Samples<'_>) -> Self {
        let moments = |feature: usize| {
            let known = || {
                (0..samples.len()).filter_map(move |i| {
                    let value = f64::from(samples.row(i)[feature]);
                    (!value.is_nan()).then_some([samples.weight(i), value])
                })
            };
            let weight: f64 = known().map(|[w, _]| w).sum::<f64>().max(f64::MIN_POSITIVE);
            let mean = known().map(|[w, v]| w * v).sum::<f64>() / weight;
            let variance = known().map(|[w, v]| w * (v - mean) * (v - mean)).sum::<f64>() / weight;
            [mean, if variance > 0.0 { variance.sqrt() } else { 1.0 }]
        };
        let all: Vec<[f64; 2]> = (0..samples.width).map(moments).collect();
        Self { mean: all.iter().map(|m| m[0]).collect(), deviation: all.iter().map(|m| m[1]).collect() }
    }
}

impl Problem<'_> {
    /// Mean cross-entropy plus penalty; `at` holds the weights and then the terms.
    fn loss(&self, at: &[f64]) -> Result<Loss> {
        let (weights, bias) = at.split_at(at.len() - self.classes);
        let layer = layers::Linear { weights, bias };
        let scores = layer.forward(&self.rows, self.monitor)?;
        let loss = cross_entropy(&scores, &self.targets, self.classes);
        let mut gradient = layer.backward(&self.rows, &loss.gradient, self.monitor)?;
        gradient.weights.iter_mut().zip(weights).for_each(|(g, w)| *g += self.penalty * w);
        gradient.weights.append(&mut gradient.bias);
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        Ok(Loss { value: loss.value + 0.5 * self.penalty * squares, gradient: gradient.weights })
    }

    /// The weights and terms of the least loss.
    fn minimum(&self, start: Vec<f64>, params: &LinearParams) -> Result<Vec<f64>> {
        let (mut at, mut here) = (start.clone(), self.loss(&start)?);
        let mut memory: VecDeque<Step> = VecDeque::new();
        for _ in 0..params.iterations {
            self.monitor.advance(1);
            if here.gradient.iter().all(|g| g.abs() <= params.tolerance) {
                break;
            }
            let direction = direction(&here.gradient, &memory);
            let slope = dot(&direction, &here.gradient);
            let first = if memory.is_empty() { 1.0 / dot(&direction, &direction).sqrt().max(1.0) } else { 1.0 };
            let mut found = None;
            for halving in 0..HALVINGS {
                let size = first * 0.5f64.powi(halving as i32);
                let place: Vec<f64> = at.iter().zip(&direction).map(|(a, d)| a + size * d).collect();
                let there = self.loss(&place)?;
                if there.value <= here.value + 1e-4 * size * slope {
                    found = Some((place, there));
                    break;
                }
            }
            let Some((place, there)) = found else { break };
            let step = Step::new(&at, &place, &here.gradient, &there.gradient);
            (at, here) = (place, there);
            if step.product > 0.0 {
                memory.push_back(step);
                memory.drain(..memory.len().saturating_sub(MEMORY));
            }
        }
        Ok(at)
    }
}

/// A step and the change of the gradient along it.
struct Step {
    moved: Vec<f64>,
    turned: Vec<f64>,
    /// Their scalar product.
    product: f64,
}

impl Step {
    fn new(from: &[f64], to: &[f64], gradient: &[f64], new_gradient: &[f64]) -> Self {
        let difference = |a: &[f64], b: &[f64]| -> Vec<f64> { b.iter().zip(a).map(|(b, a)| b - a).collect() };
        let (moved, turned) = (difference(from, to), difference(gradient, new_gradient));
        let product = dot(&moved, &turned);
        Self { moved, turned, product }
    }
}

/// The direction of descent: minus the inverse Hessian, as the memory approximates it, times the gradient.
fn direction(gradient: &[f64], memory: &VecDeque<Step>) -> Vec<f64> {
    let mut at: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut shares = Vec::with_capacity(memory.len());
    for step in memory.iter().rev() {
        let share = dot(&step.moved, &at) / step.product;
        at.iter_mut().zip(&step.turned).for_each(|(a, t)| *a -= share * t);
        shares.push(share);
    }
    if let Some(last) = memory.back() {
        let scale = last.product / dot(&last.turned, &last.turned);
        at.iter_mut().for_each(|a| *a *= scale);
    }
    for (step, share) in memory.iter().zip(shares.into_iter().rev()) {
        let back = share - dot(&step.turned, &at) / step.product;
        at.iter_mut().zip(&step.moved).for_each(|(a, m)| *a += back * m);
    }
    at
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Linear {
    /// Trains on samples. O(iterations x samples x features x classes).
    ///
    /// # Errors
    /// If samples are inconsistent, a parameter is out of range, or the work was cancelled.
    pub fn fit(samples: &Samples<'_>, params: &LinearParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        samples.check()?;
        monitor.stage("train", params.iterations as u64);
        let (width, classes) = (samples.width, samples.classes);
        let standard = Standard::of(samples);
        let active = samples.active();
        let mut rows = Vec::with_capacity(active.len() * width);
        let mut targets = vec![0.0; active.len() * classes];
        for (target, &i) in targets.chunks_exact_mut(classes).zip(&active) {
            let row = samples.row(i as usize).iter().zip(standard.mean.iter().zip(&standard.deviation));
            rows.extend(row.map(|(&v, (m, d))| if v.is_nan() { 0.0 } else { (f64::from(v) - m) / d }));
            target[usize::from(samples.labels[i as usize])] = samples.weight(i as usize);
        }
        let total: f64 = targets.iter().sum();
        let problem = Problem { rows, targets, classes, penalty: 1.0 / (params.c * total), monitor };
        let found = problem.minimum(vec![0.0; (width + 1) * classes], params)?;
        let (weights, bias) = found.split_at(width * classes);
        Ok(Self::of_standardised(weights, bias, &standard))
    }

    /// The classifier of a trained layer: weights (features by classes, row-major), one term a class, and the mean of each
    /// feature.
    ///
    /// # Errors
    /// If the lengths do not fit.
    pub fn of_layer(weights: &[f32], bias: &[f32], means: Vec<f32>) -> Result<Self> {
        let classes = bias.len();
        if classes == 0 || means.is_empty() || weights.len() != means.len() * classes {
            return Err(Error::input(format!(
                "{} weights for {} features and {classes} classes",
                weights.len(),
                means.len()
            )));
        }
        let spread: Vec<f64> =
            weights.chunks_exact(classes).map(|row| row.iter().map(|w| f64::from(w.abs())).sum()).collect();
        let importance = shares(&spread);
        Ok(Self { classes, weights: weights.to_vec(), bias: bias.to_vec(), means, importance })
    }

    /// The classifier of features as they are, from the weights of standardised ones.
    fn of_standardised(weights: &[f64], bias: &[f64], standard: &Standard) -> Self {
        let classes = bias.len();
        let (mut bias, mut raw, mut spread) = (bias.to_vec(), Vec::with_capacity(weights.len()), Vec::new());
        for ((row, &mean), &deviation) in weights.chunks_exact(classes).zip(&standard.mean).zip(&standard.deviation) {
            for (b, w) in bias.iter_mut().zip(row) {
                *b -= mean * w / deviation;
                raw.push((w / deviation) as f32);
            }
            spread.push(row.iter().map(|w| w.abs()).sum::<f64>());
        }
        Self {
            classes,
            weights: raw,
            bias: bias.into_iter().map(|b| b as f32).collect(),
            means: standard.mean.iter().map(|&m| m as f32).collect(),
            importance: shares(&spread),
        }
    }
}

/// Each number divided by their sum; zeros if that is 0.
fn shares(numbers: &[f64]) -> Vec<f64> {
    let total: f64 = numbers.iter().sum();
    numbers.iter().map(|number| if total > 0.0 { number / total } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::learner::Predictor;
    use crate::classification::testing::blobs;

    #[test]
    fn the_gradient_vanishes_at_the_minimum_and_probabilities_match_the_class_shares() {
        let data = blobs(900, 4, 3, 0.4);
        let params = LinearParams { c: 1e6, tolerance: 1e-8, ..LinearParams::default() };
        let found = Linear::fit(&data.samples(), &params, &Monitor::default()).unwrap();
        let mut out = vec![0.0; 900 * 3];
        found.predict_proba(&data.features, &mut out).unwrap();
        // Without penalty the mean probability of a class is its share, and each feature has no residual (the normal
        // equations of the maximum likelihood).
        for class in 0..3 {
            let residual =
                |i: usize| f64::from(out[i * 3 + class]) - f64::from(u8::from(data.labels[i] == class as u16));
            assert!((0..900).map(residual).sum::<f64>().abs() / 900.0 < 1e-4);
            for feature in 0..4 {
                let sum: f64 = (0..900).map(|i| residual(i) * f64::from(data.features[i * 4 + feature])).sum();
                assert!(sum.abs() / 900.0 < 1e-3, "{class} {feature} {sum}");
            }
        }
    }

    #[test]
    fn one_feature_and_two_classes_have_the_logistic_curve_of_the_odds() {
        // 1 of 4 and 3 of 4: log odds -ln 3 and ln 3 at the two places.
        let features = [0.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 2.0];
        let labels = [1, 0, 0, 0, 1, 1, 1, 0];
        let samples = Samples { features: &features, width: 1, labels: &labels, weights: None, classes: 2 };
        let params = LinearParams { c: 1e9, tolerance: 1e-9, ..LinearParams::default() };
        let found = Linear::fit(&samples, &params, &Monitor::default()).unwrap();
        let mut out = [0.0; 6];
        found.predict_proba(&[0.0, 2.0, f32::NAN], &mut out).unwrap();
        assert!((out[1] - 0.25).abs() < 1e-4 && (out[3] - 0.75).abs() < 1e-4, "{out:?}");
        // A missing value counts as the mean.
        assert!((out[5] - 0.5).abs() < 1e-4, "{out:?}");
    }

    /// Made with scikit-learn 1.9.1: `LogisticRegression(C=2, tol=1e-10)` on the standardised features, with the weights.
    #[test]
    fn probabilities_are_those_of_scikit_learn() {
        let features: Vec<f32> = (0..120)
            .flat_map(|i| {
                (0..3).map(move |j| (f64::from(i) * 1.3 + 0.7 * f64::from(j * j)).sin() as f32 * (j + 1) as f32)
            })
            .collect();
        let label = |i: usize| {
            let (a, b) = (f64::from(features[3 * i]), f64::from(features[3 * i + 1]));
            let score = (a + 0.4 * b + 0.8 * (5.1 * i as f64).sin()) * 1.5;
            (score.round_ties_even().clamp(-1.0, 1.0) + 1.0) as u16
        };
        let labels: Vec<u16> = (0..120).map(label).collect();
        let weights: Vec<f32> = (0..120u8).map(|i| 1.0 + f32::from(i % 3)).collect();
        let samples = Samples { features: &features, width: 3, labels: &labels, weights: Some(&weights), classes: 3 };
        let params = LinearParams { c: 2.0, tolerance: 1e-9, ..LinearParams::default() };
        let found = Linear::fit(&samples, &params, &Monitor::default()).unwrap();
        let expected = [
            (0, [0.029269, 0.460541, 0.51019]),
            (17, [0.85058, 0.13571, 0.013711]),
            (63, [0.00666, 0.252065, 0.741275]),
        ];
        for (row, expected) in expected {
            let mut out = [0.0; 3];
            found.predict_proba(samples.row(row), &mut out).unwrap();
            assert!(out.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 2e-5), "{row}: {out:?}");
        }
    }
}
