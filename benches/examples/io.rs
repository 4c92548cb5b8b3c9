//! Reading and rewriting a file: `cargo run --profile quick -p scansion-benches --example io -- FILE [OUTPUT]`; without a
//! file: every format from the page cache, written and read, with nanoseconds a point and bytes a second (`SCANSION_POINTS=2000000`).

use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::io::{self, Columns, Edit, ReadOptions, WriteOptions};
use std::path::Path;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let Some(input) = args.first().map(Path::new) else {
        return all_formats();
    };
    let time = |what: &str, work: &mut dyn FnMut() -> usize| {
        let start = Instant::now();
        let points = work();
        let seconds = start.elapsed().as_secs_f64();
        println!("{what:24} {seconds:8.3} s  {:8.2} M points/s", points as f64 / seconds / 1e6);
    };
    time("inspect", &mut || io::inspect(input).map_or(0, |info| info.points as usize));
    let only = |names: &[&str]| ReadOptions {
        columns: Columns::Only(names.iter().map(ToString::to_string).collect()),
        ..ReadOptions::default()
    };
    let read = |options: &ReadOptions| io::read_with(input, options).map_or(0, |cloud| cloud.len());
    time("read coordinates", &mut || read(&only(&[])));
    time("read class, intensity", &mut || read(&only(&["Classification", "Intensity"])));
    let mut points = 0;
    time("read all", &mut || {
        points = read(&ReadOptions::default());
        points
    });
    let Some(output) = args.get(1).map(Path::new) else { return };
    let edits = [
        Edit::Classification(vec![2; points]),
        Edit::Dimension(Column::new("Confidence", Values::F32((0..points).map(|i| (i % 97) as f32 / 97.0).collect()))),
    ];
    time("rewrite with 2 edits", &mut || {
        io::rewrite(input, output, &edits, &WriteOptions::default()).map_or(0, |report| report.points as usize)
    });
}

/// A cloud like that of an airborne scan, with colours.
fn scan(n: usize) -> Cloud {
    let mut random = scansion_core::random::stream(1, 0);
    let rows: Vec<[f64; 3]> = (0..n)
        .map(|i| [652_000.0 + (i % 3000) as f64 * 0.07, 6_861_000.0 + (i / 3000) as f64 * 0.3, 30.0 * random.uniform()])
        .map(|p| p.map(|v| (v * 1000.0).round() / 1000.0))
        .collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap_or_else(|e| panic!("{e}"));
    let mut set = |name: &str, values: Values| {
        let _ = cloud.set_column(Column::new(name, values));
    };
    set("Intensity", Values::U16((0..n).map(|i| (i * 7919 % 4096) as u16).collect()));
    for name in ["Red", "Green", "Blue"] {
        set(name, Values::U8((0..n).map(|i| (i * 31 % 256) as u8).collect()));
    }
    set("Classification", Values::U8((0..n).map(|i| [2, 5, 6][i % 3]).collect()));
    cloud
}

/// Writes and reads a file of each format; the best of five times.
fn all_formats() {
    let n = std::env::var("SCANSION_POINTS").ok().and_then(|v| v.parse().ok()).unwrap_or(2_000_000);
    let folder = std::env::temp_dir().join(format!("scansion-io-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap_or_else(|e| panic!("{e}"));
    let cloud = scan(n);
    println!("{n} points, {} threads", rayon::current_num_threads());
    println!(
        "{:8} {:>9} {:>15} {:>14} {:>10} {:>12}",
        "file", "MB", "write ns/point", "read ns/point", "read MB/s", "blocks MB/s"
    );
    for name in ["a.las", "a.laz", "a.ply", "a.pcd", "c.pcd", "a.npz", "a.xyz", "a.csv"] {
        let path = folder.join(name);
        let options = WriteOptions { compressed: name.starts_with('c'), ..WriteOptions::default() };
        let best = |work: &dyn Fn() -> usize| {
            let times = (0..5).map(|_| {
                let start = Instant::now();
                assert_eq!(work(), n);
                start.elapsed().as_secs_f64()
            });
            times.fold(f64::INFINITY, f64::min)
        };
        let wrote = best(&|| {
            io::write(&path, &cloud, &options).unwrap_or_else(|e| panic!("{e}"));
            n
        });
        let bytes = std::fs::metadata(&path).map_or(0, |m| m.len()) as f64 / 1e6;
        let read = best(&|| io::read(&path).map_or(0, |c| c.len()));
        let blocks = best(&|| {
            let blocks = io::blocks(&path, 50_000, &ReadOptions::default());
            blocks.map_or(0, |blocks| blocks.map(|b| b.map_or(0, |b| b.len())).sum())
        });
        let ns = |seconds: f64| seconds * 1e9 / n as f64;
        println!(
            "{name:8} {bytes:9.1} {:15.0} {:14.0} {:10.0} {:12.0}",
            ns(wrote),
            ns(read),
            bytes / read,
            bytes / blocks
        );
    }
    let _ = std::fs::remove_dir_all(&folder);
}
