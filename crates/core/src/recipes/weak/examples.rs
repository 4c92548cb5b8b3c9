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
    /// Use a finer partition than its strength gives if its segments cannot be consistent with the labels.
    pub fit_partition: bool,
    /// In a cloud with labelled positions: segments classified differently from a label in them are segmented more
    /// finely and classified again.
    pub hold: bool,
    /// Set by training: labelled positions, in the units of their cloud, and their classes.
    pub places: Vec<([f64; 3], u8)>,
}

impl Default for WeakLabels {
    fn default() -> Self {
        Self { per_class: 0, most: 100_000, within: 0.5, fit_partition: true, hold: true, places: Vec::new() }
    }
}

impl WeakLabels {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If `most` is 0, or `within` is not a distance.
    pub fn validate(&self) -> Result<()> {
        if self.within.is_nan() || self.within < 0.0 {
            return Err(Error::parameter("labels.within", self.within, "metres, 0 or more"));
        }
        if let Some((place, _)) = self.places.iter().find(|(place, _)| place.iter().any(|v| !v.is_finite())) {
            return Err(Error::parameter("labels.places", format!("{place:?}"), "finite coordinates"));
        }
        if self.most == 0 { Err(Error::parameter("labels.most", 0, "1 or more")) } else { Ok(()) }
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
pub(super) fn examples(labels: &Labels, index: &[u32], (params, seed): (&WeakLabels, u64)) -> Result<Vec<Example>> {
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
        let found = examples(&labels, &index, (&params, 7)).unwrap();
        assert_eq!(found.iter().filter(|e| e.code == 2).count(), 3);
        assert_eq!(found.last(), Some(&Example { code: 6, point: 4 }));
        let all = examples(&labels, &index, (&WeakLabels::default(), 7)).unwrap();
        assert_eq!(all.len(), 6);
        assert!(examples(&self::labels(&[0, 0]), &[0, 1], (&params, 7)).is_err());
    }
}
