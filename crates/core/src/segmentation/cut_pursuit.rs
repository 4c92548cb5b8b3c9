//! ℓ0 cut pursuit: piecewise-constant approximation of values on a graph.
//!
//! L. Landrieu, G. Obozinski, *Cut pursuit: fast algorithms to learn piecewise constant functions on general weighted
//! graphs*, SIAM J. Imaging Sciences 10(4), 2017, section 3; as used by S. Guinard, L. Landrieu, ISPRS Archives
//! XLII-1/W1, 2017, equation 1. Minimises Q = Σ m_i ‖f_i − x_c(i)‖² + ρ Σ w_ij [c(i) ≠ c(j)].
//!
//! | paper | here |
//! |---|---|
//! | f, m | rows and weights of [`Signal`] |
//! | ρ (no factor ½) | [`CutPursuitParams::strength`] |
//! | w | weights of the [`Graph`] |
//! | c | segments of the [`Partition`] |

mod bisect;
mod iterate;
mod min_cut;
mod params;
mod piece;
mod two_means;

pub use params::{CutPursuitParams, Preset, Start};

use super::connected::connected_partition;
use super::cutoff::absorb_small;
use super::regions::{Regions, energy};
use super::{Partition, Signal};
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::Monitor;
use iterate::Pursuit;

/// Result of [`cut_pursuit`].
#[derive(Clone, Debug, PartialEq)]
pub struct CutPursuit {
    /// The segments of the best iterate, after the cutoff.
    pub partition: Partition,
    /// Mean of each segment, `width` values each.
    pub centroids: Vec<f64>,
    /// Q of the best iterate, before the cutoff took part.
    pub energy: f64,
    /// Rounds of splitting and merging.
    pub iterations: usize,
    /// True if no segment could be split any more or Q fell by less than the tolerance.
    pub converged: bool,
    /// Q at the start and after every round.
    pub trace: Vec<f64>,
}

/// Segments on which the signal is nearly constant, with short boundaries.
///
/// Every round splits each open segment in two by a minimum cut between two means, and then merges segments that
/// touch, largest gain first, while Q falls. A split may raise Q for a moment, because staying whole is not among the
/// choices of the cut: the best partition that was met is returned, or `guard` forbids such splits.
///
/// # Returns
/// The partition, its means, Q, and how it was reached. Strength 0 gives the connected sets of equal values, an
/// infinite one the connected pieces (over edges of positive weight).
///
/// # Complexity
/// A round costs k-means and `flow_steps` minimum cuts inside each open segment, and O(m log m) for merging;
/// O(n · width + m) memory.
///
/// # Determinism
/// The random stream of a split depends on the seed, the segment's smallest node and the round: the same bytes for any
/// number of threads.
///
/// # Errors
/// If the signal has not a row for each node, a parameter is out of range, or the work was cancelled.
pub fn cut_pursuit(signal: &Signal, graph: &Graph, params: &CutPursuitParams, monitor: &Monitor) -> Result<CutPursuit> {
    params.validate()?;
    signal.fits(graph.len())?;
    let mut found = match trivial(signal, graph, params)? {
        Some(partition) => {
            let energy = energy(signal, graph, params.strength, &partition);
            CutPursuit { partition, centroids: vec![], energy, iterations: 0, converged: true, trace: vec![energy] }
        }
        None => Pursuit::new(signal, graph, params, monitor)?.run()?,
    };
    found.partition = absorb_small(signal, graph, &found.partition, (params.strength, params.cutoff))?;
    found.centroids = Regions::of_segments(signal, &found.partition).into_means();
    Ok(found)
}

/// The answer where the strength leaves no choice.
fn trivial(signal: &Signal, graph: &Graph, params: &CutPursuitParams) -> Result<Option<Partition>> {
    let same = |[a, b]: [u32; 2]| signal.row(a as usize) == signal.row(b as usize);
    if params.strength.is_infinite() {
        connected_partition(graph, |e, _| graph.weights()[e] > 0.0).map(Some)
    } else if params.strength == 0.0 {
        connected_partition(graph, |_, ends| same(ends)).map(Some)
    } else {
        Ok(None)
    }
}
