//! Features in spheres of several radii, each on a copy of the cloud that is thinned in proportion to the radius.
//!
//! H. Thomas, F. Goulette, J.-E. Deschaud, B. Marcotegui, Y. Le Gall, *Semantic classification of 3D point clouds with
//! multiscale spherical neighborhoods*, 3DV 2018, doi:10.1109/3DV.2018.00052: sections 2 and 3, Table 1. All points of
//! a sphere count, so that the same shape gives the same features wherever it was scanned, and a sphere of any radius
//! holds about as many points.

use super::{BLOCK, Shape};
use crate::cloud::{Points, Positions};
use crate::error::{Error, Result};
use crate::features::definition::{Feature, Group, scaled_name};
use crate::features::extractor::spacing::spacing;
use crate::features::params::Divisor;
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::{self, Shape as Shares};
use crate::neighbours::stacks::Stacks;
use crate::neighbours::sums::{Alike, Around, Batch, LANES, Scratch, Surroundings};
use crate::parallel::{Monitor, map_ordered_with};
use crate::voxels::{Grid, Level, build_levels, sorted};
use pulp::{Arch, Simd, WithSimd};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The first radius as a multiple of the point spacing, if it is taken from the cloud: about 20 points of a surface.
const SPACINGS: f64 = 2.5;

/// Parameters of [`Spheres`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SphereParams {
    /// Radius of the smallest spheres, metres; `None` (`"none"` in a recipe): 2.5 point spacings.
    #[serde(with = "crate::settings::optional_or_zero")]
    pub first_radius: Option<f64>,
    /// Number of radii, each twice the one before; 1..=12.
    pub scales: usize,
    /// ρ: radius of a sphere by the edge of the voxels that the cloud is thinned with for it; 2..=20.
    pub resolution: f64,
}

impl Default for SphereParams {
    fn default() -> Self {
        Self { first_radius: None, scales: 8, resolution: 5.0 }
    }
}

impl SphereParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        match self.first_radius {
            Some(radius) if !(1e-4..=1e4).contains(&radius) => {
                Err(Error::parameter("spheres.first_radius", radius, "0.0001..10000 metres"))
            }
            _ if !(1..=12).contains(&self.scales) => Err(Error::parameter("spheres.scales", self.scales, "1..12")),
            _ if !(2.0..=20.0).contains(&self.resolution) => {
                Err(Error::parameter("spheres.resolution", self.resolution, "2..20 voxels"))
            }
            _ => Ok(()),
        }
    }

    /// The radii, metres, from the smallest.
    fn radii(&self, first: f64) -> Vec<f64> {
        (0..self.scales).map(|scale| first * f64::from(1u32 << scale)).collect()
    }
}

/// The cloud, thinned for each radius.
#[derive(Clone, Debug)]
pub struct Spheres {
    scales: Vec<Scale>,
}

/// One radius.
#[derive(Clone, Debug)]
struct Scale {
    radius: f64,
    /// The means of the points in voxels of a share of the radius.
    thinned: Stacks,
}

impl Spheres {
    /// Number of features at a radius.
    const WIDTH: usize = 18;

    /// Thins the cloud for each radius: voxels of `radius / resolution` are replaced by the means of their points.
    ///
    /// O(n log n) time, up to about 100 bytes a point.
    ///
    /// # Errors
    /// If a parameter is out of range, voxels are too small for the extent, or the work was cancelled.
    pub fn new(points: &Points, params: &SphereParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        let first = match params.first_radius {
            Some(radius) => radius,
            None => (SPACINGS * spacing(points, monitor)?).max(1e-3),
        };
        monitor.stage("spheres", points.len() as u64);
        let grid = Grid::new(points, first / params.resolution)?;
        let points = sorted(points.clone(), &grid, monitor)?.positions;
        let levels = build_levels(&points, &grid, params.scales, monitor)?;
        drop(points);
        let scale = |(radius, Level { x, y, z, .. }): (f64, Level)| {
            let thinned = Stacks::new(&Positions { x, y, z }, radius, monitor)?;
            Ok(Scale { radius, thinned })
        };
        let scales = params.radii(first).into_iter().zip(levels).map(scale).collect::<Result<Vec<_>>>()?;
        Ok(Self { scales })
    }

    /// Radius of the smallest spheres, metres.
    pub fn first_radius(&self) -> f64 {
        self.scales.first().map_or(0.0, |scale| scale.radius)
    }

    /// Names of the features, from the smallest radius to the largest.
    pub fn names(&self) -> Vec<String> {
        let at = |scale: &Scale| {
            let radius = scale.radius;
            Group::Sphere.definitions().map(move |d| scaled_name(d, radius)).collect::<Vec<_>>()
        };
        self.scales.iter().flat_map(at).collect()
    }

    /// The features of some places, row-major. Places that follow each other should be close: up to 16 share a search.
    ///
    /// O(m) for m points of the thinned clouds in all spheres together. The same bytes for any number of threads.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn describe(&self, places: &Positions, monitor: &Monitor) -> Result<Vec<f32>> {
        let blocks = places.len().div_ceil(BLOCK);
        let parts = map_ordered_with(0..blocks, monitor, Scratch::default, |scratch, block| {
            let range = block * BLOCK..((block + 1) * BLOCK).min(places.len());
            let rows =
                Arch::new().dispatch(Describe { spheres: self, places, range: range.clone(), monitor, scratch })?;
            monitor.advance(range.len() as u64);
            Ok(rows)
        })?;
        Ok(parts.concat())
    }
}

/// Describes the places of a block, compiled for each instruction set.
struct Describe<'a> {
    spheres: &'a Spheres,
    places: &'a Positions,
    range: Range<usize>,
    monitor: &'a Monitor,
    scratch: &'a mut Scratch,
}

impl WithSimd for Describe<'_> {
    type Output = Result<Vec<f32>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<Vec<f32>> {
        let Self { spheres, places, range, monitor, scratch } = self;
        let width = Spheres::WIDTH * spheres.scales.len();
        let mut rows = vec![0.0; range.len() * width];
        for (number, Scale { radius, thinned }) in spheres.scales.iter().enumerate() {
            let around = Around { stacks: thinned, radius: *radius, shape: Shape::Sphere, weighing: Alike };
            let mut first = range.start;
            while first < range.end {
                monitor.check()?;
                let batch = Batch::of(&around, places, first..range.end);
                batch.sum(simd, scratch);
                let found = scratch.sums.solve(Divisor::N.constraints());
                for lane in 0..batch.points.len() {
                    let row = &mut rows[(first - range.start + lane) * width + number * Spheres::WIDTH..];
                    let sphere = Sphere::of(&found, lane);
                    let features = Group::Sphere.definitions().map(|d| sphere.get(d.feature) as f32);
                    row.iter_mut().zip(features).for_each(|(value, feature)| *value = feature);
                }
                first = batch.points.end;
            }
        }
        Ok(rows)
    }
}

/// The points of a sphere.
struct Sphere {
    count: f64,
    /// Eigenvalues and eigenvectors of the covariance.
    values: [f64; 3],
    vectors: [[f64; 3]; 3],
    shares: Shares<f64>,
    /// Mean of the offsets from the middle of the sphere.
    mean: [f64; 3],
    /// Mean of their products: xx, yy, zz, xy, xz, yz.
    products: [f64; 6],
}

impl Sphere {
    #[inline(always)]
    fn of(found: &Surroundings, lane: usize) -> Self {
        debug_assert!(lane < LANES);
        let values = [0, 1, 2].map(|i| found.eigen.values[i][lane]);
        let vectors = [0, 1, 2].map(|i| [0, 1, 2].map(|a| found.eigen.vectors[i][a][lane]));
        let count = found.count[lane];
        let mean = |k: usize| found.totals[k][lane] / count.max(1.0);
        Self {
            count,
            values,
            vectors,
            shares: Shares::of::<Exact>(values),
            mean: [0, 1, 2].map(mean),
            products: [3, 4, 5, 6, 7, 8].map(mean),
        }
    }

    fn get(&self, feature: Feature) -> f64 {
        match feature {
            Feature::SphereSum => shape::sum(self.values),
            Feature::SphereOmnivariance => shape::omnivariance::<Exact, f64>(self.values),
            Feature::SphereEigenentropy => shape::eigenentropy::<Exact, f64>(self.values),
            Feature::SphereLinearity => self.shares.linearity,
            Feature::SpherePlanarity => self.shares.planarity,
            Feature::SphereSphericity => self.shares.scattering,
            Feature::SphereSurfaceVariation => self.shares.surface_variation,
            Feature::SphereVerticality1 => self.verticality(0),
            Feature::SphereVerticality3 => self.verticality(2),
            Feature::SphereMomentE1 => self.moment(0).abs(),
            Feature::SphereMomentE2 => self.moment(1).abs(),
            Feature::SphereMomentE3 => self.moment(2).abs(),
            Feature::SphereSecondMomentE1 => self.square(0),
            Feature::SphereSecondMomentE2 => self.square(1),
            Feature::SphereSecondMomentE3 => self.square(2),
            Feature::SphereMomentZ => self.mean[2],
            Feature::SphereSecondMomentZ => self.products[2],
            _ => self.count,
        }
    }

    /// Angle between an eigenvector and the horizontal plane, radians.
    fn verticality(&self, vector: usize) -> f64 {
        if self.values[0] > 0.0 { self.vectors[vector][2].abs().min(1.0).asin() } else { 0.0 }
    }

    /// Mean of the offsets along an eigenvector; 0 for points that coincide, whose eigenvectors say nothing.
    fn moment(&self, vector: usize) -> f64 {
        let e = self.vectors[vector];
        if self.values[0] > 0.0 { (0..3).map(|a| e[a] * self.mean[a]).sum() } else { 0.0 }
    }

    /// Mean of the squared offsets along an eigenvector.
    fn square(&self, vector: usize) -> f64 {
        let [x, y, z] = self.vectors[vector];
        let [xx, yy, zz, xy, xz, yz] = self.products;
        let sum = x * x * xx + y * y * yy + z * z * zz + 2.0 * (x * y * xy + x * z * xz + y * z * yz);
        if self.values[0] > 0.0 { sum.max(0.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::linalg::{Sym3, mean};
    use crate::random::stream;

    fn points(rows: &[[f64; 3]]) -> Points {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0)
    }

    fn random(n: usize, extent: [f64; 3]) -> Points {
        let mut s = stream(31, n as u64);
        points(&(0..n).map(|_| extent.map(|e| s.uniform() * e)).collect::<Vec<_>>())
    }

    /// All features of a sphere by the formulas of the paper, with the reference solver in f64.
    fn slow(cloud: &Positions, at: [f32; 3], radius: f64) -> Vec<f64> {
        let offset = |p: [f32; 3]| [0, 1, 2].map(|a| f64::from(p[a] - at[a]));
        let near = |d: &[f64; 3]| d.iter().map(|v| v * v).sum::<f64>() <= radius * radius;
        let rows: Vec<[f64; 3]> = cloud.iter().map(offset).filter(near).collect();
        let n = rows.len() as f64;
        let eigen = Sym3::scatter(&rows, mean(&rows), n).eigen();
        let [l1, l2, l3] = eigen.values.map(|v| v.max(0.0));
        let along = |e: [f64; 3], power: i32| {
            rows.iter().map(|d| (0..3).map(|a| d[a] * e[a]).sum::<f64>().powi(power)).sum::<f64>() / n
        };
        let log = |l: f64| if l > 0.0 { l * l.ln() } else { 0.0 };
        let tilt = |e: [f64; 3]| (std::f64::consts::FRAC_PI_2 - e[2].clamp(-1.0, 1.0).acos()).abs();
        let [e1, e2, e3] = eigen.vectors;
        let z = [0.0, 0.0, 1.0];
        vec![
            l1 + l2 + l3,
            (l1 * l2 * l3).cbrt(),
            -(log(l1) + log(l2) + log(l3)),
            (l1 - l2) / l1,
            (l2 - l3) / l1,
            l3 / l1,
            l3 / (l1 + l2 + l3),
            tilt(e1),
            tilt(e3),
            along(e1, 1).abs(),
            along(e2, 1).abs(),
            along(e3, 1).abs(),
            along(e1, 2),
            along(e2, 2),
            along(e3, 2),
            along(z, 1),
            along(z, 2),
            n,
        ]
    }

    #[test]
    fn features_of_the_smallest_spheres_equal_the_formulas() {
        for cloud in [random(700, [9.0, 9.0, 9.0]), random(600, [20.0, 6.0, 1.0])] {
            let params = SphereParams { first_radius: Some(2.0), scales: 1, resolution: 20.0 };
            let fine = SphereParams { first_radius: Some(0.5), ..params.clone() };
            for (radius, params) in [(2.0, params), (0.5, fine)] {
                let spheres = Spheres::new(&cloud, &params, &Monitor::default()).unwrap();
                let found = spheres.describe(&cloud.positions, &Monitor::default()).unwrap();
                let thinned = &spheres.scales[0].thinned.positions;
                assert!((cloud.len() - 9..=cloud.len()).contains(&thinned.len()));
                for i in (0..cloud.len()).step_by(3) {
                    let expected = slow(thinned, cloud.positions.xyz(i), radius);
                    let row = &found[i * Spheres::WIDTH..][..Spheres::WIDTH];
                    assert_eq!(f64::from(row[17]), expected[17]);
                    // Of two or three points the smallest eigenvalues are rounding errors.
                    for (k, (value, expected)) in row.iter().zip(&expected).enumerate().filter(|_| expected[17] > 4.0) {
                        let error = (f64::from(*value) - expected).abs();
                        assert!(error < 1e-3 * (1.0 + expected.abs()), "{k} of {i}: {value} {expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_plane_has_the_moments_of_a_disc_on_every_scale() {
        let mut random = stream(5, 0);
        let cloud =
            points(&(0..90_000).map(|_| [30.0 * random.uniform(), 30.0 * random.uniform(), 5.0]).collect::<Vec<_>>());
        let params = SphereParams { first_radius: Some(0.5), scales: 4, resolution: 5.0 };
        let spheres = Spheres::new(&cloud, &params, &Monitor::default()).unwrap();
        let names = spheres.names();
        assert_eq!((names.len(), names[0].as_str(), names[71].as_str()), (72, "SphereSum_r0p5", "SphereCount_r4"));
        let at = |x: f32, y: f32| {
            let place: Positions = [[x, y, cloud.positions.z[0]]].into_iter().collect();
            spheres.describe(&place, &Monitor::default()).unwrap()
        };
        let origin = cloud.frame.origin;
        let local = |x: f64, y: f64| at((x - origin[0]) as f32, (y - origin[1]) as f32);
        let (inner, border) = (local(15.0, 15.0), local(0.0, 15.0));
        for (scale, radius) in [0.5, 1.0, 2.0, 4.0].into_iter().enumerate() {
            let of = |row: &[f32], k: usize| f64::from(row[scale * Spheres::WIDTH + k]);
            assert!((of(&inner, 0) / (0.5 * radius * radius) - 1.0).abs() < 0.15, "{}", of(&inner, 0));
            assert!(of(&inner, 4) > 0.6 && of(&inner, 6) < 1e-6);
            assert!((of(&inner, 8) - std::f64::consts::FRAC_PI_2).abs() < 1e-3 && of(&inner, 7) < 1e-3);
            assert!(of(&inner, 9).max(of(&inner, 10)) < 0.2 * radius && of(&inner, 15).abs() < 1e-4);
            // The middle of a half disc is 4 r / 3 π from its border, across the longer axis.
            let across = 4.0 * radius / (3.0 * std::f64::consts::PI);
            assert!((of(&border, 10) / across - 1.0).abs() < 0.35, "{} {across}", of(&border, 10));
            // About as many points on every scale: discs with a radius of 5 voxels.
            assert!((40.0..100.0).contains(&of(&inner, 17)), "{}", of(&inner, 17));
        }
    }

    #[test]
    fn the_radius_follows_the_spacing_and_nonsense_is_refused_by_name() {
        let rows: Vec<[f64; 3]> = (0..2500).map(|i| [f64::from(i % 50) * 0.4, f64::from(i / 50) * 0.4, 0.0]).collect();
        let open = SphereParams { scales: 2, ..SphereParams::default() };
        let spheres = Spheres::new(&points(&rows), &open, &Monitor::default()).unwrap();
        assert!((spheres.first_radius() - 1.0).abs() < 1e-3);
        let pile = Spheres::new(&points(&[[3.0; 3]; 9]), &open, &Monitor::default()).unwrap();
        let place: Positions = [[0.0; 3]].into_iter().collect();
        assert!(pile.describe(&place, &Monitor::default()).unwrap().iter().all(|v| v.is_finite()));
        let refused = |params: SphereParams| params.validate().unwrap_err().to_string();
        assert!(refused(SphereParams { scales: 0, ..open.clone() }).contains("scales"));
        assert!(refused(SphereParams { resolution: 1.0, ..open.clone() }).contains("resolution"));
        assert!(refused(SphereParams { first_radius: Some(f64::NAN), ..open }).contains("first_radius"));
    }

    #[test]
    fn the_features_have_the_same_bytes_for_any_number_of_threads() {
        let cloud = random(5000, [30.0, 30.0, 4.0]);
        let spheres =
            Spheres::new(&cloud, &SphereParams { scales: 3, ..SphereParams::default() }, &Monitor::default()).unwrap();
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| spheres.describe(&cloud.positions, &Monitor::default())).unwrap()
        };
        let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        assert!(bits(with(1)) == bits(with(3)));
    }
}
