//! Options of reading and writing.

use crate::cloud::crs::contradiction;
use crate::cloud::{ClassNames, Cloud, CodeScheme};
use crate::error::{Error, Result};
use crate::io::Edit;
use crate::parallel::Monitor;
use std::path::Path;

/// The columns to read besides the coordinates.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Columns {
    /// All.
    #[default]
    All,
    /// Those with these names, if the file has them.
    Only(Vec<String>),
}

pub use crate::cloud::Bounds;

/// Options of [`read_with`](super::read_with) and [`blocks`](super::blocks()).
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// The columns to read besides the coordinates.
    pub columns: Columns,
    /// Only points in this box; `None`: all. Of COPC files only the parts in the box are read, other files are read and
    /// filtered.
    pub bounds: Option<Bounds>,
    /// Thin to points about this far apart, in the unit of the file, above 0; `None`: all points. COPC only.
    pub resolution: Option<f64>,
    /// Metres per unit of the coordinates, overriding the file, above 0; `None`: as the file states.
    pub metres_per_unit: Option<f64>,
    /// Names of the columns of text files, x, y and z among them; empty: those of the header row, or by their number.
    pub text_columns: Vec<String>,
    /// The list that the class codes belong to, overriding what the format says.
    pub scheme: Option<CodeScheme>,
    /// Names of class codes, which take precedence over those in the file.
    pub class_names: ClassNames,
    /// Progress, cancellation and warnings.
    pub monitor: Monitor,
}

impl ReadOptions {
    /// Gives a cloud that was read the unit, the list of its class codes and the names that were asked for.
    ///
    /// # Errors
    /// If its reference system contradicts itself.
    pub(super) fn settle(&self, cloud: &mut Cloud, path: &Path) -> Result<()> {
        if let Some(problem) = cloud.crs.as_deref().and_then(contradiction) {
            return Err(Error::input(format!("{}: {problem}", path.display())));
        }
        cloud.take_unit_from_crs();
        cloud.metres_per_unit = self.metres_per_unit.or(cloud.metres_per_unit);
        if let Some(asked) = self.scheme {
            // What the user says comes before the names in the file.
            cloud.scheme = asked;
            cloud.class_names.clear();
        }
        cloud.class_names.extend(self.class_names.clone());
        Ok(())
    }

    pub(super) fn wants(&self, name: &str) -> bool {
        match &self.columns {
            Columns::All => true,
            Columns::Only(names) => names.iter().any(|n| n == name),
        }
    }

    /// Fails if the box is not ordered, or the resolution or the unit is not above 0.
    pub fn validate(&self) -> Result<()> {
        if let Some(metres) = self.metres_per_unit.filter(|m| !(m.is_finite() && *m > 0.0)) {
            return Err(Error::parameter("metres_per_unit", metres, "a number above 0, finite"));
        }
        if let Some([low, high]) = &self.bounds
            && !low.iter().zip(high).all(|(l, h)| l <= h)
        {
            return Err(Error::parameter("bounds", format!("{low:?} to {high:?}"), "low <= high on each axis, no NaN"));
        }
        match self.resolution {
            Some(r) if !(r.is_finite() && r > 0.0) => Err(Error::parameter("resolution", r, "a number above 0")),
            _ => Ok(()),
        }
    }
}

/// Options of [`write`](fn@super::write) and [`rewrite`](super::rewrite).
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Compress, for formats with a choice: PCD (`binary_compressed`) and npz (deflate). For LAS and LAZ the extension
    /// decides.
    pub compressed: bool,
    /// Scale (step of the stored integers) of LAS and LAZ for x, y and z, in the cloud's unit, finite and above 0;
    /// `None`: that of the input, or one that moves no point by more than a thousandth of the point spacing. Not for
    /// LAS to LAS.
    pub scale: Option<[f64; 3]>,
    /// Names of the columns of the input, if it is text: as in [`ReadOptions`].
    pub text_columns: Vec<String>,
    /// Progress, cancellation and warnings.
    pub monitor: Monitor,
}

impl WriteOptions {
    /// Fails if a scale is not finite and above 0.
    pub fn validate(&self) -> Result<()> {
        match self.scale {
            Some(scale) if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) => {
                Err(Error::parameter("scale", format!("{scale:?}"), "numbers above 0"))
            }
            _ => Ok(()),
        }
    }

    /// The options for reading the input.
    pub(crate) fn reading(&self) -> ReadOptions {
        let (monitor, text_columns) = (self.monitor.clone(), self.text_columns.clone());
        ReadOptions { monitor, text_columns, ..ReadOptions::default() }
    }

    /// Fails if a scale is requested for a copy from LAS to LAS, which keeps its own.
    pub(super) fn keeps_steps(&self) -> Result<()> {
        match self.scale {
            Some(scale) => Err(Error::parameter("scale", format!("{scale:?}"), "none from LAS to LAS: steps are kept")),
            None => Ok(()),
        }
    }
}

/// What [`select`](super::select) writes of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Selection<'a> {
    /// Whether each point is written, in the order of the file; `None`: all are.
    pub kept: Option<&'a [bool]>,
    /// Changes; their values are those of all points of the file, also of those that are not written.
    pub edits: &'a [Edit],
}

impl Selection<'_> {
    /// Fails if there is not one mark for each point of the file.
    pub(super) fn check(&self, points: u64) -> Result<()> {
        match self.kept {
            Some(kept) if kept.len() as u64 != points => {
                Err(Error::input(format!("{} marks of points to keep for {points} points", kept.len())))
            }
            _ => Ok(()),
        }
    }
}
