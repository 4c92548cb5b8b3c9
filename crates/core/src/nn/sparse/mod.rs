//! Sparse tensors and direct sparse convolution with attention.
//!
//! T. Hackel, M. Usvyatsov, S. Galliani, J. D. Wegner, K. Schindler, *Inference, learning and attention mechanisms that
//! exploit and preserve sparsity in convolutional networks*, GCPR 2018, doi:10.1007/978-3-030-12939-2_41: each channel has
//! its own entries, filters are sparse too, and the strongest responses of each channel are kept.

mod attention;
mod convolution;
mod density;
mod filter;
mod forward;
mod pooling;
mod pruning;
mod slab;
mod strongest;
mod tensor;
mod window;

pub use attention::{Attention, Selection};
pub use convolution::{SparseConvolution, SparseGradient};
pub use density::{DensityParams, DensityRegulariser};
pub use filter::SparseFilter;
pub use forward::Responses;
pub use pooling::{Pooled, max_pool};
pub use pruning::Pruning;
pub use tensor::{Shape, SparseTensor};
