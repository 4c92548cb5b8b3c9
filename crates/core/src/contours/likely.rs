//! Points with their likelihoods of lying on a contour, and the most likely point of each cell.

use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_watched, sort_watched, watched};
use std::collections::HashMap;

/// Points with the likelihood that each lies on a contour.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Likely {
    /// Positions in metres.
    pub positions: Positions,
    /// Likelihood of each point to lie on a contour, 0 to 1.
    pub likelihoods: Vec<f32>,
    /// First principal direction at each point, the direction of a contour there, of any sign; zeros where there is
    /// none.
    pub tangents: Vec<[f32; 3]>,
}

impl Likely {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Checks lengths and ranges. O(n).
    ///
    /// # Errors
    /// If there is not one likelihood from 0 to 1, one finite tangent and one finite position a point, there are 2^32
    /// points or more, or the work was cancelled.
    pub fn check(&self, monitor: &Monitor) -> Result<()> {
        let (points, values, tangents) = (self.len(), self.likelihoods.len(), self.tangents.len());
        if values != points || tangents != points {
            let message =
                format!("{values} likelihoods and {tangents} tangents for {points} points (allowed: one each)");
            return Err(Error::input(message));
        }
        if points >= u32::MAX as usize {
            return Err(Error::input(format!("{points} points; fewer than {} are possible", u32::MAX)));
        }
        for piece in watched(points, monitor) {
            for i in piece? {
                let value = self.likelihoods[i];
                if !(0.0..=1.0).contains(&value) {
                    return Err(Error::input(format!("likelihood {value} of point {i} (allowed: 0 to 1)")));
                }
                if !self.positions.xyz(i).iter().chain(&self.tangents[i]).all(|v| v.is_finite()) {
                    return Err(Error::input(format!(
                        "point {i} at {:?} with tangent {:?} (allowed: finite numbers)",
                        self.positions.xyz(i),
                        self.tangents[i]
                    )));
                }
            }
        }
        Ok(())
    }

    /// The points of these rows, in their order. O(rows).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn select(&self, rows: &[u32], monitor: &Monitor) -> Result<Self> {
        Ok(Self {
            positions: self.positions.select(rows, monitor)?,
            likelihoods: map_watched(rows.len(), monitor, |i| self.likelihoods[rows[i] as usize])?,
            tangents: map_watched(rows.len(), monitor, |i| self.tangents[rows[i] as usize])?,
        })
    }
}

/// The most likely point of a cell, of equal ones the first.
///
/// Sorted by cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Winner {
    /// Cell along each axis; neighbouring cells differ by one.
    pub(super) cell: [u32; 3],
    /// Falls with the likelihood.
    pub(super) rank: u32,
    pub(super) point: u32,
}

/// Which cells have a winner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    /// Edge of a cell, metres; 0: only points at the same position share a cell.
    pub(super) size: f64,
    /// Least likelihood of a winner.
    pub(super) least: f64,
}

impl Cells {
    /// The winner of each cell, ascending by cell. O(n + m log m) expected time and O(m) memory for m cells that
    /// have a winner.
    ///
    /// # Errors
    /// If the cells are too small for the extent, or the work was cancelled.
    pub(super) fn winners(&self, likely: &Likely, monitor: &Monitor) -> Result<Vec<Winner>> {
        self.winners_among(likely, |_| true, monitor)
    }

    /// The winners among the points at these places, as [`Cells::winners`].
    pub(super) fn winners_among(
        &self,
        likely: &Likely,
        among: impl Fn([f32; 3]) -> bool,
        monitor: &Monitor,
    ) -> Result<Vec<Winner>> {
        // Rank and point of the winner of each cell so far.
        let mut best: HashMap<[u32; 3], [u32; 2]> = HashMap::new();
        for piece in watched(likely.len(), monitor) {
            for i in piece? {
                let (value, place) = (likely.likelihoods[i], likely.positions.xyz(i));
                if f64::from(value) >= self.least && among(place) {
                    let own = [!(value + 0.0).to_bits(), i as u32];
                    let winner = best.entry(self.cell(place)?).or_insert(own);
                    *winner = own.min(*winner);
                }
            }
        }
        let mut all: Vec<Winner> = best.into_iter().map(|(cell, [rank, point])| Winner { cell, rank, point }).collect();
        sort_watched(&mut all, monitor)?;
        Ok(all)
    }

    fn cell(&self, at: [f32; 3]) -> Result<[u32; 3]> {
        if self.size <= 0.0 {
            // Adding 0 turns -0 into 0.
            return Ok(at.map(|v| (v + 0.0).to_bits()));
        }
        let index = at.map(|v| (f64::from(v) / self.size).floor());
        if index.iter().any(|v| v.abs() >= f64::from(i32::MAX)) {
            let expected = format!("a size with fewer than 2^31 voxels from the origin to {at:?}");
            return Err(Error::parameter("voxel", self.size, expected));
        }
        Ok(index.map(|v| (v as i32 as u32) ^ (1 << 31)))
    }
}

/// The winners in the 27 cells around one of them, itself among them, ascending by cell. O(log n).
pub(super) fn around(winners: &[Winner], cell: [u32; 3]) -> impl Iterator<Item = usize> + '_ {
    let [x, y, z] = cell;
    let columns = (x.saturating_sub(1)..=x.saturating_add(1))
        .flat_map(move |x| (y.saturating_sub(1)..=y.saturating_add(1)).map(move |y| [x, y]));
    columns.flat_map(move |[x, y]| {
        let first = winners.partition_point(|w| w.cell < [x, y, z.saturating_sub(1)]);
        let last = [x, y, z.saturating_add(1)];
        (first..winners.len()).take_while(move |&at| winners[at].cell <= last)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn winners_and_their_surroundings_equal_brute_force() {
        let mut random = stream(1, 1);
        let rows: Vec<[f32; 3]> = (0..800).map(|_| [0.0; 3].map(|_: f32| random.uniform() as f32 - 0.5)).collect();
        let likelihoods: Vec<f32> = rows.iter().map(|_| (random.below(20) as f32) / 20.0).collect();
        let tangents = vec![[1.0, 0.0, 0.0]; rows.len()];
        let likely = Likely { positions: Positions::from_rows(&rows), likelihoods, tangents };
        let monitor = Monitor::default();
        likely.check(&monitor).unwrap();
        let winners = Cells { size: 0.1, least: 0.3 }.winners(&likely, &monitor).unwrap();
        let cell = |i: usize| rows[i].map(|v| (f64::from(v) / 0.1).floor() as i64);
        for (at, winner) in winners.iter().enumerate() {
            let own = cell(winner.point as usize);
            let best = (0..rows.len())
                .filter(|&i| cell(i) == own)
                .max_by(|&a, &b| likely.likelihoods[a].total_cmp(&likely.likelihoods[b]).then(b.cmp(&a)));
            assert_eq!(best, Some(winner.point as usize));
            let near = |other: &Winner| cell(other.point as usize).iter().zip(own).all(|(a, b)| (a - b).abs() <= 1);
            let expected: Vec<usize> = (0..winners.len()).filter(|&w| near(&winners[w])).collect();
            assert!(expected.contains(&at));
            assert_eq!(around(&winners, winner.cell).collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn winners_of_many_points_in_few_cells_are_those_of_all() {
        let mut random = stream(2, 1);
        let count = 600_000;
        let rows: Vec<[f32; 3]> = (0..count).map(|_| [random.uniform() as f32, random.uniform() as f32, 0.5]).collect();
        let likelihoods: Vec<f32> = (0..count).map(|_| random.below(1 << 20) as f32 / (1 << 20) as f32).collect();
        let tangents = vec![[0.0; 3]; count];
        let likely = Likely { positions: Positions::from_rows(&rows), likelihoods, tangents };
        let left = |place: [f32; 3]| place[0] < 0.5;
        let found = Cells { size: 0.1, least: 0.2 }.winners_among(&likely, left, &Monitor::default()).unwrap();
        let mut best = std::collections::BTreeMap::new();
        for i in (0..count).filter(|&i| left(rows[i]) && f64::from(likely.likelihoods[i]) >= 0.2) {
            let cell = rows[i].map(|v| (f64::from(v) / 0.1) as u32);
            let winner = best.entry(cell).or_insert(i);
            *winner = if likely.likelihoods[i] > likely.likelihoods[*winner] { i } else { *winner };
        }
        assert_eq!(found.iter().map(|w| w.point as usize).collect::<Vec<_>>(), best.into_values().collect::<Vec<_>>());
        assert!((50..60).contains(&found.len()), "{}", found.len());
    }

    #[test]
    fn with_cells_of_size_zero_only_equal_positions_are_one() {
        let likely = Likely {
            positions: Positions::from_rows(&[[0.0; 3], [-0.0, 0.0, 0.0], [0.001, 0.0, 0.0]]),
            likelihoods: vec![0.5, 0.7, 0.2],
            tangents: vec![[0.0; 3]; 3],
        };
        let winners = Cells { size: 0.0, least: 0.1 }.winners(&likely, &Monitor::default()).unwrap();
        assert_eq!(winners.iter().map(|w| w.point).collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn lengths_ranges_and_tiny_cells_are_refused() {
        let one = Likely {
            positions: Positions::from_rows(&[[1e9, 0.0, 0.0]]),
            likelihoods: vec![0.5],
            tangents: vec![[0.0; 3]],
        };
        let refused = |likely: &Likely| likely.check(&Monitor::default()).is_err();
        assert!(!refused(&one) && !refused(&Likely::default()));
        assert!(refused(&Likely { likelihoods: vec![], ..one.clone() }));
        assert!(refused(&Likely { likelihoods: vec![f32::NAN], ..one.clone() }));
        assert!(refused(&Likely { likelihoods: vec![1.5], ..one.clone() }));
        assert!(refused(&Likely { tangents: vec![[f32::INFINITY, 0.0, 0.0]], ..one.clone() }));
        assert!(Cells { size: 1e-3, least: 0.1 }.winners(&one, &Monitor::default()).is_err());
    }
}
