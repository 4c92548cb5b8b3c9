//! The points of a cloud on which methods are compared, with their features.

use super::Candidate;
use super::patches::{Labelled, Patches};
use crate::classes::ClassTable;
use crate::classification::{Classifier, Predictor};
use crate::cloud::Positions;
use crate::error::Result;
use crate::evaluation::Confusion;
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::recipes::regularise::{ChoiceParams, Probabilities, Regularise, RegulariseParams, Support};
use std::collections::HashMap;

/// Points of a cloud or thinned copy whose features are needed: its samples, and the points of its patches.
pub(in crate::recipes) struct NeededPoints {
    /// The samples, then other points, each once: indices in the cloud.
    pub(in crate::recipes) points: Vec<u32>,
    /// Row of each point of the patches among them.
    rows: Vec<usize>,
    trial: Trial,
}

/// Points of a cloud or thinned copy on which methods are compared; may be none.
#[derive(Default)]
pub(in crate::recipes) struct Trial {
    /// Indices in the cloud, ascending.
    pub(in crate::recipes) points: Vec<u32>,
    /// Features of each point, row-major.
    pub(in crate::recipes) rows: Vec<f32>,
    positions: Positions,
    patches: Patches,
    /// Code of the true class of each point; `None` without one.
    truth: Vec<Option<u8>>,
}

impl NeededPoints {
    /// The samples alone.
    pub(in crate::recipes) fn samples(samples: &[u32]) -> Self {
        Self { points: samples.to_vec(), rows: Vec::new(), trial: Trial::default() }
    }

    /// The samples, and patches of the cloud.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::recipes) fn new(
        cloud: &Labelled<'_>,
        samples: &[u32],
        params: &ChoiceParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        let patches = Patches::new(cloud, params, monitor)?;
        let local = cloud.scene.points(monitor)?;
        let row_of = local.frame.rows(cloud.scene.cloud.len());
        let own: Vec<u32> = patches.points.iter().map(|&point| row_of[point as usize]).collect();
        let mut plan = Self::samples(samples);
        let known: HashMap<u32, usize> = samples.iter().copied().zip(0..).collect();
        for &point in &patches.points {
            let row = known.get(&point).copied().unwrap_or_else(|| {
                plan.points.push(point);
                plan.points.len() - 1
            });
            plan.rows.push(row);
        }
        let trial = Trial {
            points: patches.points.clone(),
            rows: Vec::new(),
            positions: local.positions.select(&own, monitor)?,
            truth: patches.points.iter().map(|&point| cloud.codes[point as usize]).collect(),
            patches,
        };
        Ok(Self { trial, ..plan })
    }

    /// The patches with their features, from those of all [`NeededPoints::points`].
    pub(in crate::recipes) fn into_trial(self, table: &FeatureTable) -> Trial {
        let rows = self.rows.iter().flat_map(|&row| table.row(row)).copied().collect();
        Trial { rows, ..self.trial }
    }
}

impl Trial {
    /// Class probabilities of each point by the classifier of the other colour, row-major.
    pub(super) fn probabilities(&self, halves: &[Classifier; 2]) -> Result<Vec<f32>> {
        let (width, classes) = (halves[0].width(), halves[0].classes());
        let mut values = vec![0.0; self.points.len() * classes];
        for colour in [0, 1] {
            let of = |&i: &usize| self.patches.colours[self.patches.of_point[i] as usize] == colour;
            let own: Vec<usize> = (0..self.points.len()).filter(of).collect();
            let rows: Vec<f32> = own.iter().flat_map(|&i| &self.rows[i * width..][..width]).copied().collect();
            let mut found = vec![0.0; own.len() * classes];
            halves[1 - colour].predict_proba(&rows, &mut found)?;
            for (row, &i) in found.chunks_exact(classes).zip(&own) {
                values[i * classes..][..classes].copy_from_slice(row);
            }
        }
        Ok(values)
    }

    /// Gives `take` the labels by each candidate. Neighbours and segments do not depend on the strength: they are found
    /// once for all candidates that follow each other and need the same.
    pub(super) fn each(
        &self,
        given: Probabilities<'_>,
        candidates: &[Candidate],
        params: &RegulariseParams,
        mut take: impl FnMut(Vec<u16>) -> Result<()>,
    ) -> Result<()> {
        let monitor = Monitor::default();
        let on_points = [Regularise::Local, Regularise::PointCrf];
        for group in candidates
            .chunk_by(|a, b| a.method == b.method || (on_points.contains(&a.method) && on_points.contains(&b.method)))
        {
            let base = RegulariseParams { method: group[0].method, ..params.clone() };
            let support = Support::new(&self.positions, None, &base, &monitor)?;
            for candidate in group {
                let strength = candidate.strength.unwrap_or(params.strength);
                let params = RegulariseParams { method: candidate.method, strength, ..params.clone() };
                take(support.decide(given, &params, &monitor)?.labels)?;
            }
        }
        Ok(())
    }

    /// The confusion of each patch by these labels.
    pub(super) fn confusions(&self, labels: &[u16], classes: &ClassTable) -> Result<Vec<Confusion>> {
        let mut patches = vec![Confusion::new(classes.clone()); self.patches.colours.len()];
        for (i, &label) in labels.iter().enumerate() {
            if let Some(truth) = self.truth[i] {
                let named = classes.classes()[usize::from(label)].code;
                patches[self.patches.of_point[i] as usize].add(truth, named)?;
            }
        }
        Ok(patches)
    }
}
