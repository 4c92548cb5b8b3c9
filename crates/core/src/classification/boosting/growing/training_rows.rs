//! The split of the samples into training and validation.

use crate::classification::boosting::growing::histogram::MAX_ROWS;
use crate::classification::boosting::params::BoostingParams;
use crate::classification::forest::growing::weights;
use crate::classification::params::{ClassWeight, single};
use crate::classification::samples::Samples;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::random::stream;

/// First random stream for the choice of held-out samples.
const HELD: u64 = 1 << 42;

/// The rows of training and validation.
pub(in crate::classification::boosting) struct TrainingRows {
    pub(in crate::classification::boosting) labels: Vec<u16>,
    /// Weight in the training, 0 for held-out rows.
    pub(in crate::classification::boosting) weights: Vec<f32>,
    /// Weight in the losses.
    pub(in crate::classification::boosting) loss_weights: Vec<f32>,
    /// Rows of the training, ascending.
    pub(in crate::classification::boosting) training: Vec<u32>,
    /// Rows of the validation, ascending.
    pub(in crate::classification::boosting) validation: Vec<u32>,
}

impl TrainingRows {
    pub(in crate::classification::boosting) fn choose(
        samples: &Samples<'_>,
        validation: Option<&Samples<'_>>,
        params: &BoostingParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        samples.check()?;
        monitor.check()?;
        let active = samples.active();
        monitor.check()?;
        let total = samples.len() + validation.map_or(0, Samples::len);
        if total > MAX_ROWS {
            return Err(Error::input(format!("{total} samples; boosting takes at most {MAX_ROWS}")));
        }
        let mut loss_weights = vec![0.0f32; samples.len()];
        let weights = weights(samples, &active, &params.class_weight)?;
        for (i, &row) in active.iter().enumerate() {
            loss_weights[row as usize] = weights.as_ref().map_or(Ok(1.0), |weights| single(weights[i]))?;
        }
        monitor.check()?;
        let mut rows = Self {
            labels: samples.labels.to_vec(),
            weights: loss_weights.clone(),
            loss_weights,
            training: active,
            validation: Vec::new(),
        };
        match validation {
            Some(validation) => rows.append(samples, validation, params)?,
            None if params.early_stopping > 0 => rows.hold_out(params),
            None => {}
        }
        monitor.check()?;
        Ok(rows)
    }

    fn append(&mut self, samples: &Samples<'_>, validation: &Samples<'_>, params: &BoostingParams) -> Result<()> {
        validation.check()?;
        if (validation.width, validation.classes) != (samples.width, samples.classes) {
            return Err(Error::input(format!(
                "validation samples of {} features and {} classes; {} and {} are learned from",
                validation.width, validation.classes, samples.width, samples.classes
            )));
        }
        let by_class = match &params.class_weight {
            ClassWeight::PerClass(weights) => weights.clone(),
            _ => vec![1.0; samples.classes],
        };
        let first = self.labels.len() as u32;
        self.validation = validation.active().iter().map(|r| first + r).collect();
        self.labels.extend_from_slice(validation.labels);
        self.weights.resize(self.labels.len(), 0.0);
        self.loss_weights.resize(self.labels.len(), 0.0);
        for row in validation.active() {
            let weight = validation.weight(row as usize) * by_class[usize::from(validation.labels[row as usize])];
            self.loss_weights[(first + row) as usize] = single(weight)?;
        }
        Ok(())
    }

    /// Holds out a share of every class that has at least two samples.
    fn hold_out(&mut self, params: &BoostingParams) {
        let mut members = std::collections::BTreeMap::<u16, Vec<u32>>::new();
        self.training.iter().for_each(|&r| members.entry(self.labels[r as usize]).or_default().push(r));
        for (class, rows) in members {
            let wanted = (params.validation_fraction * rows.len() as f64).round() as usize;
            let picks = stream(params.seed, HELD + u64::from(class)).choose(rows.len(), wanted.min(rows.len() - 1));
            self.validation.extend(picks.into_iter().map(|p| rows[p as usize]));
        }
        self.validation.sort_unstable();
        self.validation.iter().for_each(|&r| self.weights[r as usize] = 0.0);
        self.training.retain(|&r| self.weights[r as usize] > 0.0);
    }

    pub(in crate::classification::boosting) fn label(&self, row: u32) -> usize {
        usize::from(self.labels[row as usize])
    }
}
