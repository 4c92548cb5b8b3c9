//! Scansion divides a LiDAR scan into its parts and names every point.
//!
//! The rooms stand in the order of the data's way; a room uses only rooms above it in this list.
//!
//! `Cloud -> Neighbours -> FeatureTable -> Probabilities -> Labelling -> Scores`

#![cfg_attr(test, expect(clippy::float_cmp, reason = "tests compare with values that are exact"))]

pub mod error;

pub mod csr;
pub mod linalg;
pub mod parallel;
pub mod random;

pub mod classes;
pub mod classification;
pub mod cloud;
pub mod evaluation;
pub mod features;
pub mod images;
pub mod io;
pub mod neighbours;
pub mod recipes;

pub use cloud::Cloud;
pub use error::{Error, Result};
