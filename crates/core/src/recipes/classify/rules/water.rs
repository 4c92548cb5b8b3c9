//! Rivers, canals and lakes, which the trees take for ground: level, not above their shores, and with few returns at least
//! in parts, for water mirrors the pulses away.

use super::{GROUND, block, cell_edge, plan_cell, quantile};
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
/// Water is not looked for in wider cells, metres: around them the number of points changes with the vegetation.
const WIDEST: f64 = 3.0;
/// Share of the points of a dark cell, and of a cell of water, that are ground.
const GROUND_SHARE: f64 = 0.8;
/// The usual number of points is the median of the cells in 3 by 3 blocks of as many cells a side.
const BLOCK: i32 = 10;
/// It is at least this share of the median of all cells: in the middle of a lake all cells are dark.
const LEAST: f64 = 0.5;
/// The shore: cells at most this far from those around a patch.
const SHORE: i32 = 2;
/// A shore is lower if it lies more than this many steps below the level, and higher if it lies more than a step above.
const BELOW: f64 = 1.5;
/// Water has land or other water on both sides along two of four axes, this far away at most, metres. The edge of a scan, where
/// cells are filled in part, has not.
const ACROSS: f64 = 100.0;
const AXES: [[i32; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];

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
        for (name, length) in [
            ("classes.water.reach", self.reach),
            ("classes.water.step", self.step),
            ("classes.water.spread", self.spread),
        ] {
            if !(length >= 0.0 && length.is_finite()) {
                return Err(Error::parameter(name, length, "metres, 0 or more"));
            }
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
        let cells = Cells::new(points.len(), |row| plan_cell(points, row as u32, edge), monitor)?;
        let is_ground = |&&row: &&u32| codes[points.frame.index[row as usize] as usize] == GROUND;
        let z = |row: u32| f64::from(points.positions.z[row as usize]);
        let surface = |cell: usize| {
            let mut ground: Vec<f64> = cells.of(cell).iter().filter(is_ground).map(|&row| z(row)).collect();
            let height = if ground.is_empty() { f64::NAN } else { quantile(&mut ground, 0.5) };
            Surface { points: cells.of(cell).len(), ground: ground.len(), height }
        };
        let surfaces = map_watched(cells.len(), monitor, surface)?;
        let scene = Scene { params: self, index: CellIndex::new(cells.keys.clone()), surfaces, edge };
        let mut rows = Vec::new();
        for Water { cell, level } in scene.water(monitor)? {
            let ground = cells.of(cell).iter().filter(is_ground).copied();
            rows.extend(ground.filter(|&row| (z(row) - level).abs() <= 2.0 * self.step));
        }
        Ok(rows)
    }
}

/// What a cell holds: its points, those of the ground, and the median of their heights, metres; without ground not a number.
#[derive(Clone, Copy, Debug, Default)]
struct Surface {
    points: usize,
    ground: usize,
    height: f64,
}

impl Surface {
    fn is_ground(&self) -> bool {
        self.ground as f64 >= GROUND_SHARE * self.points as f64
    }
}

/// A cell of water and the water's level, metres.
#[derive(Clone, Copy, Debug)]
struct Water {
    cell: usize,
    level: f64,
}

/// The cells of a cloud.
struct Scene<'a> {
    params: &'a WaterParams,
    index: CellIndex<[i32; 2]>,
    surfaces: Vec<Surface>,
    /// Edge of a cell, metres.
    edge: f64,
}

impl Scene<'_> {
    /// All cells of water, ascending.
    fn water(&self, monitor: &Monitor) -> Result<Vec<Water>> {
        let usual = self.usual(monitor)?;
        let dark = map_watched(self.surfaces.len(), monitor, |cell| self.is_dark(cell, usual[cell]))?;
        let shore = |cell: usize| {
            let Surface { points, ground, .. } = self.surfaces[cell];
            let few = (points as f64) < self.params.few * usual[cell];
            ground > 0 && !(few && self.surfaces[cell].is_ground())
        };
        let mut level = vec![f64::NAN; self.surfaces.len()];
        for patch in self.patches(&dark, monitor)? {
            let known = |&cell: &usize| !level[cell].is_nan();
            if patch.iter().all(known) {
                continue;
            }
            if let Some(found) = self.level(&patch, shore) {
                for cell in self.fill(&patch, found, monitor)? {
                    level[cell] = found;
                }
            }
        }
        let water = |(cell, level): (usize, f64)| (!level.is_nan()).then_some(Water { cell, level });
        Ok(level.into_iter().enumerate().filter_map(water).collect())
    }

    /// The usual number of points of each cell.
    fn usual(&self, monitor: &Monitor) -> Result<Vec<f64>> {
        let keys = self.index.keys();
        let blocks = Cells::new(keys.len(), |cell| keys[cell].map(|v| v.div_euclid(BLOCK)), monitor)?;
        let index = CellIndex::new(blocks.keys.clone());
        let median = |cells: &mut dyn Iterator<Item = usize>| {
            let mut counts: Vec<f64> = cells.map(|cell| self.surfaces[cell].points as f64).collect();
            if counts.is_empty() { 0.0 } else { quantile(&mut counts, 0.5) }
        };
        let least = LEAST * median(&mut (0..keys.len()));
        let of_block = |own: usize| {
            let near = block(blocks.keys[own], 1).filter_map(|key| index.find(key));
            median(&mut near.flat_map(|near| blocks.of(near)).map(|&cell| cell as usize)).max(least)
        };
        let of_blocks = map_watched(blocks.len(), monitor, of_block)?;
        let mut usual = vec![0.0; keys.len()];
        for (own, &count) in of_blocks.iter().enumerate() {
            blocks.of(own).iter().for_each(|&cell| usual[cell as usize] = count);
        }
        Ok(usual)
    }

    /// Whether a cell of ground and the eight around it hold few points, of which nearly all are ground.
    fn is_dark(&self, cell: usize, usual: f64) -> bool {
        let mut all = Surface::default();
        for near in self.around(cell) {
            all.points += self.surfaces[near].points;
            all.ground += self.surfaces[near].ground;
        }
        let few = (all.points as f64) < self.params.few * 9.0 * usual;
        let own = self.surfaces[cell];
        few && all.is_ground() && own.ground > 0 && own.is_ground() && self.is_inside(cell)
    }

    /// Whether there are points on both sides of a cell, along two axes at least.
    fn is_inside(&self, cell: usize) -> bool {
        let [x, y] = self.index.keys()[cell];
        let seen = |[dx, dy]: [i32; 2]| {
            let run = self.edge * f64::from(dx).hypot(f64::from(dy));
            let key = |step: i32| [x.saturating_add(step * dx), y.saturating_add(step * dy)];
            (1..=(ACROSS / run) as i32).any(|step| self.index.find(key(step)).is_some())
        };
        AXES.into_iter().filter(|&[dx, dy]| seen([dx, dy]) && seen([-dx, -dy])).count() >= 2
    }

    /// Dark cells that may be one patch of water, the largest first.
    fn patches(&self, dark: &[bool], monitor: &Monitor) -> Result<Vec<Vec<usize>>> {
        // Cells are joined at least with their neighbours.
        let reach = (self.params.reach / self.edge).max(1.5);
        let mut patches = UnionFind::new(dark.len());
        let mut looks = Looks::at(monitor);
        let mut cells: Vec<usize> = (0..dark.len()).filter(|&cell| dark[cell]).collect();
        for &cell in &cells {
            looks.step()?;
            let [x, y] = self.index.keys()[cell];
            let near =
                |key: &[i32; 2]| f64::from(key[0].wrapping_sub(x)).hypot(f64::from(key[1].wrapping_sub(y))) <= reach;
            for near in block([x, y], reach as i32).filter(near).filter_map(|key| self.index.find(key)) {
                if dark[near] && (self.surfaces[cell].height - self.surfaces[near].height).abs() <= self.params.step {
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

    /// The level of the water whose dark cells these are, metres, if they are water.
    fn level(&self, patch: &[usize], shore: impl Fn(usize) -> bool) -> Option<f64> {
        let within = |reach: i32| -> BTreeSet<[i32; 2]> {
            patch.iter().flat_map(|&cell| block(self.index.keys()[cell], reach)).collect()
        };
        // Most patches are a cell or two.
        let most = 9.0 * patch.len() as f64 * self.edge.powi(2);
        if most < self.params.area || (within(1).len() as f64) * self.edge.powi(2) < self.params.area {
            return None;
        }
        let mut heights: Vec<f64> = patch.iter().map(|&cell| self.surfaces[cell].height).collect();
        let level = quantile(&mut heights, 0.5);
        if quantile(&mut heights, 0.9) - quantile(&mut heights, 0.1) > self.params.spread {
            return None;
        }
        let around = within(1 + SHORE);
        let shore: Vec<usize> =
            around.into_iter().filter_map(|key| self.index.find(key)).filter(|&cell| shore(cell)).collect();
        let share = |part: &dyn Fn(f64) -> bool| {
            let part = shore.iter().filter(|&&cell| part(self.surfaces[cell].height)).count();
            part as f64 / shore.len().max(1) as f64
        };
        let lower = share(&|height| height < level - BELOW * self.params.step);
        let bank = share(&|height| height > level + self.params.step);
        (lower <= self.params.lower && bank >= self.params.bank).then_some(level)
    }

    /// The cells of water that begin with this patch.
    fn fill(&self, patch: &[usize], level: f64, monitor: &Monitor) -> Result<BTreeSet<usize>> {
        let is_level = |cell: usize| {
            let surface = self.surfaces[cell];
            surface.is_ground() && (surface.height - level).abs() <= self.params.step
        };
        // Away from banks.
        let is_open = |cell: usize| {
            let bank = |near: usize| {
                self.surfaces[near].ground > 0 && !((self.surfaces[near].height - level).abs() <= self.params.step)
            };
            is_level(cell) && !self.around(cell).any(bank)
        };
        let mut looks = Looks::at(monitor);
        let mut found: BTreeSet<usize> = patch.iter().flat_map(|&cell| self.around(cell)).collect();
        let mut open: Vec<usize> = found.iter().copied().collect();
        while let Some(cell) = open.pop() {
            looks.step()?;
            for near in self.around(cell) {
                if !found.contains(&near) && is_open(near) {
                    found.insert(near);
                    open.push(near);
                }
            }
        }
        let beside: Vec<usize> = found.iter().flat_map(|&cell| self.around(cell)).collect();
        found.extend(beside);
        found.retain(|&cell| is_level(cell));
        Ok(found)
    }

    /// Occupied cells around a cell, itself included.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        block(self.index.keys()[cell], 1).filter_map(|key| self.index.find(key))
    }
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
        (2.0 * x) as u32 % 3 == 0 && (2.0 * y) as u32 % 3 == 0
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
        // A level field whose outermost 2 m have few points.
        let inside = |v: f64| (22.0..98.0).contains(&v);
        let within = |v: f64| (20.0..100.0).contains(&v);
        let field = |x: f64, y: f64| {
            let few = inside(x) && inside(y) || returns(x, y);
            (within(x) && within(y) && few).then_some(0.0)
        };
        assert_eq!(found(&scene(field)).len(), 0);
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
