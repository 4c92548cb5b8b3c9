//! How the learning rate changes from step to step.

use serde::{Deserialize, Serialize};

/// A schedule of the learning rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// The same at all steps.
    Constant,
    /// Rises linearly in the first tenth of the steps and falls along a half cosine to 0.
    #[default]
    Cosine,
    /// Falls linearly to 0.
    Linear,
}

impl Schedule {
    /// Factor of the highest rate at a step of `steps`, 0..1.
    pub fn factor(self, step: u64, steps: u64) -> f64 {
        let share = (step as f64 + 0.5) / steps.max(1) as f64;
        match self {
            Self::Constant => 1.0,
            Self::Linear => (1.0 - share).max(0.0),
            Self::Cosine if share < 0.1 => share / 0.1,
            Self::Cosine => 0.5 * (1.0 + (std::f64::consts::PI * ((share - 0.1) / 0.9).min(1.0)).cos()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_rise_and_fall() {
        let all: Vec<f64> = (0..100).map(|step| Schedule::Cosine.factor(step, 100)).collect();
        let top = all.iter().position(|&f| f == all.iter().copied().fold(0.0, f64::max)).unwrap();
        assert!((9..=10).contains(&top) && all[0] < 0.1 && all[99] < 0.01);
        assert!(all[..top].is_sorted() && all[top..].iter().rev().is_sorted());
        assert!((Schedule::Linear.factor(0, 10) - 0.95).abs() < 1e-12);
        assert_eq!(Schedule::Constant.factor(99, 100), 1.0);
    }
}
