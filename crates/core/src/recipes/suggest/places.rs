//! Where each segment lies among all: the ranks of its descriptors.

use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::recipes::segment::Segmented;
use crate::segmentation::{SegmentShape, segment_means, segment_shapes};
use crate::voxels::cells::{Cells, cell_of};

/// Ranks in 0..=1 of a segment's mean linearity, planarity, scattering and verticality, of the sides of its oriented
/// box, and of the heights of its lowest and highest point above the surroundings.
pub(super) type Place = [f64; RANKS];

/// Number of ranks.
const RANKS: usize = 9;

/// Edge of the squares whose lowest points stand for the ground, metres.
const SQUARE: f32 = 4.0;

/// Distance between two places.
pub(super) fn distance(a: &Place, b: &Place) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// The place of each segment among those of at least `fewest` points.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn places(segmented: &Segmented, fewest: usize, monitor: &Monitor) -> Result<Vec<Place>> {
    let (partition, points) = (&segmented.partition, &segmented.points.positions);
    let means = segment_means(partition, &segmented.descriptors.values, segmented.descriptors.width())?;
    let shapes = segment_shapes(partition, points)?;
    let ground = Lowest::new(points, monitor)?;
    let row = |(mean, shape): (&[f32], &SegmentShape)| -> Place {
        let [a, b, c] = shape.oriented.sides;
        let below = ground.around(shape.centroid);
        let [d, e, f, g] = [mean[0], mean[1], mean[2], mean[3]].map(f64::from);
        [d, e, f, g, a, b, c, shape.low[2] - below, shape.high[2] - below]
    };
    let mut rows: Vec<Place> = means.chunks_exact(segmented.descriptors.width()).zip(&shapes).map(row).collect();
    for column in 0..RANKS {
        let large = rows.iter().zip(&shapes).filter(|(_, shape)| shape.points >= fewest);
        let mut sorted: Vec<f64> = large.map(|(row, _)| row[column]).collect();
        sorted.sort_by(f64::total_cmp);
        rows.iter_mut().for_each(|row| row[column] = rank(&sorted, row[column]));
    }
    Ok(rows)
}

/// Share of the sorted values that are smaller than `value`, and half of the equal ones.
fn rank(sorted: &[f64], value: f64) -> f64 {
    let below = sorted.partition_point(|v| v.total_cmp(&value).is_lt());
    let upto = sorted.partition_point(|v| v.total_cmp(&value).is_le());
    (below + upto) as f64 / (2 * sorted.len().max(1)) as f64
}

/// The lowest point of each square in plan.
struct Lowest {
    squares: Cells<[i32; 2]>,
    z: Vec<f32>,
}

impl Lowest {
    fn new(points: &Positions, monitor: &Monitor) -> Result<Self> {
        let square = |i: usize| cell_of([points.x[i] / SQUARE, points.y[i] / SQUARE].map(f64::from));
        let squares = Cells::new(points.len(), square, monitor)?;
        let lowest = |s| squares.of(s).iter().map(|&i| points.z[i as usize]).fold(f32::INFINITY, f32::min);
        let z = (0..squares.len()).map(lowest).collect();
        Ok(Self { squares, z })
    }

    /// The lowest point of the nine squares around a position.
    fn around(&self, at: [f64; 3]) -> f64 {
        let [x, y]: [i32; 2] = cell_of([at[0], at[1]].map(|v| v / f64::from(SQUARE)));
        let nine = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| [x.saturating_add(dx), y.saturating_add(dy)]));
        let known = nine.filter_map(|square| self.squares.keys.binary_search(&square).ok());
        known.map(|s| f64::from(self.z[s])).fold(at[2], f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};

    #[test]
    fn ranks_are_shares_and_equal_values_share_theirs() {
        let sorted = [1.0, 2.0, 2.0, 4.0];
        for (value, expected) in [(0.0, 0.0), (1.0, 0.125), (2.0, 0.5), (3.0, 0.75), (4.0, 0.875), (9.0, 1.0)] {
            assert_eq!(rank(&sorted, value), expected, "{value}");
        }
        assert_eq!(rank(&[], 1.0), 0.0);
    }

    #[test]
    fn heights_are_above_the_lowest_point_around() {
        let rows = [[1.0, 1.0, 5.0], [6.0, 1.0, 2.0], [30.0, 1.0, 0.0], [30.0, 1.5, 9.0]];
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions;
        let lowest = Lowest::new(&points, &Monitor::default()).unwrap();
        let below = |i: usize| lowest.around(points.xyz(i).map(f64::from)) - f64::from(points.z[2]);
        assert_eq!([0, 1, 2, 3].map(below), [2.0, 2.0, 0.0, 0.0]);
        assert_eq!(lowest.around([1e12, 0.0, 7.0]), 7.0);
    }
}
