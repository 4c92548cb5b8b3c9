//! Times sparse convolutions on random tensors and on a surface, and beside them products of dense matrices, ours and faer's:
//! the least of some runs, on all threads (`RAYON_NUM_THREADS`). With R, channels and a number: only the direct one, so often.
//!
//! Sub-manifold: 65,536 random sites in 256³ cells, kernel map included, as spconv's benchmark. Direct: density 1/r in r³
//! cells, filters of density 0.1, 0.3, 0.5 and 1, at most 1/r of the cells of a channel kept, as Hackel 2018, section 6.4.1.

#![allow(clippy::print_stdout, reason = "a program for people")]

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use scansion_core::nn::layers::Linear;
use scansion_core::nn::sites::{Connections, Convolution, Kernel, KernelMap, Sites};
use scansion_core::nn::sparse::{Attention, Selection, Shape, SparseConvolution, SparseFilter, SparseTensor};
use scansion_core::parallel::Monitor;
use scansion_core::random::stream;
use std::hint::black_box;
use std::time::Instant;

type Outcome<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

fn main() -> Outcome<()> {
    let monitor = Monitor::default();
    let chosen: Vec<usize> = std::env::args().skip(1).map(|word| word.parse()).collect::<Result<_, _>>()?;
    if let [side, channels, times] = chosen[..] {
        return (0..times).try_for_each(|_| direct(side, channels, 1.0, &monitor));
    }
    dense_product(&monitor)?;
    let mut draws = stream(1, 0);
    let keys: Result<Vec<u64>, _> =
        (0..65_536).map(|_| Sites::<3>::key(0, [0; 3].map(|_: i64| draws.below(256) as i64))).collect();
    let random = Sites::<3>::of_keys(keys?, &monitor)?;
    for [inputs, outputs] in [[8, 8], [16, 32]] {
        let (values, weights) = (vec![0.5f32; random.len() * inputs], vec![0.1f32; 27 * inputs * outputs]);
        let time = least(10, || {
            let map = KernelMap::new(&random, &random, Kernel::centred(3), &monitor)?;
            let layer = Convolution { connections: Connections::centred(&map), weights: &weights, inputs, outputs };
            Ok(layer.forward(&values, &monitor)?)
        })?;
        println!("sub-manifold, {} random sites, {inputs}->{outputs}, with map: {:.2} ms", random.len(), 1e3 * time);
    }
    surface(&monitor)?;
    for side in [16, 32, 64, 128, 256] {
        for filter_density in [0.1, 0.3, 0.5, 1.0] {
            direct(side, 1, filter_density, &monitor)?;
        }
    }
    for side in [32, 64, 128] {
        direct(side, 8, 1.0, &monitor)?;
    }
    Ok(())
}

/// Seconds of the fastest of some runs.
fn least<T>(runs: usize, mut work: impl FnMut() -> Outcome<T>) -> Outcome<f64> {
    let mut best = f64::INFINITY;
    for _ in 0..runs {
        let start = Instant::now();
        black_box(work()?);
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(best)
}

/// Speed in GFLOP/s of faer's product of 4096 rows of `width` values with a square matrix.
fn faer_product(width: usize) -> Outcome<f64> {
    let rows = 4096;
    let (left, right) = (Mat::<f32>::full(rows, width, 0.3), Mat::<f32>::full(width, width, 0.2));
    let mut out = Mat::<f32>::zeros(rows, width);
    let threads = match rayon::current_num_threads() {
        1 => Par::Seq,
        more => Par::rayon(more),
    };
    let time = least(50, || {
        matmul(out.as_mut(), Accum::Replace, left.as_ref(), right.as_ref(), 1.0, threads);
        Ok(())
    })?;
    Ok(2e-9 * (rows * width * width) as f64 / time)
}

fn dense_product(monitor: &Monitor) -> Outcome<()> {
    let (rows, inputs, outputs) = (4096, 512, 64);
    let (values, weights, bias) = (vec![0.3f32; rows * inputs], vec![0.2f32; inputs * outputs], vec![0.0f32; outputs]);
    let layer = Linear { weights: &weights, bias: &bias };
    let time = least(5, || Ok(layer.forward(&values, monitor)?))?;
    println!("dense product: {:.1} GFLOP/s", 2e-9 * (rows * inputs * outputs) as f64 / time);
    Ok(())
}

/// Hills of 600 x 600 cells.
fn surface(monitor: &Monitor) -> Outcome<()> {
    let height = |x: i64, y: i64| ((x as f64 / 30.0).sin() * 8.0 + (y as f64 / 21.0).cos() * 9.0 + 20.0) as i64;
    let places = (0..600).flat_map(|x| (0..600).map(move |y| [x, y, height(x, y)]));
    let keys: Result<Vec<u64>, _> = places.map(|place| Sites::<3>::key(0, place)).collect();
    let sites = Sites::<3>::of_keys(keys?, monitor)?;
    let map = KernelMap::new(&sites, &sites, Kernel::centred(3), monitor)?;
    let time = least(5, || Ok(KernelMap::new(&sites, &sites, Kernel::centred(3), monitor)?))?;
    println!("kernel map of a surface: {:.1} ns a site, {} pairs", 1e9 * time / sites.len() as f64, map.pairs());
    for width in [16, 32, 64, 96] {
        let (values, weights) = (vec![0.5f32; sites.len() * width], vec![0.1f32; 27 * width * width]);
        let connections = Connections::centred(&map);
        let layer = Convolution { connections, weights: &weights, inputs: width, outputs: width };
        let work = 2e-9 * (map.pairs() * width * width) as f64;
        let whole = faer_product(width)?;
        let forward = work / least(3, || Ok(layer.forward(&values, monitor)?))?;
        let backward = 2.0 * work / least(3, || Ok(layer.backward(&values, &values, monitor)?))?;
        println!(
            "sub-manifold, surface, {width}->{width}: forward {forward:.1}, backward {backward:.1} GFLOP/s; \
             faer {whole:.1}, of that {:.0} and {:.0} %",
            100.0 * forward / whole,
            100.0 * backward / whole
        );
    }
    Ok(())
}

/// A direct sparse convolution to eight channels.
fn direct(side: usize, channels: usize, filter_density: f64, monitor: &Monitor) -> Outcome<()> {
    let mut draws = stream(side as u64, channels as u64);
    let density = 1.0 / side as f64;
    let cells = side * side * side;
    let mut keys = Vec::new();
    for channel in 0..channels {
        let chosen = draws.choose(cells, (density * cells as f64) as usize);
        keys.extend(chosen.into_iter().map(|cell| (channel * cells) as u64 + u64::from(cell)));
    }
    let values: Vec<f32> = keys.iter().map(|_| draws.uniform() as f32).collect();
    let input = SparseTensor::new(Shape::new(1, channels, &[side; 3])?, keys, values)?;
    let weights: Vec<f32> = (0..channels * 8 * 27).map(|_| draws.normal() as f32).collect();
    let kept: Vec<bool> = weights.iter().map(|_| draws.uniform() < filter_density).collect();
    let filter = SparseFilter::of_dense([channels, 8], 3, 3, weights)?.pruned(|i, _| kept[i]);
    let selection = Some(Selection { attention: Attention::Positive, density });
    let layer = SparseConvolution { filter: &filter, bias: &[], selection };
    let time = least(5, || Ok(layer.forward(&input, monitor)?))?;
    println!("direct, r = {side}, {channels}->8, filter density {filter_density}: {:.2} ms", 1e3 * time);
    Ok(())
}
