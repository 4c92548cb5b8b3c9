//! The list that the class codes of a cloud belong to, as far as its source tells.

use serde::Serialize;

/// The list that the codes in the column `Classification` belong to. Set by the reader of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CodeScheme {
    /// Unknown: every code is a class (PLY, PCD, E57, npz, text, clouds made in memory).
    #[default]
    Own,
    /// The ASPRS list (LAS, LAZ): 0 means never classified, 1 unclassified.
    Asprs,
    /// The Semantic3D list (text with a `.labels` file): 0 means unlabelled.
    Semantic3d,
}

impl CodeScheme {
    /// All lists.
    pub const ALL: [Self; 3] = [Self::Own, Self::Asprs, Self::Semantic3d];

    /// Name of the list in programs.
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
