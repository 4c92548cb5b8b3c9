//! Rivers, canals and lakes, which the trees take for ground: level, not above their shores, and with few returns at
//! least in parts, because water reflects the pulses away.

use super::GROUND;
use super::plan::{ACROSS, PlanRows, axes_with_land, block, cell_edge, quantile};
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::graph::UnionFind;
use crate::parallel::{Looks, Monitor, map_watched};
use crate::voxels::cells::Cells;
use crate::voxels::cells::index::CellIndex;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// When ground is water.
///
/// The height of a cell in plan is the median of its ground points. A cell is dark if it and the eight around it hold few
/// points, of which nearly all are ground. Dark cells near each other and of nearly one height are a patch of water if they
/// cover an area and are level, and if hardly any of the shore is lower and some of it higher. The water goes on from there
/// over all cells that are level with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WaterParams {
    /// Whether water becomes water (9) instead of unclassified.
    pub named: bool,
    /// Least area that a patch covers with the cells around its own, square metres. 0: water is not looked for.
    pub area: f64,
    /// A cell is dark if the nine cells hold fewer than this share of the points usual there; 0..=1.
    pub few: f64,
    /// Distance between neighbouring cells of a patch, at most, metres; 0 or more.
    pub reach: f64,
    /// Heights of the water's cells, at most this above or below its level, metres; 0 or more. The same step may lie between
    /// neighbouring cells of a patch. Single points may be twice as far from the level.
    pub step: f64,
    /// The middle four fifths of the heights of a patch lie within this, metres; 0 or more.
    pub spread: f64,
    /// Share of the shore that may be lower than the patch; 0..=1.
    pub lower: f64,
    /// Share of the shore that is higher than the patch, at least; 0..=1.
    pub bank: f64,
    /// Least edge of a cell, metres, above 0; clouds of less than 9 points per cell have cells of 3 point spacings. In clouds
    /// so thin that these would be wider than 3 m (1 point per square metre) water is not looked for.
    pub cell: f64,
}

impl Default for WaterParams {
    fn default() -> Self {
        Self {
            named: false,
            area: 100.0,
            few: 0.4,
            reach: 5.0,
            step: 0.1,
            spread: 0.15,
            lower: 0.1,
            bank: 0.1,
            cell: 1.0,
        }
    }
}

/// Point spacings to an edge of a cell, at least: 9 points a cell tell few returns from chance.
const SPACINGS: f64 = 3.0;
/// Water is not looked for in wider cells, metres, unless they were asked for: few of them hold ground alone.
const WIDEST: f64 = 3.0;
/// Share of the points of a cell of ground that are ground.
const GROUND_SHARE: f64 = 0.8;
/// The usual number of points is the median of the ground cells in a block of 10 by 10 cells and in the eight blocks around it.
const BLOCK: i32 = 10;
/// It is at least this share of the median of all ground cells: in the middle of a wide lake blocks hold water only.
const LEAST: f64 = 0.5;
/// The shore of a patch: cells at most this far from those around it.
const SHORE: i32 = 2;
/// A cell of the shore counts as lower if it lies more than this many steps below the level.
const BELOW: f64 = 1.5;
/// Water lies in a basin: around it there are at least this many times as many higher cells as lower ones and edges of the scan.
const BASIN: usize = 2;
/// A cell beside the water is outside if at most this many of the eight around it are water; others are gaps in it.
const OUTSIDE: usize = 4;
/// Looking around a cell takes as long as about so many steps of nanoseconds.
const STEPS: usize = 64;

impl WaterParams {
    /// The same, but without effect.
    pub fn none() -> Self {
        Self { area: 0.0, ..Self::default() }
    }

    pub(super) fn validate(&self) -> Result<()> {
        for (name, share) in
            [("classes.water.few", self.few), ("classes.water.lower", self.lower), ("classes.water.bank", self.bank)]
        {
            if !(0.0..=1.0).contains(&share) {
                return Err(Error::parameter(name, share, "a share, 0 to 1"));
            }
        }
        if !(self.area >= 0.0 && self.area.is_finite()) {
            return Err(Error::parameter("classes.water.area", self.area, "square metres, 0 or more"));
        }
        for (name, length) in [("classes.water.step", self.step), ("classes.water.spread", self.spread)] {
            if !(length >= 0.0 && length.is_finite()) {
                return Err(Error::parameter(name, length, "metres, 0 or more"));
            }
        }
        if !(0.0..=ACROSS).contains(&self.reach) {
            return Err(Error::parameter("classes.water.reach", self.reach, "metres, 0 to 100"));
        }
        match self.cell > 0.0 && self.cell.is_finite() {
            true => Ok(()),
            false => Err(Error::parameter("classes.water.cell", self.cell, "metres, above 0")),
        }
    }

    /// The rows of ground points that are water, ascending by cell. `codes` has an entry a point of the cloud; `density` is
    /// in points per square metre. O(n log n).
    pub(super) fn rows(&self, points: &Points, codes: &[u8], density: f64, monitor: &Monitor) -> Result<Vec<u32>> {
        let edge = cell_edge(self.cell, SPACINGS, density);
        if edge > WIDEST.max(self.cell) {
            return Ok(Vec::new());
        }
        let cells = PlanRows::new(points, (0..points.len() as u32).collect(), edge, monitor)?;
        let is_ground = |&&row: &&u32| codes[points.frame.index[row as usize] as usize] == GROUND;
        let z = |row: u32| f64::from(points.positions.z[row as usize]);
        let surface = |cell: usize| {
            let mut ground: Vec<f64> = cells.of(cell).iter().filter(is_ground).map(|&row| z(row)).collect();
            let height = if ground.is_empty() { f64::NAN } else { quantile(&mut ground, 0.5) };
            Surface { points: cells.of(cell).len() as u32, ground: ground.len() as u32, height: height as f32 }
        };
        let surfaces = map_watched(cells.len(), monitor, surface)?;
        let usual = usual(&surfaces, &cells.index, monitor)?;
        let levels = Scene { params: self, index: &cells.index, surfaces, usual, edge }.levels(monitor)?;
        let mut rows = Vec::new();
        let mut looks = Looks::at(monitor);
        for (cell, level) in levels.into_iter().enumerate().filter(|(_, level)| !level.is_nan()) {
            looks.steps(cells.of(cell).len())?;
            let ground = cells.of(cell).iter().filter(is_ground).copied();
            rows.extend(ground.filter(|&row| (z(row) - level).abs() <= 2.0 * self.step));
        }
        Ok(rows)
    }
}

/// What a cell holds: its points, those of the ground, and the median of their heights, metres; without ground not a number.
#[derive(Clone, Copy, Debug, Default)]
struct Surface {
    points: u32,
    ground: u32,
    height: f32,
}

impl Surface {
    fn is_ground(&self) -> bool {
        self.ground > 0 && f64::from(self.ground) >= GROUND_SHARE * f64::from(self.points)
    }
}

/// The number of points that a cell of ground usually holds, for each cell. Cells of vegetation, with several points a pulse,
/// do not count.
fn usual(surfaces: &[Surface], index: &CellIndex<[i32; 2]>, monitor: &Monitor) -> Result<Vec<f64>> {
    let keys = index.keys();
    let blocks = Cells::new(keys.len(), |cell| keys[cell].map(|v| v.div_euclid(BLOCK)), monitor)?;
    let block_index = CellIndex::new(blocks.keys.clone());
    let median = |cells: &mut dyn Iterator<Item = usize>| {
        let ground = cells.map(|cell| surfaces[cell]).filter(Surface::is_ground);
        let mut counts: Vec<f64> = ground.map(|surface| surface.points.into()).collect();
        if counts.is_empty() { 0.0 } else { quantile(&mut counts, 0.5) }
    };
    let least = LEAST * median(&mut (0..keys.len()));
    let of_block = |own: usize| {
        let near = block(blocks.keys[own], 1).filter_map(|key| block_index.find(key));
        median(&mut near.flat_map(|near| blocks.of(near)).map(|&cell| cell as usize)).max(least)
    };
    let of_blocks = map_watched(blocks.len(), monitor, of_block)?;
    let mut usual = vec![0.0; keys.len()];
    for (own, &count) in of_blocks.iter().enumerate() {
        blocks.of(own).iter().for_each(|&cell| usual[cell as usize] = count);
    }
    Ok(usual)
}

/// The cells of a cloud: where they are, what they hold, and how many points are usual there.
struct Scene<'a> {
    params: &'a WaterParams,
    index: &'a CellIndex<[i32; 2]>,
    surfaces: Vec<Surface>,
    usual: Vec<f64>,
    /// Edge of a cell, metres.
    edge: f64,
}

impl Scene<'_> {
    /// The level of the water of each cell, metres; not a number where there is none.
    fn levels(&self, monitor: &Monitor) -> Result<Vec<f64>> {
        let dark = map_watched(self.surfaces.len(), monitor, |cell| self.is_dark(cell))?;
        let mut levels = vec![f64::NAN; self.surfaces.len()];
        let mut filled = vec![false; self.surfaces.len()];
        for patch in self.patches(&dark, monitor)? {
            // Mostly part of what was filled from a larger patch, whether that was water or not.
            if 2 * patch.iter().filter(|&&cell| filled[cell]).count() > patch.len() {
                continue;
            }
            let Some(level) = self.level_of(&patch, monitor)? else { continue };
            let body = self.fill(&patch, level, monitor)?;
            let basin = self.is_basin(&body, level, monitor)?;
            for &cell in &body.cells {
                filled[cell] = true;
                if basin && levels[cell].is_nan() {
                    levels[cell] = level;
                }
            }
        }
        Ok(levels)
    }

    fn height(&self, cell: usize) -> f64 {
        f64::from(self.surfaces[cell].height)
    }

    /// Whether a cell holds few points.
    fn is_thin(&self, cell: usize) -> bool {
        f64::from(self.surfaces[cell].points) < self.params.few * self.usual[cell]
    }

    /// Whether a cell of ground and the eight around it hold few points, of which nearly all are ground.
    fn is_dark(&self, cell: usize) -> bool {
        let most = self.params.few * 9.0 * self.usual[cell];
        // Most cells are no ground or hold too many themselves.
        if !self.surfaces[cell].is_ground() || f64::from(self.surfaces[cell].points) >= most {
            return false;
        }
        let mut all = Surface::default();
        for near in self.around(cell) {
            all.points += self.surfaces[near].points;
            all.ground += self.surfaces[near].ground;
        }
        f64::from(all.points) < most && all.is_ground() && self.is_between(self.index.keys()[cell])
    }

    /// Whether there is land on both sides of a place, along two axes at least.
    fn is_between(&self, key: [i32; 2]) -> bool {
        let land = |key: [i32; 2]| self.index.find(key).is_some_and(|cell| !self.is_thin(cell));
        axes_with_land(key, self.edge, land) >= 2
    }

    /// Dark cells that may be one patch of water, the largest first.
    fn patches(&self, dark: &[bool], monitor: &Monitor) -> Result<Vec<Vec<usize>>> {
        // Cells are joined at least with their neighbours.
        let reach = (self.params.reach / self.edge).max(1.5);
        let mut patches = UnionFind::new(dark.len());
        let mut looks = Looks::at(monitor);
        let mut cells: Vec<usize> = (0..dark.len()).filter(|&cell| dark[cell]).collect();
        for &cell in &cells {
            looks.steps((reach * reach) as usize)?;
            let own = self.index.keys()[cell];
            // Each pair once.
            let is_next = |&key: &[i32; 2]| {
                let [dx, dy] = [0, 1].map(|axis| f64::from(key[axis]) - f64::from(own[axis]));
                key > own && dx.hypot(dy) <= reach
            };
            for near in block(own, reach as i32).filter(is_next).filter_map(|key| self.index.find(key)) {
                if dark[near] && (self.height(cell) - self.height(near)).abs() <= self.params.step {
                    patches.unite(cell as u32, near as u32);
                }
            }
        }
        let roots = patches.roots(monitor)?;
        cells.sort_by_key(|&cell| roots[cell]);
        let mut patches: Vec<Vec<usize>> =
            cells.chunk_by(|&a, &b| roots[a] == roots[b]).map(<[usize]>::to_vec).collect();
        patches.sort_by_key(|patch| std::cmp::Reverse(patch.len()));
        Ok(patches)
    }

    /// The level of the water whose dark cells these are, metres, if they may be water.
    fn level_of(&self, patch: &[usize], monitor: &Monitor) -> Result<Option<f64>> {
        if !self.covers(patch) {
            return Ok(None);
        }
        let mut heights: Vec<f64> = patch.iter().map(|&cell| self.height(cell)).collect();
        let level = quantile(&mut heights, 0.5);
        if quantile(&mut heights, 0.9) - quantile(&mut heights, 0.1) > self.params.spread {
            return Ok(None);
        }
        let mut shore = BTreeSet::new();
        let mut looks = Looks::at(monitor);
        for &cell in patch {
            looks.step()?;
            let near = block(self.index.keys()[cell], 1 + SHORE).filter_map(|key| self.index.find(key));
            let is_land = |&near: &usize| {
                self.surfaces[near].ground > 0 && !(self.is_thin(near) && self.surfaces[near].is_ground())
            };
            shore.extend(near.filter(is_land));
        }
        let share = |part: &dyn Fn(f64) -> bool| {
            let part = shore.iter().filter(|&&cell| part(self.height(cell))).count();
            part as f64 / shore.len().max(1) as f64
        };
        let lower = share(&|height| height < level - BELOW * self.params.step);
        let bank = share(&|height| height > level + self.params.step);
        Ok((lower <= self.params.lower && bank >= self.params.bank).then_some(level))
    }

    /// Whether these cells and those around them are large enough for water.
    fn covers(&self, patch: &[usize]) -> bool {
        let least = self.params.area / self.edge.powi(2);
        let mut covered = BTreeSet::new();
        patch.iter().any(|&cell| {
            covered.extend(block(self.index.keys()[cell], 1));
            covered.len() as f64 >= least
        })
    }

    /// The level cells that begin with this patch.
    fn fill(&self, patch: &[usize], level: f64, monitor: &Monitor) -> Result<Body> {
        let is_at_level = |cell: usize| (self.height(cell) - level).abs() <= self.params.step;
        let is_bank = |cell: usize| self.surfaces[cell].ground > 0 && !is_at_level(cell);
        let is_level = |cell: usize| self.surfaces[cell].is_ground() && is_at_level(cell);
        // Away from banks.
        let is_open = |cell: usize| is_level(cell) && !self.around(cell).any(is_bank);
        let mut looks = Looks::at(monitor);
        let mut body = Body { cells: Vec::new(), has: vec![false; self.surfaces.len()] };
        for &cell in patch {
            looks.steps(STEPS)?;
            self.around(cell).filter(|&near| is_level(near)).for_each(|near| body.add(near));
        }
        let mut at = 0;
        while at < body.cells.len() {
            looks.steps(STEPS)?;
            self.around(body.cells[at]).filter(|&near| is_open(near)).for_each(|near| body.add(near));
            at += 1;
        }
        // The cells beside a bank.
        for at in 0..body.cells.len() {
            looks.steps(STEPS)?;
            self.around(body.cells[at]).filter(|&near| is_level(near)).for_each(|near| body.add(near));
        }
        Ok(body)
    }

    /// Whether what surrounds these cells is higher for the most part.
    fn is_basin(&self, body: &Body, level: f64, monitor: &Monitor) -> Result<bool> {
        let is_water = |key: [i32; 2]| self.index.find(key).is_some_and(|cell| body.has[cell]);
        let mut looks = Looks::at(monitor);
        let mut seen = BTreeSet::new();
        let mut shore = Shore::default();
        for &cell in &body.cells {
            looks.steps(STEPS)?;
            for key in block(self.index.keys()[cell], 1).filter(|&key| !is_water(key)) {
                if !seen.insert(key) || block(key, 1).filter(|&near| is_water(near)).count() > OUTSIDE {
                    continue;
                }
                match self.index.find(key).map(|near| self.height(near) - level) {
                    Some(step) if step > self.params.step => shore.higher += 1,
                    Some(step) if step < -self.params.step => shore.lower += 1,
                    // Level with the water, or without ground.
                    Some(_) => {}
                    None => shore.ends += usize::from(!self.is_between(key)),
                }
            }
        }
        Ok(shore.higher > 0 && shore.higher >= BASIN * (shore.lower + shore.ends))
    }

    /// Occupied cells around a cell, itself included.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        block(self.index.keys()[cell], 1).filter_map(|key| self.index.find(key))
    }
}

/// What may be a body of water: its cells, and whether each cell is one of them.
struct Body {
    cells: Vec<usize>,
    has: Vec<bool>,
}

impl Body {
    fn add(&mut self, cell: usize) {
        if !std::mem::replace(&mut self.has[cell], true) {
            self.cells.push(cell);
        }
    }
}

/// Cells around a body of water: higher and lower ones, and those beyond the edge of the scan.
#[derive(Clone, Copy, Debug, Default)]
struct Shore {
    higher: usize,
    lower: usize,
    ends: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    /// Ground of 120 x 120 m with 4 points a square metre, of which only those stay for which `height` gives one.
    fn scene(height: impl Fn(f64, f64) -> Option<f64>) -> Points {
        let place = |i: u32| (f64::from(i % 240) / 2.0 + 0.2, f64::from(i / 240) / 2.0 + 0.2);
        let rows: Vec<[f64; 3]> =
            (0..57_600).map(place).filter_map(|(x, y)| Some([x, y, height(x, y)? + ripple(x, y)])).collect();
        Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0)
    }

    /// Up to 3 cm, as a scanner's noise.
    fn ripple(x: f64, y: f64) -> f64 {
        0.06 * (((x * 12.9898 + y * 78.233).sin() * 43_758.545).fract().abs() - 0.5)
    }

    /// Whether the pulse at this place comes back from water: one in nine.
    fn returns(x: f64, y: f64) -> bool {
        ((2.0 * x) as u32).is_multiple_of(3) && ((2.0 * y) as u32).is_multiple_of(3)
    }

    fn found(points: &Points) -> Vec<u32> {
        WaterParams::default().rows(points, &vec![GROUND; points.len()], 4.0, &Monitor::default()).unwrap()
    }

    /// Distance from the middle.
    fn far(x: f64, y: f64) -> f64 {
        (x - 60.0).hypot(y - 60.0)
    }

    #[test]
    fn a_lake_is_water_where_it_is_dark_and_where_it_is_not() {
        // Banks that rise by 1 m in 5 m, and a lake that only its western half mirrors away.
        let bank = |r: f64| (0.2 * (r - 30.0)).clamp(0.0, 1.0);
        let lake = |x: f64, y: f64| (far(x, y) > 30.0 || x > 60.0 || returns(x, y)).then(|| bank(far(x, y)));
        let points = scene(lake);
        let in_lake = |row: usize| {
            let [x, y, _] = points.world(row);
            far(x, y) < 30.0
        };
        let water: Vec<bool> = (0..points.len()).map(in_lake).collect();
        let rows = found(&points);
        let right = rows.iter().filter(|&&row| water[row as usize]).count();
        let all = water.iter().filter(|&&water| water).count();
        assert!(right as f64 > 0.93 * all as f64, "{right} of {all}");
        assert!(right as f64 > 0.95 * rows.len() as f64, "{right} of {} found", rows.len());
    }

    #[test]
    fn what_is_dark_but_steep_or_high_or_small_or_not_dark_is_no_water() {
        let dark = |x: f64, y: f64| far(x, y) > 30.0 || returns(x, y);
        // A slope of 5 %, a mesa, a puddle of 9 m, a level field.
        assert_eq!(found(&scene(|x, y| dark(x, y).then_some(0.05 * x))).len(), 0);
        assert_eq!(found(&scene(|x, y| dark(x, y).then(|| if far(x, y) < 30.0 { 2.0 } else { 0.0 }))).len(), 0);
        let puddle = |x: f64, y: f64| far(x, y) > 4.5 || returns(x, y);
        assert_eq!(found(&scene(|x, y| puddle(x, y).then(|| if far(x, y) < 4.5 { -0.5 } else { 0.0 }))).len(), 0);
        assert_eq!(found(&scene(|_, _| Some(0.0))).len(), 0);
        assert_eq!(found(&Points::default()).len(), 0);
    }

    #[test]
    fn thin_clouds_have_no_water() {
        let lake = scene(|x, y| (far(x, y) > 30.0 || returns(x, y)).then(|| if far(x, y) > 30.0 { 1.0 } else { 0.0 }));
        let codes = vec![GROUND; lake.len()];
        let rows = |density: f64| WaterParams::default().rows(&lake, &codes, density, &Monitor::default()).unwrap();
        assert!(rows(0.9).is_empty() && !rows(1.1).is_empty());
    }

    #[test]
    fn the_edge_of_a_scan_is_no_water() {
        // A level field whose outermost 6 m have few points, with a bump along a part of them.
        let within = |v: f64, margin: f64| (20.0 + margin..100.0 - margin).contains(&v);
        let field = |x: f64, y: f64| {
            let bump = (26.0..29.0).contains(&x) && (40.0..80.0).contains(&y);
            let few = within(x, 6.0) && within(y, 6.0) || returns(x, y);
            (within(x, 0.0) && within(y, 0.0) && few).then_some(if bump { 0.3 } else { 0.0 })
        };
        assert_eq!(found(&scene(field)).len(), 0);
    }

    #[test]
    fn level_land_with_a_thin_spot_is_no_water() {
        // A car park with a wet spot beside a kerb; also what clouds with heights above the ground look like.
        let spot = |x: f64, y: f64| (50.0..64.0).contains(&x) && (50.0..64.0).contains(&y);
        let kerb = |x: f64, y: f64| (64.0..66.0).contains(&x) && (48.0..66.0).contains(&y);
        let park = |x: f64, y: f64| (!spot(x, y) || returns(x, y)).then_some(if kerb(x, y) { 0.15 } else { 0.0 });
        assert_eq!(found(&scene(park)).len(), 0);
    }

    #[test]
    fn a_ride_through_a_forest_is_no_water() {
        // Three points of vegetation to one of the ground, but for a ride of 12 m between verges.
        let ride = |x: f64| (54.0..66.0).contains(&x);
        let verge = |x: f64| (52.0..68.0).contains(&x) && !ride(x);
        let ground = scene(|x, _| Some(if verge(x) { 0.25 } else { 0.0 }));
        let rows: Vec<[f64; 3]> = (0..ground.len()).map(|row| ground.world(row)).collect();
        let crowns = rows
            .iter()
            .filter(|[x, ..]| !ride(*x))
            .flat_map(|[x, y, z]| (1..=3).map(move |i| [x + 0.1 * f64::from(i), *y, z + 3.0 * f64::from(i)]));
        let crowns: Vec<[f64; 3]> = crowns.collect();
        let codes = [vec![GROUND; rows.len()], vec![5; crowns.len()]].concat();
        let points = Points::from_cloud(&Cloud::from_rows(&[rows, crowns].concat()).unwrap(), 1.0);
        assert_eq!(WaterParams::default().rows(&points, &codes, 13.0, &Monitor::default()).unwrap().len(), 0);
    }

    #[test]
    fn two_ponds_have_two_levels_and_the_dam_between_them_is_land() {
        let pond = |x: f64, y: f64, middle: f64| (x - middle).hypot(y - 60.0) < 24.0;
        let height = |x: f64, y: f64| match () {
            () if pond(x, y, 35.0) => -1.0,
            () if pond(x, y, 85.0) => -1.5,
            () => 0.0,
        };
        let dark = |x: f64, y: f64| pond(x, y, 35.0) || pond(x, y, 85.0);
        let points = scene(|x, y| (!dark(x, y) || returns(x, y)).then(|| height(x, y)));
        let in_pond = |&row: &u32| {
            let [x, y, _] = points.world(row as usize);
            dark(x, y)
        };
        let rows = found(&points);
        let all = (0..points.len() as u32).filter(in_pond).count();
        assert!(rows.iter().all(in_pond) && rows.len() as f64 > 0.7 * all as f64, "{} of {all}", rows.len());
    }

    #[test]
    fn a_cancelled_search_ends_in_an_error() {
        let points =
            scene(|x, y| (far(x, y) > 30.0 || returns(x, y)).then(|| if far(x, y) > 30.0 { 1.0 } else { 0.0 }));
        let monitor = Monitor::default();
        monitor.cancel();
        assert!(WaterParams::default().rows(&points, &vec![GROUND; points.len()], 4.0, &monitor).is_err());
    }

    #[test]
    fn ranges_are_checked() {
        WaterParams::none().validate().unwrap();
        assert!(WaterParams { area: f64::NAN, ..WaterParams::default() }.validate().is_err());
        assert!(WaterParams { few: 1.1, ..WaterParams::default() }.validate().is_err());
        assert!(WaterParams { step: -0.1, ..WaterParams::default() }.validate().is_err());
        assert!(WaterParams { cell: 0.0, ..WaterParams::default() }.validate().is_err());
    }
}
