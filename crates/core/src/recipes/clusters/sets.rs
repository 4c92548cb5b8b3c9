//! The feature sets A, B and C of E. Grilli, F. Poux, F. Remondino 2021, section 4.

use crate::cloud::Points;
use crate::error::Result;
use crate::features::definition::{Definition, Feature};
use crate::features::{Divisor, FeatureTable, Quantity, RadiusParams, radius_features};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// A set of features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClusterSet {
    /// The clusters at four levels: 4 features.
    A,
    /// Eight covariance features and verticality in spheres of ε, 2 ε, ... 8 ε, and the height above the ground: 73.
    B,
    /// The clusters; omnivariance, surface variation and verticality in spheres of ε to 4 ε; the height: 17.
    #[default]
    C,
}

/// Features of B.
const ALL: [Quantity; 9] = [
    Quantity::Sum,
    Quantity::Omnivariance,
    Quantity::Eigenentropy,
    Quantity::Anisotropy,
    Quantity::Planarity,
    Quantity::Linearity,
    Quantity::SurfaceVariation,
    Quantity::Sphericity,
    Quantity::Verticality,
];
/// Features of C.
const FEW: [Quantity; 3] = [Quantity::Omnivariance, Quantity::SurfaceVariation, Quantity::Verticality];

impl ClusterSet {
    /// Whether the clusters are among its features.
    pub(super) fn has_clusters(self) -> bool {
        self != Self::B
    }

    /// Quantities in spheres.
    fn quantities(self) -> &'static [Quantity] {
        match self {
            Self::A => &[],
            Self::B => &ALL,
            Self::C => &FEW,
        }
    }

    /// Number of radii, multiples of ε.
    fn radii(self) -> u8 {
        match self {
            Self::A => 0,
            Self::B => 8,
            Self::C => 4,
        }
    }
}

/// The covariance features in spheres of multiples of the radius.
pub(super) fn spheres(points: &Points, set: ClusterSet, radius: f64, monitor: &Monitor) -> Result<FeatureTable> {
    let definitions: Vec<&Definition> = set.quantities().iter().map(|&q| definition(q)).collect();
    let name = |factor: u8| definitions.iter().map(move |d| format!("{}_e{factor}", d.name)).collect::<Vec<_>>();
    let radii = (1..=set.radii()).map(|factor| radius * f64::from(factor)).collect();
    let params = RadiusParams { radii, divisor: Divisor::N, ..RadiusParams::default() };
    let values = radius_features(&points.positions, set.quantities(), &params, monitor)?;
    Ok(FeatureTable { names: (1..=set.radii()).flat_map(name).collect(), values })
}

/// The definition of a covariance feature.
fn definition(quantity: Quantity) -> &'static Definition {
    let feature = match quantity {
        Quantity::Omnivariance => Feature::Omnivariance,
        Quantity::Eigenentropy => Feature::Eigenentropy,
        Quantity::Anisotropy => Feature::Anisotropy,
        Quantity::Planarity => Feature::Planarity,
        Quantity::Linearity => Feature::Linearity,
        Quantity::SurfaceVariation => Feature::SurfaceVariation,
        Quantity::Sphericity => Feature::Sphericity,
        Quantity::Verticality => Feature::Verticality,
        _ => Feature::Sum,
    };
    feature.definition()
}
