//! Choice of the LAS scale (step of the stored integers) for clouds with floating-point coordinates.

use crate::cloud::{Cloud, Coordinates, StrayParams, Strays, rounding};
use crate::error::{Error, Result};
use crate::io::WriteOptions;
use crate::parallel::{Monitor, map_ordered, sort_watched, watched};
use crate::voxels::morton;

/// How LAS stores coordinates: as whole numbers t, of which each stands for `scale * t + offset`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LasFrame {
    /// Step of each axis, above 0.
    pub scale: [f64; 3],
    /// Origin of each axis.
    pub offset: [f64; 3],
}

/// Number of points handled at a time.
const PIECE: usize = 1 << 16;

/// Usual steps: of lengths, of degrees, and of heights beside degrees.
const LENGTH: f64 = 1e-3;
const DEGREE: f64 = 1e-7;

/// Largest displacement of a point by rounding, as a share of the point spacing.
const ALLOWED: f64 = 1e-3;

/// The finest power of ten tried, about that of the smallest numbers; the offset ends the search long before.
const FINEST: i32 = -300;

/// Number of powers of ten tried above the usual step if the extent needs it.
const COARSER: i32 = 6;

/// The cloud's own integers if it has them, or the requested scale. Otherwise millimetres (1e-7 degrees) times a power
/// of ten: smaller if points would move by more than a thousandth of their spacing, larger if the extent needs it and
/// they would not.
///
/// # Errors
/// If no step fulfils both, the requested one does not fit the extent, or the work was cancelled.
pub(super) fn frame(cloud: &Cloud, options: &WriteOptions) -> Result<LasFrame> {
    if let (Coordinates::Scaled { scale, offset, .. }, None) = (cloud.coordinates(), options.scale) {
        return Ok(LasFrame { scale: *scale, offset: *offset });
    }
    let monitor = &options.monitor;
    let [low, high] = cloud.bounds_watched(monitor)?.unwrap_or([[0.0; 3]; 2]);
    let axes = [0, 1, 2].map(|a| Axis { a, low: low[a], high: high[a] });
    if let Some(scale) = options.scale {
        let mut offset = [0.0; 3];
        for axis in &axes {
            let fitting = axis.offset(scale[axis.a]).ok_or_else(|| axis.too_long(scale[axis.a]));
            offset[axis.a] = fitting?;
        }
        return Ok(LasFrame { scale, offset });
    }
    let degrees = cloud.is_in_degrees();
    let plan = degrees || may_be_degrees(cloud, &axes);
    let mut spacings = [None, None];
    let mut frame = LasFrame::default();
    for axis in &axes {
        let (height, usual) = (axis.a == 2, if degrees && axis.a < 2 { DEGREE } else { LENGTH });
        let spacing = || -> Result<f64> {
            match (height && degrees, usize::from(plan && !height)) {
                // With degrees and metres there is no common distance; millimetres of height are kept.
                (true, _) => Ok(LENGTH / ALLOWED),
                (false, of) => match spacings[of] {
                    Some(known) => Ok(known),
                    None => Ok(*spacings[of].insert(spacing(cloud, of == 1, monitor)?)),
                },
            }
        };
        let (scale, offset) = axis.choose(cloud, usual, spacing, monitor)?;
        (frame.scale[axis.a], frame.offset[axis.a]) = (scale, offset);
    }
    Ok(frame)
}

/// Whether a cloud without a unit and less than one unit wide may be in degrees: then heights say nothing about its
/// spacing.
fn may_be_degrees(cloud: &Cloud, axes: &[Axis; 3]) -> bool {
    let narrow = |axis: &Axis, most: f64| axis.low >= -most && axis.high <= most && axis.high - axis.low < 1.0;
    cloud.unit_is_unknown() && narrow(&axes[0], 180.0) && narrow(&axes[1], 90.0)
}

/// One axis, and the kind of its coordinates.
struct Axis {
    a: usize,
    low: f64,
    high: f64,
}

impl Axis {
    fn choose(
        &self,
        cloud: &Cloud,
        usual: f64,
        mut spacing: impl FnMut() -> Result<f64>,
        monitor: &Monitor,
    ) -> Result<(f64, f64)> {
        let mut finest = None;
        // Powers of ten are parsed from text: 1e-4 is the nearest number, 1e-3 / 10 may not be.
        let exponent = usual.log10().round() as i32;
        let steps = (FINEST..=exponent).rev().chain(exponent + 1..=exponent + COARSER);
        let fitting = steps.filter_map(|e| format!("1e{e}").parse::<f64>().ok()).filter_map(|scale| {
            // Larger steps are only for extents that the usual one cannot represent.
            let wanted = scale <= usual || self.offset(usual).is_none();
            self.offset(scale).filter(|_| wanted).map(|offset| (scale, offset))
        });
        for (scale, offset) in fitting {
            let loss = self.loss(cloud, scale, offset, monitor)?;
            if finest.is_none_or(|(least, _)| loss < least) {
                finest = Some((loss, scale));
            }
            if loss <= 0.0 || loss <= ALLOWED * spacing()? {
                return Ok((scale, offset));
            }
        }
        Err(match finest {
            Some((loss, scale)) => self.too_coarse(loss, scale, spacing()?),
            None => self.too_long(usual),
        })
    }

    /// The offset with which all coordinates fit into 32 bits: an integer below the lowest, or in the middle.
    fn offset(&self, scale: f64) -> Option<f64> {
        let most = f64::from(i32::MAX);
        let (below, middle) = (self.low.floor(), (self.low + (self.high - self.low) / 2.0).floor());
        let fits = |offset: f64| (self.high - offset) / scale <= most && (offset - self.low) / scale <= most;
        [below, middle].into_iter().find(|&offset| fits(offset))
    }

    /// The largest displacement of a coordinate.
    fn loss(&self, cloud: &Cloud, scale: f64, offset: f64, monitor: &Monitor) -> Result<f64> {
        // Displacements below the precision of the number itself do not count.
        let noise = rounding(self.low.abs().max(self.high.abs()));
        let finite = |v: f64| if v.is_finite() { moved(v, scale, offset) } else { 0.0 };
        let most = map_ordered(cloud.len().div_ceil(PIECE), monitor, |piece| {
            let points = piece * PIECE..((piece + 1) * PIECE).min(cloud.len());
            Ok(match cloud.coordinates() {
                Coordinates::Float(axes) => axes[self.a][points].iter().map(|&v| finite(v)).fold(0.0, f64::max),
                Coordinates::Scaled { .. } => points.map(|i| finite(cloud.xyz(i)[self.a])).fold(0.0, f64::max),
            })
        })?;
        Ok((most.into_iter().fold(0.0, f64::max) - noise).max(0.0))
    }

    fn name(&self) -> char {
        ['x', 'y', 'z'][self.a]
    }

    fn too_long(&self, scale: f64) -> Error {
        let Self { low, high, .. } = self;
        let least = (high - low) / (2.0 * f64::from(i32::MAX));
        Error::input(format!(
            "{} reaches from {low} to {high}; with a scale of {scale} that does not fit LAS: give a scale above {least:.1e} \
             (--scale) or cut the cloud (convert --bounds)",
            self.name()
        ))
    }

    fn too_coarse(&self, loss: f64, scale: f64, spacing: f64) -> Error {
        let Self { low, high, .. } = self;
        Error::input(format!(
            "{}: LAS would move points by up to {loss:.1e}, more than a thousandth of their spacing of {spacing:.1e}; a step \
             below {scale:e} does not fit its 32 bits from {low} to {high}: accept the loss with --scale {scale:e} (scale= in \
             Python), cut the cloud (convert --bounds), or write another format",
            self.name()
        ))
    }
}

/// How far a coordinate is moved by a step.
fn moved(v: f64, scale: f64, offset: f64) -> f64 {
    (((v - offset) / scale).round().mul_add(scale, offset) - v).abs()
}

/// What a step that was asked for does to the coordinates of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::io) struct Moved {
    /// Number of points that it moves by more than the precision of the numbers.
    pub(in crate::io) points: u64,
    /// Their largest displacement.
    pub(in crate::io) largest: f64,
}

/// What the scale of the options does to x, y and z; nothing without one. One pass over the points.
///
/// # Errors
/// As [`frame`].
pub(in crate::io) fn moved_by_scale(cloud: &Cloud, options: &WriteOptions) -> Result<[Moved; 3]> {
    let mut found = [Moved { points: 0, largest: 0.0 }; 3];
    if options.scale.is_none() {
        return Ok(found);
    }
    let LasFrame { scale, offset } = frame(cloud, options)?;
    for piece in watched(cloud.len(), &options.monitor) {
        for at in piece?.map(|i| cloud.xyz(i)) {
            for a in 0..3 {
                let apart = moved(at[a], scale[a], offset[a]);
                if apart > rounding(at[a].abs().max(offset[a].abs())) {
                    found[a].points += 1;
                    found[a].largest = found[a].largest.max(apart);
                }
            }
        }
    }
    Ok(found)
}

/// Approximate distance of neighbouring points, rather too small than too large; infinite if all points coincide. With
/// `plan`, in x and y only.
///
/// It is the edge of the largest cubes, by repeated halving, of which at least half as many are occupied as there are
/// distinct positions. Needs one sort of the points' Morton codes. If most of the smallest cubes hold several points, as
/// where two sites lie far apart, these are divided down to the precision of the numbers, which needs another sort.
fn spacing(cloud: &Cloud, plan: bool, monitor: &Monitor) -> Result<f64> {
    let strays = Strays::find(cloud, &StrayParams::default(), monitor)?;
    let Some([low, high]) = strays.bounds else { return Ok(f64::INFINITY) };
    let axes = if plan { 2 } else { 3 };
    let side = (0..axes).map(|a| high[a] - low[a]).fold(0.0, f64::max);
    if !(side > 0.0 && side.is_finite()) {
        return Ok(f64::INFINITY);
    }
    let cube = Cube { low, side, axes };
    let mut parting = cube.parting::<1>(cloud, monitor)?;
    if 2 * (1 + parting.iter().sum::<usize>()) < cloud.len() {
        parting = cube.parting::<3>(cloud, monitor)?;
    }
    let places = 1 + parting.iter().sum::<usize>();
    if places < 2 {
        return Ok(f64::INFINITY);
    }
    let mut cubes = 1;
    let level = parting.iter().position(|&more| {
        cubes += more;
        2 * cubes >= places
    });
    Ok(side / (level.unwrap_or(parting.len()) as f64).exp2())
}

/// The cube that is halved, in two or three axes.
struct Cube {
    low: [f64; 3],
    side: f64,
    axes: usize,
}

/// Number of times that one Morton code halves.
const HALVINGS: usize = morton::LIMIT.trailing_zeros() as usize;

impl Cube {
    /// For each number of halvings, of `N` codes together, how many more cubes are occupied than before.
    fn parting<const N: usize>(&self, cloud: &Cloud, monitor: &Monitor) -> Result<Vec<usize>> {
        let mut codes: Vec<[u64; N]> = Vec::with_capacity(cloud.len());
        for piece in watched(cloud.len(), monitor) {
            codes.extend(piece?.map(|i| self.codes::<N>(cloud.xyz(i))));
        }
        sort_watched(&mut codes, monitor)?;
        let mut parting = vec![0; N * HALVINGS + 1];
        for piece in watched(codes.len().saturating_sub(1), monitor) {
            for i in piece? {
                if let Some(n) = (0..N).find(|&n| codes[i][n] != codes[i + 1][n]) {
                    let bit = 63 - (codes[i][n] ^ codes[i + 1][n]).leading_zeros() as usize;
                    parting[(n + 1) * HALVINGS - bit / 3] += 1;
                }
            }
        }
        Ok(parting)
    }

    /// The cell of a position, the cell within that cell, and so on.
    fn codes<const N: usize>(&self, at: [f64; 3]) -> [u64; N] {
        let share = |a: usize| if a < self.axes { (at[a] - self.low[a]) / self.side } else { 0.0 };
        let mut rest = [0, 1, 2].map(share);
        [(); N].map(|()| {
            let scaled = rest.map(|v| v * f64::from(morton::LIMIT));
            let cell = scaled.map(|v| (v.max(0.0) as u32).min(morton::LIMIT - 1));
            // Positions outside, which are stray, lie in the last cell.
            rest = [0, 1, 2].map(|a| (scaled[a] - f64::from(cell[a])).clamp(0.0, 1.0));
            morton::encode(cell)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io;
    use crate::random::stream;

    fn lattice(step: f64) -> Vec<[f64; 3]> {
        (0..2500).map(|i| [f64::from(i % 50) * step, f64::from(i / 50) * step, 2.0]).collect()
    }

    fn written(rows: &[[f64; 3]], options: &WriteOptions) -> Result<Cloud> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.las");
        io::write(&path, &Cloud::from_rows(rows)?, options)?;
        io::read(&path)
    }

    fn scale(cloud: &Cloud) -> [f64; 3] {
        match cloud.coordinates() {
            Coordinates::Scaled { scale, .. } => *scale,
            Coordinates::Float(_) => panic!("not LAS"),
        }
    }

    #[test]
    fn the_spacing_of_a_lattice_is_found_within_a_factor_of_two() {
        for step in [0.3, 1e-5, 40.0] {
            let found = spacing(&Cloud::from_rows(&lattice(step)).unwrap(), false, &Monitor::default()).unwrap();
            assert!((0.5 * step..=step).contains(&found), "{step} {found}");
        }
        let one_place = Cloud::from_rows(&[[1.0; 3]; 50]).unwrap();
        assert!(spacing(&one_place, false, &Monitor::default()).unwrap().is_infinite());
    }

    #[test]
    fn the_spacing_within_two_sites_far_apart_is_found() {
        let mut rows = lattice(0.25);
        rows.extend(lattice(0.25).iter().map(|p| p.map(|v| v + 1e8)));
        let found = spacing(&Cloud::from_rows(&rows).unwrap(), false, &Monitor::default()).unwrap();
        assert!((0.12..=0.25).contains(&found), "{found}");
    }

    #[test]
    fn a_far_point_does_not_cost_the_others_their_places() {
        let mut s = stream(6, 1);
        let near: Vec<[f64; 3]> = (0..1000).map(|_| [s.uniform(), s.uniform(), s.uniform()]).collect();
        for far in [1e7, 1e8, 1e12] {
            let rows = [&near[..], &[[far; 3]]].concat();
            let message = written(&rows, &WriteOptions::default()).unwrap_err().to_string();
            assert!(message.contains("--scale"), "{far}: {message}");
            let site: Vec<[f64; 3]> = near.iter().map(|p| p.map(|v| v + far)).collect();
            assert!(written(&[&near[..], &site].concat(), &WriteOptions::default()).is_err(), "{far}");
        }
        // Heights beside degrees have no spacing of their own.
        let mut rows: Vec<[f64; 3]> = near.iter().map(|p| [2.0 + p[0], 48.0 + p[1], p[2]]).collect();
        rows.push([2.5, 48.5, 1e8]);
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud.crs = Some("EPSG:4326".into());
        assert!(frame(&cloud, &WriteOptions::default()).is_err());
    }

    #[test]
    fn points_of_tiny_clouds_stay_apart() {
        let mut s = stream(7, 1);
        for (count, size) in [(3, 1e-6), (1000, 1e-15), (1000, 1e-40)] {
            let rows: Vec<[f64; 3]> = (0..count).map(|_| [0; 3].map(|_| s.uniform() * size)).collect();
            let back = written(&rows, &WriteOptions::default()).unwrap();
            let mut places: Vec<[u64; 3]> = (0..back.len()).map(|i| back.xyz(i).map(f64::to_bits)).collect();
            places.sort_unstable();
            places.dedup();
            assert_eq!(places.len(), rows.len(), "{size}");
        }
    }

    #[test]
    fn millimetres_are_the_step_of_what_they_hold() {
        let rows: Vec<[f64; 3]> =
            lattice(0.3).iter().map(|p| [p[0] + 500_000.125, p[1] + 5_200_000.25, p[2] + 0.007]).collect();
        assert_eq!(scale(&written(&rows, &WriteOptions::default()).unwrap()), [1e-3; 3]);
        // Single precision is within the allowed share of the spacing.
        let single: Vec<[f64; 3]> =
            rows.iter().map(|p| [p[0] - 5e5, p[1] - 5.2e6, p[2]].map(|v| f64::from(v as f32))).collect();
        assert_eq!(scale(&written(&single, &WriteOptions::default()).unwrap()), [1e-3; 3]);
    }

    #[test]
    fn no_point_moves_by_more_than_a_thousandth_of_the_spacing() {
        let mut s = stream(2, 9);
        for size in [1e-3, 0.2, 300.0] {
            let rows: Vec<[f64; 3]> = (0..4000).map(|_| [s.uniform() * size, s.uniform() * size, 0.0]).collect();
            let back = written(&rows, &WriteOptions::default()).unwrap();
            let spacing = size / 63.0;
            let moved =
                (0..rows.len()).map(|i| (0..3).fold(0.0, |m: f64, a| m.max((back.xyz(i)[a] - rows[i][a]).abs())));
            assert!(moved.fold(0.0, f64::max) <= 1e-3 * spacing, "{size}");
        }
    }

    #[test]
    fn places_in_degrees_stay_apart() {
        let mut s = stream(4, 2);
        let rows: Vec<[f64; 3]> =
            lattice(2e-5).iter().map(|p| [2.35 + p[0], 48.85 + p[1], 30.0 * s.uniform()]).collect();
        let back = written(&rows, &WriteOptions::default()).unwrap();
        assert!((0..rows.len()).all(|i| (0..2).all(|a| (back.xyz(i)[a] - rows[i][a]).abs() <= 2e-8)));
        let mut places: Vec<[u64; 2]> = (0..back.len()).map(|i| [0, 1].map(|a| back.xyz(i)[a].to_bits())).collect();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), rows.len());
    }

    #[test]
    fn an_extent_that_needs_a_coarser_step_is_refused_unless_nothing_is_lost() {
        let mut rows: Vec<[f64; 3]> =
            lattice(0.25).iter().map(|p| [p[0] + 500_000.0, p[1] + 5_200_000.0, 0.0]).collect();
        rows.push([0.0; 3]);
        assert_eq!(scale(&written(&rows, &WriteOptions::default()).unwrap()), [1e-3, 1e-2, 1e-3]);
        rows[7][1] += 0.003;
        let message = written(&rows, &WriteOptions::default()).unwrap_err().to_string();
        assert!(message.contains("y: ") && message.contains("--scale"), "{message}");
        let asked = WriteOptions { scale: Some([0.01; 3]), ..WriteOptions::default() };
        assert_eq!(scale(&written(&rows, &asked).unwrap()), [0.01; 3]);
        let asked = WriteOptions { scale: Some([1e-4; 3]), ..WriteOptions::default() };
        assert!(written(&rows, &asked).unwrap_err().to_string().contains("does not fit"));
        for bad in [0.0, -1.0, f64::NAN] {
            let asked = WriteOptions { scale: Some([bad; 3]), ..WriteOptions::default() };
            assert!(written(&rows, &asked).is_err());
        }
    }
}
