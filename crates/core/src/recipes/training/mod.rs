//! The first and the last steps in the training of every method: the labelled clouds in metres, their classes, and
//! counts for the report.

pub(in crate::recipes) mod blocks;
pub(in crate::recipes) mod checkerboard;
pub(in crate::recipes) mod choice;
pub(in crate::recipes) mod classifiers;
pub(in crate::recipes) mod networks;
pub(in crate::recipes) mod samples;
pub(in crate::recipes) mod sources;

use crate::classes::ClassTable;
use crate::cloud::{ClassNames, CodeScheme, MetricCloud};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::labels::{LabelledCloud, Labels};
use crate::recipes::system::report::ClassCount;
use crate::voxels::planar_density;

/// The clouds that a method is trained on.
pub(in crate::recipes) struct TrainingData<'a> {
    /// Each cloud in metres, with its labels.
    pub(in crate::recipes) scenes: Vec<LabelledScene<'a>>,
    /// Number of points with each code, over all clouds.
    points: [u64; 256],
}

/// A cloud in metres, and its labels.
pub(in crate::recipes) struct LabelledScene<'a> {
    pub(in crate::recipes) metric: MetricCloud<'a>,
    pub(in crate::recipes) labels: &'a Labels,
}

/// The samples of a class.
#[derive(Clone, Copy, Default)]
pub(in crate::recipes) struct ClassSamples {
    pub(in crate::recipes) count: u64,
    /// Weight of each.
    pub(in crate::recipes) weight: f64,
}

impl<'a> TrainingData<'a> {
    /// Decides the unit of each cloud (`metres_per_unit` of the recipe, else its own), and warns of stray points.
    ///
    /// # Errors
    /// If coordinates are degrees, or the work was cancelled.
    pub(in crate::recipes) fn new(
        clouds: &'a [LabelledCloud],
        metres_per_unit: Option<f64>,
        monitor: &Monitor,
    ) -> Result<Self> {
        let mut points = [0u64; 256];
        let mut scenes = Vec::with_capacity(clouds.len());
        for LabelledCloud { cloud, labels } in clouds {
            let metric = MetricCloud::new(cloud, metres_per_unit, monitor)?;
            metric.oddities().into_iter().for_each(|text| monitor.warn(text));
            labels.counts().iter().zip(&mut points).for_each(|(n, sum)| *sum += n);
            scenes.push(LabelledScene { metric, labels });
        }
        Ok(Self { scenes, points })
    }

    /// Number of points with this code.
    pub(in crate::recipes) fn points_with(&self, code: u8) -> u64 {
        self.points[usize::from(code)]
    }

    /// Number of points without a label.
    pub(in crate::recipes) fn unlabelled(&self) -> u64 {
        self.scenes.iter().map(|scene| scene.labels.unlabelled).sum()
    }

    /// The classes with these codes, with the names of the only known list among the labels.
    pub(in crate::recipes) fn class_table(&self, codes: &[u8]) -> ClassTable {
        let mut known = self.scenes.iter().map(|scene| scene.labels.scheme).filter(|&s| s != CodeScheme::Own);
        let first = known.next().unwrap_or_default();
        let scheme = if known.all(|s| s == first) { first } else { CodeScheme::Own };
        let mut own = ClassNames::new();
        // The first cloud that names a class counts.
        for scene in &self.scenes {
            scene.labels.names.iter().for_each(|(&code, name)| _ = own.entry(code).or_insert_with(|| name.clone()));
        }
        ClassTable::named(codes, scheme, &own)
    }

    /// All classes that are labelled.
    pub(in crate::recipes) fn labelled_classes(&self) -> ClassTable {
        let codes: Vec<u8> = (0..=255u8).filter(|&code| self.points[usize::from(code)] > 0).collect();
        self.class_table(&codes)
    }

    /// Points and samples of each labelled class, for the report.
    pub(in crate::recipes) fn class_counts(&self, samples: impl Fn(u8) -> ClassSamples) -> Vec<ClassCount> {
        let table = self.labelled_classes();
        let count = table.classes().iter().map(|class| {
            let ClassSamples { count, weight } = samples(class.code);
            let points = self.points[usize::from(class.code)];
            ClassCount { code: class.code, name: class.name.clone(), points, samples: count, weight }
        });
        count.collect()
    }
}

/// Fails if there are fewer than two classes.
pub(in crate::recipes) fn check_classes(classes: &ClassTable) -> Result<()> {
    let advice = "check the label dimension, and which codes are mapped, asked for and count as unlabelled";
    match classes.classes() {
        [] => Err(Error::input(format!("no labelled point to learn from; {advice}"))),
        [one] => Err(Error::input(format!(
            "only one class to learn, code {} ({}): a model needs two or more; {advice}",
            one.code, one.name
        ))),
        _ => Ok(()),
    }
}

/// Mean of the densities of the clouds; 0 without clouds.
pub(in crate::recipes) fn mean_density(densities: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = densities.len().max(1) as f64;
    densities.sum::<f64>() / count
}

/// Mean density of the clouds, points per square metre.
pub(in crate::recipes) fn density(data: &TrainingData<'_>, monitor: &Monitor) -> Result<f64> {
    let density = |scene: &LabelledScene<'_>| planar_density(&scene.metric.points(monitor)?.positions, monitor);
    let densities = data.scenes.iter().map(density).collect::<Result<Vec<_>>>()?;
    Ok(mean_density(densities.into_iter()))
}
