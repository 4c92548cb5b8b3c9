//! What belongs together: partitions of a cloud into segments.

mod by_intent;
mod connected;
mod cut_pursuit;
mod cutoff;
mod descriptors;
mod majority;
mod merge;
mod partition;
mod refine;
mod regions;
mod segment_graph;
mod signal;
mod supervoxels;

pub use by_intent::{
    Aim, Candidate, Intent, Method, PartitionParams, Scene, Search, Trial, partition_by_intent, search_strength,
};
pub use connected::connected_partition;
pub use cut_pursuit::{CutPursuit, CutPursuitParams, Preset, cut_pursuit};
pub use descriptors::{OrientedBox, SegmentShape, segment_means, segment_shapes};
pub use majority::{Majority, majorities, oracle_accuracy};
pub use merge::{Merge, MergeParams, merge};
pub use partition::Partition;
pub use segment_graph::{Interface, segment_graph};
pub use signal::Signal;
pub use supervoxels::{
    NO_SUPERVOXEL, Normaliser, PointAttributes, SlicParams, SupervoxelShape, SupervoxelWeights, Supervoxels,
    VccsParams, slic, vccs,
};
