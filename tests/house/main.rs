//! The rules of the source code, and the docs that are made of it.

mod arguments;
mod feature_page;
mod layers;
