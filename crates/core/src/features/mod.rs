//! Features of points: numbers that describe the geometry around a point, and its own height, colour, intensity and returns.

mod columns;
mod context;
pub mod definition;
mod extractor;
mod normals;
mod optimal;
mod params;
mod profile;
mod pyramid;
mod radius;
mod table;
mod tensor;

pub(crate) use columns::TableRows;
pub(crate) use context::ContextPart;
pub use context::{Context, ContextParams, Rated, RatedPoint};
pub use extractor::extras::colours;
pub use extractor::spacing::{spacing, spacings};
pub use extractor::stream::{FeatureStream, Rows};
pub(crate) use extractor::tiles::Middle;
pub use extractor::tiles::Tiles;
pub use extractor::{Extractor, Scratch, Wanted};
pub(crate) use normals::check_neighbours;
pub use normals::{Normals, normals};
pub use optimal::{OptimalFeatures, local_descriptors, optimal_features, optimal_features_of};
pub use params::{Centre, Column, Divisor, FeatureSet, PyramidParams};
pub use profile::{ProfileParams, Profiles};
pub(crate) use radius::StackedFeatures;
pub use radius::{Quantity, RadiusParams, Shape, SphereParams, Spheres, radius_features};
pub use table::{FeatureTable, table, table_at};
