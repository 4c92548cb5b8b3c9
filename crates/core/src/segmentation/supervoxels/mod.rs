//! Supervoxels: small pieces of a cloud whose points are similar in position, colour and normal.
//!
//! E. Hasanpour Zaryabi, M. Saadatseresht, E. Ghanbari Parmehr, *An object-based classification framework for ALS point
//! cloud in urban areas*, ISPRS Annals X-4/W1, 2022, section 3.1, mixes two methods; both are here: [`slic()`] on
//! points, as in Achanta et al. (2012), and [`vccs()`] on adjacent voxels, as in Papon et al. (2013).

mod describe;
mod params;
mod slic;
mod vccs;

pub use describe::SupervoxelShape;
pub use params::{Normaliser, SlicParams, SupervoxelWeights, VccsParams};
pub use slic::slic;
pub use vccs::vccs;

use super::Partition;
use crate::cloud::Positions;
use crate::csr::Csr;
use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor, map_watched};

/// Value in [`Supervoxels::labels`] of points without a supervoxel.
pub const NO_SUPERVOXEL: u32 = u32::MAX;

/// Attributes of each point other than its position. A term of the distance is left out if its attribute is missing.
#[derive(Clone, Copy, Debug, Default)]
pub struct PointAttributes<'a> {
    /// Unit normals. Their sign has no influence on which points form a supervoxel, but decides the sign of its normal.
    pub normals: Option<&'a [[f32; 3]]>,
    /// Red, green and blue, 0..=1.
    pub colours: Option<&'a [[f32; 3]]>,
}

impl PointAttributes<'_> {
    fn check(&self, points: usize) -> Result<()> {
        for (name, rows) in [("normals", self.normals), ("colours", self.colours)] {
            let Some(rows) = rows else { continue };
            if rows.len() != points {
                return Err(Error::input(format!("{} {name} for {points} points", rows.len())));
            }
            if let Some(at) = rows.iter().position(|row| row.iter().any(|v| v.is_nan() || v.abs() > 1.001)) {
                return Err(Error::input(format!("{name}: {:?} of point {at} (allowed: -1..=1)", rows[at])));
            }
        }
        Ok(())
    }
}

/// Supervoxels of a cloud, numbered in the order of their smallest point; each holds at least one point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Supervoxels {
    labels: Vec<u32>,
    groups: Csr,
    shapes: Vec<SupervoxelShape>,
    size: f64,
}

/// The supervoxel of each point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SupervoxelLabels {
    /// Supervoxel of each point, numbered in any way below twice the number of points; [`NO_SUPERVOXEL`] for none.
    pub labels: Vec<u32>,
    /// Distance of the seeds, metres.
    pub size: f64,
}

impl Supervoxels {
    /// From the supervoxel of each point. O(n).
    ///
    /// # Errors
    /// If there is not one label a point, a label is too large, attributes do not fit, or the work was cancelled.
    pub fn new(
        points: &Positions,
        attributes: &PointAttributes<'_>,
        labels: SupervoxelLabels,
        monitor: &Monitor,
    ) -> Result<Self> {
        let SupervoxelLabels { labels, size } = labels;
        attributes.check(points.len())?;
        if labels.len() != points.len() {
            return Err(Error::input(format!("{} labels for {} points", labels.len(), points.len())));
        }
        let (labels, count) = renumbered(labels, monitor)?;
        // Points without a supervoxel form a last group, which is removed.
        let keys: Vec<u32> = map_watched(labels.len(), monitor, |i| labels[i].min(count))?;
        let groups = Csr::group_by(&keys, count as usize + 1, monitor)?.truncated(count as usize);
        drop(keys);
        let shapes = describe::shapes(points, attributes, &groups, monitor)?;
        Ok(Self { labels, groups, shapes, size })
    }

    /// Number of supervoxels.
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// True if there is no supervoxel.
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Supervoxel of each point, or [`NO_SUPERVOXEL`].
    pub fn labels(&self) -> &[u32] {
        &self.labels
    }

    /// Points of a supervoxel, ascending.
    pub fn members(&self, supervoxel: usize) -> &[u32] {
        self.groups.group(supervoxel)
    }

    /// Shape and features of each supervoxel.
    pub fn shapes(&self) -> &[SupervoxelShape] {
        &self.shapes
    }

    /// S, the distance of the seeds, in metres.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Transfers a partition of the supervoxels to the points: the segment of each point, or [`NO_SUPERVOXEL`].
    ///
    /// # Errors
    /// If the partition is not one of these supervoxels, or the work was cancelled.
    pub fn spread(&self, segments: &Partition, monitor: &Monitor) -> Result<Vec<u32>> {
        if segments.nodes() != self.len() {
            return Err(Error::input(format!("a partition of {} for {} supervoxels", segments.nodes(), self.len())));
        }
        let of = segments.segments();
        let segment = |i: usize| of.get(self.labels[i] as usize).copied().unwrap_or(NO_SUPERVOXEL);
        map_watched(self.labels.len(), monitor, segment)
    }

    /// The same as a partition of the points, in which each point without a supervoxel is a segment by itself.
    ///
    /// # Errors
    /// If the partition is not one of these supervoxels, or the work was cancelled.
    pub fn point_partition(&self, segments: &Partition, monitor: &Monitor) -> Result<Partition> {
        let mut labels = self.spread(segments, monitor)?;
        let alone = labels.iter_mut().filter(|l| **l == NO_SUPERVOXEL);
        alone.zip(segments.len() as u32..).for_each(|(label, own)| *label = own);
        Partition::from_labels_watched(&labels, monitor)
    }

    /// The supervoxels themselves as a partition of the points.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn partition(&self, monitor: &Monitor) -> Result<Partition> {
        let each: Vec<u32> = (0..self.len() as u32).collect();
        self.point_partition(&Partition::from_labels_watched(&each, monitor)?, monitor)
    }
}

/// Labels renumbered in the order of their smallest point, and their number.
fn renumbered(mut labels: Vec<u32>, monitor: &Monitor) -> Result<(Vec<u32>, u32)> {
    let mut looks = Looks::at(monitor);
    let (mut count, limit) = (0, 2 * labels.len());
    let largest = labels.iter().filter(|l| **l != NO_SUPERVOXEL).max().map_or(0, |&l| l as usize + 1);
    let mut number = vec![NO_SUPERVOXEL; largest.min(limit)];
    for label in labels.iter_mut().filter(|l| **l != NO_SUPERVOXEL) {
        looks.step()?;
        let slot = number.get_mut(*label as usize).ok_or_else(|| {
            Error::input(format!("supervoxel {label} is not below {limit}, twice the number of points"))
        })?;
        if *slot == NO_SUPERVOXEL {
            *slot = count;
            count += 1;
        }
        *label = *slot;
    }
    Ok((labels, count))
}

#[cfg(test)]
mod testing;

#[cfg(test)]
mod tests {
    use super::testing::points_of;
    use super::*;

    #[test]
    fn segments_of_supervoxels_come_to_the_points() {
        let points = points_of(&[[0.0; 3], [5.0, 0.0, 0.0], [5.1, 0.0, 0.0], [9.0, 0.0, 0.0], [0.1, 0.0, 0.0]]);
        let labels = vec![4, 1, 1, NO_SUPERVOXEL, 4];
        let none = PointAttributes::default();
        let found =
            Supervoxels::new(&points, &none, SupervoxelLabels { labels, size: 1.0 }, &Monitor::default()).unwrap();
        assert_eq!(found.labels(), [0, 1, 1, NO_SUPERVOXEL, 0]);
        assert_eq!((found.len(), found.members(1)), (2, &[1, 2][..]));
        let joined = Partition::from_labels(&[0, 0]).unwrap();
        assert_eq!(found.spread(&joined, &Monitor::default()).unwrap(), [0, 0, 0, NO_SUPERVOXEL, 0]);
        assert_eq!(found.point_partition(&joined, &Monitor::default()).unwrap().segments(), [0, 0, 0, 1, 0]);
        assert_eq!(found.partition(&Monitor::default()).unwrap().segments(), [0, 1, 1, 2, 0]);
        assert!(found.spread(&Partition::from_labels(&[0]).unwrap(), &Monitor::default()).is_err());
    }

    #[test]
    fn attributes_that_do_not_fit_are_refused() {
        let points = points_of(&[[0.0; 3], [1.0; 3]]);
        let refused = |normals: &[[f32; 3]]| {
            let attributes = PointAttributes { normals: Some(normals), colours: None };
            Supervoxels::new(
                &points,
                &attributes,
                SupervoxelLabels { labels: vec![0, 0], size: 1.0 },
                &Monitor::default(),
            )
            .is_err()
        };
        assert!(refused(&[[0.0; 3]]) && refused(&[[0.0; 3], [f32::NAN; 3]]) && refused(&[[0.0; 3], [7.0; 3]]));
        assert!(!refused(&[[0.0, 0.0, 1.0]; 2]));
        let none = PointAttributes::default();
        assert!(
            Supervoxels::new(&points, &none, SupervoxelLabels { labels: vec![0, 4], size: 1.0 }, &Monitor::default())
                .is_err()
        );
        assert!(
            Supervoxels::new(&points, &none, SupervoxelLabels { labels: vec![0], size: 1.0 }, &Monitor::default())
                .is_err()
        );
    }
}
