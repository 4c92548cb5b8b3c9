//! The road, and the two descriptors that depend on it (Guinard & Landrieu 2017, section 2.2).

use super::examples::Example;
use crate::classification::{ClassWeight, Forest, ForestParams, Samples};
use crate::cloud::{Cloud, Points, names};
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use crate::terrain::{ElevationModel, Ground, Terrain, TerrainParams, mask_of_classes, read_ascii_grid, terrain};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Largest number of examples of road, and of other classes, that a model stores.
const MOST: usize = 500;

/// Points within this height of the lowest point of their cell count as ground if the road is unknown, metres.
const NEAR_LOWEST: f32 = 0.2;

/// Edge of these cells, metres.
const CELL: f32 = 2.0;

/// Source of the road points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RoadSource {
    /// The ground class of the cloud if it has one besides the labels in use, else a forest trained on the labels; the
    /// lowest points if no label is road.
    #[default]
    Learned,
    /// The points of the cloud whose `Classification` is one of `codes`.
    Classification,
    /// The lowest points of every 2 m square.
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
    /// An ESRI ASCII grid of ground heights, used for the elevation instead of the road points.
    pub elevation_model: Option<PathBuf>,
    /// Elevation model and extent of the road.
    pub terrain: TerrainParams,
    /// Set by training: linearity, planarity, scattering, verticality of labelled points, and whether each is road. A
    /// model finds the road in other clouds by a forest trained on these.
    pub examples: Vec<([f32; 4], bool)>,
}

impl Default for RoadParams {
    fn default() -> Self {
        Self {
            source: RoadSource::Learned,
            codes: vec![2, 11],
            elevation_model: None,
            terrain: TerrainParams::default(),
            examples: Vec::new(),
        }
    }
}

impl RoadParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if let Some((row, _)) = self.examples.iter().find(|(row, _)| row.iter().any(|v| !v.is_finite())) {
            return Err(Error::parameter("road.examples", format!("{row:?}"), "finite numbers"));
        }
        self.terrain.validate()
    }

    /// Stores labelled points of road and of other classes, at most [`MOST`] of each, spread evenly over them.
    pub(super) fn learn(&mut self, examples: &[Example], local: &FeatureTable) {
        self.examples.clear();
        for road in [true, false] {
            let of: Vec<&Example> = examples.iter().filter(|e| self.codes.contains(&e.code) == road).collect();
            let step = of.len().div_ceil(MOST).max(1);
            for example in of.into_iter().step_by(step) {
                let row = local.row(example.point as usize);
                self.examples.push(([row[0], row[1], row[2], row[3]], road));
            }
        }
    }

    /// Height above the road and position with respect to it.
    pub(super) fn describe(
        &self,
        (cloud, points): (&Cloud, &Points),
        local: &FeatureTable,
        forest: &ForestParams,
        monitor: &Monitor,
    ) -> Result<Terrain> {
        let mut road = self.mask(cloud, points, local, forest, monitor)?;
        if !road.contains(&true) {
            road = lowest(points);
        }
        let model = self.elevation_model.as_deref().map(read_ascii_grid).transpose()?;
        let model = model.map(|raster| ElevationModel::from_raster(raster, monitor)).transpose()?;
        terrain(points, &Ground { road: &road, model: model.as_ref() }, &self.terrain, monitor)
    }

    fn mask(
        &self,
        cloud: &Cloud,
        points: &Points,
        local: &FeatureTable,
        forest: &ForestParams,
        monitor: &Monitor,
    ) -> Result<Vec<bool>> {
        let both = [true, false].iter().all(|side| self.examples.iter().any(|(_, road)| road == side));
        match self.source {
            RoadSource::Classification => {
                let column = cloud.column(names::CLASSIFICATION).ok_or_else(|| {
                    Error::input("road.source is classification, but the cloud has no Classification")
                })?;
                let codes: Vec<u16> = (0..cloud.len()).map(|i| column.values.get(i) as u16).collect();
                mask_of_classes(points, &codes, &self.codes.iter().map(|&c| u16::from(c)).collect::<Vec<_>>())
            }
            RoadSource::Learned if both => learned(&self.examples, local, forest, monitor),
            _ => Ok(lowest(points)),
        }
    }
}

/// Points that a forest trained on these examples considers at least as likely road as not: those of
/// [`is_likely`](crate::terrain::is_likely), but without evaluating the remaining trees once half of them agree.
fn learned(
    examples: &[([f32; 4], bool)],
    local: &FeatureTable,
    forest: &ForestParams,
    monitor: &Monitor,
) -> Result<Vec<bool>> {
    let rows: Vec<f32> = examples.iter().flat_map(|(row, _)| *row).collect();
    // Road is the first class, so that it wins ties.
    let labels: Vec<u16> = examples.iter().map(|(_, road)| u16::from(!road)).collect();
    let samples = Samples { features: &rows, width: local.width(), labels: &labels, weights: None, classes: 2 };
    let mut params = forest.clone();
    if let ClassWeight::PerClass(weights) = &mut params.class_weight {
        weights.reverse();
    }
    let forest = Forest::fit(&samples, &params, monitor)?;
    monitor.check()?;
    Ok(forest.predict(&local.values)?.into_iter().map(|class| class == 0).collect())
}

/// Points near the lowest one of their cell.
fn lowest(points: &Points) -> Vec<bool> {
    let cell = |i: usize| ((points.x[i] / CELL) as i32, (points.y[i] / CELL) as i32);
    let mut order: Vec<((i32, i32), u32)> = (0..points.len()).map(|i| (cell(i), i as u32)).collect();
    order.sort_unstable();
    let mut mask = vec![false; points.len()];
    for group in order.chunk_by(|a, b| a.0 == b.0) {
        let z = |&(_, i): &((i32, i32), u32)| points.z[i as usize];
        let low = group.iter().map(z).fold(f32::INFINITY, f32::min);
        group.iter().filter(|p| z(p) <= low + NEAR_LOWEST).for_each(|&(_, i)| mask[i as usize] = true);
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use crate::terrain::{is_likely, road_probability};

    #[test]
    fn the_learned_road_is_that_of_the_probabilities() {
        let mut random = stream(11, 0);
        let mut row = || [0; 4].map(|_| (random.uniform() * 20.0).round() as f32 / 20.0);
        // Coarse values: equal rows of both classes give impure leaves, and ties.
        let examples: Vec<([f32; 4], bool)> = (0..300).map(|i| (row(), i % 3 == 0)).collect();
        let values: Vec<f32> = (0..3000).flat_map(|_| row()).collect();
        let names = || ["a", "b", "c", "d"].map(str::to_string).to_vec();
        for trees in [1, 2, 10, 100] {
            let params = ForestParams { trees, max_depth: (trees == 10).then_some(3), ..ForestParams::breiman() };
            let local = FeatureTable { names: names(), values: values.clone() };
            let found = learned(&examples, &local, &params, &Monitor::default()).unwrap();
            let all = examples.iter().flat_map(|(row, _)| *row).chain(values.iter().copied()).collect();
            let all = FeatureTable { names: names(), values: all };
            let own: Vec<(u32, bool)> = examples.iter().zip(0..).map(|((_, road), row)| (row, *road)).collect();
            let expected = road_probability(&all, &own, &params, &Monitor::default()).unwrap();
            assert_eq!(found, is_likely(&expected[300..]), "{trees} trees");
            assert!(found.contains(&true) && found.contains(&false));
        }
    }

    #[test]
    fn the_lowest_points_of_a_cell_are_ground() {
        let rows = [[0.5, 0.5, 0.0], [1.0, 1.0, 0.1], [1.5, 0.5, 3.0], [2.5, 0.5, 3.0]];
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        assert_eq!(lowest(&points), [true, true, false, true]);
    }
}
