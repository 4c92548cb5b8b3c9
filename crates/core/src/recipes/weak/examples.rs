//! Selection of the labelled points for training.

use crate::error::{Error, Result};
use crate::random::stream;
use crate::recipes::Labels;
use serde::{Deserialize, Serialize};

/// Parameters of the selection and use of labels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WeakLabels {
    /// Largest number of labels of each class, drawn at random; 0 uses all. The paper has 15 (Oakland) and 25
    /// (Semantic3D).
    pub per_class: usize,
    /// Largest total number of labels, so that training on a completely labelled scan stays fast.
    pub most: usize,
    /// Largest distance, metres, between a picked position and the nearest point of the cloud.
    pub within: f64,
    /// Use a finer partition than its strength gives if its oracle accuracy on the labels is below `fit_accuracy`.
    pub fit_partition: bool,
    /// Oracle accuracy on the labels that is enough for `fit_partition`, 0..=1.
    pub fit_accuracy: f64,
    /// Largest number of strengths that `fit_partition` tries.
    pub fit_trials: usize,
    /// Share of the strength that `fit_partition` tries next, above 0, below 1.
    pub fit_step: f64,
    /// In a cloud with labelled positions: segments classified differently from a label in them are segmented more
    /// finely and classified again.
    pub hold: bool,
    /// Largest number of positions of each class that a model stores for `hold`.
    pub hold_most: usize,
    /// Largest distance, metres, between a stored position and its point: coordinates may have been rounded.
    pub hold_within: f64,
    /// Share of the strength with which contradicted segments are segmented again, above 0, below 1.
    pub hold_step: f64,
}

impl Default for WeakLabels {
    fn default() -> Self {
        Self {
            per_class: 0,
            most: 100_000,
            within: 0.5,
            fit_partition: true,
            fit_accuracy: 0.9,
            fit_trials: 4,
            fit_step: 0.3,
            hold: true,
            hold_most: 500,
            hold_within: 0.01,
            hold_step: 0.03,
        }
    }
}

impl WeakLabels {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        for (name, distance) in [("labels.within", self.within), ("labels.hold_within", self.hold_within)] {
            if distance.is_nan() || distance < 0.0 {
                return Err(Error::parameter(name, distance, "metres, 0 or more"));
            }
        }
        for (name, share) in [("labels.fit_step", self.fit_step), ("labels.hold_step", self.hold_step)] {
            if !(share > 0.0 && share < 1.0) {
                return Err(Error::parameter(name, share, "a share, above 0, below 1"));
            }
        }
        if !(0.0..=1.0).contains(&self.fit_accuracy) {
            return Err(Error::parameter("labels.fit_accuracy", self.fit_accuracy, "0 to 1"));
        }
        let counts = [("labels.most", self.most), ("labels.hold_most", self.hold_most)];
        match counts.iter().chain(&[("labels.fit_trials", self.fit_trials)]).find(|(_, count)| *count == 0) {
            Some((name, _)) => Err(Error::parameter(name, 0, "1 or more")),
            None => Ok(()),
        }
    }
}

/// A labelled point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Example {
    /// Class code.
    pub code: u8,
    /// Index among the cloud's finite points.
    pub point: u32,
}

/// The labelled points among the finite points `index` of a cloud, sorted by class and then by point.
///
/// # Errors
/// If no point is labelled.
pub(super) fn examples(labels: &Labels, index: &[u32], params: &WeakLabels, seed: u64) -> Result<Vec<Example>> {
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); 256];
    for (point, &i) in index.iter().enumerate() {
        if let Some(code) = labels.codes.get(i as usize).copied().flatten() {
            members[usize::from(code)].push(point as u32);
        }
    }
    let total: usize = members.iter().map(Vec::len).sum();
    if total == 0 {
        return Err(Error::input("no labelled point to learn from; check the labels and the unlabelled codes"));
    }
    let share = (params.most as f64 / total as f64).min(1.0);
    let mut examples = Vec::new();
    for (code, members) in members.iter().enumerate().filter(|(_, m)| !m.is_empty()) {
        let most = if params.per_class == 0 { members.len() } else { params.per_class };
        let count = most.min(((members.len() as f64 * share) as usize).max(1));
        let drawn = stream(seed, 0x6578_616d ^ (code as u64) << 32).choose(members.len(), count);
        examples.extend(drawn.into_iter().map(|d| Example { code: code as u8, point: members[d as usize] }));
    }
    Ok(examples)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(codes: &[u8]) -> Labels {
        Labels { codes: codes.iter().map(|&c| (c > 0).then_some(c)).collect(), ..Labels::default() }
    }

    #[test]
    fn so_many_of_each_class_are_drawn_and_a_rare_class_gives_all() {
        let labels = labels(&[2, 2, 2, 2, 0, 6, 2, 2]);
        let index = [0, 1, 2, 4, 5, 6, 7];
        let params = WeakLabels { per_class: 3, ..WeakLabels::default() };
        let found = examples(&labels, &index, &params, 7).unwrap();
        assert_eq!(found.iter().filter(|e| e.code == 2).count(), 3);
        assert_eq!(found.last(), Some(&Example { code: 6, point: 4 }));
        let all = examples(&labels, &index, &WeakLabels::default(), 7).unwrap();
        assert_eq!(all.len(), 6);
        assert!(examples(&self::labels(&[0, 0]), &[0, 1], &params, 7).is_err());
    }
}
