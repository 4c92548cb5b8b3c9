//! Which code stands behind the name of a method, and what of the parameters depends on it.
//!
//! A new method needs its name in `method.rs`, a file with its [`PartitionMethod`], one line in the list below, a section
//! in [`SegmentParams`] if it has parameters, and its lines in `docs/partitions.md`.

use super::felzenszwalb::Felzenszwalb;
use super::growing::{Clusters, OctreeRegionGrowing, RegionGrowing};
use super::interface::PartitionMethod;
use super::on_points::OnPoints;
use super::on_supervoxels::{LocalGraphs, Supervoxels};
use super::riemannian::Riemannian;
use super::{SegmentMethod, SegmentParams};
use crate::cloud::names;
use crate::error::{Error, Result};
use crate::recipes::SupervoxelMode;
use crate::segmentation::{Intent, Method};

impl SegmentMethod {
    pub(super) fn method(self) -> &'static dyn PartitionMethod {
        match self {
            Self::CutPursuit => &OnPoints(Method::CutPursuit),
            Self::Merge => &OnPoints(Method::Merge),
            Self::Felzenszwalb => &Felzenszwalb,
            Self::Riemannian => &Riemannian,
            Self::LocalGraph => &LocalGraphs,
            Self::Slic => &Supervoxels(SupervoxelMode::Slic),
            Self::Vccs => &Supervoxels(SupervoxelMode::Vccs),
            Self::RegionGrowing => &RegionGrowing,
            Self::OctreeRegionGrowing => &OctreeRegionGrowing,
            Self::Clusters => &Clusters,
        }
    }

    /// Names of dimensions that the method gives besides the segments.
    pub fn dimensions(self) -> &'static [&'static str] {
        self.method().dimensions()
    }

    /// The names of the methods for which `holds`, for messages.
    fn those(holds: impl Fn(&dyn PartitionMethod) -> bool) -> String {
        let names: Vec<&str> = Self::ALL.iter().filter(|m| holds(m.method())).map(|m| m.name()).collect();
        names.join(", ")
    }
}

impl SegmentParams {
    /// Columns of a cloud that the method reads, besides labels.
    pub fn columns(&self) -> Vec<String> {
        match self.method.method().reads_colours() && self.objects.colour != Some(false) {
            true => names::COLOUR.iter().map(ToString::to_string).collect(),
            false => Vec::new(),
        }
    }

    /// Checks the ranges of the method's fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if self.neighbours == 0 {
            return Err(Error::parameter("neighbours", 0, "1 or more"));
        }
        if !(2..=32).contains(&self.growing.neighbours) {
            return Err(Error::parameter("growing.neighbours", self.growing.neighbours, "2..=32"));
        }
        if !self.levels.is_empty() && !self.method.method().has_levels() {
            let able = SegmentMethod::those(|method| method.has_levels());
            return Err(Error::parameter(
                "levels",
                format!("{:?}", self.levels),
                format!("the method {able}, or none"),
            ));
        }
        self.neighbourhood.validate()?;
        self.adjacency.validate()?;
        self.partition.validate()?;
        self.felzenszwalb.validate()?;
        self.riemannian.validate()?;
        self.objects.validate()?;
        self.region_growing.validate()?;
        self.octree_region_growing.validate()?;
        self.clusters.validate()
    }

    /// The same parameters with another aim: a strength or an intent.
    ///
    /// # Errors
    /// If the method does not support the aim.
    pub fn aimed(mut self, aim: Intent) -> Result<Self> {
        let method = self.method;
        match method.method().aim(&mut self, aim) {
            Some(()) => Ok(self),
            None => {
                let able = SegmentMethod::those(|m| m.aim(&mut Self::default(), aim).is_some());
                Err(Error::parameter("method", method.name(), format!("one of {able} with this aim")))
            }
        }
    }

    /// The same parameters with another size, metres: of the supervoxels, or of the largest voxels of an octree.
    ///
    /// # Errors
    /// If the method has no size.
    pub fn with_size(mut self, size: f64) -> Result<Self> {
        let method = self.method;
        match method.method().set_size(&mut self, size) {
            Some(()) => Ok(self),
            None => {
                let able = SegmentMethod::those(|m| m.set_size(&mut Self::default(), size).is_some());
                Err(Error::parameter("method", method.name(), format!("one of {able}: the others have no size")))
            }
        }
    }

    /// Checks that `partition.cutoff` has an effect on the segments.
    ///
    /// # Errors
    /// If the method does not merge small segments.
    pub fn check_cutoff(&self) -> Result<()> {
        self.check_method(|method| method.merges_small(), "merge small segments (cutoff)")
    }

    /// Checks that `neighbourhood` has an effect on the segments.
    ///
    /// # Errors
    /// If the method does not describe points by their neighbours.
    pub fn check_neighbourhood(&self) -> Result<()> {
        self.check_method(|method| method.describes_points(), "describe points by their neighbours (k_min)")
    }

    /// Fails if the method is not one of those that can do something.
    fn check_method(&self, able: impl Fn(&dyn PartitionMethod) -> bool, ability: &str) -> Result<()> {
        match able(self.method.method()) {
            true => Ok(()),
            false => {
                let expected = format!("one of {}: the others do not {ability}", SegmentMethod::those(able));
                Err(Error::parameter("method", self.method.name(), expected))
            }
        }
    }
}
