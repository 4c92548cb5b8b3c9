//! The columns that edits set.

use super::known;
use crate::cloud::names;
use crate::error::{Error, Result};
use crate::io::Edit;
use std::collections::HashSet;

/// Fails if two edits set one column; names that are read as the same count as the same.
pub(in crate::io) fn check_distinct(edits: &[Edit]) -> Result<()> {
    let mut seen = HashSet::new();
    match edits.iter().flat_map(columns).find(|name| !seen.insert(known::name(name))) {
        Some(name) => Err(Error::parameter("dimension", name, "a name that no other dimension of the result has")),
        None => Ok(()),
    }
}

/// The columns that an edit sets.
pub(in crate::io) fn columns(edit: &Edit) -> Vec<&str> {
    match edit {
        Edit::Classification(_) => vec![names::CLASSIFICATION],
        Edit::Dimension(column) => vec![&column.name],
        Edit::Colour(_) => names::COLOUR.to_vec(),
        Edit::ClassNames(_) | Edit::OtherClassNames(_) | Edit::Provenance(_) => Vec::new(),
    }
}
