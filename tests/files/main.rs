//! Files of all formats: what they hold, units, damaged ones, and limits of memory and time.

mod formats;
mod mutants;
mod passthrough;
mod resources;
mod robustness;
mod units;
