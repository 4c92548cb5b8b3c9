//! Selection and conventions of features; the defaults are those of Hackel 2018.

use super::definition::{Definition, Feature, Group, Scope, of_scope, scaled_name};
use super::profile::ProfileParams;
use crate::cloud::{Cloud, names};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// The centre of the structure tensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Centre {
    /// The medoid: the point with the least sum of distances to the others (Hackel 2018).
    #[default]
    Medoid,
    /// The arithmetic mean (most other software).
    Mean,
}

/// The divisor of the structure tensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Divisor {
    /// The number of points (Hackel 2018).
    #[default]
    #[serde(rename = "n")]
    N,
    /// The number of points minus 1 (the unbiased estimate; jakteristics).
    #[serde(rename = "n-1")]
    NMinusOne,
}

impl Divisor {
    /// What is taken from the number of points.
    pub(crate) fn constraints(self) -> f64 {
        match self {
            Self::N => 0.0,
            Self::NMinusOne => 1.0,
        }
    }
}

/// Shape of the vertical column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Column {
    /// A cylinder: points within the horizontal radius (Hackel 2018: "cylindrical").
    #[default]
    Cylinder,
    /// A cell of a horizontal grid (faster, but with steps at the borders of cells).
    Cell,
}

/// Edge of the coarsest voxel, metres, if the number of levels is not given (Hackel 2018: 9 levels from 0.025 m on).
const COARSEST: f64 = 6.4;

/// Parameters of the multi-scale pyramid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PyramidParams {
    /// Edge of the finest voxel in metres; `None` (`"none"` or 0 in a recipe) derives it from the cloud's point spacing.
    #[serde(with = "crate::settings::optional_or_zero")]
    pub first_scale: Option<f64>,
    /// Number of levels, each with voxels of twice the edge, 1..=16; `None` (`"none"` in a recipe): as many as reach from the
    /// finest to 6.4 m, the coarsest of the thesis.
    #[serde(with = "crate::settings::optional")]
    pub levels: Option<usize>,
    /// Number of points in a neighbourhood; 3..=32.
    pub k: usize,
    /// Whether the point itself is one of the k (otherwise k points of the level).
    pub include_query: bool,
    /// Centre of the structure tensor.
    pub centre: Centre,
    /// Divisor of the structure tensor.
    pub divisor: Divisor,
    /// Whether eigenvalues are divided by their sum before omnivariance and entropy.
    pub normalise: bool,
    /// Shape of the vertical column.
    pub column: Column,
    /// Radius (cylinder) or edge (cell) of the column in voxels; 0.25..=8.
    pub column_radius: f64,
    /// Share of the neighbourhood that forms the near set of the line feature (α of eq. 4.3); above 0, below 1.
    pub near_share: f64,
}

impl Default for PyramidParams {
    fn default() -> Self {
        Self {
            first_scale: Some(0.025),
            levels: None,
            k: 10,
            include_query: true,
            centre: Centre::Medoid,
            divisor: Divisor::N,
            normalise: false,
            column: Column::Cylinder,
            column_radius: 1.0,
            near_share: 0.5,
        }
    }
}

impl PyramidParams {
    /// Names of the presets.
    pub const PRESETS: [&'static str; 3] = ["hackel", "jakteristics", "pgeof"];

    /// Presets by name: `hackel` (Hackel 2018), `jakteristics` (mean, n − 1), `pgeof` (mean, n, normalised).
    ///
    /// # Errors
    /// If the name is not in [`PyramidParams::PRESETS`].
    pub fn preset(name: &str) -> Result<Self> {
        let base = Self::default();
        match name {
            "hackel" => Ok(base),
            "jakteristics" => {
                Ok(Self { include_query: false, centre: Centre::Mean, divisor: Divisor::NMinusOne, ..base })
            }
            "pgeof" => Ok(Self { include_query: false, centre: Centre::Mean, normalise: true, ..base }),
            _ => Err(Error::parameter("preset", name, Self::PRESETS.join(", "))),
        }
    }

    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        let range = |fine: bool, name, value: &dyn std::fmt::Display, expected: &str| match fine {
            true => Ok(()),
            false => Err(Error::parameter(name, value, expected)),
        };
        let first = self.first_scale.unwrap_or(1.0);
        range((1e-4..=1e4).contains(&first), "first_scale", &first, "0.0001..10000 metres")?;
        let levels = self.levels.unwrap_or(1);
        range((1..=16).contains(&levels), "levels", &levels, "1..16")?;
        range((3..=32).contains(&self.k), "k", &self.k, "3..32")?;
        range((0.25..=8.0).contains(&self.column_radius), "column_radius", &self.column_radius, "0.25..8 voxels")?;
        range(self.near_share > 0.0 && self.near_share < 1.0, "near_share", &self.near_share, "above 0 and below 1")
    }

    /// Voxel size of each level.
    pub fn scales(&self, first_scale: f64) -> Vec<f64> {
        (0..self.count(first_scale)).map(|l| first_scale * f64::from(1u32 << l)).collect()
    }

    /// Number of levels from this finest scale on.
    pub fn count(&self, first_scale: f64) -> usize {
        let reach = || (COARSEST / first_scale.max(1e-6)).log2().round().clamp(0.0, 15.0) as usize + 1;
        self.levels.unwrap_or_else(reach)
    }
}

/// A feature of a set.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Offer {
    /// Name of its column.
    pub(super) name: String,
    pub(super) place: Place,
}

/// What computes a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// The level of this number, 0 for the finest.
    Level(usize, Feature),
    /// The profiles; the position among their values.
    Profile(usize),
    /// The point's own values.
    Own(Feature),
    /// A dimension of the cloud as it is; the position among the set's.
    Dimension(usize),
}

/// All features that a recipe uses.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureSet {
    /// Use the point's colour.
    pub colour: bool,
    /// Use the point's intensity.
    pub intensity: bool,
    /// Use the point's return number and number of returns.
    pub returns: bool,
    /// Whether clouds may lack colour, intensity or returns: their values are then missing (NaN) instead of an error.
    pub optional: bool,
    /// Other dimensions of the cloud whose values are features as they are, e.g. `["Amplitude", "Reflectance"]`; NaN is a
    /// missing value.
    pub dimensions: Vec<String>,
    /// Use the height above the ground, for methods that find the ground first.
    pub height: bool,
    /// Metres per unit of the coordinates; `None` (`"none"` in a recipe): what the cloud says, else 1.
    #[serde(with = "crate::settings::optional")]
    pub metres_per_unit: Option<f64>,
    /// The pyramid.
    pub pyramid: PyramidParams,
    /// Profiles in cells of a grid in plan; none by default.
    pub profile: ProfileParams,
}

impl FeatureSet {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        match self.metres_per_unit {
            Some(m) if !(m.is_finite() && m > 0.0) => Err(Error::parameter("metres_per_unit", m, "metres, above 0")),
            _ => {
                self.validate_dimensions().and_then(|()| self.pyramid.validate()).and_then(|()| self.profile.validate())
            }
        }
    }

    /// Each dimension is named once, and is neither the classes nor a feature that has a switch of its own.
    fn validate_dimensions(&self) -> Result<()> {
        let bad = |name: &String, expected: &str| Err(Error::parameter("features.dimensions", name, expected));
        for (i, name) in self.dimensions.iter().enumerate() {
            if name.is_empty() || name == names::CLASSIFICATION {
                return bad(name, "a dimension of the cloud other than the classes");
            }
            if self.dimensions[..i].contains(name) || self.own().any(|d| d.name == name) {
                return bad(name, "each dimension once");
            }
        }
        Ok(())
    }

    /// Metres per unit of this cloud's coordinates.
    pub fn metres(&self, cloud: &Cloud) -> f64 {
        self.metres_per_unit.or(cloud.metres_per_unit).unwrap_or(1.0)
    }

    /// Names of all features: level by level, then the profiles, then those of the point itself.
    pub fn names(&self, first_scale: f64) -> Vec<String> {
        self.offers(first_scale).into_iter().map(|offer| offer.name).collect()
    }

    /// All features: level by level, then the profiles, then those of the point itself, then the cloud's dimensions.
    pub(super) fn offers(&self, first_scale: f64) -> Vec<Offer> {
        let levels = self.pyramid.scales(first_scale).into_iter().enumerate().flat_map(|(level, scale)| {
            of_scope(Scope::Level)
                .map(move |d| Offer { name: scaled_name(d, scale), place: Place::Level(level, d.feature) })
        });
        let profiles = self.profile.offers().enumerate();
        let profiles = profiles.map(|(i, (name, _))| Offer { name, place: Place::Profile(i) });
        let own = self.own().map(|d| Offer { name: d.name.to_owned(), place: Place::Own(d.feature) });
        let dimensions = self.dimensions.iter().cloned().enumerate();
        let dimensions = dimensions.map(|(i, name)| Offer { name, place: Place::Dimension(i) });
        levels.chain(profiles).chain(own).chain(dimensions).collect()
    }

    /// Columns of the cloud that the features need.
    pub fn columns(&self) -> Vec<String> {
        let mut columns: Vec<&str> = Vec::new();
        if self.colour {
            columns.extend(names::COLOUR);
        }
        if self.intensity {
            columns.push(names::INTENSITY);
        }
        if self.returns {
            columns.extend([names::RETURN_NUMBER, names::NUMBER_OF_RETURNS]);
        }
        columns.into_iter().map(String::from).chain(self.dimensions.iter().cloned()).collect()
    }

    /// The selected features of the point itself.
    pub(super) fn own(&self) -> impl Iterator<Item = &'static Definition> {
        let wanted = [(Group::Colour, self.colour), (Group::Intensity, self.intensity), (Group::Returns, self.returns)];
        let columns = wanted.into_iter().filter(|(_, wanted)| *wanted).flat_map(|(group, _)| group.definitions());
        self.height.then(|| Feature::Elevation.definition()).into_iter().chain(columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_has_144_features_on_the_scales_of_the_thesis() {
        let set = FeatureSet::default();
        let names = set.names(0.025);
        assert_eq!(names.len(), 144);
        assert_eq!((names[0].as_str(), names[143].as_str()), ("Sum_r0p025", "HeightAbove_r6p4"));
        for (first, levels) in [(0.05, 8), (0.4, 5), (0.25, 6), (6.4, 1), (100.0, 1)] {
            assert_eq!(set.pyramid.count(first), levels, "{first}");
        }
        let more = FeatureSet { returns: true, ..set };
        assert_eq!(more.names(0.025)[144..], ["ReturnNumber", "NumberOfReturns", "ReturnRatio"]);
        let own = FeatureSet { dimensions: vec!["Amplitude".into()], ..more };
        assert_eq!(own.names(0.025)[147..], ["Amplitude"]);
        assert_eq!(own.columns(), ["ReturnNumber", "NumberOfReturns", "Amplitude"]);
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let bad = |p: PyramidParams| p.validate().unwrap_err().to_string();
        assert!(bad(PyramidParams { k: 2, ..PyramidParams::default() }).contains("parameter k: found 2"));
        assert!(bad(PyramidParams { first_scale: Some(f64::NAN), ..PyramidParams::default() }).contains("first_scale"));
        for twice in [vec!["Amplitude", "Amplitude"], vec!["ReturnNumber"], vec!["Classification"], vec![""]] {
            let dimensions = twice.into_iter().map(String::from).collect();
            let set = FeatureSet { returns: true, dimensions, ..FeatureSet::default() };
            assert!(set.validate().unwrap_err().to_string().contains("features.dimensions"));
        }
        assert!(PyramidParams::preset("cgal").unwrap_err().to_string().contains("jakteristics"));
    }
}
