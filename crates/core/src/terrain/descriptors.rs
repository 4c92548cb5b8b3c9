//! The two descriptors that depend on the road: height above it, and position with respect to it (Guinard & Landrieu
//! 2017, section 2.2).

use super::alpha_shape::{AlphaParams, AlphaShape};
use super::elevation::{ElevationModel, ElevationParams};
use super::position::position;
use crate::cloud::{LocalFrame, Points};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Parameters of the two descriptors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TerrainParams {
    /// The elevation model.
    pub elevation: ElevationParams,
    /// The extent of the road.
    pub road: AlphaParams,
}

impl TerrainParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        self.elevation.validate()?;
        self.road.validate()
    }
}

/// The road or ground of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// Whether each point is road (or ground, if there is no road): from [`super::road_points`], or the points of
    /// a class.
    pub road: &'a [bool],
    /// A given elevation model, used instead of one of the road's points.
    pub model: Option<&'a ElevationModel>,
}

/// The two descriptors of every point: the features of [`Group::Terrain`](crate::features::definition::Group).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Terrain {
    /// Height above the ground, metres.
    pub elevation: Vec<f32>,
    /// 0 on the road, 0.5 near its border, 1 away from it.
    pub position: Vec<f32>,
}

/// Height above the ground and position with respect to the road, for every point.
///
/// # Errors
/// As [`ElevationModel::fit`], [`AlphaShape::fit`] and [`position`].
pub fn terrain(points: &Points, ground: &Ground<'_>, params: &TerrainParams, monitor: &Monitor) -> Result<Terrain> {
    params.validate()?;
    let heights = match ground.model {
        Some(model) => model.heights(points, monitor)?,
        None => ElevationModel::fit(points, ground.road, &params.elevation, monitor)?.heights(points, monitor)?,
    };
    let shape = AlphaShape::fit(points, ground.road, &params.road, monitor)?;
    Ok(Terrain { elevation: heights, position: position(points, &shape, params.road.rim, monitor)? })
}

/// Which points of a frame have a class code in `ground`; `codes` has one code for each point of the cloud they come
/// from. O(n · codes of the ground).
///
/// # Errors
/// If a point has no code.
pub fn mask_of_classes<C: Copy + PartialEq>(frame: &LocalFrame, codes: &[C], ground: &[C]) -> Result<Vec<bool>> {
    let known = |&i: &u32| codes.get(i as usize).map(|code| ground.contains(code));
    let mask: Option<Vec<bool>> = frame.index.iter().map(known).collect();
    mask.ok_or_else(|| Error::input(format!("{} class codes for a cloud of more points", codes.len())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::cloud::Raster;

    /// A road 12 m wide and 40 m long, a lawn 2 m lower on both sides, and one point that is not finite.
    fn street() -> (Points, Vec<u8>) {
        let mut rows: Vec<[f64; 3]> = Vec::new();
        let mut codes = Vec::new();
        for i in 0..160 {
            for j in 0..120 {
                let (x, y) = (f64::from(i) * 0.25, f64::from(j) * 0.25);
                let road = (9.0..=21.0).contains(&y);
                rows.push([x, y, if road { 3.0 } else { 1.0 }]);
                codes.push(if road { 11 } else { 3 });
            }
        }
        rows.insert(5, [f64::NAN; 3]);
        codes.insert(5, 0);
        (Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0), codes)
    }

    #[test]
    fn a_street_has_its_heights_and_positions() {
        let (points, codes) = street();
        let road = mask_of_classes(&points.frame, &codes, &[11]).unwrap();
        let ground = Ground { road: &road, model: None };
        let found = terrain(&points, &ground, &TerrainParams::default(), &Monitor::default()).unwrap();
        for (i, &road) in road.iter().enumerate() {
            assert!((found.elevation[i] - if road { 0.0 } else { -2.0 }).abs() < 1e-5);
            let (x, y) = (f64::from(points.positions.x[i]), f64::from(points.positions.y[i]));
            let inwards = (y - 9.0).min(21.0 - y).min(x).min(39.75 - x);
            if inwards.abs() > 1.001 {
                assert_eq!(found.position[i], if inwards > 0.0 { 0.0 } else { 1.0 }, "{x} {y}");
            } else if (0.0..0.999).contains(&inwards) {
                assert_eq!(found.position[i], 0.5, "{x} {y}");
            }
        }
    }

    #[test]
    fn an_elevation_model_of_somebody_else_takes_precedence() {
        let (points, _) = street();
        let raster = Raster::new([0.0; 2], 100.0, 1, vec![-1.0]).unwrap();
        let model = ElevationModel::from_raster(raster, &Monitor::default()).unwrap();
        let ground = Ground { road: &vec![false; points.len()], model: Some(&model) };
        let found = terrain(&points, &ground, &TerrainParams::default(), &Monitor::default()).unwrap();
        assert_eq!((found.elevation[0], found.position[0]), (2.0, 1.0));
        let none = Ground { model: None, ..ground };
        assert!(terrain(&points, &none, &TerrainParams::default(), &Monitor::default()).is_err());
    }

    #[test]
    fn a_mask_needs_a_code_for_every_point() {
        let (points, codes) = street();
        assert!(mask_of_classes(&points.frame, &codes[..100], &[11]).is_err());
    }

    #[test]
    fn parameters_read_as_they_are_written() {
        let text = "[elevation]\ncell = 2.0\n[road]\nalpha = 3.0\n";
        let params: TerrainParams = toml::from_str(text).unwrap();
        assert_eq!((params.elevation.cell, params.elevation.median, params.road.alpha), (2.0, 3, 3.0));
        assert!(toml::from_str::<TerrainParams>("[road]\nbeta = 3.0\n").is_err());
    }
}
