//! Buildings that do not stand above the ground around them: hilltops, terraces and decks of bridges, which the trees
//! take for roofs because they are flat and high.

use super::{BUILDING, GROUND, SPACINGS, cell_edge, plan_cell};
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::graph::UnionFind;
use crate::parallel::{Monitor, watched};
use crate::voxels::cells::Cells;
use crate::voxels::cells::index::Walk;
use serde::{Deserialize, Serialize};

/// When a building is level with the ground around it.
///
/// Cells in plan that hold building points are joined to components, 8 neighbours a cell. Each pair of such a cell and a
/// neighbour that holds ground, but no building, is level, drops, or lies between; the highest points of both cells count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LevelParams {
    /// A component is no building if more than this share of its pairs that are level or drop are level; 0..=1. 1: none.
    pub share: f64,
    /// It is ground if more than this share are level, else unclassified; 0..=1. 1: never. Points higher than `drop` above
    /// the lowest of their cell are unclassified.
    pub ground: f64,
    /// Largest step of a level pair, metres; 0 or more.
    pub step: f64,
    /// Least step down of a pair that drops, metres; not below `step`.
    pub drop: f64,
    /// Level pairs that a component must have at least.
    pub pairs: usize,
    /// Least edge of a cell, metres, above 0; clouds of less than 2.25 points per cell have cells of 1.5 point spacings.
    pub cell: f64,
}

impl Default for LevelParams {
    fn default() -> Self {
        Self { share: 0.5, ground: 0.8, step: 0.5, drop: 1.5, pairs: 3, cell: 1.0 }
    }
}

/// Rows of building points that are level with the ground around them, each ascending by cell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct LevelRows {
    /// Those that are ground.
    pub(super) ground: Vec<u32>,
    /// Those that may be a deck or a terrace.
    pub(super) unknown: Vec<u32>,
}

/// The highest building point of a cell; if it has none, its highest ground point.
#[derive(Clone, Copy, Debug)]
struct Top {
    building: bool,
    height: f32,
}

/// Pairs of a component.
#[derive(Clone, Copy, Debug, Default)]
struct Pairs {
    level: usize,
    drop: usize,
}

impl LevelParams {
    /// The same, but without effect.
    pub fn none() -> Self {
        Self { share: 1.0, ..Self::default() }
    }

    pub(super) fn validate(&self) -> Result<()> {
        for (name, share) in [("classes.level.share", self.share), ("classes.level.ground", self.ground)] {
            if !(0.0..=1.0).contains(&share) {
                return Err(Error::parameter(name, share, "a share, 0 to 1"));
            }
        }
        if !(self.step >= 0.0 && self.step.is_finite()) {
            return Err(Error::parameter("classes.level.step", self.step, "metres, 0 or more"));
        }
        if !(self.drop >= self.step && self.drop.is_finite()) {
            return Err(Error::parameter("classes.level.drop", self.drop, "metres, not below classes.level.step"));
        }
        match self.cell > 0.0 && self.cell.is_finite() {
            true => Ok(()),
            false => Err(Error::parameter("classes.level.cell", self.cell, "metres, above 0")),
        }
    }

    /// The building points that are level with the ground around them. `codes` has an entry a point of the cloud; `density`
    /// is in points per square metre. O(n).
    pub(super) fn rows(&self, points: &Points, codes: &[u8], density: f64, monitor: &Monitor) -> Result<LevelRows> {
        let code = |row: usize| codes[points.frame.index[row] as usize];
        let used: Vec<u32> =
            (0..points.len() as u32).filter(|&row| matches!(code(row as usize), BUILDING | GROUND)).collect();
        let edge = cell_edge(self.cell, SPACINGS, density);
        let cells = Cells::new(used.len(), |i| plan_cell(points, used[i], edge), monitor)?;
        let rows = |cell: usize| cells.of(cell).iter().map(|&i| used[i as usize]);
        let top = |cell: usize| {
            let building = rows(cell).any(|row| code(row as usize) == BUILDING);
            let counts = rows(cell).filter(|&row| !building || code(row as usize) == BUILDING);
            Top { building, height: counts.map(|row| points.positions.z[row as usize]).fold(f32::MIN, f32::max) }
        };
        let tops: Vec<Top> = (0..cells.len()).map(top).collect();
        let mut components = UnionFind::new(cells.len());
        let pairs = self.pairs(&cells, &tops, &mut components, monitor)?;
        let mut found = LevelRows::default();
        for cell in (0..cells.len()).filter(|&cell| tops[cell].building) {
            let Pairs { level, drop } = pairs[components.root(cell as u32) as usize];
            let more_than = |share: f64| level as f64 > share * (level + drop) as f64;
            if level < self.pairs.max(1) || !more_than(self.share) {
                continue;
            }
            let buildings = || rows(cell).filter(|&row| code(row as usize) == BUILDING);
            let z = |row: u32| points.positions.z[row as usize];
            let lowest = buildings().map(z).fold(f32::MAX, f32::min);
            for row in buildings() {
                // Wires above a hilltop are part of its component.
                let low = f64::from(z(row) - lowest) <= self.drop;
                let list = if low && more_than(self.ground) { &mut found.ground } else { &mut found.unknown };
                list.push(row);
            }
        }
        Ok(found)
    }

    /// Joins the building cells to components, and counts the pairs of each at its root.
    fn pairs(
        &self,
        cells: &Cells<[i32; 2]>,
        tops: &[Top],
        components: &mut UnionFind,
        monitor: &Monitor,
    ) -> Result<Vec<Pairs>> {
        let mut own = vec![Pairs::default(); cells.len()];
        if !cells.keys.is_empty() {
            let mut walk = Walk::<1>::new(&cells.keys, 0);
            for piece in watched(cells.len(), monitor) {
                for cell in piece?.filter(|&cell| tops[cell].building) {
                    walk.around(cell, |near, _| {
                        let step = f64::from(tops[cell].height - tops[near].height);
                        if tops[near].building {
                            components.unite(cell as u32, near as u32);
                        } else if step.abs() < self.step {
                            own[cell].level += 1;
                        } else if step > self.drop {
                            own[cell].drop += 1;
                        }
                    });
                }
            }
        }
        let mut sums = vec![Pairs::default(); cells.len()];
        for (cell, own) in own.iter().enumerate() {
            let sum = &mut sums[components.root(cell as u32) as usize];
            *sum = Pairs { level: sum.level + own.level, drop: sum.drop + own.drop };
        }
        Ok(sums)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    /// Ground in the squares of 60 x 40 m, with something else in the place of some of them: height and code.
    fn scene(ground: impl Fn(f64, f64) -> f64, other: impl Fn(f64, f64) -> Option<f64>) -> (Points, Vec<u8>) {
        let places = (0..9600).map(|i| (f64::from(i % 120) / 2.0 + 0.2, f64::from(i / 120) / 2.0 + 0.2));
        let point = |(x, y)| match other(x, y) {
            Some(z) => ([x, y, z], BUILDING),
            None => ([x, y, ground(x, y)], GROUND),
        };
        let (rows, codes): (Vec<[f64; 3]>, Vec<u8>) = places.map(point).unzip();
        (Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0), codes)
    }

    /// Numbers of points that become ground and that become unclassified.
    fn found(scene: &(Points, Vec<u8>)) -> [usize; 2] {
        let rows = LevelParams::default().rows(&scene.0, &scene.1, 4.0, &Monitor::default()).unwrap();
        [rows.ground.len(), rows.unknown.len()]
    }

    #[test]
    fn houses_stand_and_hilltops_and_decks_do_not() {
        let inside = |v: f64, [low, high]: [f64; 2]| v > low && v < high;
        let named = |scene: &(Points, Vec<u8>)| scene.1.iter().filter(|&&code| code == BUILDING).count();
        let house = |x: f64, y: f64| (inside(x, [20.0, 30.0]) && inside(y, [10.0, 20.0])).then_some(5.0);
        assert_eq!(found(&scene(|_, _| 0.0, house)), [0, 0]);
        // Built into a slope: level with it on the upper side.
        assert_eq!(found(&scene(|x, _| if x > 30.0 { 5.0 } else { 0.0 }, house)), [0, 0]);
        // The flat top of a hill.
        let hill = |x: f64, y: f64| (8.0 - 0.4 * (x - 30.0).hypot(y - 20.0)).clamp(0.0, 5.0);
        let hilltop = scene(hill, |x, y| (hill(x, y) > 4.5).then_some(hill(x, y)));
        assert_eq!(found(&hilltop), [named(&hilltop), 0]);
        // A wire above it, which was taken for a part of the building.
        let wire = |y: f64| (y * 10.0).round() as i64 % 100 == 2;
        let high = |x: f64, y: f64| if inside(x, [27.0, 33.0]) && wire(y) { 15.0 } else { hill(x, y) };
        let crossed = scene(hill, |x, y| (hill(x, y) > 4.5).then_some(high(x, y)));
        let [ground, unknown] = found(&crossed);
        assert!(ground > 0 && ground + unknown == named(&crossed), "{ground} {unknown}");
        // A bridge over a narrow cutting: 6 m long, 16 m wide.
        let cutting = |x: f64| if inside(x, [27.0, 33.0]) { -6.0 } else { 0.0 };
        let bridge =
            scene(|x, _| cutting(x), |x, y| (inside(x, [27.0, 33.0]) && inside(y, [12.0, 28.0])).then_some(0.1));
        assert_eq!(found(&bridge), [0, named(&bridge)]);
        // With every pair level it takes more than a share of 1.
        let none = LevelParams::none().rows(&bridge.0, &bridge.1, 4.0, &Monitor::default()).unwrap();
        assert_eq!(none, LevelRows::default());
    }

    #[test]
    fn clouds_without_buildings_or_ground_have_none() {
        assert_eq!(found(&scene(|_, _| 0.0, |_, _| None)), [0, 0]);
        assert_eq!(found(&scene(|_, _| 0.0, |_, _| Some(1.0))), [0, 0]);
        assert_eq!(found(&(Points::default(), Vec::new())), [0, 0]);
        assert!(LevelParams { share: 1.5, ..LevelParams::default() }.validate().is_err());
        assert!(LevelParams { step: 2.0, ..LevelParams::default() }.validate().is_err());
    }
}
