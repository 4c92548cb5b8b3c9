//! LAZ compared with the crate `laz` (which is Python's `lazrs`), in alternating runs on one thread:
//! `RAYON_NUM_THREADS=1 cargo run --profile quick -p scansion-benches --example laz -- FILE.laz`.
//!
//! The crate decodes into raw records in memory and encodes from them into memory. Scansion decodes into columns; and
//! it reads the records from a file, encodes, writes, syncs and verifies a file. Seconds are processor time (Linux);
//! the median of the ratios is reported.

use laz::{LasZipCompressor, LasZipDecompressor, LazVlr};
use scansion_core::io::{self, Columns, ReadOptions, WriteOptions};
use std::io::Cursor;
use std::path::Path;

const ROUNDS: usize = 5;

fn number<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut out = [0; N];
    out.copy_from_slice(&bytes[at..at + N]);
    out
}

/// The LAZ record of a file, which `at` stands before the points.
fn laz_record(bytes: &[u8]) -> LazVlr {
    let mut at = usize::from(u16::from_le_bytes(number(bytes, 94)));
    loop {
        let length = usize::from(u16::from_le_bytes(number(bytes, at + 20)));
        if bytes[at + 2..].starts_with(b"laszip encoded") {
            let record = LazVlr::from_buffer(&bytes[at + 54..at + 54 + length]);
            return record.unwrap_or_else(|e| panic!("{e}"));
        }
        at += 54 + length;
    }
}

/// Processor time of this process, user and system, in hundredths of a second.
fn processor() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|f| f.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn timed(work: impl FnOnce()) -> f64 {
    let start = processor();
    work();
    processor() - start
}

fn main() {
    let input = std::env::args().nth(1).unwrap_or_else(|| panic!("a LAZ file"));
    let (input, folder) = (Path::new(&input), std::env::temp_dir());
    let bytes = std::fs::read(input).unwrap_or_else(|e| panic!("{e}"));
    let length = usize::from(u16::from_le_bytes(number(&bytes, 105)));
    let points = io::inspect(input).map_or(0, |info| info.points as usize);
    let (plain, packed) = (folder.join("scansion-laz.las"), folder.join("scansion-laz.laz"));
    let rewrite = |from: &Path, to: &Path| {
        io::rewrite(from, to, &[], &WriteOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    };
    rewrite(input, &plain);
    let mut raw = Vec::new();
    let mut rounds = [[0.0; ROUNDS]; 3];
    for round in 0..ROUNDS {
        drop(raw);
        raw = Vec::new();
        let peer = timed(|| {
            raw = vec![0; points * length];
            let start = u32::from_le_bytes(number(&bytes, 96));
            let mut source = Cursor::new(&bytes);
            source.set_position(u64::from(start));
            let mut decoder = LasZipDecompressor::new(source, laz_record(&bytes)).unwrap_or_else(|e| panic!("{e}"));
            decoder.decompress_many(&mut raw).unwrap_or_else(|e| panic!("{e}"));
        });
        let axes = ReadOptions { columns: Columns::Only(Vec::new()), ..Default::default() };
        let ours = timed(|| assert_eq!(io::read(input).map_or(0, |c| c.len()), points));
        let only = timed(|| assert_eq!(io::read_with(input, &axes).map_or(0, |c| c.len()), points));
        let peer_writes = timed(|| {
            let target = Cursor::new(Vec::with_capacity(bytes.len()));
            let mut encoder = LasZipCompressor::new(target, laz_record(&bytes)).unwrap_or_else(|e| panic!("{e}"));
            encoder.compress_many(&raw).and_then(|()| encoder.done()).unwrap_or_else(|e| panic!("{e}"));
        });
        let our_writing = timed(|| rewrite(&plain, &packed));
        rounds.iter_mut().zip([ours / peer, only / peer, our_writing / peer_writes]).for_each(|(r, v)| r[round] = v);
        println!(
            "read {ours:.3} s, coordinates {only:.3} s, peer {peer:.3} s; write {our_writing:.3} s, peer {peer_writes:.3} s"
        );
    }
    for (what, mut ratios) in ["read all", "read coordinates", "write"].into_iter().zip(rounds) {
        ratios.sort_by(f64::total_cmp);
        println!("{what}: {:.2} of the peer's time", ratios[ROUNDS / 2]);
    }
    for path in [plain, packed] {
        let _ = std::fs::remove_file(path);
    }
}
