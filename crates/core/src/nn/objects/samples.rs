//! Samples of objects, and how they become sparse tensors.

use crate::error::{Error, Result};
use crate::nn::sparse::{Shape, SparseTensor};
use crate::random::Stream;
use serde::{Deserialize, Serialize};
use sha2::Digest;

/// Channels and extent of the samples.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectShape {
    /// Number of channels.
    pub channels: usize,
    /// Cells along each axis.
    pub extent: Vec<usize>,
}

/// A sample.
#[derive(Clone, Debug, PartialEq)]
pub enum Sample {
    /// Places (channel by channel, the last axis fastest), ascending, and values.
    Entries(Vec<u64>, Vec<f32>),
    /// Points, which become occupied cells of a cube around them; x, y, z are the axes in this order.
    Points(Vec<[f32; 3]>),
}

/// Objects and their classes.
#[derive(Clone, Debug, PartialEq)]
pub struct Objects {
    /// The shape in cells.
    pub shape: ObjectShape,
    /// The samples.
    pub samples: Vec<Sample>,
    /// Number of the class of each sample; none if they are only to be classified.
    pub labels: Vec<u16>,
}

/// How samples are changed each time before they are learned from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectAugmentation {
    /// Whether they are turned about the last axis: points by any angle, cells by quarters of a turn (which needs a square).
    pub turn: bool,
    /// Whether half of them are mirrored along the first axis.
    pub mirror: bool,
    /// Standard deviation of random shifts of points as a share of the longest side, 0 to 0.5; shifts end at five times as
    /// much.
    pub jitter: f64,
    /// Cells by which cells are moved along each axis, at most.
    pub shift: usize,
}

impl Default for ObjectAugmentation {
    fn default() -> Self {
        Self { turn: true, mirror: false, jitter: 0.01, shift: 0 }
    }
}

impl ObjectAugmentation {
    /// Changes nothing.
    pub const NONE: Self = Self { turn: false, mirror: false, jitter: 0.0, shift: 0 };

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range, also if it does not fit the shape.
    pub fn validate(&self, shape: &ObjectShape) -> Result<()> {
        if !(0.0..=0.5).contains(&self.jitter) {
            return Err(Error::parameter("augment.jitter", self.jitter, "0 to 0.5"));
        }
        let shortest = shape.extent.iter().copied().min().unwrap_or(0);
        match self.shift < shortest {
            true => Ok(()),
            false => Err(Error::parameter("augment.shift", self.shift, format!("below {shortest}"))),
        }
    }
}

impl Objects {
    /// Checks that samples, labels and shape fit together.
    ///
    /// # Errors
    /// Names what does not.
    pub fn validate(&self) -> Result<()> {
        let shape = Shape::new(1, self.shape.channels, &self.shape.extent)?;
        if !self.labels.is_empty() && self.labels.len() != self.samples.len() {
            let found = format!("{} labels for {} samples", self.labels.len(), self.samples.len());
            return Err(Error::input(found));
        }
        let cells = (shape.channels * shape.cells()) as u64;
        for (number, sample) in self.samples.iter().enumerate() {
            let fine = match sample {
                Sample::Entries(keys, values) => {
                    keys.len() == values.len()
                        && keys.is_sorted_by(|a, b| a < b)
                        && keys.last().is_none_or(|&key| key < cells)
                        && values.iter().all(|value| value.is_finite())
                }
                Sample::Points(points) => {
                    self.shape.channels == 1
                        && self.shape.extent.len() == 3
                        && points.iter().flatten().all(|c| c.is_finite())
                }
            };
            if !fine {
                let allowed =
                    "ascending places inside the shape and finite values; points: finite, one channel, 3 axes";
                return Err(Error::input(format!("sample {number} (allowed: {allowed})")));
            }
        }
        Ok(())
    }

    /// Feeds samples and labels to a checksum.
    pub(in crate::nn) fn feed(&self, sum: &mut impl Digest) {
        for sample in &self.samples {
            match sample {
                Sample::Entries(keys, values) => {
                    keys.iter().for_each(|key| sum.update(key.to_le_bytes()));
                    values.iter().for_each(|value| sum.update(value.to_le_bytes()));
                }
                Sample::Points(points) => points.iter().flatten().for_each(|c| sum.update(c.to_le_bytes())),
            }
            sum.update(u64::MAX.to_le_bytes());
        }
        self.labels.iter().for_each(|label| sum.update(label.to_le_bytes()));
    }

    /// A batch of samples as they are, or changed by random draws.
    ///
    /// # Errors
    /// If the keys overflow.
    pub fn batch(
        &self,
        numbers: &[usize],
        augment: &ObjectAugmentation,
        draws: &mut Stream,
    ) -> Result<SparseTensor<f32>> {
        let shape = Shape::new(numbers.len().max(1), self.shape.channels, &self.shape.extent)?;
        let size = (shape.channels * shape.cells()) as u64;
        let (mut keys, mut values) = (Vec::new(), Vec::new());
        for (place, &number) in numbers.iter().enumerate() {
            let base = place as u64 * size;
            match &self.samples[number] {
                Sample::Entries(own, of_own) => {
                    let moved = Moved::draw(&shape, augment, draws);
                    let entries = own.iter().zip(of_own);
                    let inside = entries.filter_map(|(&key, &value)| moved.key(key, &shape).map(|key| (key, value)));
                    inside.for_each(|(key, value)| {
                        keys.push(base + key);
                        values.push(value);
                    });
                }
                Sample::Points(points) => {
                    let occupied = occupied(points, &self.shape.extent, augment, draws);
                    values.resize(values.len() + occupied.len(), 1.0);
                    keys.extend(occupied.into_iter().map(|cell| base + cell));
                }
            }
        }
        SparseTensor::new(shape, keys, values)
    }
}

/// Quarters of a turn, mirroring and shifts of cells.
struct Moved {
    quarters: usize,
    mirror: bool,
    shift: [isize; 4],
}

impl Moved {
    fn draw(shape: &Shape, augment: &ObjectAugmentation, draws: &mut Stream) -> Self {
        let square = shape.extent.len() >= 2 && shape.extent[0] == shape.extent[1];
        let quarters = if augment.turn && square { draws.below(4) } else { 0 };
        let mirror = augment.mirror && draws.below(2) == 1;
        let mut shift = [0; 4];
        if augment.shift > 0 {
            let reach = augment.shift as isize;
            shift.iter_mut().for_each(|s| *s = draws.below(2 * augment.shift + 1) as isize - reach);
        }
        Self { quarters, mirror, shift }
    }

    /// The place of an entry after it was moved, if it lies inside.
    fn key(&self, key: u64, shape: &Shape) -> Option<u64> {
        let cells = shape.cells();
        let (channel, mut cell) = (key as usize / cells, key as usize % cells);
        let mut position = [0usize; 4];
        for (axis, &length) in shape.extent.iter().enumerate().rev() {
            (position[axis], cell) = (cell % length, cell / length);
        }
        if self.mirror {
            position[0] = shape.extent[0] - 1 - position[0];
        }
        for _ in 0..self.quarters {
            (position[0], position[1]) = (position[1], shape.extent[0] - 1 - position[0]);
        }
        let mut moved = 0;
        for (axis, &length) in shape.extent.iter().enumerate() {
            let at = position[axis].checked_add_signed(self.shift[axis]).filter(|&at| at < length)?;
            moved = moved * length + at;
        }
        Some((channel * cells + moved) as u64)
    }
}

/// The cells of a cube around points that hold one or more of them, ascending. The longest side fills the cube; the others
/// lie in its middle.
fn occupied(points: &[[f32; 3]], extent: &[usize], augment: &ObjectAugmentation, draws: &mut Stream) -> Vec<u64> {
    let angle = if augment.turn { draws.uniform() * std::f64::consts::TAU } else { 0.0 };
    let mirror = if augment.mirror && draws.below(2) == 1 { -1.0 } else { 1.0 };
    let (sin, cos) = angle.sin_cos();
    let turned = points.iter().map(|p| {
        let [x, y, z] = p.map(f64::from);
        [(x * cos - y * sin) * mirror, x * sin + y * cos, z]
    });
    let mut all: Vec<[f64; 3]> = turned.collect();
    let side = longest(&all);
    if augment.jitter > 0.0 && side > 0.0 {
        let mut step = || (augment.jitter * draws.normal()).clamp(-5.0 * augment.jitter, 5.0 * augment.jitter) * side;
        all.iter_mut().flatten().for_each(|c| *c += step());
    }
    let (low, high) = bounds(&all);
    let side = longest(&all).max(f64::MIN_POSITIVE);
    let cell = |p: &[f64; 3]| {
        let at = |axis: usize| {
            let centred = (p[axis] - 0.5 * (low[axis] + high[axis])) / side + 0.5;
            ((centred * extent[axis] as f64) as usize).min(extent[axis] - 1)
        };
        ((at(0) * extent[1] + at(1)) * extent[2] + at(2)) as u64
    };
    let mut cells: Vec<u64> = all.iter().map(cell).collect();
    cells.sort_unstable();
    cells.dedup();
    cells
}

/// Lowest and highest coordinates.
fn bounds(points: &[[f64; 3]]) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    (low, high)
}

/// The longest side of the box around points.
fn longest(points: &[[f64; 3]]) -> f64 {
    let (low, high) = bounds(points);
    (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn objects(samples: Vec<Sample>, extent: &[usize]) -> Objects {
        Objects { shape: ObjectShape { channels: 1, extent: extent.to_vec() }, samples, labels: Vec::new() }
    }

    #[test]
    fn points_fill_a_cube_along_their_longest_side() {
        // A rod along z, its ends included.
        let rod = (0..=100).map(|i| [5.0, -3.0, i as f32]).collect();
        let objects = objects(vec![Sample::Points(rod)], &[4, 4, 4]);
        let batch = objects.batch(&[0, 0], &ObjectAugmentation::NONE, &mut stream(0, 0)).unwrap();
        let column = [40, 41, 42, 43];
        let expected: Vec<u64> = column.into_iter().chain(column.map(|key| key + 64)).collect();
        assert_eq!(batch.keys(), expected);
        // It stays a column whatever its turn.
        let turned = ObjectAugmentation { turn: true, ..ObjectAugmentation::NONE };
        let batch = objects.batch(&[0], &turned, &mut stream(0, 1)).unwrap();
        assert_eq!(batch.len(), 4);
    }

    #[test]
    fn four_quarters_of_a_turn_and_two_mirrorings_are_none() {
        let shape = Shape::new(1, 2, &[3, 3, 2]).unwrap();
        let still = [0; 4];
        let (quarter, mirror) =
            (Moved { quarters: 1, mirror: false, shift: still }, Moved { quarters: 0, mirror: true, shift: still });
        for key in 0..36 {
            let mut turned = key;
            (0..4).for_each(|_| turned = quarter.key(turned, &shape).unwrap());
            let mirrored = mirror.key(mirror.key(key, &shape).unwrap(), &shape).unwrap();
            assert_eq!((turned, mirrored), (key, key));
        }
        // (0, 1, z) goes to (1, 2, z).
        assert_eq!(quarter.key(2, &shape), Some((3 + 2) * 2));
        let moved = Moved { quarters: 0, mirror: false, shift: [1, 0, 0, 0] };
        assert_eq!((moved.key(0, &shape), moved.key(17, &shape)), (Some(6), None));
    }

    #[test]
    fn samples_that_do_not_fit_are_named() {
        let wrong = |sample: Sample| objects(vec![sample], &[2, 2]).validate().unwrap_err().to_string();
        assert!(wrong(Sample::Entries(vec![4], vec![1.0])).contains("sample 0"));
        assert!(wrong(Sample::Entries(vec![1, 0], vec![1.0, 1.0])).contains("ascending"));
        assert!(wrong(Sample::Points(vec![[0.0; 3]])).contains("3 axes"));
        assert!(objects(vec![Sample::Entries(vec![0, 3], vec![1.0, 0.5])], &[2, 2]).validate().is_ok());
    }
}
