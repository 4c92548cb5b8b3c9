//! Two classifiers, each trained on the samples in the squares of one colour.

use crate::classes::ClassTable;
use crate::classification::{Classifier, Samples};
use crate::error::Result;
use crate::memory;
use crate::parallel::Monitor;
use crate::random::stream;

/// What is learned from, and how.
pub(in crate::recipes) struct CrossTraining<'a, L> {
    pub(in crate::recipes) samples: Samples<'a>,
    /// Colour of the square of each sample, 0 or 1.
    pub(in crate::recipes) colours: &'a [usize],
    pub(in crate::recipes) classes: &'a ClassTable,
    pub(in crate::recipes) seed: u64,
    /// Trains a classifier.
    pub(in crate::recipes) learn: L,
}

impl<L: Fn(&Samples<'_>, &Monitor) -> Result<Classifier>> CrossTraining<'_, L> {
    /// The classifiers of both colours, each of at most so many random samples; `None` if one colour has fewer than two
    /// classes.
    pub(super) fn halves(&self, most: usize, monitor: &Monitor) -> Result<Option<[Classifier; 2]>> {
        let parts = [self.part(0, most), self.part(1, most)];
        let several = |part: &Vec<usize>| {
            let mut labels = part.iter().map(|&i| self.samples.labels[i]);
            let first = labels.next();
            labels.any(|label| Some(label) != first)
        };
        match parts.iter().all(several) {
            true => Ok(Some([self.learnt(&parts[0], monitor)?, self.learnt(&parts[1], monitor)?])),
            false => Ok(None),
        }
    }

    /// Random samples of one colour, ascending.
    fn part(&self, colour: usize, most: usize) -> Vec<usize> {
        let samples = &self.samples;
        let own: Vec<usize> =
            (0..samples.len()).filter(|&i| self.colours[i] == colour && samples.weight(i) > 0.0).collect();
        let chosen = stream(self.seed, 0x6368_6f69 + colour as u64).choose(own.len(), most);
        chosen.into_iter().map(|i| own[i as usize]).collect()
    }

    fn learnt(&self, part: &[usize], monitor: &Monitor) -> Result<Classifier> {
        let samples = &self.samples;
        let labels: Vec<u16> = part.iter().map(|&i| samples.labels[i]).collect();
        let mut features = memory::filled(0.0f32, part.len() * samples.width, "the samples of one colour")?;
        features.chunks_exact_mut(samples.width).zip(part).for_each(|(row, &i)| row.copy_from_slice(samples.row(i)));
        let weights = samples.weights.map(|all| part.iter().map(|&i| all[i]).collect::<Vec<f32>>());
        let part = Samples { features: &features, labels: &labels, weights: weights.as_deref(), ..*samples };
        (self.learn)(&part, monitor)
    }
}
