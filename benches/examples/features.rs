//! Nanoseconds per point and level on a raw f64 file: pyramid_speed xyz.bin first_scale
use scansion_core::{Cloud, cloud::Coordinates, features::*, parallel::Monitor};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let b = std::fs::read(&a[1]).unwrap();
    let v: Vec<f64> = b.chunks_exact(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect();
    let ax = |k: usize| v.iter().skip(k).step_by(3).copied().collect::<Vec<f64>>();
    let cloud = Cloud::new(Coordinates::Float([ax(0), ax(1), ax(2)])).unwrap();
    let mut set = FeatureSet::default();
    set.pyramid.first_scale = Some(a[2].parse().unwrap());
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    let m = Monitor::default();
    let all = set.names(set.pyramid.first_scale.unwrap());
    for (what, names) in [
        ("all", all.clone()),
        ("cov", all.iter().enumerate().filter(|(i, _)| i % 16 < 9).map(|x| x.1.clone()).collect()),
        ("cov+contour", all.iter().enumerate().filter(|(i, _)| i % 16 < 13).map(|x| x.1.clone()).collect()),
        ("height", all.iter().enumerate().filter(|(i, _)| i % 16 >= 13).map(|x| x.1.clone()).collect()),
    ] {
        let t = std::time::Instant::now();
        let e = Extractor::prepare(&cloud, &set, (Wanted::Names(&names), None), &m).unwrap();
        let prep = t.elapsed().as_secs_f64();
        let mut s = Scratch::default();
        let mut rows = Vec::new();
        let mut sum = 0.0f64;
        for b in 0..e.blocks() {
            e.block(b, &mut s, &mut rows);
            sum += f64::from(rows[rows.len() / 2]);
        }
        let total = t.elapsed().as_secs_f64();
        println!(
            "{what}: prepare {prep:.2} s, blocks {:.2} s, {:.0} ns per point and level in all, {:.0} k points/s ({sum})",
            total - prep,
            total * 1e9 / (v.len() as f64 / 3.0) / 9.0,
            v.len() as f64 / 3.0 / total / 1e3
        );
    }
}
