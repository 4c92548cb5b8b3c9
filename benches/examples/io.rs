//! Reading and rewriting a file: `cargo run --profile quick -p scansion-benches --example io -- FILE [OUTPUT]`.

use scansion_core::cloud::{Column, Values};
use scansion_core::io::{self, Columns, Edit, ReadOptions, WriteOptions};
use std::path::Path;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let Some(input) = args.first().map(Path::new) else {
        eprintln!("give a file");
        return;
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
