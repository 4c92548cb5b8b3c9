//! The point spacing of a cloud: gives the first scale if the user gives none.

use crate::cloud::Points;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::voxels::{Grid, Search, build_levels, sorted};

/// Number of points whose neighbours are examined.
const SAMPLES: usize = 10_000;
/// Index of the neighbour: on a plane of even density it is about one spacing away, π r² ρ = 4.
const NEIGHBOUR: usize = 4;

/// Median distance, in metres, to the fourth nearest distinct position; 0 if there are fewer than five.
///
/// O(n log n).
///
/// # Errors
/// If the work was cancelled.
pub fn spacing(points: &Points, monitor: &Monitor) -> Result<f64> {
    let distances = spacings(points, monitor)?;
    Ok(distances.get(distances.len() / 2).copied().unwrap_or(0.0))
}

/// Distances, in metres, to the fourth nearest distinct position of at most 10,000 points all over the cloud, ascending; none
/// if there are fewer than five.
///
/// O(n log n).
///
/// # Errors
/// If the work was cancelled.
pub fn spacings(points: &Points, monitor: &Monitor) -> Result<Vec<f64>> {
    let far = points.positions.iter().flatten().fold(0.0f32, |m, v| m.max(v));
    let grid = Grid::new(points, f64::from(far).max(1e-3) / f64::from(1u32 << 20))?;
    let points = sorted(points.clone(), &grid, monitor)?;
    let levels = build_levels(&points.positions, &grid, 1, monitor)?;
    let (Some(level), true) = (levels.first(), points.len() > NEIGHBOUR) else { return Ok(Vec::new()) };
    let mut search = Search::default();
    let mut found = [0; NEIGHBOUR + 1];
    let mut distances = Vec::new();
    for i in (0..points.len()).step_by(points.len().div_ceil(SAMPLES)) {
        let at = points.positions.xyz(i);
        let n = search.nearest(level, at, &mut found);
        let distance = |&j: &u32| {
            let d = [level.x[j as usize] - at[0], level.y[j as usize] - at[1], level.z[j as usize] - at[2]];
            f64::from(d.iter().map(|v| v * v).sum::<f32>()).sqrt()
        };
        if n > NEIGHBOUR {
            distances.push(found.iter().map(distance).fold(0.0, f64::max));
        }
    }
    distances.sort_by(f64::total_cmp);
    Ok(distances)
}

/// The scale 0.025 m times a power of two that is nearest to a spacing (by ratio), from 1/64 of it to 16384 times.
pub(super) fn scale_of(spacing: f64) -> f64 {
    if spacing > 0.0 { 0.025 * (spacing / 0.025).log2().round().clamp(-6.0, 14.0).exp2() } else { 0.025 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    #[test]
    fn the_spacing_of_a_lattice_is_its_step() {
        let rows: Vec<[f64; 3]> = (0..2500).map(|i| [f64::from(i % 50) * 0.3, f64::from(i / 50) * 0.3, 2.0]).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let found = spacing(&points, &Monitor::default()).unwrap();
        assert!((found - 0.3).abs() < 1e-4, "{found}");
        assert!((scale_of(found) - 0.4).abs() < 1e-12);
        let one = Points::from_cloud(&Cloud::from_rows(&[[5.0; 3]; 9]).unwrap(), 1.0);
        assert_eq!(scale_of(spacing(&one, &Monitor::default()).unwrap()), 0.025);
    }
}
