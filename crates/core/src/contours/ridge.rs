//! Likely points moved to the edge that they lie beside.
//!
//! A classifier rates all points within some distance of an edge alike, so that the likely points form a band. Each is moved across
//! the band to the mean of those around it, as in U. Ozertem, D. Erdogmus, *Locally defined principal curves and surfaces*,
//! Journal of Machine Learning Research 12, 2011, which thins the band to a curve. That curve runs inside: half a band beside the
//! rim of a surface, and between both surfaces of a crease. The edge is where the likely points end on the side that is away from
//! the surface, and points spread evenly end √3 standard deviations beyond their mean.

use super::likely::{Cells, Likely};
use super::nodes::Nodes;
use super::params::RidgeParams;
use crate::cloud::Positions;
use crate::error::Result;
use crate::linalg::{Eigen3, Sym3};
use crate::neighbours::within;
use crate::parallel::{Monitor, map_watched};

/// Points whose neighbours are in memory at a time.
const QUERIES: usize = 1 << 17;

/// Standard deviations of a neighbourhood at which it is cut off.
const CUT: f64 = 2.5;

/// The likeliest point of each voxel, moved to the edge, with the direction of the edge there; all likely points if there are no
/// passes.
///
/// O(n + m k) for m likely voxels with k others in their neighbourhoods; memory O(m), and O(k) for each of 131,072 of them.
///
/// # Errors
/// If lengths do not fit, a value is not finite or not a likelihood, a parameter is outside its range, the voxels are too small
/// for the extent, or the work was cancelled.
pub fn ridge(likely: &Likely, params: &RidgeParams, monitor: &Monitor) -> Result<Nodes> {
    params.validate()?;
    likely.check(monitor)?;
    if params.passes == 0 {
        return Ok(Nodes { likely: likely.clone(), points: (0..likely.len() as u32).collect() });
    }
    let rows = |least: f64| -> Result<Vec<u32>> {
        let winners = Cells { size: params.voxel, least }.winners(likely, monitor)?;
        let mut rows: Vec<u32> = winners.iter().map(|winner| winner.point).collect();
        rows.sort_unstable();
        Ok(rows)
    };
    let points = rows(params.least)?;
    let band = likely.select(&points, monitor)?;
    let all = likely.positions.select(&rows(0.0)?, monitor)?;
    let mut places = band.positions.clone();
    for pass in 1..=params.passes {
        let surroundings = (pass == params.passes && params.end > 0.0).then_some(&all);
        places = moved(&band, &places, surroundings, &Pass { params, monitor })?;
    }
    let mut found = Likely { positions: places, ..band };
    found.tangents = directions(&found, 2.0 * params.reach, monitor)?;
    Ok(Nodes { likely: found, points })
}

struct Pass<'a> {
    params: &'a RidgeParams,
    monitor: &'a Monitor,
}

/// Places moved to the mean of the band around them; with the points all around, to where the band ends.
fn moved(band: &Likely, places: &Positions, all: Option<&Positions>, pass: &Pass<'_>) -> Result<Positions> {
    let (params, monitor) = (pass.params, pass.monitor);
    let rows: Vec<u32> = (0..places.len() as u32).collect();
    let mut found = Positions::default();
    for part in rows.chunks(QUERIES) {
        let queries = places.select(part, monitor)?;
        let near = within(&band.positions, &queries, CUT * params.reach, monitor)?;
        let around = all.map(|all| within(all, &queries, params.around, monitor)).transpose()?;
        let new = map_watched(part.len(), monitor, |at| {
            let from = queries.xyz(at).map(f64::from);
            let Some(local) = Local::new(band, near.of(at), from, params.reach) else { return queries.xyz(at) };
            let centre = all.zip(around.as_ref()).map(|(all, around)| mean(all, around.of(at)));
            local.edge(from, centre, params.end).map(|v| v as f32)
        })?;
        new.into_iter().for_each(|place| found.push(place));
    }
    Ok(found)
}

/// The direction of a band at each of its points.
fn directions(band: &Likely, reach: f64, monitor: &Monitor) -> Result<Vec<[f32; 3]>> {
    let rows: Vec<u32> = (0..band.len() as u32).collect();
    let mut found = Vec::with_capacity(band.len());
    for part in rows.chunks(QUERIES) {
        let queries = band.positions.select(part, monitor)?;
        let near = within(&band.positions, &queries, CUT * reach, monitor)?;
        found.extend(map_watched(part.len(), monitor, |at| {
            let local = Local::new(band, near.of(at), queries.xyz(at).map(f64::from), reach);
            let along = local.filter(|local| local.spread.values[0] > 0.0).map(|local| local.spread.vectors[0]);
            along.unwrap_or_default().map(|v| v as f32)
        })?);
    }
    Ok(found)
}

/// Mean of some positions.
fn mean(positions: &Positions, rows: &[u32]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for &row in rows {
        sum.iter_mut().zip(positions.xyz(row as usize)).for_each(|(sum, v)| *sum += f64::from(v));
    }
    sum.map(|v| v / rows.len().max(1) as f64)
}

/// The band around a place.
struct Local {
    mean: [f64; 3],
    covariance: Sym3,
    spread: Eigen3,
}

impl Local {
    /// From some points, weighted by the squares of their likelihoods and less with their distance; none if they have no weight.
    fn new(band: &Likely, rows: &[u32], from: [f64; 3], reach: f64) -> Option<Self> {
        let place = |row: u32| band.positions.xyz(row as usize).map(f64::from);
        let weight = |row: u32| {
            let squared: f64 = place(row).iter().zip(from).map(|(a, b)| (a - b).powi(2)).sum();
            f64::from(band.likelihoods[row as usize]).powi(2) * (-squared / (2.0 * reach * reach)).exp()
        };
        let weights: Vec<f64> = rows.iter().map(|&row| weight(row)).collect();
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            return None;
        }
        let mut mean = [0.0; 3];
        for (&row, weight) in rows.iter().zip(&weights) {
            mean.iter_mut().zip(place(row)).for_each(|(sum, v)| *sum += weight * v / total);
        }
        let rooted = |(&row, weight): (&u32, &f64)| {
            let (at, root) = (place(row), weight.sqrt());
            [0, 1, 2].map(|axis| root * (at[axis] - mean[axis]))
        };
        let apart: Vec<[f64; 3]> = rows.iter().zip(&weights).map(rooted).collect();
        let covariance = Sym3::scatter(&apart, [0.0; 3], total);
        Some(Self { mean, covariance, spread: covariance.eigen() })
    }

    /// The place beside this one at the middle of the band, or at its end away from the centre of the surroundings.
    fn edge(&self, from: [f64; 3], centre: Option<[f64; 3]>, end: f64) -> [f64; 3] {
        let along = self.spread.vectors[0];
        let across = |way: [f64; 3]| {
            let ahead = dot(way, along);
            [0, 1, 2].map(|axis| way[axis] - ahead * along[axis])
        };
        let shift = across([0, 1, 2].map(|axis| self.mean[axis] - from[axis]));
        let middle = [0, 1, 2].map(|axis| from[axis] + shift[axis]);
        let Some(centre) = centre else { return middle };
        let outward = across([0, 1, 2].map(|axis| middle[axis] - centre[axis]));
        let length = dot(outward, outward).sqrt();
        if length <= 0.0 {
            return middle;
        }
        let outward = outward.map(|v| v / length);
        let ([xx, yy, zz], [xy, xz, yz], [x, y, z]) = (self.covariance.diagonal, self.covariance.off, outward);
        let variance = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z);
        let reach = end * variance.max(0.0).sqrt();
        [0, 1, 2].map(|axis| middle[axis] + reach * outward[axis])
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A surface whose points are likely near an edge along x: its rim, or the crease with another one.
    fn surface(crease: bool) -> Likely {
        let mut likely = Likely::default();
        for (x, s) in (0..80).flat_map(|x| (0..40).map(move |s| (x, s as f32 * 0.0125 + 0.006))) {
            let sides: &[[f32; 3]] = if crease { &[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] } else { &[[0.0, 1.0, 0.0]] };
            for side in sides {
                likely.positions.push([x as f32 * 0.0125, s * side[1], s * side[2]]);
                likely.likelihoods.push(if s < 0.05 { 0.9 } else { 0.02 });
                likely.tangents.push([1.0, 0.0, 0.0]);
            }
        }
        likely
    }

    #[test]
    fn bands_beside_rims_and_creases_become_the_edge() {
        for crease in [false, true] {
            let likely = surface(crease);
            let found = ridge(&likely, &RidgeParams::default(), &Monitor::default()).unwrap();
            let middle = ridge(&likely, &RidgeParams { end: 0.0, ..Default::default() }, &Monitor::default()).unwrap();
            let apart = |nodes: &Nodes| {
                let inner: Vec<[f32; 3]> =
                    nodes.likely.positions.iter().filter(|p| (0.2..0.8).contains(&p[0])).collect();
                inner.iter().map(|p| p[1].hypot(p[2])).sum::<f32>() / inner.len() as f32
            };
            assert!(apart(&found) < 0.012 && apart(&middle) > 0.015, "{} {}", apart(&found), apart(&middle));
            assert!(found.likely.likelihoods.iter().all(|&p| p == 0.9));
            for (node, &point) in found.points.iter().enumerate() {
                let (new, old) = (found.likely.positions.xyz(node), likely.positions.xyz(point as usize));
                assert!(new.iter().zip(old).all(|(a, b)| (a - b).abs() < 0.08));
                let along = found.likely.tangents[node][0].abs();
                assert!(along > 0.95 || !(0.2..0.8).contains(&new[0]), "{along}");
            }
        }
    }

    #[test]
    fn without_passes_nothing_moves_and_few_points_are_no_trouble() {
        let likely = surface(true);
        let params = RidgeParams { passes: 0, ..Default::default() };
        assert_eq!(ridge(&likely, &params, &Monitor::default()).unwrap().likely, likely);
        for n in [0, 1, 30] {
            let same = Likely {
                positions: Positions::from_rows(&vec![[1.0; 3]; n]),
                likelihoods: vec![0.9; n],
                tangents: vec![[0.0; 3]; n],
            };
            let found = ridge(&same, &RidgeParams::default(), &Monitor::default()).unwrap();
            assert_eq!(found.points, if n == 0 { vec![] } else { vec![0] });
            assert!(found.likely.positions.iter().all(|p| p == [1.0; 3]));
        }
    }

    #[test]
    fn the_same_for_any_number_of_threads() {
        let likely = surface(true);
        let with = |n: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| ridge(&likely, &RidgeParams::default(), &Monitor::default()).unwrap())
        };
        assert_eq!(with(1), with(3));
    }
}
