//! Parameters of segmentation: a method, and the parameters of each method.

use super::SegmentMethod;
use crate::error::{Error, Result};
use crate::graph::{FelzenszwalbParams, KnnGraphParams};
use crate::neighbours::OptimalParams;
use crate::recipes::objects::ObjectSegments;
use crate::segmentation::{
    ClusterParams, CutPursuitSteps, Intent, Leftovers, LocalGraphParams, OctreeGrowingParams, PartitionParams,
    RegionGrowingParams, RiemannianParams, SlicParams,
};
use crate::settings::changes::{explained, with_defaults, with_keys};
use serde::{Deserialize, Serialize};

/// Parameters that both kinds of region growing share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GrowingParams {
    /// Number of nearest neighbours for region growing and for normals, 2..=32.
    pub neighbours: usize,
    /// Treatment of points without a region.
    pub leftovers: Leftovers,
}

impl Default for GrowingParams {
    fn default() -> Self {
        Self { neighbours: 15, leftovers: Leftovers::default() }
    }
}

/// Parameters of [`segment`](super::segment()), saved as a recipe of their own. Each method has its own defaults,
/// except that the strength of cut pursuit and merging is 0.03, which suits airborne scans too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentParams {
    /// The method; only the sections of this method are used.
    pub method: SegmentMethod,
    /// `riemannian`: segment the cloud at each of these least depths of the octree too.
    pub levels: Vec<u32>,
    /// `cut-pursuit`, `merge`, `felzenszwalb`: number of nearest neighbours that each point is connected to, at least 1. The boundary
    /// scores of every method use this graph.
    pub neighbours: usize,
    /// Neighbourhoods of the four descriptors that are nearly constant on a segment.
    pub neighbourhood: OptimalParams,
    /// Weights of these edges.
    pub adjacency: KnnGraphParams,
    /// The partition: a strength, or an intent. Its `method` is that of [`SegmentParams::method`].
    pub partition: PartitionParams,
    /// `felzenszwalb`: k, in units of the distance between descriptors; larger values give larger segments.
    pub felzenszwalb: FelzenszwalbParams,
    /// `riemannian`.
    pub riemannian: RiemannianParams,
    /// `local-graph`, `slic`, `vccs`.
    pub objects: ObjectSegments,
    /// `region-growing`, `octree-region-growing`.
    pub growing: GrowingParams,
    /// `region-growing`.
    pub region_growing: RegionGrowingParams,
    /// `octree-region-growing`.
    pub octree_region_growing: OctreeGrowingParams,
    /// `clusters`.
    pub clusters: ClusterParams,
}

impl Default for SegmentParams {
    fn default() -> Self {
        Self {
            method: SegmentMethod::default(),
            levels: Vec::new(),
            neighbours: 10,
            neighbourhood: OptimalParams::default(),
            adjacency: KnnGraphParams::default(),
            partition: PartitionParams { intent: Intent::Strength(0.03), ..PartitionParams::default() },
            felzenszwalb: FelzenszwalbParams::default(),
            riemannian: RiemannianParams::default(),
            objects: ObjectSegments::default(),
            growing: GrowingParams::default(),
            region_growing: RegionGrowingParams::default(),
            octree_region_growing: OctreeGrowingParams::default(),
            clusters: ClusterParams::default(),
        }
    }
}

impl SegmentParams {
    /// The method of that name with its defaults, or, with `-paper` behind its name, as in its paper; `None` if there is no
    /// such method.
    pub fn named(name: &str) -> Option<Self> {
        let (plain, paper) = name.strip_suffix("-paper").map_or((name, false), |plain| (plain, true));
        let method = SegmentMethod::ALL.iter().copied().find(|method| method.name() == plain)?;
        let params = Self { method, ..Self::default() };
        if !paper {
            return Some(params);
        }
        match method {
            SegmentMethod::CutPursuit => {
                let partition = PartitionParams { cut_pursuit: CutPursuitSteps::paper(), ..params.partition };
                Some(Self { partition, ..params })
            }
            SegmentMethod::Riemannian => Some(Self { riemannian: RiemannianParams::paper(), ..params }),
            SegmentMethod::LocalGraph | SegmentMethod::Slic => {
                let local_graphs = LocalGraphParams::paper();
                let objects = ObjectSegments { slic: SlicParams::paper(), local_graphs, ..params.objects };
                Some(Self { objects, ..params })
            }
            _ => None,
        }
    }

    /// Reads TOML; values not given are the defaults, in each section too. The message about a wrong key gives its line
    /// and the nearest valid key.
    ///
    /// # Errors
    /// If the text is not TOML, or a key or value is unknown.
    pub fn from_toml(text: &str) -> Result<Self> {
        with_defaults(text, &Self::default())
    }

    /// The parameters as TOML, with all values written out.
    ///
    /// # Errors
    /// Never for values that pass [`SegmentParams::validate`].
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::input(format!("settings cannot be written as TOML: {e}")))
    }

    /// Applies `section.key=value` settings, each value read as TOML (a bare word counts as text).
    ///
    /// # Errors
    /// As [`SegmentParams::from_toml`].
    pub fn with_settings<'a>(&self, settings: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let table: toml::Table = self.to_toml()?.parse().map_err(|e| Error::input(format!("settings: {e}")))?;
        with_keys(&table, settings, |table| explained(&table.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segmentation::StopRule;

    #[test]
    fn settings_survive_toml_and_reach_the_method() {
        let params = SegmentParams { method: SegmentMethod::Vccs, ..SegmentParams::default() };
        assert_eq!(SegmentParams::from_toml(&params.to_toml().unwrap()).unwrap(), params);
        let other = params.with_settings(["objects.vccs.size=2", "method=slic"]).unwrap();
        assert_eq!((other.objects.vccs.size, other.method), (2.0, SegmentMethod::Slic));
        let rule = params.with_settings(["riemannian.octree.stop.absolute=0.5"]).unwrap();
        assert_eq!(rule.riemannian.octree.stop, StopRule::Absolute(0.5));
        let aim = params.with_settings(["partition.intent.smallest-object=0.5", "partition.cutoff=3"]).unwrap();
        assert_eq!((aim.partition.intent, aim.partition.cutoff), (Intent::SmallestObject(0.5), 3.0));
        // A section that is written in part keeps the strength of this command, 0.03.
        let written = SegmentParams::from_toml("[partition]\ncutoff = 3.0\n").unwrap();
        assert_eq!((written.partition.intent, written.partition.cutoff), (Intent::Strength(0.03), 3.0));
        let message = params.with_settings(["objects.vccs.syze=2"]).unwrap_err().to_string();
        assert!(message.contains("syze") && message.contains("did you mean `size`"), "{message}");
    }

    #[test]
    fn every_method_goes_by_its_name() {
        for &method in SegmentMethod::ALL {
            let text = format!("method = \"{}\"", method.name());
            assert_eq!(SegmentParams::from_toml(&text).unwrap().method, method);
            assert_eq!(SegmentParams::named(method.name()).unwrap().method, method);
        }
        assert!(SegmentParams::named("bricks").is_none() && SegmentParams::named("merge-paper").is_none());
        let paper = |name: &str| SegmentParams::named(name).unwrap();
        assert_eq!(paper("riemannian-paper").riemannian, RiemannianParams::paper());
        assert_eq!(paper("cut-pursuit-paper").partition.cut_pursuit, CutPursuitSteps::paper());
        assert_eq!(paper("local-graph-paper").objects.local_graphs, LocalGraphParams::paper());
        for name in ["riemannian-paper", "cut-pursuit-paper", "local-graph-paper", "slic-paper"] {
            paper(name).validate().unwrap();
            assert_eq!(SegmentParams::from_toml(&paper(name).to_toml().unwrap()).unwrap(), paper(name));
        }
    }

    #[test]
    fn a_size_scales_the_voxels_and_needs_a_method_that_has_one() {
        let params = SegmentParams { method: SegmentMethod::Vccs, ..SegmentParams::default() };
        let larger = params.with_size(2.4).unwrap().objects;
        assert_eq!((larger.slic.size, larger.vccs.size, larger.vccs.voxel), (2.4, 2.4, 0.6));
        assert!(SegmentParams::default().with_size(1.0).is_err());
        let levels = SegmentParams { levels: vec![4], ..SegmentParams::default() };
        assert!(levels.validate().is_err());
    }
}
