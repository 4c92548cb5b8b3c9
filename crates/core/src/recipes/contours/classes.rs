//! The classes on both sides of a line.

use super::scaled::VOXEL;
use crate::cloud::{Cloud, Points, Positions, names};
use crate::contours::{Polyline, sampled};
use crate::error::{Error, Result};
use crate::neighbours::within;
use crate::parallel::Monitor;

/// Distance within which points lie beside a line, in voxels.
const REACH: f64 = 2.0;
/// Share of the points beside a line below which the second class is no side.
const SHARE: f64 = 0.1;

/// Points with their classes.
pub(super) struct Sides<'a> {
    positions: &'a Positions,
    /// Class of each point.
    codes: Vec<u8>,
}

/// The class of each point of a cloud: that of the caller, else the cloud's own; `None` if there is none.
///
/// # Errors
/// If there is not one class a point.
pub(super) fn codes_of(cloud: &Cloud, given: Option<&[u8]>) -> Result<Option<Vec<u8>>> {
    let all: Vec<u8> = match (given, cloud.column(names::CLASSIFICATION)) {
        (Some(codes), _) => codes.to_vec(),
        (None, Some(column)) => (0..cloud.len()).map(|i| column.values.get(i).clamp(0.0, 255.0) as u8).collect(),
        (None, None) => return Ok(None),
    };
    match all.len() == cloud.len() {
        true => Ok(Some(all)),
        false => {
            let found = format!("{} classes for {} points", all.len(), cloud.len());
            Err(Error::input(format!("{found} (allowed: one each)")))
        }
    }
}

impl<'a> Sides<'a> {
    /// Scaled points with their classes; `None` if there is only one class.
    pub(super) fn of(points: &'a Points, all: &[u8]) -> Option<Self> {
        let codes: Vec<u8> = points.frame.index.iter().map(|&i| all[i as usize]).collect();
        let several = codes.windows(2).any(|pair| pair[0] != pair[1]);
        several.then_some(Self { positions: &points.positions, codes })
    }

    /// For each line the two most frequent classes beside it, ascending; `None` if there is no point beside it.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn beside(&self, lines: &[Polyline], monitor: &Monitor) -> Result<Vec<Option<[u8; 2]>>> {
        let (mut places, mut ends) = (Positions::default(), Vec::with_capacity(lines.len()));
        for line in lines {
            sampled(std::slice::from_ref(line), VOXEL)?.iter().for_each(|place| places.push(place));
            ends.push(places.len());
        }
        let near = within(self.positions, &places, REACH * VOXEL, monitor)?;
        let mut first = 0;
        let pair = |end: usize| {
            let mut counts = [0usize; 256];
            let points = (first..end).flat_map(|place| near.of(place));
            points.for_each(|&i| counts[usize::from(self.codes[i as usize])] += 1);
            first = end;
            pair_of(&counts)
        };
        Ok(ends.into_iter().map(pair).collect())
    }
}

/// The two most frequent classes, ascending; one twice if the second is rare.
fn pair_of(counts: &[usize; 256]) -> Option<[u8; 2]> {
    let all: usize = counts.iter().sum();
    let mut order: Vec<usize> = (0..256).filter(|&code| counts[code] > 0).collect();
    order.sort_by_key(|&code| std::cmp::Reverse(counts[code]));
    let first = *order.first()?;
    let second = order.get(1).copied().filter(|&code| counts[code] as f64 >= SHARE * all as f64).unwrap_or(first);
    Some([first.min(second) as u8, first.max(second) as u8])
}
