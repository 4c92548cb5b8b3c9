//! Comparison of two LAS or LAZ files block by block.

use super::tally::Tally;
use super::{Changed, ClassChange, Difference, grid_tolerance, header};
use crate::cloud::{Column, Values, names};
use crate::error::Result;
use crate::io::las::{Header, Layout, Outside, Stream};
use crate::parallel::Monitor;
use rayon::prelude::*;
use std::path::Path;

/// Points of a block.
const BLOCK: usize = 250_000;

pub(super) fn diff(a: &Path, b: &Path, monitor: &Monitor) -> Result<Difference> {
    let (mut a, mut b) = (Stream::open(a)?, Stream::open(b)?);
    let points = [a.len(), b.len()];
    let mut found = Difference { points, compared: points[0].min(points[1]), ..Difference::default() };
    found.header = header::fields(&a.records, &b.records);
    found.records = header::records(&mut a.records, &mut b.records, monitor)?;
    let layouts = [&a, &b].map(|s| Layout::of(&s.records.header, &s.records.vlrs));
    found.only_in = [(0, 1), (1, 0)].map(|(one, other)| only_in(&layouts[one], &layouts[other]));
    let mut tallies = tallies(&a, &b, &layouts);
    found.types = types(&tallies, &layouts);
    let mut counts = vec![0u64; 1 << 16];
    let grids = same_grid(&a, &b);
    let mut outside = [&a, &b].map(|s| Outside::new(&s.records.header));
    monitor.stage("compare", found.compared);
    let mut first = 0;
    while first < found.compared {
        let most = (found.compared - first).min(BLOCK as u64) as usize;
        let blocks = [a.next(most, monitor)?, b.next(most, monitor)?];
        outside[0].add(&blocks[0], a.record_length());
        outside[1].add(&blocks[1], b.record_length());
        tallies.par_iter_mut().for_each(|tally| {
            if let [Some(one), Some(two)] = [0, 1].map(|f| layouts[f].column(&tally.name, &blocks[f])) {
                match tally.name.as_bytes() {
                    [axis @ b'X'..=b'Z'] if !grids => {
                        let place = |column: &Column, s: &Stream| coordinates(column, s, usize::from(axis - b'X'));
                        tally.compare(&place(&one, &a), &place(&two, &b), first);
                    }
                    _ => tally.compare(&one.values, &two.values, first),
                }
            }
        });
        let classes = [0, 1].map(|f| layouts[f].column(names::CLASSIFICATION, &blocks[f]));
        if let [Some(one), Some(two)] = classes {
            count_classes(&mut counts, &one.values, &two.values);
        }
        first += most as u64;
        monitor.advance(most as u64);
    }
    for (outside, stream) in outside.iter().zip([&a, &b]) {
        outside.report(&stream.records.path, &stream.records.header, monitor);
    }
    found.fields = tallies.into_iter().filter_map(Tally::finish).collect();
    if found.fields.iter().any(|f| f.name == names::CLASSIFICATION) {
        found.classes = class_changes(&counts);
    }
    Ok(found)
}

fn only_in(one: &Layout, other: &Layout) -> Vec<String> {
    one.names().filter(|name| !other.has(name)).map(String::from).collect()
}

/// Whether both files have the same scale and offset, so that integers can be compared.
fn same_grid(a: &Stream, b: &Stream) -> bool {
    let bits = |s: &Stream| (s.records.header.scale.map(f64::to_bits), s.records.header.offset.map(f64::to_bits));
    bits(a) == bits(b)
}

fn coordinates(ticks: &Column, stream: &Stream, axis: usize) -> Values {
    let header = &stream.records.header;
    let place = |t: &i32| f64::from(*t).mul_add(header.scale[axis], header.offset[axis]);
    match &ticks.values {
        Values::I32(ticks) => Values::F64(ticks.iter().map(place).collect()),
        other => other.clone(),
    }
}

/// A tally for each field that both files have.
fn tallies(a: &Stream, b: &Stream, layouts: &[Layout; 2]) -> Vec<Tally> {
    let (one, two) = (&a.records.header, &b.records.header);
    let grids = same_grid(a, b);
    let common = layouts[0].names().filter(|name| layouts[1].has(name));
    common
        .map(|name| {
            let mut tally = Tally::new(name);
            match name.as_bytes() {
                [axis @ b'X'..=b'Z'] => {
                    let axis = usize::from(axis - b'X');
                    let scale = one.scale[axis].min(two.scale[axis]);
                    let reach =
                        |header: &Header| f64::from(i32::MAX).mul_add(header.scale[axis], header.offset[axis].abs());
                    match grids {
                        true => tally.unit = scale,
                        false => tally.tolerance = grid_tolerance(scale, reach(one).max(reach(two))),
                    }
                }
                // Whole degrees before point format 6, units of 0.006 degrees from it on.
                b"ScanAngle" if (one.format < 6) != (two.format < 6) => tally.tolerance = 0.003_01,
                _ => {}
            }
            tally
        })
        .collect()
}

fn types(tallies: &[Tally], layouts: &[Layout; 2]) -> Vec<Changed> {
    let of = |layout: &Layout, name: &str| layout.column(name, &[]).map_or("", |c| c.values.type_name());
    let both = tallies.iter().map(|t| (&t.name, of(&layouts[0], &t.name), of(&layouts[1], &t.name)));
    both.filter(|(_, a, b)| a != b).map(|(name, a, b)| Changed::new(name, a, b)).collect()
}

/// Adds the pairs of codes to a table of 256 x 256 counts; those with another code are left out.
pub(super) fn count_classes(counts: &mut [u64], a: &Values, b: &Values) {
    for i in 0..a.len().min(b.len()) {
        let (from, to) = (a.get(i), b.get(i));
        if from <= 255.0 && to <= 255.0 {
            counts[usize::from(from as u8) << 8 | usize::from(to as u8)] += 1;
        }
    }
}

/// The pairs of codes that occur.
pub(super) fn class_changes(counts: &[u64]) -> Vec<ClassChange> {
    let pairs = counts.iter().enumerate().filter(|(_, n)| **n > 0);
    pairs.map(|(pair, &points)| ClassChange { from: (pair >> 8) as u8, to: pair as u8, points }).collect()
}
