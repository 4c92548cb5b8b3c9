//! The boosting rounds.

use super::growing::data::BoostingData;
use super::growing::grow::HistogramPool;
use super::growing::tree::GrownTree;
use super::growing::tree::TreeFit;
use super::model::Boosting;
use super::params::BoostingParams;
use crate::classification::learner::Learner;
use crate::classification::samples::Samples;
use crate::error::Result;
use crate::parallel::{Monitor, map_watched, resize_watched};
use crate::random::stream;
use rayon::prelude::*;

/// Losses during the training.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoostingReport {
    /// Weighted mean loss (nats) of the training samples before the first round and after every round.
    pub training_loss: Vec<f64>,
    /// The same for the held-out samples; empty if there are none.
    pub validation_loss: Vec<f64>,
    /// Number of rounds kept: all of them, or with early stopping those up to the lowest validation loss.
    pub rounds: usize,
}

impl Boosting {
    /// Trains boosted trees. The result is the same bytes for any number of threads. At most
    /// O(rounds · classes · samples · features · depth).
    ///
    /// # Errors
    /// If samples are inconsistent or more than 2^24 - 1, a parameter is out of range, or the work was cancelled.
    pub fn fit(samples: &Samples<'_>, params: &BoostingParams, monitor: &Monitor) -> Result<Self> {
        Self::fit_with_report(samples, None, params, monitor).map(|(model, _)| model)
    }

    /// As [`Boosting::fit`], with the losses. `validation` are samples for early stopping; if there are none and early
    /// stopping is on, `validation_fraction` of the samples of every class is held out.
    ///
    /// # Errors
    /// As [`Boosting::fit`], or if the validation samples have another width or number of classes.
    pub fn fit_with_report(
        samples: &Samples<'_>,
        validation: Option<&Samples<'_>>,
        params: &BoostingParams,
        monitor: &Monitor,
    ) -> Result<(Self, BoostingReport)> {
        params.validate()?;
        let data = BoostingData::new(samples, validation, params, monitor)?;
        let (trees, report) = Rounds::new(&data)?.run()?;
        Ok((Self::assemble(&data, &trees)?, report))
    }
}

impl Learner for BoostingParams {
    type Trained = Boosting;

    fn seed(&mut self) -> Option<&mut u64> {
        Some(&mut self.seed)
    }

    fn max_depth(&mut self) -> Option<&mut Option<usize>> {
        Some(&mut self.max_depth)
    }

    fn train(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<Boosting> {
        Boosting::fit(samples, self, monitor)
    }
}

/// The rounds: current scores, and the trees so far.
struct Rounds<'a> {
    data: &'a BoostingData<'a>,
    /// Scores, one column of all rows for each group.
    scores: Vec<f64>,
    trees: Vec<GrownTree>,
    /// Memory of each group's histograms.
    pools: Vec<HistogramPool>,
}

impl<'a> Rounds<'a> {
    fn new(data: &'a BoostingData<'a>) -> Result<Self> {
        let mut scores = Vec::with_capacity(data.start.len() * data.classes.len());
        for (group, start) in (1..).zip(&data.start) {
            resize_watched(&mut scores, group * data.classes.len(), start, data.monitor)?;
        }
        let pools = (0..data.loss.groups()).map(|_| HistogramPool::default()).collect();
        Ok(Self { data, scores, trees: Vec::new(), pools })
    }

    /// Runs all rounds; with early stopping, trees after the best round are removed.
    fn run(mut self) -> Result<(Vec<GrownTree>, BoostingReport)> {
        let (data, params) = (self.data, self.data.params);
        let mut report = BoostingReport::default();
        data.monitor.stage("boosting", params.rounds as u64);
        let mut norms = self.evaluate(&mut report)?;
        let (mut bag, mut best) = (data.training.clone(), 0);
        for round in 0..params.rounds {
            if round % params.row_rounds == 0 && params.row_fraction < 1.0 {
                bag = self.draw(round);
            }
            self.grow(round, &bag, &norms)?;
            norms = self.evaluate(&mut report)?;
            data.monitor.advance(1);
            let loss = &report.validation_loss;
            let patience = params.early_stopping;
            if patience == 0 || loss.is_empty() || loss[round + 1] < loss[best] {
                best = round + 1;
            } else if round + 1 - best >= patience {
                break;
            }
        }
        self.trees.truncate(best * data.loss.groups());
        report.rounds = best;
        Ok((self.trees, report))
    }

    /// Computes the log-sum-exp of the scores of every row; appends the mean losses to the report.
    fn evaluate(&self, report: &mut BoostingReport) -> Result<Vec<f64>> {
        let data = self.data;
        let (n, groups) = (data.classes.len(), data.loss.groups());
        let norm = |row| data.loss.norm((0..groups).map(|g| self.scores[g * n + row]));
        let norms = map_watched(n, data.monitor, norm)?;
        report.training_loss.push(data.mean_loss(&data.training, &self.scores, &norms)?);
        if !data.validation.is_empty() {
            report.validation_loss.push(data.mean_loss(&data.validation, &self.scores, &norms)?);
        }
        Ok(norms)
    }

    /// Grows one tree a group on the rows of the bag, all from the same scores; groups run in parallel.
    fn grow(&mut self, round: usize, bag: &[u32], norms: &[f64]) -> Result<()> {
        let (data, n) = (self.data, self.data.classes.len());
        let group = |(group, (scores, pool)): (usize, (&mut [f64], &mut HistogramPool))| {
            let seed = (round * data.loss.groups() + group) as u64;
            TreeFit { data, group, seed, norms }.tree(bag, scores, pool)
        };
        let columns = self.scores.par_chunks_mut(n).zip(self.pools.par_iter_mut()).with_max_len(1);
        let trees: Vec<Result<GrownTree>> = columns.enumerate().map(group).collect();
        for tree in trees {
            self.trees.push(tree?);
        }
        Ok(())
    }

    /// Draws the rows of a round's trees.
    fn draw(&self, round: usize) -> Vec<u32> {
        let (params, rows) = (self.data.params, &self.data.training);
        let wanted = ((params.row_fraction * rows.len() as f64).round() as usize).max(1);
        let picks = stream(params.seed, ROWS + round as u64).choose(rows.len(), wanted);
        picks.into_iter().map(|p| rows[p as usize]).collect()
    }
}

/// First random stream for the draws of rows.
const ROWS: u64 = 1 << 40;
