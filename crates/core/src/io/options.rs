//! What readers and writers are told.

use crate::error::{Error, Result};
use crate::parallel::Monitor;

/// Which columns are read besides the coordinates.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Columns {
    /// All.
    #[default]
    All,
    /// Those of these names, where the file has them.
    Only(Vec<String>),
}

/// Smallest and largest coordinates, both included, in the file's unit.
pub type Bounds = ([f64; 3], [f64; 3]);

/// Settings of [`read_with`](super::read_with) and [`blocks`](super::blocks()).
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Which columns are read besides the coordinates.
    pub columns: Columns,
    /// Only points in this box; `None`: all. COPC files are read where the box is, others whole and then cut.
    pub bounds: Option<Bounds>,
    /// A thinner cloud whose points are about so far apart, in the file's unit, above 0; `None`: all points. COPC only.
    pub resolution: Option<f64>,
    /// Metres in one unit of the coordinates, whatever the file says, above 0; `None`: as the file says.
    pub metres_per_unit: Option<f64>,
    /// Progress, cancellation and warnings.
    pub monitor: Monitor,
}

impl ReadOptions {
    pub(super) fn wants(&self, name: &str) -> bool {
        match &self.columns {
            Columns::All => true,
            Columns::Only(names) => names.iter().any(|n| n == name),
        }
    }

    /// Fails if the box is not in order, or the resolution or the unit not above 0.
    pub fn validate(&self) -> Result<()> {
        if let Some(metres) = self.metres_per_unit.filter(|m| !(m.is_finite() && *m > 0.0)) {
            return Err(Error::parameter("metres_per_unit", metres, "a number above 0, finite"));
        }
        if let Some((low, high)) = &self.bounds
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

/// Settings of [`write`](fn@super::write) and [`rewrite`](super::rewrite).
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Compress where the format lets one choose: PCD (`binary_compressed`) and npz (deflate). LAS and LAZ go by their
    /// extension.
    pub compressed: bool,
    /// Step of the whole numbers that LAS and LAZ store x, y and z in, in the cloud's unit, finite and above 0; `None`: that of
    /// the input, or one that moves no point by more than a thousandth of the spacing. Not for LAS to LAS.
    pub scale: Option<[f64; 3]>,
    /// Progress, cancellation and warnings.
    pub monitor: Monitor,
}

impl WriteOptions {
    /// Fails if a step is not a number above 0.
    pub fn validate(&self) -> Result<()> {
        match self.scale {
            Some(scale) if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) => {
                Err(Error::parameter("scale", format!("{scale:?}"), "numbers above 0"))
            }
            _ => Ok(()),
        }
    }

    /// Fails if a step is asked for where the records of a LAS file keep theirs.
    pub(super) fn keeps_steps(&self) -> Result<()> {
        match self.scale {
            Some(scale) => Err(Error::parameter("scale", format!("{scale:?}"), "none from LAS to LAS: steps are kept")),
            None => Ok(()),
        }
    }
}
