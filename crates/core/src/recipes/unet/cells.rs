//! Points in cells: the sites of the network, and their inputs.

use super::inputs::OWN;
use crate::error::Result;
use crate::nn::sites::Sites;
use crate::parallel::{Monitor, sort_watched};

/// Points of one or several samples that are to be put into cells.
#[derive(Default)]
pub(super) struct Gathered {
    /// Key of the cell of each point.
    pub(super) keys: Vec<u64>,
    /// Place of each point in its cell, −1/2 to 1/2.
    pub(super) places: Vec<[f32; 3]>,
    /// Further numbers of each point, row-major.
    pub(super) numbers: Vec<f32>,
}

impl Gathered {
    /// Adds a point of a sample at a position in units of cells, 0 or more.
    ///
    /// # Errors
    /// If it lies beyond the largest cell.
    pub(super) fn push(&mut self, sample: u32, at: [f64; 3], numbers: &[f32]) -> Result<()> {
        let cell = at.map(f64::floor);
        self.keys.push(Sites::<3>::key(sample, cell.map(|c| c as i64))?);
        self.places.push([0, 1, 2].map(|a: usize| (at[a] - cell[a] - 0.5) as f32));
        self.numbers.extend_from_slice(numbers);
        Ok(())
    }
}

/// The occupied cells.
pub(super) struct Cells {
    pub(super) sites: Sites<3>,
    /// Cell of each point.
    pub(super) of_point: Vec<u32>,
    /// Inputs of each cell, row-major.
    pub(super) inputs: Vec<f32>,
}

impl Cells {
    /// The cells of these points; `width` is the count of further numbers of a point.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn new(points: &Gathered, width: usize, monitor: &Monitor) -> Result<Self> {
        let mut order: Vec<(u64, u32)> = points.keys.iter().copied().zip(0..).collect();
        sort_watched(&mut order, monitor)?;
        let channels = OWN + width;
        let (mut keys, mut of_point, mut inputs) = (Vec::new(), vec![0; order.len()], Vec::new());
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            let first = inputs.len();
            inputs.resize(first + channels, 0.0);
            let sums = &mut inputs[first..];
            for &(_, point) in group {
                of_point[point as usize] = keys.len() as u32;
                let place = points.places[point as usize].iter();
                let numbers = points.numbers[point as usize * width..][..width].iter();
                sums[1..4].iter_mut().zip(place).for_each(|(sum, v)| *sum += v);
                sums[OWN..].iter_mut().zip(numbers).for_each(|(sum, v)| *sum += v);
            }
            let count = group.len() as f32;
            sums.iter_mut().for_each(|sum| *sum /= count);
            (sums[0], sums[4]) = (1.0, (1.0 + count).ln() / 3.0);
            keys.push(group[0].0);
        }
        Ok(Self { sites: Sites::of_keys(keys, monitor)?, of_point, inputs })
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.sites.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_hold_the_means_of_their_points() {
        let mut points = Gathered::default();
        points.push(0, [3.25, 0.5, 7.0], &[2.0]).unwrap();
        points.push(0, [0.5, 0.5, 0.5], &[-1.0]).unwrap();
        points.push(0, [3.75, 0.5, 7.5], &[4.0]).unwrap();
        let cells = Cells::new(&points, 1, &Monitor::default()).unwrap();
        assert_eq!((cells.len(), &cells.of_point[..]), (2, &[1, 0, 1][..]));
        let count = |n: f32| (1.0 + n).ln() / 3.0;
        assert_eq!(cells.inputs, [1.0, 0.0, 0.0, 0.0, count(1.0), -1.0, 1.0, 0.0, 0.0, -0.25, count(2.0), 3.0]);
        assert!(points.push(0, [-0.5, 0.0, 0.0], &[0.0]).is_err());
    }
}
