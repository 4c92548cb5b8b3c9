//! Decks of long bridges, which the trees take for roofs: long, narrow and smooth, level with the ground at both ends and
//! high above it on both sides.

use super::plan::{AXES, PlanRows, SPACINGS, block, cell_edge, length};
use super::{BUILDING, GROUND};
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::graph::UnionFind;
use crate::parallel::{Monitor, map_watched, watched};
use crate::voxels::cells::index::{CellIndex, Walk};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// When buildings are the deck of a bridge.
///
/// Cells in plan that hold building points have the height of the lowest of them that is at most 2 m below the highest; cells
/// that hold ground, but no building, that of its highest point. A building cell is of a strip if on two opposite sides the
/// ground next to the building is lower. Cells of strips are joined where their heights differ by a small step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DeckParams {
    /// Least length of a deck, metres; it is also at least 1.5 times as long as wide. 0: decks are not looked for.
    pub length: f64,
    /// Greatest width of a strip, from the ground on one side to that on the other, metres; above 0.
    pub width: f64,
    /// Least height above the ground on both sides, metres; 0 or more. Building cells beside the deck that are at most as much
    /// higher or lower belong to it: railings.
    pub drop: f64,
    /// Largest step from cell to cell, and to the ground at both ends, metres; 0 or more.
    pub step: f64,
    /// Distance from the strip to that ground, at most about, metres; 0 or more.
    pub reach: f64,
    /// Least edge of a cell, metres, above 0; clouds of less than 2.25 points per cell have cells of 1.5 point spacings.
    pub cell: f64,
}

impl Default for DeckParams {
    fn default() -> Self {
        Self { length: 10.0, width: 20.0, drop: 1.5, step: 0.4, reach: 6.0, cell: 1.0 }
    }
}

/// A building's points lower than this below the highest of their cell are of a wall, metres.
const WALL: f32 = 2.0;
/// Least length of a deck in widths.
const NARROW: f64 = 1.5;
/// Cells without building and ground that are passed on the way to the ground beside a strip.
const GAP: usize = 2;
/// The ends of a deck: this share of its length.
const END: f64 = 0.25;
/// At most this share of the strip's cells may be level with the ground between the ends.
const BETWEEN: f64 = 0.05;

impl DeckParams {
    /// The same, but without effect.
    pub fn none() -> Self {
        Self { length: 0.0, ..Self::default() }
    }

    pub(super) fn validate(&self) -> Result<()> {
        for (name, value) in [
            ("classes.decks.length", self.length),
            ("classes.decks.drop", self.drop),
            ("classes.decks.step", self.step),
            ("classes.decks.reach", self.reach),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::parameter(name, value, "metres, 0 or more"));
            }
        }
        for (name, value) in [("classes.decks.width", self.width), ("classes.decks.cell", self.cell)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::parameter(name, value, "metres, above 0"));
            }
        }
        Ok(())
    }

    /// The rows of building points that are the deck of a bridge, ascending by cell. `codes` has an entry a point of the
    /// cloud; `density` is in points per square metre. O(n + building cells · width).
    pub(super) fn rows(&self, points: &Points, codes: &[u8], density: f64, monitor: &Monitor) -> Result<Vec<u32>> {
        let code = |row: usize| codes[points.frame.index[row] as usize];
        let used: Vec<u32> =
            (0..points.len() as u32).filter(|&row| matches!(code(row as usize), BUILDING | GROUND)).collect();
        let edge = cell_edge(self.cell, SPACINGS, density);
        let cells = PlanRows::new(points, used, edge, monitor)?;
        let rows = |cell: usize| cells.of(cell).iter().copied();
        let buildings = |cell: usize| rows(cell).filter(|&row| code(row as usize) == BUILDING);
        let z = |row: u32| points.positions.z[row as usize];
        let surface = |cell: usize| match buildings(cell).map(z).reduce(f32::max) {
            Some(top) => {
                let height = buildings(cell).map(z).filter(|z| *z >= top - WALL).fold(top, f32::min);
                Surface { building: true, height }
            }
            None => Surface { building: false, height: rows(cell).map(z).fold(f32::MIN, f32::max) },
        };
        let surfaces = map_watched(cells.len(), monitor, surface)?;
        let scene = Scene { params: self, index: &cells.index, surfaces, edge };
        Ok(scene.decks(monitor)?.into_iter().flat_map(buildings).collect())
    }
}

/// Height of a cell of building or of ground, metres.
#[derive(Clone, Copy, Debug, Default)]
struct Surface {
    building: bool,
    height: f32,
}

/// The cells of a cloud.
struct Scene<'a> {
    params: &'a DeckParams,
    index: &'a CellIndex<[i32; 2]>,
    surfaces: Vec<Surface>,
    /// Edge of a cell, metres.
    edge: f64,
}

/// The line along a strip.
struct Axis {
    middle: [f64; 2],
    direction: [f64; 2],
    from: f64,
    length: f64,
}

impl Axis {
    /// Along the largest spread of these cells. Lengths are in cells.
    fn of(keys: &[[i32; 2]]) -> Self {
        let n = keys.len() as f64;
        let at = |key: &[i32; 2]| key.map(f64::from);
        let middle = keys.iter().map(at).fold([0.0; 2], |[x, y], [kx, ky]| [x + kx / n, y + ky / n]);
        let [xx, xy, yy] = keys.iter().map(at).fold([0.0; 3], |[xx, xy, yy], [x, y]| {
            let [x, y] = [x - middle[0], y - middle[1]];
            [xx + x * x, xy + x * y, yy + y * y]
        });
        let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
        let mut axis = Self { middle, direction: [cos, sin], from: 0.0, length: 1.0 };
        let places = || keys.iter().map(|&key| axis.along(key));
        let (from, to) = (places().fold(f64::MAX, f64::min), places().fold(f64::MIN, f64::max));
        (axis.from, axis.length) = (from, (to - from).max(1.0));
        axis
    }

    fn along(&self, key: [i32; 2]) -> f64 {
        let [x, y] = [f64::from(key[0]) - self.middle[0], f64::from(key[1]) - self.middle[1]];
        x * self.direction[0] + y * self.direction[1]
    }

    /// The place of a cell: 0 at one end, 1 at the other.
    fn place(&self, key: [i32; 2]) -> f64 {
        (self.along(key) - self.from) / self.length
    }
}

impl Scene<'_> {
    /// The cells of all decks, ascending.
    fn decks(&self, monitor: &Monitor) -> Result<BTreeSet<usize>> {
        let strip = map_watched(self.surfaces.len(), monitor, |cell| self.is_of_strip(cell))?;
        let mut strips = UnionFind::new(strip.len());
        if !strip.is_empty() {
            let mut walk = Walk::<1>::new(self.index.keys(), 0);
            for piece in watched(strip.len(), monitor) {
                for cell in piece?.filter(|&cell| strip[cell]) {
                    walk.around(cell, |near, _| {
                        if strip[near] && self.step(cell, near) <= self.params.step {
                            strips.unite(cell as u32, near as u32);
                        }
                    });
                }
            }
        }
        let roots = strips.roots(monitor)?;
        let mut cells: Vec<usize> = (0..strip.len()).filter(|&cell| strip[cell]).collect();
        cells.sort_by_key(|&cell| roots[cell]);
        let mut decks = BTreeSet::new();
        for strip in cells.chunk_by(|&a, &b| roots[a] == roots[b]) {
            monitor.check()?;
            decks.extend(self.deck(strip).into_iter().flatten());
        }
        Ok(decks)
    }

    /// Whether the ground on two opposite sides of a building cell is lower.
    fn is_of_strip(&self, cell: usize) -> bool {
        let lower = |direction: [i32; 2], most: f64| {
            let run = self.edge * length(direction);
            let mut key = self.index.keys()[cell];
            let mut gap = 0;
            for steps in 1..=(most / run) as usize {
                key = [key[0].saturating_add(direction[0]), key[1].saturating_add(direction[1])];
                match self.index.find(key).map(|near| self.surfaces[near]) {
                    Some(Surface { building: true, .. }) => gap = 0,
                    Some(ground) => {
                        let lower =
                            f64::from(self.surfaces[cell].height) - f64::from(ground.height) >= self.params.drop;
                        return lower.then_some(steps as f64 * run);
                    }
                    None if gap == GAP => return None,
                    None => gap += 1,
                }
            }
            None
        };
        let both = |[x, y]: [i32; 2]| {
            let width = lower([x, y], self.params.width)?;
            lower([-x, -y], self.params.width - width)
        };
        self.surfaces[cell].building && AXES.into_iter().any(|direction| both(direction).is_some())
    }

    /// The cells of the deck whose middle is this strip, if it is one.
    fn deck(&self, strip: &[usize]) -> Option<BTreeSet<usize>> {
        let keys: Vec<[i32; 2]> = strip.iter().map(|&cell| self.index.keys()[cell]).collect();
        let axis = Axis::of(&keys);
        let [length, area] = [(axis.length + 1.0) * self.edge, strip.len() as f64 * self.edge.powi(2)];
        if length < self.params.length || length < NARROW * area / length {
            return None;
        }
        let mut deck: BTreeSet<usize> = strip.iter().copied().collect();
        for _ in 0..(self.params.reach / self.edge).ceil() as usize {
            let before = deck.len();
            self.grow(&mut deck, self.params.step);
            if deck.len() == before {
                break;
            }
        }
        let level = |cell: usize| {
            let ground = |near: usize| !self.surfaces[near].building && self.step(cell, near) < self.params.step;
            self.around(cell).any(ground)
        };
        let mut contacts = [0; 3];
        for &cell in deck.iter().filter(|&&cell| level(cell)) {
            let place = axis.place(self.index.keys()[cell]);
            contacts[usize::from(place >= END) + usize::from(place > 1.0 - END)] += 1;
        }
        let [first, between, last] = contacts;
        if first == 0 || last == 0 || f64::from(between) > BETWEEN * strip.len() as f64 {
            return None;
        }
        // Railings.
        self.grow(&mut deck, self.params.drop);
        Some(deck)
    }

    /// Adds the building cells around these that are a small step away.
    fn grow(&self, cells: &mut BTreeSet<usize>, step: f64) {
        let more = |&cell: &usize| {
            let near = move |&near: &usize| self.surfaces[near].building && self.step(cell, near) <= step;
            self.around(cell).filter(near)
        };
        let more: Vec<usize> = cells.iter().flat_map(more).collect();
        cells.extend(more);
    }

    /// Occupied cells around a cell, itself included.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        block(self.index.keys()[cell], 1).filter_map(|key| self.index.find(key))
    }

    fn step(&self, a: usize, b: usize) -> f64 {
        (f64::from(self.surfaces[a].height) - f64::from(self.surfaces[b].height)).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    /// A valley of 120 x 60 m that is 6 m deep, with something named building across it: its height.
    fn scene(building: impl Fn(f64, f64) -> Option<f64>) -> (Points, Vec<u8>) {
        let places = (0..28_800).map(|i| (f64::from(i % 240) / 2.0 + 0.2, f64::from(i / 240) / 2.0 + 0.2));
        let valley = |x: f64| (((x - 60.0).abs() - 40.0) * 0.6).clamp(-6.0, 0.0);
        let mut rows = Vec::new();
        let mut codes = Vec::new();
        for (x, y) in places {
            let (z, code) = building(x, y).map_or((valley(x), GROUND), |z| (z, BUILDING));
            rows.push([x, y, z]);
            codes.push(code);
        }
        (Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0), codes)
    }

    fn found(scene: &(Points, Vec<u8>)) -> usize {
        found_by(&DeckParams::default(), scene)
    }

    fn found_by(params: &DeckParams, scene: &(Points, Vec<u8>)) -> usize {
        params.rows(&scene.0, &scene.1, 4.0, &Monitor::default()).unwrap().len()
    }

    fn named(scene: &(Points, Vec<u8>)) -> usize {
        scene.1.iter().filter(|&&code| code == BUILDING).count()
    }

    #[test]
    fn a_bridge_over_a_valley_is_a_deck_and_a_house_in_it_is_none() {
        // Straight and askew, with railings of 1 m.
        for turn in [0.0, 0.3] {
            let across = |x: f64, y: f64| (y - 30.0) - turn * (x - 60.0);
            let rail = |x: f64, y: f64| if across(x, y).abs() > 2.5 { 1.0 } else { 0.0 };
            let on = |x: f64, y: f64| (x - 60.0).abs() < 42.0 && across(x, y).abs() < 3.0;
            let arch = |x: f64| 0.8 - ((x - 60.0) / 47.0).powi(2);
            let bridge = scene(|x, y| on(x, y).then_some(arch(x) + rail(x, y)));
            let share = found(&bridge) as f64 / named(&bridge) as f64;
            assert!(share > 0.95, "{turn}: {share}");
        }
        let house = |x: f64, y: f64| (x - 60.0).abs() < 25.0 && (y - 30.0).abs() < 5.0;
        assert_eq!(found(&scene(|x, y| house(x, y).then_some(3.0))), 0);
    }

    #[test]
    fn what_reaches_ground_at_one_end_only_or_all_along_is_no_deck() {
        let pier = |x: f64, y: f64| x < 60.0 && x > 18.0 && (y - 30.0).abs() < 3.0;
        assert_eq!(found(&scene(|x, y| pier(x, y).then_some(0.1))), 0);
        // A flat roof from side to side of the valley, too wide for a deck.
        let wide = |x: f64, y: f64| (x - 60.0).abs() < 42.0 && (y - 30.0).abs() < 15.0;
        assert_eq!(found(&scene(|x, y| wide(x, y).then_some(0.1))), 0);
        assert_eq!(found(&scene(|_, _| None)), 0);
        assert_eq!(found(&(Points::default(), Vec::new())), 0);
    }

    #[test]
    fn a_deck_is_long_and_narrow() {
        let flat = |half: f64| {
            let on = move |x: f64, y: f64| (x - 60.0).abs() < 42.0 && (y - 30.0).abs() < half;
            scene(move |x, y| on(x, y).then_some(0.1))
        };
        let broad = DeckParams { width: 100.0, ..DeckParams::default() };
        assert!(found_by(&broad, &flat(15.0)) > 0);
        // 84 m long and 58 m wide.
        assert_eq!(found_by(&broad, &flat(29.0)), 0);
        assert_eq!(found_by(&DeckParams { length: 90.0, ..DeckParams::default() }, &flat(3.0)), 0);
        assert!(found_by(&DeckParams { length: 70.0, ..DeckParams::default() }, &flat(3.0)) > 0);
    }

    #[test]
    fn ranges_are_checked() {
        DeckParams::none().validate().unwrap();
        assert!(DeckParams { width: 0.0, ..DeckParams::default() }.validate().is_err());
        assert!(DeckParams { step: f64::NAN, ..DeckParams::default() }.validate().is_err());
    }
}
