//! Noise: points that are farther from their neighbours than others are.
//!
//! R. B. Rusu, Z. C. Marton, N. Blodow, M. Dolha, M. Beetz, *Towards 3D point cloud based object maps for household
//! environments*, Robotics and Autonomous Systems 56(11), 2008, doi:10.1016/j.robot.2008.08.005, section 4.1, for the
//! statistical outliers; the filters of the Point Cloud Library and of PDAL (`filters.outlier`) for both.

use super::{RadiusParams, StatisticalParams};
use crate::cloud::{MetricCloud, Positions};
use crate::error::{Error, Result};
use crate::neighbours::map_distances;
use crate::parallel::Monitor;

/// A method that finds noise, and its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OutlierParams {
    /// [`statistical_outliers`].
    Statistical(StatisticalParams),
    /// [`radius_outliers`].
    Radius(RadiusParams),
}

/// Whether each point is a statistical outlier: the mean distance d to its k nearest other points exceeds μ + m·σ, where
/// μ and σ are mean and standard deviation (with n − 1) of d over all points, and m the multiplier.
///
/// Sums are taken in `f64` in the order of the points: the result does not depend on the number of threads. Equal
/// distances have no outliers. O(n log n) expected time; 8 bytes a point besides the tree.
///
/// # Errors
/// If a coordinate is not finite, a parameter is out of range, or the work was cancelled.
///
/// ```
/// use scansion_core::{Cloud, cloud::Points, filters::statistical_outliers, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// let mut rows: Vec<[f64; 3]> = (0..100).map(|i| [f64::from(i % 10), f64::from(i / 10), 0.0]).collect();
/// rows.push([5.0, 5.0, 30.0]);
/// let points = Points::from_cloud(&Cloud::from_rows(&rows)?, 1.0).positions;
/// let found = statistical_outliers(&points, &Default::default(), &Monitor::default())?;
/// assert!(found[100] && !found[..100].contains(&true));
/// # Ok(())
/// # }
/// ```
pub fn statistical_outliers(points: &Positions, params: &StatisticalParams, monitor: &Monitor) -> Result<Vec<bool>> {
    params.validate()?;
    let mean = |squared: &[f32]| {
        let sum: f64 = squared.iter().map(|&d| f64::from(d).sqrt()).sum();
        sum / squared.len().max(1) as f64
    };
    let distances = map_distances(points, params.neighbours, monitor, mean)?;
    let count = distances.len() as f64;
    let mean = distances.iter().sum::<f64>() / count;
    let squares: f64 = distances.iter().map(|d| (d - mean).powi(2)).sum();
    let limit = mean + params.multiplier * (squares / (count - 1.0)).sqrt();
    // NaN for fewer than two points: nothing exceeds it.
    Ok(distances.into_iter().map(|d| d > limit).collect())
}

/// Whether each point has fewer than `min_neighbours` other points within the radius, which counts as within.
///
/// O(n log n) expected time; one byte a point besides the tree.
///
/// # Errors
/// If a coordinate is not finite, a parameter is out of range, or the work was cancelled.
pub fn radius_outliers(points: &Positions, params: &RadiusParams, monitor: &Monitor) -> Result<Vec<bool>> {
    params.validate()?;
    let limit = (params.radius * params.radius) as f32;
    let few = |squared: &[f32]| squared.get(params.min_neighbours - 1).is_none_or(|&d| d > limit);
    map_distances(points, params.min_neighbours, monitor, few)
}

/// Whether each point of a cloud is noise among the points with `active` set; false for all others.
///
/// Points without finite coordinates and [stray points](crate::cloud::Strays) are noise; they are nobody's neighbours.
///
/// # Errors
/// If `active` has not one value a point, a parameter is out of range, or the work was cancelled.
pub fn outliers(
    scene: &MetricCloud<'_>,
    active: &[bool],
    params: &OutlierParams,
    monitor: &Monitor,
) -> Result<Vec<bool>> {
    if active.len() != scene.cloud.len() {
        return Err(Error::input(format!("{} marks for {} points", active.len(), scene.cloud.len())));
    }
    let all = scene.points(monitor)?;
    let rows: Vec<u32> = (0..all.len() as u32).filter(|&row| active[all.frame.index[row as usize] as usize]).collect();
    let points = if rows.len() == all.len() { all } else { all.select(&rows, monitor)? };
    let found = match params {
        OutlierParams::Statistical(params) => statistical_outliers(&points.positions, params, monitor)?,
        OutlierParams::Radius(params) => radius_outliers(&points.positions, params, monitor)?,
    };
    let mut noise = active.to_vec();
    points.frame.index.iter().zip(found).for_each(|(&point, is_noise)| noise[point as usize] = is_noise);
    Ok(noise)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::random::stream;

    fn positions(rows: &[[f64; 3]]) -> Positions {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0).positions
    }

    /// A rough surface with some points above and below it.
    fn noisy(n: usize) -> Vec<[f64; 3]> {
        let mut s = stream(8, n as u64);
        let of = |i: usize, s: &mut crate::random::Stream| {
            let height = if i.is_multiple_of(40) { 25.0 * (s.uniform() - 0.5) } else { 0.2 * s.uniform() };
            [15.0 * s.uniform(), 15.0 * s.uniform(), height]
        };
        (0..n).map(|i| of(i, &mut s)).collect()
    }

    /// Ascending distances from point `i` to all others.
    fn distances(points: &Positions, i: usize) -> Vec<f64> {
        let at = points.xyz(i);
        let apart = |j: usize| {
            let d = [points.x[j] - at[0], points.y[j] - at[1], points.z[j] - at[2]];
            f64::from(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
        };
        let mut all: Vec<f64> = (0..points.len()).filter(|&j| j != i).map(apart).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    #[test]
    fn statistical_outliers_are_those_of_brute_force() {
        let points = positions(&noisy(1500));
        for (neighbours, multiplier) in [(8, 2.0), (1, 0.5), (20, -0.1), (1000, 1.0)] {
            let mean_of = |i: usize| distances(&points, i)[..neighbours].iter().sum::<f64>() / neighbours as f64;
            let means: Vec<f64> = (0..points.len()).map(mean_of).collect();
            let n = means.len() as f64;
            let mean = means.iter().sum::<f64>() / n;
            let deviation = (means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (n - 1.0)).sqrt();
            let expected: Vec<bool> = means.iter().map(|m| *m > mean + multiplier * deviation).collect();
            let params = StatisticalParams { neighbours, multiplier };
            let found = statistical_outliers(&points, &params, &Monitor::default()).unwrap();
            assert_eq!(found, expected, "{params:?}");
            assert!(found.contains(&true) && found.contains(&false), "{params:?}");
        }
    }

    #[test]
    fn radius_outliers_are_those_of_brute_force() {
        let lattice: Vec<[f64; 3]> = (0..300).map(|i| [f64::from(i % 20), f64::from(i / 20), 0.0]).collect();
        for rows in [noisy(1500), lattice] {
            let points = positions(&rows);
            for (radius, min_neighbours) in [(1.0, 2), (0.5, 4), (1.0, 4), (2.0, 13)] {
                let count = |i: usize| distances(&points, i).into_iter().filter(|d| *d <= radius).count();
                let expected: Vec<bool> = (0..points.len()).map(|i| count(i) < min_neighbours).collect();
                let params = RadiusParams { radius, min_neighbours };
                let found = radius_outliers(&points, &params, &Monitor::default()).unwrap();
                assert_eq!(found, expected, "{params:?}");
            }
        }
    }

    #[test]
    fn equal_distances_and_few_points_have_no_statistical_outliers() {
        let monitor = Monitor::default();
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        for rows in [&square[..], &square[..2], &square[..1], &[], &[[7.0; 3]; 50]] {
            let points = positions(rows);
            let found = statistical_outliers(&points, &StatisticalParams::default(), &monitor).unwrap();
            assert_eq!(found, vec![false; rows.len()]);
            let alone = radius_outliers(&points, &RadiusParams::default(), &monitor).unwrap();
            assert_eq!(alone, vec![rows.len() < 3; rows.len()]);
        }
    }

    #[test]
    fn points_without_a_place_and_stray_points_are_noise_that_moves_no_limit() {
        let mut rows = noisy(2000);
        let monitor = Monitor::default();
        let params = OutlierParams::Statistical(StatisticalParams::default());
        let of = |rows: &[[f64; 3]]| {
            let cloud = Cloud::from_rows(rows).unwrap();
            let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
            outliers(&scene, &vec![true; rows.len()], &params, &monitor).unwrap()
        };
        let before = of(&rows);
        rows.extend([[9e6, 0.0, 0.0], [f64::NAN, 0.0, 0.0]]);
        let after = of(&rows);
        assert_eq!((&after[..2000], &after[2000..]), (&before[..], &[true, true][..]));
    }

    #[test]
    fn points_that_are_not_active_are_no_neighbours() {
        let rows: Vec<[f64; 3]> = (0..6).map(|i| [0.3 * f64::from(i), 0.0, 0.0]).collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        let monitor = Monitor::default();
        let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
        let params = OutlierParams::Radius(RadiusParams { radius: 0.35, min_neighbours: 1 });
        let of = |active: &[bool]| outliers(&scene, active, &params, &monitor).unwrap();
        assert_eq!(of(&[true; 6]), [false; 6]);
        assert_eq!(of(&[true, false, true, false, true, true]), [true, false, true, false, false, false]);
        assert!(outliers(&scene, &[true], &params, &monitor).is_err());
    }

    #[test]
    fn lengths_are_metres_and_threads_change_nothing() {
        let rows = noisy(3000);
        let feet: Vec<[f64; 3]> = rows.iter().map(|p| p.map(|v| v / 0.3048)).collect();
        let monitor = Monitor::default();
        let of = |rows: &[[f64; 3]], metres| {
            let cloud = Cloud::from_rows(rows).unwrap();
            let scene = MetricCloud::new(&cloud, Some(metres), &monitor).unwrap();
            let params = OutlierParams::Radius(RadiusParams::default());
            outliers(&scene, &vec![true; rows.len()], &params, &monitor).unwrap()
        };
        assert_eq!(of(&rows, 1.0), of(&feet, 0.3048));
        let points = positions(&rows);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| statistical_outliers(&points, &StatisticalParams::default(), &monitor)).unwrap()
        };
        assert!(with(1) == with(2) && with(1) == with(5));
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        for params in [
            StatisticalParams { neighbours: 0, ..Default::default() },
            StatisticalParams { neighbours: 1001, ..Default::default() },
            StatisticalParams { multiplier: f64::NAN, ..Default::default() },
        ] {
            assert!(params.validate().is_err(), "{params:?}");
        }
        for params in [
            RadiusParams { radius: 0.0, ..Default::default() },
            RadiusParams { radius: f64::INFINITY, ..Default::default() },
            RadiusParams { min_neighbours: 0, ..Default::default() },
        ] {
            assert!(params.validate().is_err(), "{params:?}");
        }
    }
}
