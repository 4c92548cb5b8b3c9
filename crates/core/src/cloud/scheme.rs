//! The class list to which the codes of a cloud belong, as far as its source states it, and names of the cloud's own.

use serde::Serialize;
use std::collections::BTreeMap;

/// The list that the codes in the column `Classification` belong to. Set by the reader of a file, or by the user.
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
    /// S3DIS: 0 ceiling to 12 clutter.
    S3dis,
    /// The ids of SemanticKITTI (`.bin` with a `.label` file): 0 means unlabelled, 1 outlier.
    SemanticKitti,
    /// Toronto-3D: 0 means unclassified.
    #[serde(rename = "toronto-3d")]
    Toronto3d,
    /// The ten classes of Paris-Lille-3D: 0 means unclassified.
    #[serde(rename = "paris-lille-3d")]
    ParisLille3d,
}

impl CodeScheme {
    /// All lists.
    pub const ALL: [Self; 7] = [
        Self::Own,
        Self::Asprs,
        Self::Semantic3d,
        Self::S3dis,
        Self::SemanticKitti,
        Self::Toronto3d,
        Self::ParisLille3d,
    ];

    /// Name of the list in programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Asprs => "asprs",
            Self::Semantic3d => "semantic3d",
            Self::S3dis => "s3dis",
            Self::SemanticKitti => "semantickitti",
            Self::Toronto3d => "toronto-3d",
            Self::ParisLille3d => "paris-lille-3d",
        }
    }

    /// The list of that name, in any case.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scheme| scheme.name().eq_ignore_ascii_case(name))
    }

    /// The list to take names for people from: of unknown ones ASPRS is the likeliest.
    pub fn likely(self) -> Self {
        if self == Self::Own { Self::Asprs } else { self }
    }

    /// The codes that mean "unlabelled" in this list.
    pub fn unlabelled(self) -> &'static [u8] {
        match self {
            Self::Own | Self::S3dis => &[],
            Self::Asprs | Self::SemanticKitti => &[0, 1],
            Self::Semantic3d | Self::Toronto3d | Self::ParisLille3d => &[0],
        }
    }
}

/// Name, and if there is one the colour, of a class code.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OwnClass {
    /// Name for people.
    pub name: String,
    /// sRGB colour.
    pub colour: Option<[u8; 3]>,
}

/// Names of codes that take precedence over those of a list: the user's, else those in the file.
pub type ClassNames = BTreeMap<u8, OwnClass>;
