//! Scansion classifies LiDAR point clouds: it divides a scan into segments and assigns a class to every point.
//!
//! The modules follow the flow of the data; each uses only modules that come before it in this list.
//!
//! `Cloud -> Neighbours -> FeatureTable -> Probabilities -> Labelling -> Scores`
//!
//! ```
//! use scansion_core::{io, parallel::Monitor, recipes};
//!
//! # fn main() -> scansion_core::Result<()> {
//! # let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../cli/assets/demo.laz"));
//! let cloud = io::read(path)?;
//! let model = recipes::default_model()?;
//! let named = recipes::classify(&cloud, &model, &Default::default(), &Monitor::default())?;
//! assert_eq!(named.codes.len(), cloud.len());
//! # Ok(())
//! # }
//! ```

#![cfg_attr(test, expect(clippy::float_cmp, reason = "tests compare with values that are exact"))]

pub mod error;

mod settings;

pub mod memory;

pub mod random;

pub mod linalg;

pub mod parallel;

pub mod csr;

pub mod cloud;

pub mod voxels;

pub mod io;

pub mod classes;

pub mod neighbours;

pub mod features;

pub mod graph;

pub mod segmentation;

pub mod nn;

pub mod classification;

pub mod regularisation;

pub mod contours;

pub mod synthetic;

pub mod terrain;

pub mod filters;

pub mod evaluation;

pub mod images;

pub mod recipes;

pub use cloud::Cloud;
pub use error::{Error, Result};
