//! Size, extent and oriented box of each segment, and the means of its points' values.

use super::Partition;
use super::oriented_box::{OrientedBox, span};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::linalg::{Sym3, mean};
use crate::parallel::{Monitor, map_ordered_with};

/// Shape of one segment, in metres relative to the origin of the points.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentShape {
    /// Number of points.
    pub points: usize,
    /// Mean of the points.
    pub centroid: [f64; 3],
    /// Smallest coordinates.
    pub low: [f64; 3],
    /// Largest coordinates.
    pub high: [f64; 3],
    /// A tight box in any orientation.
    pub oriented: OrientedBox,
}

impl SegmentShape {
    /// Side lengths of the box along the axes of the coordinates, in metres.
    pub fn extent(&self) -> [f64; 3] {
        [0, 1, 2].map(|a| self.high[a] - self.low[a])
    }

    /// Highest minus lowest point, in metres.
    pub fn height_range(&self) -> f64 {
        self.high[2] - self.low[2]
    }
}

/// Shape of each segment: bounding boxes, centroid and size, one entry a segment. The oriented box is the one of
/// smaller surface of two candidates: the best upright box, and the box along the principal directions of the points.
/// O(n log n).
///
/// # Errors
/// If the partition is not one of these points.
pub fn segment_shapes(partition: &Partition, points: &Positions) -> Result<Vec<SegmentShape>> {
    same_length(partition, points.len(), "points")?;
    let place = |&i: &u32| {
        let i = i as usize;
        [f64::from(points.x[i]), f64::from(points.y[i]), f64::from(points.z[i])]
    };
    let describe = |own: &mut Vec<[f64; 3]>, segment: usize| {
        own.clear();
        own.extend(partition.members(segment).iter().map(place));
        Ok(shape(own))
    };
    map_ordered_with(0..partition.len(), &Monitor::default(), Vec::new, describe)
}

fn shape(points: &[[f64; 3]]) -> SegmentShape {
    let centroid = mean(points);
    let scatter = Sym3::scatter(points, centroid, points.len().max(1) as f64);
    let spans = [0, 1, 2].map(|a| span(points.iter().map(|p| p[a])));
    SegmentShape {
        points: points.len(),
        centroid,
        low: spans.map(|s| s[0]),
        high: spans.map(|s| s[1]),
        oriented: OrientedBox::tightest(points, &scatter),
    }
}

/// Mean of each column over each segment: `width` values a segment, row after row (features, or red, green and blue).
/// Values that are not finite are left out; the mean of a column without finite values is NaN. O(n · width).
///
/// # Errors
/// If there are not `width` values (at least 1) for each node.
pub fn segment_means(partition: &Partition, values: &[f32], width: usize) -> Result<Vec<f32>> {
    if width == 0 || !values.len().is_multiple_of(width) {
        return Err(Error::input(format!("{} values are no rows of {width} (allowed: 1 or more)", values.len())));
    }
    same_length(partition, values.len() / width, "rows")?;
    let mut means = Vec::with_capacity(partition.len() * width);
    for members in partition.iter() {
        let mut sums = vec![(0.0f64, 0u32); width];
        for &node in members {
            for (sum, &value) in sums.iter_mut().zip(&values[node as usize * width..]) {
                if value.is_finite() {
                    *sum = (sum.0 + f64::from(value), sum.1 + 1);
                }
            }
        }
        means.extend(sums.iter().map(|&(sum, count)| (sum / f64::from(count)) as f32));
    }
    Ok(means)
}

pub(super) fn same_length(partition: &Partition, found: usize, what: &str) -> Result<()> {
    if partition.nodes() == found {
        return Ok(());
    }
    Err(Error::input(format!("{found} {what} for a partition of {} nodes", partition.nodes())))
}

#[cfg(test)]
mod tests {
    use super::super::oriented_box::dot;
    use super::*;

    fn turned_box(sides: [f64; 3], angle: f64) -> Positions {
        let mut points = Positions::default();
        let (s, c) = angle.sin_cos();
        for i in 0..1000 {
            let [u, v, w] = [i % 10, i / 10 % 10, i / 100].map(|k| f64::from(k) / 9.0);
            let [a, b] = [u * sides[0], v * sides[1]];
            points.push([3.0 + c * a - s * b, 5.0 + s * a + c * b, w * sides[2]].map(|v| v as f32));
        }
        points
    }

    #[test]
    fn a_turned_box_has_its_own_sides() {
        for angle in [0.0, 0.4, 1.1] {
            let points = turned_box([8.0, 2.0, 4.0], angle);
            let partition = Partition::from_labels(&[0; 1000]).unwrap();
            let shapes = segment_shapes(&partition, &points).unwrap();
            let SegmentShape { points: count, oriented, .. } = &shapes[0];
            assert_eq!(*count, 1000);
            assert!(oriented.sides.iter().zip([8.0, 4.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-4), "{oriented:?}");
            assert!((oriented.volume() - 64.0).abs() < 0.01);
            assert!(dot(oriented.axes[0], [angle.cos(), angle.sin(), 0.0]).abs() > 0.999_99);
            assert!((0..3).all(|a| (oriented.centre[a] - shapes[0].centroid[a]).abs() < 1e-4));
            assert!((shapes[0].height_range() - 4.0).abs() < 1e-5);
            assert!((shapes[0].extent()[2] - 4.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_point_and_a_pole_have_boxes_too() {
        let points = Positions::from_rows(&[[1.0; 3], [2.0, 2.0, 0.0], [2.0, 2.0, 1.0], [2.0, 2.0, 5.0]]);
        let shapes = segment_shapes(&Partition::from_labels(&[0, 1, 1, 1]).unwrap(), &points).unwrap();
        assert_eq!((shapes[0].oriented.sides, shapes[0].oriented.centre), ([0.0; 3], [1.0; 3]));
        assert_eq!(shapes[1].oriented.sides, [5.0, 0.0, 0.0]);
        assert_eq!((shapes[1].low, shapes[1].high), ([2.0, 2.0, 0.0], [2.0, 2.0, 5.0]));
        assert!(segment_shapes(&Partition::from_labels(&[0; 3]).unwrap(), &points).is_err());
    }

    #[test]
    fn means_leave_out_what_is_not_finite() {
        let partition = Partition::from_labels(&[0, 1, 0]).unwrap();
        let means = segment_means(&partition, &[1.0, 10.0, f32::NAN, 7.0, 3.0, f32::NAN], 2).unwrap();
        assert_eq!((means[0], means[1], means[3]), (2.0, 10.0, 7.0));
        assert!(means[2].is_nan());
        assert!(segment_means(&partition, &[1.0; 5], 2).is_err() && segment_means(&partition, &[1.0; 4], 2).is_err());
    }
}
