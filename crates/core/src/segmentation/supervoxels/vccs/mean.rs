//! Means of points and of voxels.

use crate::linalg::Sym3;
use crate::linalg::jacobi::jacobi;
use pulp::{Arch, Simd, WithSimd};

/// Matrices whose eigenvectors are found together.
const LANES: usize = 8;

/// Mean position, normal (unit, any sign) and colour of some points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Voxel {
    pub(super) place: [f32; 3],
    pub(super) normal: [f32; 3],
    pub(super) colour: [f32; 3],
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

    /// True if a normal other than zero was added.
    #[inline(always)]
    fn has_normals(&self) -> bool {
        self.normal.diagonal.iter().sum::<f64>() > 0.0
    }

    /// True if nothing was added.
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    #[inline(always)]
    fn mean(&self, normal: [f32; 3]) -> Voxel {
        let n = f64::from(self.count.max(1));
        Voxel { place: self.place.map(|v| (v / n) as f32), normal, colour: self.colour.map(|v| (v / n) as f32) }
    }
}

/// Writes the mean of each of the sums to `out`; that of an empty sum is the default.
pub(super) fn means(sums: &[Sum], out: &mut [Voxel]) {
    Arch::new().dispatch(Means { sums, out });
}

/// The work of [`means`], compiled for each instruction set.
struct Means<'a> {
    sums: &'a [Sum],
    out: &'a mut [Voxel],
}

impl WithSimd for Means<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (sums, out) in self.sums.chunks(LANES).zip(self.out.chunks_mut(LANES)) {
            let axes = axes(sums);
            for ((sum, slot), axis) in sums.iter().zip(out).zip(axes) {
                *slot = sum.mean(axis);
            }
        }
    }
}

/// The eigenvector of the largest eigenvalue of each sum of normals; unused lanes hold the zero matrix.
#[inline(always)]
fn axes(sums: &[Sum]) -> [[f32; 3]; LANES] {
    let mut axes = [[0.0; 3]; LANES];
    if sums.iter().all(|sum| !sum.has_normals()) {
        return axes;
    }
    let mut matrices = [[0.0; LANES]; 6];
    for (l, sum) in sums.iter().enumerate() {
        for (entry, lanes) in sum.normal.entries().into_iter().zip(&mut matrices) {
            lanes[l] = entry;
        }
    }
    let [first, ..] = jacobi(&matrices).vectors;
    for (l, _) in sums.iter().enumerate().filter(|(_, sum)| sum.has_normals()) {
        axes[l] = [first[0][l] as f32, first[1][l] as f32, first[2][l] as f32];
    }
    axes
}

#[cfg(test)]
mod tests {
    use super::super::super::describe::dot;
    use super::*;
    use crate::random::stream;

    fn mean_of(sum: &Sum) -> Voxel {
        let mut mean = [Voxel::default()];
        means(std::slice::from_ref(sum), &mut mean);
        mean[0]
    }

    #[test]
    fn normals_of_either_sign_have_one_mean_in_any_order() {
        let normals = [[0.6, 0.0, 0.8], [0.6, 0.0, -0.8], [-0.6, 0.0, -0.8], [0.0, 0.6, -0.8], [0.0, -0.6, 0.8]];
        let mean = |order: [usize; 5], sign: f32| {
            let mut sum = Sum::default();
            for i in order {
                let normal = normals[i].map(|v: f32| if i % 2 == 0 { v * sign } else { v });
                sum.add(&Voxel { place: [3.0, 0.0, 1.0], normal, colour: [0.5; 3] });
            }
            mean_of(&sum)
        };
        let expected = mean([0, 1, 2, 3, 4], 1.0);
        assert!((dot(expected.normal, expected.normal) - 1.0).abs() < 1e-6);
        assert_eq!((expected.place, expected.colour), ([3.0, 0.0, 1.0], [0.5; 3]));
        for order in [[4, 3, 2, 1, 0], [2, 0, 4, 1, 3], [1, 4, 0, 3, 2]] {
            for sign in [1.0, -1.0] {
                assert!(dot(mean(order, sign).normal, expected.normal).abs() > 1.0 - 1e-6);
            }
        }
        assert_eq!(mean_of(&Sum::default()), Voxel::default());
    }

    #[test]
    fn the_mean_of_two_directions_is_their_bisector() {
        let mut sum = Sum::default();
        for normal in [[0.0, 0.0, 1.0], [0.0, -0.6, -0.8]] {
            sum.add(&Voxel { normal, ..Voxel::default() });
        }
        let expected = [0.0, 0.6, 1.8].map(|v: f32| v / (0.36f32 + 3.24).sqrt());
        assert!(dot(mean_of(&sum).normal, expected).abs() > 1.0 - 1e-6);
    }

    #[test]
    fn many_means_at_once_are_those_of_each_sum_alone() {
        let mut random = stream(3, 1);
        for count in [1, LANES - 1, LANES, 2 * LANES + 3] {
            let sums: Vec<Sum> = (0..count)
                .map(|i| {
                    let mut sum = Sum::default();
                    (0..i % 4).for_each(|_| {
                        let normal = [0, 1, 2].map(|_| random.uniform() as f32);
                        sum.add(&Voxel { normal, place: normal, ..Voxel::default() });
                    });
                    sum
                })
                .collect();
            let mut found = vec![Voxel::default(); count];
            means(&sums, &mut found);
            for (sum, found) in sums.iter().zip(found) {
                let axis = if sum.has_normals() { sum.normal.eigen().vectors[0].map(|v| v as f32) } else { [0.0; 3] };
                assert_eq!(found, sum.mean(axis));
            }
        }
    }
}
