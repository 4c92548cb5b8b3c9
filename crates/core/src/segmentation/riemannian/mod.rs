//! Supervoxels on a Riemannian graph, segmented by cut pursuit (Li 2018).
//!
//! | paper | here |
//! |---|---|
//! | d_min, d_max, N_min, λ3 < 0.5 | [`OctreeParams`](super::OctreeParams) |
//! | D, D_N, D_s | `clusters` |
//! | d_proj, ρ | `arc` |
//! | f_v, a_p, a_s | `describe` |
//! | EMST, Kruskal, 8 nearest | `euclidean_tree`, `graph` |
//! | g*, μ | [`cut_pursuit`](super::cut_pursuit()), [`RiemannianParams::strength`] |

mod arc;
mod boxes;
mod clusters;
mod connected;
mod describe;
mod euclidean_tree;
mod graph;
mod params;
mod run;

pub use params::{KMeansParams, Nearest, NodeWeight, RiemannianGraphParams, RiemannianParams, Sides, Start, Symmetry};
pub use run::{GraphSizes, Riemannian, Scale, StageSeconds, multi_scale, riemannian, riemannian_with_normals};
