//! Ground between two waters, which may be the deck of a bridge. Water reflects the pulses away: a piece of it is a place
//! without points and with land around.
//!
//! This ground keeps its class: dams between ponds look the same, and few open scans hold bridges to tell them by. Only
//! a warning says where it is.

use super::GROUND;
use super::plan::{PlanRows, SPACINGS, axes_with_land, block, cell_edge, each_cell, groups, pieces};
use crate::cloud::Points;
use crate::error::Result;
use crate::parallel::{Looks, Monitor, map_watched};
use crate::voxels::cells::index::CellIndex;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Least edge of a cell in plan, metres; also [`SPACINGS`] point spacings.
const CELL: f64 = 0.7;
/// Greatest distance from water to water over the ground between, metres.
const WIDTH: f64 = 20.0;
/// Least length of a water's shore, metres.
const SHORE: f64 = 20.0;
/// Least area of the ground between, square metres.
const AREA: f64 = 8.0;
/// Largest step to the banks, metres; cells larger than 1 m may have as much for each metre.
const STEP: f64 = 0.4;
/// Water has land on both sides along so many of four axes; the outside of a scan has not.
const WITH_LAND: usize = 2;
/// Way from the middle of one cell to that of the next, straight and diagonal, and from water to the middle of the first cell.
const STRAIGHT: u32 = 5;
const DIAGONAL: u32 = 7;
const ASHORE: u32 = 2;

/// Ground between two waters that joins two banks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    /// A ground point where it is narrowest.
    pub(super) row: u32,
    /// Its width there, from water to water, metres.
    pub(super) width: f64,
}

/// Points with classes.
pub(super) struct Scan<'a> {
    pub(super) points: &'a Points,
    /// One a point of the cloud.
    pub(super) codes: &'a [u8],
    /// Rows of points on water, which count as no points.
    pub(super) wet: &'a [u32],
    /// Points per square metre.
    pub(super) density: f64,
}

/// What may be decks of bridges in the ground, the narrowest first. O(n log n).
pub(super) fn spans(scan: &Scan<'_>, monitor: &Monitor) -> Result<Vec<Span>> {
    let Scan { points, codes, wet, density } = *scan;
    let mut is_dry = vec![true; points.len()];
    wet.iter().for_each(|&row| is_dry[row as usize] = false);
    let dry: Vec<u32> = (0..points.len() as u32).filter(|&row| is_dry[row as usize]).collect();
    let edge = cell_edge(CELL, SPACINGS, density);
    let cells = PlanRows::new(points, dry, edge, monitor)?;
    let is_ground = |row: &u32| codes[points.frame.index[*row as usize] as usize] == GROUND;
    let ground = |cell: usize| cells.of(cell).iter().copied().filter(is_ground);
    let height = |cell: usize| ground(cell).map(|row| points.positions.z[row as usize]).fold(f32::NAN, f32::max);
    let heights = map_watched(cells.len(), monitor, height)?;
    let scene = Scene { index: &cells.index, heights, edge };
    let ways = scene.ways(&scene.waters(monitor)?, monitor)?;
    let span = |strip: &Vec<usize>| {
        let (cell, way) = strip.iter().filter_map(|&cell| Some((cell, ways[cell]?))).min_by_key(|&(_, way)| way)?;
        let row = ground(cell).next()?;
        Some(Span { row, width: f64::from(way) / f64::from(STRAIGHT) * edge })
    };
    let mut spans: Vec<Span> = scene.strips(&ways, monitor)?.iter().filter_map(span).collect();
    spans.sort_by(|a, b| a.width.total_cmp(&b.width));
    Ok(spans)
}

/// The cells of a cloud.
struct Scene<'a> {
    index: &'a CellIndex<[i32; 2]>,
    /// The highest ground point of each cell, metres; not a number without ground.
    heights: Vec<f32>,
    /// Edge of a cell, metres.
    edge: f64,
}

/// Shores of waters, as empty cells.
struct Waters {
    keys: Vec<[i32; 2]>,
    /// Numbers in `keys`, one list a water.
    shores: Vec<Vec<usize>>,
}

/// A way from water to a cell; the shortest is the first in order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Way {
    /// [`STRAIGHT`] a cell.
    length: u32,
    water: u32,
    cell: u32,
}

impl Scene<'_> {
    /// Waters whose shore is long enough.
    fn waters(&self, monitor: &Monitor) -> Result<Waters> {
        let mut empty = each_cell(self.index.keys().len(), monitor, |cell| self.empty_beside(cell))?;
        empty.sort_unstable();
        empty.dedup();
        let land = |key: [i32; 2]| self.index.find(key).is_some();
        let is_water = map_watched(empty.len(), monitor, |i| axes_with_land(empty[i], self.edge, land) >= WITH_LAND)?;
        let keys: Vec<[i32; 2]> =
            empty.into_iter().zip(is_water).filter(|(_, is_water)| *is_water).map(|(key, _)| key).collect();
        let index = CellIndex::new(keys.clone());
        let near = |i: usize| block(keys[i], 1).filter_map(|key| index.find(key));
        let mut shores = groups((0..keys.len()).collect(), near, monitor)?;
        shores.retain(|shore| shore.len() as f64 * self.edge >= SHORE);
        Ok(Waters { keys, shores })
    }

    /// Empty cells two away from a cell whose neighbours are empty, too.
    fn empty_beside(&self, cell: usize) -> Vec<[i32; 2]> {
        let key = self.index.keys()[cell];
        let is_free = |key: [i32; 2]| self.index.find(key).is_none();
        // Most cells have points all around.
        if !block(key, 1).any(is_free) {
            return Vec::new();
        }
        block(key, 2).filter(|&near| block(near, 1).all(is_free)).collect()
    }

    /// For each cell of ground between two waters the length of the way from one to the other through it.
    fn ways(&self, waters: &Waters, monitor: &Monitor) -> Result<Vec<Option<u32>>> {
        let most = (WIDTH / self.edge * f64::from(STRAIGHT)) as u32;
        let mut open = BinaryHeap::new();
        for (water, shore) in waters.shores.iter().enumerate() {
            let near = shore.iter().flat_map(|&i| block(waters.keys[i], 2)).filter_map(|key| self.ground_at(key));
            open.extend(near.map(|cell| Reverse(Way { length: ASHORE, water: water as u32, cell: cell as u32 })));
        }
        let mut first: Vec<Option<Way>> = vec![None; self.heights.len()];
        let mut ways: Vec<Option<u32>> = vec![None; self.heights.len()];
        let mut looks = Looks::at(monitor);
        while let Some(Reverse(way)) = open.pop() {
            looks.step()?;
            let cell = way.cell as usize;
            match first[cell] {
                None => first[cell] = Some(way),
                Some(other) if other.water == way.water || ways[cell].is_some() => continue,
                Some(other) => ways[cell] = Some(other.length + way.length),
            }
            let key = self.index.keys()[cell];
            for near in self.ground_around(cell) {
                let [x, y] = self.index.keys()[near];
                let length = way.length + if x == key[0] || y == key[1] { STRAIGHT } else { DIAGONAL };
                if length <= most && first[near].is_none_or(|first| first.water != way.water) && ways[near].is_none() {
                    open.push(Reverse(Way { length, cell: near as u32, ..way }));
                }
            }
        }
        Ok(ways.into_iter().map(|way| way.filter(|&length| length <= most)).collect())
    }

    /// Cells between waters that touch each other, are large enough together, and join two banks.
    fn strips(&self, ways: &[Option<u32>], monitor: &Monitor) -> Result<Vec<Vec<usize>>> {
        let cells = (0..ways.len()).filter(|&cell| ways[cell].is_some()).collect();
        let near = |cell: usize| self.ground_around(cell).filter(|&near| ways[near].is_some());
        let strips = groups(cells, near, monitor)?.into_iter();
        Ok(strips.filter(|strip| strip.len() as f64 * self.edge.powi(2) >= AREA && self.joins(strip)).collect())
    }

    /// Whether the ground that a strip meets without a step is in two pieces or more; a peninsula meets one. The cells of the
    /// strip ascend.
    fn joins(&self, strip: &[usize]) -> bool {
        let step = STEP * self.edge.max(1.0);
        let met = |&cell: &usize| {
            let near = self.ground_around(cell).filter(|near| strip.binary_search(near).is_err());
            near.filter(move |&near| (f64::from(self.heights[near]) - f64::from(self.heights[cell])).abs() <= step)
        };
        pieces(strip.iter().flat_map(met).collect(), |cell| self.ground_around(cell)).len() >= 2
    }

    /// Cells of ground around a cell, itself included.
    fn ground_around(&self, cell: usize) -> impl Iterator<Item = usize> {
        block(self.index.keys()[cell], 1).filter_map(|key| self.ground_at(key))
    }

    /// The cell of a key if it holds ground.
    fn ground_at(&self, key: [i32; 2]) -> Option<usize> {
        self.index.find(key).filter(|&cell| !self.heights[cell].is_nan())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    /// 120 x 120 m of ground at 4 points a square metre, whose height is given; no points where it is not.
    fn found(height: impl Fn(f64, f64) -> Option<f64>) -> Vec<Span> {
        let places = (0..57_600).map(|i| [f64::from(i % 240) / 2.0 + 0.2, f64::from(i / 240) / 2.0 + 0.2]);
        let rows: Vec<[f64; 3]> = places.filter_map(|[x, y]| height(x, y).map(|z| [x, y, z])).collect();
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let codes = vec![GROUND; rows.len()];
        spans(&Scan { points: &points, codes: &codes, wet: &[], density: 4.0 }, &Monitor::default()).unwrap()
    }

    /// A canal 15 m wide along x, in the middle; on the bridge, 6 m wide, what `bridge` gives.
    fn canal(x: f64, y: f64, bridge: Option<f64>) -> Option<f64> {
        match (y - 60.0).abs() < 7.5 {
            true if (x - 60.0).abs() < 3.0 => bridge,
            true => None,
            false => Some(0.0),
        }
    }

    #[test]
    fn a_bridge_over_a_canal_without_returns_is_found_however_low() {
        for height in [0.0, 0.5, 1.2] {
            let [span] = found(|x, y| canal(x, y, Some(height)))[..] else { panic!("not one span") };
            assert!((span.width - 6.0).abs() < 1.5, "{span:?}");
        }
        assert!(found(|x, y| canal(x, y, None)).is_empty());
    }

    #[test]
    fn a_bridge_askew_over_a_narrow_canal_is_found() {
        for turn in [0.2, 0.5, 1.0] {
            let off = |x: f64, y: f64| (y - 60.0 - turn * (x - 60.0)) / turn.hypot(1.0);
            let along = |x: f64, y: f64| (x - 60.0 + turn * (y - 60.0)) / turn.hypot(1.0);
            let height = |x: f64, y: f64| (off(x, y).abs() > 2.3 || along(x, y).abs() < 4.0).then_some(0.0);
            assert_eq!(found(height).len(), 1, "{turn}");
        }
    }

    #[test]
    fn a_bridge_at_the_edge_of_a_scan_is_found_and_a_peninsula_is_not() {
        // Water has land along two axes only next to the bridge.
        let height = |x: f64, y: f64| match (y - 60.0).abs() < 3.5 {
            true => ((x - 92.5).abs() < 2.5).then_some(1.2),
            false => Some(0.0),
        };
        assert_eq!(found(height).len(), 1);
        let tip = |x: f64, y: f64| (y - 60.0).abs() < 8.0 && x > 50.0;
        let sea = |x: f64, y: f64| (y - 60.0).abs() < 30.0 && x > 20.0;
        let low = |x: f64| if x < 55.0 { 0.0 } else { 1.5 };
        assert!(found(|x, y| if tip(x, y) { Some(low(x)) } else { (!sea(x, y)).then_some(0.0) }).is_empty());
        // Land of 12 m between two lakes whose other banks are no nearer than 40 m: too wide only beyond 20 m.
        let lakes = |width: f64| {
            move |x: f64, y: f64| ((y - 60.0).abs() > 20.0 || (x - 60.0).abs() < width / 2.0).then_some(0.0)
        };
        assert_eq!([found(lakes(12.0)).len(), found(lakes(26.0)).len()], [1, 0]);
    }

    #[test]
    fn the_outside_of_a_scan_is_no_water() {
        // A ridge along the diagonal of a square, and its corners.
        let inside = |x: f64, y: f64| (x - 60.0).abs() + (y - 60.0).abs() < 50.0;
        assert!(found(|x, y| inside(x, y).then_some(2.0 - (x - 60.0).abs() / 25.0)).is_empty());
        // A path of 8 m.
        assert!(found(|x, y| ((y - 60.0).abs() < 4.0).then_some(x / 20.0)).is_empty());
        assert!(found(|_, _| None).is_empty());
    }
}
