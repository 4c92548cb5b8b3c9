//! Training on a few labelled points.

use super::WeakRecipe;
use super::describe::{self, Described, DescribedScene, LabelledRows, head};
use super::examples::{Example, WeakLabels, examples};
use super::learned::{LabelledPosition, RoadExample, WeakLearned};
use super::report::{StrengthScore, WeakReport};
use super::shares::{most_probable, shares_of};
use crate::classes::{Class, ClassTable};
use crate::classification::cross_validation::stratified_folds;
use crate::classification::{ClassifierParams, Fingerprint, Samples};
use crate::cloud::{Cloud, Points};
use crate::error::Result;
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::recipes::labels::{check_classes, check_labels, class_table, counts_of};
use crate::recipes::points::{note_oddities, points_of};
use crate::recipes::regularise::{Probabilities, Regularise, RegulariseParams, Scene};
use crate::recipes::{ClassCount, Fitted, Labels, Model, System, TrainOptions};
use crate::segmentation::Intent;
use crate::voxels::planar_density;

/// The labelled points of one cloud and their features.
struct LabelledPoints<'a> {
    /// All points of the first cloud, if strengths are to be tried on it.
    described: Option<Described<'a>>,
    examples: Vec<Example>,
    /// One row a labelled point.
    rows: FeatureTable,
    density: f64,
}

/// Trains on the labelled points of one or more clouds. The unlabelled points only contribute to the neighbourhoods.
///
/// With `options.strengths`, the random field uses the strength that predicts most of the held-out labels correctly
/// (ties to the smallest), measured on the first cloud.
pub(super) fn train(
    recipe: &WeakRecipe,
    clouds: &[(Cloud, Labels)],
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<(Model, WeakReport)> {
    recipe.validate()?;
    check_labels(clouds)?;
    let Study { mut recipe, studied, partitions, road, held } = study(clouds, recipe, options, monitor)?;
    let codes: Vec<u8> = studied.iter().flat_map(|l| l.examples.iter().map(|e| e.code)).collect();
    let classes = class_table(&codes, clouds);
    check_classes(&classes)?;
    let labels: Vec<u16> = codes.iter().filter_map(|&code| classes.position(code)).map(|p| p as u16).collect();
    let learned = WeakLearned { shares: shares_of(&labels, classes.len()), road, labels: held };
    let strengths = match (&options.strengths[..], studied.first()) {
        ([], _) | (_, None) => Vec::new(),
        (_, Some(labelled)) => {
            Search { labelled, recipe: &recipe, shares: &learned.shares }.run(&classes, options, monitor)?
        }
    };
    if let Some(best) = best_of(&strengths) {
        recipe.regularise.strength = best;
    }
    let density = studied.iter().map(|l| l.density).sum::<f64>() / studied.len().max(1) as f64;
    let FeatureTable { names: feature_names, values: rows } = table(studied);
    let (width, count) = (feature_names.len(), classes.len());
    let samples = Samples { features: &rows, width, labels: &labels, weights: None, classes: count };
    let classifier = seeded(&recipe).train(&samples, monitor)?;
    let (classes_counted, road_examples) =
        (counts(clouds, &codes, &classes), learned.road.iter().filter(|e| e.road).count());
    let report = WeakReport {
        classes: classes_counted,
        unlabelled: clouds.iter().map(|(_, l)| l.unlabelled).sum(),
        road_examples,
        partitions,
        strengths,
        strength: recipe.regularise.strength,
        warnings: warnings(&recipe, road_examples),
    };
    let model = Model {
        fingerprint: Fingerprint::of(&samples, density),
        fitted: Fitted { recipe, learned }.into(),
        feature_names,
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

/// What all clouds give: labelled points with their features, and the recipe with its open choices made.
struct Study<'a> {
    recipe: WeakRecipe,
    studied: Vec<LabelledPoints<'a>>,
    /// Partition strengths that were tried.
    partitions: Vec<StrengthScore>,
    road: Vec<RoadExample>,
    held: Vec<LabelledPosition>,
}

/// Describes the labelled points of every cloud. The strength of the partition and the finest scale are those of the
/// first cloud. If strengths are to be tried, the features of all points of the first cloud are kept.
fn study<'a>(
    clouds: &'a [(Cloud, Labels)],
    recipe: &WeakRecipe,
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<Study<'a>> {
    let mut drafts = Vec::new();
    note_oddities(clouds.iter().map(|(cloud, _)| cloud), monitor)?;
    for (c, (cloud, labels)) in clouds.iter().enumerate() {
        let points = points_of(cloud, recipe.features.metres_per_unit, monitor)?;
        let seed = recipe.seed.wrapping_add(c as u64);
        let examples = examples(labels, &points.frame.index, &recipe.labels, seed)?;
        let local = describe::local(&points.positions, recipe, monitor)?;
        drafts.push(Draft { cloud, points, examples, local });
    }
    // The step that needs most memory comes first, while little else is held.
    let (mut recipe, partitions) = fit_partition(&drafts, recipe, monitor)?;
    let (mut road, mut held) = (Vec::new(), Vec::new());
    for Draft { cloud, points, examples, local } in &drafts {
        road.extend(recipe.road.learn(examples, local));
        let position = |point: u32| cloud.xyz(points.frame.index[point as usize] as usize);
        held.extend(recipe.labels.remember(examples, position));
    }
    let mut studied = Vec::new();
    for Draft { cloud, points, examples, local } in drafts {
        let elevation = options.elevation.as_ref();
        let scene = DescribedScene { cloud, points: &points, examples: &road, elevation };
        let six = describe::six(&scene, local, &recipe, monitor)?;
        let at: Vec<u32> = examples.iter().map(|e| e.point).collect();
        let own = describe::select(&six, &at);
        let places: Vec<u32> = at.iter().map(|&point| points.frame.index[point as usize]).collect();
        let first = !options.strengths.is_empty() && studied.is_empty();
        let described = first.then_some(Described { cloud, points, six });
        let more = describe::more(&recipe, None);
        let (rows, scale) = describe::rows(cloud, LabelledRows { six: own, places: &places }, more.as_ref(), monitor)?;
        // The finest scale of the first cloud is used for the others, and for all clouds that the model classifies.
        recipe.features.pyramid.first_scale = scale.or(recipe.features.pyramid.first_scale);
        let density = planar_density(cloud, cloud.metres_per_unit.unwrap_or(1.0), monitor)?;
        studied.push(LabelledPoints { described, examples, rows, density });
    }
    Ok(Study { recipe, studied, partitions, road, held })
}

/// The rows of all clouds; their other data are freed.
fn table(studied: Vec<LabelledPoints<'_>>) -> FeatureTable {
    let mut tables = studied.into_iter().map(|labelled| labelled.rows);
    let mut all = tables.next().unwrap_or_default();
    tables.for_each(|table| all.values.extend_from_slice(&table.values));
    all
}

fn seeded(recipe: &WeakRecipe) -> ClassifierParams {
    ClassifierParams::Forest(recipe.forest.clone()).with_seed(recipe.seed)
}

/// The recipe with segments so fine that whole segments can be consistent with the labels of the first cloud.
///
/// The paper's strength suits its street scans; on airborne scans roofs and ground would share segments.
fn fit_partition(
    drafts: &[Draft<'_>],
    recipe: &WeakRecipe,
    monitor: &Monitor,
) -> Result<(WeakRecipe, Vec<StrengthScore>)> {
    let (mut recipe, mut tried) = (recipe.clone(), Vec::new());
    let voting = matches!(recipe.regularise.method, Regularise::Consensus | Regularise::SegmentCrf);
    let (Some(draft), true) = (drafts.first(), voting && recipe.labels.fit_partition) else {
        return Ok((recipe, tried));
    };
    let mut labels = vec![None; draft.points.len()];
    draft.examples.iter().for_each(|e| labels[e.point as usize] = Some(e.code));
    while let Intent::Strength(strength) = recipe.regularise.partition.intent {
        let scene = Scene::new(&draft.points.positions, Some(&draft.local), &recipe.regularise, monitor)?;
        let accuracy = scene.oracle_accuracy(&labels)?.unwrap_or(1.0);
        tried.push(StrengthScore { strength, accuracy });
        let WeakLabels { fit_accuracy, fit_trials, fit_step, .. } = recipe.labels;
        if accuracy >= fit_accuracy || tried.len() >= fit_trials || strength <= 0.0 {
            break;
        }
        recipe.regularise.partition.intent = Intent::Strength(strength * fit_step);
    }
    Ok((recipe, tried))
}

/// The search for the strength of the random field on the labels of one cloud.
struct Search<'a> {
    labelled: &'a LabelledPoints<'a>,
    recipe: &'a WeakRecipe,
    /// Share of each class in the labels.
    shares: &'a [f64],
}

impl Search<'_> {
    /// Accuracy of every strength on the held-out labels.
    fn run(&self, classes: &ClassTable, options: &TrainOptions, monitor: &Monitor) -> Result<Vec<StrengthScore>> {
        let Self { labelled, recipe, shares } = self;
        let labels: Vec<u16> =
            labelled.examples.iter().filter_map(|e| classes.position(e.code)).map(|p| p as u16).collect();
        let (strengths, count) = (&options.strengths, options.folds());
        let folds = stratified_folds(&labels, count, recipe.seed)?;
        let Some(described) = &labelled.described else { return Ok(Vec::new()) };
        let scene = Scene::new(&described.points.positions, Some(&head(&described.six)), &recipe.regularise, monitor)?;
        let more = describe::more(recipe, None);
        let mut right = vec![0usize; strengths.len()];
        for fold in 0..count as u32 {
            let kept: Vec<usize> = (0..labels.len()).filter(|&i| folds[i] != fold).collect();
            let rows: Vec<f32> = kept.iter().flat_map(|&i| labelled.rows.row(i)).copied().collect();
            let names: Vec<u16> = kept.iter().map(|&i| labels[i]).collect();
            let (width, classes) = (labelled.rows.width(), classes.len());
            let samples = Samples { features: &rows, width, labels: &names, weights: None, classes };
            let forest = seeded(recipe).train(&samples, monitor)?;
            let mut values = described.probabilities(&forest, more.as_ref(), monitor)?;
            let counts = most_probable(&values, classes);
            recipe.shares.apply(&mut values, &counts, shares);
            for (s, &strength) in strengths.iter().enumerate() {
                let params = RegulariseParams { strength, ..recipe.regularise.clone() };
                params.validate()?;
                let found = scene.decide(Probabilities { values: &values, classes }, &params, monitor)?;
                let held = (0..labels.len()).filter(|&i| folds[i] == fold);
                right[s] += held.filter(|&i| found.labels[labelled.examples[i].point as usize] == labels[i]).count();
            }
        }
        let score = |(&strength, right): (&f64, usize)| StrengthScore {
            strength,
            accuracy: right as f64 / labels.len() as f64,
        };
        Ok(strengths.iter().zip(right).map(score).collect())
    }
}

/// The strength of the best accuracy; the smallest of equal ones.
fn best_of(scores: &[StrengthScore]) -> Option<f64> {
    let better = |a: &&StrengthScore, b: &&StrengthScore| {
        a.accuracy.total_cmp(&b.accuracy).then(b.strength.total_cmp(&a.strength))
    };
    scores.iter().max_by(better).map(|s| s.strength)
}

/// Number of labelled points of each class, and of those used.
fn counts(clouds: &[(Cloud, Labels)], codes: &[u8], classes: &ClassTable) -> Vec<ClassCount> {
    let points = counts_of(clouds);
    let samples = |code| codes.iter().filter(|&&c| c == code).count() as u64;
    let count = |c: &Class| ClassCount {
        code: c.code,
        name: c.name.clone(),
        points: points[usize::from(c.code)],
        samples: samples(c.code),
        weight: 1.0,
    };
    classes.classes().iter().map(count).collect()
}

fn warnings(recipe: &WeakRecipe, road_examples: usize) -> Vec<String> {
    match road_examples {
        0 => vec![format!("no label is road (road.codes {:?}): the lowest points stand in for it", recipe.road.codes)],
        _ => Vec::new(),
    }
}
