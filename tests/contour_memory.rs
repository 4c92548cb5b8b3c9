//! The memory that lines take after points were rated follows from the edges, not from the number of points.

use peak_alloc::PeakAlloc;
use scansion_core::contours::{CandidateParams, Candidates, Likely, TraceParams, candidates, trace};
use scansion_core::parallel::Monitor;
use scansion_core::random::stream;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// A plate of 8 m with a hole of 4 m, whose points are likely near the rims.
fn plate(points: usize) -> Likely {
    let mut random = stream(3, 0);
    let mut likely = Likely::default();
    while likely.positions.len() < points {
        let [x, y] = [0, 1].map(|_| 8.0 * random.uniform());
        let rim = |low: f64, high: f64| (x - low).min(high - x).min(y - low).min(high - y);
        if rim(2.0, 6.0) > 0.0 {
            continue;
        }
        let outside = (2.0 - x).max(x - 6.0).max(2.0 - y).max(y - 6.0);
        likely.positions.push([x as f32, y as f32, 0.002 * random.uniform() as f32]);
        likely.likelihoods.push(if rim(0.0, 8.0).min(outside) < 0.05 { 0.9 } else { 0.02 });
        likely.tangents.push([0.0; 3]);
    }
    likely
}

/// The number of seeds, and the bytes that were taken besides the input.
fn drawn(likely: &Likely) -> (usize, usize) {
    let before = ALLOCATOR.current_usage();
    ALLOCATOR.reset_peak_usage();
    let found: Candidates = candidates(likely, &CandidateParams::default(), &Monitor::default()).unwrap();
    let sure = vec![0.9; found.list.len()];
    let lines = trace(&found, &sure, &TraceParams::default(), &Monitor::default()).unwrap();
    assert!(lines.polylines.len() >= 2, "the rims of the plate and of the hole");
    (found.seeds.len(), ALLOCATOR.peak_usage() - before)
}

#[test]
fn memory_follows_the_seeds_and_not_the_points() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let [few, many] = [200_000, 1_600_000].map(|points| {
        let likely = plate(points);
        let (seeds, bytes) = pool.install(|| drawn(&likely));
        eprintln!("{points} points, {seeds} seeds: {bytes} bytes, {} a seed", bytes / seeds);
        (seeds, bytes)
    });
    assert!((300..1000).contains(&few.0) && many.0.abs_diff(few.0) < few.0 / 4, "{few:?} {many:?}");
    // Eight times the points take hardly more memory: four bytes for each of the others would be too much.
    assert!(many.1 < 3 * few.1, "{few:?} {many:?}");
}
