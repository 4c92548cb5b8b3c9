//! Tests of the whole extraction, from likelihoods to lines.

use super::*;
use crate::cloud::Positions;
use crate::random::{Stream, stream};

/// The twelve edges of a box.
fn edges(size: [f32; 3]) -> Vec<Polyline> {
    let corner = |k: usize| [0, 1, 2].map(|i| if k >> i & 1 == 1 { size[i] } else { 0.0 });
    let pairs = (0..8usize).flat_map(|k| (0..3).map(move |i| [k, k | 1 << i])).filter(|[a, b]| a != b);
    pairs.map(|pair| Polyline { vertices: pair.map(corner).to_vec(), ..Polyline::default() }).collect()
}

/// Points on a box, more likely near its edges, with noise.
fn scan(size: [f32; 3], noise: f64, random: &mut Stream) -> Likely {
    let mut likely = Likely::default();
    let near = |v: f32, far: f32| v.min(far - v).abs();
    let area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2]);
    for _ in 0..(area * 1600.0) as usize {
        let axis = random.below(3);
        let mut at = size.map(|s| (random.uniform() * f64::from(s)) as f32);
        at[axis] = if random.below(2) == 0 { 0.0 } else { size[axis] };
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let [a, b] = others.map(|i| near(at[i], size[i]));
        let tangent = if a < b { others[1] } else { others[0] };
        let likelihood = (1.0 - a.min(b) / 0.08).max(0.0) * (0.85 + 0.15 * random.uniform() as f32);
        likely.likelihoods.push(likelihood.max(0.02));
        let mut direction = [0.0; 3].map(|_: f32| 0.1 * random.normal() as f32);
        direction[tangent] = 1.0;
        likely.tangents.push(direction);
        likely.positions.push(at.map(|v| v + (noise * random.normal()) as f32));
    }
    likely
}

/// A stand-in for the classifier: mean likelihood and straightness.
fn probabilities(of: &Candidates) -> Vec<f32> {
    let one = |row: &[f32]| (row[15..20].iter().sum::<f32>() / 5.0 * (0.5 + 0.5 * (row[3] + row[4]))).clamp(0.0, 1.0);
    of.descriptors.chunks(VALUES).map(one).collect()
}

fn traced(likely: &Likely, params: &TraceParams) -> Traced {
    let monitor = Monitor::default();
    let found = candidates(likely, &CandidateParams::default(), &monitor).unwrap();
    trace(&found, &probabilities(&found), params, &monitor).unwrap()
}

#[test]
fn a_box_is_twelve_lines() {
    for seed in 0..3 {
        let size = [2.0, 1.5, 1.0];
        let likely = scan(size, 0.005, &mut stream(seed, 1));
        let monitor = Monitor::default();
        // The field as printed, and coarser lines than those of the built-in model: the stand-in is no calibrated classifier.
        let field = FieldParams { bias: 0.0, continuation_angle: 0.0, ..FieldParams::default() };
        let tidy = TidyParams { corner: 0.2, loop_width: 0.1, ..TidyParams::default() };
        let seeds = SeedParams { suppression: Suppression::All, ..SeedParams::default() };
        let found = candidates(&likely, &CandidateParams { seeds, ..CandidateParams::default() }, &monitor).unwrap();
        let traced =
            trace(&found, &probabilities(&found), &TraceParams { field, tidy, ..TraceParams::default() }, &monitor)
                .unwrap();
        let lines = ComparedLines { found: &traced.polylines, reference: &edges(size), unsure: &[] };
        let scores = score_lines(&lines, &ScoreParams::default(), &monitor).unwrap();
        let (precision, recall) = (scores.precision().unwrap(), scores.recall().unwrap());
        let lengths: Vec<f64> = traced.polylines.iter().map(Polyline::length).collect();
        assert!(recall > 0.95 && precision > 0.9, "seed {seed}: {scores:?} {lengths:?}");
        assert!((11..=14).contains(&traced.polylines.len()), "seed {seed}: {lengths:?}");
        for line in &traced.polylines {
            assert!(line.nodes.iter().all(|&point| likely.likelihoods[point as usize] >= 0.1));
            assert!((0.0..=1.0).contains(&line.confidence) && line.vertices.len() >= 2);
        }
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let likely = scan([1.0, 1.0, 1.0], 0.01, &mut stream(4, 1));
    let with = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| traced(&likely, &TraceParams::default()))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn by_the_letter_vertices_are_points_of_the_cloud() {
    let likely = scan([1.0, 1.0, 0.5], 0.005, &mut stream(5, 1));
    let plain = TraceParams {
        tidy: TidyParams::plain(0.05),
        parts: PartParams { least: 0.0, ..PartParams::default() },
        ..TraceParams::default()
    };
    let unmoved = RidgeParams { passes: 0, ..RidgeParams::default() };
    let params = CandidateParams { ridge: unmoved, ..CandidateParams::default() };
    let monitor = Monitor::default();
    let from = candidates(&likely, &params, &monitor).unwrap();
    let found = trace(&from, &probabilities(&from), &plain, &monitor).unwrap();
    assert!(!found.polylines.is_empty());
    for line in &found.polylines {
        let mut points = line.nodes.iter().map(|&node| likely.positions.xyz(node as usize));
        assert!(line.vertices.iter().all(|vertex| points.any(|point| point == *vertex)));
    }
}

#[test]
fn nothing_one_point_copies_and_a_flat_plane_have_no_contours() {
    let of = |rows: &[[f32; 3]], likelihood: f32| Likely {
        positions: Positions::from_rows(rows),
        likelihoods: vec![likelihood; rows.len()],
        tangents: vec![[1.0, 0.0, 0.0]; rows.len()],
    };
    let plane: Vec<[f32; 3]> = (0..2500).map(|i| [(i % 50) as f32 * 0.02, (i / 50) as f32 * 0.02, 0.0]).collect();
    let far: Vec<[f32; 3]> = (0..40).map(|i| [i as f32 * 100.0, 0.0, 0.0]).collect();
    for likely in [of(&[], 0.5), of(&[[0.0; 3]], 0.9), of(&[[1.0; 3]; 99], 0.9), of(&plane, 0.05), of(&far, 0.9)] {
        let found = traced(&likely, &TraceParams::default());
        assert!(found.polylines.is_empty() && found.choice.active.is_empty());
        assert!(baselines::canny(&likely, &Default::default(), &Monitor::default()).unwrap().is_empty());
    }
    assert!(
        candidates(
            &Likely { likelihoods: vec![2.0], ..of(&[[0.0; 3]], 0.5) },
            &CandidateParams::default(),
            &Monitor::default()
        )
        .is_err()
    );
}

#[test]
fn candidates_that_are_no_contours_and_wrong_probabilities() {
    let likely = scan([0.5, 0.5, 0.5], 0.005, &mut stream(6, 1));
    let monitor = Monitor::default();
    let found = candidates(&likely, &CandidateParams::default(), &monitor).unwrap();
    assert_eq!(found.descriptors.len(), VALUES * found.list.len());
    let none = trace(&found, &vec![0.01; found.list.len()], &TraceParams::default(), &monitor).unwrap();
    assert!(none.polylines.is_empty());
    assert!(trace(&found, &[], &TraceParams::default(), &monitor).is_err());
    monitor.cancel();
    assert!(candidates(&likely, &CandidateParams::default(), &monitor).is_err());
}
