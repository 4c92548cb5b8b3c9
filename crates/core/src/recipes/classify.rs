//! Classifies every point of a cloud with a model, block by block.

use super::any::AnyRecipe;
use super::objects::classify_objects;
use super::recipe::Recipe;
use super::regularise::{Probabilities, Regularise, RegulariseParams, Regularised, largest, regularise};
use super::training::planar_density;
use super::weak::classify_weak;
use crate::classification::{Model, PredictScratch};
use crate::cloud::{Cloud, Points, StrayParams, Strays};
use crate::error::{Error, Result};
use crate::features::{Extractor, FeatureSet, Scratch, Tiles, Wanted};
use crate::memory;
use crate::parallel::{Monitor, map_ordered_with, watched};

/// Number of blocks that are classified together: the more rows share a path through a tree, the cheaper it is.
const TOGETHER: usize = 8;

/// Number of groups of blocks whose probabilities are held at a time.
const GROUPS_AT_ONCE: usize = 32;

/// Factor between the densities of cloud and training data that causes a warning.
const OTHER: f64 = 8.0;

/// Parameters of [`classify`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClassifyParams {
    /// Also return the probability of every class (4 bytes a point and class).
    pub probabilities: bool,
    /// Metres per unit of the coordinates; `None` uses the cloud's own unit, else 1.
    pub metres_per_unit: Option<f64>,
    /// Regularisation of the labels; `None` uses that of the model. Its parameters are always those of the model's
    /// recipe.
    pub regularise: Option<Regularise>,
}

/// The classification, one entry a point in the cloud's order. Points that are not finite get code 1 (or
/// [`ClassTable::free_code`](crate::classes::ClassTable::free_code) if 1 is a class of the model), confidence 0 and
/// entropy ln(classes). So do stray points ([`Strays`]), except that a model with ASPRS codes gives them code 7
/// (noise).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Classified {
    /// Most probable class.
    pub codes: Vec<u8>,
    /// Probability of that class, 0..1.
    pub confidence: Vec<f32>,
    /// Entropy of the probabilities in nats, 0..ln(classes).
    pub entropy: Vec<f32>,
    /// Row-major `points x classes`, if requested.
    pub probabilities: Option<Vec<f32>>,
    /// Warnings for the user: another density than in training, points that are not finite.
    pub warnings: Vec<String>,
}

/// Classifies every point of a cloud with a model of any recipe.
///
/// Without regularisation, the features of the pyramid are computed and discarded block by block; with it, the
/// probabilities and a graph of all points are held (about 300 bytes a point).
///
/// # Errors
/// If the model needs a feature that this version or this cloud does not have.
pub fn classify(cloud: &Cloud, model: &Model, params: &ClassifyParams, monitor: &Monitor) -> Result<Classified> {
    let recipe = AnyRecipe::from_toml(&model.recipe_toml)?;
    forecast(cloud.len(), &recipe, params)?;
    let agree = recipe.regularise();
    let agree = RegulariseParams { method: params.regularise.unwrap_or(agree.method), ..agree.clone() };
    let mut result = match &recipe {
        AnyRecipe::Pyramid(recipe) => classify_pyramid(cloud, (model, recipe), (params, &agree), monitor)?,
        AnyRecipe::Weak(recipe) => {
            let (points, found) = classify_weak(cloud, (model, recipe), (params.metres_per_unit, &agree), monitor)?;
            adopted(cloud, (model, params), (&points.index, &found), monitor)?
        }
        AnyRecipe::Objects(recipe) => {
            let metres = params.metres_per_unit;
            let (points, found) = classify_objects(cloud, (model, recipe), (metres, &agree), monitor)?;
            adopted(cloud, (model, params), (&points.index, &found), monitor)?
        }
    };
    let strays = Strays::find(cloud, &StrayParams::default(), monitor)?;
    strays.index.iter().for_each(|&i| result.codes[i as usize] = stray_code(model));
    Ok(result)
}

/// ASPRS code for low points and other noise.
const NOISE: u8 = 7;

/// The code for stray points: noise (7) if the model has ASPRS codes, in which 0 and 1 are not classes.
fn stray_code(model: &Model) -> u8 {
    let has = |code| model.classes.position(code).is_some();
    if has(2) && !has(0) && !has(1) { NOISE } else { model.classes.free_code() }
}

/// Fails before any work if there is less memory than the classification of so many points needs at least.
fn forecast(points: usize, recipe: &AnyRecipe, params: &ClassifyParams) -> Result<()> {
    let method = params.regularise.unwrap_or(recipe.regularise().method);
    let alone = matches!(recipe, AnyRecipe::Pyramid(_)) && method == Regularise::None;
    let each = if alone { 45 } else { 200 };
    // The fine levels are held for only a part of the points.
    let needed = each * points as u64 + 150 * points.min(1 << 20) as u64;
    memory::require(needed, &format!("naming {points} points"))
}

/// The result of a recipe that decides about all points together.
fn adopted(
    cloud: &Cloud,
    (model, params): (&Model, &ClassifyParams),
    (index, found): (&[u32], &Regularised),
    monitor: &Monitor,
) -> Result<Classified> {
    let mut result = Classified::unknown(cloud.len(), model, params.probabilities);
    let metres = params.metres_per_unit.or(cloud.metres_per_unit).unwrap_or(1.0);
    result.warnings = warnings(cloud, model, metres, monitor)?;
    result.adopt(index, found, model, monitor)?;
    Ok(result)
}

fn classify_pyramid(
    cloud: &Cloud,
    (model, recipe): (&Model, &Recipe),
    (params, agree): (&ClassifyParams, &RegulariseParams),
    monitor: &Monitor,
) -> Result<Classified> {
    let mut set = recipe.features.clone();
    set.metres_per_unit = params.metres_per_unit.or(set.metres_per_unit);
    if agree.method == Regularise::None {
        return point_by_point(cloud, model, (&set, params.probabilities), monitor);
    }
    let mut result = point_by_point(cloud, model, (&set, true), monitor)?;
    let points = Points::from_cloud_watched(cloud, set.metres(cloud), monitor)?;
    let classes = model.classes.len();
    let all = result.probabilities.take().unwrap_or_default();
    let values = match points.len() == cloud.len() {
        true => all,
        false => rows_of(&all, classes, &points.index, monitor)?,
    };
    let found = regularise(&points, Probabilities { values: &values, classes }, None, agree, monitor)?;
    let warnings = std::mem::take(&mut result.warnings);
    result = Classified { warnings, ..Classified::unknown(cloud.len(), model, params.probabilities) };
    result.adopt(&points.index, &found, model, monitor)?;
    Ok(result)
}

/// The probabilities of the points with these indices, one row a point.
fn rows_of(all: &[f32], classes: usize, index: &[u32], monitor: &Monitor) -> Result<Vec<f32>> {
    let mut rows = Vec::with_capacity(index.len() * classes);
    for piece in watched(index.len(), monitor) {
        rows.extend(index[piece?].iter().flat_map(|&i| &all[i as usize * classes..][..classes]));
    }
    Ok(rows)
}

fn point_by_point(
    cloud: &Cloud,
    model: &Model,
    (set, probabilities): (&FeatureSet, bool),
    monitor: &Monitor,
) -> Result<Classified> {
    let mut result = Classified::unknown(cloud.len(), model, probabilities);
    result.warnings = warnings(cloud, model, set.metres(cloud), monitor)?;
    let tiles = prepare(cloud, set, model, monitor)?;
    monitor.stage("classify", tiles.len() as u64);
    for part in 0..tiles.parts() {
        let (mut places, mut attempt) = (tiles.places(part), 0);
        while !places.is_empty() {
            let extractor = tiles.extractor(&places, attempt, monitor)?;
            let loose = all_blocks(&extractor, model, &mut result, monitor)?;
            places = loose.into_iter().map(|row| places[row]).collect();
            attempt += 1;
        }
    }
    Ok(result)
}

/// Classifies the points of an extractor; returns the rows that need a wider margin.
fn all_blocks(
    extractor: &Extractor<'_>,
    model: &Model,
    result: &mut Classified,
    monitor: &Monitor,
) -> Result<Vec<usize>> {
    let groups = extractor.blocks().div_ceil(TOGETHER);
    let mut loose = Vec::new();
    for first in (0..groups).step_by(GROUPS_AT_ONCE) {
        let range = first..(first + GROUPS_AT_ONCE).min(groups);
        let parts = map_ordered_with(range, monitor, Workspace::default, |w, g| w.group(g, extractor, model, monitor))?;
        for part in parts {
            result.place(&part, model);
            monitor.advance((part.points.len() - part.loose.len()) as u64);
            loose.extend(part.loose);
        }
    }
    Ok(loose)
}

/// The pyramid with only the features that the model's trees use.
fn prepare<'a>(cloud: &'a Cloud, set: &FeatureSet, model: &Model, monitor: &Monitor) -> Result<Tiles<'a>> {
    let known = set.names(set.pyramid.first_scale.unwrap_or_default());
    if let Some(name) = model.feature_names.iter().find(|name| !known.contains(name)) {
        return Err(Error::ModelMismatch(format!(
            "it needs the feature {name}; its recipe gives {} others",
            known.len()
        )));
    }
    Tiles::prepare(cloud, set, Wanted::Names(&model.feature_names), monitor)
}

#[derive(Default)]
struct Workspace {
    scratch: Scratch,
    rows: Vec<f32>,
    group: Vec<f32>,
    trees: PredictScratch,
}

/// Points of a group of blocks and their class probabilities.
struct Part {
    points: Vec<u32>,
    probabilities: Vec<f32>,
    /// Rows of the extractor that need a wider margin.
    loose: Vec<usize>,
}

impl Workspace {
    fn group(&mut self, g: usize, extractor: &Extractor<'_>, model: &Model, monitor: &Monitor) -> Result<Part> {
        let (mut points, mut loose) = (Vec::new(), Vec::new());
        self.group.clear();
        for b in g * TOGETHER..((g + 1) * TOGETHER).min(extractor.blocks()) {
            monitor.check()?;
            points.extend_from_slice(extractor.block(b, &mut self.scratch, &mut self.rows));
            self.group.extend_from_slice(&self.rows);
            loose.extend(self.scratch.loose().iter().map(|&row| b * Extractor::BLOCK + row as usize));
        }
        let mut probabilities = vec![0.0; points.len() * model.classes.len()];
        model.classifier.predict_block(&self.group, &mut self.trees, &mut probabilities)?;
        Ok(Part { points, probabilities, loose })
    }
}

impl Classified {
    fn unknown(points: usize, model: &Model, probabilities: bool) -> Self {
        let classes = model.classes.len();
        Self {
            codes: vec![model.classes.free_code(); points],
            confidence: vec![0.0; points],
            entropy: vec![(classes as f32).ln(); points],
            probabilities: probabilities.then(|| vec![1.0 / classes as f32; points * classes]),
            warnings: Vec::new(),
        }
    }

    fn place(&mut self, part: &Part, model: &Model) {
        let classes = model.classes.len();
        for (&point, row) in part.points.iter().zip(part.probabilities.chunks_exact(classes)) {
            self.set(point as usize, usize::from(largest(row)), row, model);
        }
    }

    /// Replaces the labels by the regularised ones; row i belongs to point `index[i]`.
    fn adopt(&mut self, index: &[u32], found: &Regularised, model: &Model, monitor: &Monitor) -> Result<()> {
        let classes = model.classes.len();
        for piece in watched(index.len(), monitor) {
            for i in piece? {
                let row = &found.probabilities[i * classes..][..classes];
                self.set(index[i] as usize, usize::from(found.labels[i]), row, model);
            }
        }
        Ok(())
    }

    fn set(&mut self, point: usize, label: usize, row: &[f32], model: &Model) {
        self.codes[point] = model.classes.classes()[label].code;
        self.confidence[point] = row[label].clamp(0.0, 1.0);
        self.entropy[point] = entropy(row);
        if let Some(all) = &mut self.probabilities {
            all[point * row.len()..(point + 1) * row.len()].copy_from_slice(row);
        }
    }
}

/// Entropy in nats of probabilities that sum to 1, with 0 ln 0 = 0.
fn entropy(row: &[f32]) -> f32 {
    row.iter().filter(|&&p| p > 0.0).map(|&p| -p * p.ln()).sum::<f32>().max(0.0)
}

/// Warnings about differences between this cloud and the training data.
fn warnings(cloud: &Cloud, model: &Model, metres: f64, monitor: &Monitor) -> Result<Vec<String>> {
    let mut warnings = Vec::new();
    let mut finite = 0;
    for piece in watched(cloud.len(), monitor) {
        finite += piece?.filter(|&i| cloud.xyz(i).iter().all(|v| v.is_finite())).count();
    }
    if finite < cloud.len() {
        warnings.push(format!(
            "{} points have coordinates that are not finite; they stay unclassified (code {})",
            cloud.len() - finite,
            model.classes.free_code()
        ));
    }
    warnings.extend(cloud.oddities(monitor)?);
    let (here, there) = (planar_density(cloud, metres, monitor)?, model.fingerprint.density);
    let thinnest = thinnest(model).min(there);
    if finite > 1000 && there > 0.0 && (here > OTHER * there || here * OTHER < thinnest) {
        let mut text = format!(
            "{here:.1} points per square metre here, {there:.1} in training: check the unit of the coordinates and the result"
        );
        if here < there && cloud.metres_per_unit.is_none() && cloud.crs.is_none() {
            text += " (the file tells no unit: if it is feet, say --unit 0.3048)";
        }
        warnings.push(text);
    }
    Ok(warnings)
}

/// The lowest density of the thinned copies that a model was trained on.
fn thinnest(model: &Model) -> f64 {
    match AnyRecipe::from_toml(&model.recipe_toml) {
        Ok(AnyRecipe::Pyramid(recipe)) => recipe.training.densities.iter().copied().fold(f64::INFINITY, f64::min),
        _ => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entropy_of_known_distributions() {
        assert!((entropy(&[0.5, 0.5, 0.0]) - std::f32::consts::LN_2).abs() < 1e-6);
        assert!(entropy(&[1.0, 0.0]).abs() < 1e-9);
    }
}
