//! Products of a survey: terrain model, surface model, normalised surface, heights above ground, height contours, outlines
//! of buildings.

mod footprints;
mod isolines;
mod params;
mod polygons;
mod simplify;
mod surfaces;
mod survey;
#[cfg(test)]
mod tests;
mod triangulated;

pub use footprints::{Footprint, FootprintParams, footprints, outlines};
pub use isolines::{Isoline, IsolineParams, isolines};
pub use params::{GroundChoice, ProductParams};
pub use surfaces::{heights_above_ground, normalised, surface_model, terrain_model};
pub use survey::{Survey, noise_classes};
