//! Learning the pyramid recipe: multi-scale features of labelled points and a random forest
//! (or another classifier).
//!
//! Reference: T. Hackel, *Large-scale machine learning for point cloud processing*, thesis, ETH Zurich 2018, chapter
//! 4.4 (document 004). The steps of the chapter are the functions of this file, in order.

use super::labels::Labels;
use super::points::note_oddities;
use super::recipe::Recipe;
use super::training::{Candidate, ClassCount, TrainingReport, candidates, copies, planar_density};
use crate::classes::ClassTable;
use crate::classification::cross_validation::{grid_search, grouped_folds};
use crate::classification::sampling::{BalanceParams, balance};
use crate::classification::{Classifier, ClassifierParams, Fingerprint, Model, Samples};
use crate::cloud::Cloud;
use crate::error::{Error, Result};
use crate::features;
use crate::parallel::Monitor;
use serde::Serialize;

/// Edge of the squares that cross-validation holds out, metres.
const BLOCK: f64 = 50.0;

/// Samples of one cloud or thinned copy.
struct Source {
    cloud: usize,
    /// `None`: all points of the cloud.
    copy: Option<Vec<u32>>,
    candidates: Vec<Candidate>,
}

/// Learns a model from labelled clouds.
///
/// The first scale, if the recipe leaves it open, comes from the spacing of the first cloud and is fixed in the model.
///
/// # Errors
/// A parameter out of range; fewer than one labelled point; a column that the features need is absent.
pub fn train(clouds: &[(Cloud, Labels)], recipe: &Recipe, monitor: &Monitor) -> Result<(Model, TrainingReport)> {
    let (sources, described, recipe) = prepare(clouds, recipe, monitor)?;
    let params = recipe.classifier().with_seed(recipe.seed);
    let (classifier, out_of_bag_accuracy) = Classifier::fit_with_score(&described.samples(), &params, monitor)?;
    let (classifier, used) = classifier.retain_used();
    let report = TrainingReport {
        classes: count(clouds, &sources, &described.classes),
        unlabelled: clouds.iter().map(|(_, l)| l.unlabelled).sum(),
        out_of_bag_accuracy,
        first_scale: recipe.features.pyramid.first_scale.unwrap_or_default(),
        used_features: used.len(),
        features: described.names.len(),
    };
    let fingerprint = Fingerprint::of(&described.samples(), mean_density(clouds, &recipe)).select(&used);
    let feature_names = used.iter().map(|&f| described.names[f].clone()).collect();
    let (recipe_toml, seed) = (recipe.to_toml()?, recipe.seed);
    Ok((Model { recipe_toml, classes: described.classes, feature_names, seed, fingerprint, classifier }, report))
}

/// Scores of one maximum depth, each the mean over the folds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthScore {
    /// The depth; `None` is unlimited.
    pub max_depth: Option<usize>,
    /// Mean accuracy, 0..1.
    pub accuracy: f64,
    /// Mean of the folds' mean F1, 0..1.
    pub mean_f1: f64,
}

/// k-fold cross-validation of the recipe for each depth (of the recipe's own depth if there are none), on spatially
/// disjoint folds: whole squares of 50 m are held out.
///
/// # Errors
/// As [`train`]; fewer squares than folds.
pub fn cross_validate(
    clouds: &[(Cloud, Labels)],
    recipe: &Recipe,
    (depths, folds): (&[usize], usize),
    monitor: &Monitor,
) -> Result<Vec<DepthScore>> {
    let (_, described, recipe) = prepare(clouds, recipe, monitor)?;
    let folds = grouped_folds(&described.blocks, folds)?;
    let mut grid = vec![recipe.classifier()];
    if !depths.is_empty() {
        grid = depths.iter().map(|&depth| with_depth(recipe.classifier(), depth)).collect();
    }
    let scores = grid_search(&described.samples(), &grid, &folds, monitor)?;
    let pairs = grid.iter_mut().zip(scores);
    Ok(pairs.map(|(p, s)| DepthScore { max_depth: *p.max_depth(), accuracy: s.accuracy, mean_f1: s.mean_f1 }).collect())
}

fn with_depth(mut params: ClassifierParams, depth: usize) -> ClassifierParams {
    *params.max_depth() = Some(depth);
    params
}

/// Steps 1 to 3; returns the recipe with its first scale fixed.
fn prepare(clouds: &[(Cloud, Labels)], recipe: &Recipe, monitor: &Monitor) -> Result<(Vec<Source>, Described, Recipe)> {
    recipe.validate()?;
    let mut recipe = recipe.clone();
    for (cloud, _) in clouds {
        cloud.metres(recipe.features.metres_per_unit)?;
    }
    note_oddities(clouds.iter().map(|(cloud, _)| cloud), monitor);
    let mut sources = gather(clouds, &recipe);
    let classes = class_table(&sources)?;
    choose(&mut sources, &classes, &recipe)?;
    let described = describe(clouds, &sources, &mut recipe, monitor)?;
    Ok((sources, described, recipe))
}

/// Step 1: what could be learned from, for every cloud and its thinned copies.
fn gather(clouds: &[(Cloud, Labels)], recipe: &Recipe) -> Vec<Source> {
    let mut sources = Vec::new();
    for (c, (cloud, labels)) in clouds.iter().enumerate() {
        let metres = recipe.features.metres(cloud);
        for copy in copies(cloud, &recipe.training, metres, recipe.seed.wrapping_add(c as u64)) {
            let candidates = match &copy {
                None => candidates(cloud, labels, &recipe.training, metres),
                Some(kept) => candidates(&cloud.select(kept), &labels.select(kept), &recipe.training, metres),
            };
            sources.push(Source { cloud: c, copy, candidates });
        }
    }
    sources
}

fn class_table(sources: &[Source]) -> Result<ClassTable> {
    let codes: Vec<u8> = sources.iter().flat_map(|s| s.candidates.iter().map(|c| c.code)).collect();
    match codes.is_empty() {
        true => {
            Err(Error::input("no labelled point to learn from; check the label dimension and the unlabelled codes"))
        }
        false => Ok(ClassTable::from_codes(&codes)),
    }
}

/// Step 2: the class balance of chapter 4.6.1 over all sources together.
fn choose(sources: &mut [Source], classes: &ClassTable, recipe: &Recipe) -> Result<()> {
    let all = sources.iter().flat_map(|s| &s.candidates);
    let labels: Vec<u16> = all.filter_map(|c| classes.position(c.code).map(|p| p as u16)).collect();
    let params = BalanceParams {
        max_ratio: recipe.training.max_ratio,
        max_samples: recipe.training.max_samples,
        seed: recipe.seed,
    };
    let chosen = balance(&labels, &params)?;
    let mut keep = vec![false; labels.len()];
    chosen.iter().for_each(|&i| keep[i as usize] = true);
    let mut keep = keep.into_iter();
    for source in sources {
        source.candidates.retain(|_| keep.next().unwrap_or(false));
        source.candidates.sort_unstable_by_key(|c| c.point);
    }
    Ok(())
}

/// Feature vectors of the chosen points, the position of their class, and the block that they stand in.
#[derive(Default)]
pub(super) struct Described {
    pub(super) values: Vec<f32>,
    pub(super) labels: Vec<u16>,
    pub(super) blocks: Vec<u32>,
    pub(super) names: Vec<String>,
    pub(super) classes: ClassTable,
}

impl Described {
    pub(super) fn samples(&self) -> Samples<'_> {
        let (features, labels) = (&self.values[..], &self.labels[..]);
        Samples { features, width: self.names.len(), labels, weights: None, classes: self.classes.len() }
    }
}

/// Step 3: feature vectors of the chosen points; fixes the first scale in the recipe.
fn describe(
    clouds: &[(Cloud, Labels)],
    sources: &[Source],
    recipe: &mut Recipe,
    monitor: &Monitor,
) -> Result<Described> {
    let mut described = Described { classes: class_table(sources)?, ..Described::default() };
    for source in sources {
        let whole = &clouds[source.cloud].0;
        let thinned = source.copy.as_ref().map(|kept| whole.select(kept));
        let cloud = thinned.as_ref().unwrap_or(whole);
        let points: Vec<u32> = source.candidates.iter().map(|c| c.point).collect();
        let (table, first_scale) = features::table_at(cloud, &recipe.features, &points, monitor)?;
        recipe.features.pyramid.first_scale = Some(first_scale);
        described.values.extend_from_slice(&table.values);
        described
            .labels
            .extend(source.candidates.iter().filter_map(|c| described.classes.position(c.code)).map(|p| p as u16));
        let metres = recipe.features.metres(cloud);
        described.blocks.extend(points.iter().map(|&p| block_of(source.cloud, cloud.xyz(p as usize), metres)));
        described.names = table.names;
    }
    Ok(described)
}

/// A number for the 50 m square of the cloud that holds a point (collisions only join squares).
fn block_of(cloud: usize, xyz: [f64; 3], metres: f64) -> u32 {
    let [x, y] = [xyz[0], xyz[1]].map(|v| (v * metres / BLOCK).floor() as i64 as u32);
    let mixed = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ (cloud as u32).wrapping_mul(0xc2b2_ae3d);
    mixed.wrapping_mul(0x27d4_eb2f) >> 8
}

fn count(clouds: &[(Cloud, Labels)], sources: &[Source], classes: &ClassTable) -> Vec<ClassCount> {
    let mut points = [0u64; 256];
    for (_, labels) in clouds {
        labels.counts().iter().zip(&mut points).for_each(|(n, sum)| *sum += n);
    }
    let samples = |code| sources.iter().flat_map(|s| &s.candidates).filter(|c| c.code == code).count() as u64;
    classes
        .classes()
        .iter()
        .map(|c| ClassCount { code: c.code, points: points[usize::from(c.code)], samples: samples(c.code) })
        .collect()
}

/// Mean of the clouds' densities, points per square metre.
fn mean_density(clouds: &[(Cloud, Labels)], recipe: &Recipe) -> f64 {
    let sum: f64 = clouds.iter().map(|(cloud, _)| planar_density(cloud, recipe.features.metres(cloud))).sum();
    sum / clouds.len().max(1) as f64
}
