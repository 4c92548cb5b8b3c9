//! Training on a few labelled points, and classification of all points.

use super::WeakRecipe;
use super::describe::{self, Described};
use super::examples::{Example, examples};
use super::hold::{self, Known};
use crate::classes::{Class, ClassTable};
use crate::classification::cross_validation::stratified_folds;
use crate::classification::{Classifier, ClassifierParams, Fingerprint, Model, Samples};
use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::recipes::labels::{check_classes, check_labels, class_table, counts_of};
use crate::recipes::points::{note_oddities, points_of};
use crate::recipes::regularise::{Probabilities, Regularise, RegulariseParams, Regularised, Scene};
use crate::recipes::{ClassCount, Labels, planar_density};
use crate::segmentation::Intent;
use serde::Serialize;

/// Oracle accuracy on the labels that the segments must reach, largest number of partition strengths tried, and the
/// factor between them.
const ENOUGH: f64 = 0.9;
const TRIALS: usize = 4;
const FINER: f64 = 0.3;

/// Number of folds in the search for the strength.
const FOLDS: usize = 5;

/// Report of the training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WeakReport {
    /// Per class, ascending by code: number of labelled points, and of those used for training.
    pub classes: Vec<ClassCount>,
    /// Points without a label.
    pub unlabelled: u64,
    /// Number of labelled road points (0: the lowest points were used instead).
    pub road_examples: usize,
    /// Partition strengths that were tried, with the oracle accuracy on the labels; the last one is used.
    pub partitions: Vec<StrengthScore>,
    /// Strengths of the random field that were tried, with their scores; empty if no search was requested.
    pub strengths: Vec<StrengthScore>,
    /// Strength that the model uses.
    pub strength: f64,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Score of a strength on labelled points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StrengthScore {
    /// σ or ρ.
    pub strength: f64,
    /// Share of the labels that were predicted correctly, 0..1.
    pub accuracy: f64,
}

/// The labelled points of one cloud and their features.
struct Lesson<'a> {
    /// All points of the first cloud, if strengths are to be tried on it.
    described: Option<Described<'a>>,
    examples: Vec<Example>,
    /// One row a labelled point.
    rows: FeatureTable,
    density: f64,
}

/// Trains on the labelled points of one or more clouds. The unlabelled points only contribute to the neighbourhoods.
///
/// With `strengths`, the random field uses the strength that predicts most of the held-out labels correctly (5 folds,
/// ties to the smallest), measured on the first cloud.
///
/// # Errors
/// If fewer than two classes are labelled, a parameter is out of range, or the work was cancelled.
pub fn train_weak(
    clouds: &[(Cloud, Labels)],
    recipe: &WeakRecipe,
    strengths: &[f64],
    monitor: &Monitor,
) -> Result<(Model, WeakReport)> {
    recipe.validate()?;
    check_labels(clouds)?;
    let mut recipe = recipe.clone();
    let (lessons, partitions) = study(clouds, &mut recipe, !strengths.is_empty(), monitor)?;
    let codes: Vec<u8> = lessons.iter().flat_map(|l| l.examples.iter().map(|e| e.code)).collect();
    let classes = class_table(&codes, clouds);
    check_classes(&classes)?;
    let labels: Vec<u16> = codes.iter().filter_map(|&code| classes.position(code)).map(|p| p as u16).collect();
    recipe.shares.learn(&labels, classes.len());
    let scores = match (strengths, lessons.first()) {
        ([], _) | (_, None) => Vec::new(),
        (_, Some(lesson)) => search(lesson, (&recipe, &classes), strengths, monitor)?,
    };
    if let Some(best) = best_of(&scores) {
        recipe.regularise.strength = best;
    }
    let density = lessons.iter().map(|l| l.density).sum::<f64>() / lessons.len().max(1) as f64;
    let FeatureTable { names: feature_names, values: rows } = table(lessons);
    let (width, count) = (feature_names.len(), classes.len());
    let samples = Samples { features: &rows, width, labels: &labels, weights: None, classes: count };
    let classifier = Classifier::fit(&samples, &seeded(&recipe), monitor)?;
    let report = WeakReport { partitions, ..report(clouds, (&codes, &classes), &recipe, scores) };
    let model = Model {
        recipe_toml: toml::to_string(&recipe).map_err(|e| Error::input(format!("recipe cannot be written: {e}")))?,
        fingerprint: Fingerprint::of(&samples, density),
        feature_names,
        seed: recipe.seed,
        classes,
        classifier,
    };
    Ok((model, report))
}

/// A cloud of which only the local descriptors have been computed.
struct Draft<'a> {
    cloud: &'a Cloud,
    points: Points,
    examples: Vec<Example>,
    local: FeatureTable,
}

/// Labelled points and features of every cloud. Sets in the recipe the examples of road, from all clouds, and the
/// strength of the partition, from the first. With `search`, the features of all points of the first cloud are kept.
fn study<'a>(
    clouds: &'a [(Cloud, Labels)],
    recipe: &mut WeakRecipe,
    search: bool,
    monitor: &Monitor,
) -> Result<(Vec<Lesson<'a>>, Vec<StrengthScore>)> {
    let mut drafts = Vec::new();
    note_oddities(clouds.iter().map(|(cloud, _)| cloud), monitor)?;
    for (c, (cloud, labels)) in clouds.iter().enumerate() {
        let points = points_of(cloud, recipe.features.metres_per_unit, monitor)?;
        let seed = recipe.seed.wrapping_add(c as u64);
        let examples = examples(labels, &points.index, (&recipe.labels, seed))?;
        let local = describe::local(&points, recipe, monitor)?;
        drafts.push(Draft { cloud, points, examples, local });
    }
    // The step that needs most memory comes first, while little else is held.
    let partitions = fit_partition(&drafts, recipe, monitor)?;
    let mut road = Vec::new();
    recipe.labels.places.clear();
    for Draft { cloud, points, examples, local } in &drafts {
        recipe.road.learn(examples, local);
        road.append(&mut recipe.road.examples);
        if recipe.labels.hold {
            recipe.labels.remember(examples, |point| cloud.xyz(points.index[point as usize] as usize));
        }
    }
    recipe.road.examples = road;
    let mut lessons = Vec::new();
    for Draft { cloud, points, examples, local } in drafts {
        let six = describe::six(cloud, &points, local, recipe, monitor)?;
        let at: Vec<u32> = examples.iter().map(|e| e.point).collect();
        let own = describe::select(&six, &at);
        let places: Vec<u32> = at.iter().map(|&point| points.index[point as usize]).collect();
        let described = (search && lessons.is_empty()).then_some(Described { cloud, points, six });
        let more = describe::more(recipe, None);
        let (rows, scale) = describe::rows(cloud, (own, &places), more.as_ref(), monitor)?;
        // The finest scale of the first cloud is used for the others, and for all clouds that the model classifies.
        recipe.features.pyramid.first_scale = scale.or(recipe.features.pyramid.first_scale);
        let density = planar_density(cloud, cloud.metres_per_unit.unwrap_or(1.0), monitor)?;
        lessons.push(Lesson { described, examples, rows, density });
    }
    Ok((lessons, partitions))
}

/// The rows of all clouds; their other data are freed.
fn table(lessons: Vec<Lesson<'_>>) -> FeatureTable {
    let mut tables = lessons.into_iter().map(|lesson| lesson.rows);
    let mut all = tables.next().unwrap_or_default();
    tables.for_each(|table| all.values.extend_from_slice(&table.values));
    all
}

fn seeded(recipe: &WeakRecipe) -> ClassifierParams {
    ClassifierParams::Forest(recipe.forest.clone()).with_seed(recipe.seed)
}

/// Makes segments finer until whole segments can be consistent with the labels of the first cloud.
///
/// The paper's strength suits its street scans; on airborne scans roofs and ground would share segments.
fn fit_partition(drafts: &[Draft<'_>], recipe: &mut WeakRecipe, monitor: &Monitor) -> Result<Vec<StrengthScore>> {
    let mut tried = Vec::new();
    let voting = matches!(recipe.regularise.method, Regularise::Consensus | Regularise::SegmentCrf);
    let (Some(draft), true) = (drafts.first(), voting && recipe.labels.fit_partition) else { return Ok(tried) };
    let mut labels = vec![None; draft.points.len()];
    draft.examples.iter().for_each(|e| labels[e.point as usize] = Some(e.code));
    while let Intent::Strength(strength) = recipe.regularise.partition.intent {
        let scene = Scene::new(&draft.points, Some(&draft.local), &recipe.regularise, monitor)?;
        let accuracy = scene.oracle_accuracy(&labels)?.unwrap_or(1.0);
        tried.push(StrengthScore { strength, accuracy });
        if accuracy >= ENOUGH || tried.len() == TRIALS || strength <= 0.0 {
            break;
        }
        recipe.regularise.partition.intent = Intent::Strength(strength * FINER);
    }
    Ok(tried)
}

/// Accuracy of every strength on the held-out labels of one cloud.
fn search(
    lesson: &Lesson<'_>,
    (recipe, classes): (&WeakRecipe, &ClassTable),
    strengths: &[f64],
    monitor: &Monitor,
) -> Result<Vec<StrengthScore>> {
    let labels: Vec<u16> = lesson.examples.iter().filter_map(|e| classes.position(e.code)).map(|p| p as u16).collect();
    let folds = stratified_folds(&labels, FOLDS, recipe.seed)?;
    let Some(described) = &lesson.described else { return Ok(Vec::new()) };
    let scene = Scene::new(&described.points, Some(&head(&described.six)), &recipe.regularise, monitor)?;
    let more = describe::more(recipe, None);
    let mut right = vec![0usize; strengths.len()];
    for fold in 0..FOLDS as u32 {
        let kept: Vec<usize> = (0..labels.len()).filter(|&i| folds[i] != fold).collect();
        let rows: Vec<f32> = kept.iter().flat_map(|&i| lesson.rows.row(i)).copied().collect();
        let names: Vec<u16> = kept.iter().map(|&i| labels[i]).collect();
        let (width, classes) = (lesson.rows.width(), classes.len());
        let samples = Samples { features: &rows, width, labels: &names, weights: None, classes };
        let forest = Classifier::fit(&samples, &seeded(recipe), monitor)?;
        let mut values = described.probabilities(&forest, more.as_ref(), monitor)?;
        recipe.shares.apply(&mut values, classes);
        for (s, &strength) in strengths.iter().enumerate() {
            let params = RegulariseParams { strength, ..recipe.regularise.clone() };
            params.validate()?;
            let found = scene.decide(Probabilities { values: &values, classes }, &params, monitor)?;
            let held = (0..labels.len()).filter(|&i| folds[i] == fold);
            right[s] += held.filter(|&i| found.labels[lesson.examples[i].point as usize] == labels[i]).count();
        }
    }
    let score =
        |(&strength, right): (&f64, usize)| StrengthScore { strength, accuracy: right as f64 / labels.len() as f64 };
    Ok(strengths.iter().zip(right).map(score).collect())
}

/// The strength of the best accuracy; the smallest of equal ones.
fn best_of(scores: &[StrengthScore]) -> Option<f64> {
    let better = |a: &&StrengthScore, b: &&StrengthScore| {
        a.accuracy.total_cmp(&b.accuracy).then(b.strength.total_cmp(&a.strength))
    };
    scores.iter().max_by(better).map(|s| s.strength)
}

/// The four local descriptors, which the segments are based on.
fn head(features: &FeatureTable) -> FeatureTable {
    let rows = features.values.chunks_exact(features.width());
    FeatureTable { names: features.names[..4].to_vec(), values: rows.flat_map(|r| &r[..4]).copied().collect() }
}

fn report(
    clouds: &[(Cloud, Labels)],
    (codes, classes): (&[u8], &ClassTable),
    recipe: &WeakRecipe,
    strengths: Vec<StrengthScore>,
) -> WeakReport {
    let points = counts_of(clouds);
    let samples = |code| codes.iter().filter(|&&c| c == code).count() as u64;
    let count = |c: &Class| ClassCount {
        code: c.code,
        name: c.name.clone(),
        points: points[usize::from(c.code)],
        samples: samples(c.code),
        weight: 1.0,
    };
    let classes: Vec<ClassCount> = classes.classes().iter().map(count).collect();
    let road_examples = recipe.road.examples.iter().filter(|e| e.1).count();
    let mut warnings = Vec::new();
    if road_examples == 0 {
        warnings
            .push(format!("no label is road (road.codes {:?}): the lowest points stand in for it", recipe.road.codes));
    }
    let unlabelled = clouds.iter().map(|(_, l)| l.unlabelled).sum();
    let strength = recipe.regularise.strength;
    WeakReport { classes, unlabelled, road_examples, partitions: Vec::new(), strengths, strength, warnings }
}

/// Classifies every finite point of a cloud; returns the points and the decision of the random field.
pub(in crate::recipes) fn classify_weak(
    cloud: &Cloud,
    (model, recipe): (&Model, &WeakRecipe),
    (metres, params): (Option<f64>, &RegulariseParams),
    monitor: &Monitor,
) -> Result<(Points, Regularised)> {
    let unit = cloud.metres(metres.or(recipe.features.metres_per_unit))?;
    let points = points_of(cloud, Some(unit), monitor)?;
    let labels = recipe.labels.found(cloud, (&points, unit), &model.classes, monitor)?;
    let local = describe::local(&points, recipe, monitor)?;
    // The step that needs most memory comes first, while little else is held.
    let mut scene = Scene::to_be_recut(&points, Some(&local), params, monitor)?;
    scene.only_recut_at(labels.iter().map(|(point, _)| *point));
    let six = describe::six(cloud, &points, local, recipe, monitor)?;
    let more = describe::more(recipe, metres);
    let described = Described { cloud, points, six };
    let names = described.names(more.as_ref());
    if names != model.feature_names {
        return Err(Error::ModelMismatch(format!(
            "it needs the features {}; its recipe gives {}",
            model.feature_names.join(", "),
            names.join(", ")
        )));
    }
    let mut values = described.probabilities(&model.classifier, more.as_ref(), monitor)?;
    recipe.shares.apply(&mut values, model.classes.len());
    let given = Probabilities { values: &values, classes: model.classes.len() };
    let Described { points, six, .. } = described;
    let known = Known { descriptors: head(&six), labels };
    drop(six);
    let found = hold::decide(scene, given, (&known, params), monitor)?;
    Ok((points, found))
}
