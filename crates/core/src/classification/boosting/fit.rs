//! The boosting rounds.

use super::super::binning::{Binning, BinningParams};
use super::super::samples::Samples;
use super::blocks::Blocks;
use super::grow::Pool;
use super::lesson::Lesson;
use super::loss::Loss;
use super::model::{Boosting, Grown};
use super::params::BoostingParams;
use super::rows::Rows;
use crate::error::Result;
use crate::parallel::{Monitor, fold_ordered};
use crate::random::stream;
use rayon::prelude::*;

/// Number of samples that one task processes.
pub(super) const CHUNK: usize = 1 << 13;

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
        let mut course = Course::new(samples, validation, params, monitor)?;
        let report = course.run()?;
        let shape = (samples.width, samples.classes);
        let model = Self::assemble(shape, (&course.present, &course.start), &course.grown, course.blocks.binning)?;
        Ok((model, report))
    }
}

/// State of the training: samples, current scores and trees.
pub(super) struct Course<'a> {
    pub(super) params: &'a BoostingParams,
    pub(super) monitor: &'a Monitor,
    pub(super) blocks: Blocks,
    /// Classes that occur among the training samples.
    present: Vec<u16>,
    pub(super) loss: Loss,
    start: Vec<f64>,
    /// Position in `present` of the class of every row.
    pub(super) classes: Vec<u16>,
    pub(super) weights: Vec<f32>,
    /// Rows of the training and of the validation, ascending.
    learned: Vec<u32>,
    held: Vec<u32>,
    /// Scores, one column of all rows for each group.
    scores: Vec<f64>,
    grown: Vec<Grown>,
}

impl<'a> Course<'a> {
    fn new(
        samples: &Samples<'_>,
        validation: Option<&Samples<'_>>,
        params: &'a BoostingParams,
        monitor: &'a Monitor,
    ) -> Result<Self> {
        let rows = Rows::choose(samples, validation, params)?;
        let fitted = Samples { weights: Some(&rows.weights[..samples.len()]), ..*samples };
        let binning = BinningParams { max_bins: params.max_bins, seed: params.seed, ..BinningParams::default() };
        let tables = [Some(samples.features), validation.map(|v| v.features)];
        let blocks = Blocks::new(&tables.into_iter().flatten().collect::<Vec<_>>(), Binning::fit(&fitted, &binning)?)?;
        let mut shares = vec![0.0f64; samples.classes];
        rows.learned.iter().for_each(|&r| shares[rows.label(r)] += f64::from(rows.weights[r as usize]));
        let present: Vec<u16> = (0..samples.classes).filter(|&c| shares[c] > 0.0).map(|c| c as u16).collect();
        let total: f64 = shares.iter().sum();
        let loss = Loss { classes: present.len() };
        let start = loss.start(&present.iter().map(|&c| shares[usize::from(c)] / total).collect::<Vec<_>>());
        let place = |label: u16| present.binary_search(&label).map_or(u16::MAX, |p| p as u16);
        Ok(Self {
            params,
            monitor,
            blocks,
            loss,
            scores: start.iter().flat_map(|&s| std::iter::repeat_n(s, rows.labels.len())).collect(),
            start,
            classes: rows.labels.iter().map(|&l| place(l)).collect(),
            present,
            held: rows.judged,
            weights: rows.judging,
            learned: rows.learned,
            grown: Vec::new(),
        })
    }

    /// Runs all rounds; with early stopping, trees after the best round are removed.
    fn run(&mut self) -> Result<BoostingReport> {
        let mut report = BoostingReport::default();
        let mut pools: Vec<Pool> = (0..self.loss.groups()).map(|_| Pool::default()).collect();
        self.monitor.stage("boosting", self.params.rounds as u64);
        let mut norms = self.judge(&mut report);
        let (mut bag, mut best) = (self.learned.clone(), 0);
        for round in 0..self.params.rounds {
            if round % self.params.row_rounds == 0 && self.params.row_fraction < 1.0 {
                bag = self.draw(round);
            }
            self.round((round, &bag), &norms, &mut pools)?;
            norms = self.judge(&mut report);
            self.monitor.advance(1);
            let loss = &report.validation_loss;
            let patience = self.params.early_stopping;
            if patience == 0 || loss.is_empty() || loss[round + 1] < loss[best] {
                best = round + 1;
            } else if round + 1 - best >= patience {
                break;
            }
        }
        self.grown.truncate(best * self.loss.groups());
        report.rounds = best;
        Ok(report)
    }

    /// Computes the log-sum-exp of the scores of every row; appends the mean losses to the report.
    fn judge(&self, report: &mut BoostingReport) -> Vec<f64> {
        let (n, groups) = (self.classes.len(), self.loss.groups());
        let mut norms = vec![0.0; n];
        norms.par_iter_mut().with_min_len(CHUNK).enumerate().for_each(|(row, norm)| {
            *norm = self.loss.norm((0..groups).map(|g| self.scores[g * n + row]));
        });
        report.training_loss.push(self.mean_loss(&self.learned, &norms));
        if !self.held.is_empty() {
            report.validation_loss.push(self.mean_loss(&self.held, &norms));
        }
        norms
    }

    fn mean_loss(&self, rows: &[u32], norms: &[f64]) -> f64 {
        let n = self.classes.len();
        let part = |range: std::ops::Range<usize>| {
            rows[range].iter().map(|&r| r as usize).fold([0.0; 2], |[loss, weight], row| {
                let w = f64::from(self.weights[row]);
                let class = usize::from(self.classes[row]);
                let own = match self.classes[row] {
                    // A class that never occurred has probability 0; its loss is that of the smallest positive number.
                    u16::MAX => -f64::MIN_POSITIVE.ln(),
                    _ => self.loss.value(norms[row], class, |g| self.scores[g * n + row]),
                };
                [loss + w * own, weight + w]
            })
        };
        let sums = fold_ordered(rows.len(), CHUNK, part, |a, b| [a[0] + b[0], a[1] + b[1]]).unwrap_or_default();
        sums[0] / sums[1].max(f64::MIN_POSITIVE)
    }

    /// Grows one tree a group, all from the same scores; groups run in parallel.
    fn round(&mut self, (round, bag): (usize, &[u32]), norms: &[f64], pools: &mut [Pool]) -> Result<()> {
        let mut scores = std::mem::take(&mut self.scores);
        let (course, n) = (&*self, self.classes.len());
        let group = |(group, (scores, pool)): (usize, (&mut [f64], &mut Pool))| {
            let lesson = Lesson { course, group, seed: (round * course.loss.groups() + group) as u64, norms };
            lesson.tree(bag, scores, pool)
        };
        let trees: Vec<Result<Grown>> =
            scores.par_chunks_mut(n).zip(pools.par_iter_mut()).with_max_len(1).enumerate().map(group).collect();
        self.scores = scores;
        for tree in trees {
            self.grown.push(tree?);
        }
        Ok(())
    }

    /// Draws the rows of a round's trees.
    fn draw(&self, round: usize) -> Vec<u32> {
        let wanted = ((self.params.row_fraction * self.learned.len() as f64).round() as usize).max(1);
        let picks = stream(self.params.seed, ROWS + round as u64).choose(self.learned.len(), wanted);
        picks.into_iter().map(|p| self.learned[p as usize]).collect()
    }
}

/// First random stream for the draws of rows.
const ROWS: u64 = 1 << 40;
