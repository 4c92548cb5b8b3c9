//! Networks made of the layers.

mod unet;

pub use unet::{Scene, UNet, UNetParams};
