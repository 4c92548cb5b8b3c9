//! Arguments of the commands that divide a cloud into segments.

use super::choices::segment_methods;
use super::{LabelArgs, ScaleArgs, UnitArgs, examples};
use clap::Args as ClapArgs;
use scansion_core::classes::ClassTable;
use scansion_core::recipes::SegmentMethod;
use std::path::PathBuf;

/// The segmentation method, and the size of its segments.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct SegmentArgs {
    /// Segmentation method [default: cut-pursuit]
    #[arg(long, value_parser = segment_methods())]
    pub(crate) method: Option<SegmentMethod>,
    /// Cost of a boundary edge (cut-pursuit, merge, riemannian): larger gives fewer, larger segments [default: 0.03;
    /// riemannian: 0.1]
    #[arg(long, value_name = "RHO", group = "intent")]
    pub(crate) strength: Option<f64>,
    /// Aim at this many segments per hectare of covered ground (cut-pursuit, merge)
    #[arg(long, value_name = "N", group = "intent")]
    pub(crate) segments_per_hectare: Option<f64>,
    /// Aim at the smallest object that should be a segment of its own, metres (cut-pursuit, merge)
    #[arg(long, value_name = "METRES", group = "intent")]
    pub(crate) smallest_object: Option<f64>,
    /// Aim at the fewest segments whose oracle accuracy on the cloud's labels is lower by at most this, 0..1
    /// (cut-pursuit, merge)
    #[arg(long, value_name = "LOSS", group = "intent")]
    pub(crate) oracle_loss: Option<f64>,
    /// Size of the supervoxels (local-graph, slic, vccs) or of the largest voxels (octree-region-growing) [default: 1.2; 2]
    #[arg(long, value_name = "METRES", group = "intent")]
    pub(crate) size: Option<f64>,
    /// Merge segments of fewer points into their best neighbour (cut-pursuit, merge) [default: 0]
    #[arg(long, value_name = "POINTS")]
    pub(crate) cutoff: Option<f64>,
    /// Smallest neighbourhood of a point (cut-pursuit, merge, felzenszwalb; 20 or more on scans that consist of lines)
    /// [default: 10]
    #[arg(long, value_name = "K")]
    pub(crate) k_min: Option<usize>,
    /// Settings of all methods as TOML, or the name of a method, e.g. riemannian, or riemannian-paper
    /// for it as printed; flags take precedence
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(crate) recipe: Option<PathBuf>,
    /// Change one setting, e.g. objects.vccs.voxel=0.4; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    #[command(flatten)]
    pub(crate) unit: UnitArgs,
    /// Seed of all random draws [default: 0]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
}

/// scansion segment IN -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::SEGMENT)]
pub(crate) struct Segment {
    /// Cloud to divide
    pub(crate) input: PathBuf,
    /// Output: the input with the dimension ClusterID (from 1; 0 = none)
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Also give each segment a colour of its own (points of none are grey), for labelling in a viewer; replaces the
    /// colours of the file
    #[arg(long, visible_alias = "color")]
    pub(crate) colour: bool,
    #[command(flatten)]
    pub(crate) segments: SegmentArgs,
    /// Also divide the cloud at each of these least depths of the octree (riemannian), as dimensions ClusterID_L1,
    /// ClusterID_L2, ...
    #[arg(long, value_name = "DEPTHS", value_delimiter = ',')]
    pub(crate) levels: Vec<u32>,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
}

/// scansion suggest IN -o OUT
#[derive(Debug, ClapArgs)]
#[command(after_help = examples::SUGGEST)]
pub(crate) struct Suggest {
    /// Cloud to examine
    pub(crate) input: PathBuf,
    /// Output: .csv to be filled in, .las, .laz or .ply with ClusterID, .html with two pictures of each segment; may be
    /// repeated
    #[arg(short, long, required = true)]
    pub(crate) output: Vec<PathBuf>,
    /// Number of segments to suggest
    #[arg(short = 'n', long, value_name = "N", default_value_t = 50)]
    pub(crate) count: usize,
    /// Model to improve: its uncertainty is taken into account
    #[arg(short, long)]
    pub(crate) model: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) scale: ScaleArgs,
    /// Labels of earlier rounds, as for train: their segments are left out, and what is unlike them comes first; may be
    /// repeated
    #[arg(long, value_name = "FILE")]
    pub(crate) weak_labels: Vec<PathBuf>,
    /// The same for the labels in the cloud
    #[arg(long, conflicts_with = "weak_labels")]
    pub(crate) labelled: bool,
    /// Classes that the page offers, CODE or CODE=NAME, e.g. 2,5,64=vehicle [default: the model's, else well-known ones]
    #[arg(long, value_name = "CLASSES")]
    pub(crate) offer: Option<ClassTable>,
    #[command(flatten)]
    pub(crate) segments: SegmentArgs,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
}
