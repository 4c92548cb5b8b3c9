//! The occupied voxels and their adjacency.

use super::super::PointAttributes;
use crate::cloud::Positions;
use crate::csr::Csr;
use crate::error::{Error, Result};
use crate::linalg::Sym3;
use crate::parallel::Monitor;
use crate::voxels::cells::Cells;
use crate::voxels::rows::{RowGrid, adjacency};
use rayon::prelude::*;

/// Voxels that one task describes.
const BLOCK: usize = 4096;

/// Mean position, normal (unit, any sign) and colour of some points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Voxel {
    pub(super) place: [f32; 3],
    pub(super) normal: [f32; 3],
    pub(super) colour: [f32; 3],
}

/// All occupied voxels.
pub(super) struct Voxels {
    /// Points by voxel.
    pub(super) points: Csr,
    pub(super) voxels: Vec<Voxel>,
    /// For each voxel the occupied ones among the 26 around it.
    pub(super) near: Csr,
}

impl Voxels {
    pub(super) fn new(
        points: &Positions,
        attributes: &PointAttributes<'_>,
        size: f64,
        monitor: &Monitor,
    ) -> Result<Self> {
        let grid = RowGrid::new(points.iter(), size, "voxel")?;
        let cells = Cells::new(points.len(), |i| grid.key(points.xyz(i)), monitor)?;
        let near = adjacency(&cells.keys, monitor)?;
        let points_of = cells.into_groups(points.len())?;
        let mut voxels = vec![Voxel::default(); points_of.len()];
        voxels.par_chunks_mut(BLOCK).enumerate().try_for_each(|(b, block)| {
            monitor.check()?;
            let described = block.iter_mut().zip(b * BLOCK..);
            described.for_each(|(slot, v)| *slot = voxel(points, attributes, points_of.group(v)));
            Ok::<(), Error>(())
        })?;
        Ok(Self { points: points_of, voxels, near })
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.voxels.len()
    }
}

fn voxel(points: &Positions, attributes: &PointAttributes<'_>, members: &[u32]) -> Voxel {
    let mut sum = Sum::default();
    for &i in members {
        let i = i as usize;
        sum.add(&Voxel {
            place: points.xyz(i),
            normal: attributes.normals.map_or([0.0; 3], |n| n[i]),
            colour: attributes.colours.map_or([0.0; 3], |c| c[i]),
        });
    }
    sum.mean()
}

/// Sums for a mean. Normals have no side, so that their mean is the axis of Σ n nᵀ: no order of the sum matters.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    count: u32,
    place: [f64; 3],
    normal: Sym3,
    colour: [f64; 3],
}

impl Sum {
    #[inline(always)]
    pub(super) fn add(&mut self, voxel: &Voxel) {
        self.count += 1;
        let n = voxel.normal.map(f64::from);
        self.place.iter_mut().zip(voxel.place).for_each(|(sum, v)| *sum += f64::from(v));
        self.colour.iter_mut().zip(voxel.colour).for_each(|(sum, v)| *sum += f64::from(v));
        self.normal.diagonal.iter_mut().zip(n).for_each(|(sum, v)| *sum += v * v);
        for (sum, [a, b]) in self.normal.off.iter_mut().zip([[0, 1], [0, 2], [1, 2]]) {
            *sum += n[a] * n[b];
        }
    }

    /// True if nothing was added.
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    pub(super) fn mean(&self) -> Voxel {
        let n = f64::from(self.count.max(1));
        let any = self.normal.diagonal.iter().sum::<f64>() > 0.0;
        Voxel {
            place: self.place.map(|v| (v / n) as f32),
            normal: if any { self.normal.eigen().vectors[0].map(|v| v as f32) } else { [0.0; 3] },
            colour: self.colour.map(|v| (v / n) as f32),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::describe::dot;
    use super::*;

    #[test]
    fn normals_of_either_sign_have_one_mean_in_any_order() {
        let normals = [[0.6, 0.0, 0.8], [0.6, 0.0, -0.8], [-0.6, 0.0, -0.8], [0.0, 0.6, -0.8], [0.0, -0.6, 0.8]];
        let mean = |order: [usize; 5], sign: f32| {
            let mut sum = Sum::default();
            for i in order {
                let normal = normals[i].map(|v: f32| if i % 2 == 0 { v * sign } else { v });
                sum.add(&Voxel { place: [3.0, 0.0, 1.0], normal, colour: [0.5; 3] });
            }
            sum.mean()
        };
        let expected = mean([0, 1, 2, 3, 4], 1.0);
        assert!((dot(expected.normal, expected.normal) - 1.0).abs() < 1e-6);
        assert_eq!((expected.place, expected.colour), ([3.0, 0.0, 1.0], [0.5; 3]));
        for order in [[4, 3, 2, 1, 0], [2, 0, 4, 1, 3], [1, 4, 0, 3, 2]] {
            for sign in [1.0, -1.0] {
                assert!(dot(mean(order, sign).normal, expected.normal).abs() > 1.0 - 1e-6);
            }
        }
        assert_eq!(Sum::default().mean(), Voxel::default());
    }

    #[test]
    fn the_mean_of_two_directions_is_their_bisector() {
        let mut sum = Sum::default();
        for normal in [[0.0, 0.0, 1.0], [0.0, -0.6, -0.8]] {
            sum.add(&Voxel { normal, ..Voxel::default() });
        }
        let expected = [0.0, 0.6, 1.8].map(|v: f32| v / (0.36f32 + 3.24).sqrt());
        assert!(dot(sum.mean().normal, expected).abs() > 1.0 - 1e-6);
    }
}
