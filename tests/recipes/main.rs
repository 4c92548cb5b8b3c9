//! Training and classification by each recipe, on real and on made-up clouds.

mod airborne;
mod contours;
mod determinism;
mod labels;
mod objects;
mod one_stage;
mod pyramid;
mod regularisation;
mod search;
mod weak;
