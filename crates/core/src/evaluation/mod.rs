//! Evaluation: comparison of a result with reference labels.

mod confusion;
mod one_vs_rest;
mod partition;
pub mod report;
mod scores;
mod segmentation_error;

pub use confusion::Confusion;
pub use one_vs_rest::OneVsRest;
pub use partition::{BoundaryScores, SizeBin, boundary_scores, oracle_accuracy, purities, size_histogram};
pub use scores::{ClassScores, Scores, no_point_to_score};
pub use segmentation_error::{
    ClassEdges, ClassImage, EmptyCells, LabelledPartition, SegmentationError, SegmentationErrorParams, compare_edges,
    segmentation_error,
};
