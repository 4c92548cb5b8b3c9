//! The training samples: those of every cloud and of its thinned copies, balanced over the classes.

use super::samples::{Candidate, TrainingParams, candidates, copies};
use super::{ClassSamples, LabelledScene, TrainingData, check_classes};
use crate::classes::ClassTable;
use crate::classification::sampling::balance;
use crate::cloud::MetricCloud;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::random::{Stream, stream};
use crate::recipes::system::report::ClassCount;

/// Samples of one cloud or thinned copy.
pub(in crate::recipes) struct SampleSource {
    /// Number of the cloud.
    pub(in crate::recipes) cloud: usize,
    /// Indices of the points of a thinned copy; `None`: all points of the cloud.
    pub(in crate::recipes) copy: Option<Vec<u32>>,
    /// The samples, ascending by point.
    pub(in crate::recipes) candidates: Vec<Candidate>,
}

/// The samples of all clouds, and what they are samples of.
pub(in crate::recipes) struct SampleSources {
    /// Each cloud, followed by its copies.
    pub(in crate::recipes) list: Vec<SampleSource>,
    /// Weight of the samples of each code.
    weights: Vec<f32>,
    /// The classes that are learned.
    pub(in crate::recipes) classes: ClassTable,
    /// Points and samples of each labelled class.
    pub(in crate::recipes) counts: Vec<ClassCount>,
    /// Warnings about classes with few samples.
    pub(in crate::recipes) warnings: Vec<String>,
}

impl SampleSources {
    /// Selects the samples: one a voxel of each cloud and copy, at most so many a copy, then the balance of classes over
    /// all of them (Hackel 2018, chapters 4.4.3 and 4.6.1).
    ///
    /// # Errors
    /// If fewer than two classes can be learned, or the work was cancelled.
    pub(in crate::recipes) fn select(
        data: &TrainingData<'_>,
        params: &TrainingParams,
        seed: u64,
        monitor: &Monitor,
    ) -> Result<Self> {
        let gathering = Gathering { params, seed };
        let mut list = gathering.sources(data, monitor)?;
        let offered = tally(&list);
        let weights = gathering.balanced(&mut list)?;
        let samples = tally(&list);
        let of = |code: u8| ClassSamples {
            count: samples[usize::from(code)],
            weight: f64::from(weights.get(usize::from(code)).copied().unwrap_or_default()),
        };
        let counts = data.class_counts(of);
        let warnings = warnings(&counts, &offered, params);
        let codes: Vec<u8> = counts.iter().filter(|c| c.samples > 0).map(|c| c.code).collect();
        let classes = data.class_table(&codes);
        check_classes(&classes).map_err(|e| with_reasons(e, &warnings))?;
        Ok(Self { list, weights, classes, counts, warnings })
    }

    /// Weight of each sample, source by source; empty if all are equal.
    pub(in crate::recipes) fn sample_weights(&self) -> Vec<f32> {
        let samples = self.list.iter().flat_map(|source| &source.candidates);
        let weights: Vec<f32> = samples.map(|c| self.weights[usize::from(c.code)] * c.weight).collect();
        if weights.iter().any(|&w| (w - 1.0).abs() > f32::EPSILON) { weights } else { Vec::new() }
    }
}

impl SampleSource {
    /// Calls `work` with the cloud or copy in metres.
    ///
    /// # Errors
    /// Those of `work`, or if the work was cancelled.
    pub(in crate::recipes) fn with_scene<T>(
        &self,
        data: &TrainingData<'_>,
        monitor: &Monitor,
        work: impl FnOnce(&MetricCloud<'_>) -> Result<T>,
    ) -> Result<T> {
        let whole = &data.scenes[self.cloud].metric;
        match &self.copy {
            None => work(whole),
            Some(kept) => work(&MetricCloud::new(&whole.cloud.select(kept), Some(whole.metres), monitor)?),
        }
    }

    /// The position of each sample's class.
    pub(in crate::recipes) fn labels(&self, classes: &ClassTable) -> impl Iterator<Item = u16> {
        self.candidates.iter().filter_map(|c| classes.position(c.code)).map(|position| position as u16)
    }

    /// The code of each point of the cloud or copy, if it is learned and the point is not excluded.
    pub(in crate::recipes) fn codes(
        &self,
        data: &TrainingData<'_>,
        classes: &ClassTable,
        params: &TrainingParams,
    ) -> Vec<Option<u8>> {
        let LabelledScene { metric, labels } = &data.scenes[self.cloud];
        let known = |point: usize| {
            let xyz = metric.cloud.xyz(point);
            labels.codes[point].filter(|&code| classes.position(code).is_some() && !params.excludes(xyz[0], xyz[1]))
        };
        match &self.copy {
            None => (0..metric.cloud.len()).map(known).collect(),
            Some(kept) => kept.iter().map(|&point| known(point as usize)).collect(),
        }
    }

    /// The point of each sample.
    pub(in crate::recipes) fn points(&self) -> Vec<u32> {
        self.candidates.iter().map(|c| c.point).collect()
    }
}

/// The error about too few classes, with the reasons why others were dropped.
pub(in crate::recipes) fn with_reasons(error: Error, reasons: &[String]) -> Error {
    match reasons.is_empty() {
        true => error,
        false => Error::input(format!("{error} ({})", reasons.join("; "))),
    }
}

/// How samples are gathered.
struct Gathering<'a> {
    params: &'a TrainingParams,
    seed: u64,
}

impl Gathering<'_> {
    /// The candidate samples of every cloud and its thinned copies.
    fn sources(&self, data: &TrainingData<'_>, monitor: &Monitor) -> Result<Vec<SampleSource>> {
        let (mut sources, params) = (Vec::new(), self.params);
        for (c, LabelledScene { metric, labels }) in data.scenes.iter().enumerate() {
            for copy in copies(metric, params, self.seed.wrapping_add(c as u64), monitor)? {
                let candidates = match &copy {
                    None => candidates(metric, labels, params, monitor)?,
                    Some(kept) => {
                        let thinned = metric.cloud.select(kept);
                        let thinned = MetricCloud::new(&thinned, Some(metric.metres), monitor)?;
                        candidates(&thinned, &labels.select(kept), params, monitor)?
                    }
                };
                let random = stream(self.seed, 0x636f_7079 ^ (sources.len() as u64) << 32);
                let candidates = limited(candidates, params.per_copy, random);
                sources.push(SampleSource { cloud: c, copy, candidates });
            }
        }
        Ok(sources)
    }

    /// The class balance of chapter 4.6.1 over all sources together; returns the sample weight of each code.
    fn balanced(&self, sources: &mut [SampleSource]) -> Result<Vec<f32>> {
        let present = tally(sources);
        let codes: Vec<u8> = (0..=255u8).filter(|&code| present[usize::from(code)] > 0).collect();
        let position = |code: u8| codes.iter().position(|&c| c == code).unwrap_or_default() as u16;
        let places: Vec<u16> = (0..=255u8).map(position).collect();
        let labels: Vec<u16> =
            sources.iter().flat_map(|s| &s.candidates).map(|c| places[usize::from(c.code)]).collect();
        let balance = balance(&labels, &self.params.balance(self.seed))?;
        let mut keep = vec![false; labels.len()];
        balance.chosen.iter().for_each(|&i| keep[i as usize] = true);
        let mut keep = keep.into_iter();
        for source in sources {
            source.candidates.retain(|_| keep.next().unwrap_or(false));
            source.candidates.sort_unstable_by_key(|c| c.point);
        }
        let mut weights = vec![0.0; 256];
        codes.iter().zip(balance.weights).for_each(|(&code, weight)| weights[usize::from(code)] = weight);
        Ok(weights)
    }
}

/// At most `most` random candidates a class, in their order; 0: all.
pub(in crate::recipes) fn limited(candidates: Vec<Candidate>, most: usize, mut random: Stream) -> Vec<Candidate> {
    if most == 0 {
        return candidates;
    }
    let mut left = [0u64; 256];
    candidates.iter().for_each(|c| left[usize::from(c.code)] += 1);
    let mut open = left.map(|count| count.min(most as u64));
    // Each candidate is chosen with the probability of those still wanted among those still to come.
    let mut chosen = |c: &Candidate| {
        let (left, open) = (&mut left[usize::from(c.code)], &mut open[usize::from(c.code)]);
        let taken = random.uniform() * (*left as f64) < *open as f64;
        *left -= 1;
        *open -= u64::from(taken);
        taken
    };
    candidates.into_iter().filter(|c| chosen(c)).collect()
}

/// Number of samples by code.
fn tally(sources: &[SampleSource]) -> [u64; 256] {
    let mut samples = [0; 256];
    sources.iter().flat_map(|s| &s.candidates).for_each(|c| samples[usize::from(c.code)] += 1);
    samples
}

/// Warnings about classes with few samples; `offered` are the samples before balancing.
fn warnings(counts: &[ClassCount], offered: &[u64; 256], params: &TrainingParams) -> Vec<String> {
    let largest = counts.iter().map(|c| c.samples).max().unwrap_or(0);
    let warning = |c: &ClassCount| {
        let (of, name) = (offered[usize::from(c.code)], c.title());
        match c.samples {
            0 if of == 0 => Some(format!(
                "{name} is left out: its {} points are the majority of no voxel of {} m, or are excluded",
                c.points, params.voxel
            )),
            0 => Some(format!(
                "{name} is left out: {of} samples are too few to learn from (training.rare_below = {}; \
                 training.rare = \"keep\" learns it all the same)",
                params.rare_below
            )),
            _ if c.weight > 1.0 => Some(format!(
                "{name} has {} samples beside {largest} of the largest class: each weighs {:.1} times as much \
                 (training.max_ratio = {})",
                c.samples, c.weight, params.max_ratio
            )),
            _ => None,
        }
    };
    counts.iter().filter_map(warning).collect()
}
