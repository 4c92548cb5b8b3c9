//! Clusters at four levels: segments, merged segments, categories of them, and how central they are.

mod automatic;
mod contacts;
mod first;
mod k_means;
mod merging;
mod params;
#[cfg(test)]
mod tests;
mod third;

pub use automatic::{Automatic, automatic_parameters};
pub use k_means::{HartiganParams, KMeans, KMeansStart, NumberRows, hartigan};
pub use params::{AutomaticParams, ClusterParams};

use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::features::definition::{Feature, Group};
use crate::graph::{Graph, centrality};
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::Shape;
use crate::parallel::{Monitor, map_watched};
use contacts::{contacts, grouped};
use first::{First, NONE, Object};
use merging::{Limits, Second};
use serde::{Deserialize, Serialize};
use third::{Merged, Third};

/// What the levels are found in.
#[derive(Clone, Copy, Debug)]
pub struct ClusterInput<'a> {
    /// The points.
    pub points: &'a Positions,
    /// Height of each above the ground, metres; NaN where it is not known. Without heights, those above the lowest point
    /// serve.
    pub heights: Option<&'a [f32]>,
    /// Red, green, blue of each, 0..=1.
    pub colours: Option<&'a [[f32; 3]]>,
}

/// How the levels become features of points.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClusterForm {
    /// As in the paper, one number a level: the rank of the segment, and of the merged segment, by size; the category; the
    /// centrality. The ranks name places in the cloud, so that training and test parts must be clustered together.
    #[default]
    Rank,
    /// Numbers that mean the same in every cloud: size, planarity, verticality of the segment and of the merged segment,
    /// mean height of the category, centrality.
    Descriptor,
}

/// Clusters at four levels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClusterLevels {
    /// The parameters of the segmentation, and where they come from.
    pub automatic: Automatic,
    /// Segment of each point, from 1 on by decreasing size; 0 for points that belong to none.
    segment: Vec<u32>,
    /// Number of each segment on levels 1 to 4, from 1 on.
    numbers: [Vec<u32>; 4],
    /// Number of clusters on each level.
    pub counts: [u32; 4],
    /// Centrality of each segment, 0..=1.
    centrality: Vec<f32>,
    segments: Vec<Object>,
    merged: Vec<Object>,
    /// Mean height of each category, metres.
    category_heights: Vec<f64>,
}

/// Clusters of a cloud at four levels.
///
/// E. Grilli, F. Poux, F. Remondino, *Unsupervised object-based clustering in support of supervised point-based 3D point
/// cloud classification*, ISPRS Archives XLIII-B2-2021, section 3.2: (1) region growing gives small planar segments; what is
/// left is divided into connected sets; (2) adjacent segments with similar properties are merged; (3) k-means with
/// Hartigan's rule gives categories of the merged segments; (4) centralities in the graphs of the clusters of these three
/// levels, where the weight of an edge is the number of pairs of points within ε, are each divided by the largest and
/// averaged. The parameters follow from the cloud ([`automatic_parameters`]). What the paper leaves open is settled in
/// `docs/clusters.md`.
///
/// The result does not depend on the order of the points (but for ties) nor on the number of threads. O(n log n) for a
/// bounded number of points in a ball; memory about 80 bytes a point.
///
/// # Errors
/// As [`automatic_parameters`]; if there are not as many heights and colours as points.
///
/// ```
/// use scansion_core::segmentation::{ClusterInput, ClusterParams, cluster_levels};
/// use scansion_core::{cloud::Positions, parallel::Monitor};
/// // A floor and a wall that meet.
/// let points: Positions = (0..3200u16)
///     .map(|i| (f32::from(i % 40) / 10.0, f32::from(i / 40 % 40) / 10.0, i < 1600))
///     .map(|(a, b, floor)| if floor { [a, b, 0.0] } else { [a, 4.0, b] })
///     .collect();
/// let input = ClusterInput { points: &points, heights: None, colours: None };
/// let found = cluster_levels(&input, &ClusterParams::default(), &Monitor::default())?;
/// assert_eq!(found.counts[0], 2);
/// # Ok::<(), scansion_core::Error>(())
/// ```
pub fn cluster_levels(input: &ClusterInput<'_>, params: &ClusterParams, monitor: &Monitor) -> Result<ClusterLevels> {
    let n = input.points.len();
    for (what, found) in
        [("heights", input.heights.map(<[f32]>::len)), ("colours", input.colours.map(<[[f32; 3]]>::len))]
    {
        if let Some(found) = found.filter(|found| *found != n) {
            return Err(Error::input(format!("{found} {what} for {n} points (allowed: as many)")));
        }
    }
    let mut prepared = automatic::prepare(input.points, params, monitor)?;
    let First { labels, objects } = first::first_level(&prepared, params, monitor)?;
    (prepared.normals, prepared.variation) = (Vec::new(), Vec::new());
    let graph = contacts(&prepared.stacks, &labels, prepared.automatic.radius, monitor)?;
    let graph = if graph.len() == objects.len() { graph } else { Graph::new(objects.len(), &[], &[])? };
    let limits = Limits::new(&prepared.automatic, params);
    let second = merging::second_level(&objects, &graph, &limits, monitor)?;
    let of = |i: usize| (labels[i] != NONE).then(|| second.group[labels[i] as usize - 1] as usize);
    let merged = Merged {
        stacks: &prepared.stacks,
        of: &of,
        objects: &second.objects,
        heights: input.heights,
        colours: input.colours,
    };
    let third = third::third_level(&merged, params, monitor)?;
    let central = Central { graph: &graph, second: &second, third: &third }.values(params, monitor)?;
    let mut segment = vec![NONE; n];
    prepared.stacks.index.iter().zip(&labels).for_each(|(&i, &label)| segment[i as usize] = label);
    let category = second.group.iter().map(|&g| third.category[g as usize] + 1).collect();
    let (rank, ranks) = ranked(&central);
    let counts = [objects.len() as u32, second.objects.len() as u32, third.heights.len() as u32, ranks];
    let numbers = [(1..=objects.len() as u32).collect(), second.group.iter().map(|g| g + 1).collect(), category, rank];
    Ok(ClusterLevels {
        automatic: prepared.automatic,
        segment,
        numbers,
        counts,
        centrality: central,
        segments: objects,
        merged: second.objects,
        category_heights: third.heights,
    })
}

impl ClusterLevels {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.segment.len()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.segment.is_empty()
    }

    /// Cluster of each point on a level, 1..=4; 0 for points that belong to none. On level 4, segments of equal centrality
    /// are one cluster, and the most central is 1.
    ///
    /// # Errors
    /// If there is no such level, or the work was cancelled.
    pub fn labels(&self, level: usize, monitor: &Monitor) -> Result<Vec<u32>> {
        let Some(numbers) = level.checked_sub(1).and_then(|l| self.numbers.get(l)) else {
            return Err(Error::parameter("level", level, "1..=4"));
        };
        map_watched(self.len(), monitor, |i| match self.segment[i] {
            NONE => 0,
            s => numbers[s as usize - 1],
        })
    }

    /// Centrality of the clusters of each point, 0..=1; 0 for points that belong to none.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn centralities(&self, monitor: &Monitor) -> Result<Vec<f32>> {
        map_watched(self.len(), monitor, |i| match self.segment[i] {
            NONE => 0.0,
            s => self.centrality[s as usize - 1],
        })
    }

    /// The levels as features, one row a point; 0 for points that belong to no segment.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn features(&self, form: ClusterForm, monitor: &Monitor) -> Result<FeatureTable> {
        let group = match form {
            ClusterForm::Rank => Group::ClusterRank,
            ClusterForm::Descriptor => Group::ClusterDescriptor,
        };
        let columns: Vec<Feature> = group.definitions().map(|d| d.feature).collect();
        let rows: Vec<f32> =
            (0..self.segments.len()).flat_map(|s| columns.iter().map(move |&f| self.value(f, s))).collect();
        let (width, mut values) = (columns.len(), Vec::new());
        values.reserve_exact(self.len() * width);
        for piece in crate::parallel::watched(self.len(), monitor) {
            for &s in &self.segment[piece?] {
                match s {
                    NONE => values.extend(std::iter::repeat_n(0.0, width)),
                    s => values.extend_from_slice(&rows[(s as usize - 1) * width..s as usize * width]),
                }
            }
        }
        Ok(FeatureTable { names: group.names().collect(), values })
    }

    /// A feature of a segment.
    fn value(&self, feature: Feature, segment: usize) -> f32 {
        let number = |level: usize| self.numbers[level][segment];
        let merged = &self.merged[number(1) as usize - 1];
        let [own, wide] = [&self.segments[segment], merged];
        let size = |o: &Object| o.spread.count.log10();
        let planarity = |o: &Object| Shape::of::<Exact>(o.spread.eigen().values).planarity;
        let verticality = |o: &Object| (1.0 - o.spread.eigen().vectors[2][2].abs()).max(0.0);
        let share = |level: usize| f64::from(number(level)) / f64::from(self.counts[level]);
        let value = match feature {
            Feature::ClusterRank1 => share(0),
            Feature::ClusterRank2 => share(1),
            Feature::ClusterCategory => share(2),
            Feature::ClusterSize1 => size(own),
            Feature::ClusterPlanarity1 => planarity(own),
            Feature::ClusterVerticality1 => verticality(own),
            Feature::ClusterSize2 => size(wide),
            Feature::ClusterPlanarity2 => planarity(wide),
            Feature::ClusterVerticality2 => verticality(wide),
            Feature::ClusterHeight => self.category_heights[number(2) as usize - 1],
            _ => f64::from(self.centrality[segment]),
        };
        value as f32
    }
}

/// Ranks by decreasing value, equal values together, and their number.
fn ranked(values: &[f32]) -> (Vec<u32>, u32) {
    let mut distinct = values.to_vec();
    distinct.sort_by(|a, b| b.total_cmp(a));
    distinct.dedup();
    let rank = |v: &f32| distinct.partition_point(|d| d > v) as u32 + 1;
    (values.iter().map(rank).collect(), distinct.len() as u32)
}

/// The graphs of level 4.
struct Central<'a> {
    graph: &'a Graph,
    second: &'a Second,
    third: &'a Third,
}

impl Central<'_> {
    /// Weighted mean of the centralities of each segment's clusters on levels 1 to 3, each divided by the largest.
    fn values(&self, params: &ClusterParams, monitor: &Monitor) -> Result<Vec<f32>> {
        let Self { graph, second, third } = self;
        let same: Vec<u32> = (0..graph.len() as u32).collect();
        let category: Vec<u32> = second.group.iter().map(|&g| third.category[g as usize]).collect();
        let levels = [(&same, graph.len()), (&second.group, second.objects.len()), (&category, third.heights.len())];
        let total: f64 = params.level_weights.iter().sum();
        let mut values = vec![0.0; graph.len()];
        for ((group, groups), weight) in levels.into_iter().zip(params.level_weights) {
            let found = centrality(&grouped(graph, group, groups, monitor)?, params.centrality, monitor)?;
            let largest = found.iter().copied().fold(0.0, f64::max);
            let share = if largest > 0.0 { weight / (total * largest) } else { 0.0 };
            values.iter_mut().zip(group.iter()).for_each(|(value, &g)| *value += share * found[g as usize]);
        }
        Ok(values.into_iter().map(|value| value as f32).collect())
    }
}
