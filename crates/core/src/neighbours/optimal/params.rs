//! Parameters of the optimal neighbourhood and of its descriptors.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// The quantities in linearity, planarity and scattering.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Eigenvalues {
    /// The eigenvalues λ (Guinard & Landrieu 2017).
    #[default]
    Raw,
    /// Their square roots √λ, which are lengths (superpoint graphs, pgeof).
    Sqrt,
}

/// The neighbourhood sizes that are compared, and the conventions of the descriptors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OptimalParams {
    /// Smallest number of neighbours, not counting the point itself; 2..=k_max. With line scanners 10 neighbours may
    /// all lie on one scan line.
    pub k_min: usize,
    /// Largest number of neighbours; k_min..=1000.
    pub k_max: usize,
    /// Neighbourhoods of k_min, k_min + k_step, ... and of k_max neighbours are compared; at least 1.
    pub k_step: usize,
    /// The quantities in linearity, planarity and scattering.
    pub eigenvalues: Eigenvalues,
    /// Factor of verticality; above 0.
    pub verticality_factor: f64,
}

impl Default for OptimalParams {
    /// Guinard & Landrieu 2017; the range of k of Weinmann et al. 2015.
    fn default() -> Self {
        Self { k_min: 10, k_max: 100, k_step: 1, eigenvalues: Eigenvalues::Raw, verticality_factor: 1.0 }
    }
}

impl OptimalParams {
    /// Names of the presets.
    pub const PRESETS: [&'static str; 2] = ["guinard2017", "spg"];

    /// Presets: `guinard2017` (the default), `spg` (superpoint graphs: 45 neighbours everywhere, √λ, verticality
    /// doubled).
    /// verticality doubled).
    ///
    /// # Errors
    /// If the name is not in [`OptimalParams::PRESETS`].
    pub fn preset(name: &str) -> Result<Self> {
        match name {
            "guinard2017" => Ok(Self::default()),
            "spg" => {
                Ok(Self { k_min: 45, k_max: 45, k_step: 1, eigenvalues: Eigenvalues::Sqrt, verticality_factor: 2.0 })
            }
            _ => Err(Error::parameter("preset", name, Self::PRESETS.join(", "))),
        }
    }

    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if self.k_max > 1000 {
            return Err(Error::parameter("k_max", self.k_max, "at most 1000"));
        }
        if self.k_min < 2 || self.k_min > self.k_max {
            return Err(Error::parameter("k_min", self.k_min, format!("2..{} (k_max)", self.k_max)));
        }
        if self.k_step == 0 {
            return Err(Error::parameter("k_step", self.k_step, "at least 1"));
        }
        if !(self.verticality_factor > 0.0 && self.verticality_factor.is_finite()) {
            return Err(Error::parameter("verticality_factor", self.verticality_factor, "above 0"));
        }
        Ok(())
    }

    /// The numbers of neighbours that are compared if `available` neighbours exist, ascending.
    pub(super) fn wanted(&self, available: usize) -> Vec<u32> {
        let (low, high) = (self.k_min.min(available), self.k_max.min(available));
        let mut wanted: Vec<u32> = (low..=high).step_by(self.k_step).map(|k| k as u32).collect();
        if wanted.last().is_some_and(|&k| (k as usize) < high) {
            wanted.push(high as u32);
        }
        // A point and one neighbour always form a line, which carries no information.
        wanted.retain(|&k| k > 1);
        wanted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_neighbourhood_is_always_compared() {
        let params = OptimalParams { k_min: 5, k_max: 20, k_step: 7, ..OptimalParams::default() };
        assert_eq!(params.wanted(100), [5, 12, 19, 20]);
        assert_eq!(params.wanted(12), [5, 12]);
        assert_eq!(params.wanted(3), [3]);
        assert!(params.wanted(1).is_empty());
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        for bad in [
            OptimalParams { k_min: 1, ..OptimalParams::default() },
            OptimalParams { k_min: 101, ..OptimalParams::default() },
            OptimalParams { k_max: 1001, ..OptimalParams::default() },
            OptimalParams { k_step: 0, ..OptimalParams::default() },
            OptimalParams { verticality_factor: f64::NAN, ..OptimalParams::default() },
        ] {
            assert!(matches!(bad.validate(), Err(Error::InvalidParameter { .. })));
        }
        for name in OptimalParams::PRESETS {
            OptimalParams::preset(name).unwrap().validate().unwrap();
        }
        assert!(OptimalParams::preset("weinmann").is_err());
    }
}
