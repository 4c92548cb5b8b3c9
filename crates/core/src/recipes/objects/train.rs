//! Trains on a share of the segments and evaluates on the others.

use super::ObjectsRecipe;
use super::describe::{Objects, objects};
use super::report::ObjectsReport;
use super::split::{Labelled, split};
use crate::classes::ClassTable;
use crate::classification::{Classifier, Fingerprint, Predictor, Samples};
use crate::error::Result;
use crate::evaluation::{Confusion, Scores};
use crate::parallel::Monitor;
use crate::recipes::training::sources::with_reasons;
use crate::recipes::training::{ClassSamples, LabelledScene, TrainingData, check_classes, mean_density};
use crate::recipes::{ClassCount, Fitted, LabelledCloud, Nothing, System, Trained, TrainingResult};
use crate::segmentation::{Majority, majorities};
use crate::voxels::planar_density;

/// The segments of one cloud with their features.
struct CloudSegments {
    found: Objects,
    /// The most frequent label of each segment.
    votes: Vec<Majority>,
    /// Class of each segment, if it has one.
    codes: Vec<Option<u8>>,
    learned: Vec<bool>,
    /// Label of each point of `found`.
    truth: Vec<Option<u8>>,
    density: f64,
}

/// Trains on a share of the segments of one or more labelled clouds; the class of a segment is the most frequent one of
/// its points.
///
/// # Errors
/// If fewer than two classes are labelled, a parameter is out of range, a cloud lacks the requested colours, or the
/// work was cancelled.
pub(super) fn train(
    recipe: &ObjectsRecipe,
    clouds: &[LabelledCloud],
    monitor: &Monitor,
) -> Result<TrainingResult<ObjectsRecipe>> {
    recipe.validate()?;
    let data = TrainingData::new(clouds, recipe.metres_per_unit(), monitor)?;
    check_classes(&data.labelled_classes())?;
    let mut recipe = recipe.clone();
    let mut studied = Vec::new();
    for (c, scene) in data.scenes.iter().enumerate() {
        let cloud_segments = study(scene, &recipe, recipe.seed.wrapping_add(c as u64), monitor)?;
        // The first cloud decides whether the model uses colours.
        recipe.segments.colour = Some(cloud_segments.found.coloured);
        studied.push(cloud_segments);
    }
    let codes: Vec<u8> = studied.iter().flat_map(|l| l.codes.iter().flatten().copied()).collect();
    let classes = data.class_table(&codes);
    let counts = counts(&data, &studied);
    let warnings: Vec<String> = counts.iter().filter(|c| c.samples == 0).map(|c| unlearned(c, &classes)).collect();
    check_classes(&classes).map_err(|e| with_reasons(e, &warnings))?;
    let (rows, labels) = table(&studied, &classes);
    let names = studied.first().map(|l| l.found.features.names.clone()).unwrap_or_default();
    let samples =
        Samples { features: &rows, width: names.len(), labels: &labels, weights: None, classes: classes.len() };
    let classifier = recipe.classifier().with_seed(recipe.seed).train(&samples, monitor)?;
    let (by_segment, by_point) = held_out(&studied, &Answer { classifier: &classifier, classes: &classes })?;
    let report = ObjectsReport {
        unlabelled: data.unlabelled(),
        segments: studied.iter().map(|l| l.codes.len()).sum(),
        labelled: studied.iter().flat_map(|l| &l.codes).flatten().count(),
        learned: counts.iter().map(|c| c.samples as usize).sum(),
        classes: counts,
        oracle_accuracy: oracle(&studied),
        by_segment,
        by_point,
        warnings,
    };
    let density = mean_density(studied.iter().map(|l| l.density));
    let trained = Trained {
        cars: None,
        earlier: Vec::new(),
        network: None,
        fingerprint: Fingerprint::of(&samples, density),
        feature_names: names,
        classes,
        classifier,
    };
    Ok(TrainingResult { fitted: Fitted { recipe, learned: Nothing {} }, trained, report })
}

fn study(scene: &LabelledScene<'_>, recipe: &ObjectsRecipe, seed: u64, monitor: &Monitor) -> Result<CloudSegments> {
    let found = objects(&scene.metric, recipe, monitor)?;
    let truth = scene.labels.of(&found.points.frame.index);
    let votes = majorities(&found.partition, &truth)?;
    let pure = |m: &Majority| f64::from(m.votes) >= recipe.training.purity * f64::from(m.labelled);
    let codes: Vec<Option<u8>> = votes.iter().map(|m| m.code.filter(|_| pure(m))).collect();
    let named: Vec<usize> = (0..codes.len()).filter(|&s| codes[s].is_some()).collect();
    let segments: Vec<Labelled> =
        named.iter().map(|&s| Labelled { code: codes[s].unwrap_or_default(), at: middle(&found, s) }).collect();
    let mut learned = vec![false; codes.len()];
    named.iter().zip(split(&segments, &recipe.training, seed)).for_each(|(&s, chosen)| learned[s] = chosen);
    let density = planar_density(&found.points.positions, monitor)?;
    Ok(CloudSegments { found, votes, codes, learned, truth, density })
}

/// Mean position of a segment, metres.
fn middle(found: &Objects, segment: usize) -> [f64; 2] {
    let members = found.partition.members(segment);
    let mean = |axis: &[f32]| members.iter().map(|&i| f64::from(axis[i as usize])).sum::<f64>() / members.len() as f64;
    [mean(&found.points.positions.x), mean(&found.points.positions.y)]
}

/// A classifier and its classes.
struct Answer<'a> {
    classifier: &'a Classifier,
    classes: &'a ClassTable,
}

/// Feature rows of the training segments, and the positions of their classes.
fn table(studied: &[CloudSegments], classes: &ClassTable) -> (Vec<f32>, Vec<u16>) {
    let (mut rows, mut labels) = (Vec::new(), Vec::new());
    for cloud_segments in studied {
        for s in (0..cloud_segments.codes.len()).filter(|&s| cloud_segments.learned[s]) {
            if let Some(position) = cloud_segments.codes[s].and_then(|code| classes.position(code)) {
                rows.extend_from_slice(cloud_segments.found.features.row(s));
                labels.push(position as u16);
            }
        }
    }
    (rows, labels)
}

/// Points and training segments of each labelled class.
fn counts(data: &TrainingData<'_>, studied: &[CloudSegments]) -> Vec<ClassCount> {
    data.class_counts(|code| {
        let of = |l: &CloudSegments| l.codes.iter().zip(&l.learned).filter(|(c, l)| **c == Some(code) && **l).count();
        let count = studied.iter().map(of).sum::<usize>() as u64;
        ClassSamples { count, weight: if count > 0 { 1.0 } else { 0.0 } }
    })
}

/// The warning about a class without samples.
fn unlearned(class: &ClassCount, classes: &ClassTable) -> String {
    let (title, points) = (class.title(), class.points);
    match classes.position(class.code) {
        Some(_) => format!("{title} is in no segment that was used for training"),
        None => format!("{title} is left out: its {points} points are the majority of no segment"),
    }
}

fn oracle(studied: &[CloudSegments]) -> f64 {
    let votes = || studied.iter().flat_map(|l| &l.votes);
    let right: u64 = votes().map(|m| u64::from(m.votes)).sum();
    let all: u64 = votes().map(|m| u64::from(m.labelled)).sum();
    right as f64 / all.max(1) as f64
}

/// Scores of the segments that were not used for training, and of their points.
fn held_out(studied: &[CloudSegments], answer: &Answer<'_>) -> Result<(Option<Scores>, Option<Scores>)> {
    let Answer { classifier, classes } = *answer;
    let (mut segments, mut points) = (Confusion::new(classes.clone()), Confusion::new(classes.clone()));
    for cloud_segments in studied {
        let predicted = classifier.predict(&cloud_segments.found.features.values)?;
        for (s, code) in cloud_segments.codes.iter().enumerate().filter(|(s, _)| !cloud_segments.learned[*s]) {
            let (Some(code), name) = (code, classes.classes()[usize::from(predicted[s])].code) else { continue };
            segments.add(*code, name)?;
            let known =
                cloud_segments.found.partition.members(s).iter().filter_map(|&i| cloud_segments.truth[i as usize]);
            // A class that is not the majority in any segment is missing in the table; its points cannot be classified
            // correctly.
            for truth in known.filter(|&truth| classes.position(truth).is_some()) {
                points.add(truth, name)?;
            }
        }
    }
    let scores = |found: &Confusion| (found.points() > 0).then(|| found.scores());
    Ok((scores(&segments), scores(&points)))
}
