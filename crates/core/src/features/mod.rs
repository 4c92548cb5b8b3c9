//! Features of points: numbers that describe the geometry around a point, and its own colour, intensity and returns.

mod contour;
pub mod definition;
mod extractor;
mod extras;
mod normals;
mod optimal;
mod params;
mod pyramid;
mod region;
mod slots;
mod spacing;
mod stream;
mod surfaces;
mod table;
mod tensor;
mod tiles;

pub use extractor::{Extractor, Scratch, Wanted};
pub use extras::colours;
pub use normals::{Normals, normals};
pub use optimal::{OptimalFeatures, local_descriptors, optimal_features, optimal_features_of};
pub use params::{Centre, Column, Divisor, FeatureSet, PyramidParams};
pub use spacing::spacing;
pub use stream::{FeatureStream, Rows};
pub use table::{FeatureTable, table, table_at};
pub use tiles::Tiles;
