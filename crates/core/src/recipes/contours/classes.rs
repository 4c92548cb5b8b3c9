//! The classes on both sides of a line.

use super::scaled::VOXEL;
use crate::cloud::{Cloud, Column, Points, Positions, names};
use crate::contours::{Polyline, sampled};
use crate::error::{Error, Result};
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use std::collections::HashMap;

/// Distance within which points lie beside a line, in voxels.
const REACH: f64 = 2.0;
/// Share of the points beside a line below which the second class is no side.
const SHARE: f64 = 0.1;

/// Points whose nearest lines are held at a time.
const BLOCK: usize = 1 << 20;

/// Points with their classes.
pub(super) struct Sides<'a> {
    positions: &'a Positions,
    /// Class of each point, if it has one.
    codes: Vec<Option<u8>>,
}

/// The class of each point of a cloud: that of the caller, else the cloud's own, in which negative numbers and NaN are no
/// class; `None` if there are no classes.
///
/// # Errors
/// If there is not one class a point, or a number is no class.
pub(super) fn codes_of(cloud: &Cloud, given: Option<&[u8]>) -> Result<Option<Vec<Option<u8>>>> {
    let all: Vec<Option<u8>> = match (given, cloud.column(names::CLASSIFICATION)) {
        (Some(codes), _) => codes.iter().copied().map(Some).collect(),
        (None, Some(Column { values, .. })) => {
            let code = |i| match values.get(i) {
                code if code.is_nan() || code < 0.0 => Ok(None),
                code if code > 255.0 || code.fract() > 0.0 => {
                    Err(Error::input(format!("point {i} has class {code} (allowed: whole numbers up to 255)")))
                }
                code => Ok(Some(code as u8)),
            };
            (0..cloud.len()).map(code).collect::<Result<_>>()?
        }
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
    pub(super) fn of(points: &'a Points, all: &[Option<u8>]) -> Option<Self> {
        let codes: Vec<Option<u8>> = points.frame.index.iter().map(|&i| all[i as usize]).collect();
        let first = codes.iter().flatten().next();
        let several = codes.iter().flatten().any(|code| Some(code) != first);
        several.then_some(Self { positions: &points.positions, codes })
    }

    /// For each line the two most frequent classes beside it, ascending; `None` if there is no point beside it. A point
    /// lies beside the line that is nearest to it. O(n log s) for n points and s samples; memory for a
    /// million points at a time.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn beside(&self, lines: &[Polyline], monitor: &Monitor) -> Result<Vec<Option<[u8; 2]>>> {
        let (mut places, mut of) = (Positions::default(), Vec::new());
        for (number, line) in lines.iter().enumerate() {
            sampled(std::slice::from_ref(line), VOXEL / 2.0)?.iter().for_each(|place| places.push(place));
            of.resize(places.len(), number);
        }
        let mut counts: Vec<HashMap<u8, usize>> = vec![HashMap::new(); lines.len()];
        if places.is_empty() {
            return Ok(vec![None; lines.len()]);
        }
        let limit = (REACH * REACH * VOXEL * VOXEL) as f32;
        for first in (0..self.positions.len()).step_by(BLOCK) {
            let rows: Vec<u32> = (first..self.positions.len().min(first + BLOCK)).map(|i| i as u32).collect();
            let near = nearest_of(&places, &self.positions.select(&rows, monitor)?, 1, monitor)?;
            for (row, &i) in rows.iter().enumerate().filter(|(row, _)| near.squared_distances(*row)[0] <= limit) {
                if let Some(code) = self.codes[i as usize] {
                    *counts[of[near.of(row)[0] as usize]].entry(code).or_default() += 1;
                }
            }
        }
        Ok(counts.iter().map(pair_of).collect())
    }
}

/// The two most frequent classes, ascending; one twice if the second is rare.
fn pair_of(counts: &HashMap<u8, usize>) -> Option<[u8; 2]> {
    let all: usize = counts.values().sum();
    let mut order: Vec<[usize; 2]> = counts.iter().map(|(&code, &count)| [usize::from(code), count]).collect();
    order.sort_unstable_by_key(|&[code, count]| (std::cmp::Reverse(count), code));
    let [first, _] = *order.first()?;
    let often = order.get(1).filter(|[_, count]| *count as f64 >= SHARE * all as f64);
    let second = often.map_or(first, |[code, _]| *code);
    Some([first.min(second) as u8, first.max(second) as u8])
}
