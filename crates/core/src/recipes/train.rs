//! Learning the pyramid recipe: multi-scale features of labelled points and a random forest.
//!
//! Reference: T. Hackel, *Large-scale machine learning for point cloud processing*, thesis, ETH Zurich 2018, chapter
//! 4.4 (document 004). The steps of the chapter are the functions of this file, in order.

use super::labels::Labels;
use super::recipe::Recipe;
use super::training::{Candidate, ClassCount, TrainingReport, candidates, copies, planar_density};
use crate::classes::ClassTable;
use crate::classification::{Fingerprint, Forest, Model, Samples, sampling};
use crate::cloud::Cloud;
use crate::error::{Error, Result};
use crate::features;
use crate::parallel::Monitor;

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
    recipe.validate()?;
    let mut sources = gather(clouds, recipe);
    let classes = class_table(&sources)?;
    choose(&mut sources, &classes, recipe)?;
    let mut recipe = recipe.clone();
    let (values, labels, names) = describe(clouds, &sources, &classes, &mut recipe, monitor)?;
    let mut params = recipe.forest.clone();
    params.seed = params.seed.wrapping_add(recipe.seed);
    let samples = Samples { features: &values, width: names.len(), labels: &labels, weights: None, classes: classes.len() };
    let (forest, fit) = Forest::fit_with_report(&samples, &params, monitor)?;
    let (forest, used) = forest.retain_used();
    let report = TrainingReport {
        classes: count(clouds, &sources, &classes),
        unlabelled: clouds.iter().map(|(_, l)| l.unlabelled).sum(),
        out_of_bag_accuracy: fit.oob_score,
        first_scale: recipe.features.pyramid.first_scale.unwrap_or_default(),
        used_features: used.len(),
        features: names.len(),
    };
    let fingerprint = Fingerprint::of(&samples, mean_density(clouds, &recipe));
    let feature_names = used.iter().map(|&f| names[f].clone()).collect();
    let model = Model { recipe_toml: recipe.to_toml()?, classes, feature_names, seed: recipe.seed, fingerprint, forest };
    Ok((model, report))
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
        true => Err(Error::input("no labelled point to learn from; check the label dimension and the unlabelled codes")),
        false => Ok(ClassTable::from_codes(&codes)),
    }
}

/// Step 2: the class balance of chapter 4.6.1 over all sources together.
fn choose(sources: &mut [Source], classes: &ClassTable, recipe: &Recipe) -> Result<()> {
    let all = sources.iter().flat_map(|s| &s.candidates);
    let labels: Vec<u16> = all.filter_map(|c| classes.position(c.code).map(|p| p as u16)).collect();
    let params = sampling::BalanceParams {
        max_ratio: recipe.training.max_ratio,
        max_samples: recipe.training.max_samples,
        seed: recipe.seed,
    };
    let chosen = sampling::balance(&labels, &params)?;
    let mut keep = vec![false; labels.len()];
    chosen.iter().for_each(|&i| keep[i as usize] = true);
    let mut keep = keep.into_iter();
    for source in sources {
        source.candidates.retain(|_| keep.next().unwrap_or(false));
        source.candidates.sort_unstable_by_key(|c| c.point);
    }
    Ok(())
}

/// Step 3: feature vectors and class positions of the chosen points; fixes the first scale in the recipe.
fn describe(
    clouds: &[(Cloud, Labels)],
    sources: &[Source],
    classes: &ClassTable,
    recipe: &mut Recipe,
    monitor: &Monitor,
) -> Result<(Vec<f32>, Vec<u16>, Vec<String>)> {
    let (mut values, mut labels, mut names) = (Vec::new(), Vec::new(), Vec::new());
    for source in sources {
        let whole = &clouds[source.cloud].0;
        let thinned = source.copy.as_ref().map(|kept| whole.select(kept));
        let points: Vec<u32> = source.candidates.iter().map(|c| c.point).collect();
        let (table, first_scale) = features::table_at(thinned.as_ref().unwrap_or(whole), &recipe.features, &points, monitor)?;
        recipe.features.pyramid.first_scale = Some(first_scale);
        values.extend_from_slice(&table.values);
        labels.extend(source.candidates.iter().filter_map(|c| classes.position(c.code)).map(|p| p as u16));
        names = table.names;
    }
    Ok((values, labels, names))
}

fn count(clouds: &[(Cloud, Labels)], sources: &[Source], classes: &ClassTable) -> Vec<ClassCount> {
    let mut points = [0u64; 256];
    for (_, labels) in clouds {
        labels.counts().iter().zip(&mut points).for_each(|(n, sum)| *sum += n);
    }
    let samples = |code| sources.iter().flat_map(|s| &s.candidates).filter(|c| c.code == code).count() as u64;
    classes.classes().iter().map(|c| ClassCount { code: c.code, points: points[usize::from(c.code)], samples: samples(c.code) }).collect()
}

/// Mean of the clouds' densities, points per square metre.
fn mean_density(clouds: &[(Cloud, Labels)], recipe: &Recipe) -> f64 {
    let sum: f64 = clouds.iter().map(|(cloud, _)| planar_density(cloud, recipe.features.metres(cloud))).sum();
    sum / clouds.len().max(1) as f64
}
