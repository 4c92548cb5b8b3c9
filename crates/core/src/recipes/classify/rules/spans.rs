//! Ground that may be the deck of a bridge over water: it lies between places without points, as water reflects the pulses
//! away, and above the ground along them.
//!
//! These points keep their class: dams between ponds look the same, and few open scans hold bridges to tell them by. Only
//! a warning says where they are.

use super::{AXES, GROUND, SPACINGS, axes_with_land, block, cell_edge, plan_cell, quantile};
use crate::cloud::Points;
use crate::error::Result;
use crate::graph::UnionFind;
use crate::parallel::{Looks, Monitor, map_watched};
use crate::voxels::cells::Cells;
use crate::voxels::cells::index::CellIndex;
use std::collections::BTreeSet;

/// Least edge of a cell in plan, metres; also [`SPACINGS`] point spacings.
const CELL: f64 = 1.0;
/// Greatest distance from the water on one side to that on the other, metres.
const WIDTH: f64 = 20.0;
/// Least extent of the water on each side, across, metres. It is at least three cells wide.
const WATER: f64 = 5.0;
/// Least area, square metres.
const AREA: f64 = 15.0;
/// Least height above the ground along the water, metres.
const RISE: f64 = 0.6;
/// That ground: in regions of this edge, metres, that hold cells of the span, and in those around them; at least so many cells.
const REGION: f64 = 20.0;
const FEWEST: usize = 10;
/// Its height: this share of these cells is lower.
const LOW: f64 = 0.3;
/// Cells away from water, at most, of that ground.
const NEAR: i32 = 2;
/// Water has land on both sides along so many of [`AXES`], at least; the outside of a scan has not.
const WITH_LAND: usize = 2;

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
    let shore = scene.shore(monitor)?;
    let mut spans = Vec::new();
    for strip in scene.strips(&shore, monitor)? {
        if let Some(rise) = scene.rise(&strip, &shore, monitor)?.filter(|&rise| rise >= RISE) {
            let row = ground(strip[strip.len() / 2]).next().unwrap_or_default();
            spans.push(Span { row, area: strip.len() as f64 * edge.powi(2), rise });
        }
    }
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

    /// Cells of ground between water that touch each other, and are large enough together.
    fn strips(&self, shore: &Shore, monitor: &Monitor) -> Result<Vec<Vec<usize>>> {
        // Most cells are far from water.
        let is_strip = |cell: usize| {
            let near = || block(self.region(cell), 1).any(|key| shore.index.find(key).is_some());
            !self.heights[cell].is_nan() && near() && self.is_between_water(cell)
        };
        let strip = map_watched(self.heights.len(), monitor, is_strip)?;
        let mut cells: Vec<usize> = (0..strip.len()).filter(|&cell| strip[cell]).collect();
        let mut strips = UnionFind::new(strip.len());
        let mut looks = Looks::at(monitor);
        for &cell in &cells {
            looks.step()?;
            let near = block(self.index.keys()[cell], 1).filter_map(|key| self.index.find(key));
            for near in near.filter(|&near| strip[near]) {
                strips.unite(cell as u32, near as u32);
            }
        }
        let roots = strips.roots(monitor)?;
        cells.sort_by_key(|&cell| roots[cell]);
        let strips = cells.chunk_by(|&a, &b| roots[a] == roots[b]).map(<[usize]>::to_vec);
        Ok(strips.filter(|strip| strip.len() as f64 * self.edge.powi(2) >= AREA).collect())
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

    /// Whether a cell has water on two opposite sides, not too far from each other.
    fn is_between_water(&self, cell: usize) -> bool {
        let key = self.index.keys()[cell];
        AXES.into_iter().any(|[x, y]| {
            let both = |width: f64| {
                let first = self.water(key, [x, y], width)?;
                self.water(key, [-x, -y], width - first)
            };
            both(WIDTH).is_some()
        })
    }

    /// The distance to the water in a direction, metres, if there is some within a distance.
    fn water(&self, key: [i32; 2], direction: [i32; 2], most: f64) -> Option<f64> {
        let run = self.edge * f64::from(direction[0]).hypot(f64::from(direction[1]));
        let at = |step: usize| moved(key, direction, step as i32);
        // The middle of the empty block is a cell further.
        let first = (1..=(most / run) as usize + 1).find(|&step| self.is_empty(at(step)))?;
        let last = first + (WATER / run).ceil() as usize - 1;
        let open = (first + 1..=last).all(|step| self.is_empty(at(step)));
        let land = |key: [i32; 2]| self.index.find(key).is_some();
        (open && axes_with_land(at(last), self.edge, land) >= WITH_LAND).then_some((first - 1) as f64 * run)
    }

    /// Height of a strip above the ground along the water near it, metres, if there is enough of that.
    fn rise(&self, strip: &[usize], shore: &Shore, monitor: &Monitor) -> Result<Option<f64>> {
        let of_strip: BTreeSet<usize> = strip.iter().copied().collect();
        let regions: BTreeSet<[i32; 2]> = strip.iter().flat_map(|&cell| block(self.region(cell), 1)).collect();
        let cells =
            regions.into_iter().filter_map(|key| shore.index.find(key)).flat_map(|region| shore.regions.of(region));
        let mut heights = Vec::new();
        let mut looks = Looks::at(monitor);
        for cell in cells.map(|&number| shore.near[number as usize] as usize) {
            looks.step()?;
            let mut around = block(self.index.keys()[cell], NEAR).filter_map(|key| self.index.find(key));
            if !around.any(|near| of_strip.contains(&near)) {
                heights.push(self.heights[cell]);
            }
        }
        let mut own: Vec<f64> = strip.iter().map(|&cell| self.heights[cell]).collect();
        Ok((heights.len() >= FEWEST).then(|| quantile(&mut own, 0.5) - quantile(&mut heights, LOW)))
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
    fn the_outside_of_a_scan_is_no_water() {
        // A ridge along the diagonal of a square, and its corners.
        let inside = |x: f64, y: f64| (x - 60.0).abs() + (y - 60.0).abs() < 50.0;
        assert!(found(|x, y| inside(x, y).then_some(2.0 - (x - 60.0).abs() / 25.0)).is_empty());
        // A path of 8 m.
        assert!(found(|x, y| ((y - 60.0).abs() < 4.0).then_some(x / 20.0)).is_empty());
        assert!(found(|_, _| None).is_empty());
    }
}
