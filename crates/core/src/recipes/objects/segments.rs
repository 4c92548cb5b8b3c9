//! Points to supervoxels, supervoxels to segments (Hasanpour Zaryabi et al. 2022, sections 3.1 to 3.5).

use crate::cloud::{Cloud, Points, names};
use crate::error::{Error, Result};
use crate::features::colours;
use crate::graph::{NormalParams, Orientation};
use crate::parallel::Monitor;
use crate::segmentation::{
    LocalGraphParams, Partition, PointAttributes, SlicParams, Supervoxels, VccsParams, local_graphs, slic, vccs,
};
use serde::{Deserialize, Serialize};

/// The kind of supervoxels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SupervoxelMode {
    /// SLIC on points, as in Hasanpour Zaryabi et al. 2022.
    #[default]
    Slic,
    /// VCCS on adjacent voxels: no supervoxel crosses a gap.
    Vccs,
}

/// Parameters of supervoxels and segments. The defaults suit airborne scans; `docs/objects.md` says which of them
/// are those of Hasanpour Zaryabi et al. 2022.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectSegments {
    /// Number of nearest neighbours for point normals, 2..=32.
    pub neighbours: usize,
    /// Orientation of the normals.
    pub orientation: Orientation,
    /// Use the points' colours; `None` (`"none"` in a recipe): if the cloud has any.
    #[serde(with = "crate::settings::optional")]
    pub colour: Option<bool>,
    /// The kind of supervoxels.
    pub supervoxels: SupervoxelMode,
    /// Parameters of supervoxels on points.
    pub slic: SlicParams,
    /// Parameters of supervoxels on voxels.
    pub vccs: VccsParams,
    /// Parameters of the segmentation by local graphs.
    pub local_graphs: LocalGraphParams,
}

impl Default for ObjectSegments {
    fn default() -> Self {
        Self {
            neighbours: 10,
            orientation: Orientation::Up,
            colour: None,
            supervoxels: SupervoxelMode::default(),
            slic: SlicParams::default(),
            vccs: VccsParams::default(),
            local_graphs: LocalGraphParams::default(),
        }
    }
}

impl ObjectSegments {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if !(2..=32).contains(&self.neighbours) {
            return Err(Error::parameter("neighbours", self.neighbours, "2..=32"));
        }
        self.slic.validate()?;
        self.vccs.validate()?;
        self.local_graphs.validate()
    }

    /// Colours of the points, 0..=1, if they are used.
    ///
    /// # Errors
    /// If they are requested and the cloud has none, or the work was cancelled.
    pub(in crate::recipes) fn colours(
        &self,
        cloud: &Cloud,
        points: &Points,
        monitor: &Monitor,
    ) -> Result<Option<Vec<[f32; 3]>>> {
        let known = names::COLOUR.iter().all(|name| cloud.column(name).is_some());
        match self.colour.unwrap_or(known) {
            true => colours(cloud, &points.frame.index, monitor).map(Some),
            false => Ok(None),
        }
    }

    /// The supervoxels of a cloud.
    ///
    /// # Errors
    /// If a parameter is out of range or the work was cancelled.
    pub(in crate::recipes) fn supervoxels(
        &self,
        points: &Points,
        colours: Option<&[[f32; 3]]>,
        monitor: &Monitor,
    ) -> Result<Supervoxels> {
        self.validate()?;
        let params = NormalParams { neighbours: self.neighbours, orientation: self.orientation.clone() };
        let directions = params.find(points, monitor)?.directions;
        let attributes = PointAttributes { normals: Some(&directions), colours };
        match self.supervoxels {
            SupervoxelMode::Slic => slic(&points.positions, &attributes, &self.slic, monitor),
            SupervoxelMode::Vccs => vccs(&points.positions, &attributes, &self.vccs, monitor),
        }
    }

    /// The segments of a cloud's points; points without a supervoxel are segments by themselves.
    ///
    /// # Errors
    /// As [`ObjectSegments::supervoxels`].
    pub(in crate::recipes) fn partition(
        &self,
        points: &Points,
        colours: Option<&[[f32; 3]]>,
        monitor: &Monitor,
    ) -> Result<Partition> {
        let supervoxels = self.supervoxels(points, colours, monitor)?;
        self.joined(&supervoxels, monitor)
    }

    /// Segments of the points from supervoxels, by local graphs.
    ///
    /// # Errors
    /// If a parameter is out of range or the work was cancelled.
    pub(in crate::recipes) fn joined(&self, supervoxels: &Supervoxels, monitor: &Monitor) -> Result<Partition> {
        supervoxels.point_partition(&local_graphs(supervoxels, &self.local_graphs, monitor)?, monitor)
    }
}
