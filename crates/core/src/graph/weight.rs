//! Weight of an edge from its length.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Weight of an edge of length d, where d̄ is the mean length of the graph's edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum EdgeWeight {
    /// 1 for every length.
    #[default]
    Constant,
    /// 1 / (offset + d/d̄), with an offset above 0; superpoint graphs (Landrieu and Simonovsky 2018) have 1.
    Inverse {
        /// Limits the weight of short edges.
        offset: f64,
    },
    /// exp(-d / (scale · d̄)), with a scale above 0.
    Exponential {
        /// Multiple of the mean length at which the weight has fallen to 1/e.
        scale: f64,
    },
}

impl EdgeWeight {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If the offset or the scale is not above 0 and finite.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Self::Inverse { offset } if !(offset > 0.0 && offset.is_finite()) => {
                Err(Error::parameter("offset", offset, "above 0, finite"))
            }
            Self::Exponential { scale } if !(scale > 0.0 && scale.is_finite()) => {
                Err(Error::parameter("scale", scale, "above 0, finite"))
            }
            _ => Ok(()),
        }
    }

    /// Weight of an edge of length `length` where `mean` is the mean length, both in metres; if the mean is 0, all
    /// edges weigh the same.
    pub fn of(&self, length: f64, mean: f64) -> f64 {
        let relative = if mean > 0.0 { length / mean } else { 0.0 };
        match *self {
            Self::Constant => 1.0,
            Self::Inverse { offset } => 1.0 / (offset + relative),
            Self::Exponential { scale } => (-relative / scale).exp(),
        }
    }
}

/// Share of its weight that an edge keeps if weights fall with the distance in metres: 1 up to the length `near`, and
/// (near/d)² for a longer length d. An infinite `near` leaves all weights as they are.
///
/// Weights relative to the mean length cannot see how dense a cloud is; these can.
pub fn metric_share(squared_length: f64, near: f64) -> f64 {
    let squared_near = near * near;
    if squared_length <= squared_near { 1.0 } else { squared_near / squared_length }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_of_mean_length_has_half_the_weight_or_the_eth_part() {
        assert_eq!(EdgeWeight::Constant.of(3.0, 3.0), 1.0);
        assert_eq!(EdgeWeight::Inverse { offset: 1.0 }.of(3.0, 3.0), 0.5);
        assert!((EdgeWeight::Exponential { scale: 1.0 }.of(3.0, 3.0) - (-1.0f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn short_edges_keep_their_weight_and_long_ones_lose_it_with_the_square_of_the_length() {
        for (length, near, share) in
            [(0.3, 0.5, 1.0), (0.5, 0.5, 1.0), (1.0, 0.5, 0.25), (2.0, 0.5, 0.0625), (0.0, 0.5, 1.0)]
        {
            assert_eq!(metric_share(length * length, near), share);
        }
        assert_eq!(metric_share(1e12, f64::INFINITY), 1.0);
    }

    #[test]
    fn offsets_and_scales_are_above_zero() {
        assert!(EdgeWeight::Inverse { offset: 0.0 }.validate().is_err());
        assert!(EdgeWeight::Exponential { scale: -1.0 }.validate().is_err());
        assert!(EdgeWeight::Exponential { scale: f64::NAN }.validate().is_err());
        assert!(EdgeWeight::Inverse { offset: 1.0 }.validate().is_ok());
    }
}
