//! The built-in model: ground, vegetation and building in airborne scans.

use super::model::Model;
use crate::error::Result;
use std::path::Path;

/// Mapping of the classes of a labelled scan to those of the built-in model: all vegetation is 5.
pub const BUILTIN_MAP: &str = "3-4=5";

const BYTES: &[u8] = include_bytes!("../../assets/default.model");

/// The built-in model for airborne scans (ASPRS codes 2 ground, 5 vegetation, 6 building).
///
/// It was trained by `scripts/default-model` on the clouds listed there; `docs/default-model.md` reports its accuracy
/// on scenes not used for training.
///
/// # Errors
/// Never: the embedded file is valid.
pub fn default_model() -> Result<Model> {
    Model::from_bytes(BYTES, Path::new("built-in model"))
}
