//! Elevation model, and heights of points above it.

use super::membrane::membrane;
use super::smooth::{fill_holes, median};
use crate::cloud::{Height, Points, Raster};
use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor, fill_parts, map_ordered, watched};
use crate::voxels::cells::radix::{Bits, radix_sort};
use serde::{Deserialize, Serialize};

/// Points of a block.
const BLOCK: usize = 16_384;

/// Parameters of the elevation model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ElevationParams {
    /// Edge of a cell, metres; above 0.
    pub cell: f64,
    /// Percentile of the ground points' heights that is the height of a cell; 0..=1. Slightly above 0, so that a few
    /// wrong points have no effect.
    pub percentile: f64,
    /// Width of the median filter in cells; odd, 1..=99. 1 does not smooth.
    pub median: usize,
}

impl Default for ElevationParams {
    /// Guinard & Landrieu 2017 only mention "a simple elevation model"; these values are our choice.
    fn default() -> Self {
        Self { cell: 1.0, percentile: 0.1, median: 3 }
    }
}

impl ElevationParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(self.cell > 0.0 && self.cell.is_finite()) {
            return Err(Error::parameter("cell", self.cell, "metres, above 0"));
        }
        if !(0.0..=1.0).contains(&self.percentile) {
            return Err(Error::parameter("percentile", self.percentile, "0..1"));
        }
        if self.median.is_multiple_of(2) || self.median > 99 {
            return Err(Error::parameter("median", self.median, "an odd number, 1..99"));
        }
        Ok(())
    }
}

/// An elevation model: a raster without holes, bilinearly interpolated between the centres of its cells.
#[derive(Clone, Debug, PartialEq)]
pub struct ElevationModel {
    raster: Raster,
}

impl ElevationModel {
    /// The elevation model below all `points`, from those for which `is_ground` is true.
    ///
    /// The height of a cell is the given percentile of the heights of its ground points (the `⌊p (n − 1)⌋`-th of n,
    /// ascending); holes take the height of the nearest cell that has one; then a median filter smooths. O(n log n +
    /// cells).
    ///
    /// # Errors
    /// If there is no ground point, lengths differ, a parameter is out of range, the extent has too many cells, or the work was
    /// cancelled.
    pub fn fit(points: &Points, is_ground: &[bool], params: &ElevationParams, monitor: &Monitor) -> Result<Self> {
        let surface = surface(&Ground { points, is_ground, params, holes: Holes::Nearest }, monitor)?;
        Ok(Self { raster: surface.raised(points.frame.origin[2]) })
    }

    /// An elevation model from given heights; holes (NaN) take the nearest height.
    ///
    /// # Errors
    /// If there is no height at all, or the work was cancelled.
    pub fn from_raster(raster: Raster, monitor: &Monitor) -> Result<Self> {
        Ok(Self { raster: fill_holes(raster, monitor)? })
    }

    /// The same model in metres, if its numbers are in a unit of that many metres.
    ///
    /// # Errors
    /// If a result is not finite.
    pub fn in_metres(&self, metres: f64) -> Result<Self> {
        Ok(Self { raster: self.raster.clone().in_unit(metres.recip())? })
    }

    /// The raster.
    pub fn raster(&self) -> &Raster {
        &self.raster
    }

    /// Height of the ground at a position in metres (absolute, not relative to an origin).
    pub fn ground(&self, at: [f64; 2]) -> f64 {
        self.raster.bilinear(at)
    }

    /// Height of every point above the ground, metres; negative below it. Points beyond the raster, which are warned of, are
    /// compared with the height at its border. O(n).
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn heights(&self, points: &Points, monitor: &Monitor) -> Result<Vec<f32>> {
        let beyond = map_ordered(points.len().div_ceil(BLOCK), monitor, |block| {
            let mut range = block * BLOCK..((block + 1) * BLOCK).min(points.len());
            Ok(range.any(|i| !self.raster.covers([0, 1].map(|axis| points.world(i)[axis]))))
        })?;
        if beyond.contains(&true) {
            let [[x, y], [right, top]] = self.raster.bounds();
            monitor.warn(format!(
                "points lie beyond the elevation model (x {x:.1} to {right:.1}, y {y:.1} to {top:.1}, metres): heights there are \
                 those above its border"
            ));
        }
        heights_over(&self.raster, points, points.frame.origin[2], monitor)
    }
}

/// What fills cells without ground.
#[derive(Clone, Copy, Debug)]
pub(super) enum Holes {
    /// The nearest height.
    Nearest,
    /// A membrane between their edges, so that the ground below a house on a slope is the slope.
    Membrane,
}

/// Ground points among others, and how they become a surface.
pub(super) struct Ground<'a> {
    pub(super) points: &'a Points,
    /// One a point.
    pub(super) is_ground: &'a [bool],
    pub(super) params: &'a ElevationParams,
    pub(super) holes: Holes,
}

/// Heights of all points above the surface of the ground, as those of [`ElevationModel::fit`], in less memory.
///
/// # Errors
/// As [`ElevationModel::fit`].
pub(super) fn heights_above_surface(ground: &Ground<'_>, monitor: &Monitor) -> Result<Vec<f32>> {
    heights_over(&surface(ground, monitor)?, ground.points, 0.0, monitor)
}

/// Heights of points over a raster. `origin` is the height of the points' origin, in the raster's heights.
fn heights_over<T: Height>(raster: &Raster<T>, points: &Points, origin: f64, monitor: &Monitor) -> Result<Vec<f32>> {
    let mut heights = vec![0.0; points.len()];
    fill_parts(&mut heights, BLOCK, monitor, |block, part| {
        for (height, i) in part.iter_mut().zip(block * BLOCK..) {
            let [x, y, _] = points.world(i);
            *height = (f64::from(points.positions.z[i]) + origin - raster.bilinear([x, y])) as f32;
        }
    })?;
    Ok(heights)
}

/// The surface of the ground above the origin of the points.
fn surface(ground: &Ground<'_>, monitor: &Monitor) -> Result<Raster<f32>> {
    let raster = heights_of_cells(ground, monitor)?;
    let raster = match ground.holes {
        Holes::Nearest => fill_holes(raster, monitor)?,
        Holes::Membrane => membrane(raster, monitor)?,
    };
    match ground.params.median {
        1 => Ok(raster),
        width => median(raster, width, monitor),
    }
}

/// A raster below all points: the percentile of the ground points' heights in each cell, NaN in cells without any.
fn heights_of_cells(ground: &Ground<'_>, monitor: &Monitor) -> Result<Raster<f32>> {
    let Ground { points, is_ground, params, .. } = *ground;
    params.validate()?;
    check_mask(points.len(), is_ground)?;
    if !is_ground.contains(&true) {
        return Err(Error::input("no ground point: name a class that is ground, or give an elevation model"));
    }
    monitor.check()?;
    let Points { positions, frame } = points;
    let low = [&positions.x, &positions.y].map(|axis| axis.iter().fold(f32::INFINITY, |m, &v| m.min(v)));
    let high = [&positions.x, &positions.y].map(|axis| axis.iter().fold(f32::NEG_INFINITY, |m, &v| m.max(v)));
    let world = |v: [f32; 2]| [0, 1].map(|a| f64::from(v[a]) + frame.origin[a]);
    let mut raster = Raster::over(world(low), world(high), params.cell)?;
    // By cell, then by height.
    let key = |i: usize| {
        let [x, y, _] = points.world(i);
        (raster.cell_of([x, y]) as u64) << 32 | u64::from(ascending(positions.z[i]))
    };
    let mut keys = Vec::with_capacity(is_ground.iter().filter(|&&is_ground| is_ground).count());
    for piece in watched(points.len(), monitor) {
        keys.extend(piece?.filter(|&i| is_ground[i]).map(key));
    }
    let bits = Bits { from: 32, count: raster.values().len().ilog2() + 1 };
    radix_sort(&mut keys, bits, |key| *key, monitor)?;
    let mut looks = Looks::at(monitor);
    for cell in keys.chunk_by_mut(|a, b| a >> 32 == b >> 32) {
        looks.steps(cell.len())?;
        let place = (params.percentile * (cell.len() - 1) as f64) as usize;
        let key = *cell.select_nth_unstable(place).1;
        raster.values_mut()[(key >> 32) as usize] = descended(key as u32);
    }
    Ok(raster)
}

/// Checks that a mask has one value a point.
pub(super) fn check_mask(points: usize, mask: &[bool]) -> Result<()> {
    if mask.len() == points { Ok(()) } else { Err(Error::input(format!("{} marks for {points} points", mask.len()))) }
}

/// Bit patterns that sort like the numbers.
fn ascending(v: f32) -> u32 {
    let bits = v.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

fn descended(bits: u32) -> f32 {
    f32::from_bits(if bits >> 31 == 1 { bits & !(1 << 31) } else { !bits })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;

    fn street(slope: f64) -> (Points, Vec<bool>) {
        let mut s = stream(6, 6);
        let mut rows: Vec<[f64; 3]> = (0..20_000)
            .map(|_| {
                let (x, y) = (600_000.0 + s.uniform() * 60.0, 5e6 + s.uniform() * 40.0);
                [x, y, 250.0 + slope * (x - 600_000.0)]
            })
            .collect();
        rows.extend((0..500).map(|_| [600_010.0 + s.uniform() * 3.0, 5e6 + 10.0 + s.uniform() * 3.0, 257.0]));
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        (points, (0..20_500).map(|i| i < 20_000).collect())
    }

    #[test]
    fn a_tilted_road_is_level_within_slope_times_cell() {
        for slope in [0.0, 0.05, 0.3, -0.4] {
            let (points, ground) = street(slope);
            let model =
                ElevationModel::fit(&points, &ground, &ElevationParams::default(), &Monitor::default()).unwrap();
            let heights = model.heights(&points, &Monitor::default()).unwrap();
            let worst = heights[..20_000].iter().fold(0.0f32, |m, h| m.max(h.abs()));
            assert!(f64::from(worst) <= slope.abs() + 1e-4, "slope {slope}: {worst}");
            let roof = 257.0 - 250.0 - slope * 11.5;
            assert!(heights[20_000..].iter().all(|&h| (f64::from(h) - roof).abs() < 2.5 * slope.abs() + 1e-3));
        }
    }

    #[test]
    fn holes_take_the_nearest_ground_and_spikes_are_smoothed() {
        let (points, ground) = street(0.0);
        let west: Vec<bool> = (0..points.len()).map(|i| ground[i] && points.positions.x[i] < 20.0).collect();
        let model = ElevationModel::fit(&points, &west, &ElevationParams::default(), &Monitor::default()).unwrap();
        assert!((model.ground([600_059.0, 5e6 + 3.0]) - 250.0).abs() < 1e-4);
        assert!(model.raster().values().iter().all(|v| (v - 250.0).abs() < 1e-4));
    }

    #[test]
    fn a_raster_of_somebody_else_is_taken_as_it_is() {
        let raster = Raster::new([600_000.0, 5e6], 10.0, 2, vec![240.0, f64::NAN, 240.0, f64::NAN]).unwrap();
        let model = ElevationModel::from_raster(raster, &Monitor::default()).unwrap();
        let (points, _) = street(0.0);
        let heights = model.heights(&points, &Monitor::default()).unwrap();
        assert!((heights[0] - 10.0).abs() < 1e-4 && (heights[20_100] - 17.0).abs() < 1e-4);
    }

    #[test]
    fn what_cannot_be_a_ground_is_refused() {
        let (points, ground) = street(0.0);
        let fit = |mask: &[bool], params: ElevationParams| {
            ElevationModel::fit(&points, mask, &params, &Monitor::default()).map(|_| ()).map_err(|e| e.to_string())
        };
        assert!(fit(&vec![false; points.len()], ElevationParams::default()).unwrap_err().contains("no ground point"));
        assert!(fit(&ground[1..], ElevationParams::default()).is_err());
        for bad in [
            ElevationParams { cell: 0.0, ..ElevationParams::default() },
            ElevationParams { cell: 1e-9, ..ElevationParams::default() },
            ElevationParams { percentile: 1.5, ..ElevationParams::default() },
            ElevationParams { median: 2, ..ElevationParams::default() },
        ] {
            assert!(fit(&ground, bad).is_err());
        }
    }

    #[test]
    fn order_survives_the_change_of_bits() {
        let values = [-3.5f32, -0.0, 0.0, 1e-30, 7.0, f32::MAX];
        assert!(values.windows(2).all(|w| ascending(w[0]) < ascending(w[1])));
        assert!(values.iter().all(|&v| descended(ascending(v)).to_bits() == v.to_bits()));
    }
}
