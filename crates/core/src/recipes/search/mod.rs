//! Cross-validation of any recipe, and the choice of its settings from a grid.

mod grid;

pub use grid::{Grid, GridAxis};

use crate::error::{Error, Result};
use crate::evaluation::{Confusion, Scores};
use crate::parallel::Monitor;
use crate::recipes::classify::ClassifyParams;
use crate::recipes::classify::rules::ClassRules;
use crate::recipes::labels::{LabelledCloud, Labels};
use crate::recipes::model::any::AnyRecipe;
use crate::recipes::model::classify;
use crate::recipes::system::TrainOptions;
use crate::recipes::system::report::{SCORE_COLUMNS, score_row};
use crate::recipes::training::blocks::{Place, spatial_folds};
use crate::terrain::ElevationModel;
use serde::Serialize;

/// Parameters of [`search`].
#[derive(Clone, Debug, PartialEq)]
pub struct SearchParams {
    /// The settings to try; without any the recipe is evaluated as it is.
    pub grid: Grid,
    /// Number of folds, 2 or more.
    pub folds: usize,
    /// Edge of the squares that are held out together, metres; `None`: 50, halved until there are two squares a fold.
    pub block: Option<f64>,
    /// Ground heights, in the unit of the clouds, to use instead of those of the road points (weak).
    pub elevation: Option<ElevationModel>,
}

impl Default for SearchParams {
    fn default() -> Self {
        Self { grid: Grid::default(), folds: 5, block: None, elevation: None }
    }
}

/// Settings that were tried, and the scores of the held-out points of all folds together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SearchScore {
    /// `key=value` of each axis of the grid.
    pub settings: Vec<String>,
    /// Scores, with those of each class.
    pub scores: Scores,
}

/// Result of [`search`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SearchReport {
    /// Number of folds.
    pub folds: usize,
    /// Edge of the squares, metres.
    pub block: f64,
    /// Position of the settings with the largest mean F1, the first of equal ones.
    pub best: usize,
    /// All settings, in the order of the grid.
    pub tried: Vec<SearchScore>,
}

/// Tries all settings of a grid by cross-validation: for each fold of whole squares, a model is trained on the labels of
/// the others and classifies the clouds, with the recipe's own regularisation. The unlabelled points, and the points of held-out squares, still belong to the neighbourhoods of the others.
///
/// Labels are hidden in place, and are back when this returns. Takes the time of folds x settings trainings and
/// classifications.
///
/// # Errors
/// If a setting is unknown, there are fewer squares than folds, a fold leaves fewer than two classes, or the work was
/// cancelled.
pub fn search(
    recipe: &AnyRecipe,
    clouds: &mut [LabelledCloud],
    params: &SearchParams,
    monitor: &Monitor,
) -> Result<SearchReport> {
    let candidates = params.grid.candidates()?;
    let recipes = candidates.iter().map(|settings| {
        let recipe = recipe.with_settings(settings.iter().map(String::as_str))?;
        recipe.validate().map(|()| recipe)
    });
    let recipes = recipes.collect::<Result<Vec<_>>>()?;
    let truth: Vec<Labels> = clouds.iter_mut().map(|labelled| std::mem::take(&mut labelled.labels)).collect();
    let trials = Trials { recipes: &recipes, truth: &truth, params };
    let found = trials.run(clouds, monitor);
    clouds.iter_mut().zip(truth).for_each(|(labelled, labels)| labelled.labels = labels);
    let (block, scores) = found?;
    let tried: Vec<SearchScore> =
        candidates.into_iter().zip(scores).map(|(settings, scores)| SearchScore { settings, scores }).collect();
    let mean = |at: usize| tried[at].scores.mean_f1_score;
    let best = (1..tried.len()).fold(0, |best, at| if mean(at) > mean(best) { at } else { best });
    Ok(SearchReport { folds: params.folds, block, best, tried })
}

impl SearchReport {
    /// A CSV table: one row for each class of all settings that were tried.
    pub fn csv(&self) -> String {
        let row = |trial: &SearchScore| {
            let settings = trial.settings.join(" ");
            trial.scores.labels.iter().map(|class| score_row(&settings, class)).collect::<String>()
        };
        std::iter::once(format!("settings,{SCORE_COLUMNS}\n")).chain(self.tried.iter().map(row)).collect()
    }

    /// One line for each setting that was tried, and below it one for each class; lines end with a line feed.
    pub fn text(&self) -> String {
        let mut text = format!("{}-fold cross-validation on squares of {} m\n", self.folds, self.block);
        for (at, SearchScore { settings, scores }) in self.tried.iter().enumerate() {
            let name = if settings.is_empty() { "the recipe".into() } else { settings.join(" ") };
            let mark = if at == self.best && self.tried.len() > 1 { "  best" } else { "" };
            let [accuracy, f1] = [scores.overall_accuracy, scores.mean_f1_score].map(|share| 100.0 * share);
            text += &format!("{name}: accuracy {accuracy:.2} %, mean F1 {f1:.2} %{mark}\n");
            for class in &scores.labels {
                let [precision, recall, f1] =
                    [class.precision, class.recall, class.f1_score].map(|share| 100.0 * share);
                let (code, name) = (class.code, &class.name);
                text += &format!(
                    "{code:>5}  {name:<20} precision {precision:>6.2}  recall {recall:>6.2}  F1 {f1:>6.2} %\n"
                );
            }
        }
        text
    }
}

/// What is compared.
struct Trials<'a> {
    recipes: &'a [AnyRecipe],
    truth: &'a [Labels],
    params: &'a SearchParams,
}

impl Trials<'_> {
    /// Edge of the squares, and the scores of each recipe.
    fn run(&self, clouds: &mut [LabelledCloud], monitor: &Monitor) -> Result<(f64, Vec<Scores>)> {
        let metres = self.recipes.first().and_then(AnyRecipe::metres_per_unit);
        let (mut places, mut starts) = (Vec::new(), Vec::new());
        for (number, (labelled, labels)) in clouds.iter().zip(self.truth).enumerate() {
            let unit = labelled.cloud.metres(metres)?;
            starts.push(places.len());
            let known = (0..labels.codes.len()).filter(|&i| labels.codes[i].is_some());
            places.extend(known.map(|i| Place::new(number, labelled.cloud.xyz(i), unit)));
        }
        let folds = spatial_folds(&places, self.params.folds, self.params.block)?;
        drop(places);
        let mut found: Vec<Vec<Vec<u8>>> =
            vec![self.truth.iter().map(|labels| vec![0; labels.codes.len()]).collect(); self.recipes.len()];
        for fold in 0..self.params.folds as u32 {
            for ((labelled, labels), &start) in clouds.iter_mut().zip(self.truth).zip(&starts) {
                let mut place = start..;
                let kept = |code: &Option<u8>| code.filter(|_| place.next().is_some_and(|p| folds.of[p] != fold));
                labelled.labels = labels.changed(labels.codes.iter().map(kept).collect());
            }
            for (recipe, found) in self.recipes.iter().zip(&mut found) {
                self.hold_out(recipe, clouds, found, monitor)
                    .map_err(|e| if monitor.is_cancelled() { e } else { in_fold(fold, e) })?;
            }
        }
        let scores = found.iter().map(|codes| self.scores(codes)).collect::<Result<Vec<_>>>()?;
        Ok((folds.square, scores))
    }

    /// Trains on the labels that are there, and puts the classes of the labelled points that are hidden into `found`.
    fn hold_out(
        &self,
        recipe: &AnyRecipe,
        clouds: &[LabelledCloud],
        found: &mut [Vec<u8>],
        monitor: &Monitor,
    ) -> Result<()> {
        let elevation = || self.params.elevation.clone();
        let options = TrainOptions { elevation: elevation(), ..TrainOptions::default() };
        let (model, _) = recipe.train(clouds, &options, monitor)?;
        let rules = Some(ClassRules::default());
        for (c, labelled) in clouds.iter().enumerate() {
            let hidden = |i: usize| self.truth[c].codes[i].is_some() && labelled.labels.codes[i].is_none();
            if !(0..labelled.cloud.len()).any(hidden) {
                continue;
            }
            let params = ClassifyParams { elevation: elevation(), rules: rules.clone(), ..ClassifyParams::default() };
            let classified = classify(&labelled.cloud, &model, &params, monitor)?;
            let codes = found[c].iter_mut().zip(&classified.codes).enumerate();
            codes.filter(|(i, _)| hidden(*i)).for_each(|(_, (slot, &code))| *slot = code);
        }
        Ok(())
    }

    fn scores(&self, found: &[Vec<u8>]) -> Result<Scores> {
        let truth: Vec<Option<u8>> = self.truth.iter().flat_map(|labels| labels.codes.iter().copied()).collect();
        let confusion = Confusion::from_options(&truth, &found.concat())?;
        let named = self.truth.first().map(|labels| confusion.clone().named(labels.scheme, &labels.names));
        Ok(named.unwrap_or(confusion).scores())
    }
}

/// The same error, with the fold in which it happened.
fn in_fold(fold: u32, error: Error) -> Error {
    match error {
        Error::InvalidInput(text) => Error::input(format!("fold {}: {text}", fold + 1)),
        other => other,
    }
}
