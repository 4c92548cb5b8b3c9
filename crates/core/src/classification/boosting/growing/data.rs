//! What all rounds of boosting read: quantised samples, their classes and weights, and the initial scores.

use crate::classification::binning::{Binning, BinningParams};
use crate::classification::boosting::growing::blocks::Blocks;
use crate::classification::boosting::growing::training_rows::TrainingRows;
use crate::classification::boosting::loss::Loss;
use crate::classification::boosting::params::BoostingParams;
use crate::classification::samples::Samples;
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered, map_watched};

/// Number of samples that one task processes.
pub(in crate::classification::boosting) const CHUNK: usize = 1 << 13;

/// The data of a training.
pub(in crate::classification::boosting) struct BoostingData<'a> {
    pub(in crate::classification::boosting) params: &'a BoostingParams,
    pub(in crate::classification::boosting) monitor: &'a Monitor,
    pub(in crate::classification::boosting) blocks: Blocks,
    /// Number of classes of the samples, those without any sample included.
    pub(in crate::classification::boosting) all_classes: usize,
    /// Classes that occur among the training samples.
    pub(in crate::classification::boosting) present: Vec<u16>,
    pub(in crate::classification::boosting) loss: Loss,
    /// Score before the first round, one for each group of trees.
    pub(in crate::classification::boosting) start: Vec<f64>,
    /// Position in `present` of the class of every row.
    pub(in crate::classification::boosting) classes: Vec<u16>,
    /// Weight of every row in the losses.
    pub(in crate::classification::boosting) weights: Vec<f32>,
    /// Rows of the training, ascending.
    pub(in crate::classification::boosting) training: Vec<u32>,
    /// Rows of the validation, ascending.
    pub(in crate::classification::boosting) validation: Vec<u32>,
}

impl<'a> BoostingData<'a> {
    pub(in crate::classification::boosting) fn new(
        samples: &Samples<'_>,
        validation: Option<&Samples<'_>>,
        params: &'a BoostingParams,
        monitor: &'a Monitor,
    ) -> Result<Self> {
        let rows = TrainingRows::choose(samples, validation, params, monitor)?;
        let fitted = Samples { weights: Some(&rows.weights[..samples.len()]), ..*samples };
        let binning = BinningParams { max_bins: params.max_bins, seed: params.seed, ..BinningParams::default() };
        let tables = [Some(samples.features), validation.map(|v| v.features)];
        let binning = Binning::fit(&fitted, &binning, monitor)?;
        let blocks = Blocks::new(&tables.into_iter().flatten().collect::<Vec<_>>(), binning, monitor)?;
        let mut shares = vec![0.0f64; samples.classes];
        rows.training.iter().for_each(|&r| shares[rows.label(r)] += f64::from(rows.weights[r as usize]));
        let present: Vec<u16> = (0..samples.classes).filter(|&c| shares[c] > 0.0).map(|c| c as u16).collect();
        let total: f64 = shares.iter().sum();
        let loss = Loss { classes: present.len() };
        let start = loss.start(&present.iter().map(|&c| shares[usize::from(c)] / total).collect::<Vec<_>>());
        let position = |label: u16| present.binary_search(&label).map_or(u16::MAX, |p| p as u16);
        Ok(Self {
            params,
            monitor,
            blocks,
            all_classes: samples.classes,
            loss,
            start,
            classes: map_watched(rows.labels.len(), monitor, |i| position(rows.labels[i]))?,
            present,
            validation: rows.validation,
            weights: rows.loss_weights,
            training: rows.training,
        })
    }

    /// Weighted mean loss of some rows, from the scores of all rows (one column a group) and the log-sum-exp of each
    /// row's scores.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(in crate::classification::boosting) fn mean_loss(
        &self,
        rows: &[u32],
        scores: &[f64],
        norms: &[f64],
    ) -> Result<f64> {
        let n = self.classes.len();
        let part = |range: std::ops::Range<usize>| {
            rows[range].iter().map(|&r| r as usize).fold([0.0; 2], |[loss, weight], row| {
                let w = f64::from(self.weights[row]);
                let class = usize::from(self.classes[row]);
                let own = match self.classes[row] {
                    // A class that never occurred has probability 0; its loss is that of the smallest positive number.
                    u16::MAX => -f64::MIN_POSITIVE.ln(),
                    _ => self.loss.value(norms[row], class, |g| scores[g * n + row]),
                };
                [loss + w * own, weight + w]
            })
        };
        let chunk = |c: usize| c * CHUNK..((c + 1) * CHUNK).min(rows.len());
        let sums = map_ordered(rows.len().div_ceil(CHUNK), self.monitor, |c| Ok(part(chunk(c))))?;
        let [loss, weight] = sums.into_iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        Ok(loss / weight.max(f64::MIN_POSITIVE))
    }
}
