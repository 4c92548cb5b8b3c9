//! Parameters of a filter run.

use super::Area;
use crate::cloud::Bounds;
use crate::error::{Error, Result};
use crate::io::ReadOptions;
use crate::terrain::ProductParams;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// Most neighbours that a search may ask for.
const MOST: usize = 1000;

/// Which points [`filter`](super::filter()) keeps. The filters that are set are applied in the order of the fields, each
/// to the points that those before it left; by default all points are kept.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FilterParams {
    /// Keep only points of these classes; empty: of all.
    pub classes: Vec<u8>,
    /// Remove points of these classes.
    pub drop_classes: Vec<u8>,
    /// Remove statistical outliers.
    pub statistical: Option<StatisticalParams>,
    /// Remove points with few neighbours.
    pub radius: Option<RadiusParams>,
    /// Keep outliers, with class 7 (noise); the heights then do not matter to them.
    pub mark: bool,
    /// Keep only points with such a height above ground.
    pub height: Option<HeightRange>,
    /// How the ground is found for heights.
    pub ground: ProductParams,
    /// Find the ground even if the cloud has heights, the dimension `HeightAboveGround`.
    pub find_ground: bool,
    /// Keep only points in this box, in the unit of the file.
    #[serde(skip)]
    pub bounds: Option<Bounds>,
    /// Keep only points whose x and y are in this area.
    pub polygon: Option<Area>,
    /// Keep the points outside the area instead of those inside.
    pub outside: bool,
    /// Metres per unit of the coordinates, above 0; `None`: as the file states, else 1.
    pub metres_per_unit: Option<f64>,
}

impl FilterParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range, a class is both kept and dropped, or a field lacks the one that it changes.
    pub fn validate(&self) -> Result<()> {
        if let Some(code) = self.drop_classes.iter().find(|code| self.classes.contains(code)) {
            return Err(Error::parameter("drop_classes", code, "other classes than those to keep"));
        }
        self.statistical.map_or(Ok(()), |params| params.validate())?;
        self.radius.map_or(Ok(()), |params| params.validate())?;
        if self.mark && self.statistical.is_none() && self.radius.is_none() {
            return Err(Error::parameter("mark", true, "only together with a search for outliers"));
        }
        if self.outside && self.polygon.is_none() {
            return Err(Error::parameter("outside", true, "only together with a polygon"));
        }
        if self.find_ground && self.height.is_none() {
            return Err(Error::parameter("find_ground", true, "only together with heights"));
        }
        self.height.map_or(Ok(()), |range| range.validate())?;
        self.ground.validate()?;
        let (bounds, metres_per_unit) = (self.bounds, self.metres_per_unit);
        ReadOptions { bounds, metres_per_unit, ..ReadOptions::default() }.validate()
    }

    /// Whether no filter is set.
    pub fn is_empty(&self) -> bool {
        self.classes.is_empty()
            && self.drop_classes.is_empty()
            && self.statistical.is_none()
            && self.radius.is_none()
            && self.height.is_none()
            && self.bounds.is_none()
            && self.polygon.is_none()
    }

    /// Whether points are filtered by their class.
    pub(super) fn has_classes(&self) -> bool {
        !self.classes.is_empty() || !self.drop_classes.is_empty()
    }
}

/// Parameters of [`statistical_outliers`](super::statistical_outliers).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StatisticalParams {
    /// Number of nearest other points to which the mean distance is taken; 1 to 1000.
    pub neighbours: usize,
    /// Standard deviations above the mean over all points from which on a point is noise. Smaller: more points are noise.
    /// No unit; finite.
    pub multiplier: f64,
}

impl Default for StatisticalParams {
    /// Those of PDAL's `filters.outlier` (`mean_k`, `multiplier`).
    fn default() -> Self {
        Self { neighbours: 8, multiplier: 2.0 }
    }
}

impl StatisticalParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !self.multiplier.is_finite() {
            return Err(Error::parameter("multiplier", self.multiplier, "a finite number"));
        }
        match (1..=MOST).contains(&self.neighbours) {
            true => Ok(()),
            false => Err(Error::parameter("neighbours", self.neighbours, format!("1..{MOST}"))),
        }
    }
}

/// Parameters of [`radius_outliers`](super::radius_outliers).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RadiusParams {
    /// Distance within which neighbours count, metres; above 0.
    pub radius: f64,
    /// A point with fewer other points within the radius is noise; 1 to 1000.
    pub min_neighbours: usize,
}

impl Default for RadiusParams {
    /// Those of PDAL's `filters.outlier` (`radius`, `min_k`).
    fn default() -> Self {
        Self { radius: 1.0, min_neighbours: 2 }
    }
}

impl RadiusParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(self.radius > 0.0 && self.radius.is_finite()) {
            return Err(Error::parameter("radius", self.radius, "metres, above 0, finite"));
        }
        match (1..=MOST).contains(&self.min_neighbours) {
            true => Ok(()),
            false => Err(Error::parameter("min_neighbours", self.min_neighbours, format!("1..{MOST}"))),
        }
    }
}

/// A range of heights above ground, metres, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeightRange {
    /// Lowest height; −∞ has no limit.
    pub low: f64,
    /// Greatest height; ∞ has no limit.
    pub high: f64,
}

impl Default for HeightRange {
    /// All heights.
    fn default() -> Self {
        Self { low: f64::NEG_INFINITY, high: f64::INFINITY }
    }
}

impl HeightRange {
    /// Fails if the range is empty, NaN, or has no limit.
    pub fn validate(&self) -> Result<()> {
        match self.low <= self.high && (self.low.is_finite() || self.high.is_finite()) {
            true => Ok(()),
            false => Err(Error::parameter("height", format!("{}..{}", self.low, self.high), "LOW..HIGH, e.g. 2..50")),
        }
    }

    pub(super) fn holds(&self, height: f64) -> bool {
        self.low <= height && height <= self.high
    }
}

impl FromStr for HeightRange {
    type Err = Error;

    /// From `2..50`, `2..` or `..50`.
    fn from_str(text: &str) -> Result<Self> {
        let wrong = || Error::parameter("height", text, "metres as LOW..HIGH, LOW.. or ..HIGH, e.g. 2..50");
        let (low, high) = text.split_once("..").ok_or_else(wrong)?;
        let end = |text: &str, none: f64| match text.trim() {
            "" => Ok(none),
            number => number.parse::<f64>().map_err(|_| wrong()),
        };
        let range = Self { low: end(low, f64::NEG_INFINITY)?, high: end(high, f64::INFINITY)? };
        range.validate().map(|()| range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_heights_have_one_end_or_two() {
        let of = |text: &str| text.parse::<HeightRange>().map(|range| [range.low, range.high]);
        assert_eq!(of("2..50").unwrap(), [2.0, 50.0]);
        assert_eq!(of("-1.5..").unwrap(), [-1.5, f64::INFINITY]);
        assert_eq!(of(" .. .5").unwrap(), [f64::NEG_INFINITY, 0.5]);
        assert_eq!(of("3..3").unwrap(), [3.0, 3.0]);
        for wrong in ["", "..", "5", "5..2", "a..b", "nan..2", "1...2x", "-inf..inf"] {
            assert!(of(wrong).unwrap_err().to_string().contains("height"), "{wrong}");
        }
    }

    #[test]
    fn fields_that_contradict_each_other_are_refused() {
        let (classes, drop_classes) = (vec![2, 6], vec![6]);
        for (wrong, what) in [
            (FilterParams { classes, drop_classes, ..Default::default() }, "drop_classes"),
            (FilterParams { mark: true, ..Default::default() }, "mark"),
            (FilterParams { outside: true, ..Default::default() }, "outside"),
            (FilterParams { bounds: Some([[1.0; 3], [0.0; 3]]), ..Default::default() }, "bounds"),
            (FilterParams { metres_per_unit: Some(0.0), ..Default::default() }, "metres_per_unit"),
        ] {
            let message = wrong.validate().unwrap_err().to_string();
            assert!(message.contains(what), "{message}");
        }
        assert!(FilterParams::default().validate().is_ok() && FilterParams::default().is_empty());
    }
}
