//! Features of the points within a radius of each point: in spheres, or in vertical cylinders.

mod quantity;
mod spheres;

pub use crate::neighbours::Shape;
pub use quantity::Quantity;
pub use spheres::{SphereParams, Spheres};

use super::params::Divisor;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::linalg::arithmetic::{Division, Exact};
use crate::linalg::shape::{self, Shape as Shares};
use crate::memory;
use crate::neighbours::stacks::Stacks;
use crate::neighbours::sums::{Alike, Around, Batch, Scratch, Surroundings};
use crate::parallel::{Monitor, map_ordered_with};
use pulp::{Arch, Simd, WithSimd};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Points that one task describes.
const BLOCK: usize = 2048;
/// Blocks per thread that are held until their rows have been stored.
const AT_ONCE: usize = 16;

/// Parameters of [`radius_features`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RadiusParams {
    /// Radii, metres; each above 0.
    pub radii: Vec<f64>,
    /// Sphere or vertical cylinder.
    pub shape: Shape,
    /// Divisor of the covariance.
    pub divisor: Divisor,
    /// Whether eigenvalues are divided by their sum before omnivariance and entropy.
    pub normalise: bool,
}

impl Default for RadiusParams {
    fn default() -> Self {
        Self { radii: vec![1.0], shape: Shape::Sphere, divisor: Divisor::NMinusOne, normalise: false }
    }
}

impl RadiusParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If there is no radius, or one is not above 0 and finite.
    pub fn validate(&self) -> Result<()> {
        if self.radii.is_empty() {
            return Err(Error::parameter("radii", "none", "one or more, metres"));
        }
        match self.radii.iter().find(|r| !(**r > 0.0 && r.is_finite())) {
            Some(radius) => Err(Error::parameter("radii", radius, "metres, above 0, finite")),
            None => Ok(()),
        }
    }
}

/// Quantities of the points within each radius of each point: row i belongs to point i; the quantities at the first
/// radius, then those at the second.
///
/// The covariance features of spherical neighbourhoods of M. Pauly, R. Keiser, M. Gross, *Multi-scale feature extraction
/// on point-sampled surfaces*, Computer Graphics Forum 22(3), 2003, doi:10.1111/1467-8659.00675, with the names and
/// formulas of jakteristics 0.6.2. The point itself is one of its neighbours. A point is within the radius by the rule of
/// [`within`](crate::neighbours::within()). The sign of eigenvectors carries no information: their largest component is
/// positive. Where all points are in one place, and for a point that is alone, shares and eigenvalues are 0 and the
/// eigenvectors are the axes.
///
/// O(m) for m neighbours of all points together, after a sort; memory 16 bytes a point beside the result. Points that
/// are piled up in one place by the thousand take long, as all are neighbours of each other. The same bytes for any
/// number of threads.
///
/// # Errors
/// If a radius is not above 0 and finite, a coordinate is not finite, the table does not fit into memory, or the work was
/// cancelled.
///
/// ```
/// use scansion_core::features::{Quantity, RadiusParams, radius_features};
/// use scansion_core::{cloud::Positions, parallel::Monitor};
/// // A square lattice with steps of 1 m: 5 points within 1 m of an inner one.
/// let points: Positions = (0..100u8).map(|i| [f32::from(i % 10), f32::from(i / 10), 0.0]).collect();
/// let wanted = [Quantity::Count, Quantity::Sum, Quantity::Verticality];
/// let params = RadiusParams { radii: vec![1.0], ..RadiusParams::default() };
/// let found = radius_features(&points, &wanted, &params, &Monitor::default())?;
/// assert_eq!(found[55 * 3..56 * 3], [5.0, 1.0, 0.0]);
/// # Ok::<(), scansion_core::Error>(())
/// ```
pub fn radius_features(
    points: &Positions,
    quantities: &[Quantity],
    params: &RadiusParams,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    params.validate()?;
    let least = params.radii.iter().copied().fold(f64::INFINITY, f64::min);
    if points.is_empty() || quantities.is_empty() {
        return Ok(Vec::new());
    }
    let stacks = Stacks::new(points, least, monitor)?;
    StackedFeatures { stacks: &stacks, quantities, params }.collect(|place| stacks.index[place] as usize, monitor)
}

/// The same of points that are already sorted into columns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StackedFeatures<'a> {
    pub(crate) stacks: &'a Stacks,
    pub(crate) quantities: &'a [Quantity],
    pub(crate) params: &'a RadiusParams,
}

impl StackedFeatures<'_> {
    /// The table, row i for point i in the order of the columns.
    ///
    /// # Errors
    /// As [`radius_features`].
    pub(crate) fn rows(&self, monitor: &Monitor) -> Result<Vec<f32>> {
        self.params.validate()?;
        self.collect(|place| place, monitor)
    }

    /// The table; `row_of` gives the row of a point in the order of the columns.
    fn collect(&self, row_of: impl Fn(usize) -> usize, monitor: &Monitor) -> Result<Vec<f32>> {
        let Self { stacks, quantities, params } = *self;
        let (width, count) = (quantities.len() * params.radii.len(), stacks.len());
        let what = format!("{width} features of {count} points");
        let mut values = memory::filled(0.0f32, count.saturating_mul(width), &what)?;
        monitor.stage("features", count as u64);
        let blocks = count.div_ceil(BLOCK);
        let at_once = AT_ONCE * rayon::current_num_threads();
        for first in (0..blocks).step_by(at_once) {
            let range = first..(first + at_once).min(blocks);
            let parts = map_ordered_with(range, monitor, Scratch::default, |scratch, block| {
                let range = block * BLOCK..((block + 1) * BLOCK).min(count);
                let describe = Describe { stacks, range: range.clone(), quantities, params, monitor, scratch };
                let rows = Arch::new().dispatch(describe)?;
                monitor.advance(range.len() as u64);
                Ok((range, rows))
            })?;
            for (range, rows) in parts {
                monitor.check()?;
                for (place, row) in range.zip(rows.chunks_exact(width)) {
                    values[row_of(place) * width..][..width].copy_from_slice(row);
                }
            }
        }
        Ok(values)
    }
}

/// Describes the points of a block, compiled for each instruction set.
struct Describe<'a> {
    stacks: &'a Stacks,
    range: Range<usize>,
    quantities: &'a [Quantity],
    params: &'a RadiusParams,
    monitor: &'a Monitor,
    scratch: &'a mut Scratch,
}

impl WithSimd for Describe<'_> {
    type Output = Result<Vec<f32>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<Vec<f32>> {
        let Self { stacks, range, quantities, params, monitor, scratch } = self;
        let width = quantities.len() * params.radii.len();
        let mut rows = vec![0.0; range.len() * width];
        for (number, &radius) in params.radii.iter().enumerate() {
            let around = Around { stacks, radius, shape: params.shape, weighing: Alike };
            let mut first = range.start;
            while first < range.end {
                monitor.check()?;
                let batch = Batch::of(&around, &stacks.positions, first..range.end);
                batch.sum(simd, scratch);
                let found = scratch.sums.solve(params.divisor.constraints());
                for lane in 0..batch.points.len() {
                    let described = SphereShape::of(&found, lane, params.normalise);
                    let row = &mut rows[(first - range.start + lane) * width + number * quantities.len()..];
                    row.iter_mut().zip(quantities).for_each(|(value, q)| *value = described.get(*q) as f32);
                }
                first = batch.points.end;
            }
        }
        Ok(rows)
    }
}

/// The points around one point.
struct SphereShape {
    count: f64,
    values: [f64; 3],
    vectors: [[f64; 3]; 3],
    shares: Shares<f64>,
    /// The eigenvalues of omnivariance and entropy.
    used: [f64; 3],
}

impl SphereShape {
    fn of(found: &Surroundings, lane: usize, normalise: bool) -> Self {
        let eigen = &found.eigen;
        let values = [0, 1, 2].map(|i| eigen.values[i][lane]);
        let vectors = [0, 1, 2].map(|i| with_fixed_sign([0, 1, 2].map(|a| eigen.vectors[i][a][lane])));
        let used = if normalise { shape::normalised::<Exact, f64>(values) } else { values };
        Self { count: found.count[lane], values, vectors, shares: Shares::of::<Exact>(values), used }
    }

    fn get(&self, quantity: Quantity) -> f64 {
        let [first, second, third] = self.values;
        let share = |value: f64| Exact::quotient(value, shape::sum(self.values));
        match quantity {
            Quantity::Sum => shape::sum(self.values),
            Quantity::Omnivariance => shape::omnivariance::<Exact, f64>(self.used),
            Quantity::Eigenentropy => shape::eigenentropy::<Exact, f64>(self.used),
            Quantity::Anisotropy => self.shares.anisotropy,
            Quantity::Planarity => self.shares.planarity,
            Quantity::Linearity => self.shares.linearity,
            Quantity::FirstShare => share(first),
            Quantity::SecondShare => share(second),
            Quantity::SurfaceVariation => self.shares.surface_variation,
            Quantity::Sphericity => self.shares.scattering,
            Quantity::Verticality if first > 0.0 => (1.0 - self.vectors[2][2].abs()).max(0.0),
            Quantity::Verticality => 0.0,
            Quantity::Count => self.count,
            Quantity::Eigenvalue1 => first,
            Quantity::Eigenvalue2 => second,
            Quantity::Eigenvalue3 => third,
            Quantity::Eigenvector1X => self.vectors[0][0],
            Quantity::Eigenvector1Y => self.vectors[0][1],
            Quantity::Eigenvector1Z => self.vectors[0][2],
            Quantity::Eigenvector2X => self.vectors[1][0],
            Quantity::Eigenvector2Y => self.vectors[1][1],
            Quantity::Eigenvector2Z => self.vectors[1][2],
            Quantity::NormalX | Quantity::Eigenvector3X => self.vectors[2][0],
            Quantity::NormalY | Quantity::Eigenvector3Y => self.vectors[2][1],
            Quantity::NormalZ | Quantity::Eigenvector3Z => self.vectors[2][2],
        }
    }
}

/// The vector or its opposite: the one whose largest component is positive.
fn with_fixed_sign(v: [f64; 3]) -> [f64; 3] {
    let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
    if larger(larger(v[0], v[1]), v[2]) < 0.0 { v.map(|c| -c) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{Sym3, mean};
    use crate::random::stream;

    fn random(n: usize, extent: [f32; 3]) -> Positions {
        let mut s = stream(15, n as u64);
        (0..n).map(|_| extent.map(|e| s.uniform() as f32 * e + 100.0)).collect()
    }

    /// Count, eigenvalues and |normal| of brute force with the reference solver, in f64.
    fn slow(points: &Positions, i: usize, radius: f64, params: &RadiusParams) -> [f64; 7] {
        let at = points.xyz(i);
        let near = |&p: &[f32; 3]| {
            let [x, y, z] = [p[0] - at[0], p[1] - at[1], p[2] - at[2]];
            let plan = x * x + y * y;
            let squared = if params.shape == Shape::Sphere { plan + z * z } else { plan };
            squared <= (radius * radius) as f32
        };
        let rows: Vec<[f64; 3]> = points.iter().filter(near).map(|p| p.map(f64::from)).collect();
        let n = rows.len() as f64;
        let divisor = if params.divisor == Divisor::N || n < 2.0 { n } else { n - 1.0 };
        let eigen = Sym3::scatter(&rows, mean(&rows), divisor).eigen();
        let normal = eigen.vectors[2].map(f64::abs);
        [n, eigen.values[0], eigen.values[1], eigen.values[2], normal[0], normal[1], normal[2]]
    }

    #[test]
    fn all_radii_and_shapes_equal_brute_force() {
        use Quantity::{Count, Eigenvalue1, Eigenvalue2, Eigenvalue3, NormalX, NormalY, NormalZ};
        let wanted = [Count, Eigenvalue1, Eigenvalue2, Eigenvalue3, NormalX, NormalY, NormalZ];
        for points in [random(3000, [20.0, 20.0, 0.2]), random(2000, [5.0; 3]), random(40, [50.0; 3])] {
            for (shape, divisor) in [(Shape::Sphere, Divisor::NMinusOne), (Shape::Cylinder, Divisor::N)] {
                let params = RadiusParams { radii: vec![0.4, 1.1, 3.0], shape, divisor, normalise: false };
                let found = radius_features(&points, &wanted, &params, &Monitor::default()).unwrap();
                for i in (0..points.len()).step_by(5) {
                    for (r, &radius) in params.radii.iter().enumerate() {
                        let row = &found[(i * 3 + r) * 7..][..7];
                        let expected = slow(&points, i, radius, &params);
                        assert_eq!(f64::from(row[0]), expected[0], "count");
                        for k in 1..4 {
                            let error = (f64::from(row[k]) - expected[k]).abs();
                            assert!(error <= 1e-6 * expected[1], "λ{k} {} {}", row[k], expected[k]);
                        }
                        let cosine: f64 = (4..7).map(|k| f64::from(row[k].abs()) * expected[k]).sum();
                        let gap = (expected[2] - expected[3]) / expected[1];
                        assert!(gap < 1e-3 || cosine > 1.0 - 1e-5, "{cosine}");
                    }
                }
            }
        }
    }

    #[test]
    fn quantities_of_a_box_of_known_variances() {
        // Eight corners of a box with half edges 4, 2, 1: variances 16, 4, 1.
        let corner = |i: u8| [0, 1, 2].map(|a| if i >> a & 1 == 1 { 1.0 } else { -1.0 } * [4.0, 2.0, 1.0][a]);
        let points: Positions = (0..8).map(corner).collect();
        let value = |q: Quantity, normalise: bool| {
            let params = RadiusParams { radii: vec![20.0], divisor: Divisor::N, normalise, ..Default::default() };
            let found = radius_features(&points, &[q], &params, &Monitor::default()).unwrap();
            assert!(found.iter().all(|v| *v == found[0]));
            f64::from(found[0])
        };
        let entropy = |l: [f64; 3]| -l.iter().map(|l| l * l.ln()).sum::<f64>();
        let shares = [16.0 / 21.0, 4.0 / 21.0, 1.0 / 21.0];
        for (quantity, expected) in [
            (Quantity::Sum, 21.0),
            (Quantity::Omnivariance, 4.0),
            (Quantity::Eigenentropy, entropy([16.0, 4.0, 1.0])),
            (Quantity::Anisotropy, 15.0 / 16.0),
            (Quantity::Planarity, 3.0 / 16.0),
            (Quantity::Linearity, 0.75),
            (Quantity::FirstShare, shares[0]),
            (Quantity::SecondShare, shares[1]),
            (Quantity::SurfaceVariation, shares[2]),
            (Quantity::Sphericity, 1.0 / 16.0),
            (Quantity::Verticality, 0.0),
            (Quantity::Count, 8.0),
            (Quantity::Eigenvector1X, 1.0),
            (Quantity::Eigenvector2Y, 1.0),
            (Quantity::NormalZ, 1.0),
            (Quantity::NormalX, 0.0),
        ] {
            assert!((value(quantity, false) - expected).abs() < 1e-5, "{quantity:?} {}", value(quantity, false));
        }
        assert!((value(Quantity::Eigenentropy, true) - entropy(shares)).abs() < 1e-6);
        assert!((value(Quantity::Omnivariance, true) - 4.0 / 21.0).abs() < 1e-6);
    }

    #[test]
    fn lone_and_piled_points_have_no_extent_and_nonsense_is_refused() {
        let mut points: Positions = (0..5).map(|_| [7.0, 8.0, 9.0]).collect();
        points.push([90.0, 0.0, 0.0]);
        let monitor = Monitor::default();
        let width = Quantity::ALL.len();
        let found = radius_features(&points, Quantity::ALL, &RadiusParams::default(), &monitor).unwrap();
        for (i, row) in found.chunks(width).enumerate() {
            assert!(row.iter().all(|v| v.is_finite()));
            let count = Quantity::ALL.iter().position(|q| *q == Quantity::Count).unwrap();
            assert_eq!(row[count], if i < 5 { 5.0 } else { 1.0 });
            assert!(row[..count - 3].iter().all(|v| *v == 0.0), "{row:?}");
        }
        for radii in [vec![], vec![0.0], vec![1.0, f64::NAN]] {
            let params = RadiusParams { radii, ..RadiusParams::default() };
            assert!(radius_features(&points, Quantity::ALL, &params, &monitor).is_err());
        }
        let none = Positions::default();
        assert!(radius_features(&none, Quantity::ALL, &RadiusParams::default(), &monitor).unwrap().is_empty());
        monitor.cancel();
        assert!(radius_features(&points, Quantity::ALL, &RadiusParams::default(), &monitor).is_err());
    }

    #[test]
    fn the_values_have_the_same_bytes_for_any_number_of_threads() {
        let points = random(20_000, [40.0, 40.0, 2.0]);
        let params = RadiusParams { radii: vec![0.5, 2.0], ..RadiusParams::default() };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| radius_features(&points, Quantity::ALL, &params, &Monitor::default())).unwrap();
            found.iter().map(|v| v.to_bits()).collect::<Vec<u32>>()
        };
        let one = with(1);
        assert!(one == with(2) && one == with(3));
    }
}
