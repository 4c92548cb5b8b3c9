//! The optimal neighbourhood of a point: the number of neighbours with the lowest eigenentropy.

mod lanes;
pub(super) mod params;

use super::knn::search::Nearest;
use super::knn::tree::Tree;
use super::knn::{Block, blocks};
use super::nearest::Neighbours;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::linalg::Eigen3;
use crate::linalg::jacobi::jacobi;
use crate::parallel::{Monitor, map_ordered_with};
use lanes::{Chosen, LANES, Lane, choose};
use params::OptimalParams;
use pulp::{Arch, Simd, WithSimd};

/// Points of a block, if neighbours are given.
const BLOCK: usize = 2048;

/// The optimal neighbourhood of one point.
///
/// Without extent (fewer than three points, or all coincident) entropy and eigenvalues are 0 and the eigenvectors are
/// the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimal {
    /// Number of neighbours, not counting the point itself.
    pub k: u32,
    /// Eigenentropy −Σ x ln x, x = λ / Σλ, of the neighbourhood; 0..=ln 3.
    pub entropy: f64,
    /// Eigenvalues (m²) and eigenvectors of the covariance of the point and its neighbours around their mean, divided by
    /// their number.
    pub eigen: Eigen3,
}

/// The optimal neighbourhood of every point, from given neighbours.
///
/// M. Weinmann, B. Jutzi, S. Hinz, C. Mallet, *Semantic point cloud interpretation based on optimal neighborhoods,
/// relevant features and efficient classifiers*, ISPRS Journal 105, 2015, doi:10.1016/j.isprsjprs.2015.01.016, eq. 3;
/// Guinard & Landrieu 2017, section 2.1. For increasing k the covariance of the point and its k nearest is updated by
/// running sums in `f64`; the k of lowest eigenentropy is taken, and of those that differ by less than 1e-6 the
/// smallest. Neighbourhoods without extent are taken only if there is no other. O(n k_max) time; the result takes 112
/// bytes a point.
///
/// # Errors
/// If a parameter is out of range, the neighbours do not belong to these points, there are fewer than `k_max` of them
/// although there are more points, or the work was cancelled.
pub fn optimal(
    points: &Positions,
    neighbours: &Neighbours,
    params: &OptimalParams,
    monitor: &Monitor,
) -> Result<Vec<Optimal>> {
    params.validate()?;
    let (n, k) = (points.len(), params.k_max.min(points.len().saturating_sub(1)));
    if (neighbours.len() != n && k > 0) || neighbours.k() < k {
        return Err(Error::input(format!(
            "{} neighbours of {} points (needed: at least {k} neighbours of {n} points)",
            neighbours.k(),
            neighbours.len()
        )));
    }
    let wanted = params.wanted(k);
    monitor.stage("optimal neighbourhoods", n as u64);
    let parts = map_ordered_with(0..n.div_ceil(BLOCK), monitor, Vec::new, |rows, block| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(n);
        let mut out = Vec::with_capacity(range.len());
        let row = |i: usize| (i, if k > 0 { &neighbours.of(i)[..k] } else { &[] });
        Arch::new().dispatch(Choose {
            points,
            row: |l| row(range.start + l),
            count: range.len(),
            wanted: &wanted,
            rows,
            out: &mut out,
        });
        monitor.advance(range.len() as u64);
        Ok(out)
    })?;
    Ok(parts.concat())
}

/// Applies `describe` to the optimal neighbourhood of every point; results in the order of the points.
///
/// Bit-identical to [`optimal`] with [`super::knn`], but only the neighbours of a block of points are held at a time:
/// about 25 bytes a point and the results of `describe`.
///
/// # Errors
/// If a parameter is out of range, a coordinate is not finite, or the work was cancelled.
pub fn map_optimal<T: Copy + Default + Send>(
    points: &Positions,
    params: &OptimalParams,
    monitor: &Monitor,
    describe: impl Fn(&Optimal) -> T + Sync + Send,
) -> Result<Vec<T>> {
    params.validate()?;
    let k = params.k_max.min(points.len().saturating_sub(1));
    let tree = Tree::new(points, k, monitor)?;
    let wanted = params.wanted(k);
    let mut all = vec![T::default(); points.len()];
    monitor.stage("optimal neighbourhoods", points.len() as u64);
    let kernel = |block: Block, tree: &Tree| {
        let (mut rows, mut out) = (Vec::new(), Vec::with_capacity(block.points.len()));
        let row = |l: usize| (tree.index[block.points.start + l] as usize, &block.rows.index[l * k..(l + 1) * k]);
        Arch::new().dispatch(Choose {
            points,
            row,
            count: block.points.len(),
            wanted: &wanted,
            rows: &mut rows,
            out: &mut out,
        });
        Ok((block.points, out.iter().map(&describe).collect::<Vec<T>>()))
    };
    blocks(Nearest { tree: &tree, k }, monitor, kernel, |(range, values)| {
        tree.index[range].iter().zip(values).for_each(|(&point, value)| all[point as usize] = value);
    })?;
    Ok(all)
}

/// Finds the optimal neighbourhoods of a block, compiled for each instruction set. `row` gives a point and its
/// neighbours.
struct Choose<'a, F> {
    points: &'a Positions,
    row: F,
    count: usize,
    wanted: &'a [u32],
    rows: &'a mut Vec<[Lane; 3]>,
    out: &'a mut Vec<Optimal>,
}

impl<'r, F: Fn(usize) -> (usize, &'r [u32])> WithSimd for Choose<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Positions { x, y, z } = self.points;
        for first in (0..self.count).step_by(LANES) {
            let lanes = LANES.min(self.count - first);
            for l in 0..LANES {
                // Unused lanes repeat the last point.
                let (i, near) = (self.row)(first + l.min(lanes - 1));
                let at = [x[i], y[i], z[i]].map(f64::from);
                self.rows.resize(near.len(), [[0.0; LANES]; 3]);
                for (row, &j) in self.rows.iter_mut().zip(near) {
                    let j = j as usize;
                    row[0][l] = f64::from(x[j]) - at[0];
                    row[1][l] = f64::from(y[j]) - at[1];
                    row[2][l] = f64::from(z[j]) - at[2];
                }
            }
            let chosen = choose(self.rows, self.wanted);
            describe(&chosen, lanes, self.out);
        }
    }
}

#[inline(always)]
fn describe(chosen: &Chosen, lanes: usize, out: &mut Vec<Optimal>) {
    let eigen = jacobi(&chosen.matrix);
    for l in 0..lanes {
        out.push(Optimal {
            k: chosen.rows[l] as u32,
            entropy: if chosen.entropy[l].is_finite() { chosen.entropy[l].max(0.0) } else { 0.0 },
            eigen: Eigen3 {
                values: [eigen.values[0][l], eigen.values[1][l], eigen.values[2][l]],
                vectors: [0, 1, 2].map(|i| [0, 1, 2].map(|a| eigen.vectors[i][a][l])),
            },
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::linalg::{Sym3, mean};
    use crate::neighbours::knn;
    use crate::random::stream;

    fn points(rows: &[[f64; 3]]) -> Positions {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0).positions
    }

    fn find(points: &Positions, params: &OptimalParams) -> Vec<Optimal> {
        let near = knn(points, params.k_max, &Monitor::default()).unwrap();
        let found = optimal(points, &near, params, &Monitor::default()).unwrap();
        let streamed = map_optimal(points, params, &Monitor::default(), |o| Some(*o)).unwrap();
        assert!(found.iter().zip(&streamed).all(|(a, b)| Some(*a) == *b) && found.len() == streamed.len());
        found
    }

    /// Reference: two passes in f64 over the point and its `k` nearest.
    fn twin(points: &Positions, i: usize, row: &[u32]) -> (f64, Eigen3) {
        let at = |j: usize| points.xyz(j).map(f64::from);
        let members: Vec<[f64; 3]> = [i].into_iter().chain(row.iter().map(|&j| j as usize)).map(at).collect();
        let eigen = Sym3::scatter(&members, mean(&members), members.len() as f64).eigen();
        let sum: f64 = eigen.values.iter().sum();
        let terms = eigen.values.map(|v| if v > 0.0 { -v / sum * (v / sum).ln() } else { 0.0 });
        (if sum > 0.0 { terms.iter().sum() } else { f64::INFINITY }, eigen)
    }

    fn check(rows: &[[f64; 3]], params: &OptimalParams) {
        let points = points(rows);
        let near = knn(&points, params.k_max, &Monitor::default()).unwrap();
        let wanted = params.wanted(near.k());
        for (i, found) in find(&points, params).iter().enumerate() {
            let all: Vec<(f64, u32)> =
                wanted.iter().map(|&k| (twin(&points, i, &near.of(i)[..k as usize]).0, k)).collect();
            let least = all.iter().fold(f64::INFINITY, |m, e| e.0.min(m));
            assert!((found.entropy - least).abs() < 1.1e-6, "point {i}: {} for {least}", found.entropy);
            let smallest = all.iter().find(|e| e.0 <= least + 2.2e-6).unwrap();
            assert!(found.k >= smallest.1, "point {i}: {} although {smallest:?}", found.k);
            assert!(all.iter().any(|e| e.1 == found.k && e.0 < least + 1.1e-6), "point {i}");
            let eigen = twin(&points, i, &near.of(i)[..found.k as usize]).1;
            for a in 0..3 {
                let apart = (found.eigen.values[a] - eigen.values[a]).abs();
                assert!(apart <= 1e-6 * eigen.values[a] + 1e-13 * eigen.values[0], "point {i}: {found:?} {eigen:?}");
            }
        }
    }

    fn scene(n: usize) -> Vec<[f64; 3]> {
        let mut s = stream(21, n as u64);
        let mut rows: Vec<[f64; 3]> =
            (0..n).map(|_| [s.uniform() * 9.0, s.uniform() * 9.0, s.uniform() * 0.02]).collect();
        rows.extend((0..n / 4).map(|_| [s.uniform() * 0.05, 4.0, s.uniform() * 8.0]));
        rows.extend((0..n / 4).map(|_| [5.0 + s.uniform(), 5.0 + s.uniform(), 2.0 + s.uniform()]));
        rows.extend((0..n / 10).map(|_| [700.0 + s.uniform(), 5.0, 2.0]));
        rows
    }

    #[test]
    fn the_choice_is_the_least_entropy_by_brute_force() {
        check(&scene(400), &OptimalParams::default());
        check(&scene(300), &OptimalParams { k_min: 5, k_max: 60, k_step: 7, ..OptimalParams::default() });
        check(&scene(90), &OptimalParams { k_max: 1000, ..OptimalParams::default() });
    }

    #[test]
    fn a_planar_lattice_has_the_entropy_of_two_equal_eigenvalues() {
        let rows: Vec<[f64; 3]> = (0..1681).map(|i| [f64::from(i % 41), f64::from(i / 41), 3.0]).collect();
        let params = OptimalParams { k_min: 8, k_max: 8, ..OptimalParams::default() };
        let found = find(&points(&rows), &params);
        // Away from the border the 8 nearest form a square around the point.
        assert!((found[20 * 41 + 20].entropy - std::f64::consts::LN_2).abs() < 1e-12);
        assert_eq!(found[20 * 41 + 20].eigen.values[2], 0.0);
    }

    #[test]
    fn equal_entropies_choose_the_smallest_neighbourhood() {
        let line: Vec<[f64; 3]> =
            (0..300).map(|i| [f64::from(i) * 0.3, f64::from(i) * 0.7, f64::from(i) * 0.1]).collect();
        assert!(find(&points(&line), &OptimalParams::default()).iter().all(|o| o.k == 10 && o.entropy < 1e-6));
    }

    #[test]
    fn the_choice_does_not_change_with_the_unit() {
        let cloud = points(&scene(300));
        let times = |factor: f32| {
            let axis = |v: &[f32]| v.iter().map(|v| v * factor).collect();
            Positions { x: axis(&cloud.x), y: axis(&cloud.y), z: axis(&cloud.z) }
        };
        let params = OptimalParams::default();
        let (one, other) = (find(&cloud, &params), find(&times(1024.0), &params));
        assert!(one.iter().zip(&other).all(|(a, b)| a.k == b.k && (a.entropy - b.entropy).abs() < 1e-14));
        let other = find(&times(1000.0), &params);
        let same = one.iter().zip(&other).filter(|(a, b)| a.k == b.k).count();
        assert!(same * 100 >= one.len() * 99, "{same} of {}", one.len());
        assert!(one.iter().zip(&other).all(|(a, b)| (a.entropy - b.entropy).abs() < 1e-4));
    }

    #[test]
    fn neighbourhoods_without_extent_have_defined_values() {
        let params = OptimalParams::default();
        for rows in [vec![], vec![[1.0; 3]], vec![[1.0; 3], [2.0, 1.0, 1.0]], vec![[4.0; 3]; 200]] {
            for found in find(&points(&rows), &params) {
                assert!(found.entropy == 0.0 && found.eigen.values == [0.0; 3], "{found:?}");
                assert!(found.k == if rows.len() > 2 { 10 } else { 0 });
            }
        }
        let three = find(&points(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), &params);
        assert!(three.iter().all(|o| o.k == 2 && (o.eigen.values[0] - 1.0 / 3.0).abs() < 1e-12));
        let mut pile = vec![[4.0; 3]; 30];
        pile.extend((0..30).map(|i| [4.0 + f64::from(i), 4.0, 5.0]));
        assert!(find(&points(&pile), &params).iter().all(|o| o.entropy.is_finite() && o.eigen.values[0] > 0.0));
    }

    #[test]
    fn too_few_neighbours_are_refused() {
        let cloud = points(&scene(60));
        let near = knn(&cloud, 20, &Monitor::default()).unwrap();
        let run = |params: &OptimalParams| optimal(&cloud, &near, params, &Monitor::default());
        assert!(run(&OptimalParams::default()).unwrap_err().to_string().contains("at least 95"));
        assert!(run(&OptimalParams { k_max: 20, ..OptimalParams::default() }).is_ok());
        assert!(matches!(
            run(&OptimalParams { k_step: 0, ..OptimalParams::default() }),
            Err(Error::InvalidParameter { .. })
        ));
    }

    #[test]
    fn the_choice_is_the_same_for_any_number_of_threads_and_instructions() {
        let points = points(&scene(9000));
        let params = OptimalParams { k_max: 30, ..OptimalParams::default() };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| map_optimal(&points, &params, &Monitor::default(), |o| Some(*o))).unwrap()
        };
        let one = with(1);
        assert!(one == with(2) && one == with(3));
        let near = knn(&points, 30, &Monitor::default()).unwrap();
        let (mut rows, mut out) = (Vec::new(), Vec::new());
        let wanted = params.wanted(30);
        let row = |i: usize| (i, near.of(i));
        let kernel = Choose { points: &points, row, count: 500, wanted: &wanted, rows: &mut rows, out: &mut out };
        pulp::Scalar::new().vectorize(kernel);
        assert!(out.iter().zip(&one).all(|(a, b)| Some(*a) == *b));
    }
}
