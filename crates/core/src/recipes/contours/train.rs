//! Training: the classifiers of points, then that of candidates, from points that the other half of the clouds has rated.

use super::likely::{CODES, RatedPoints, rate};
use super::points::{PointLessons, half_of};
use super::scaled::{LocalLines, Scale};
use super::{CandidateTraining, ContoursRecipe, ContoursReport};
use crate::classification::{Classifier, Fingerprint, Learner, Samples};
use crate::cloud::{CodeScheme, MetricCloud, OwnClass};
use crate::contours::{
    Candidate, Candidates, ComparedLines, MatchParams, PathMatch, Polyline, VALUE_NAMES, VALUES, candidates,
    match_candidates,
};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_each};
use crate::random::{Stream, stream};
use crate::recipes::trained::EarlierStage;
use crate::recipes::training::sources::SampleSources;
use crate::recipes::training::{TrainingData, density};
use crate::recipes::{EdgeLines, Fitted, LabelledCloud, Labels, Nothing, System, Trained, TrainingResult};

pub(super) fn train(
    recipe: &ContoursRecipe,
    clouds: &[LabelledCloud],
    monitor: &Monitor,
) -> Result<TrainingResult<ContoursRecipe>> {
    recipe.validate()?;
    let scaled = clouds.iter().map(|cloud| scaled(recipe, cloud, monitor)).collect::<Result<Vec<_>>>()?;
    let parts = parts(scaled, monitor)?;
    let data = TrainingData::new(&parts, None, monitor)?;
    let sources = SampleSources::select(&data, &recipe.training, recipe.seed, monitor)?;
    let points = PointLessons::new(recipe, &data, &sources, monitor)?.learn(monitor)?;
    let mut collected = CandidateExamples { params: &recipe.examples, rows: Default::default() };
    for (number, part) in parts.iter().enumerate() {
        // By the classifiers that the other half has taught.
        let found = found_candidates(recipe, part, &points.halves[1 - half_of(number)], monitor)?;
        collected.take(&found, &part.labels, monitor)?;
    }
    let examples = collected.examples(stream(recipe.seed, 1))?;
    let labels: Vec<u16> = examples.labels();
    let samples = Samples { features: &examples.values, width: VALUES, labels: &labels, weights: None, classes: 2 };
    let mut forest = recipe.candidate_forest.clone();
    forest.seed = forest.seed.wrapping_add(recipe.seed);
    let classifier = Classifier::Forest(forest.train(&samples, monitor)?);
    let given = TrainingData::new(clouds, recipe.metres_per_unit(), monitor)?;
    let [off, on] = examples.counts;
    let report = ContoursReport {
        classes: sources.counts.clone(),
        unlabelled: given.unlabelled(),
        candidates_on: on,
        candidates_off: off,
        used_features: points.all.iter().map(|stage| stage.feature_names.len()).collect(),
        warnings: sources.warnings.clone(),
    };
    let trained = Trained {
        classes: sources.classes.clone(),
        feature_names: VALUE_NAMES.iter().map(|&name| name.to_string()).collect(),
        fingerprint: Fingerprint::of(&samples, density(&given, monitor)?),
        classifier,
        cars: None,
        earlier: points.all,
        network: None,
    };
    Ok(TrainingResult { fitted: Fitted { recipe: recipe.clone(), learned: Nothing {} }, trained, report })
}

/// A copy of a cloud in scaled metres, labelled as on or off contours.
fn scaled(recipe: &ContoursRecipe, given: &LabelledCloud, monitor: &Monitor) -> Result<LabelledCloud> {
    let scene = MetricCloud::new(&given.cloud, recipe.metres_per_unit(), monitor)?;
    let cloud = Scale::of(recipe, &scene, monitor)?.copy(&given.cloud);
    let code = |code: &Option<u8>| code.map(|code| CODES[usize::from(code == recipe.code)]);
    let codes = given.labels.codes.iter().map(code).collect();
    let name = |name: &str| OwnClass { name: name.into(), ..OwnClass::default() };
    let names = [(CODES[0], name("other")), (CODES[1], name("contour"))].into_iter().collect();
    let labels = Labels { names, edges: given.labels.edges.clone(), ..Labels::new(codes, CodeScheme::Own) };
    Ok(LabelledCloud { cloud, labels })
}

/// The clouds, which are of the one and the other half in turn; a single one is divided across its longer side.
fn parts(clouds: Vec<LabelledCloud>, monitor: &Monitor) -> Result<Vec<LabelledCloud>> {
    let [only] = &clouds[..] else { return Ok(clouds) };
    let points = MetricCloud::new(&only.cloud, None, monitor)?.some_points(monitor)?;
    let extent = |axis: &[f32]| axis.iter().copied().fold(0.0, f32::max);
    let positions = &points.positions;
    let axis = if extent(&positions.x) >= extent(&positions.y) { &positions.x } else { &positions.y };
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_by(|&a, &b| axis[a as usize].total_cmp(&axis[b as usize]).then(a.cmp(&b)));
    let (one, other) = order.split_at(order.len() / 2);
    let part = |rows: &[u32]| {
        let mut index: Vec<u32> = rows.iter().map(|&row| points.frame.index[row as usize]).collect();
        index.sort_unstable();
        LabelledCloud { cloud: only.cloud.select(&index), labels: only.labels.select(&index) }
    };
    Ok(vec![part(one), part(other)])
}

/// The candidates of a scaled cloud; their nodes are points of the cloud.
fn found_candidates(
    recipe: &ContoursRecipe,
    cloud: &LabelledCloud,
    stages: &[EarlierStage],
    monitor: &Monitor,
) -> Result<Found> {
    let scene = MetricCloud::new(&cloud.cloud, None, monitor)?;
    let rated: RatedPoints = rate(recipe, &scene, stages, monitor)?;
    let likely = rated.likely(recipe, monitor)?;
    let found = candidates(&likely, &recipe.candidates, monitor)?;
    let EdgeLines { lines, unsure } = &cloud.labels.edges;
    let local = LocalLines { metres: scene.metres, origin: rated.points.frame.origin };
    let (reference, unsure) = (local.of(lines), local.of(unsure));
    Ok(Found { candidates: found, index: rated.points.frame.index, reference, unsure })
}

/// Candidates, the point of the cloud that each point was, and the lines that were to be found, if they are known.
struct Found {
    candidates: Candidates,
    index: Vec<u32>,
    reference: Vec<Polyline>,
    unsure: Vec<Polyline>,
}

impl Found {
    /// How far each candidate runs along contours: along the lines, without these by the labels of its nodes.
    fn matched(&self, labels: &Labels, params: &MatchParams, monitor: &Monitor) -> Result<Vec<PathMatch>> {
        if !self.reference.is_empty() {
            let lines = ComparedLines { found: &[], reference: &self.reference, unsure: &self.unsure };
            return match_candidates(&self.candidates, &lines, params, monitor);
        }
        let nodes = &self.candidates.nodes.points;
        let label = |&node: &u32| labels.codes[self.index[nodes[node as usize] as usize] as usize];
        let one = |candidate: &Candidate| {
            let labelled: Vec<Option<u8>> = candidate.path.iter().map(label).collect();
            let share = |code: Option<u8>| {
                labelled.iter().filter(|&&found| found == code).count() as f32 / labelled.len().max(1) as f32
            };
            Ok(PathMatch { on: share(Some(CODES[1])), unsure: share(None) })
        };
        map_each(&self.candidates.list, monitor, one)
    }
}

/// Candidates that are examples.
struct CandidateExamples<'a> {
    params: &'a CandidateTraining,
    /// Descriptors of those off and on contours.
    rows: [Vec<f32>; 2],
}

/// The examples that are learned from.
struct Examples {
    values: Vec<f32>,
    /// Number of those off and on contours.
    counts: [usize; 2],
}

impl Examples {
    fn labels(&self) -> Vec<u16> {
        let [off, on] = self.counts;
        std::iter::repeat_n(0, off).chain(std::iter::repeat_n(1, on)).collect()
    }
}

impl CandidateExamples<'_> {
    /// Adds the candidates of a cloud that clearly run along a contour, or along none.
    fn take(&mut self, found: &Found, labels: &Labels, monitor: &Monitor) -> Result<()> {
        let matched = found.matched(labels, &self.params.along, monitor)?;
        let CandidateTraining { on, off, unsure, .. } = *self.params;
        for (matched, row) in matched.iter().zip(found.candidates.descriptors.chunks_exact(VALUES)) {
            if f64::from(matched.on) >= on {
                self.rows[1].extend_from_slice(row);
            } else if f64::from(matched.on) < off && f64::from(matched.unsure) <= unsure {
                self.rows[0].extend_from_slice(row);
            }
        }
        Ok(())
    }

    /// At most as many as the settings say, both kinds in the proportion in which they were found.
    fn examples(self, mut draws: Stream) -> Result<Examples> {
        let counts = self.rows.each_ref().map(|rows| rows.len() / VALUES);
        if counts.contains(&0) {
            let [off, on] = counts;
            let found = format!("{on} candidates on contours and {off} off them");
            return Err(Error::input(format!("{found} to learn from (allowed: 1 and more of each; give more clouds)")));
        }
        let all: usize = counts.iter().sum();
        let share = (self.params.most as f64 / all as f64).min(1.0);
        let kept = counts.map(|count| ((count as f64 * share).round() as usize).clamp(1, count));
        let mut examples = Examples { values: Vec::new(), counts: kept };
        for (rows, [count, kept]) in self.rows.iter().zip([[counts[0], kept[0]], [counts[1], kept[1]]]) {
            let mut chosen = draws.choose(count, kept);
            chosen.sort_unstable();
            chosen.iter().for_each(|&row| examples.values.extend_from_slice(&rows[row as usize * VALUES..][..VALUES]));
        }
        Ok(examples)
    }
}
