//! Selection of the training points: voxel sub-sampling, thinned copies, class balance.
//!
//! Hackel 2018, chapters 4.4.3 and 4.6.1: training data are filtered by voxels so that their density does not depend on
//! the distance from the scanner; then the largest class keeps at most 4 times the samples of the smallest. If the
//! smallest class has only a handful of points, that rule would leave almost nothing of the others: see
//! [`balance`](crate::classification::sampling::balance).

use crate::classification::sampling::{BalanceParams, Rare};
use crate::cloud::{Cloud, MetricCloud, Values};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, sort_watched_by, watched};
use crate::random::{Stream, stream};
use crate::recipes::Labels;
use crate::voxels::cells::cell_of;
use crate::voxels::planar_density;
use serde::{Deserialize, Serialize};

/// Parameters of the selection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainingParams {
    /// Edge of the voxels that give one sample each, with the most frequent label in the voxel, metres; 0 uses every
    /// point.
    pub voxel: f64,
    /// The largest class keeps at most this multiple of the samples of the smallest class that is learned; at least 1;
    /// infinite (`inf`): all samples.
    pub max_ratio: f64,
    /// `max_ratio` reduces no class below this many samples; the samples of smaller classes get a higher weight
    /// instead.
    pub keep_samples: usize,
    /// A class with fewer samples than this and than a hundredth of the largest class is too rare to be learned; 0:
    /// none is.
    pub rare_below: usize,
    /// Treatment of classes that are too rare: `leave-out` or `keep`.
    pub rare: Rare,
    /// Largest total number of samples; above it all classes are reduced by the same factor.
    pub max_samples: usize,
    /// At most this many samples a class from each cloud and each of its thinned copies, so that dense or large scenes do
    /// not outvote the others; 0: no limit.
    pub per_copy: usize,
    /// Densities, points per square metre, of thinned copies of the cloud that are used for training as well.
    pub densities: Vec<f64>,
    /// Dimension of the training clouds with the weight of each point, 0 or more; points of weight 0 are not learned from.
    #[serde(with = "crate::settings::optional")]
    pub weight: Option<String>,
    /// Boxes `[x min, y min, x max, y max]` in the file's coordinates that are excluded from training.
    pub exclude: Vec<[f64; 4]>,
}

impl Default for TrainingParams {
    fn default() -> Self {
        let balance = BalanceParams::default();
        Self {
            voxel: 0.01,
            max_ratio: balance.max_ratio,
            keep_samples: balance.keep_samples,
            rare_below: balance.rare_below,
            rare: balance.rare,
            max_samples: balance.max_samples,
            per_copy: 0,
            densities: Vec::new(),
            weight: None,
            exclude: Vec::new(),
        }
    }
}

impl TrainingParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !self.voxel.is_finite() || self.voxel < 0.0 {
            return Err(Error::parameter("training.voxel", self.voxel, "a size in metres, 0 or more"));
        }
        if self.max_ratio.is_nan() || self.max_ratio < 1.0 {
            return Err(Error::parameter("training.max_ratio", self.max_ratio, "1 or more"));
        }
        if self.max_samples == 0 {
            return Err(Error::parameter("training.max_samples", 0, "1 or more"));
        }
        match self.densities.iter().find(|d| !d.is_finite() || **d <= 0.0) {
            Some(d) => Err(Error::parameter("training.densities", d, "points per square metre, above 0")),
            None => Ok(()),
        }
    }

    /// The parameters of the class balance.
    pub(in crate::recipes) fn balance(&self, seed: u64) -> BalanceParams {
        BalanceParams {
            max_ratio: self.max_ratio,
            keep_samples: self.keep_samples,
            rare_below: self.rare_below,
            rare: self.rare,
            max_samples: self.max_samples,
            seed,
        }
    }

    /// Columns of the training clouds that are read.
    pub(in crate::recipes) fn columns(&self) -> Vec<String> {
        self.weight.iter().cloned().collect()
    }

    /// The weights of a cloud's points, if they are asked for.
    fn weights<'a>(&self, cloud: &'a Cloud) -> Result<Option<&'a Values>> {
        let Some(name) = &self.weight else { return Ok(None) };
        match cloud.column(name) {
            Some(column) => Ok(Some(&column.values)),
            None => Err(Error::input(format!("training.weight: the cloud has no dimension {name}"))),
        }
    }

    /// Whether a place, in the file's coordinates, is excluded from training.
    pub(in crate::recipes) fn excludes(&self, x: f64, y: f64) -> bool {
        self.exclude.iter().any(|b| x >= b[0] && y >= b[1] && x <= b[2] && y <= b[3])
    }
}

/// A candidate for a training sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::recipes) struct Candidate {
    /// Index in the cloud (or its thinned copy).
    pub(in crate::recipes) point: u32,
    /// Class code.
    pub(in crate::recipes) code: u8,
    /// Weight of the point, above 0.
    pub(in crate::recipes) weight: f32,
}

/// One candidate for each voxel: its first point with the most frequent label of the voxel (ties: smallest code).
///
/// O(n log n) time, 28 bytes a labelled point.
///
/// # Errors
/// If the dimension with the weights is missing or has a negative value, or the work was cancelled.
pub(in crate::recipes) fn candidates(
    scene: &MetricCloud<'_>,
    labels: &Labels,
    params: &TrainingParams,
    monitor: &Monitor,
) -> Result<Vec<Candidate>> {
    let (cloud, points) = (scene.cloud, scene.points(monitor)?);
    let weights = params.weights(cloud)?;
    let mut keyed: Vec<([i32; 3], Candidate)> = Vec::new();
    for piece in watched(points.len(), monitor) {
        for i in piece? {
            let point = points.frame.index[i];
            let xyz = cloud.xyz(point as usize);
            let kept = |_: &u8| !params.excludes(xyz[0], xyz[1]);
            let Some(code) = labels.codes[point as usize].filter(kept) else { continue };
            let weight = weights.map_or(Ok(1.0), |values| weight_at(values, point))?;
            if weight <= 0.0 {
                continue;
            }
            let voxel = match params.voxel > 0.0 {
                true => cell_of(points.positions.xyz(i).map(|v| f64::from(v) / params.voxel)),
                // Every point has a voxel of its own.
                false => [point as i32; 3],
            };
            keyed.push((voxel, Candidate { point, code, weight }));
        }
    }
    drop(points);
    let order = |(key, c): &([i32; 3], Candidate)| (*key, c.code, c.point);
    sort_watched_by(&mut keyed, |a, b| order(a).cmp(&order(b)), monitor)?;
    monitor.check()?;
    Ok(keyed.chunk_by(|a, b| a.0 == b.0).filter_map(majority).collect())
}

/// The weight of a point.
fn weight_at(values: &Values, point: u32) -> Result<f32> {
    let weight = values.get(point as usize);
    match weight >= 0.0 && weight.is_finite() {
        true => Ok(weight as f32),
        false => Err(Error::input(format!("training.weight: found {weight} at point {point}, expected 0 or more"))),
    }
}

/// The candidate of a voxel, whose members are sorted by code, then by point.
fn majority(voxel: &[([i32; 3], Candidate)]) -> Option<Candidate> {
    let runs = voxel.chunk_by(|a, b| a.1.code == b.1.code);
    runs.fold(None, |best: Option<&[([i32; 3], Candidate)]>, run| match best {
        Some(b) if b.len() >= run.len() => Some(b),
        _ => Some(run),
    })
    .map(|run| run[0].1)
}

/// The cloud itself (`None`), then its thinned copies, each as indices of its points.
///
/// A density is only used if the cloud is at least a quarter denser.
///
/// # Errors
/// If the work was cancelled.
pub(in crate::recipes) fn copies(
    scene: &MetricCloud<'_>,
    params: &TrainingParams,
    seed: u64,
    monitor: &Monitor,
) -> Result<Vec<Option<Vec<u32>>>> {
    let mut copies = vec![None];
    let density = planar_density(&scene.points(monitor)?.positions, monitor)?;
    for (c, &target) in params.densities.iter().enumerate() {
        if density > 1.25 * target {
            let mut random = stream(seed, 0x7468_696e ^ (c as u64) << 32);
            copies.push(Some(thin(scene.cloud.len(), target / density, &mut random, monitor)?));
        }
    }
    Ok(copies)
}

fn thin(points: usize, share: f64, random: &mut Stream, monitor: &Monitor) -> Result<Vec<u32>> {
    let mut kept = Vec::new();
    for piece in watched(points, monitor) {
        kept.extend(piece?.map(|i| i as u32).filter(|_| random.uniform() < share));
    }
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Column;

    fn labels(codes: &[u8]) -> Labels {
        Labels { codes: codes.iter().map(|&c| (c > 0).then_some(c)).collect(), ..Labels::default() }
    }

    #[test]
    fn a_voxel_gives_its_first_point_of_the_majority_label() {
        let rows = [[0.1, 0.1, 0.1], [0.2, 0.2, 0.2], [0.3, 0.1, 0.2], [1.5, 0.0, 0.0]];
        let cloud = Cloud::from_rows(&rows).unwrap();
        let monitor = Monitor::default();
        let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
        let params = TrainingParams { voxel: 1.0, ..TrainingParams::default() };
        let found = candidates(&scene, &labels(&[5, 2, 2, 0]), &params, &monitor).unwrap();
        assert_eq!(found, [Candidate { point: 1, code: 2, weight: 1.0 }]);
        let all = TrainingParams { voxel: 0.0, ..params.clone() };
        let found = candidates(&scene, &labels(&[5, 2, 2, 6]), &all, &monitor).unwrap();
        assert_eq!(found.len(), 4);
        let boxed = TrainingParams { exclude: vec![[0.0, 0.0, 1.0, 1.0]], ..params };
        let found = candidates(&scene, &labels(&[5, 2, 2, 6]), &boxed, &monitor).unwrap();
        assert_eq!(found, [Candidate { point: 3, code: 6, weight: 1.0 }]);
    }

    #[test]
    fn points_have_the_weights_of_a_dimension_and_those_of_none_are_left_out() {
        let mut cloud = Cloud::from_rows(&[[0.0; 3], [1.0; 3], [2.0; 3]]).unwrap();
        cloud.set_column(Column::new("Trust", Values::F32(vec![0.5, 0.0, 3.0]))).unwrap();
        let (monitor, all) = (Monitor::default(), labels(&[2, 2, 6]));
        let find = |cloud: &Cloud, name: &str| {
            let params = TrainingParams { weight: Some(name.into()), ..TrainingParams::default() };
            candidates(&MetricCloud::new(cloud, None, &monitor).unwrap(), &all, &params, &monitor)
        };
        let found = find(&cloud, "Trust").unwrap();
        assert_eq!(found.iter().map(|c| (c.point, c.weight)).collect::<Vec<_>>(), [(0, 0.5), (2, 3.0)]);
        assert!(find(&cloud, "Weight").unwrap_err().to_string().contains("no dimension Weight"));
        cloud.set_column(Column::new("Trust", Values::F32(vec![0.5, -1.0, 3.0]))).unwrap();
        assert!(find(&cloud, "Trust").unwrap_err().to_string().contains("found -1 at point 1"));
    }

    #[test]
    fn copies_reach_the_asked_density() {
        let rows: Vec<[f64; 3]> =
            (0..10_000).map(|i| [f64::from(i % 100) * 0.2, f64::from(i / 100) * 0.2, 0.0]).collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        let monitor = Monitor::default();
        let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
        assert!((planar_density(&scene.points(&monitor).unwrap().positions, &monitor).unwrap() - 25.0).abs() < 1e-9);
        let params = TrainingParams { densities: vec![5.0, 24.0], ..TrainingParams::default() };
        let copies = copies(&scene, &params, 0, &monitor).unwrap();
        assert_eq!(copies.len(), 2);
        let thinned = copies[1].as_ref().unwrap().len();
        assert!((1800..2200).contains(&thinned), "{thinned}");
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let bad = TrainingParams { max_ratio: 0.5, ..TrainingParams::default() };
        assert!(bad.validate().unwrap_err().to_string().contains("max_ratio"));
        assert!(TrainingParams { voxel: f64::NAN, ..TrainingParams::default() }.validate().is_err());
    }
}
