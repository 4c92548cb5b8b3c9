//! Training. The functions of this file follow the steps of Hackel 2018, chapter 4.4.

use super::PyramidRecipe;
use super::report::PyramidReport;
use super::samples::{Candidate, Sampling, TrainingParams, candidates, copies};
use super::select::chosen_depth;
use crate::classes::{Class, ClassTable};
use crate::classification::sampling::balance;
use crate::classification::{Fingerprint, Predictor, Samples};
use crate::cloud::Cloud;
use crate::error::{Error, Result};
use crate::features::{self, FeatureSet};
use crate::parallel::Monitor;
use crate::recipes::labels::{check_classes, class_table, counts_of};
use crate::recipes::points::note_oddities;
use crate::recipes::{ClassCount, Fitted, Labels, Model, Nothing, System, TrainOptions};
use crate::voxels::cells::cell_of;
use crate::voxels::planar_density;

/// Edge of the squares that cross-validation holds out together, metres.
pub(super) const BLOCK: f64 = 50.0;

/// Samples of one cloud or thinned copy.
struct Source {
    cloud: usize,
    /// `None`: all points of the cloud.
    copy: Option<Vec<u32>>,
    candidates: Vec<Candidate>,
}

/// Trains a model. The finest voxel, if the recipe leaves it open, is that of the first cloud's point spacing; the depth
/// is the best of `options.depths`.
pub(super) fn train(
    recipe: &PyramidRecipe,
    clouds: &[(Cloud, Labels)],
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<(Model, PyramidReport)> {
    options.without_strengths(PyramidRecipe::NAME)?;
    let Prepared { described, recipe, classes, warnings } = prepare(clouds, recipe, monitor)?;
    let (recipe, depths) = chosen_depth(&described, recipe, options, monitor)?;
    let params = recipe.classifier().with_seed(recipe.seed);
    let (classifier, out_of_bag_accuracy) = params.train_with_score(&described.samples(), monitor)?;
    let (classifier, used) = classifier.retain_used();
    let report = PyramidReport {
        classes,
        unlabelled: clouds.iter().map(|(_, l)| l.unlabelled).sum(),
        out_of_bag_accuracy,
        first_scale: recipe.features.pyramid.first_scale.unwrap_or_default(),
        used_features: used.len(),
        features: described.names.len(),
        folds: if options.cross_validates() { options.folds() } else { 0 },
        depths,
        warnings,
    };
    let model = Model {
        fingerprint: Fingerprint::of(&described.samples(), mean_density(clouds, &recipe, monitor)?).select(&used),
        feature_names: used.iter().map(|&f| described.names[f].clone()).collect(),
        fitted: Fitted { recipe, learned: Nothing {} }.into(),
        classes: described.classes,
        classifier,
    };
    Ok((model, report))
}

/// The training samples, and the recipe with the first scale set.
struct Prepared {
    described: Described,
    recipe: PyramidRecipe,
    classes: Vec<ClassCount>,
    warnings: Vec<String>,
}

/// Steps 1 to 3.
fn prepare(clouds: &[(Cloud, Labels)], recipe: &PyramidRecipe, monitor: &Monitor) -> Result<Prepared> {
    recipe.validate()?;
    for (cloud, _) in clouds {
        cloud.metres(recipe.features.metres_per_unit)?;
    }
    note_oddities(clouds.iter().map(|(cloud, _)| cloud), monitor)?;
    let mut sources = gather(clouds, recipe, monitor)?;
    let offered = tally(&sources);
    let weights = choose(&mut sources, recipe)?;
    let counts = count(clouds, &tally(&sources), &weights);
    let warnings = warnings(&counts, &offered, &recipe.training);
    let codes: Vec<u8> = counts.iter().filter(|c| c.samples > 0).map(|c| c.code).collect();
    let classes = class_table(&codes, clouds);
    check_classes(&classes).map_err(|e| with_reasons(e, &warnings))?;
    let described = Described { classes, features: recipe.features.clone(), ..Described::default() };
    let chosen = Chosen { sources: &sources, weights: &weights };
    let described = describe(clouds, &chosen, described, monitor)?;
    let recipe = PyramidRecipe { features: described.features.clone(), ..recipe.clone() };
    Ok(Prepared { described, recipe, classes: counts, warnings })
}

/// The error about too few classes, with the reasons why others were dropped.
fn with_reasons(error: Error, reasons: &[String]) -> Error {
    match reasons.is_empty() {
        true => error,
        false => Error::input(format!("{error} ({})", reasons.join("; "))),
    }
}

/// Step 1: the candidate samples of every cloud and its thinned copies.
fn gather(clouds: &[(Cloud, Labels)], recipe: &PyramidRecipe, monitor: &Monitor) -> Result<Vec<Source>> {
    let mut sources = Vec::new();
    for (c, (cloud, labels)) in clouds.iter().enumerate() {
        let metres = recipe.features.metres(cloud);
        let sampling = Sampling { params: &recipe.training, metres };
        for copy in copies(cloud, &sampling, recipe.seed.wrapping_add(c as u64), monitor)? {
            let candidates = match &copy {
                None => candidates(cloud, labels, &sampling, monitor)?,
                Some(kept) => candidates(&cloud.select(kept), &labels.select(kept), &sampling, monitor)?,
            };
            sources.push(Source { cloud: c, copy, candidates });
        }
    }
    Ok(sources)
}

/// Number of samples by code.
fn tally(sources: &[Source]) -> [u64; 256] {
    let mut samples = [0; 256];
    sources.iter().flat_map(|s| &s.candidates).for_each(|c| samples[usize::from(c.code)] += 1);
    samples
}

/// Step 2: the class balance of chapter 4.6.1 over all sources together; returns the sample weight of each code.
fn choose(sources: &mut [Source], recipe: &PyramidRecipe) -> Result<Vec<f32>> {
    let present = tally(sources);
    let codes: Vec<u8> = (0..=255u8).filter(|&code| present[usize::from(code)] > 0).collect();
    let position = |code: u8| codes.iter().position(|&c| c == code).unwrap_or_default() as u16;
    let places: Vec<u16> = (0..=255u8).map(position).collect();
    let labels: Vec<u16> = sources.iter().flat_map(|s| &s.candidates).map(|c| places[usize::from(c.code)]).collect();
    let balance = balance(&labels, &recipe.training.balance(recipe.seed))?;
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

/// Feature vectors of the chosen points, the position of their class, and their 50 m square.
#[derive(Default)]
pub(super) struct Described {
    pub(super) values: Vec<f32>,
    pub(super) labels: Vec<u16>,
    /// Weight of each sample; empty if all are equal.
    pub(super) weights: Vec<f32>,
    pub(super) blocks: Vec<u32>,
    pub(super) names: Vec<String>,
    pub(super) classes: ClassTable,
    /// The features; the first scale is set.
    pub(super) features: FeatureSet,
}

impl Described {
    pub(super) fn samples(&self) -> Samples<'_> {
        let (features, labels) = (&self.values[..], &self.labels[..]);
        let weights = (!self.weights.is_empty()).then_some(&self.weights[..]);
        Samples { features, width: self.names.len(), labels, weights, classes: self.classes.len() }
    }
}

/// The chosen points of all clouds, and the sample weight of each code.
struct Chosen<'a> {
    sources: &'a [Source],
    weights: &'a [f32],
}

/// Step 3: computes the feature vectors of the chosen points, all with the first scale of the first cloud.
fn describe(
    clouds: &[(Cloud, Labels)],
    chosen: &Chosen<'_>,
    mut described: Described,
    monitor: &Monitor,
) -> Result<Described> {
    let Chosen { sources, weights } = *chosen;
    let weighted = sources.iter().flat_map(|s| &s.candidates).map(|c| weights[usize::from(c.code)]);
    if weighted.clone().any(|w| w > 1.0) {
        described.weights = weighted.collect();
    }
    for source in sources {
        let whole = &clouds[source.cloud].0;
        let thinned = source.copy.as_ref().map(|kept| whole.select(kept));
        let cloud = thinned.as_ref().unwrap_or(whole);
        let points: Vec<u32> = source.candidates.iter().map(|c| c.point).collect();
        let (table, first_scale) = features::table_at(cloud, &described.features, &points, monitor)?;
        described.features.pyramid.first_scale = Some(first_scale);
        described.values.extend_from_slice(&table.values);
        described
            .labels
            .extend(source.candidates.iter().filter_map(|c| described.classes.position(c.code)).map(|p| p as u16));
        let metres = described.features.metres(cloud);
        described.blocks.extend(points.iter().map(|&p| block_of(source.cloud, cloud.xyz(p as usize), metres)));
        described.names = table.names;
    }
    Ok(described)
}

/// A number for the 50 m square that contains a point (hash collisions only merge squares).
fn block_of(cloud: usize, xyz: [f64; 3], metres: f64) -> u32 {
    let [x, y] = cell_of([xyz[0], xyz[1]].map(|v| v * metres / BLOCK)).map(|v| v as u32);
    let mixed = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ (cloud as u32).wrapping_mul(0xc2b2_ae3d);
    mixed.wrapping_mul(0x27d4_eb2f) >> 8
}

/// Number of points and samples, and weight, of every labelled class.
fn count(clouds: &[(Cloud, Labels)], samples: &[u64; 256], weights: &[f32]) -> Vec<ClassCount> {
    let points = counts_of(clouds);
    let codes: Vec<u8> = (0..=255u8).filter(|&code| points[usize::from(code)] > 0).collect();
    let table = class_table(&codes, clouds);
    let count = |class: &Class| {
        let code = usize::from(class.code);
        let weight = f64::from(weights.get(code).copied().unwrap_or_default());
        ClassCount { code: class.code, name: class.name.clone(), points: points[code], samples: samples[code], weight }
    };
    table.classes().iter().map(count).collect()
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

/// Mean density of the clouds, points per square metre.
fn mean_density(clouds: &[(Cloud, Labels)], recipe: &PyramidRecipe, monitor: &Monitor) -> Result<f64> {
    let mut sum = 0.0;
    for (cloud, _) in clouds {
        sum += planar_density(cloud, recipe.features.metres(cloud), monitor)?;
    }
    Ok(sum / clouds.len().max(1) as f64)
}
