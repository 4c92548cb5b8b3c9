//! The methods of segmentation: their common interface, and the list of all methods.
//!
//! A new method needs a file here with its [`PartitionMethod`], one line in the list below, a section in
//! [`SegmentParams`] if it has parameters, and its lines in `docs/partitions.md`.

use super::felzenszwalb::Felzenszwalb;
use super::growing::{Clusters, OctreeRegionGrowing, RegionGrowing};
use super::on_points::OnPoints;
use super::on_supervoxels::{LocalGraphs, Supervoxels};
use super::riemannian::Riemannian;
use super::{Parted, SegmentParams};
use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::SupervoxelMode;
use crate::segmentation::{Intent, Method};
use serde::{Deserialize, Serialize};

/// A cloud to segment.
pub(super) struct SegmentScene<'a> {
    pub(super) cloud: &'a Cloud,
    pub(super) points: &'a Points,
    /// One label a point, for the intent that is based on them.
    pub(super) labels: Option<&'a [Option<u8>]>,
}

/// A way to divide a cloud into segments.
pub(super) trait PartitionMethod: Sync {
    /// Segments the points.
    fn part(&self, scene: &SegmentScene<'_>, params: &SegmentParams, monitor: &Monitor) -> Result<Parted>;

    /// Whether it reads colours.
    fn reads_colours(&self) -> bool {
        false
    }

    /// Names of dimensions that it gives besides the segments.
    fn dimensions(&self) -> &'static [&'static str] {
        &[]
    }

    /// Whether it segments at several depths of an octree.
    fn has_levels(&self) -> bool {
        false
    }

    /// Sets a strength or an intent; `None` if the method has no such parameter.
    fn aim(&self, _params: &mut SegmentParams, _aim: Intent) -> Option<()> {
        None
    }

    /// Sets the size of supervoxels or voxels, metres; `None` if the method has no such parameter.
    fn set_size(&self, _params: &mut SegmentParams, _size: f64) -> Option<()> {
        None
    }
}

macro_rules! methods {
    ($($(#[$attribute:meta])* $variant:ident, $name:literal, $title:literal, $method:expr;)*) => {
        /// The method of segmentation.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        pub enum SegmentMethod {
            $(#[doc = $title] $(#[$attribute])* #[serde(rename = $name)] $variant,)*
        }

        impl SegmentMethod {
            /// All methods.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The name as in TOML and on the command line.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// One line about it.
            pub fn title(self) -> &'static str {
                match self { $(Self::$variant => $title,)* }
            }

            pub(super) fn method(self) -> &'static dyn PartitionMethod {
                match self { $(Self::$variant => &$method,)* }
            }
        }
    };
}

methods! {
    #[default]
    CutPursuit, "cut-pursuit", "l0 cut pursuit on the points (Guinard and Landrieu 2017): lower energy",
        OnPoints(Method::CutPursuit);
    Merge, "merge", "The same energy by greedy merging: faster", OnPoints(Method::Merge);
    Felzenszwalb, "felzenszwalb", "Components by the differences within and between them (Felzenszwalb and Huttenlocher 2004)",
        Felzenszwalb;
    Riemannian, "riemannian", "Supervoxels of an octree, their Riemannian graph, l0 cut pursuit (Li 2018)", Riemannian;
    LocalGraph, "local-graph", "Local graphs of supervoxels (Hasanpour Zaryabi et al. 2022)", LocalGraphs;
    Slic, "slic", "SLIC supervoxels on points", Supervoxels(SupervoxelMode::Slic);
    Vccs, "vccs", "VCCS supervoxels on adjacent voxels", Supervoxels(SupervoxelMode::Vccs);
    RegionGrowing, "region-growing", "Region growing on points", RegionGrowing;
    OctreeRegionGrowing, "octree-region-growing", "Octree-based region growing", OctreeRegionGrowing;
    Clusters, "clusters", "Clusters at four levels (Grilli, Poux and Remondino 2021)", Clusters;
}

impl SegmentMethod {
    /// Names of dimensions that the method gives besides the segments.
    pub fn dimensions(self) -> &'static [&'static str] {
        self.method().dimensions()
    }

    /// The names of the methods for which `holds`, for messages.
    pub(super) fn those(holds: impl Fn(&dyn PartitionMethod) -> bool) -> String {
        let names: Vec<&str> = Self::ALL.iter().filter(|m| holds(m.method())).map(|m| m.name()).collect();
        names.join(", ")
    }
}

impl SegmentParams {
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
}
