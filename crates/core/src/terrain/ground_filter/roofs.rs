//! Roofs wider than the largest window, which no opening lowers: large parts of the ground that end in walls.
//!
//! Ground and roofs are both smooth, but ground can be reached from other ground without a step. G. Sithole, G. Vosselman,
//! *Filtering of airborne laser scanner data based on segmented point clouds*, ISPRS Archives XXXVI-3/W19, 2005, decide in
//! the same way, on segments of profiles.

use super::GroundParams;
use crate::cloud::Raster;
use crate::error::Result;
use crate::graph::UnionFind;
use crate::parallel::{Looks, Monitor, watched};
use crate::terrain::holes::nearest_filled;
use std::collections::{BTreeMap, BTreeSet};

/// Two heights farther apart than this say nothing of each other, metres; trenches are at most as wide.
const FAR: f64 = 15.0;
/// Slope of a wall, rise over run, at least.
const STEEPEST: f64 = 1.0;
/// The ground goes on between two heights that differ by at most this, metres, ...
const STEP: f64 = 0.3;
/// ... and by this share of their distance.
const SLOPE: f64 = 0.3;
/// A roof has walls down along at least this share of its border that is wall or level, ...
const OF_KNOWN: f64 = 0.75;
/// ... this share of its border on other ground, ...
const OF_ALL: f64 = 0.25;
/// ... and this many times its border that is that of the scan: a wall from border to border divides ground.
const OF_ENDS: f64 = 1.5;
/// Rounds of the search: a roof that stands on another one is found first.
const ROUNDS: usize = 4;

/// The ground without the roofs that are at least as large as the square of the window and whose walls are as high as
/// [`GroundParams::wall`]. The largest part of the ground always stays. O(cells).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn without_roofs(mut ground: Raster<f32>, params: &GroundParams, monitor: &Monitor) -> Result<Raster<f32>> {
    let given: Vec<bool> = ground.values().iter().map(|z| !z.is_nan()).collect();
    if params.wall == 0.0 || !given.contains(&true) {
        return Ok(ground);
    }
    let nearest = nearest_filled(&given, ground.columns(), monitor)?;
    let heights = Heights { ground: &ground, nearest, wall: params.wall };
    let Some(part) = heights.parts(monitor)? else { return Ok(ground) };
    let least = (params.window / params.cell).powi(2);
    let roofs = heights.roofs(&part, least, monitor)?;
    let values = ground.values_mut().iter_mut().zip(&part);
    values.filter(|(_, part)| roofs.contains(part)).for_each(|(z, _)| *z = f32::NAN);
    Ok(ground)
}

/// Heights with holes, and for each cell the nearest one with a height.
struct Heights<'a> {
    ground: &'a Raster<f32>,
    nearest: Vec<u32>,
    /// Least height of a wall, metres.
    wall: f64,
}

/// How two heights lie that are neighbours: their cells touch, or the holes between them are divided by nearness.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Step {
    /// The ground goes on.
    Level,
    /// A wall.
    Wall,
    /// Neither, or too far apart to be told.
    Between,
}

/// Two neighbouring heights, by their cells.
struct Pair {
    low: usize,
    high: usize,
    step: Step,
}

/// The border of a part of the ground, in cell edges.
#[derive(Clone, Copy, Default)]
struct Border {
    /// Walls that go down from the part, and walls that rise from it.
    down: usize,
    up: usize,
    /// Level ground, beside the part or beyond a trench.
    level: usize,
    /// Neither wall nor level.
    other: usize,
    /// The border of the raster.
    ends: usize,
}

impl Border {
    fn is_of_roof(&self) -> bool {
        let known = self.down + self.up + self.level;
        let down = self.down as f64;
        let least = [OF_KNOWN * known as f64, OF_ALL * (known + self.other) as f64, OF_ENDS * self.ends as f64];
        self.down > 0 && least.iter().all(|&least| down >= least)
    }
}

/// The part of a height that has none yet.
const NONE: u32 = u32::MAX;

impl Heights<'_> {
    /// Calls `with` for each pair of neighbouring cells whose nearest heights differ.
    fn pairs(&self, monitor: &Monitor, mut with: impl FnMut(Pair)) -> Result<()> {
        let (columns, rows) = (self.ground.columns(), self.ground.rows());
        let mut looks = Looks::at(monitor);
        for row in 0..rows {
            looks.steps(columns)?;
            for cell in row * columns..(row + 1) * columns {
                if cell + 1 < (row + 1) * columns {
                    self.pair(cell, cell + 1).into_iter().for_each(&mut with);
                }
                if row + 1 < rows {
                    self.pair(cell, cell + columns).into_iter().for_each(&mut with);
                }
            }
        }
        Ok(())
    }

    #[inline]
    fn pair(&self, cell: usize, beside: usize) -> Option<Pair> {
        let (a, b) = (self.nearest[cell] as usize, self.nearest[beside] as usize);
        if a == b {
            return None;
        }
        let z = self.ground.values();
        let (low, high) = if z[a] <= z[b] { (a, b) } else { (b, a) };
        let distance = match (a, b) == (cell, beside) {
            true => self.ground.cell(),
            false => self.distance(a, b),
        };
        let step = match f64::from(z[high]) - f64::from(z[low]) {
            _ if distance > FAR => Step::Between,
            height if height >= self.wall.max(STEEPEST * distance) => Step::Wall,
            height if height <= STEP + SLOPE * distance => Step::Level,
            _ => Step::Between,
        };
        Some(Pair { low, high, step })
    }

    /// The distance of two cells, metres.
    fn distance(&self, a: usize, b: usize) -> f64 {
        let columns = self.ground.columns();
        let apart = |f: fn(usize, usize) -> usize| f(a, columns).abs_diff(f(b, columns)) as f64;
        (apart(|i, n| i % n).powi(2) + apart(|i, n| i / n).powi(2)).sqrt() * self.ground.cell()
    }

    /// The part of each height, by a number of its own: heights that the ground goes on between. `None` if there is no
    /// wall.
    fn parts(&self, monitor: &Monitor) -> Result<Option<Vec<u32>>> {
        let cells = self.nearest.len();
        let mut at_wall = vec![false; cells];
        self.pairs(monitor, |pair| {
            if pair.step == Step::Wall {
                at_wall[pair.low] = true;
                at_wall[pair.high] = true;
            }
        })?;
        if !at_wall.contains(&true) {
            return Ok(None);
        }
        // Heights near a wall join nothing, so that stairs and ramps do not join a roof to the ground.
        let mut near = at_wall.clone();
        self.pairs(monitor, |pair| {
            if at_wall[pair.low] || at_wall[pair.high] {
                near[pair.low] = true;
                near[pair.high] = true;
            }
        })?;
        let mut joined = UnionFind::new(cells);
        self.pairs(monitor, |pair| {
            if pair.step == Step::Level && !near[pair.low] && !near[pair.high] {
                joined.unite(pair.low as u32, pair.high as u32);
            }
        })?;
        let mut part = joined.roots(monitor)?;
        drop(joined);
        part.iter_mut().zip(near).filter(|(_, near)| *near).for_each(|(part, _)| *part = NONE);
        self.grown(part, monitor).map(Some)
    }

    /// Gives the heights near walls to the parts beside them; those that lie at no part are parts of their own.
    fn grown(&self, mut part: Vec<u32>, monitor: &Monitor) -> Result<Vec<u32>> {
        // Two rings of heights are near a wall.
        for _ in 0..3 {
            let mut next = part.clone();
            self.pairs(monitor, |pair| {
                for (from, to) in [(pair.low, pair.high), (pair.high, pair.low)] {
                    if pair.step == Step::Level && part[to] == NONE {
                        next[to] = next[to].min(part[from]);
                    }
                }
            })?;
            part = next;
        }
        part.iter_mut().zip(0..).filter(|(part, _)| **part == NONE).for_each(|(part, own)| *part = own);
        Ok(part)
    }

    /// The parts of at least `least` cells that are roofs.
    fn roofs(&self, part: &[u32], least: f64, monitor: &Monitor) -> Result<BTreeSet<u32>> {
        let mut area = vec![0u32; part.len()];
        for piece in watched(part.len(), monitor) {
            self.nearest[piece?].iter().for_each(|&height| area[part[height as usize] as usize] += 1);
        }
        let largest = (0..).zip(&area).max_by_key(|(_, area)| **area).map(|(part, _): (u32, _)| part);
        let wide = |part: u32| f64::from(area[part as usize]) >= least && Some(part) != largest;
        let mut roofs = BTreeSet::new();
        for _ in 0..ROUNDS {
            let mut borders = self.ends(part, wide);
            self.pairs(monitor, |pair| {
                let (low, high) = (part[pair.low], part[pair.high]);
                if low == high {
                    return;
                }
                for (own, other) in [(low, high), (high, low)].into_iter().filter(|(own, _)| wide(*own)) {
                    let border = borders.entry(own).or_default();
                    match pair.step {
                        Step::Level => border.level += 1,
                        Step::Wall if own == high => {
                            match self.is_trench(&pair, |at| part[at] != own && !roofs.contains(&part[at])) {
                                true => border.level += 1,
                                false => border.down += 1,
                            }
                        }
                        Step::Wall => border.up += usize::from(!roofs.contains(&other)),
                        Step::Between => border.other += 1,
                    }
                }
            })?;
            let before = roofs.len();
            roofs.extend(borders.into_iter().filter(|(_, border)| border.is_of_roof()).map(|(part, _)| part));
            if roofs.len() == before {
                break;
            }
        }
        Ok(roofs)
    }

    /// Whether the wall is that of a trench, a canal or a cutting: beyond its foot, in the direction away from it, there is
    /// ground of another part that is at most half of the least wall lower than its top. `other` tells the heights of such
    /// parts.
    fn is_trench(&self, wall: &Pair, other: impl Fn(usize) -> bool) -> bool {
        let (columns, rows, z) = (self.ground.columns(), self.ground.rows(), self.ground.values());
        let at = |cell: usize| [cell % columns, cell / columns].map(|v| v as f64);
        let (foot, top) = (at(wall.low), at(wall.high));
        let away = [foot[0] - top[0], foot[1] - top[1]];
        let length = away[0].hypot(away[1]);
        (1..=(FAR / self.ground.cell()) as usize).any(|steps| {
            let [x, y] = [0, 1].map(|axis| (foot[axis] + away[axis] / length * steps as f64).round());
            if x < 0.0 || y < 0.0 || x >= columns as f64 || y >= rows as f64 {
                return false;
            }
            let beyond = self.nearest[y as usize * columns + x as usize] as usize;
            other(beyond) && f64::from(z[wall.high]) - f64::from(z[beyond]) <= 0.5 * self.wall
        })
    }

    /// The edges of the raster that belong to wide parts.
    fn ends(&self, part: &[u32], wide: impl Fn(u32) -> bool) -> BTreeMap<u32, Border> {
        let (columns, rows) = (self.ground.columns(), self.ground.rows());
        let across = (0..columns).flat_map(|c| [c, (rows - 1) * columns + c]);
        let along = (0..rows).flat_map(|r| [r * columns, (r + 1) * columns - 1]);
        let mut borders = BTreeMap::<u32, Border>::new();
        for cell in across.chain(along) {
            let own = part[self.nearest[cell] as usize];
            if wide(own) {
                borders.entry(own).or_default().ends += 1;
            }
        }
        borders
    }
}
