//! The points of a cloud in local metres.

use super::Positions;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_watched};

/// Largest distance of a point, or of another origin, from the origin in metres: three squares of it still fit into
/// `f32`.
const FARTHEST: f64 = 1e18;

/// Where local positions are from: which points of a cloud they are, and the origin that was subtracted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LocalFrame {
    /// Index in the cloud of each point, ascending unless others were selected.
    pub index: Vec<u32>,
    /// The subtracted origin, in metres.
    pub origin: [f64; 3],
}

impl LocalFrame {
    /// The row of each point of a cloud of `points` points; 0 for points that have none.
    pub(crate) fn rows(&self, points: usize) -> Vec<u32> {
        let mut rows = vec![0; points];
        self.index.iter().zip(0..).for_each(|(&point, row)| rows[point as usize] = row);
        rows
    }

    /// The frame of the points in these rows, in their order. O(rows), in parallel.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn select(&self, rows: &[u32], monitor: &Monitor) -> Result<Self> {
        let index = map_watched(rows.len(), monitor, |i| self.index[rows[i] as usize])?;
        Ok(Self { index, origin: self.origin })
    }
}

/// Points of a cloud: their positions, and where these are in the cloud and in the world.
///
/// Contains only the finite points of a cloud that are not stray ([`Strays`](super::Strays)) and at most 10^15 km from the
/// origin, beyond which squares overflow `f32`. What needs only coordinates takes [`Positions`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Local coordinates in metres.
    pub positions: Positions,
    /// Index in the cloud of each position, and their origin.
    pub frame: LocalFrame,
}

impl Points {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Where point `i` lies in the world: metres, not relative to the origin.
    #[inline]
    pub fn world(&self, i: usize) -> [f64; 3] {
        let at = self.positions.xyz(i);
        [0, 1, 2].map(|a| f64::from(at[a]) + self.frame.origin[a])
    }

    /// The points in these rows, in their order. O(rows), in parallel.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn select(&self, rows: &[u32], monitor: &Monitor) -> Result<Self> {
        Ok(Self { positions: self.positions.select(rows, monitor)?, frame: self.frame.select(rows, monitor)? })
    }

    /// The same points relative to another origin, in metres: moved in `f64`, rounded to `f32`. Positions of two clouds
    /// can be compared once they have one origin.
    ///
    /// # Errors
    /// If the origins are too far apart for `f32`.
    pub fn moved_to(mut self, origin: [f64; 3]) -> Result<Self> {
        let shift = [0, 1, 2].map(|a| self.frame.origin[a] - origin[a]);
        if !shift.iter().all(|v| v.abs() <= FARTHEST) {
            let found = format!("origins {origin:?} and {:?}", self.frame.origin);
            return Err(Error::input(format!("{found} are too far apart to be compared (allowed: {FARTHEST:e} m)")));
        }
        let Positions { x, y, z } = &mut self.positions;
        for (axis, shift) in [x, y, z].into_iter().zip(shift) {
            axis.iter_mut().for_each(|v| *v = (f64::from(*v) + shift) as f32);
        }
        self.frame.origin = origin;
        Ok(self)
    }
}
