//! Positions in local metres, as the kernels use them.

use crate::error::Result;
use crate::parallel::{Monitor, map_watched};

/// `f32` coordinates in metres relative to some origin, axis by axis.
///
/// Neighbours, graphs, surfaces and segments depend on nothing else; what a position is in the cloud is known to its
/// [`LocalFrame`](super::LocalFrame).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Positions {
    /// Metres east of the origin.
    pub x: Vec<f32>,
    /// Metres north of the origin.
    pub y: Vec<f32>,
    /// Metres above the origin.
    pub z: Vec<f32>,
}

impl Positions {
    /// The positions of these rows of x, y, z.
    pub fn from_rows(rows: &[[f32; 3]]) -> Self {
        rows.iter().copied().collect()
    }

    /// Number of positions.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// True if there is no position.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// The coordinates of position `i`.
    #[inline(always)]
    pub fn xyz(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }

    /// The coordinates of each position.
    pub fn iter(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        self.x.iter().zip(&self.y).zip(&self.z).map(|((&x, &y), &z)| [x, y, z])
    }

    /// Appends a position.
    pub fn push(&mut self, [x, y, z]: [f32; 3]) {
        self.x.push(x);
        self.y.push(y);
        self.z.push(z);
    }

    /// The positions of these rows, in their order. O(rows), in parallel.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn select(&self, rows: &[u32], monitor: &Monitor) -> Result<Self> {
        let axis = |from: &[f32]| map_watched(rows.len(), monitor, |i| from[rows[i] as usize]);
        Ok(Self { x: axis(&self.x)?, y: axis(&self.y)?, z: axis(&self.z)? })
    }

    /// Makes room for exactly `n` more positions.
    pub(super) fn reserve(&mut self, n: usize) {
        self.x.reserve_exact(n);
        self.y.reserve_exact(n);
        self.z.reserve_exact(n);
    }
}

impl FromIterator<[f32; 3]> for Positions {
    fn from_iter<I: IntoIterator<Item = [f32; 3]>>(rows: I) -> Self {
        let mut positions = Self::default();
        rows.into_iter().for_each(|row| positions.push(row));
        positions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selected_rows_stand_in_the_order_asked_for() {
        let rows = [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]];
        let positions = Positions::from_rows(&rows);
        assert!(positions.iter().eq(rows) && positions.xyz(1) == rows[1]);
        let chosen = positions.select(&[2, 0, 2], &Monitor::default()).unwrap();
        assert_eq!(chosen, Positions::from_rows(&[rows[2], rows[0], rows[2]]));
        assert!(positions.select(&[], &Monitor::default()).unwrap().is_empty());
    }
}
