//! The four local descriptors of a point in its optimal neighbourhood (Guinard & Landrieu 2017, section 2.1).

use super::definition::Group;
use super::table::FeatureTable;
use crate::cloud::Positions;
use crate::error::Result;
use crate::linalg::Eigen3;
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::Shape;
use crate::neighbours::{Eigenvalues, Neighbours, Optimal, OptimalParams, map_optimal, optimal};
use crate::parallel::Monitor;

/// Descriptors of all points in their optimal neighbourhoods.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OptimalFeatures {
    /// One row a point; columns are the features of [`Group::Optimal`].
    pub table: FeatureTable,
    /// Size of the optimal neighbourhood, not counting the point itself.
    pub k: Vec<u32>,
}

/// Linearity, planarity, scattering and verticality of every point in its optimal neighbourhood, in the order of the points.
///
/// S. Guinard, L. Landrieu, *Weakly supervised segmentation-aided classification of urban scenes from 3D LiDAR point
/// clouds*, ISPRS Archives XLII-1/W1, 2017, doi:10.5194/isprs-archives-XLII-1-W1-151-2017, section 2.1: see [`optimal`]
/// for the neighbourhood and [`local_descriptors`] for the formulas. Returns a table with one row a point and the size
/// of each neighbourhood. Only the neighbours of a block of points are held at a time: about 50 bytes a point in all.
/// O(n (log n + k_max)) expected time.
///
/// # Errors
/// If a parameter is out of range, a coordinate is not finite, or the work was cancelled.
///
/// ```
/// use scansion_core::{Cloud, cloud::Points, features::optimal_features, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// let wall: Vec<[f64; 3]> = (0..900).map(|i| [f64::from(i % 30), 0.0, f64::from(i / 30)]).collect();
/// let points = Points::from_cloud(&Cloud::from_rows(&wall)?, 1.0).positions;
/// let found = optimal_features(&points, &Default::default(), &Monitor::default())?;
/// let middle = found.table.row(15 * 30 + 15);
/// assert_eq!(middle[2], 0.0); // no scattering on a plane
/// # Ok(())
/// # }
/// ```
pub fn optimal_features(points: &Positions, params: &OptimalParams, monitor: &Monitor) -> Result<OptimalFeatures> {
    Ok(collect(map_optimal(points, params, monitor, |found| (local_descriptors(&found.eigen, params), found.k))?))
}

/// [`optimal_features`] from given neighbours.
///
/// # Errors
/// As [`optimal`].
pub fn optimal_features_of(
    points: &Positions,
    neighbours: &Neighbours,
    params: &OptimalParams,
    monitor: &Monitor,
) -> Result<OptimalFeatures> {
    let found = optimal(points, neighbours, params, monitor)?;
    let row = |o: &Optimal| (local_descriptors(&o.eigen, params), o.k);
    Ok(collect(found.iter().map(row).collect()))
}

fn collect(rows: Vec<([f32; 4], u32)>) -> OptimalFeatures {
    let names = Group::Optimal.names().collect();
    let k = rows.iter().map(|r| r.1).collect();
    let values = rows.into_iter().flat_map(|r| r.0).collect();
    OptimalFeatures { table: FeatureTable { names, values }, k }
}

/// Linearity, planarity, scattering and verticality from eigenvalues and eigenvectors; all 0 if λ1 is 0.
///
/// Verticality: v_m = Σ λ_j |(e_j)_m| for m = x, y, z; v_z / ‖v‖. Known values: horizontal plane or line 0, vertical
/// line 1, vertical plane with λ1 = λ2 exactly 1/√2. It always uses λ, whatever the others use.
pub fn local_descriptors(eigen: &Eigen3, params: &OptimalParams) -> [f32; 4] {
    let Eigen3 { values, vectors } = eigen;
    if values[0] <= 0.0 {
        return [0.0; 4];
    }
    let used = match params.eigenvalues {
        Eigenvalues::Raw => *values,
        Eigenvalues::Sqrt => values.map(f64::sqrt),
    };
    let v = [0, 1, 2].map(|m| (0..3).map(|j| values[j] * vectors[j][m].abs()).sum::<f64>());
    let length = v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let verticality = if length > 0.0 { params.verticality_factor * v[2] / length } else { 0.0 };
    let shape = Shape::of::<Exact>(used);
    [shape.linearity, shape.planarity, shape.scattering, verticality].map(|value| value as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::linalg::{Sym3, mean};
    use crate::neighbours::knn;
    use crate::random::stream;

    fn of(rows: &[[f64; 3]]) -> [f32; 4] {
        local_descriptors(&Sym3::scatter(rows, mean(rows), rows.len() as f64).eigen(), &OptimalParams::default())
    }

    fn near(found: f32, expected: f64) -> bool {
        (f64::from(found) - expected).abs() < 1e-6
    }

    /// A disc spanned by u and v, whose two eigenvalues are equal.
    fn disc(u: [f64; 3], v: [f64; 3]) -> Vec<[f64; 3]> {
        let turn = |i: i32| std::f64::consts::TAU * f64::from(i) / 12.0;
        (0..12).map(|i| [0, 1, 2].map(|a| 5.0 + turn(i).cos() * u[a] + turn(i).sin() * v[a])).collect()
    }

    #[test]
    fn verticality_has_its_closed_forms() {
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        assert!(near(of(&disc(x, y))[3], 0.0));
        for azimuth in [0.0f64, 0.3, 1.0, 2.5] {
            let along = [azimuth.cos(), azimuth.sin(), 0.0];
            assert!(near(of(&disc(along, z))[3], 0.5f64.sqrt()), "{azimuth}");
            let line: Vec<[f64; 3]> = (0..9).map(|i| along.map(|v| v * f64::from(i))).collect();
            assert!(near(of(&line)[3], 0.0));
        }
        let pole: Vec<[f64; 3]> = (0..9).map(|i| [3.0, 4.0, f64::from(i)]).collect();
        assert!(near(of(&pole)[3], 1.0));
        for tilt in [0.2f64, 0.7, 1.2] {
            // Eigenvectors along slope and strike, with nearly equal eigenvalues.
            let slope = [1.000_001 * tilt.cos(), 0.0, 1.000_001 * tilt.sin()];
            let found = f64::from(of(&disc(slope, y))[3]);
            assert!((found - tilt.sin() / 2.0f64.sqrt()).abs() < 1e-5, "{tilt}: {found}");
        }
        let octahedron: Vec<[f64; 3]> = [x, y, z].into_iter().flat_map(|u| [u, u.map(|v: f64| -v)]).collect();
        assert!(near(of(&octahedron)[3], 1.0 / 3.0f64.sqrt()));
    }

    #[test]
    fn shares_of_a_box_follow_from_its_eigenvalues() {
        // Corners of a box of 6 x 4 x 2: variances 9, 4, 1.
        let side = |i: usize, a: usize| if i >> a & 1 == 1 { 3.0 - a as f64 } else { a as f64 - 3.0 };
        let rows: Vec<[f64; 3]> = (0..8).map(|i| [side(i, 0), side(i, 1), side(i, 2)]).collect();
        let eigen = Sym3::scatter(&rows, [0.0; 3], 8.0).eigen();
        let raw = local_descriptors(&eigen, &OptimalParams::default());
        assert!(near(raw[0], 5.0 / 9.0) && near(raw[1], 3.0 / 9.0) && near(raw[2], 1.0 / 9.0));
        let spg = local_descriptors(&eigen, &OptimalParams::preset("spg").unwrap());
        assert!(near(spg[0], 1.0 / 3.0) && near(spg[1], 1.0 / 3.0) && near(spg[2], 1.0 / 3.0));
        assert!(near(spg[3], 2.0 * f64::from(raw[3])));
    }

    #[test]
    fn the_first_three_sum_to_one_and_the_table_equals_that_of_given_neighbours() {
        let mut s = stream(31, 0);
        let mut rows: Vec<[f64; 3]> =
            (0..3000).map(|_| [s.uniform() * 20.0, s.uniform() * 20.0, s.uniform()]).collect();
        rows.extend(vec![[900.0, 900.0, 900.0]; 150]);
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions;
        let params = OptimalParams { k_max: 40, ..OptimalParams::default() };
        let found = optimal_features(&points, &params, &Monitor::default()).unwrap();
        for i in 0..3000 {
            let row = found.table.row(i);
            assert!((row[0] + row[1] + row[2] - 1.0).abs() < 1e-6 && row.iter().all(|v| (0.0..=1.0).contains(v)));
        }
        assert!((3000..3150).all(|i| found.table.row(i) == [0.0; 4]));
        let near = knn(&points, 40, &Monitor::default()).unwrap();
        assert!(found == optimal_features_of(&points, &near, &params, &Monitor::default()).unwrap());
        let none = optimal_features(&Positions::default(), &params, &Monitor::default()).unwrap();
        assert!(none.table.values.is_empty() && none.k.is_empty());
    }
}
