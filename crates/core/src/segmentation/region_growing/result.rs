//! The grown regions, and the treatment of points without a region.

use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::neighbours::nearest_of;
use crate::parallel::{Looks, Monitor, watched};
use crate::segmentation::Partition;
use serde::{Deserialize, Serialize};

/// Region of each point; points may have none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GrownRegions {
    /// Region of each point from 1 on, numbered by their smallest point; 0 for points that belong to none.
    pub labels: Vec<u32>,
    /// Number of regions.
    pub count: u32,
}

/// Treatment of points without a region when a partition is made.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Leftovers {
    /// Each is a segment of its own.
    Singletons,
    /// Each joins the region of the nearest point that has one.
    #[default]
    Nearest,
}

impl GrownRegions {
    /// Dissolves regions that are too small or too large and numbers the others by their smallest point.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn numbered(
        mut labels: Vec<u32>,
        largest: u32,
        sizes: std::ops::RangeInclusive<u32>,
        monitor: &Monitor,
    ) -> Result<Self> {
        let mut size = vec![0u32; largest as usize + 1];
        for piece in watched(labels.len(), monitor) {
            labels[piece?].iter().for_each(|&l| size[l as usize] += 1);
        }
        let mut looks = Looks::at(monitor);
        let mut number = vec![0u32; size.len()];
        let mut count = 0;
        for label in labels.iter_mut().filter(|label| **label > 0) {
            looks.step()?;
            let old = *label as usize;
            if number[old] == 0 && sizes.contains(&size[old]) {
                count += 1;
                number[old] = count;
            }
            *label = number[old];
        }
        Ok(Self { labels, count })
    }

    /// Share of the points that have a region, 0..=1; 0 for no points.
    pub fn coverage(&self) -> f64 {
        let inside = self.labels.iter().filter(|l| **l > 0).count();
        inside as f64 / self.labels.len().max(1) as f64
    }

    /// The regions as a partition: a segment for every point. O(n), or O(n log n) where leftovers join the nearest
    /// region.
    ///
    /// # Errors
    /// If there are not as many points as labels, a coordinate is not finite, or the work was cancelled.
    pub fn partition(&self, points: &Positions, leftovers: Leftovers, monitor: &Monitor) -> Result<Partition> {
        if points.len() != self.labels.len() {
            let (labels, n) = (self.labels.len(), points.len());
            return Err(Error::input(format!("labels of {labels} points for a cloud of {n}")));
        }
        let mut labels = self.labels.clone();
        if leftovers == Leftovers::Nearest && self.count > 0 {
            let (mut inside, mut outside) = (Vec::new(), Vec::new());
            for piece in watched(points.len(), monitor) {
                piece?.for_each(|i| if self.labels[i] > 0 { inside.push(i as u32) } else { outside.push(i as u32) });
            }
            let (held, left) = (points.select(&inside, monitor)?, points.select(&outside, monitor)?);
            let nearest = nearest_of(&held, &left, 1, monitor)?;
            for (&i, &j) in outside.iter().zip(nearest.indices()) {
                labels[i as usize] = self.labels[inside[j as usize] as usize];
            }
        }
        let mut next = self.count;
        for label in labels.iter_mut().filter(|label| **label == 0) {
            next += 1;
            *label = next;
        }
        Partition::from_labels_watched(&labels, monitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_numbered_by_their_smallest_point_and_small_and_large_ones_vanish() {
        let found = GrownRegions::numbered(vec![0, 5, 2, 2, 5, 1, 3, 3, 3, 3], 5, 2..=3, &Monitor::default()).unwrap();
        assert_eq!((found.labels.as_slice(), found.count), (&[0, 1, 2, 2, 1, 0, 0, 0, 0, 0][..], 2));
        assert_eq!(found.coverage(), 0.4);
        assert_eq!(GrownRegions::default().coverage(), 0.0);
    }

    #[test]
    fn leftovers_are_alone_or_join_the_nearest_region() {
        let x = vec![0.0, 1.0, 2.2, 5.0, 6.0, 3.9];
        let points = Positions { x, y: vec![0.0; 6], z: vec![0.0; 6] };
        let found = GrownRegions { labels: vec![1, 1, 0, 2, 2, 0], count: 2 };
        let segments =
            |found: &GrownRegions, how| found.partition(&points, how, &Monitor::default()).unwrap().segments().to_vec();
        assert_eq!(segments(&found, Leftovers::Singletons), [0, 0, 1, 2, 2, 3]);
        assert_eq!(segments(&found, Leftovers::Nearest), [0, 0, 0, 1, 1, 1]);
        let nothing = GrownRegions { labels: vec![0; 6], count: 0 };
        assert_eq!(segments(&nothing, Leftovers::Nearest), [0, 1, 2, 3, 4, 5]);
        assert!(found.partition(&Positions::default(), Leftovers::Nearest, &Monitor::default()).is_err());
    }
}
