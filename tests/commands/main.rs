//! The verbs of the program: arguments, outputs, exit codes, and what a killed run leaves.

mod cli;
mod diff;
mod effects;
mod filters;
mod kill;
mod normals;
mod outputs;
mod terrain;
