//! The band that the likely points of a class form around a point: how long, wide and thick it is, and where the point lies
//! in it.

use super::{Rated, RatedPoint};
use crate::error::Result;
use crate::linalg::Spread;
use crate::parallel::{Monitor, concat_watched, map_ordered};
use crate::voxels::cells::Cells;
use crate::voxels::cells::index::{CellIndex, block_of};
use crate::voxels::rows::{RowGrid, neighbours};

/// Cells of a block.
const BLOCK: usize = 4096;

/// Number of values of a class.
pub(super) const VALUES: usize = 7;

/// The bands around the voxels of one size.
#[derive(Clone, Debug)]
pub(super) struct Bands {
    size: f32,
    classes: usize,
    grid: RowGrid,
    index: CellIndex<u64>,
    /// Those around each voxel, one a class.
    bands: Vec<Band>,
}

/// The points of 3 x 3 x 3 voxels, each with the weight of its probability.
#[derive(Clone, Copy, Debug, Default)]
struct Band {
    /// Largest probability; 0: there is no band.
    most: f32,
    /// Standard deviations along the principal axes, descending, metres.
    deviations: [f32; 3],
    mean: [f32; 3],
    /// First principal axis, a unit vector.
    axis: [f32; 3],
}

/// The points of a class in a voxel, or around it.
#[derive(Clone, Copy, Debug, Default)]
struct Weighted {
    spread: Spread,
    most: f32,
}

impl Weighted {
    fn join(&mut self, other: &Self) {
        self.spread.join(&other.spread);
        self.most = self.most.max(other.most);
    }

    fn band(&self) -> Band {
        if self.most <= 0.0 {
            return Band::default();
        }
        let shape = self.spread.eigen();
        Band {
            most: self.most,
            deviations: shape.values.map(|value| value.max(0.0).sqrt() as f32),
            mean: self.spread.mean.map(|v| v as f32),
            axis: shape.vectors[0].map(|v| v as f32),
        }
    }
}

impl Bands {
    /// O(n log n); 44 bytes a cell and class.
    pub(super) fn new(rated: &Rated<'_>, size: f64, monitor: &Monitor) -> Result<Self> {
        let (points, classes) = (rated.points, rated.classes);
        let grid = RowGrid::new(points.iter(), size, "context.bands")?;
        let cells = Cells::new(points.len(), |i| grid.key(points.xyz(i)), monitor)?;
        let blocks = cells.len().div_ceil(BLOCK);
        let own = map_ordered(blocks, monitor, |b| {
            let class = |cell: usize, class: usize| {
                let mut sum = Weighted::default();
                for &point in cells.of(cell) {
                    let most = rated.row(point as usize)[class];
                    let spread = Spread::weighted(points.xyz(point as usize).map(f64::from), f64::from(most));
                    sum.join(&Weighted { spread, most });
                }
                sum
            };
            Ok(block_of(b, BLOCK, cells.len())
                .flat_map(|cell| (0..classes).map(move |c| [cell, c]))
                .map(|[cell, c]| class(cell, c))
                .collect::<Vec<_>>())
        })?;
        let own = concat_watched(own, monitor)?;
        let bands = map_ordered(blocks, monitor, |b| {
            let range = block_of(b, BLOCK, cells.len());
            let mut around = vec![Weighted::default(); range.len() * classes];
            neighbours(&cells.keys, range, |place, near| {
                let sums = around[place * classes..][..classes].iter_mut();
                sums.zip(&own[near as usize * classes..]).for_each(|(sum, own)| sum.join(own));
            });
            Ok(around.iter().map(Weighted::band).collect::<Vec<_>>())
        })?;
        let bands = concat_watched(bands, monitor)?;
        Ok(Self { size: size as f32, classes, grid, index: CellIndex::new(cells.keys), bands })
    }

    /// The voxels of some points.
    pub(super) fn cells(&self, points: &[RatedPoint<'_>]) -> Vec<Option<u32>> {
        self.index.find_each(&points.iter().map(|point| self.grid.key(point.at)).collect::<Vec<_>>())
    }

    /// Of a point in this voxel, each for all classes: the largest probability, length, width and thickness of the band, the
    /// distances of the point from its line and from its middle, and the point's probability as a share of the largest.
    /// Lengths are in voxels. NaN where there is no band.
    pub(super) fn describe<'a>(&self, point: RatedPoint<'_>, cell: Option<u32>, out: &'a mut Vec<f32>) -> &'a [f32] {
        let RatedPoint { at, own } = point;
        out.resize(VALUES * self.classes, 0.0);
        for class in 0..self.classes {
            let band =
                cell.map(|cell| &self.bands[cell as usize * self.classes + class]).filter(|band| band.most > 0.0);
            let values = band.map_or([f32::NAN; VALUES], |band| self.values(band, at, own[class]));
            values.into_iter().enumerate().for_each(|(k, value)| out[k * self.classes + class] = value);
        }
        out
    }

    fn values(&self, band: &Band, at: [f32; 3], own: f32) -> [f32; VALUES] {
        let apart: [f32; 3] = std::array::from_fn(|axis| at[axis] - band.mean[axis]);
        let squared: f32 = apart.iter().map(|v| v * v).sum();
        let along: f32 = apart.iter().zip(band.axis).map(|(a, b)| a * b).sum();
        let across = (squared - along * along).max(0.0).sqrt();
        let [length, width, thickness] = band.deviations.map(|deviation| deviation / self.size);
        [band.most, length, width, thickness, across / self.size, squared.sqrt() / self.size, own / band.most]
    }
}
