//! The names of the methods of segmentation.

use serde::{Deserialize, Serialize};

macro_rules! names {
    ($($(#[$attribute:meta])* $variant:ident, $name:literal, $title:literal;)*) => {
        /// The method of segmentation.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        pub enum SegmentMethod {
            $(#[doc = $title] $(#[$attribute])* #[serde(rename = $name)] $variant,)*
        }

        impl SegmentMethod {
            /// All methods.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The name as in TOML and on the command line.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// One line about it.
            pub fn title(self) -> &'static str {
                match self { $(Self::$variant => $title,)* }
            }
        }
    };
}

names! {
    #[default]
    CutPursuit, "cut-pursuit", "l0 cut pursuit on the points (Guinard and Landrieu 2017): lower energy";
    Merge, "merge", "The same energy by greedy merging: faster";
    Felzenszwalb, "felzenszwalb", "Components by the differences within and between them (Felzenszwalb and Huttenlocher 2004)";
    Riemannian, "riemannian", "Supervoxels of an octree, their Riemannian graph, l0 cut pursuit (Li 2018)";
    LocalGraph, "local-graph", "Local graphs of supervoxels (Hasanpour Zaryabi et al. 2022)";
    Slic, "slic", "SLIC supervoxels on points";
    Vccs, "vccs", "VCCS supervoxels on adjacent voxels";
    RegionGrowing, "region-growing", "Region growing on points";
    OctreeRegionGrowing, "octree-region-growing", "Octree-based region growing";
    Clusters, "clusters", "Clusters at four levels (Grilli, Poux and Remondino 2021)";
}
