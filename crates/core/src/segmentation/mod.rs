//! Segmentation: partitions of a cloud into segments.

mod cluster_levels;
mod connected;
mod descriptors;
mod local_graphs;
mod majority;
mod minimal_partition;
mod object_features;
mod octree;
mod oriented_box;
mod partition;
mod region_growing;
mod riemannian;
mod segment_graph;
mod supervoxels;

pub use cluster_levels::{
    Automatic, AutomaticParams, ClusterForm, ClusterInput, ClusterLevels, ClusterParams, HartiganParams, KMeans,
    KMeansStart, NumberRows, automatic_parameters, cluster_levels, hartigan,
};
pub use connected::connected_partition;
pub use descriptors::{SegmentShape, segment_means, segment_shapes};
pub use local_graphs::{Combination, LocalGraphParams, SurfaceRule, local_graphs};
pub use majority::{Majority, majorities, oracle_accuracy};
pub use minimal_partition::{
    Aim, Candidate, ChosenSegments, CutPursuit, CutPursuitParams, CutPursuitSteps, Intent, Merge, MergeParams, Method,
    PartitionInput, PartitionParams, Preset, Signal, StrengthSearch, Trial, cut_pursuit, merge, partition_by_intent,
    recut, search_strength,
};
pub use object_features::{ObjectAttributes, object_features};
pub use octree::{Cube, Leaf, Octree, OctreeParams, StopRule, octree};
pub use oriented_box::OrientedBox;
pub use partition::Partition;
pub use region_growing::{
    GrownRegions, Leftovers, OctreeGrowingParams, Reference, RegionGrowingParams, octree_region_growing, region_growing,
};
pub use riemannian::{
    GraphSizes, KMeansParams, Nearest, NodeWeight, Riemannian, RiemannianGraphParams, RiemannianParams, Scale, Sides,
    StageSeconds, Start, Symmetry, multi_scale, riemannian, riemannian_with_normals,
};
pub use segment_graph::{Interface, segment_graph};
pub use supervoxels::{
    NO_SUPERVOXEL, Normaliser, PointAttributes, SlicParams, SupervoxelLabels, SupervoxelShape, SupervoxelWeights,
    Supervoxels, VccsParams, slic, vccs,
};
