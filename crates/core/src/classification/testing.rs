//! Samples for tests.

use super::samples::Samples;
use crate::random::stream;

/// Samples that own their values.
pub(crate) struct Owned {
    pub(crate) features: Vec<f32>,
    pub(crate) labels: Vec<u16>,
    pub(crate) width: usize,
    pub(crate) classes: usize,
}

impl Owned {
    pub(crate) fn samples(&self) -> Samples<'_> {
        Samples {
            features: &self.features,
            width: self.width,
            labels: &self.labels,
            weights: None,
            classes: self.classes,
        }
    }
}

/// Gaussian clusters, one a class; half of the features are noise. Values are multiples of `step` (0: any).
pub(crate) fn blobs(count: usize, width: usize, classes: usize, step: f32) -> Owned {
    let mut random = stream(11, 0);
    let mut owned = Owned { features: Vec::new(), labels: Vec::new(), width, classes };
    for _ in 0..count {
        let label = random.below(classes);
        owned.labels.push(label as u16);
        for f in 0..width {
            let noise: f64 = (0..6).map(|_| random.uniform() - 0.5).sum();
            let centre = if f % 2 == 0 { ((label * (f + 3)) % 7) as f64 * 0.4 } else { 0.0 };
            let value = (centre + noise) as f32;
            owned.features.push(if step > 0.0 { (value / step).round() * step } else { value });
        }
    }
    owned
}
