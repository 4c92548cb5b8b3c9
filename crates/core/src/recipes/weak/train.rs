//! Training on a few labelled points.

use super::WeakRecipe;
use super::describe::{DescribedCloud, PaperDescriptors, RoadSources, WeakScene, paper_descriptors, scaled_features};
use super::examples::{Example, WeakLabels, examples};
use super::learned::{LabelledPosition, WeakLearned};
use super::report::{StrengthScore, WeakReport};
use super::shares::{most_probable, shares_of};
use crate::classification::cross_validation::stratified_folds;
use crate::classification::{ClassifierParams, Fingerprint, Samples};
use crate::error::Result;
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::recipes::regularise::{
    DescribedPoints, Probabilities, RegulariseParams, Segments, Support, adjacency, partition,
};
use crate::recipes::training::{ClassSamples, LabelledScene, TrainingData, check_classes, mean_density};
use crate::recipes::{Fitted, LabelledCloud, System, TrainOptions, Trained, TrainingResult};
use crate::segmentation::Intent;
use crate::terrain::RoadExample;
use crate::voxels::planar_density;

/// The labelled points of one cloud and their features.
struct LabelledPoints<'a> {
    /// All points of the first cloud, if strengths are to be tried on it.
    trial: Option<Trial<'a>>,
    examples: Vec<Example>,
    /// One row a labelled point.
    rows: FeatureTable,
    density: f64,
}

/// A cloud on which strengths of the random field are tried.
struct Trial<'a> {
    described: DescribedCloud<'a>,
    support: Support,
}

/// Trains on the labelled points of one or more clouds. The unlabelled points only contribute to the neighbourhoods.
///
/// With `options.strengths`, the random field uses the strength that predicts most of the held-out labels correctly
/// (ties to the smallest), measured on the first cloud.
pub(super) fn train(
    recipe: &WeakRecipe,
    clouds: &[LabelledCloud],
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<TrainingResult<WeakRecipe>> {
    recipe.validate()?;
    let data = TrainingData::new(clouds, recipe.metres_per_unit(), monitor)?;
    check_classes(&data.labelled_classes())?;
    let Study { mut recipe, studied, partitions, road, held, warnings } = study(&data, recipe, options, monitor)?;
    let codes: Vec<u8> = studied.iter().flat_map(|l| l.examples.iter().map(|e| e.code)).collect();
    let classes = data.class_table(&codes);
    check_classes(&classes)?;
    let labels: Vec<u16> = codes.iter().filter_map(|&code| classes.position(code)).map(|p| p as u16).collect();
    let learned = WeakLearned { shares: shares_of(&labels, classes.len()), road, labels: held };
    let strengths = match studied.first() {
        Some(labelled) => StrengthTrials { labelled, recipe: &recipe, shares: &learned.shares }.run(
            &labels[..labelled.examples.len()],
            options,
            monitor,
        )?,
        None => Vec::new(),
    };
    if let Some(best) = best_of(&strengths) {
        recipe.regularise.strength = best;
    }
    let density = mean_density(studied.iter().map(|l| l.density));
    let FeatureTable { names: feature_names, values: rows } = table(studied);
    let (width, count) = (feature_names.len(), classes.len());
    let samples = Samples { features: &rows, width, labels: &labels, weights: None, classes: count };
    let classifier = seeded(&recipe).train(&samples, monitor)?;
    let road_examples = learned.road.iter().filter(|e| e.road).count();
    let samples_of = |code| ClassSamples { count: codes.iter().filter(|&&c| c == code).count() as u64, weight: 1.0 };
    let report = WeakReport {
        classes: data.class_counts(samples_of),
        unlabelled: data.unlabelled(),
        road_examples,
        partitions,
        strengths,
        strength: recipe.regularise.strength,
        warnings,
    };
    let trained = Trained {
        cars: None,
        earlier: Vec::new(),
        network: None,
        fingerprint: Fingerprint::of(&samples, density),
        feature_names,
        classes,
        classifier,
    };
    Ok(TrainingResult { fitted: Fitted { recipe, learned }, trained, report })
}

/// A cloud of which only the local descriptors have been computed.
struct Draft<'a> {
    scene: WeakScene<'a>,
    examples: Vec<Example>,
}

/// Labelled points of all clouds with their features, and the recipe with automatic choices replaced by values.
struct Study<'a> {
    recipe: WeakRecipe,
    studied: Vec<LabelledPoints<'a>>,
    /// Partition strengths that were tried.
    partitions: Vec<StrengthScore>,
    road: Vec<RoadExample>,
    held: Vec<LabelledPosition>,
    /// Warnings for the user, each once.
    warnings: Vec<String>,
}

/// Describes the labelled points of every cloud. The strength of the partition and the finest scale are those of the
/// first cloud. If strengths are to be tried, the features of all points of the first cloud are kept.
fn study<'a>(
    data: &'a TrainingData<'a>,
    recipe: &WeakRecipe,
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<Study<'a>> {
    let mut drafts = Vec::new();
    for (c, LabelledScene { metric, labels }) in data.scenes.iter().enumerate() {
        let scene = WeakScene::new(metric, recipe, monitor)?;
        let seed = recipe.seed.wrapping_add(c as u64);
        let examples = examples(labels, &scene.points.frame.index, &recipe.labels, seed)?;
        drafts.push(Draft { scene, examples });
    }
    // The graph of the points needs most memory: it comes first, while little else is held.
    let Fit { mut recipe, tried: partitions, mut support } = fit_partition(&drafts, recipe, options, monitor)?;
    let (mut road, mut held) = (Vec::new(), Vec::new());
    for Draft { scene, examples } in &drafts {
        road.extend(recipe.road.learn(examples, &scene.local));
        let position = |point: u32| scene.metric.cloud.xyz(scene.points.frame.index[point as usize] as usize);
        held.extend(recipe.labels.remember(examples, position));
    }
    let (mut studied, mut warnings) = (Vec::new(), Vec::new());
    for Draft { mut scene, examples } in drafts {
        let sources = RoadSources { examples: &road, elevation: options.elevation.as_ref() };
        let PaperDescriptors { table: paper, warning } = paper_descriptors(&scene, sources, &recipe, monitor)?;
        warnings.extend(warning.filter(|text| !warnings.contains(text)));
        scene.local = FeatureTable::default();
        let (metric, described) = (scene.metric, DescribedCloud { scene, paper });
        let density = planar_density(&described.scene.points.positions, monitor)?;
        let at: Vec<u32> = examples.iter().map(|e| e.point).collect();
        let selected = described.select(&at);
        // The descriptors of all points are freed unless strengths are to be tried on them.
        let trial = support.take().map(|support| Trial { described, support });
        let (rows, scale) = selected.rows(metric, scaled_features(&recipe), monitor)?;
        // The finest scale of the first cloud is used for the others, and for all clouds that the model classifies.
        recipe.features.pyramid.first_scale = scale.or(recipe.features.pyramid.first_scale);
        studied.push(LabelledPoints { trial, examples, rows, density });
    }
    Ok(Study { recipe, studied, partitions, road, held, warnings })
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

/// The strength of the partition, chosen on the first cloud.
struct Fit {
    recipe: WeakRecipe,
    /// Strengths that were tried, and their oracle accuracy.
    tried: Vec<StrengthScore>,
    /// Support for the random field on the first cloud, if strengths of the field are to be tried.
    support: Option<Support>,
}

/// Chooses segments so fine that whole segments can be consistent with the labels of the first cloud.
///
/// The paper's strength suits its street scans; on airborne scans roofs and ground would share segments.
fn fit_partition(drafts: &[Draft<'_>], recipe: &WeakRecipe, options: &TrainOptions, monitor: &Monitor) -> Result<Fit> {
    let (mut recipe, mut tried) = (recipe.clone(), Vec::new());
    let Some(Draft { scene: WeakScene { points, local, .. }, examples }) = drafts.first() else {
        return Ok(Fit { recipe, tried, support: None });
    };
    let points = &points.positions;
    let wanted = !options.strengths.is_empty();
    if !(recipe.regularise.method.has_segments() && recipe.labels.fit_partition) {
        let support = wanted.then(|| Support::new(points, Some(local), &recipe.regularise, monitor)).transpose()?;
        return Ok(Fit { recipe, tried, support });
    }
    let mut labels = vec![None; points.len()];
    examples.iter().for_each(|e| labels[e.point as usize] = Some(e.code));
    let described = DescribedPoints { points, descriptors: local, labels: Some(&labels) };
    let graph = adjacency(points, &recipe.regularise, monitor)?;
    let mut found = None;
    while let Intent::Strength(strength) = recipe.regularise.partition.intent {
        let search = partition(described, &graph, &recipe.regularise.partition, monitor)?;
        let accuracy = search.trials.first().and_then(|trial| trial.oracle_accuracy).unwrap_or(1.0);
        found = wanted.then_some(search);
        tried.push(StrengthScore { strength, accuracy });
        let WeakLabels { fit_accuracy, fit_trials, fit_step, .. } = recipe.labels;
        if accuracy >= fit_accuracy || tried.len() >= fit_trials || strength <= 0.0 {
            break;
        }
        recipe.regularise.partition.intent = Intent::Strength(strength * fit_step);
    }
    let support = match (wanted, found) {
        (false, _) => None,
        (true, Some(found)) => Some(Support::Segments(Segments::new(found, &graph, monitor)?)),
        (true, None) => Some(Support::new(points, Some(local), &recipe.regularise, monitor)?),
    };
    Ok(Fit { recipe, tried, support })
}

/// Trials of strengths of the random field on the labels of one cloud.
struct StrengthTrials<'a> {
    labelled: &'a LabelledPoints<'a>,
    recipe: &'a WeakRecipe,
    /// Share of each class in the labels.
    shares: &'a [f64],
}

impl StrengthTrials<'_> {
    /// Accuracy of every strength on the held-out labels; `labels` are the positions of their classes.
    fn run(&self, labels: &[u16], options: &TrainOptions, monitor: &Monitor) -> Result<Vec<StrengthScore>> {
        let Self { labelled, recipe, shares } = self;
        let Some(Trial { described, support }) = &labelled.trial else { return Ok(Vec::new()) };
        let (strengths, count, classes) = (&options.strengths, options.folds(), shares.len());
        let folds = stratified_folds(labels, count, recipe.seed)?;
        let scaled = scaled_features(recipe);
        let mut right = vec![0usize; strengths.len()];
        for fold in 0..count as u32 {
            let kept: Vec<usize> = (0..labels.len()).filter(|&i| folds[i] != fold).collect();
            let rows: Vec<f32> = kept.iter().flat_map(|&i| labelled.rows.row(i)).copied().collect();
            let names: Vec<u16> = kept.iter().map(|&i| labels[i]).collect();
            let width = labelled.rows.width();
            let samples = Samples { features: &rows, width, labels: &names, weights: None, classes };
            let forest = seeded(recipe).train(&samples, monitor)?;
            let mut values = described.probabilities(&forest, scaled, monitor)?;
            let counts = most_probable(&values, classes);
            recipe.shares.apply(&mut values, &counts, shares);
            for (s, &strength) in strengths.iter().enumerate() {
                let params = RegulariseParams { strength, ..recipe.regularise.clone() };
                params.validate()?;
                let found = support.decide(Probabilities { values: &values, classes }, &params, monitor)?;
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
