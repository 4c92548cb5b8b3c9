//! What classification by every recipe has in common: its parameters, its result, the comparison with the training.

pub(in crate::recipes) mod candidates;
pub(in crate::recipes) mod predict;
pub(in crate::recipes) mod returns;
pub(in crate::recipes) mod rules;
pub(in crate::recipes) mod statistics;

use crate::classification::argmax;
use crate::cloud::{Cloud, MetricCloud, Points};
use crate::error::Result;
use crate::parallel::{Monitor, watched};
use crate::recipes::classify::rules::ClassRules;
use crate::recipes::classify::statistics::CloudStatistics;
use crate::recipes::regularise::{Regularise, RegulariseParams, Regularised};
use crate::recipes::trained::Trained;
use crate::terrain::ElevationModel;
use crate::voxels::PlanarDensity;

/// Factor between the densities of cloud and training data that causes a warning.
const OTHER: f64 = 8.0;

/// Share of the feature values beyond all of those in training that causes a warning. With the built-in model airborne
/// scans have up to 0.01, an office 0.15, depth images 0.26.
const UNLIKE: f64 = 0.05;

/// Parameters of [`classify`](crate::recipes::classify()).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClassifyParams {
    /// Also return the probability of every class (4 bytes a point and class).
    pub probabilities: bool,
    /// Metres per unit of the coordinates; `None`: that of the model's recipe, else the cloud's own, else 1.
    pub metres_per_unit: Option<f64>,
    /// Regularisation of the labels; `None` uses that of the model. Its parameters are always those of the model's
    /// recipe.
    pub regularise: Option<Regularise>,
    /// Ground heights of this cloud, in its unit, to use instead of those of its road points (weak).
    pub elevation: Option<ElevationModel>,
    /// Statistics of the whole cloud, if this is a part of it: parts then get the labels that the whole would give them.
    /// `None`: this is the whole.
    pub statistics: Option<CloudStatistics>,
    /// What the classes become in the end; `None`: the rules of the model's recipe.
    pub rules: Option<ClassRules>,
}

/// How the feature values of a cloud compare with those of the samples that its model was trained on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureFit {
    /// Share of the values outside the middle 90 % of those in training, 0..1: about 0.1 for a cloud like those.
    pub outside: f64,
    /// Share of the values below the lowest or above the highest of those in training, 0..1: hardly any for such a cloud.
    pub beyond: f64,
}

/// The classification, one entry a point in the cloud's order. Points that are not finite get code 1 (or
/// [`ClassTable::free_code`](crate::classes::ClassTable::free_code) if 1 is a class of the model), confidence 0 and
/// entropy ln(classes). So do stray points ([`Strays`](crate::cloud::Strays)), except that a model with ASPRS codes gives
/// them code 7 (noise).
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
    /// The probability of each point to be a car, 0..1; 0 for points that are not vegetation or building (3 to 6) before
    /// regularisation, or not 0.2 to 3 m above the ground of the ground filter. Empty if no cars are looked for.
    pub cars: Vec<f32>,
    /// Whether each point is ground to the ground filter; empty if the recipe has no heights.
    pub lying: Vec<bool>,
    /// Whether neighbours were made to agree, so that a class may have a low probability beside others that are as sure.
    pub is_regularised: bool,
    /// How the features compare with those of the training, if that was looked at.
    pub fit: Option<FeatureFit>,
    /// Points per square metre of covered ground.
    pub density: f64,
    /// How unevenly they cover it: the least ratio between the neighbouring quantiles 10, 30, 50, 70 and 90 % of the points per
    /// square of 2 m. Airborne scans have up to 1.3, scans from the ground 1.8 and more; 1 for clouds of less than 400 m².
    pub density_spread: f64,
    /// Share of the squares of 2 m in which the first of several returns lie above the last ones: scans from above have 0.97 and
    /// more. `None` if the recipe does not look at returns, the cloud has no numbers of returns, or too few to say.
    pub returns_falling: Option<f64>,
    /// Warnings for the user: another density than in training, points that are not finite.
    pub warnings: Vec<String>,
}

impl ClassifyParams {
    /// The model's own regularisation with the method that the caller asks for.
    pub(in crate::recipes) fn regularise_of(&self, own: &RegulariseParams) -> RegulariseParams {
        let method = match self.regularise.unwrap_or(own.method) {
            // A choice that no training has made.
            Regularise::Auto => Regularise::None,
            method => method,
        };
        RegulariseParams { method, ..own.clone() }
    }

    /// The cloud in metres: the unit is the caller's, else that of the recipe, else the cloud's own.
    pub(in crate::recipes) fn scene<'a>(
        &self,
        cloud: &'a Cloud,
        of_recipe: Option<f64>,
        monitor: &Monitor,
    ) -> Result<MetricCloud<'a>> {
        MetricCloud::new(cloud, self.metres_per_unit.or(of_recipe), monitor)
    }
}

/// A cloud to classify.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// The cloud in metres.
    pub scene: &'a MetricCloud<'a>,
    /// Classes, feature names and classifiers of the model.
    pub model: &'a Trained,
    /// What the caller asks for.
    pub params: &'a ClassifyParams,
    /// The regularisation: the recipe's with the caller's method.
    pub regularise: &'a RegulariseParams,
    /// Lowest density of the thinned copies in training, points per square metre ([`System::lowest_density`]).
    ///
    /// [`System::lowest_density`]: crate::recipes::System::lowest_density
    pub lowest_density: f64,
}

impl Job<'_> {
    /// The result of a method that decides about all points of the cloud together.
    pub(in crate::recipes) fn decided(
        &self,
        points: &Points,
        found: &Regularised,
        monitor: &Monitor,
    ) -> Result<Classified> {
        let mut result = Classified::unknown(self.scene.cloud.len(), self.model, self.params.probabilities);
        result.take_density(PlanarDensity::new(&points.positions, monitor)?);
        result.warnings = self.warnings(result.density, monitor)?;
        let (index, classes) = (&points.frame.index, self.model.classes.len());
        for piece in watched(points.len(), monitor) {
            for i in piece? {
                result.set(index[i] as usize, usize::from(found.labels[i]), found.row(i, classes), self.model);
            }
        }
        Ok(result)
    }

    /// Warnings about differences between this cloud and the training data; `here` is its density, points per m².
    pub(in crate::recipes) fn warnings(&self, here: f64, monitor: &Monitor) -> Result<Vec<String>> {
        let Self { scene: MetricCloud { cloud, .. }, model, lowest_density, .. } = self;
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
        warnings.extend(self.scene.oddities());
        let there = model.fingerprint.density;
        let thinnest = lowest_density.min(there);
        if finite > 1000 && there > 0.0 && (here > OTHER * there || here * OTHER < thinnest) {
            let mut text = format!(
                "{here:.1} points per square metre here, {there:.1} in training: check the unit of the coordinates and the result"
            );
            if here < there && cloud.unit_is_unknown() {
                text += " (the file states no unit; for feet use --unit 0.3048)";
            }
            warnings.push(text);
        }
        Ok(warnings)
    }
}

/// ASPRS code for low points and other noise.
const NOISE: u8 = 7;

/// The code for stray points: noise (7) if the model has ASPRS codes, in which 0 and 1 are not classes.
pub(in crate::recipes) fn stray_code(model: &Trained) -> u8 {
    let has = |code| model.classes.position(code).is_some();
    if has(2) && !has(0) && !has(1) { NOISE } else { model.classes.free_code() }
}

impl Classified {
    /// Mean confidence of the points that could be classified; `None` if there is none.
    pub fn mean_confidence(&self) -> Option<f64> {
        let known = self.confidence.iter().filter(|&&c| c > 0.0);
        let (sum, count) = known.fold((0.0, 0u64), |(sum, count), &c| (sum + f64::from(c), count + 1));
        (count > 0).then(|| sum / count as f64)
    }

    /// Keeps how the features compare with those of the training, and warns if they differ.
    pub(in crate::recipes) fn compared(mut self, fit: Option<FeatureFit>) -> Self {
        self.fit = fit;
        if let Some(fit) = fit.filter(|fit| fit.beyond > UNLIKE) {
            self.warnings.push(format!(
                "{:.0} % of the feature values lie beyond all of those in training: the model was not trained on clouds \
                 like this one; check the result",
                100.0 * fit.beyond
            ));
        }
        self
    }

    pub(in crate::recipes) fn take_density(&mut self, PlanarDensity { mean, spread }: PlanarDensity) {
        (self.density, self.density_spread) = (mean, spread);
    }

    /// No class for any point yet.
    pub(in crate::recipes) fn unknown(points: usize, model: &Trained, probabilities: bool) -> Self {
        let classes = model.classes.len();
        Self {
            codes: vec![model.classes.free_code(); points],
            confidence: vec![0.0; points],
            entropy: vec![(classes as f32).ln(); points],
            probabilities: probabilities.then(|| vec![1.0 / classes as f32; points * classes]),
            cars: Vec::new(),
            lying: Vec::new(),
            is_regularised: false,
            fit: None,
            density: 0.0,
            density_spread: 1.0,
            returns_falling: None,
            warnings: Vec::new(),
        }
    }

    /// Gives some points their most probable class; row i of `probabilities` belongs to point `points[i]`.
    pub(in crate::recipes) fn place(&mut self, points: &[u32], probabilities: &[f32], model: &Trained) {
        for (&point, row) in points.iter().zip(probabilities.chunks_exact(model.classes.len())) {
            self.set(point as usize, argmax(row), row, model);
        }
    }

    fn set(&mut self, point: usize, label: usize, row: &[f32], model: &Trained) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entropy_of_known_distributions() {
        assert!((entropy(&[0.5, 0.5, 0.0]) - std::f32::consts::LN_2).abs() < 1e-6);
        assert!(entropy(&[1.0, 0.0]).abs() < 1e-9);
    }
}
