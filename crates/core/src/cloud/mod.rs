//! The point cloud: coordinates as stored in the file, and named columns.

mod column;
pub mod crs;
mod epsg;
mod metric;
mod points;
mod positions;
mod raster;
mod scheme;
mod stray;
mod wkt;

pub(crate) use column::each_values;
pub use column::{Column, Values};
pub use metric::MetricCloud;
pub use points::{LocalFrame, Points};
pub use positions::Positions;
pub use raster::{Height, Raster};
pub use scheme::{ClassNames, CodeScheme, OwnClass};
pub use stray::{StrayParams, Strays};

use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};
use std::collections::HashMap;

/// Largest number of columns of a cloud; LAS records have no room for more.
pub(crate) const MOST_COLUMNS: usize = 65_536;

/// Smallest and largest coordinate of each axis, both included.
pub type Bounds = [[f64; 3]; 2];

/// Largest rounding error between two computations of a coordinate from whole numbers, with coordinates and offsets up
/// to `most`.
pub(crate) fn rounding(most: f64) -> f64 {
    4.0 * f64::EPSILON * most
}

/// The bounds around two boxes.
pub(crate) fn around([a, b]: Bounds, [c, d]: Bounds) -> Bounds {
    [[0, 1, 2].map(|i| a[i].min(c[i])), [0, 1, 2].map(|i| b[i].max(d[i]))]
}

/// Points of a piece when bounds are computed in parallel.
const PIECE: usize = 65_536;

/// Names of the columns with a defined meaning (PDAL's dimension names).
pub mod names {
    /// Class code, u8.
    pub const CLASSIFICATION: &str = "Classification";
    /// Whether the point is not to be used (LAS), 0 or 1.
    pub const WITHHELD: &str = "Withheld";
    /// Intensity of the return, u16 in LAS.
    pub const INTENSITY: &str = "Intensity";
    /// Number of this return in its pulse, from 1.
    pub const RETURN_NUMBER: &str = "ReturnNumber";
    /// Number of returns of the pulse.
    pub const NUMBER_OF_RETURNS: &str = "NumberOfReturns";
    /// Red, green and blue.
    pub const COLOUR: [&str; 3] = ["Red", "Green", "Blue"];
    /// Highest class probability, f32 in 0..1.
    pub const CONFIDENCE: &str = "Confidence";
    /// Entropy of the class probabilities, f32, in nats.
    pub const ENTROPY: &str = "Entropy";
    /// Height above the ground, f32, in the unit of z.
    pub const HEIGHT_ABOVE_GROUND: &str = "HeightAboveGround";
    /// Components of the unit normal, f32.
    pub const NORMAL: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];

    /// Name of the dimension with the probability of a class: `P_` and the name, at most 31 characters, as many as LAS has
    /// room for.
    pub fn probability_of(class: &str) -> String {
        let name = format!("P_{}", class.replace(|ch: char| !ch.is_ascii_alphanumeric(), "_"));
        name.chars().take(31).collect()
    }
}

/// Coordinates in one of the two forms used by files.
#[derive(Clone, Debug, PartialEq)]
pub enum Coordinates {
    /// `tick * scale + offset` per axis: the exact integers of LAS files.
    Scaled {
        /// Integers per axis.
        ticks: [Vec<i32>; 3],
        /// Size of one tick, finite and above 0.
        scale: [f64; 3],
        /// Added after scaling, finite.
        offset: [f64; 3],
    },
    /// Floating-point numbers per axis (PLY, text, numpy).
    Float([Vec<f64>; 3]),
}

/// Points with named columns. Every column has one value (or row) a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    coordinates: Coordinates,
    columns: Vec<Column>,
    /// Position of the column of each name.
    places: HashMap<String, usize>,
    /// Coordinate reference system as the file states it: WKT, `EPSG:n`, or `EPSG:n+m` with a vertical system m.
    pub crs: Option<String>,
    /// Metres per unit of the coordinates, if the file states it (0.3048 for feet).
    pub metres_per_unit: Option<f64>,
    /// The class list that the codes in the column `Classification` belong to.
    pub scheme: CodeScheme,
    /// Names of class codes that take precedence over those of the list.
    pub class_names: ClassNames,
}

impl Cloud {
    /// A cloud without columns. Fails if the axes differ in length, a scale is not finite and positive,
    /// or there are 2^32 points or more.
    pub fn new(coordinates: Coordinates) -> Result<Self> {
        let [x, y, z] = match &coordinates {
            Coordinates::Scaled { ticks: [x, y, z], .. } => [x.len(), y.len(), z.len()],
            Coordinates::Float([x, y, z]) => [x.len(), y.len(), z.len()],
        };
        if x != y || x != z {
            return Err(Error::input(format!("axes differ in length: x {x}, y {y}, z {z}")));
        }
        if x > u32::MAX as usize {
            return Err(Error::input(format!("{x} points in one cloud; at most {} are possible", u32::MAX)));
        }
        if let Coordinates::Scaled { scale, offset, .. } = &coordinates
            && (scale.iter().any(|s| !s.is_finite() || *s <= 0.0) || offset.iter().any(|o| !o.is_finite()))
        {
            return Err(Error::input(format!("scale {scale:?} must be positive and offset {offset:?} finite")));
        }
        Ok(Self {
            coordinates,
            columns: Vec::new(),
            places: HashMap::new(),
            crs: None,
            metres_per_unit: None,
            scheme: CodeScheme::default(),
            class_names: ClassNames::new(),
        })
    }

    /// A cloud from rows of x, y, z.
    ///
    /// # Errors
    /// If there are 2^32 points or more.
    pub fn from_rows(rows: &[[f64; 3]]) -> Result<Self> {
        Self::new(Coordinates::Float([0, 1, 2].map(|a| rows.iter().map(|r| r[a]).collect())))
    }

    /// A copy, made array by array; as [`Clone`], for many points.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn copied(&self, monitor: &Monitor) -> Result<Self> {
        let coordinates = match &self.coordinates {
            Coordinates::Scaled { ticks, scale, offset } => {
                Coordinates::Scaled { ticks: copied(ticks, monitor)?, scale: *scale, offset: *offset }
            }
            Coordinates::Float(axes) => Coordinates::Float(copied(axes, monitor)?),
        };
        let mut columns = Vec::with_capacity(self.columns.len());
        for column in &self.columns {
            monitor.check()?;
            columns.push(column.clone());
        }
        let Self { metres_per_unit, scheme, .. } = *self;
        let (places, crs, class_names) = (self.places.clone(), self.crs.clone(), self.class_names.clone());
        Ok(Self { coordinates, columns, places, crs, metres_per_unit, scheme, class_names })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        match &self.coordinates {
            Coordinates::Scaled { ticks, .. } => ticks[0].len(),
            Coordinates::Float(axes) => axes[0].len(),
        }
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The coordinates as stored.
    pub fn coordinates(&self) -> &Coordinates {
        &self.coordinates
    }

    /// Coordinates of point `i` in the file's unit.
    pub fn xyz(&self, i: usize) -> [f64; 3] {
        match &self.coordinates {
            Coordinates::Scaled { ticks, scale, offset } => {
                [0, 1, 2].map(|a| f64::from(ticks[a][i]).mul_add(scale[a], offset[a]))
            }
            Coordinates::Float(axes) => [0, 1, 2].map(|a| axes[a][i]),
        }
    }

    /// Smallest and largest finite coordinate per axis; `None` if no point is finite.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds_of(0..self.len())
    }

    /// Like [`Cloud::bounds`], with cancellation, in parallel.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn bounds_watched(&self, monitor: &Monitor) -> Result<Option<Bounds>> {
        let pieces = self.len().div_ceil(PIECE);
        let boxes = map_ordered(pieces, monitor, |piece| {
            Ok(self.bounds_of(piece * PIECE..((piece + 1) * PIECE).min(self.len())))
        })?;
        Ok(boxes.into_iter().flatten().reduce(around))
    }

    fn bounds_of(&self, points: std::ops::Range<usize>) -> Option<Bounds> {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for i in points {
            let p = self.xyz(i);
            if p.iter().all(|v| v.is_finite()) {
                for a in 0..3 {
                    low[a] = low[a].min(p[a]);
                    high[a] = high[a].max(p[a]);
                }
            }
        }
        (low[0] <= high[0]).then_some([low, high])
    }

    /// All columns, in the order of the file.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The column with that name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.places.get(name).map(|&at| &self.columns[at])
    }

    /// Adds a column or replaces the one with the same name. Fails if its length is not the number of points, or if
    /// there are 65,536 columns already.
    pub fn set_column(&mut self, column: Column) -> Result<()> {
        if column.values.len() != self.len() {
            return Err(Error::input(format!(
                "column {} has {} values for {} points",
                column.name,
                column.values.len(),
                self.len()
            )));
        }
        if let Some(&at) = self.places.get(&column.name) {
            self.columns[at] = column;
            return Ok(());
        }
        if self.columns.len() >= MOST_COLUMNS {
            return Err(Error::input(format!("column {}: a cloud has at most {MOST_COLUMNS} columns", column.name)));
        }
        self.places.insert(column.name.clone(), self.columns.len());
        self.columns.push(column);
        Ok(())
    }

    /// The reference system as WKT; that of a cloud without one, whose unit is known and not the metre, is a local system
    /// that tells only the unit. `None` if there is neither, or if an EPSG code is not in the table.
    pub fn wkt(&self) -> Option<String> {
        match self.crs.as_deref() {
            Some(text) => crs::wkt(text),
            None => self.metres_per_unit.filter(|&metres| !crs::same_length(metres, 1.0)).map(crs::local),
        }
    }

    /// Whether x and y are degrees or other angles: the reference system says so, and no length unit is given.
    pub fn is_in_degrees(&self) -> bool {
        self.angle().is_some()
    }

    /// Whether nothing tells the unit of x and y: none is given, and there is no reference system that states one.
    pub fn unit_is_unknown(&self) -> bool {
        self.metres_per_unit.is_none() && self.crs.as_deref().and_then(crs::unit_of).is_none()
    }

    /// Radians in the unit of x and y, if they are angles.
    pub(crate) fn angle(&self) -> Option<f64> {
        match (self.metres_per_unit, crs::unit_of(self.crs.as_deref()?)) {
            (None, Some(crs::Unit::Angle(radians))) => Some(radians),
            _ => None,
        }
    }

    /// Metres per unit of the coordinates: the requested value, else that of the cloud, else 1.
    ///
    /// # Errors
    /// If the number is not finite and above 0, or the coordinates are degrees.
    pub fn metres(&self, asked: Option<f64>) -> Result<f64> {
        match asked.or(self.metres_per_unit) {
            Some(metres) if metres.is_finite() && metres > 0.0 => Ok(metres),
            Some(metres) => Err(Error::parameter("metres_per_unit", metres, "a number above 0, finite")),
            None => match self.angle() {
                Some(radians) => Err(Error::input(format!(
                    "x and y are {}, but distances are needed: project the cloud first, e.g. with PDAL's \
                     filters.reprojection to UTM; if they are a length after all, say which (--unit METRES, or \
                     metres_per_unit in Python)",
                    crs::angles(radians)
                ))),
                None => Ok(1.0),
            },
        }
    }

    /// Gives the cloud another reference system. A unit that is that of the former one becomes that of the new one, if it
    /// states one; any other unit stays.
    pub fn set_crs(&mut self, crs: Option<String>) {
        let unit = |crs: &Option<String>| crs.as_deref().and_then(crs::unit_of);
        if let (Some(metres), Some(crs::Unit::Length(former)), Some(_)) =
            (self.metres_per_unit, unit(&self.crs), unit(&crs))
            && crs::same_length(metres, former)
        {
            self.metres_per_unit = None;
        }
        self.crs = crs;
        self.take_unit_from_crs();
    }

    /// Sets the unit from the reference system if it is not known otherwise.
    pub fn take_unit_from_crs(&mut self) {
        if let (None, Some(crs::Unit::Length(metres))) =
            (self.metres_per_unit, self.crs.as_deref().and_then(crs::unit_of))
        {
            self.metres_per_unit = Some(metres);
        }
    }

    /// Removes a column and returns it.
    pub fn take_column(&mut self, name: &str) -> Option<Column> {
        let at = self.places.remove(name)?;
        self.places.values_mut().filter(|place| **place > at).for_each(|place| *place -= 1);
        Some(self.columns.remove(at))
    }

    /// The points at `indices`, in that order, with all their columns.
    pub fn select(&self, indices: &[u32]) -> Self {
        let coordinates = match &self.coordinates {
            Coordinates::Scaled { ticks, scale, offset } => Coordinates::Scaled {
                ticks: [0, 1, 2].map(|a| indices.iter().map(|&i| ticks[a][i as usize]).collect()),
                scale: *scale,
                offset: *offset,
            },
            Coordinates::Float(axes) => {
                Coordinates::Float([0, 1, 2].map(|a| indices.iter().map(|&i| axes[a][i as usize]).collect()))
            }
        };
        Self {
            coordinates,
            columns: self.columns.iter().map(|c| c.select(indices)).collect(),
            places: self.places.clone(),
            crs: self.crs.clone(),
            metres_per_unit: self.metres_per_unit,
            scheme: self.scheme,
            class_names: self.class_names.clone(),
        }
    }
}

fn copied<T: Clone>([x, y, z]: &[Vec<T>; 3], monitor: &Monitor) -> Result<[Vec<T>; 3]> {
    let copy = |axis: &Vec<T>| monitor.check().map(|()| axis.clone());
    Ok([copy(x)?, copy(y)?, copy(z)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_skip_points_that_are_not_finite() {
        let cloud = Cloud::from_rows(&[[1.0, 2.0, 3.0], [f64::NAN, 0.0, 0.0], [4.0, -1.0, 3.5]]).unwrap();
        assert_eq!(cloud.bounds(), Some([[1.0, -1.0, 3.0], [4.0, 2.0, 3.5]]));
        assert_eq!(Cloud::from_rows(&[]).unwrap().bounds(), None);
        let rows: Vec<[f64; 3]> = (0..200_000).map(|i| [f64::from(i * 7 % 1000), f64::from(-i), f64::NAN]).collect();
        let rows: Vec<[f64; 3]> = rows.iter().map(|r| [r[0], r[1], if r[0] > 900.0 { r[2] } else { 0.5 }]).collect();
        let many = Cloud::from_rows(&rows).unwrap();
        assert_eq!(many.bounds_watched(&Monitor::default()).unwrap(), many.bounds());
    }

    #[test]
    fn a_unit_goes_with_its_system_and_stays_without() {
        let foot = 1200.0 / 3937.0;
        let after = |start: Option<f64>, systems: &[Option<&str>]| {
            let mut cloud = Cloud::from_rows(&[[0.0; 3]]).unwrap();
            cloud.metres_per_unit = start;
            systems.iter().for_each(|crs| cloud.set_crs(crs.map(String::from)));
            cloud.metres_per_unit
        };
        let feet = Some("EPSG:2229");
        assert_eq!([after(None, &[feet]), after(None, &[feet, None])], [Some(foot); 2]);
        assert_eq!(
            [after(None, &[feet, Some("EPSG:25832")]), after(None, &[feet, Some("EPSG:4326")])],
            [Some(1.0), None]
        );
        assert_eq!(after(None, &[feet, Some("somewhere")]), Some(foot));
        assert_eq!([after(Some(0.5), &[feet]), after(Some(0.5), &[feet, Some("EPSG:25832")])], [Some(0.5); 2]);
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let cloud = Cloud { metres_per_unit: Some(wrong), ..Cloud::from_rows(&[]).unwrap() };
            assert!(cloud.metres(None).is_err() && cloud.metres(Some(2.0)).is_ok());
        }
    }

    #[test]
    fn a_system_that_states_no_unit_leaves_it_unknown() {
        let mut cloud = Cloud::from_rows(&[]).unwrap();
        let site = "PROJCS[\"site\",GEOGCS[\"g\",UNIT[\"degree\",0.0174532925199433]]]";
        for (crs, unknown) in [
            (None, true),
            (Some("EPSG:12345"), true),
            (Some(site), true),
            (Some("EPSG:4326"), false),
            (Some("EPSG:32632"), false),
        ] {
            cloud.crs = crs.map(String::from);
            assert_eq!(cloud.unit_is_unknown(), unknown, "{crs:?}");
        }
        cloud.crs = Some(site.into());
        cloud.metres_per_unit = Some(1.0);
        assert!(!cloud.unit_is_unknown());
    }

    #[test]
    fn columns_must_have_one_value_a_point() {
        let mut cloud = Cloud::from_rows(&[[0.0; 3], [1.0; 3]]).unwrap();
        assert!(cloud.set_column(Column::new("Classification", Values::U8(vec![2]))).is_err());
        cloud.set_column(Column::new("Classification", Values::U8(vec![2, 6]))).unwrap();
        assert_eq!(cloud.select(&[1]).column("Classification").unwrap().values, Values::U8(vec![6]));
    }

    #[test]
    fn columns_are_found_by_name_after_others_have_left() {
        let mut cloud = Cloud::from_rows(&[[0.0; 3]]).unwrap();
        for (i, name) in ["A", "B", "C", "D"].into_iter().enumerate() {
            cloud.set_column(Column::new(name, Values::U8(vec![i as u8]))).unwrap();
        }
        assert_eq!(cloud.take_column("B").unwrap().values, Values::U8(vec![1]));
        assert!(cloud.take_column("B").is_none() && cloud.column("B").is_none());
        cloud.set_column(Column::new("D", Values::U8(vec![9]))).unwrap();
        cloud.set_column(Column::new("B", Values::U8(vec![7]))).unwrap();
        let found = ["A", "C", "D", "B"].map(|name| cloud.column(name).unwrap().values.get(0));
        assert_eq!(found, [0.0, 2.0, 9.0, 7.0]);
        assert!(cloud.columns().iter().map(|c| &c.name[..]).eq(["A", "C", "D", "B"]));
    }

    #[test]
    fn scaled_coordinates_refuse_a_zero_scale() {
        let scaled =
            |s| Coordinates::Scaled { ticks: [vec![1], vec![2], vec![3]], scale: [s, 1.0, 1.0], offset: [0.0; 3] };
        assert!(Cloud::new(scaled(0.0)).is_err());
        assert_eq!(Cloud::new(scaled(0.5)).unwrap().xyz(0), [0.5, 2.0, 3.0]);
    }
}
