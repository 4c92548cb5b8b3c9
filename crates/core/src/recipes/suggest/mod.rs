//! Active learning: suggests the segments to label next, those that a model is unsure of, and that are different from
//! the labelled ones.

mod page;
mod places;

pub use page::suggestion_page;

use super::Labels;
use super::segment::Segmented;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::segmentation::majorities;
use places::{Place, distance, places};
use serde::{Deserialize, Serialize};

/// Parameters of [`suggest`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SuggestParams {
    /// Number of segments to suggest, at least 1.
    pub count: usize,
    /// Exponent of the number of points in the score where there is a model, 0..=1: 1 favours the largest segments, 0
    /// ignores sizes. Without a model sizes are ignored: rare objects are small.
    pub size_power: f64,
    /// Segments of fewer points are never suggested.
    pub fewest_points: usize,
}

impl Default for SuggestParams {
    fn default() -> Self {
        Self { count: 50, size_power: 0.5, fewest_points: 10 }
    }
}

impl SuggestParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if self.count == 0 {
            return Err(Error::parameter("count", 0, "1 or more"));
        }
        match (0.0..=1.0).contains(&self.size_power) {
            true => Ok(()),
            false => Err(Error::parameter("size_power", self.size_power, "0 to 1")),
        }
    }
}

/// What a model says about the points of a cloud.
#[derive(Clone, Copy, Debug)]
pub enum Doubt<'a> {
    /// Uncertainty of each point, 0..=1.
    Uncertainty(&'a [f32]),
    /// Probabilities of so many classes for each point, row-major. The uncertainty of a segment is the entropy of its mean
    /// probabilities over ln(classes).
    Probabilities(&'a [f32], usize),
}

/// What is known about the points of a cloud before segments are suggested.
#[derive(Clone, Copy, Debug, Default)]
pub struct KnownPoints<'a> {
    /// What the model to improve says.
    pub doubt: Option<Doubt<'a>>,
    /// Labels that are there already; segments that contain one are not suggested.
    pub labels: Option<&'a Labels>,
}

/// A suggested segment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Suggestion {
    /// Number of the segment (`ClusterID`).
    pub cluster_id: u32,
    /// Index in the cloud of the point nearest to the segment's mean.
    pub point: u32,
    /// Number of points.
    pub points: usize,
    /// Its uncertainty, 0..1 ([`Doubt`]); 1 without a model.
    pub uncertainty: f64,
    /// Distance, by the ranks of the descriptors, to the nearest segment that is labelled or was suggested before.
    pub diversity: f64,
    /// uncertainty · points^power · diversity when it was chosen; the diversity alone without a model.
    pub score: f64,
}

/// The segments whose labels are expected to help most, best first.
///
/// Greedy (farthest first): chooses the segment of the largest uncertainty x size^power x diversity, then updates all
/// diversities by the distance to it. Distances are between the ranks of the segments' descriptors, so that a class of a
/// few segments is as far from the others as one of many. O(count · segments).
///
/// # Errors
/// If a parameter is out of range, lengths differ, or the work was cancelled.
pub fn suggest(
    segmented: &Segmented,
    known: KnownPoints<'_>,
    params: &SuggestParams,
    monitor: &Monitor,
) -> Result<Vec<Suggestion>> {
    params.validate()?;
    let count = segmented.partition.len();
    let labelled = labelled(segmented, known.labels)?;
    let size = |s: usize| segmented.partition.members(s).len();
    let open = (0..count).map(|s| !labelled[s] && size(s) >= params.fewest_points).collect();
    let weights = match known.doubt {
        None => vec![1.0; count],
        Some(Doubt::Uncertainty(values)) => means(segmented, values, 1)?,
        Some(Doubt::Probabilities(values, classes)) => {
            means(segmented, values, classes)?.chunks_exact(classes).map(entropy).collect()
        }
    };
    let power = if known.doubt.is_some() { params.size_power } else { 0.0 };
    let largest = (0..count).map(size).max().unwrap_or(1).max(1);
    let mut search = GreedyChoice {
        weights: (0..count).map(|s| weights[s] * (size(s) as f64).powf(power)).collect(),
        places: places(segmented, params.fewest_points, monitor)?,
        diversity: vec![f64::INFINITY; count],
        shares: (0..count).map(|s| size(s) as f64 / largest as f64).collect(),
        open,
    };
    (0..count).filter(|&s| labelled[s]).for_each(|s| search.approach(s));
    let mut chosen = Vec::new();
    while let Some(best) = search.best().filter(|_| chosen.len() < params.count) {
        monitor.check()?;
        chosen.push(Suggestion {
            cluster_id: best as u32 + 1,
            point: middle(segmented, best),
            points: size(best),
            uncertainty: weights[best],
            diversity: search.newness(best),
            score: search.score(best),
        });
        search.open[best] = false;
        search.approach(best);
    }
    Ok(chosen)
}

/// The state of the greedy choice, one entry a segment.
struct GreedyChoice {
    /// uncertainty · points^power.
    weights: Vec<f64>,
    places: Vec<Place>,
    /// Distance to the nearest segment that is labelled or chosen; infinite while there is none.
    diversity: Vec<f64>,
    /// Number of points over that of the largest segment.
    shares: Vec<f64>,
    /// Whether the segment may be chosen.
    open: Vec<bool>,
}

impl GreedyChoice {
    /// The distance to what is known; while nothing is, the share of the largest segment: the first is the largest.
    fn newness(&self, s: usize) -> f64 {
        if self.diversity[s].is_finite() { self.diversity[s] } else { self.shares[s] }
    }

    fn score(&self, s: usize) -> f64 {
        self.weights[s] * self.newness(s)
    }

    /// The open segment of the largest score; the first of equal ones.
    fn best(&self) -> Option<usize> {
        let open = (0..self.open.len()).filter(|&s| self.open[s]);
        open.max_by(|&a, &b| self.score(a).total_cmp(&self.score(b)).then(b.cmp(&a)))
    }

    /// Reduces diversities to the distance from segment `to`.
    fn approach(&mut self, to: usize) {
        let there = self.places[to];
        for (diversity, place) in self.diversity.iter_mut().zip(&self.places) {
            *diversity = diversity.min(distance(place, &there));
        }
    }
}

/// Entropy of probabilities over the largest possible one, 0..1.
fn entropy(probabilities: &[f64]) -> f64 {
    let most = (probabilities.len() as f64).ln().max(f64::MIN_POSITIVE);
    let sum: f64 = probabilities.iter().filter(|p| **p > 0.0).map(|p| -p * p.ln()).sum();
    (sum / most).clamp(0.0, 1.0)
}

/// Means over the points of each segment of `width` values a point of the cloud, each in 0..=1.
fn means(segmented: &Segmented, values: &[f32], width: usize) -> Result<Vec<f64>> {
    let points = segmented.clusters.len();
    if width == 0 || values.len() != points * width {
        return Err(Error::input(format!("{} uncertainties or probabilities for {points} points", values.len())));
    }
    let mut means = Vec::with_capacity(segmented.partition.len() * width);
    for members in segmented.partition.iter() {
        let row = |&node: &u32| segmented.points.frame.index[node as usize] as usize * width;
        for column in 0..width {
            let sum: f64 = members.iter().map(|node| f64::from(values[row(node) + column])).sum();
            means.push((sum / members.len().max(1) as f64).clamp(0.0, 1.0));
        }
    }
    Ok(means)
}

/// Whether each segment contains a label.
fn labelled(segmented: &Segmented, labels: Option<&Labels>) -> Result<Vec<bool>> {
    let Some(labels) = labels else { return Ok(vec![false; segmented.partition.len()]) };
    if labels.codes.len() != segmented.clusters.len() {
        return Err(Error::input(format!("{} labels for {} points", labels.codes.len(), segmented.clusters.len())));
    }
    let known = labels.of(&segmented.points.frame.index);
    Ok(majorities(&segmented.partition, &known)?.iter().map(|majority| majority.labelled > 0).collect())
}

/// Index in the cloud of the point of a segment that is nearest to its mean.
fn middle(segmented: &Segmented, s: usize) -> u32 {
    let (points, members) = (&segmented.points, segmented.partition.members(s));
    let at = |i: usize| points.positions.xyz(i).map(f64::from);
    let count = members.len().max(1) as f64;
    let mean = [0, 1, 2].map(|a| members.iter().map(|&i| at(i as usize)[a]).sum::<f64>() / count);
    let distance = |i: u32| (0..3).map(|a| (at(i as usize)[a] - mean[a]).powi(2)).sum::<f64>();
    let nearest = members.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
    nearest.map_or(0, |i| points.frame.index[i as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::parallel::Monitor;
    use crate::recipes::segment::{SegmentParams, segment};

    /// A floor, two separate walls, and a distant line.
    fn scene() -> Cloud {
        let mut rows = Vec::new();
        for i in 0..60 {
            for j in 0..30 {
                let (a, b) = (f64::from(i) * 0.25, f64::from(j) * 0.25);
                rows.push([a, b, 0.0]);
                if j < 20 {
                    rows.push([a, 30.0, 5.0 + b]);
                    rows.push([a, 60.0, 5.0 + b]);
                }
            }
        }
        rows.extend((0..200).map(|i| [f64::from(i) * 0.1, 90.0, 8.0]));
        Cloud::from_rows(&rows).unwrap()
    }

    fn suggested(known: KnownPoints<'_>, count: usize) -> (Cloud, Result<Vec<Suggestion>>) {
        let (cloud, monitor) = (scene(), Monitor::default());
        let segmented = segment(&cloud, None, &SegmentParams::default(), &monitor).unwrap();
        let params = SuggestParams { count, ..SuggestParams::default() };
        let found = suggest(&segmented, known, &params, &monitor);
        (cloud, found)
    }

    #[test]
    fn every_kind_of_segment_is_among_the_first_whatever_its_size() {
        let (cloud, found) = suggested(KnownPoints::default(), 3);
        let rows: Vec<f64> = found.unwrap().iter().map(|s| cloud.xyz(s.point as usize)[1]).collect();
        let wall = rows.iter().any(|y| [30.0, 60.0].contains(y));
        assert!(wall && rows.contains(&90.0) && rows.iter().any(|y| *y < 8.0), "{rows:?}");
    }

    #[test]
    fn what_is_unlike_the_labelled_segments_comes_first() {
        let cloud = scene();
        // With one wall labelled, the other is the least new.
        let codes = (0..cloud.len()).map(|i| (cloud.xyz(i)[1] == 30.0).then_some(6)).collect();
        let labels = Labels { codes, ..Labels::default() };
        let known = KnownPoints { labels: Some(&labels), ..KnownPoints::default() };
        let next = suggested(known, 100).1.unwrap();
        let wall = |s: &Suggestion| cloud.xyz(s.point as usize)[1];
        assert!(next.len() >= 3 && next.iter().all(|s| s.points >= 10 && wall(s) != 30.0));
        assert!(wall(&next[0]) != 60.0 && next[0].score >= next[1].score);
        let short = Labels { codes: vec![None; 3], ..Labels::default() };
        assert!(suggested(KnownPoints { labels: Some(&short), ..KnownPoints::default() }, 1).1.is_err());
    }

    #[test]
    fn certain_segments_are_not_asked_for() {
        let cloud = scene();
        let entropy: Vec<f32> = (0..cloud.len()).map(|i| if cloud.xyz(i)[1] == 60.0 { 0.9 } else { 0.0 }).collect();
        let unsure = |values| KnownPoints { doubt: Some(Doubt::Uncertainty(values)), ..KnownPoints::default() };
        let found = suggested(unsure(&entropy), 1).1.unwrap();
        assert_eq!(cloud.xyz(found[0].point as usize)[1], 60.0);
        assert!(suggested(unsure(&entropy[1..]), 1).1.is_err());
        assert!(suggested(unsure(&entropy), 0).1.is_err());
    }

    #[test]
    fn a_segment_between_classes_is_uncertain_even_if_each_of_its_points_is_sure() {
        let cloud = scene();
        let of = |i: usize| match cloud.xyz(i)[1] {
            60.0 if i.is_multiple_of(2) => [0.0, 1.0],
            _ => [1.0, 0.0],
        };
        let values: Vec<f32> = (0..cloud.len()).flat_map(of).collect();
        let doubt = |classes| KnownPoints { doubt: Some(Doubt::Probabilities(&values, classes)), labels: None };
        let found = suggested(doubt(2), 1).1.unwrap();
        assert!(cloud.xyz(found[0].point as usize)[1] == 60.0 && found[0].uncertainty > 0.99, "{found:?}");
        assert!(suggested(doubt(3), 1).1.is_err() && suggested(doubt(0), 1).1.is_err());
    }
}
