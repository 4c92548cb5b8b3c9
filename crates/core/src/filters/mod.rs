//! Filters: noise (statistical and radius outliers), classes, heights above ground, areas.

mod apply;
mod area;
mod classes;
mod files;
mod heights;
mod outliers;
mod params;

pub use apply::{Filtered, Step, filter};
pub use area::{Area, ClassArea};
pub use files::{FilterReport, filter_file};
pub use outliers::{OutlierParams, outliers, radius_outliers, statistical_outliers};
pub use params::{FilterParams, HeightRange, RadiusParams, StatisticalParams};
