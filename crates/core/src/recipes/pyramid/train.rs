//! Training. The functions of this file follow the steps of Hackel 2018, chapter 4.4.

use super::PyramidRecipe;
use super::report::PyramidReport;
use super::samples::{BLOCK, Candidate, Described, TrainingParams, candidates, copies};
use super::select::chosen_depth;
use crate::classification::sampling::balance;
use crate::classification::{Fingerprint, Predictor};
use crate::cloud::MetricCloud;
use crate::error::{Error, Result};
use crate::features;
use crate::parallel::Monitor;
use crate::recipes::training::{ClassSamples, LabelledScene, TrainingData, check_classes, mean_density};
use crate::recipes::{ClassCount, Fitted, LabelledCloud, Model, Nothing, System, TrainOptions};
use crate::voxels::planar_density;

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
    clouds: &[LabelledCloud],
    options: &TrainOptions,
    monitor: &Monitor,
) -> Result<(Model, PyramidReport)> {
    options.without_strengths(PyramidRecipe::NAME)?;
    recipe.validate()?;
    let data = TrainingData::new(clouds, recipe.metres_per_unit(), monitor)?;
    let Prepared { described, recipe, classes, warnings } = prepare(&data, recipe, monitor)?;
    let (recipe, depths) = chosen_depth(&described, recipe, options, monitor)?;
    let params = recipe.classifier().with_seed(recipe.seed);
    let (classifier, out_of_bag_accuracy) = params.train_with_score(&described.samples(), monitor)?;
    let (classifier, used) = classifier.retain_used();
    let report = PyramidReport {
        classes,
        unlabelled: data.unlabelled(),
        out_of_bag_accuracy,
        first_scale: recipe.features.pyramid.first_scale.unwrap_or_default(),
        used_features: used.len(),
        features: described.names.len(),
        folds: if options.cross_validates() { options.folds() } else { 0 },
        depths,
        warnings,
    };
    let model = Model {
        fingerprint: Fingerprint::of(&described.samples(), density(&data, monitor)?).select(&used),
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
fn prepare(data: &TrainingData<'_>, recipe: &PyramidRecipe, monitor: &Monitor) -> Result<Prepared> {
    let mut sources = gather(data, recipe, monitor)?;
    let offered = tally(&sources);
    let weights = choose(&mut sources, recipe)?;
    let samples = tally(&sources);
    let of = |code: u8| ClassSamples {
        count: samples[usize::from(code)],
        weight: f64::from(weights.get(usize::from(code)).copied().unwrap_or_default()),
    };
    let counts = data.class_counts(of);
    let warnings = warnings(&counts, &offered, &recipe.training);
    let codes: Vec<u8> = counts.iter().filter(|c| c.samples > 0).map(|c| c.code).collect();
    let classes = data.class_table(&codes);
    check_classes(&classes).map_err(|e| with_reasons(e, &warnings))?;
    let described = Described { classes, features: recipe.features.clone(), ..Described::default() };
    let chosen = Chosen { sources: &sources, weights: &weights };
    let described = describe(data, &chosen, described, monitor)?;
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
fn gather(data: &TrainingData<'_>, recipe: &PyramidRecipe, monitor: &Monitor) -> Result<Vec<Source>> {
    let (mut sources, params) = (Vec::new(), &recipe.training);
    for (c, LabelledScene { metric, labels }) in data.scenes.iter().enumerate() {
        for copy in copies(metric, params, recipe.seed.wrapping_add(c as u64), monitor)? {
            let candidates = match &copy {
                None => candidates(metric, labels, params, monitor)?,
                Some(kept) => {
                    let thinned = metric.cloud.select(kept);
                    let thinned = MetricCloud::new(&thinned, Some(metric.metres), monitor)?;
                    candidates(&thinned, &labels.select(kept), params, monitor)?
                }
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

/// The chosen points of all clouds, and the sample weight of each code.
struct Chosen<'a> {
    sources: &'a [Source],
    weights: &'a [f32],
}

/// Step 3: computes the feature vectors of the chosen points, all with the first scale of the first cloud.
fn describe(
    data: &TrainingData<'_>,
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
        let whole = &data.scenes[source.cloud].metric;
        let thinned = source.copy.as_ref().map(|kept| whole.cloud.select(kept));
        let thinned = thinned.as_ref().map(|cloud| MetricCloud::new(cloud, Some(whole.metres), monitor)).transpose()?;
        let scene = thinned.as_ref().unwrap_or(whole);
        let points: Vec<u32> = source.candidates.iter().map(|c| c.point).collect();
        let (table, first_scale) = features::table_at(scene, &described.features, &points, monitor)?;
        described.features.pyramid.first_scale = Some(first_scale);
        described.values.extend_from_slice(&table.values);
        described
            .labels
            .extend(source.candidates.iter().filter_map(|c| described.classes.position(c.code)).map(|p| p as u16));
        let block = |&p: &u32| block_of(source.cloud, scene.cloud.xyz(p as usize), scene.metres);
        described.blocks.extend(points.iter().map(block));
        described.names = table.names;
    }
    Ok(described)
}

/// A number for the 50 m square that contains a point (hash collisions only merge squares).
fn block_of(cloud: usize, xyz: [f64; 3], metres: f64) -> u32 {
    let [x, y] = [xyz[0], xyz[1]].map(|v| (v * metres / BLOCK).floor() as i64 as u32);
    let mixed = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ (cloud as u32).wrapping_mul(0xc2b2_ae3d);
    mixed.wrapping_mul(0x27d4_eb2f) >> 8
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
fn density(data: &TrainingData<'_>, monitor: &Monitor) -> Result<f64> {
    let density = |scene: &LabelledScene<'_>| planar_density(&scene.metric.points(monitor)?.positions, monitor);
    let densities = data.scenes.iter().map(density).collect::<Result<Vec<_>>>()?;
    Ok(mean_density(densities.into_iter()))
}
