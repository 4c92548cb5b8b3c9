//! Likely points moved to the edge that they lie beside.
//!
//! A classifier rates all points within some distance of an edge alike, so that the likely points form a band. Each is
//! moved across the band to the mean of those around it, as in U. Ozertem, D. Erdogmus, *Locally defined principal
//! curves and surfaces*, Journal of Machine Learning Research 12, 2011, which thins the band to a curve. That curve
//! does not lie on the edge: at the rim of a surface it runs half the width of the band inside, and at a crease between
//! the two surfaces. The edge is where the likely points end on the side away from the surface; evenly spread points
//! end √3 standard deviations beyond their mean.

use super::likely::{Cells, Likely, Winner};
use super::nodes::Nodes;
use super::params::RidgeParams;
use crate::cloud::Positions;
use crate::error::Result;
use crate::neighbours::Shape;
use crate::neighbours::stacks::Stacks;
use crate::neighbours::sums::{Alike, Around, Gaussian, Surrounding};
use crate::parallel::{Monitor, map_watched, watched};
use crate::voxels::cells::cell_of;
use std::collections::HashSet;

/// The likeliest point of each voxel, moved to the edge, with the direction of the edge there, those that are near each other one
/// after the other; all likely points in their order if there are no passes.
///
/// O(n + m k) for m likely voxels with k others in their neighbourhoods; memory O(m), and O(m) for the voxels of the surface beside
/// them.
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
    let cells = Cells { size: params.voxel, least: params.least };
    let points = points_of(&cells.winners(likely, monitor)?);
    let given = likely.select(&points, monitor)?;
    let band = Band::new(&given, params.reach, monitor)?;
    monitor.stage("edge", params.passes as u64 + 1);
    let mut places = band.stacks.positions.clone();
    for pass in 1..=params.passes {
        let ends = pass == params.passes && params.end > 0.0;
        let surface = ends.then(|| surface(likely, &places, params, monitor)).transpose()?;
        places = moved(&band, &places, surface.as_ref(), &Pass { params, monitor })?;
        monitor.advance(1);
    }
    let mut found = Likely { positions: places, ..given.select(&band.stacks.index, monitor)? };
    found.tangents = directions(&found, 2.0 * params.reach, monitor)?;
    monitor.advance(1);
    let points = map_watched(found.len(), monitor, |node| points[band.stacks.index[node] as usize])?;
    Ok(Nodes { likely: found, points })
}

/// The points of some winners, ascending.
fn points_of(winners: &[Winner]) -> Vec<u32> {
    let mut points: Vec<u32> = winners.iter().map(|winner| winner.point).collect();
    points.sort_unstable();
    points
}

/// The points of the surface around places, likely or not, one of each voxel.
fn surface(likely: &Likely, places: &Positions, params: &RidgeParams, monitor: &Monitor) -> Result<Stacks> {
    let vicinity = Vicinity::new(places, params.around);
    let cells = Cells { size: params.voxel, least: 0.0 };
    let winners = cells.winners_among(likely, |place| vicinity.holds(place), monitor)?;
    Stacks::new(&likely.positions.select(&points_of(&winners), monitor)?, params.around, monitor)
}

/// Cells that hold all places within a radius of some others, and more.
struct Vicinity {
    /// Edge of a cell, metres.
    edge: f64,
    cells: HashSet<[i32; 3]>,
}

impl Vicinity {
    /// O(n).
    fn new(places: &Positions, radius: f64) -> Self {
        // So that rounding excludes no place.
        let edge = radius * (1.0 + 1e-6);
        let own: HashSet<[i32; 3]> = places.iter().map(|place| cell_of(place.map(|v| f64::from(v) / edge))).collect();
        let beside = |cell: [i32; 3], i: i32| {
            let offset = [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1];
            [0, 1, 2].map(|axis| cell[axis].saturating_add(offset[axis]))
        };
        let cells = own.iter().flat_map(|&cell| (0..27).map(move |i| beside(cell, i))).collect();
        Self { edge, cells }
    }

    fn holds(&self, place: [f32; 3]) -> bool {
        self.cells.contains(&cell_of(place.map(|v| f64::from(v) / self.edge)))
    }
}

/// Likely points sorted for sums over those around a place, which count by the squares of their likelihoods.
struct Band {
    stacks: Stacks,
    weights: Vec<f32>,
    /// Standard deviation of a neighbourhood, metres.
    reach: f64,
}

impl Band {
    fn new(likely: &Likely, reach: f64, monitor: &Monitor) -> Result<Self> {
        let stacks = Stacks::new(&likely.positions, Gaussian::radius(reach), monitor)?;
        let weight = |at: usize| likely.likelihoods[stacks.index[at] as usize].powi(2);
        Ok(Self { weights: map_watched(stacks.len(), monitor, weight)?, stacks, reach })
    }

    fn around(&self) -> Around<'_, Gaussian<'_>> {
        Around {
            stacks: &self.stacks,
            radius: Gaussian::radius(self.reach),
            shape: Shape::Sphere,
            weighing: Gaussian::new(&self.weights, self.reach),
        }
    }
}

struct Pass<'a> {
    params: &'a RidgeParams,
    monitor: &'a Monitor,
}

/// Places moved to the mean of the band around them; with the points of the surface, to where the band ends.
fn moved(band: &Band, places: &Positions, surface: Option<&Stacks>, pass: &Pass<'_>) -> Result<Positions> {
    let (params, monitor) = (pass.params, pass.monitor);
    let centres = surface.map(|stacks| {
        let around = Around { stacks, radius: params.around, shape: Shape::Sphere, weighing: Alike };
        around.map(places, monitor, |_, near| (near.weight > 0.0).then_some(near.mean))
    });
    let centres = centres.transpose()?;
    let new = band.around().map(places, monitor, |at, near| {
        let (from, centre) = (places.xyz(at), centres.as_ref().and_then(|centres| centres[at]));
        let by = if near.weight > 0.0 { shift(near, centre, params.end) } else { [0.0; 3] };
        [0, 1, 2].map(|axis| (f64::from(from[axis]) + by[axis]) as f32)
    })?;
    let mut found = Positions::default();
    for piece in watched(new.len(), monitor) {
        new[piece?].iter().for_each(|&place| found.push(place));
    }
    Ok(found)
}

/// The direction of a band at each of its points.
fn directions(likely: &Likely, reach: f64, monitor: &Monitor) -> Result<Vec<[f32; 3]>> {
    let band = Band::new(likely, reach, monitor)?;
    let found = band.around().map(&band.stacks.positions, monitor, |_, near| {
        if near.values[0] > 0.0 { near.axis.map(|v| v as f32) } else { [0.0; 3] }
    })?;
    band.stacks.restored(&found, monitor)
}

/// From a place to the middle of the band beside it, or to its end away from the centre of the surface; all are relative to the
/// place.
fn shift(band: &Surrounding, centre: Option<[f64; 3]>, end: f64) -> [f64; 3] {
    let along = band.axis;
    let across = |way: [f64; 3]| {
        let ahead = dot(way, along);
        [0, 1, 2].map(|axis| way[axis] - ahead * along[axis])
    };
    let middle = across(band.mean);
    let Some(centre) = centre else { return middle };
    let outward = across([0, 1, 2].map(|axis| middle[axis] - centre[axis]));
    let length = dot(outward, outward).sqrt();
    if length <= 0.0 {
        return middle;
    }
    let outward = outward.map(|v| v / length);
    let ([xx, yy, zz], [xy, xz, yz], [x, y, z]) = (band.covariance.diagonal, band.covariance.off, outward);
    let variance = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z);
    let reach = end * variance.max(0.0).sqrt();
    [0, 1, 2].map(|axis| middle[axis] + reach * outward[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

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
    fn points_far_from_the_band_change_nothing() {
        let likely = surface(true);
        let mut more = likely.clone();
        for i in 0..500 {
            more.positions.push([i as f32 * 0.01, 2.0, (i % 7) as f32]);
            more.likelihoods.push(0.05);
            more.tangents.push([0.0; 3]);
        }
        let of = |likely: &Likely| ridge(likely, &RidgeParams::default(), &Monitor::default()).unwrap();
        assert_eq!(of(&more), of(&likely));
    }

    #[test]
    fn the_vicinity_holds_all_places_within_the_radius() {
        let mut random = stream(9, 2);
        let mut place = || [0.0; 3].map(|_: f32| 4.0 * random.uniform() as f32 - 2.0);
        let places: Positions = (0..40).map(|_| place()).collect();
        let vicinity = Vicinity::new(&places, 0.3);
        let mut held = 0;
        for _ in 0..5000 {
            let other = place();
            let near = places.iter().any(|p| (0..3).map(|a| (p[a] - other[a]).powi(2)).sum::<f32>() <= 0.09);
            assert!(vicinity.holds(other) || !near, "{other:?}");
            held += usize::from(vicinity.holds(other));
        }
        assert!((100..3000).contains(&held), "{held}");
        assert!(!Vicinity::new(&Positions::default(), 0.3).holds([0.0; 3]));
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
