//! Ground that may be the deck of a bridge over water: it lies between places without points, as water reflects the pulses
//! away, and above the ground along them.
//!
//! These points keep their class: dams between ponds look the same, and few open scans hold bridges to tell them by. Only
//! a warning says where they are.

use super::{AXES, GROUND, SPACINGS, axes_with_land, block, cell_edge, groups, plan_cell, quantile};
use crate::cloud::Points;
use crate::error::Result;
use crate::parallel::{Looks, Monitor, map_watched};
use crate::voxels::cells::Cells;
use crate::voxels::cells::index::CellIndex;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

/// Least edge of a cell in plan, metres; also [`SPACINGS`] point spacings.
const CELL: f64 = 1.0;
/// Greatest distance from the water on one side to that on the other, metres.
const WIDTH: f64 = 20.0;
/// Least extent of the water on each side, across, metres. It is at least three cells wide.
const WATER: f64 = 5.0;
/// Least area, square metres.
const AREA: f64 = 15.0;
/// Least height of a cell above the ground along the water, metres.
const RISE: f64 = 0.8;
/// That ground: in the region of this edge, metres, that holds the cell, and in those around it; at least so many cells.
const REGION: f64 = 20.0;
const FEWEST: usize = 10;
/// Its height: this share of these cells is lower.
const LOW: f64 = 0.3;
/// Largest step to the banks, metres; cells larger than 1 m may have as much for each metre.
const STEP: f64 = 0.4;
/// Cells away from water, at most, of that ground.
const NEAR: i32 = 2;
/// Somewhere between its two ends water has land on both sides along so many of [`AXES`]; the outside of a scan has not.
const WITH_LAND: usize = 2;
/// Eight directions, anticlockwise. Water lies on two sides if it does in directions at least three apart, 135 degrees.
const DIRECTIONS: [[i32; 2]; 8] = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];
const APART: usize = 3;
/// No void.
const NONE: RangeInclusive<usize> = RangeInclusive::new(1, 0);

/// Ground between water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    /// A ground point in its middle.
    pub(super) row: u32,
    /// Square metres.
    pub(super) area: f64,
    /// Height above the ground along the water, metres.
    pub(super) rise: f64,
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

/// What may be decks of bridges in the ground, the largest first. O(n log n).
pub(super) fn spans(scan: &Scan<'_>, monitor: &Monitor) -> Result<Vec<Span>> {
    let Scan { points, codes, wet, density } = *scan;
    let mut is_dry = vec![true; points.len()];
    wet.iter().for_each(|&row| is_dry[row as usize] = false);
    let dry: Vec<u32> = (0..points.len() as u32).filter(|&row| is_dry[row as usize]).collect();
    let edge = cell_edge(CELL, SPACINGS, density);
    let cells = Cells::new(dry.len(), |i| plan_cell(points, dry[i], edge), monitor)?;
    let ground = |cell: usize| {
        let rows = cells.of(cell).iter().map(|&i| dry[i as usize]);
        rows.filter(|&row| codes[points.frame.index[row as usize] as usize] == GROUND)
    };
    let height =
        |cell: usize| ground(cell).map(|row| f64::from(points.positions.z[row as usize])).fold(f64::NAN, f64::max);
    let heights = map_watched(cells.len(), monitor, height)?;
    let scene = Scene { index: CellIndex::new(cells.keys.clone()), heights, edge };
    let rises = scene.rises(&scene.shore(monitor)?, monitor)?;
    let span = |strip: Vec<usize>| {
        let mut own: Vec<f64> = strip.iter().map(|&cell| rises[cell]).collect();
        let row = ground(strip[strip.len() / 2]).next().unwrap_or_default();
        Span { row, area: strip.len() as f64 * edge.powi(2), rise: quantile(&mut own, 0.5) }
    };
    let mut spans: Vec<Span> = scene.strips(&rises, monitor)?.into_iter().map(span).collect();
    spans.sort_by(|a, b| b.area.total_cmp(&a.area));
    Ok(spans)
}

/// The cells of a cloud.
struct Scene {
    index: CellIndex<[i32; 2]>,
    /// The highest ground point of each cell, metres; not a number without ground.
    heights: Vec<f64>,
    /// Edge of a cell, metres.
    edge: f64,
}

impl Scene {
    /// The cells of ground near water.
    fn shore(&self, monitor: &Monitor) -> Result<Shore> {
        let keys = self.index.keys();
        let beside = map_watched(keys.len(), monitor, |cell| self.is_beside_water(cell))?;
        let is_near = |cell: usize| {
            let mut near = block(keys[cell], NEAR).filter_map(|key| self.index.find(key));
            !self.heights[cell].is_nan() && near.any(|near| beside[near])
        };
        let near = map_watched(keys.len(), monitor, is_near)?;
        let near: Vec<u32> = (0..near.len() as u32).filter(|&cell| near[cell as usize]).collect();
        let regions = Cells::new(near.len(), |i| self.region(near[i] as usize), monitor)?;
        Ok(Shore { index: CellIndex::new(regions.keys.clone()), near, regions })
    }

    /// The region of a cell.
    fn region(&self, cell: usize) -> [i32; 2] {
        self.index.keys()[cell].map(|axis| axis.div_euclid((REGION / self.edge).ceil() as i32))
    }

    /// For each cell between water its height above the ground along it, metres, if that is enough; else not a number.
    fn rises(&self, shore: &Shore, monitor: &Monitor) -> Result<Vec<f64>> {
        let regions: BTreeSet<[i32; 2]> = shore.index.keys().iter().flat_map(|&region| block(region, 1)).collect();
        let mut levels = BTreeMap::new();
        let mut looks = Looks::at(monitor);
        for region in regions {
            looks.step()?;
            levels.extend(self.shore_level(region, shore).map(|level| (region, level)));
        }
        // Most cells are far from water or low: what takes time comes last.
        let rise = |cell: usize| {
            let rise = self.heights[cell] - levels.get(&self.region(cell))?;
            (rise >= RISE && self.is_between_water(cell)).then_some(rise)
        };
        map_watched(self.heights.len(), monitor, |cell| rise(cell).unwrap_or(f64::NAN))
    }

    /// Height of the ground along the water in and around a region, metres, if there is enough of it.
    fn shore_level(&self, region: [i32; 2], shore: &Shore) -> Option<f64> {
        let regions = block(region, 1).filter_map(|key| shore.index.find(key));
        let cells = regions.flat_map(|region| shore.regions.of(region));
        let mut heights: Vec<f64> = cells.map(|&i| self.heights[shore.near[i as usize] as usize]).collect();
        (heights.len() >= FEWEST).then(|| quantile(&mut heights, LOW))
    }

    /// Raised cells between water that touch each other, are large enough together, and join two banks.
    fn strips(&self, rises: &[f64], monitor: &Monitor) -> Result<Vec<Vec<usize>>> {
        let cells = (0..rises.len()).filter(|&cell| !rises[cell].is_nan()).collect();
        let near = |cell: usize| self.ground_around(cell).filter(|&near| !rises[near].is_nan());
        let strips = groups(cells, near, monitor)?.into_iter();
        Ok(strips.filter(|strip| strip.len() as f64 * self.edge.powi(2) >= AREA && self.joins(strip)).collect())
    }

    /// Whether the ground that a strip meets without a step is in two pieces or more; a peninsula meets one. The cells of the
    /// strip ascend.
    fn joins(&self, strip: &[usize]) -> bool {
        let step = STEP * self.edge.max(1.0);
        let met = |&cell: &usize| {
            let near = self.ground_around(cell).filter(|near| strip.binary_search(near).is_err());
            near.filter(move |&near| (self.heights[near] - self.heights[cell]).abs() <= step)
        };
        let mut met: BTreeSet<usize> = strip.iter().flat_map(met).collect();
        let mut piece = Vec::from_iter(met.pop_first());
        while let Some(cell) = piece.pop() {
            piece.extend(self.ground_around(cell).filter(|near| met.remove(near)));
        }
        !met.is_empty()
    }

    /// Cells of ground around a cell, itself included.
    fn ground_around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let near = block(self.index.keys()[cell], 1).filter_map(|key| self.index.find(key));
        near.filter(|&near| !self.heights[near].is_nan())
    }

    /// Whether a place and the eight around it hold no points.
    fn is_empty(&self, key: [i32; 2]) -> bool {
        block(key, 1).all(|key| self.index.find(key).is_none())
    }

    /// Whether the next place but one in a direction is empty.
    fn is_beside_water(&self, cell: usize) -> bool {
        let key = self.index.keys()[cell];
        let next = |[x, y]: [i32; 2]| self.is_empty(moved(key, [x, y], 2)) || self.is_empty(moved(key, [-x, -y], 2));
        AXES.into_iter().any(next)
    }

    /// Whether a cell has water on two sides, not too far from each other.
    fn is_between_water(&self, cell: usize) -> bool {
        let key = self.index.keys()[cell];
        let voids = DIRECTIONS.map(|direction| self.void(key, direction));
        let mut water = [None; DIRECTIONS.len()];
        let mut is_water = |side: usize| *water[side].get_or_insert_with(|| self.is_water(key, side, &voids[side]));
        let pairs = (0..8).flat_map(|first| (APART..=4).map(move |apart| [first, (first + apart) % 8]));
        let is_near = |[a, b]: &[usize; 2]| self.distance(*a, &voids[*a]) + self.distance(*b, &voids[*b]) <= WIDTH;
        pairs.filter(is_near).any(|[a, b]| is_water(a) && is_water(b))
    }

    /// The nearest places without points in a direction, long enough for water: steps to the middles of the first and the
    /// last three cells.
    fn void(&self, key: [i32; 2], direction: [i32; 2]) -> RangeInclusive<usize> {
        let run = self.run(direction);
        let is_empty = |step: usize| self.is_empty(moved(key, direction, step as i32));
        let first = (1..=(WIDTH / run) as usize + 1).find(|&step| is_empty(step));
        let last = first.map(|first| first + ((WATER / run).ceil() as usize).saturating_sub(3));
        first
            .zip(last)
            .map(|(first, last)| first..=last)
            .filter(|void| void.clone().skip(1).all(is_empty))
            .unwrap_or(NONE)
    }

    /// The distance to a void, metres; infinite without one.
    fn distance(&self, side: usize, void: &RangeInclusive<usize>) -> f64 {
        if void.is_empty() { f64::INFINITY } else { (void.start() - 1) as f64 * self.run(DIRECTIONS[side]) }
    }

    /// Whether a void is water: the outside of a scan is none.
    fn is_water(&self, key: [i32; 2], side: usize, void: &RangeInclusive<usize>) -> bool {
        let land = |key: [i32; 2]| self.index.find(key).is_some();
        let at = |step: usize| moved(key, DIRECTIONS[side], step as i32);
        void.clone().any(|step| axes_with_land(at(step), self.edge, land) >= WITH_LAND)
    }

    /// Metres to the next cell in a direction.
    fn run(&self, [x, y]: [i32; 2]) -> f64 {
        self.edge * f64::from(x).hypot(f64::from(y))
    }
}

/// Cells of ground near water, by regions.
struct Shore {
    near: Vec<u32>,
    /// Numbers in `near`.
    regions: Cells<[i32; 2]>,
    index: CellIndex<[i32; 2]>,
}

/// The place some steps away.
fn moved([x, y]: [i32; 2], [dx, dy]: [i32; 2], steps: i32) -> [i32; 2] {
    [x.saturating_add(steps * dx), y.saturating_add(steps * dy)]
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
    fn a_bridge_over_a_canal_without_returns_is_found_and_a_level_dam_is_not() {
        let [span] = found(|x, y| canal(x, y, Some(1.2)))[..] else { panic!("not one span") };
        assert!((span.rise - 1.2).abs() < 0.05 && (60.0..110.0).contains(&span.area), "{span:?}");
        assert!(found(|x, y| canal(x, y, Some(0.2))).is_empty());
        assert!(found(|x, y| canal(x, y, None)).is_empty());
    }

    #[test]
    fn a_bridge_at_the_edge_of_a_scan_is_found_and_a_peninsula_is_not() {
        // Water has land along two axes only next to the bridge, 5 m from the edge.
        let height = |x: f64, y: f64| match (y - 60.0).abs() < 3.5 {
            true => ((x - 112.5).abs() < 2.5).then_some(1.2),
            false => Some(0.0),
        };
        assert_eq!(found(height).len(), 1);
        // A canal that turns by 45 degrees below the bridge.
        let bent = |x: f64, y: f64| {
            let off = if x < 60.0 { y - 60.0 } else { (y - 60.0 - (x - 60.0)) / 1.4 };
            match off.abs() < 4.0 {
                true => ((x - 60.0).abs() < 2.5).then_some(1.2),
                false => Some(0.0),
            }
        };
        assert_eq!(found(bent).len(), 1);
        let tip = |x: f64, y: f64| (y - 60.0).abs() < 8.0 && x > 50.0;
        let sea = |x: f64, y: f64| (y - 60.0).abs() < 30.0 && x > 20.0;
        let low = |x: f64| if x < 55.0 { 0.0 } else { 1.5 };
        assert!(found(|x, y| if tip(x, y) { Some(low(x)) } else { (!sea(x, y)).then_some(0.0) }).is_empty());
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
