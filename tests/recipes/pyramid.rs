//! The features of the pyramid against a simple `f64` reference that shares only the eigen-solver of `linalg` with the
//! kernels, and their symmetries and edge cases.

use scansion_core::cloud::{Cloud, MetricCloud};
use scansion_core::features::definition::{Feature, Group, Scope, of_scope};
use scansion_core::features::{
    Centre, Column, Divisor, Extractor, FeatureSet, FeatureTable, PyramidParams, Scratch, Wanted, table, table_at,
};
use scansion_core::linalg::{self, Eigen3, Sym3};
use scansion_core::parallel::Monitor;
use scansion_core::random::stream;
use std::collections::BTreeMap;

type Point = [f64; 3];

/// The feature of a column.
fn key(column: &str) -> Feature {
    Feature::named(column, Scope::Level).unwrap()
}

/// Multiples of 2^-15 and half of that, so that `f32` holds coordinates below 64 exactly and none lies on a voxel's face.
fn exact(v: f64) -> f64 {
    ((v * 32768.0).floor() + 0.5) / 32768.0
}

/// A floor, a wall, a pole and a tree crown in a box of 32 m x 32 m x 8 m with points in its corners.
fn scene(n: usize) -> Vec<Point> {
    let mut s = stream(21, n as u64);
    let mut rows = vec![[0.1, 0.1, 0.1], [31.9, 31.9, 7.9]];
    for i in 0..n {
        let (u, v, w) = (s.uniform(), s.uniform(), s.uniform());
        rows.push(match i % 8 {
            0..4 => [0.2 + 31.6 * u, 0.2 + 31.6 * v, 1.0 + 0.2 * u + 0.03 * w],
            4 | 5 => [0.2 + 31.6 * u, 20.0 + 0.05 * w + 2.0 * u, 1.0 + 6.0 * v],
            6 => [8.0 + 0.2 * u, 5.0 + 0.2 * v, 1.0 + 5.0 * w],
            _ => [20.0 + 6.0 * u, 6.0 + 6.0 * v, 3.0 + 4.0 * w],
        });
    }
    rows.into_iter().map(|p| p.map(exact)).collect()
}

fn set(pyramid: PyramidParams) -> FeatureSet {
    FeatureSet {
        pyramid: PyramidParams { first_scale: Some(0.5), levels: Some(4), ..pyramid },
        ..FeatureSet::default()
    }
}

fn features(rows: &[Point], set: &FeatureSet) -> FeatureTable {
    table(&Cloud::from_rows(rows).unwrap(), set, &Monitor::default()).unwrap()
}

fn bits(table: &FeatureTable) -> Vec<u32> {
    table.values.iter().map(|v| v.to_bits()).collect()
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Whether the least value is less than the others by more than rounding errors.
fn clear_least(values: &[f64], margin: f64) -> bool {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.len() < 2 || sorted[1] - sorted[0] > margin
}

struct Twin<'a> {
    params: &'a PyramidParams,
    size: f64,
    level: Vec<Point>,
    /// Normal and surface variation of each level point; none if the normal depends on rounding.
    surfaces: Vec<Option<(Point, f64)>>,
}

impl<'a> Twin<'a> {
    fn new(rows: &[Point], params: &'a PyramidParams, size: f64) -> Self {
        let mut voxels: BTreeMap<[i64; 3], (f64, Point)> = BTreeMap::new();
        for p in rows {
            let voxel = voxels.entry(p.map(|v| (v / size).floor() as i64)).or_default();
            voxel.0 += 1.0;
            (0..3).for_each(|a| voxel.1[a] += p[a]);
        }
        let level = voxels.values().map(|(n, sum)| sum.map(|s| f64::from((s / n) as f32))).collect();
        let mut twin = Self { params, size, level, surfaces: Vec::new() };
        twin.surfaces =
            (0..twin.level.len()).map(|i| twin.surface(&twin.nearest(twin.level[i], params.k)?.1)).collect();
        twin
    }

    /// Indices and positions, relative to p, of the k nearest; none if a tie makes them ambiguous.
    fn nearest(&self, p: Point, k: usize) -> Option<(Vec<usize>, Vec<Point>)> {
        let mut order: Vec<(f64, usize)> =
            self.level.iter().enumerate().map(|(i, &q)| (dot(minus(q, p), minus(q, p)), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        if order.len() > k && order[k].0 - order[k - 1].0 < 1e-5 * order[k].0 {
            return None;
        }
        order.truncate(k);
        Some(order.iter().map(|o| (o.1, minus(self.level[o.1], p))).unzip())
    }

    fn tensor(&self, points: &[Point]) -> Option<Eigen3> {
        let sums: Vec<f64> =
            points.iter().map(|p| points.iter().map(|q| dot(minus(*p, *q), minus(*p, *q)).sqrt()).sum()).collect();
        let centre = match self.params.centre {
            Centre::Mean => linalg::mean(points),
            Centre::Medoid if !clear_least(&sums, 1e-5 * sums[0]) => return None,
            Centre::Medoid => points[linalg::medoid(points)],
        };
        let divisor = points.len() as f64 - if self.params.divisor == Divisor::N { 0.0 } else { 1.0 };
        Some(Sym3::scatter(points, centre, divisor).eigen())
    }

    fn surface(&self, points: &[Point]) -> Option<(Point, f64)> {
        let Eigen3 { values: [a, b, c], vectors } = self.tensor(points)?;
        (b - c > 0.01 * a).then(|| (vectors[2], c / (a + b + c)))
    }

    /// The 16 features of a point, each with the error that `f32` may cause; none if a choice depends on rounding.
    fn features(&self, p: Point) -> [Option<(f64, f64)>; 16] {
        let mut out = [None; 16];
        self.heights(p, &mut out);
        let own = usize::from(self.params.include_query);
        let Some((found, mut points)) = self.nearest(p, self.params.k - own) else { return out };
        points.extend((0..own).map(|_| [0.0; 3]));
        let Some(eigen) = self.tensor(&points) else { return out };
        self.covariance(&eigen, &mut out);
        let mut surfaces: Vec<_> = found.iter().map(|&i| self.surfaces[i]).collect();
        surfaces.extend((0..own).map(|_| self.surface(&points)));
        let [a, b, c] = eigen.values;
        if b - c > 0.05 * a && a - b > 0.05 * a {
            self.contour(&points, eigen.vectors[1], &surfaces, &mut out);
        }
        out
    }

    fn covariance(&self, eigen: &Eigen3, out: &mut [Option<(f64, f64)>; 16]) {
        let [a, b, c] = eigen.values;
        let sum = a + b + c;
        let [u, v, w] = eigen.values.map(|x| if self.params.normalise { x / sum } else { x });
        let product = u * v * w;
        out[0] = Some((sum, 1e-5 * sum));
        // The error of the smallest eigenvalue is of the size of the largest's rounding.
        out[1] = Some((product.cbrt(), (product + 1e-5 * u * u * v).cbrt() - product.cbrt() + 1e-6 * u));
        let entropy: f64 = -[u, v, w].iter().map(|&x| if x > 0.0 { x * x.ln() } else { 0.0 }).sum::<f64>();
        out[2] = Some((entropy, 1e-4 * u * (1.0 + u.ln().abs())));
        for (i, ratio) in [(a - c) / a, (b - c) / a, (a - b) / a, c / sum, c / a].into_iter().enumerate() {
            out[3 + i] = Some((ratio, 1e-5));
        }
        if b - c > 1e-2 * a {
            out[8] = Some((1.0 - eigen.vectors[2][2].abs(), 1e-3));
        }
    }

    fn contour(
        &self,
        points: &[Point],
        mut second: Point,
        surfaces: &[Option<(Point, f64)>],
        out: &mut [Option<(f64, f64)>; 16],
    ) {
        let mut sizes = second.map(f64::abs);
        let largest = (0..3).fold(0, |best, i| if sizes[i] > sizes[best] { i } else { best });
        if second[largest] < 0.0 {
            second = second.map(|v| -v);
        }
        sizes.sort_by(f64::total_cmp);
        let along: Vec<f64> = points.iter().map(|&q| dot(q, second)).collect();
        let (first, moment): (f64, f64) = (along.iter().sum(), along.iter().map(|d| d * d).sum());
        out[9] = Some((first * first / moment, 5e-3));
        out[10] = Some((moment, 1e-3 * moment));
        let Some(surfaces) = surfaces.iter().copied().collect::<Option<Vec<_>>>() else { return };
        let far = along.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        let sides = along.iter().all(|d| d.abs() > 1e-3 * far || *d == 0.0) && sizes[2] - sizes[1] > 1e-3;
        let medoid = |negative: bool| -> Option<Option<Point>> {
            let normals: Vec<Point> =
                (0..along.len()).filter(|&i| (along[i] < 0.0) == negative).map(|i| surfaces[i].0).collect();
            let sums: Vec<f64> =
                normals.iter().map(|&n| normals.iter().map(|&m| 1.0 - dot(n, m).abs()).sum()).collect();
            let best = (0..sums.len()).fold(0, |best, i| if sums[i] < sums[best] { i } else { best });
            clear_least(&sums, 1e-3).then(|| normals.get(best).copied())
        };
        if let (true, Some(below), Some(above)) = (sides, medoid(true), medoid(false)) {
            out[11] = Some((below.zip(above).map_or(1.0, |(n, m)| dot(n, m).abs()), 2e-3));
        }
        let near = (self.params.near_share * along.len() as f64).ceil() as usize;
        let mut order: Vec<(f64, f64)> = along.iter().zip(&surfaces).map(|(d, s)| (d.abs(), s.1)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mean = |part: &[(f64, f64)]| part.iter().map(|o| o.1).sum::<f64>() / part.len() as f64;
        let (close, beyond) = (mean(&order[..near]), mean(&order[near..]));
        if order[near].0 - order[near - 1].0 > 1e-3 * far && beyond > 1e-9 {
            let ratio = (close / beyond).min(1000.0);
            out[12] = Some((ratio, 1e-2 * (1.0 + ratio)));
        }
    }

    fn heights(&self, p: Point, out: &mut [Option<(f64, f64)>; 16]) {
        let radius = self.params.column_radius * self.size;
        let (mut low, mut high) = (p[2], p[2]);
        for q in &self.level {
            let apart = (q[0] - p[0]).hypot(q[1] - p[1]);
            let inside = match self.params.column {
                Column::Cylinder if (apart - radius).abs() < 1e-5 => return,
                Column::Cylinder => apart < radius,
                Column::Cell => (0..2).all(|a| (q[a] / radius).floor() == (p[a] / radius).floor()),
            };
            if inside {
                (low, high) = (low.min(q[2]), high.max(q[2]));
            }
        }
        out[13] = Some((high - low, 2e-6));
        out[14] = Some((p[2] - low, 2e-6));
        out[15] = Some((high - p[2], 2e-6));
    }
}

fn check_against_twin(pyramid: PyramidParams) {
    let rows = scene(2400);
    let set = set(pyramid);
    let found = features(&rows, &set);
    let (mut compared, mut asked) = ([0usize; 16], 0);
    for level in 0..4 {
        let twin = Twin::new(&rows, &set.pyramid, 0.5 * f64::from(1 << level));
        for (i, &p) in rows.iter().enumerate().step_by(5) {
            asked += 1;
            for (f, expected) in twin.features(p).into_iter().enumerate() {
                let value = f64::from(found.row(i)[level * 16 + f]);
                let Some((expected, error)) = expected else { continue };
                compared[f] += 1;
                let name = &found.names[level * 16 + f];
                assert!((value - expected).abs() <= error, "{name} of point {i}: {value}, twin {expected} ± {error}");
            }
        }
    }
    let share = compared.map(|n| n as f64 / f64::from(asked));
    assert!(share.iter().all(|&s| s > 0.15) && share[..8].iter().all(|&s| s > 0.8), "too little compared: {share:.2?}");
}

#[test]
fn the_features_of_the_thesis_equal_the_twin() {
    check_against_twin(PyramidParams::default());
}

#[test]
fn other_conventions_equal_the_twin() {
    check_against_twin(PyramidParams::preset("jakteristics").unwrap());
    check_against_twin(PyramidParams {
        normalise: true,
        column: Column::Cell,
        column_radius: 2.0,
        ..PyramidParams::default()
    });
    check_against_twin(PyramidParams { k: 14, near_share: 0.3, column_radius: 0.5, ..PyramidParams::default() });
}

/// A plane with 5 mm of noise: its surface variation is 1e-5 at a scale of 1 m and 1e-7 at 10 m.
fn smooth() -> Vec<Point> {
    let mut s = stream(22, 0);
    let mut rows = Vec::new();
    for i in 0..3600 {
        let (x, y) = (0.5 * f64::from(i % 60) + 0.4 * s.uniform(), 0.5 * f64::from(i / 60) + 0.4 * s.uniform());
        // Twelve uniform numbers have a sum of variance 1.
        let noise = (0..12).map(|_| s.uniform()).sum::<f64>() - 6.0;
        rows.push([x, y, 0.3 * x + 0.1 * y + 0.005 * noise].map(exact));
    }
    rows
}

#[test]
fn the_line_feature_of_a_very_smooth_surface_equals_the_twin() {
    let rows = smooth();
    let pyramid = PyramidParams { first_scale: Some(0.8), levels: Some(3), ..PyramidParams::default() };
    let found = features(&rows, &FeatureSet { pyramid: pyramid.clone(), ..FeatureSet::default() });
    for level in 0..3 {
        let twin = Twin::new(&rows, &pyramid, 0.8 * f64::from(1 << level));
        let mut compared = 0;
        for (i, &p) in rows.iter().enumerate().step_by(5) {
            let Some((expected, _)) = twin.features(p)[12] else { continue };
            let value = f64::from(found.row(i)[level * 16 + 12]);
            compared += 1;
            assert!((value / expected - 1.0).abs() < 0.01, "level {level}, point {i}: {value}, twin {expected}");
        }
        assert!(compared > 100, "{compared}");
    }
}

#[test]
fn a_shift_by_whole_metres_changes_no_bit() {
    let rows = scene(3000);
    let shifted: Vec<Point> = rows.iter().map(|p| [p[0] + 5e6, p[1] + 5e6, p[2] - 300.0]).collect();
    assert_eq!(
        bits(&features(&rows, &set(PyramidParams::default()))),
        bits(&features(&shifted, &set(PyramidParams::default())))
    );
}

#[test]
fn units_other_than_metres_change_no_bit() {
    let rows = scene(2000);
    let halves: Vec<Point> = rows.iter().map(|p| p.map(|v| v * 2.0)).collect();
    let metres = set(PyramidParams::default());
    let expected = bits(&features(&rows, &metres));
    assert_eq!(bits(&features(&halves, &FeatureSet { metres_per_unit: Some(0.5), ..metres.clone() })), expected);
    let mut cloud = Cloud::from_rows(&halves).unwrap();
    cloud.metres_per_unit = Some(0.5);
    assert_eq!(bits(&table(&cloud, &metres, &Monitor::default()).unwrap()), expected, "the cloud's own unit");
}

#[test]
fn features_change_with_scale_by_their_unit_alone() {
    let rows = scene(2000);
    let large: Vec<Point> = rows.iter().map(|p| p.map(|v| v * 4.0)).collect();
    let mut scaled = set(PyramidParams::default());
    scaled.pyramid.first_scale = Some(2.0);
    let (small, large) = (features(&rows, &set(PyramidParams::default())), features(&large, &scaled));
    for (i, (a, b)) in small.values.iter().zip(&large.values).enumerate() {
        let name = &small.names[i % small.width()];
        let feature = key(name);
        match (feature, feature.definition().unit) {
            (Feature::Eigenentropy, _) => {}
            (Feature::Omnivariance, "m2") => assert!((a * 16.0 - b).abs() <= 1e-5 * b, "{name}"),
            (_, "m2") => assert_eq!(a * 16.0, *b, "{name}"),
            (_, "m") => assert_eq!(a * 4.0, *b, "{name}"),
            _ => assert_eq!(a, b, "{name}"),
        }
    }
}

#[test]
fn a_quarter_turn_about_z_changes_nothing_but_rounding() {
    let rows = scene(3000);
    let turned: Vec<Point> = rows.iter().map(|p| [-p[1], p[0], p[2]]).collect();
    let set = set(PyramidParams::default());
    let (a, b) = (features(&rows, &set), features(&turned, &set));
    for (f, definition) in of_scope(Scope::Level).enumerate() {
        if definition.feature == Feature::SurfaceOrientation {
            continue;
        }
        // The side of the point itself, and so R, depends on the sign of e2, which is fixed by the axes: R is left out.
        let pairs: Vec<(f32, f32)> =
            (0..rows.len() * 4).map(|i| (a.values[i * 16 + f], b.values[i * 16 + f])).collect();
        let equal = pairs.iter().filter(|(x, y)| (x - y).abs() <= 2e-3 * x.abs().max(y.abs()).max(0.05)).count();
        // If two eigenvalues are equal, e2 itself depends on rounding, and with it contour features of a few points.
        let needed = if definition.group == Group::Contour { 0.97 } else { 0.999 };
        let share = equal as f64 / pairs.len() as f64;
        assert!(share >= needed, "{}: {share}", a.names[f]);
    }
}

#[test]
fn degenerate_clouds_have_finite_features() {
    let line = (0..40).map(|i| [f64::from(i) * 0.1, f64::from(i) * 0.2, f64::from(i) * 0.05]).collect();
    let plane =
        (0..900).map(|i| [f64::from(i % 30) * 0.37, f64::from(i / 30) * 0.41, f64::from(i % 30) * 0.185]).collect();
    let clouds: [(&str, Vec<Point>); 7] = [
        ("none", vec![]),
        ("one", vec![[1.0, 2.0, 3.0]]),
        ("two", vec![[0.0; 3], [1.0, 2.0, 3.0]]),
        ("three", vec![[0.0; 3], [1.0, 2.0, 3.0], [9.0, 2.0, 1.0]]),
        ("same place", vec![[5.5, 5.5, 5.5]; 5000]),
        ("line", line),
        ("plane", plane),
    ];
    for (name, rows) in clouds {
        let found = features(&rows, &set(PyramidParams::default()));
        assert_eq!(found.values.len(), rows.len() * 64, "{name}");
        for (i, &v) in found.values.iter().enumerate() {
            let column = &found.names[i % 64];
            assert!(v.is_finite(), "{name}: {column} is {v}");
            match (name, key(column)) {
                ("one" | "same place", feature) => {
                    let missing = feature.definition().missing.parse().unwrap_or(0.0);
                    assert_eq!(v, missing, "{name}: {column}");
                }
                ("line", Feature::Linearity) => assert!(v > 1.0 - 1e-5, "{name}: {column} {v}"),
                ("plane" | "line" | "two" | "three", Feature::SurfaceVariation | Feature::Sphericity) => {
                    assert!(v < 2e-6, "{name}: {column} {v}");
                }
                ("plane", Feature::LineFeature) => assert_eq!(v, 1.0, "{name}: {column}"),
                ("plane", Feature::Verticality) => {
                    let planarity = found.names.iter().position(|n| *n == column.replace("Verticality", "Planarity"));
                    assert!(
                        (v - (1.0 - 1.25f32.sqrt().recip())).abs() < 1e-3
                            || found.row(i / 64)[planarity.unwrap()] < 0.01,
                        "{name}: {column} {v}"
                    );
                }
                _ => {}
            }
        }
    }
}

#[test]
fn points_that_are_not_finite_have_empty_rows_and_change_no_other() {
    let mut rows = scene(500);
    let expected = features(&rows, &set(PyramidParams::default()));
    rows.insert(7, [f64::NAN, 1.0, 1.0]);
    rows.push([1.0, f64::INFINITY, 1.0]);
    let found = features(&rows, &set(PyramidParams::default()));
    assert!(found.row(7).iter().chain(found.row(rows.len() - 1)).all(|v| v.is_nan()));
    assert_eq!(found.row(6), expected.row(6));
    assert_eq!(found.row(8), expected.row(7));
    assert_eq!(found.row(rows.len() - 2), expected.row(expected.rows() - 1));
}

#[test]
fn features_at_some_points_are_the_rows_of_the_table() {
    let cloud = Cloud::from_rows(&scene(4000)).unwrap();
    let set = set(PyramidParams::default());
    let monitor = Monitor::default();
    let all = table(&cloud, &set, &monitor).unwrap();
    let at: Vec<u32> = (0..500).map(|i| i * 7919 % 4002).collect();
    let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
    let (some, scale) = table_at(&scene, &set, &at, &monitor).unwrap();
    assert_eq!(scale, 0.5);
    at.iter().enumerate().for_each(|(r, &i)| assert_eq!(some.row(r), all.row(i as usize), "point {i}"));
    assert!(table_at(&scene, &set, &[1, 2, 1], &monitor).unwrap_err().to_string().contains('1'));
    assert!(table_at(&scene, &set, &[4002], &monitor).unwrap_err().to_string().contains("4002"));
}

#[test]
fn wanted_features_are_the_columns_of_the_table() {
    let cloud = Cloud::from_rows(&scene(1500)).unwrap();
    let set = set(PyramidParams::default());
    let all = table(&cloud, &set, &Monitor::default()).unwrap();
    for step in [1, 3, 5, 16, 40] {
        let columns: Vec<usize> = (0..64).rev().step_by(step).collect();
        let names: Vec<String> = columns.iter().map(|&c| all.names[c].clone()).collect();
        let monitor = Monitor::default();
        let scene = MetricCloud::new(&cloud, set.metres_per_unit, &monitor).unwrap();
        let extractor = Extractor::prepare(&scene, &set, Wanted::Names(&names), &monitor).unwrap();
        let (mut scratch, mut rows) = (Scratch::default(), Vec::new());
        for block in 0..extractor.blocks() {
            let points = extractor.block(block, &mut scratch, &mut rows);
            for (&point, row) in points.iter().zip(rows.chunks_exact(names.len())) {
                let expected: Vec<f32> = columns.iter().map(|&c| all.row(point as usize)[c]).collect();
                assert_eq!(row, expected, "point {point}");
            }
        }
    }
}

#[test]
fn the_narrowest_columns_reach_over_the_widest_extent() {
    let set = FeatureSet {
        pyramid: PyramidParams {
            first_scale: Some(0.5),
            levels: Some(2),
            column_radius: 0.25,
            ..PyramidParams::default()
        },
        ..FeatureSet::default()
    };
    let cloud = Cloud::from_rows(&[[0.0; 3], [900_000.0, 5.0, 1.0]]).unwrap();
    let table = table(&cloud, &set, &Monitor::default()).unwrap();
    let ranges: Vec<usize> = (0..table.width()).filter(|&f| table.names[f].starts_with("VerticalRange")).collect();
    assert_eq!(ranges.len(), 2);
    assert!(
        (0..2).all(|point| ranges.iter().all(|&f| table.row(point)[f] == 0.0)),
        "each point is alone in its column"
    );
}

#[test]
fn an_unknown_feature_is_told_the_three_nearest() {
    let all = FeatureSet::default().names(0.5);
    let message = |name: &str| Wanted::Asked(&[name.to_string()]).names(&all).unwrap_err().to_string();
    for (asked, nearest) in [("Planarty", "e.g. Planarity, "), ("planarity_r05", "e.g. Planarity_r0p5, ")] {
        assert!(message(asked).contains(nearest) && message(asked).len() < 200, "{}", message(asked));
    }
}
