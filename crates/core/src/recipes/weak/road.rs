//! The road, and the two descriptors that depend on it (Guinard & Landrieu 2017, section 2.2).

use super::examples::Example;
use crate::classification::ForestParams;
use crate::cloud::{Cloud, Points, Positions, names};
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::terrain::{
    ElevationModel, Ground, RoadExample, Terrain, TerrainParams, mask_of_classes, road_points, terrain,
};
use crate::voxels::cells::{Cells, cell_of};
use serde::{Deserialize, Serialize};

/// Source of the road points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RoadSource {
    /// A forest trained on the labels; the lowest points if the labels do not have both road and other classes.
    #[default]
    Learned,
    /// The points of the cloud whose `Classification` is one of `codes`.
    Classification,
    /// The lowest points of every square of `lowest_cell`.
    Lowest,
}

/// Parameters of the road and its descriptors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RoadParams {
    /// Source of the road points.
    pub source: RoadSource,
    /// Classes that count as road.
    pub codes: Vec<u8>,
    /// Elevation model and extent of the road.
    pub terrain: TerrainParams,
    /// Largest number of examples of road, and of other classes, that a model stores.
    pub most: usize,
    /// Edge, metres, of the squares whose lowest points replace an unknown road.
    pub lowest_cell: f64,
    /// Points within this height of the lowest one of their square are used, metres.
    pub lowest_within: f64,
}

impl Default for RoadParams {
    fn default() -> Self {
        Self {
            source: RoadSource::Learned,
            codes: vec![2, 11],
            terrain: TerrainParams::default(),
            most: 500,
            lowest_cell: 2.0,
            lowest_within: 0.2,
        }
    }
}

impl RoadParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if self.most == 0 {
            return Err(Error::parameter("road.most", 0, "1 or more"));
        }
        if !(self.lowest_cell > 0.0 && self.lowest_cell.is_finite()) {
            return Err(Error::parameter("road.lowest_cell", self.lowest_cell, "metres, above 0"));
        }
        if self.lowest_within.is_nan() || self.lowest_within < 0.0 {
            return Err(Error::parameter("road.lowest_within", self.lowest_within, "metres, 0 or more"));
        }
        self.terrain.validate()
    }

    /// Labelled points of road and of other classes, at most `most` of each, spread evenly over them.
    pub(super) fn learn(&self, examples: &[Example], local: &FeatureTable) -> Vec<RoadExample> {
        let mut learned = Vec::new();
        for road in [true, false] {
            let of: Vec<&Example> = examples.iter().filter(|e| self.codes.contains(&e.code) == road).collect();
            let step = of.len().div_ceil(self.most).max(1);
            for example in of.into_iter().step_by(step) {
                let row = local.row(example.point as usize).first_chunk();
                learned.extend(row.map(|&descriptors| RoadExample { descriptors, road }));
            }
        }
        learned
    }

    /// Height above the road and position with respect to it.
    pub(super) fn describe(&self, scene: &RoadScene<'_>, monitor: &Monitor) -> Result<DescribedRoad> {
        let mut unknown = self.unknown(scene.examples);
        let mut road = if unknown.is_some() { Vec::new() } else { self.mask(scene, monitor)? };
        if !road.contains(&true) {
            road = self.lowest(&scene.points.positions, monitor)?;
            unknown = unknown.or_else(|| self.absent());
        }
        let ground = Ground { road: &road, model: scene.elevation };
        let terrain = terrain(scene.points, &ground, &self.terrain, monitor)?;
        let warning = unknown.map(|why| format!("{why}: the lowest points stand in for the road"));
        Ok(DescribedRoad { terrain, warning })
    }

    /// Why the labels do not tell road from other points, if so and if they should.
    fn unknown(&self, examples: &[RoadExample]) -> Option<String> {
        let has = |road: bool| examples.iter().any(|e| e.road == road);
        match (self.source, has(true), has(false)) {
            (RoadSource::Learned, false, _) => Some(format!("no label is road (road.codes {:?})", self.codes)),
            (RoadSource::Learned, true, false) => Some(format!("every label is road (road.codes {:?})", self.codes)),
            _ => None,
        }
    }

    /// What is said of a cloud in which no point is road.
    fn absent(&self) -> Option<String> {
        match self.source {
            RoadSource::Learned => Some("no point is like the labels of road".into()),
            RoadSource::Classification => Some(format!("no point has a class of road (road.codes {:?})", self.codes)),
            RoadSource::Lowest => None,
        }
    }

    /// Whether each point is road by the source.
    fn mask(&self, scene: &RoadScene<'_>, monitor: &Monitor) -> Result<Vec<bool>> {
        match self.source {
            RoadSource::Classification => {
                let column = scene.cloud.column(names::CLASSIFICATION).ok_or_else(|| {
                    Error::input("road.source is classification, but the cloud has no Classification")
                })?;
                let codes: Vec<u16> = (0..scene.cloud.len()).map(|i| column.values.get(i) as u16).collect();
                let road: Vec<u16> = self.codes.iter().map(|&c| u16::from(c)).collect();
                mask_of_classes(&scene.points.frame, &codes, &road)
            }
            RoadSource::Learned => road_points(scene.local, scene.examples, scene.forest, monitor),
            RoadSource::Lowest => self.lowest(&scene.points.positions, monitor),
        }
    }

    /// Points near the lowest one of their square.
    fn lowest(&self, points: &Positions, monitor: &Monitor) -> Result<Vec<bool>> {
        let edge = self.lowest_cell as f32;
        let square = |i: usize| cell_of([points.x[i] / edge, points.y[i] / edge].map(f64::from));
        let squares = Cells::new(points.len(), square, monitor)?;
        let mut mask = vec![false; points.len()];
        for members in (0..squares.len()).map(|square| squares.of(square)) {
            let z = |&i: &u32| points.z[i as usize];
            let low = members.iter().map(z).fold(f32::INFINITY, f32::min);
            let near = low + self.lowest_within as f32;
            members.iter().filter(|i| z(i) <= near).for_each(|&i| mask[i as usize] = true);
        }
        Ok(mask)
    }
}

/// The descriptors that depend on the road.
pub(super) struct DescribedRoad {
    /// Height above it and position with respect to it.
    pub(super) terrain: Terrain,
    /// The warning that the lowest points stand in for a road that was not found, and why.
    pub(super) warning: Option<String>,
}

/// A cloud in which the road is searched.
pub(super) struct RoadScene<'a> {
    pub(super) cloud: &'a Cloud,
    pub(super) points: &'a Points,
    /// The four local descriptors of the points.
    pub(super) local: &'a FeatureTable,
    /// Labelled points of road and of other classes.
    pub(super) examples: &'a [RoadExample],
    /// Parameters of the forest that tells road from other classes.
    pub(super) forest: &'a ForestParams,
    /// Ground heights to use instead of those of the road points.
    pub(super) elevation: Option<&'a ElevationModel>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};

    #[test]
    fn the_lowest_points_of_a_cell_are_ground() {
        let rows = [[0.5, 0.5, 0.0], [1.0, 1.0, 0.1], [1.5, 0.5, 3.0], [2.5, 0.5, 3.0]];
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let lowest = RoadParams::default().lowest(&points.positions, &Monitor::default()).unwrap();
        assert_eq!(lowest, [true, true, false, true]);
    }

    /// The warning about a flat cloud without a road, whose points all have the descriptors 0.
    fn warning(params: &RoadParams, examples: &[RoadExample]) -> Option<String> {
        let rows: Vec<[f64; 3]> = (0..100).map(|i| [f64::from(i % 10), f64::from(i / 10), 0.0]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud.set_column(Column::new(names::CLASSIFICATION, Values::U8(vec![6; 100]))).unwrap();
        let points = Points::from_cloud(&cloud, 1.0);
        let local = FeatureTable { names: ["l", "p", "s", "v"].map(String::from).into(), values: vec![0.0; 400] };
        let forest = ForestParams { trees: 5, ..ForestParams::breiman() };
        let scene =
            RoadScene { cloud: &cloud, points: &points, local: &local, examples, forest: &forest, elevation: None };
        let DescribedRoad { terrain, warning } = params.describe(&scene, &Monitor::default()).unwrap();
        assert!(terrain.elevation.len() == 100 && terrain.elevation.iter().all(|height| height.abs() < 1e-3));
        warning
    }

    #[test]
    fn a_warning_tells_why_the_lowest_points_stand_in_for_the_road() {
        let example = |road: bool, value: f32| RoadExample { descriptors: [value; 4], road };
        let far = [vec![example(true, 1.0); 6], vec![example(false, 0.0); 60]].concat();
        let learned = RoadParams::default();
        for (examples, why) in [
            (vec![], "no label is road (road.codes [2, 11])"),
            (vec![example(false, 0.0)], "no label is road (road.codes [2, 11])"),
            (vec![example(true, 1.0)], "every label is road (road.codes [2, 11])"),
            (far, "no point is like the labels of road"),
        ] {
            let text = format!("{why}: the lowest points stand in for the road");
            assert_eq!(warning(&learned, &examples), Some(text));
        }
        let classes = RoadParams { source: RoadSource::Classification, ..RoadParams::default() };
        assert!(warning(&classes, &[]).unwrap().starts_with("no point has a class of road (road.codes [2, 11])"));
        // Nothing is missing where the lowest points were asked for, or road is found.
        assert_eq!(warning(&RoadParams { source: RoadSource::Lowest, ..RoadParams::default() }, &[]), None);
        let six = RoadParams { codes: vec![6], ..classes };
        assert_eq!(warning(&six, &[]), None);
        let like = [vec![example(true, 0.0); 60], vec![example(false, 1.0); 6]].concat();
        assert_eq!(warning(&learned, &like), None);
    }
}
