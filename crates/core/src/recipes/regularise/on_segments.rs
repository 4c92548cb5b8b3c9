//! Classification of segments by their mean probabilities and a conditional random field (Guinard & Landrieu 2017,
//! section 4).

use super::field::field;
use super::{Posterior, Probabilities, Regularise, RegulariseParams, Regularised, spread};
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::Monitor;
use crate::segmentation::{
    ChosenSegments, Intent, Interface, Partition, PartitionInput, PartitionParams, StrengthSearch, recut, segment_graph,
};
use std::sync::Arc;

/// A partition and its segment graph.
#[derive(Debug)]
pub(in crate::recipes) struct Segments {
    partition: Arc<Partition>,
    /// w_st: total weight of the point edges between two segments.
    graph: Graph,
    /// ρ of the first segmentation.
    coarseness: f64,
}

/// Segments to be segmented again, and the share (0..1) of the strength with which that is done.
#[derive(Clone, Copy, Debug)]
pub(in crate::recipes) struct Again<'a> {
    pub(in crate::recipes) segments: &'a [u32],
    pub(in crate::recipes) step: f64,
}

impl Segments {
    pub(in crate::recipes) fn new(found: StrengthSearch, points: &Graph, monitor: &Monitor) -> Result<Self> {
        let graph = segment_graph(points, &found.partition, Interface::Weight, monitor)?;
        Ok(Self { partition: Arc::new(found.partition), graph, coarseness: found.strength })
    }

    /// Number of segments.
    pub(in crate::recipes) fn len(&self) -> usize {
        self.partition.len()
    }

    /// Segment of each point.
    pub(in crate::recipes) fn of_points(&self) -> &[u32] {
        self.partition.segments()
    }

    /// Divides some segments into smaller ones.
    pub(in crate::recipes) fn recut(
        &mut self,
        scene: &PartitionInput<'_>,
        again: &Again<'_>,
        params: &PartitionParams,
        monitor: &Monitor,
    ) -> Result<()> {
        let params = PartitionParams { intent: Intent::Strength(again.step * self.coarseness), ..params.clone() };
        let chosen = ChosenSegments { partition: &self.partition, chosen: again.segments };
        self.partition = Arc::new(recut(scene, chosen, &params, monitor)?);
        self.graph = segment_graph(scene.graph, &self.partition, Interface::Weight, monitor)?;
        Ok(())
    }

    /// One label for each segment, transferred to its points.
    pub(in crate::recipes) fn decide(
        &self,
        given: Probabilities<'_>,
        params: &RegulariseParams,
        monitor: &Monitor,
    ) -> Result<Regularised> {
        let Probabilities { values: smooth, classes } = given;
        let rows = self.mean(smooth, classes);
        let partition = Some(Arc::clone(&self.partition));
        if params.method == Regularise::Consensus {
            return Ok(Regularised::by_largest(rows, classes, partition));
        }
        let costs = match params.posterior {
            Posterior::LogOfMean => self.costs(rows.iter().map(|p| -f64::from(*p).ln()), classes),
            Posterior::MeanOfLogs => self.costs(self.mean_of_logs(smooth, classes).into_iter(), classes),
        };
        let found = field(&costs, &self.graph, params, monitor)?;
        let labels = spread(&self.partition, &found.labels);
        Ok(Regularised { labels, rows, partition, energy: Some(found.energy) })
    }

    /// p(L_s = k): mean over the points of each segment.
    fn mean(&self, smooth: &[f32], classes: usize) -> Vec<f32> {
        self.average(smooth, classes, f64::from).into_iter().map(|p| p as f32).collect()
    }

    fn mean_of_logs(&self, smooth: &[f32], classes: usize) -> Vec<f64> {
        self.average(smooth, classes, |p| -f64::from(p).ln())
    }

    fn average(&self, rows: &[f32], classes: usize, of: impl Fn(f32) -> f64) -> Vec<f64> {
        let mut means = Vec::with_capacity(self.partition.len() * classes);
        let mut sum = vec![0.0; classes];
        for s in 0..self.partition.len() {
            let members = self.partition.members(s);
            sum.fill(0.0);
            for &point in members {
                let row = &rows[point as usize * classes..][..classes];
                sum.iter_mut().zip(row).for_each(|(sum, &p)| *sum += of(p));
            }
            means.extend(sum.iter().map(|sum| sum / members.len() as f64));
        }
        means
    }

    /// |s| times the costs of a point, minus that of the cheapest label: only differences matter, and this keeps their precision.
    fn costs(&self, means: impl Iterator<Item = f64>, classes: usize) -> Vec<f32> {
        let means: Vec<f64> = means.collect();
        let rows = means.chunks_exact(classes).enumerate();
        rows.flat_map(|(s, row)| {
            let least = row.iter().copied().fold(f64::INFINITY, f64::min);
            let size = self.partition.members(s).len() as f64;
            row.iter().map(move |cost| (size * (cost - least)) as f32).collect::<Vec<_>>()
        })
        .collect()
    }
}
