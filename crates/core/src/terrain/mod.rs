//! The lie of the land: what is road, how high a point stands above it, and on which side of its border.

mod alpha_shape;
mod elevation;
mod holes;
mod position;
mod raster;
mod road;

pub use alpha_shape::{AlphaParams, AlphaShape};
pub use elevation::{ElevationModel, ElevationParams};
pub use position::position;
pub use raster::Raster;
pub use road::{is_likely, road_probability};
