//! Which list the class codes of a cloud are of, as far as its source tells.

use serde::Serialize;

/// The list that the codes of the column `Classification` are of. The reader of a file sets it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CodeScheme {
    /// Not known: every code is a class (PLY, PCD, E57, npz, text, clouds made in memory).
    #[default]
    Own,
    /// The list of ASPRS (LAS, LAZ): 0 is never classified, 1 unclassified.
    Asprs,
    /// The classes of Semantic3D (text with `.labels` beside it): 0 is unlabelled.
    Semantic3d,
}

impl CodeScheme {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Own, Self::Asprs, Self::Semantic3d];

    /// Its name in programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Asprs => "asprs",
            Self::Semantic3d => "semantic3d",
        }
    }

    /// The codes that mean "unlabelled" in this list.
    pub fn unlabelled(self) -> &'static [u8] {
        match self {
            Self::Own => &[],
            Self::Asprs => &[0, 1],
            Self::Semantic3d => &[0],
        }
    }
}
