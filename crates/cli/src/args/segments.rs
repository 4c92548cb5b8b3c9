//! Arguments of the commands that part a cloud.

use super::LabelArgs;
use clap::{Args as ClapArgs, ValueEnum};
use std::path::PathBuf;

/// How segments are found, and how large they are to be.
#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct SegmentArgs {
    /// How segments are found
    #[arg(long, value_enum, default_value_t = MethodArg::CutPursuit)]
    pub(crate) method: MethodArg,
    /// Cost of a boundary edge: larger gives fewer, larger segments [default: 0.03]
    #[arg(long, value_name = "RHO", group = "intent")]
    pub(crate) strength: Option<f64>,
    /// Aim at so many segments on a hectare of covered ground
    #[arg(long, value_name = "N", group = "intent")]
    pub(crate) segments_per_hectare: Option<f64>,
    /// Aim at the smallest object that is to be a segment of its own, metres
    #[arg(long, value_name = "METRES", group = "intent")]
    pub(crate) smallest_object: Option<f64>,
    /// Aim at the fewest segments that could be named with at most so much loss of accuracy on the cloud's labels, 0..1
    #[arg(long, value_name = "LOSS", group = "intent")]
    pub(crate) oracle_loss: Option<f64>,
    /// Segments of fewer points join their best neighbour
    #[arg(long, value_name = "POINTS", default_value_t = 0.0)]
    pub(crate) cutoff: f64,
    /// Smallest neighbourhood that describes a point (20 or more on scans that consist of lines)
    #[arg(long, value_name = "K", default_value_t = 10)]
    pub(crate) k_min: usize,
    /// Seed of everything that is drawn by chance
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
}

/// How segments are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodArg {
    /// l0 cut pursuit: lower energy
    CutPursuit,
    /// Greedy merging: faster
    Merge,
}

/// scansion segment IN -o OUT
#[derive(Debug, ClapArgs)]
pub(crate) struct Segment {
    /// Cloud to part
    pub(crate) input: PathBuf,
    /// Result: the input with the dimension ClusterID (from 1; 0 = none)
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) segments: SegmentArgs,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
    /// Replace the input itself if it is also the output
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// scansion suggest IN -o OUT
#[derive(Debug, ClapArgs)]
pub(crate) struct Suggest {
    /// Cloud to look at
    pub(crate) input: PathBuf,
    /// Where the answer goes: .csv to be filled in, .las, .laz or .ply with ClusterID, .html with two pictures of each
    /// segment; may be repeated
    #[arg(short, long, required = true)]
    pub(crate) output: Vec<PathBuf>,
    /// Segments to name
    #[arg(short = 'n', long, value_name = "N", default_value_t = 50)]
    pub(crate) count: usize,
    /// Model that is to get better: its uncertainty counts
    #[arg(short, long)]
    pub(crate) model: Option<PathBuf>,
    /// Leave out segments that hold a label
    #[arg(long)]
    pub(crate) labelled: bool,
    #[command(flatten)]
    pub(crate) segments: SegmentArgs,
    #[command(flatten)]
    pub(crate) labels: LabelArgs,
}
