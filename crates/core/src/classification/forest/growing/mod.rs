//! Training: trees in parallel, each with its own random stream.

pub(in crate::classification) mod bag;
pub(in crate::classification) mod exact;
pub(in crate::classification) mod histogram;
pub(in crate::classification) mod impurity;
pub(in crate::classification) mod out_of_bag;
pub(in crate::classification) mod splitter;
pub(in crate::classification) mod tree;

use self::bag::bag;
use self::exact::{Ranks, Sorter};
use self::histogram::{Histogram, QuantisedSamples};
use self::impurity::{Entry, Weight};
use self::out_of_bag::{BagSet, FitReport};
use self::splitter::{CodeTable, Scan};
use self::tree::{ForestGrower, ForestTree, TreeParams};
use crate::classification::binning::{Binning, BinningParams};
use crate::classification::forest::Forest;
use crate::classification::learner::Learner;
use crate::classification::params::{Bootstrap, ClassWeight, ForestParams, Splitter};
use crate::classification::samples::Samples;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};
use crate::random::stream;

impl Forest {
    /// Trains a forest. The result is the same bytes for any number of threads. O(trees · features tried · samples ·
    /// depth).
    ///
    /// # Errors
    /// If samples are inconsistent, a parameter is out of range, or the work was cancelled.
    pub fn fit(samples: &Samples<'_>, params: &ForestParams, monitor: &Monitor) -> Result<Self> {
        learn(samples, params, monitor).map(|(forest, _)| forest)
    }

    /// As [`Forest::fit`]; also returns the out-of-bag score.
    pub fn fit_with_report(
        samples: &Samples<'_>,
        params: &ForestParams,
        monitor: &Monitor,
    ) -> Result<(Self, FitReport)> {
        let (forest, bags) = learn(samples, params, monitor)?;
        if params.bootstrap == Bootstrap::None {
            return Ok((forest, FitReport::default()));
        }
        let report = out_of_bag::report(&forest, samples, &bags, monitor)?;
        Ok((forest, report))
    }
}

impl Learner for ForestParams {
    type Trained = Forest;

    fn seed(&mut self) -> Option<&mut u64> {
        Some(&mut self.seed)
    }

    fn max_depth(&mut self) -> Option<&mut Option<usize>> {
        Some(&mut self.max_depth)
    }

    fn train(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<Forest> {
        Forest::fit(samples, self, monitor)
    }

    fn train_with_score(&self, samples: &Samples<'_>, monitor: &Monitor) -> Result<(Forest, Option<f64>)> {
        Forest::fit_with_report(samples, self, monitor).map(|(forest, report)| (forest, report.oob_score))
    }
}

/// The active samples and their weights, before bootstrap sampling.
struct ForestData<'a> {
    samples: &'a Samples<'a>,
    params: &'a ForestParams,
    monitor: &'a Monitor,
    active: Vec<u32>,
    /// Weight of every active sample; `None` if all are 1.
    weights: Option<Vec<f64>>,
}

fn learn(samples: &Samples<'_>, params: &ForestParams, monitor: &Monitor) -> Result<(Forest, Vec<BagSet>)> {
    learn_with(samples, params, None, monitor)
}

/// As [`learn`], with the quantisation of other samples, for [`Splitter::Histogram`].
fn learn_with(
    samples: &Samples<'_>,
    params: &ForestParams,
    binning: Option<&Binning>,
    monitor: &Monitor,
) -> Result<(Forest, Vec<BagSet>)> {
    params.validate()?;
    samples.check()?;
    let active = samples.active();
    let weights = weights(samples, &active, &params.class_weight)?;
    let data = ForestData { samples, params, monitor, active, weights };
    monitor.stage("forest", params.trees as u64);
    let grown = match params.splitter {
        Splitter::Histogram => {
            let binning = match binning {
                Some(given) => given.clone(),
                None => quantised(samples, params, monitor)?,
            };
            let codes = QuantisedSamples::new(samples, binning)?;
            match data.weights.is_none() {
                true => data.trees(&codes, |_, times| times, Histogram::<u32>::new)?,
                false => data.trees(&codes, |w, times| w * f64::from(times), Histogram::<f64>::new)?,
            }
        }
        Splitter::Exact => {
            let ranks = Ranks::new(samples);
            data.trees(&ranks, |w, times| w * f64::from(times), Sorter::<f64>::new)?
        }
    };
    let (trees, bags): (Vec<_>, Vec<_>) = grown.into_iter().unzip();
    Ok((Forest::assemble(&trees, samples.width, samples.classes)?, bags))
}

/// The quantisation that a forest learns on.
fn quantised(samples: &Samples<'_>, params: &ForestParams, monitor: &Monitor) -> Result<Binning> {
    let binning = BinningParams { max_bins: params.max_bins, seed: params.seed, ..BinningParams::default() };
    Binning::fit(samples, &binning, monitor)
}

/// What one of several forests learns from.
#[derive(Clone, Debug)]
pub struct ForestPart {
    /// Weight of each sample; 0 leaves it out.
    pub weights: Vec<f32>,
    /// The forest.
    pub params: ForestParams,
}

impl Forest {
    /// One forest for each part of the samples, all with the quantisation of all samples by the parameters of the first,
    /// so that [`Forest::joined`] has no more thresholds than one of them may have.
    ///
    /// # Errors
    /// As [`Learner::train`].
    pub fn fit_parts(samples: &Samples<'_>, parts: &[ForestPart], monitor: &Monitor) -> Result<Vec<Self>> {
        let Some(first) = parts.first() else { return Ok(Vec::new()) };
        first.params.validate()?;
        samples.check()?;
        let binning = quantised(samples, &first.params, monitor)?;
        let fit = |part: &ForestPart| {
            let samples = Samples { weights: Some(&part.weights), ..*samples };
            learn_with(&samples, &part.params, Some(&binning), monitor).map(|(forest, _)| forest)
        };
        parts.iter().map(fit).collect()
    }
}

impl ForestData<'_> {
    fn trees<D: CodeTable, S: Scan<D::Code, W>, W: Weight>(
        &self,
        columns: &D,
        weight: impl Fn(f64, u32) -> W + Sync,
        scan: impl Fn(usize) -> S + Sync,
    ) -> Result<Vec<(ForestTree, BagSet)>> {
        map_ordered(self.params.trees, self.monitor, |t| {
            let mut random = stream(self.params.seed, t as u64);
            let times = bag(self.params.bootstrap, self.active.len(), &mut random);
            let weigh = |i: usize| self.weights.as_ref().map_or(1.0, |w| w[i]);
            let entries = (0..times.len()).filter(|&i| times[i] > 0).map(|i| Entry {
                row: self.active[i],
                class: u32::from(self.samples.labels[self.active[i] as usize]),
                weight: weight(weigh(i), times[i]),
            });
            let entries: Vec<Entry<W>> = entries.collect();
            let set = BagSet::new(self.samples.len(), entries.iter().map(|e| e.row));
            let of = TreeParams { columns, params: self.params, classes: self.samples.classes, monitor: self.monitor };
            let tree = ForestGrower::new(of, scan(self.samples.classes), random).grow(entries)?;
            self.monitor.advance(1);
            Ok((tree, set))
        })
    }
}

/// Weight of every active sample: its own times that of its class.
pub(in crate::classification) fn weights(
    samples: &Samples<'_>,
    active: &[u32],
    class_weight: &ClassWeight,
) -> Result<Option<Vec<f64>>> {
    let own = |i: u32| samples.weight(i as usize);
    let label = |i: u32| usize::from(samples.labels[i as usize]);
    let by_class: Vec<f64> = match class_weight {
        ClassWeight::None => vec![1.0; samples.classes],
        ClassWeight::Balanced => {
            let mut counts = vec![0.0f64; samples.classes];
            active.iter().for_each(|&i| counts[label(i)] += 1.0);
            let present = counts.iter().filter(|&&c| c > 0.0).count() as f64;
            counts.iter().map(|&c| active.len() as f64 / (present * c.max(1.0))).collect()
        }
        ClassWeight::PerClass(weights) if weights.len() == samples.classes => weights.clone(),
        ClassWeight::PerClass(weights) => {
            return Err(Error::parameter("class_weight", weights.len(), format!("{} weights", samples.classes)));
        }
    };
    let all: Vec<f64> = active.iter().map(|&i| own(i) * by_class[label(i)]).collect();
    let plain = all.iter().all(|w| w.to_bits() == 1.0f64.to_bits());
    Ok((!plain).then_some(all))
}
