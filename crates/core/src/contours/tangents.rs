//! Directions of contours at points.

use super::likely::{Cells, Likely};
use super::params::TangentParams;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::linalg::Sym3;
use crate::neighbours::nearest_of;
use crate::parallel::{Monitor, map_watched, watched};

/// Points whose neighbours are in memory at a time.
const QUERIES: usize = 1 << 19;

/// The direction of the contour at each point: the first principal direction of the nearest most likely points of voxels,
/// weighted by the squares of their likelihoods; zeros for points below the least likelihood and where all are at one
/// position.
///
/// T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.5.1, takes the first
/// eigenvector of all neighbours, which at the crease of two planes is any direction in both. O(n + m log m) for m points
/// above the least likelihood.
///
/// # Errors
/// If there is not one likelihood a point, a position is not finite, a parameter is outside its range, or the work was
/// cancelled.
pub fn tangents(
    positions: &Positions,
    likelihoods: &[f32],
    params: &TangentParams,
    monitor: &Monitor,
) -> Result<Vec<[f32; 3]>> {
    params.validate()?;
    if positions.len() != likelihoods.len() {
        return Err(Error::input(format!("{} likelihoods for {} points", likelihoods.len(), positions.len())));
    }
    let likely = Likely {
        positions: positions.clone(),
        likelihoods: likelihoods.to_vec(),
        tangents: vec![[0.0; 3]; positions.len()],
    };
    likely.check(monitor)?;
    let winners = Cells { size: params.voxel, least: params.least }.winners(&likely, monitor)?;
    let rows: Vec<u32> = winners.iter().map(|winner| winner.point).collect();
    let nodes = likely.select(&rows, monitor)?;
    let mut wanted: Vec<u32> = Vec::new();
    for piece in watched(positions.len(), monitor) {
        wanted.extend(piece?.filter(|&i| f64::from(likelihoods[i]) >= params.least).map(|i| i as u32));
    }
    let mut tangents = likely.tangents;
    for part in wanted.chunks(QUERIES) {
        let near = nearest_of(&nodes.positions, &positions.select(part, monitor)?, params.neighbours, monitor)?;
        let found = map_watched(part.len(), monitor, |at| direction(&nodes, near.of(at)))?;
        part.iter().zip(found).for_each(|(&point, found)| tangents[point as usize] = found);
    }
    Ok(tangents)
}

/// First principal direction of some nodes.
fn direction(nodes: &Likely, rows: &[u32]) -> [f32; 3] {
    let weight = |row: u32| f64::from(nodes.likelihoods[row as usize]).powi(2);
    let place = |row: u32| nodes.positions.xyz(row as usize).map(f64::from);
    let total: f64 = rows.iter().map(|&row| weight(row)).sum();
    if total <= 0.0 {
        return [0.0; 3];
    }
    let centre: [f64; 3] =
        std::array::from_fn(|axis| rows.iter().map(|&row| weight(row) * place(row)[axis]).sum::<f64>() / total);
    let moved = |&row: &u32| {
        let (at, root) = (place(row), weight(row).sqrt());
        std::array::from_fn(|axis| root * (at[axis] - centre[axis]))
    };
    let apart: Vec<[f64; 3]> = rows.iter().map(moved).collect();
    let eigen = Sym3::scatter(&apart, [0.0; 3], total).eigen();
    if eigen.values[0] > 0.0 { eigen.vectors[0].map(|v| v as f32) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_a_crease_the_direction_is_that_of_the_crease() {
        // Two planes that meet along x, likely near it.
        let mut positions = Positions::default();
        let mut likelihoods = Vec::new();
        for (x, s) in (0..60).flat_map(|x| (-20..=20).map(move |s| (x, s as f32 * 0.02))) {
            positions.push([x as f32 * 0.02, s.max(0.0), (-s).max(0.0)]);
            likelihoods.push((1.0 - s.abs() / 0.1).max(0.0));
        }
        let found = tangents(&positions, &likelihoods, &TangentParams::default(), &Monitor::default()).unwrap();
        for (i, tangent) in found.iter().enumerate() {
            match likelihoods[i] {
                p if p < 0.1 => assert_eq!(*tangent, [0.0; 3]),
                _ if (0.3..0.9).contains(&positions.xyz(i)[0]) => assert!(tangent[0].abs() > 0.9, "{i} {tangent:?}"),
                _ => {}
            }
        }
    }

    #[test]
    fn nothing_and_points_at_one_place_have_no_direction() {
        let params = TangentParams::default();
        assert!(tangents(&Positions::default(), &[], &params, &Monitor::default()).unwrap().is_empty());
        let same = Positions::from_rows(&[[1.0; 3]; 5]);
        assert_eq!(tangents(&same, &[0.9; 5], &params, &Monitor::default()).unwrap(), [[0.0; 3]; 5]);
        assert!(tangents(&same, &[0.9; 4], &params, &Monitor::default()).is_err());
    }
}
