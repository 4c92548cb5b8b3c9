//! The four levels on scenes whose segments are known.

use super::*;
use crate::random::stream;

fn levels(points: &Positions, params: &ClusterParams) -> ClusterLevels {
    let input = ClusterInput { points, heights: None, colours: None };
    cluster_levels(&input, params, &Monitor::default()).unwrap()
}

fn automatic(points: &Positions) -> Result<Automatic> {
    automatic_parameters(points, &ClusterParams::default(), &Monitor::default())
}

/// A lattice of side × side points with steps of 0.1 m: where coordinates are those of `place`.
fn sheet(side: u16, place: impl Fn(f32, f32) -> [f32; 3]) -> Vec<[f32; 3]> {
    let step = |i: u16| f32::from(i) / 10.0;
    (0..side * side).map(|i| place(step(i % side), step(i / side))).collect()
}

#[test]
fn two_perpendicular_planes_are_two_segments_on_both_levels() {
    let rows = [sheet(40, |a, b| [a, b, 0.0]), sheet(40, |a, b| [a, 4.0, b])].concat();
    let points = Positions::from_rows(&rows);
    let found = levels(&points, &ClusterParams::default());
    assert_eq!(found.counts[..2], [2, 2]);
    let labels = found.labels(1, &Monitor::default()).unwrap();
    // The lowest row of the wall lies in the plane of the floor too.
    for i in (0..3200).filter(|&i| i < 1600 || rows[i][2] > 0.0) {
        assert_eq!(labels[i] == labels[0], i < 1600, "point {i}");
    }
}

#[test]
fn parallel_steps_higher_than_the_offset_are_separate_and_lower_ones_are_one() {
    // Four steps of 4 m x 1 m next to each other.
    let stairs = |height: f32| {
        let rows = sheet(40, |a, b| [a, b, height * (b + 0.01).floor()]);
        levels(&Positions::from_rows(&rows), &ClusterParams { angle_deg: Some(20.0), ..ClusterParams::default() })
    };
    assert_eq!(stairs(0.8).counts[..2], [4, 4]);
    assert_eq!(stairs(0.01).counts[..2], [1, 1]);
}

/// A street: rough ground, two walls, a hedge.
fn street(scale: f32) -> Positions {
    let mut random = stream(9, 9);
    let mut u = |from: f32, to: f32| from + (to - from) * random.uniform() as f32;
    let mut rows = Vec::new();
    for i in 0..24_000 {
        rows.push(match i % 8 {
            0..4 => [u(0.0, 20.0), u(0.0, 10.0), u(0.0, 0.02)],
            4 | 5 => [u(0.0, 20.0), 10.0 + u(0.0, 0.02), u(0.0, 5.0)],
            6 => [20.0 + u(0.0, 0.02), u(0.0, 10.0), u(0.0, 5.0)],
            _ => [u(2.0, 18.0), u(2.0, 3.0), u(0.4, 1.4)],
        });
    }
    rows.iter().map(|row| row.map(|v| v * scale)).collect()
}

#[test]
fn levels_are_nested_and_segments_have_at_least_the_least_size() {
    let points = street(1.0);
    let found = levels(&points, &ClusterParams::default());
    let monitor = Monitor::default();
    let labels: Vec<Vec<u32>> = (1..=4).map(|l| found.labels(l, &monitor).unwrap()).collect();
    let mut sizes = vec![0u32; found.counts[0] as usize + 1];
    labels[0].iter().for_each(|&l| sizes[l as usize] += 1);
    assert!(found.counts[0] >= 4 && sizes[0] < 2400, "{:?} {}", found.counts, sizes[0]);
    assert!(sizes[1..].iter().all(|&s| s >= found.automatic.min_size), "{sizes:?}");
    assert!(sizes[1..].is_sorted_by(|a, b| a >= b), "{sizes:?}");
    for (fine, coarse) in [(0, 1), (1, 2), (0, 3)] {
        let mut above = vec![None; found.counts[fine] as usize + 1];
        for (&own, &wide) in labels[fine].iter().zip(&labels[coarse]) {
            assert_eq!(*above[own as usize].get_or_insert(wide), wide, "level {}", coarse + 1);
            assert_eq!(own == 0, wide == 0);
        }
        assert_eq!(labels[coarse].iter().max(), Some(&found.counts[coarse]));
    }
    let table = found.features(ClusterForm::Rank, &monitor).unwrap();
    assert_eq!(table.width(), 4);
    for (i, row) in table.values.chunks(4).enumerate() {
        assert!(row.iter().all(|v| (0.0..=1.0).contains(v)), "{row:?}");
        assert_eq!(row[0], labels[0][i] as f32 / found.counts[0] as f32);
    }
    let table = found.features(ClusterForm::Descriptor, &monitor).unwrap();
    assert!(table.width() == 8 && table.values.iter().all(|v| v.is_finite()));
    assert!(found.labels(0, &monitor).is_err() && found.labels(5, &monitor).is_err());
}

#[test]
fn radius_and_offset_scale_with_the_cloud_and_size_and_angle_do_not() {
    let one = automatic(&street(1.0)).unwrap();
    for scale in [0.125, 8.0] {
        let other = automatic(&street(scale)).unwrap();
        assert!((other.radius / one.radius / f64::from(scale) - 1.0).abs() < 1e-5);
        assert!((other.offset / one.offset / f64::from(scale) - 1.0).abs() < 1e-3);
        assert_eq!(other.min_size, one.min_size);
        assert!((other.angle_deg - one.angle_deg).abs() < 0.05, "{} {}", other.angle_deg, one.angle_deg);
    }
    assert_eq!(one.reasons.len(), 4);
}

#[test]
fn the_radius_of_a_square_lattice_is_the_distance_to_its_sixteenth_neighbour() {
    // Distances on a lattice of step 0.1: 4 of 1, 4 of √2, 4 of 2, 8 of √5 steps.
    let points = Positions::from_rows(&sheet(60, |a, b| [a, b, 7.0]));
    let found = automatic(&points).unwrap();
    assert!((found.radius - 0.1 * 5f64.sqrt()).abs() < 1e-6, "{}", found.radius);
    assert!((found.angle_deg, found.offset) == (10.0, 0.25 * found.radius), "{found:?}");
}

#[test]
fn heights_that_are_not_known_do_not_count() {
    let monitor = Monitor::default();
    // Two sheets far from each other, which are one category.
    let rows = [sheet(40, |a, b| [a, b, 0.0]), sheet(40, |a, b| [a + 5000.0, b, 300.0])].concat();
    let points = Positions::from_rows(&rows);
    let found = |heights: &[f32]| {
        let input = ClusterInput { points: &points, heights: Some(heights), colours: None };
        let found = cluster_levels(&input, &ClusterParams::default(), &monitor).unwrap();
        let table = found.features(ClusterForm::Descriptor, &monitor).unwrap();
        let column = table.names.iter().position(|name| name == "ClusterHeightL3").unwrap();
        assert_eq!(found.counts[..3], [2, 2, 1]);
        (0..3200).map(|i| table.row(i)[column]).collect::<Vec<f32>>()
    };
    let half: Vec<f32> = (0..3200).map(|i| if i % 2 == 0 { 4.0 } else { f32::NAN }).collect();
    assert_eq!(found(&half), vec![4.0; 3200]);
    // A sheet without heights has that of the other.
    let one: Vec<f32> = (0..3200).map(|i| if i < 1600 { 4.0 } else { f32::INFINITY }).collect();
    assert_eq!(found(&one), vec![4.0; 3200]);
    assert_eq!(found(&[f32::NAN; 3200]), vec![0.0; 3200]);
}

#[test]
fn given_parameters_are_used_and_the_others_found() {
    let params = ClusterParams { radius: Some(0.5), min_size: Some(33), ..ClusterParams::default() };
    let found = automatic_parameters(&street(1.0), &params, &Monitor::default()).unwrap();
    assert_eq!((found.radius, found.min_size), (0.5, 33));
    assert!(found.reasons[0].contains("given") && !found.reasons[2].contains("given"), "{:?}", found.reasons);
}

#[test]
fn clouds_without_segments_planes_or_extent() {
    let mut random = stream(2, 9);
    let few = Positions::from_rows(&sheet(6, |a, b| [a, b, 0.0]));
    let found = levels(&few, &ClusterParams::default());
    assert_eq!((found.counts, found.labels(2, &Monitor::default()).unwrap()), ([0; 4], vec![0; 36]));
    let volume: Positions = (0..3000).map(|_| [0; 3].map(|_| random.uniform() as f32)).collect();
    let found = levels(&volume, &ClusterParams { angle_deg: Some(0.01), ..ClusterParams::default() });
    assert_eq!(found.counts[0], 1);
    let far = [sheet(30, |a, b| [a, b, 0.0]), sheet(30, |a, b| [a + 5000.0, b, 300.0])].concat();
    assert_eq!(levels(&Positions::from_rows(&far), &ClusterParams::default()).counts[..2], [2, 2]);
    for count in [0, 1, 9, 99, 300_000] {
        let pile = levels(&Positions::from_rows(&vec![[1.0; 3]; count]), &ClusterParams::default());
        assert_eq!((pile.counts[0], pile.len()), (0, count));
    }
    let doubled: Positions = (0..990).map(|i| [(i / 99) as f32, 0.0, 0.0]).collect();
    let message = automatic(&doubled).unwrap_err().to_string();
    assert!(message.contains("coincide"), "{message}");
    let mut broken = few.clone();
    broken.x[3] = f32::NAN;
    assert!(automatic(&broken).is_err());
    let input = ClusterInput { points: &few, heights: Some(&[1.0]), colours: None };
    assert!(cluster_levels(&input, &ClusterParams::default(), &Monitor::default()).is_err());
    let bad = ClusterParams { growth: 1.0, ..ClusterParams::default() };
    assert!(automatic_parameters(&few, &bad, &Monitor::default()).unwrap_err().to_string().contains("growth"));
}

#[test]
fn the_levels_are_the_same_for_any_number_of_threads_and_order_of_the_points() {
    let points = street(1.0);
    let with = |threads: usize, points: &Positions| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let params =
            ClusterParams { automatic: AutomaticParams { sample: 30_000, ..Default::default() }, ..Default::default() };
        pool.install(|| levels(points, &params))
    };
    let one = with(1, &points);
    assert!(one == with(2, &points) && one == with(5, &points));
    let order: Vec<u32> = (0..points.len() as u32).rev().collect();
    let turned = with(2, &points.select(&order, &Monitor::default()).unwrap());
    let labels = |l: &ClusterLevels| l.labels(2, &Monitor::default()).unwrap();
    assert!(labels(&one).into_iter().rev().eq(labels(&turned)));
}
