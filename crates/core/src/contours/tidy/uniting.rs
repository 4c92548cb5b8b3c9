//! Groups of places that are near each other.

use crate::cloud::Positions;
use crate::error::Result;
use crate::neighbours::within;
use crate::parallel::Monitor;

/// The group of each place, and the number of groups: places within `reach` metres are in one group, the nearest first,
/// as long as no side of the box around a group is longer than twice that. O(n log n + m) for m near pairs.
///
/// # Errors
/// If a place is not finite, or the work was cancelled.
pub(super) fn groups(places: &Positions, reach: f64, monitor: &Monitor) -> Result<(Vec<u32>, usize)> {
    let near = within(places, places, reach, monitor)?;
    let mut pairs: Vec<(f32, [u32; 2])> = Vec::new();
    for i in 0..places.len() {
        let row = near.of(i).iter().zip(near.squared_distances(i)).filter(|(j, _)| (i as u32) < **j);
        pairs.extend(row.map(|(&j, &squared)| (squared, [i as u32, j])));
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut growing = Growing {
        parents: (0..places.len() as u32).collect(),
        boxes: places.iter().map(|at| [at, at]).collect(),
        most: (2.0 * reach * (1.0 + 1e-6)) as f32,
    };
    for (count, (_, pair)) in pairs.into_iter().enumerate() {
        if count % 65_536 == 0 {
            monitor.check()?;
        }
        growing.unite(pair);
    }
    let mut numbers = vec![u32::MAX; places.len()];
    let mut count = 0;
    let mut group = |i: u32| {
        let number = &mut numbers[growing.root(i) as usize];
        if *number == u32::MAX {
            (*number, count) = (count, count + 1);
        }
        *number
    };
    let of: Vec<u32> = (0..places.len() as u32).map(&mut group).collect();
    Ok((of, count as usize))
}

/// Groups that grow.
struct Growing {
    /// A place of the same group; the root of a group is its own parent.
    parents: Vec<u32>,
    /// Box around the group of each root.
    boxes: Vec<[[f32; 3]; 2]>,
    /// Longest side of a box, metres.
    most: f32,
}

impl Growing {
    fn root(&mut self, mut at: u32) -> u32 {
        while self.parents[at as usize] != at {
            let above = self.parents[at as usize];
            self.parents[at as usize] = self.parents[above as usize];
            at = above;
        }
        at
    }

    fn unite(&mut self, pair: [u32; 2]) {
        let [a, b] = pair.map(|at| self.root(at));
        let [first, second] = [a, b].map(|at| self.boxes[at as usize]);
        let low: [f32; 3] = std::array::from_fn(|axis| first[0][axis].min(second[0][axis]));
        let high: [f32; 3] = std::array::from_fn(|axis| first[1][axis].max(second[1][axis]));
        if low.iter().zip(high).all(|(low, high)| high - low <= self.most) {
            self.parents[a.max(b) as usize] = a.min(b);
            self.boxes[a.min(b) as usize] = [low, high];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_row_of_near_places_is_several_groups_none_of_them_wide() {
        let places: Positions = (0..60).map(|i| [i as f32 * 0.15, 0.0, 0.0]).collect();
        let (of, count) = groups(&places, 0.2, &Monitor::default()).unwrap();
        assert!(count >= 20 && of.iter().all(|&group| (group as usize) < count));
        for group in 0..count as u32 {
            let along: Vec<f32> = (0..60).filter(|&i| of[i] == group).map(|i| i as f32 * 0.15).collect();
            assert!(along.last().unwrap() - along[0] <= 0.4 + 1e-4, "{along:?}");
        }
        assert_eq!(groups(&Positions::default(), 0.2, &Monitor::default()).unwrap(), (vec![], 0));
    }
}
