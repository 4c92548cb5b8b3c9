//! The model that ships inside: ground, vegetation and building in airborne scans.

use crate::classification::Model;
use crate::error::Result;
use std::path::Path;

/// How the classes of a labelled scan map to those of the built-in model: all vegetation is 5.
pub const BUILTIN_MAP: &str = "3-4=5";

const BYTES: &[u8] = include_bytes!("../../assets/default.model");

/// The built-in model for airborne scans (ASPRS codes 2 ground, 5 vegetation, 6 building).
///
/// It was trained by `scripts/default-model` on the clouds named there; `docs/default-model.md` tells how accurate it is
/// on scenes that it has not seen.
pub fn default_model() -> Result<Model> {
    Model::from_bytes(BYTES, Path::new("built-in model"))
}
