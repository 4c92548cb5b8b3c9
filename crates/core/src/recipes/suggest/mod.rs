//! Active learning: suggests the segments to label next, those that are uncertain, large, and different from the
//! labelled ones.

mod page;

pub use page::suggestion_page;

use super::Labels;
use super::segment::Segmented;
use crate::error::{Error, Result};
use crate::segmentation::{majorities, segment_means, segment_shapes};
use serde::{Deserialize, Serialize};

/// Parameters of [`suggest`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SuggestParams {
    /// Number of segments to suggest, at least 1.
    pub count: usize,
    /// Exponent of the number of points in the score, 0..=1: 1 favours the largest segments, 0 ignores sizes.
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

/// A suggested segment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Suggestion {
    /// Number of the segment (`ClusterID`).
    pub cluster_id: u32,
    /// Index in the cloud of the point nearest to the segment's mean.
    pub point: u32,
    /// Number of points.
    pub points: usize,
    /// Entropy of its mean probabilities divided by the largest possible one, 0..1; 1 without a model.
    pub uncertainty: f64,
    /// Distance, in standard deviations of the descriptors, to the nearest segment that is labelled or was suggested
    /// before.
    pub diversity: f64,
    /// uncertainty · points^power · diversity when it was chosen.
    pub score: f64,
}

/// The segments whose labels are expected to help most, best first.
///
/// Greedy: chooses the segment of the largest uncertainty x size^power x diversity, then updates all diversities by the
/// distance to it. `uncertainty`, if a model is given, has one value in 0..=1 for each point of the cloud (the entropy
/// of its class probabilities over ln(classes)). O(count · segments).
///
/// # Errors
/// If a parameter is out of range or lengths differ.
pub fn suggest(
    segmented: &Segmented,
    uncertainty: Option<&[f32]>,
    labels: Option<&Labels>,
    params: &SuggestParams,
) -> Result<Vec<Suggestion>> {
    params.validate()?;
    let partition = &segmented.partition;
    let places = embed(segmented)?;
    let unsure = unsure(segmented, uncertainty)?;
    let labelled = labelled(segmented, labels)?;
    let mut diversity: Vec<f64> = vec![f64::INFINITY; partition.len()];
    for s in (0..partition.len()).filter(|&s| labelled[s]) {
        approach(&mut diversity, &places, s);
    }
    let mut open: Vec<bool> =
        (0..partition.len()).map(|s| !labelled[s] && partition.members(s).len() >= params.fewest_points).collect();
    let mut chosen = Vec::new();
    while chosen.len() < params.count {
        // While no segment is labelled or suggested, all have the same diversity.
        let new = |s: usize| if diversity[s].is_finite() { diversity[s] } else { 1.0 };
        let score = |s: usize| unsure[s] * (partition.members(s).len() as f64).powf(params.size_power) * new(s);
        let Some(best) =
            (0..partition.len()).filter(|&s| open[s]).max_by(|&a, &b| score(a).total_cmp(&score(b)).then(b.cmp(&a)))
        else {
            break;
        };
        chosen.push(Suggestion {
            cluster_id: best as u32 + 1,
            point: middle(segmented, best),
            points: partition.members(best).len(),
            uncertainty: unsure[best],
            diversity: new(best),
            score: score(best),
        });
        open[best] = false;
        approach(&mut diversity, &places, best);
    }
    Ok(chosen)
}

/// Feature vectors of segments: mean descriptors, sides of the oriented box, height; each in standard deviations over
/// the points.
fn embed(segmented: &Segmented) -> Result<Vec<[f64; 8]>> {
    let partition = &segmented.partition;
    let means = segment_means(partition, &segmented.descriptors.values, segmented.descriptors.width())?;
    let shapes = segment_shapes(partition, &segmented.points.positions)?;
    let mut places: Vec<[f64; 8]> = Vec::with_capacity(partition.len());
    for (mean, shape) in means.chunks_exact(segmented.descriptors.width()).zip(&shapes) {
        let side = shape.oriented.sides.map(|s| (s + 0.05).ln());
        let mean = [mean[0], mean[1], mean[2], mean[3]].map(f64::from);
        places.push([mean[0], mean[1], mean[2], mean[3], side[0], side[1], side[2], shape.centroid[2]]);
    }
    let count = places.len().max(1) as f64;
    for column in 0..8 {
        let mean = places.iter().map(|p| p[column]).sum::<f64>() / count;
        let spread = (places.iter().map(|p| (p[column] - mean).powi(2)).sum::<f64>() / count).sqrt();
        let scale = if spread > 1e-12 { 1.0 / spread } else { 0.0 };
        places.iter_mut().for_each(|p| p[column] = (p[column] - mean) * scale);
    }
    Ok(places)
}

fn unsure(segmented: &Segmented, uncertainty: Option<&[f32]>) -> Result<Vec<f64>> {
    let Some(values) = uncertainty else { return Ok(vec![1.0; segmented.partition.len()]) };
    if values.len() != segmented.clusters.len() {
        return Err(Error::input(format!("{} uncertainties for {} points", values.len(), segmented.clusters.len())));
    }
    let mean = |members: &[u32]| {
        let of = |&node: &u32| f64::from(values[segmented.points.frame.index[node as usize] as usize]);
        members.iter().map(of).sum::<f64>() / members.len().max(1) as f64
    };
    Ok((0..segmented.partition.len()).map(|s| mean(segmented.partition.members(s)).clamp(0.0, 1.0)).collect())
}

/// Whether each segment contains a label.
fn labelled(segmented: &Segmented, labels: Option<&Labels>) -> Result<Vec<bool>> {
    let Some(labels) = labels else { return Ok(vec![false; segmented.partition.len()]) };
    let of = |&i: &u32| labels.codes.get(i as usize).copied().flatten();
    let known: Vec<Option<u8>> = segmented.points.frame.index.iter().map(of).collect();
    Ok(majorities(&segmented.partition, &known)?.iter().map(|m| m.labelled > 0).collect())
}

/// Reduces diversities to the distance from segment `to`.
fn approach(diversity: &mut [f64], places: &[[f64; 8]], to: usize) {
    for (diversity, place) in diversity.iter_mut().zip(places) {
        let squared: f64 = place.iter().zip(&places[to]).map(|(a, b)| (a - b).powi(2)).sum();
        *diversity = diversity.min(squared.sqrt());
    }
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

    #[test]
    fn what_is_unlike_the_labelled_segments_comes_first() {
        let cloud = scene();
        let segmented = segment(&cloud, None, &SegmentParams::default(), &Monitor::default()).unwrap();
        let params = SuggestParams { count: 100, ..SuggestParams::default() };
        let all = suggest(&segmented, None, None, &params).unwrap();
        assert!(all.len() >= 4 && all.iter().all(|s| s.points >= 10));
        // With one wall labelled, the other is the least new of the large segments.
        let wall = |s: &Suggestion| cloud.xyz(s.point as usize)[1];
        let codes = (0..cloud.len()).map(|i| (cloud.xyz(i)[1] == 30.0).then_some(6)).collect();
        let labels = Labels { codes, ..Labels::default() };
        let next = suggest(&segmented, None, Some(&labels), &params).unwrap();
        assert!(next.iter().all(|s| wall(s) != 30.0));
        assert!(wall(&next[0]) != 60.0 && next[0].score >= next[1].score);
    }

    #[test]
    fn certain_segments_are_not_asked_for() {
        let cloud = scene();
        let segmented = segment(&cloud, None, &SegmentParams::default(), &Monitor::default()).unwrap();
        let entropy: Vec<f32> = (0..cloud.len()).map(|i| if cloud.xyz(i)[1] == 60.0 { 0.9 } else { 0.0 }).collect();
        let params = SuggestParams { count: 1, ..SuggestParams::default() };
        let found = suggest(&segmented, Some(&entropy), None, &params).unwrap();
        assert_eq!(cloud.xyz(found[0].point as usize)[1], 60.0);
        assert!(suggest(&segmented, Some(&entropy[1..]), None, &params).is_err());
        assert!(suggest(&segmented, None, None, &SuggestParams { count: 0, ..params }).is_err());
    }
}
