//! Objects to classify as a whole: images, occupied cells, and clouds of points; readers of the files in which data sets
//! come.

mod idx;
mod mesh;
mod samples;
mod xyz;

pub use idx::{Idx, read_idx};
pub use mesh::{Mesh, read_off};
pub use samples::{ObjectAugmentation, ObjectShape, Objects, Sample};
pub use xyz::{XyzObject, read_xyz, read_xyz_folder};
