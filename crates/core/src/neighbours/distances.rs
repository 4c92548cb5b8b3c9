//! Values computed from the distances of each point to its nearest neighbours, without a table of all neighbours.

use super::knn::search::Nearest;
use super::knn::tree::Tree;
use super::knn::{Block, blocks};
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::Monitor;

/// A value for each point, computed from its squared distances (m²) to its `k` nearest other points, the nearest first.
///
/// `k` is reduced to at most one less than the number of points. Neighbours and distances are those of
/// [`knn`](super::knn()), of which only a few blocks are in memory at a time. O(n log n) expected time.
///
/// # Errors
/// If a coordinate is not finite, or the work was cancelled.
///
/// ```
/// use scansion_core::{Cloud, cloud::Points, neighbours::map_distances, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// let cloud = Cloud::from_rows(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])?;
/// let points = Points::from_cloud(&cloud, 1.0).positions;
/// let farthest = map_distances(&points, 2, &Monitor::default(), |squared| squared[1].sqrt())?;
/// assert_eq!(farthest, [3.0, 2.0, 3.0]);
/// # Ok(())
/// # }
/// ```
pub fn map_distances<T: Clone + Default + Send>(
    points: &Positions,
    k: usize,
    monitor: &Monitor,
    value: impl Fn(&[f32]) -> T + Sync + Send,
) -> Result<Vec<T>> {
    let k = k.min(points.len().saturating_sub(1));
    let tree = Tree::new(points, k, monitor)?;
    let mut values = vec![T::default(); points.len()];
    monitor.stage("neighbours", points.len() as u64);
    let kernel = |block: Block, _: &Tree| {
        let mut row = Vec::with_capacity(k);
        let of = |i: usize| {
            row.clear();
            row.extend(block.rows.squared[i * k..(i + 1) * k].iter().map(|&bits| f32::from_bits(bits)));
            value(&row)
        };
        let found: Vec<T> = (0..block.points.len()).map(of).collect();
        Ok((block.points, found))
    };
    blocks(Nearest { tree: &tree, k }, monitor, kernel, |(range, found)| {
        tree.index[range].iter().zip(found).for_each(|(&point, value)| values[point as usize] = value);
    })?;
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::neighbours::knn;
    use crate::random::stream;

    #[test]
    fn distances_are_those_of_the_table_of_neighbours() {
        let mut s = stream(5, 0);
        let rows: Vec<[f64; 3]> = (0..20_000).map(|_| [30.0, 30.0, 2.0].map(|e| s.uniform() * e)).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions;
        let monitor = Monitor::default();
        let table = knn(&points, 7, &monitor).unwrap();
        let found = map_distances(&points, 7, &monitor, <[f32]>::to_vec).unwrap();
        assert!((0..points.len()).all(|i| found[i] == table.squared_distances(i)));
    }

    #[test]
    fn few_points_have_fewer_neighbours() {
        for n in 0..4 {
            let rows: Vec<[f64; 3]> = (0..n).map(|i| [f64::from(i), 0.0, 0.0]).collect();
            let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions;
            let counts = map_distances(&points, 5, &Monitor::default(), <[f32]>::len).unwrap();
            assert_eq!(counts, vec![rows.len().saturating_sub(1); rows.len()]);
        }
    }
}
