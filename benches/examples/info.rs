//! Times what `scansion info` does on a LAZ file of 1 GB:
//! `cargo run --profile quick -p scansion-benches --example info -- FILE.laz [program]`.
//!
//! The file is a sparse copy of the given one (without EVLRs), with a hole between its points and its chunk table, so
//! that the first, the middle and the last bytes of a large file are read while it takes little disk space. With the
//! path of the program, a whole run of it is timed too.

#![allow(clippy::print_stdout, reason = "a program for people")]

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;
use std::time::Instant;

const SIZE: u64 = 1 << 30;
const ROUNDS: usize = 20;

fn long(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..).and_then(|b| b.first_chunk()).map(|b| u64::from_le_bytes(*b))
}

fn sparse(from: &Path, to: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let mut bytes = std::fs::read(from)?;
    let data =
        bytes.get(96..).and_then(|b| b.first_chunk()).map(|b| u32::from_le_bytes(*b)).ok_or("no header")? as usize;
    let table = long(&bytes, data).ok_or("no points")?;
    let chunk_table = bytes.split_off(table as usize);
    let place = SIZE - chunk_table.len() as u64;
    bytes[data..data + 8].copy_from_slice(&place.to_le_bytes());
    let mut file = File::create(to)?;
    file.write_all(&bytes)?;
    file.set_len(SIZE)?;
    file.seek(SeekFrom::Start(place))?;
    Ok(file.write_all(&chunk_table)?)
}

/// The shortest and the median time in milliseconds.
fn timed(
    mut work: impl FnMut() -> Result<(), Box<dyn std::error::Error>>,
) -> Result<(f64, f64), Box<dyn std::error::Error>> {
    let mut all = Vec::new();
    for _ in 0..ROUNDS {
        let start = Instant::now();
        work()?;
        all.push(start.elapsed().as_secs_f64() * 1e3);
    }
    all.sort_by(f64::total_cmp);
    Ok((all[0], all[ROUNDS / 2]))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let from = arguments.first().ok_or("a LAZ file")?;
    let path = std::env::temp_dir().join(format!("scansion-info-{}.laz", std::process::id()));
    sparse(Path::new(from), &path)?;
    let points = scansion_core::io::inspect(&path)?.points;
    let (least, median) = timed(|| Ok(scansion_core::io::inspect(&path).map(|_| ())?))?;
    println!("{points} points, {SIZE} bytes: {least:.2} ms, median {median:.2} ms");
    if let Some(program) = arguments.get(1) {
        let run = || match std::process::Command::new(program).arg("info").arg(&path).output()?.status.success() {
            true => Ok(()),
            false => Err("the program failed".into()),
        };
        let (least, median) = timed(run)?;
        println!("the whole program: {least:.2} ms, median {median:.2} ms");
    }
    Ok(std::fs::remove_file(&path)?)
}
