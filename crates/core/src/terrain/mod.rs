//! Terrain: road and ground points, elevation model, height above ground, position with respect to the road;
//! terrain and surface models, height contours, outlines of buildings.

mod above_ground;
mod alpha_shape;
mod descriptors;
mod elevation;
mod ground_filter;
mod holes;
mod membrane;
mod position;
mod products;
mod road;
mod sites;
mod smooth;

pub use above_ground::{HeightParams, PointAboveGround, filtered_heights, heights_above, points_above_ground};
pub use alpha_shape::{AlphaParams, AlphaShape};
pub use descriptors::{Ground, Terrain, TerrainParams, mask_of_classes, terrain};
pub use elevation::{ElevationModel, ElevationParams};
pub use ground_filter::{GroundMethod, GroundParams, ground_points};
pub use position::position;
pub use products::terrain_model;
pub use products::{Footprint, FootprintParams, GroundChoice, Isoline, IsolineParams, ProductParams, Survey};
pub use products::{footprints, heights_above_ground, isolines, noise_classes, normalised, outlines, surface_model};
pub use road::{RoadExample, road_points};
pub use smooth::fill_holes;
