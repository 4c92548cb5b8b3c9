//! Networks made of the layers.

mod build;
mod connected;
mod levels;
mod objects;
mod unet;
mod windows;

pub use connected::Mode;
pub use levels::{Kept, ObjectLevel, Weights};
pub use objects::{
    EpochReport, LabelKind, ObjectLearning, ObjectModel, ObjectModelAbout, ObjectNet, ObjectNetParams, ObjectPreset,
    ObjectTraining, Pass,
};
pub use unet::{SceneLevels, UNet, UNetParams};
pub use windows::{WindowNet, WindowNetParams, WindowPass};
