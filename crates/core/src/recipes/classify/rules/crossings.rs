//! Level ways across lower ground, which may be the decks of bridges over land: steep drops on two opposite sides, and
//! ground at both ends.
//!
//! They keep their class, for culverts and steep dams look the same. Only a warning says where they are.

use super::plan::{AXES, BLOCK, PlanRows, SPACINGS, block, cell_edge, each_cell, groups, length, pieces, quantile};
use super::raised::Land;
use super::{BUILDING, GROUND};
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered, map_watched};
use crate::voxels::cells::index::{CellIndex, Walk, block_of};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// Least edge of a cell, metres; also [`SPACINGS`] point spacings.
const CELL: f64 = 1.0;
/// Greatest width of a way from drop to drop, to one cell, metres.
const WIDTH: f64 = 20.0;
/// Least drop, metres.
const DROP: f64 = 0.7;
/// So many cells between drops and level cells may be empty.
const GAP: i32 = 1;
/// Heights of level cells differ by this much, metres, and by this slope.
const LEVEL: f64 = 0.4;
const GRADE: f64 = 0.05;
/// The first two cells of a drop have this share of its depth up to so many metres away: a slope of earth has less.
const STEEP: f64 = 0.8;
const BESIDE: f64 = 8.0;
/// Along the way, next to the drop, ground rises to this share of the drop on both sides within so many metres.
const RISE: f64 = 0.5;
const BANK: f64 = 25.0;
/// Least area between the drops, square metres.
const AREA: f64 = 10.0;
/// Building or unclassified points up to about so many metres beyond may hide where the way meets the ground.
const APPROACH: f64 = 3.0;
/// Most pieces of ground that the way meets: rough land is met in many.
const ENDS: usize = 3;
/// The second piece has this share of the cells of the first: a deck is met along its width at both ends.
const ALIKE: f64 = 0.3;
/// Least number of cells of a piece.
const PIECE: usize = 3;
/// Least area of the ground that begins at a piece, square metres.
const LAND: f64 = 60.0;
/// Cells of one piece are at most so many cells apart: one between them may be empty, but neither lower nor on the way.
const APART: i32 = 2;
/// Axes between those of [`AXES`]; with fewer axes across, a wide deck over a narrow channel is missed.
const BETWEEN: [[i32; 2]; 12] =
    [[2, 1], [1, 2], [2, -1], [1, -2], [3, 1], [1, 3], [3, -1], [1, -3], [3, 2], [2, 3], [3, -2], [2, -3]];
/// From a cell to the next along a way less than so many cells.
const STEP: f64 = 5.0;
/// The next cell along a way is at most so many cells away along each axis.
const SIDE: usize = STEP as usize - 1;

/// A level way across lower ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// A point in its middle.
    pub(super) row: u32,
    /// From drop to drop, metres.
    pub(super) width: f64,
    /// The deepest drop, metres.
    pub(super) fall: f64,
}

/// The ways across lower ground, the highest first. O(n log n).
pub(super) fn crossings(land: &Land<'_>, monitor: &Monitor) -> Result<Vec<Crossing>> {
    let Land { points, codes, free, density } = *land;
    let code = |row: u32| codes[points.frame.index[row as usize] as usize];
    let is_used = |&row: &u32| matches!(code(row), GROUND | BUILDING) || code(row) == free;
    let used: Vec<u32> = (0..points.len() as u32).filter(is_used).collect();
    let edge = cell_edge(CELL, SPACINGS, density);
    let cells = PlanRows::new(points, used, edge, monitor)?;
    let rows = |cell: usize| cells.of(cell).iter().copied();
    let surface = |cell: usize| {
        let z = |row: u32| points.positions.z[row as usize];
        let ground = || rows(cell).filter(|&row| code(row) == GROUND).map(z);
        Surface {
            height: quantile(&mut rows(cell).map(|row| f64::from(z(row))).collect::<Vec<f64>>(), 0.5) as f32,
            lowest: ground().fold(f32::INFINITY, f32::min),
            highest: ground().fold(f32::NEG_INFINITY, f32::max),
            bare: rows(cell).all(|row| code(row) == GROUND),
        }
    };
    let surfaces = map_watched(cells.len(), monitor, surface)?;
    let scene = Scene { index: &cells.index, surfaces, edge };
    let crossing =
        |place: Place| Some(Crossing { row: rows(place.cell).next()?, width: place.width, fall: place.fall });
    let mut crossings: Vec<Crossing> = scene.places(monitor)?.into_iter().filter_map(crossing).collect();
    crossings.sort_by(|a, b| b.fall.total_cmp(&a.fall));
    Ok(crossings)
}

/// Heights of a cell, metres.
#[derive(Clone, Copy, Debug, Default)]
struct Surface {
    /// Half of its points are lower.
    height: f32,
    /// The lowest and the highest point of ground; infinite without one.
    lowest: f32,
    highest: f32,
    /// Whether all its points are ground.
    bare: bool,
}

/// The cells of a cloud.
struct Scene<'a> {
    index: &'a CellIndex<[i32; 2]>,
    surfaces: Vec<Surface>,
    /// Edge of a cell, metres.
    edge: f64,
}

/// What lies next to a cell in a direction.
enum Next {
    Level(usize),
    Drop(Drop),
}

/// Where lower ground begins beside a level cell.
struct Drop {
    /// The level cell.
    brink: usize,
    /// The first cell with lower ground, which may have no other points.
    foot: [i32; 2],
}

/// A line of cells between two drops.
struct Strip {
    cells: Vec<usize>,
    /// From drop to drop, metres.
    width: f64,
    /// The lesser of the two drops, metres.
    fall: f64,
}

/// A cell of a way across lower ground.
#[derive(Clone, Copy)]
struct Place {
    cell: usize,
    /// Of the narrowest strip, metres.
    width: f64,
    /// Of the deepest strip, metres.
    fall: f64,
}

impl Scene<'_> {
    /// One cell for each way, in its middle.
    fn places(&self, monitor: &Monitor) -> Result<Vec<Place>> {
        let strips_of = |brink: usize| {
            let axes = AXES.into_iter().chain(BETWEEN);
            axes.filter_map(|direction| self.strip(brink, direction)).collect::<Vec<Strip>>()
        };
        let mut places = BTreeMap::<usize, Place>::new();
        let brinks = self.brinks(monitor)?;
        for strip in each_cell(brinks.len(), monitor, |i| strips_of(brinks[i]))? {
            for cell in strip.cells {
                let place = places.entry(cell).or_insert(Place { cell, width: f64::MAX, fall: 0.0 });
                (place.width, place.fall) = (place.width.min(strip.width), place.fall.max(strip.fall));
            }
        }
        let cells = places.keys().copied().collect();
        let near = |cell: usize| self.within(cell, 1).filter(|near| places.contains_key(near));
        let mut ways = groups(cells, near, monitor)?;
        ways.retain(|way| way.len() as f64 * self.edge.powi(2) >= AREA && self.joins(way));
        let place = |way: &Vec<usize>| {
            let fall = way.iter().filter_map(|cell| places.get(cell)).map(|place| place.fall).fold(0.0, f64::max);
            places.get(&self.middle(way)?).map(|place| Place { fall, ..*place })
        };
        Ok(ways.iter().filter_map(place).collect())
    }

    /// The cells with lower ground near enough to be the next one: most have none.
    fn brinks(&self, monitor: &Monitor) -> Result<Vec<usize>> {
        let keys = self.index.keys();
        let found = map_ordered(keys.len().div_ceil(BLOCK), monitor, |block| {
            let cells = block_of(block, BLOCK, keys.len());
            let mut walk = Walk::<SIDE>::new(keys, cells.start);
            let mut drops = |cell: usize| {
                let mut lowest = f32::INFINITY;
                walk.around(cell, |near, _| lowest = lowest.min(self.surfaces[near].lowest));
                self.is_below(lowest, cell)
            };
            Ok(cells.filter(|&cell| drops(cell)).collect::<Vec<usize>>())
        })?;
        Ok(found.concat())
    }

    /// The cells from one that drops in a direction to one that drops in the opposite direction, if both drops are steep and
    /// have banks.
    fn strip(&self, brink: usize, direction: [i32; 2]) -> Option<Strip> {
        let Next::Drop(first) = self.next(brink, brink, direction)? else { return None };
        let back = direction.map(|step| -step);
        let mut cells = vec![brink];
        let last = loop {
            match self.next(brink, *cells.last()?, back)? {
                Next::Level(cell) => cells.push(cell),
                Next::Drop(last) => break last,
            }
            if self.distance(brink, self.index.keys()[*cells.last()?]) > WIDTH {
                return None;
            }
        };
        let feet = [0, 1].map(|axis| f64::from(first.foot[axis] - last.foot[axis]) * self.edge);
        let width = feet[0].hypot(feet[1]) - self.edge;
        if width > WIDTH + 2.0 * self.run(direction) - self.edge {
            return None;
        }
        let fall = self.fall(&first, direction)?.min(self.fall(&last, back)?);
        Some(Strip { cells, width, fall })
    }

    /// The next cell in a direction that is level with `brink`, or the drop before it.
    fn next(&self, brink: usize, cell: usize, direction: [i32; 2]) -> Option<Next> {
        let find = |steps: i32| {
            let key = self.ahead(self.index.keys()[cell], direction, steps);
            let near = self.index.find(key)?;
            if self.is_lower(near, cell) {
                return Some(Next::Drop(Drop { brink: cell, foot: key }));
            }
            let most = LEVEL + GRADE * self.distance(brink, key);
            ((self.height(near) - self.height(brink)).abs() <= most).then_some(Next::Level(near))
        };
        (1..=GAP + 1).take_while(|&steps| f64::from(steps) * length(direction) < STEP).find_map(find)
    }

    /// The depth of a drop if it is steep and ground rises on both sides along the way.
    fn fall(&self, drop: &Drop, direction: [i32; 2]) -> Option<f64> {
        let height = self.height(drop.brink);
        let lower = |steps: i32| {
            let near = self.index.find(self.ahead(drop.foot, direction, steps));
            near.map_or(0.0, |near| height - f64::from(self.surfaces[near].lowest))
        };
        let deepest = |most: i32| (0..=most).map(lower).fold(0.0, f64::max);
        let fall = deepest(1);
        let cells = (BANK / self.run(direction)) as i32;
        let rises = |along: [i32; 2]| {
            let mut keys = (1..=cells).map(|steps| self.ahead(drop.foot, along, steps));
            let is_bank = |near: usize| f64::from(self.surfaces[near].highest) >= height - RISE * fall;
            keys.any(|key| self.index.find(key).is_some_and(is_bank))
        };
        let [x, y] = direction;
        let is_steep = fall >= STEEP * deepest((BESIDE / self.run(direction)) as i32);
        (is_steep && rises([-y, x]) && rises([y, -x])).then_some(fall)
    }

    /// Whether a way meets land at two ends.
    fn joins(&self, way: &[usize]) -> bool {
        let way = self.grown(way);
        let is_end = |piece: &Vec<usize>| piece.len() >= PIECE && self.is_land(piece, &way);
        let mut ends: Vec<usize> = self.beside(&way).iter().filter(|piece| is_end(piece)).map(Vec::len).collect();
        ends.sort_unstable_by_key(|&cells| Reverse(cells));
        ends.len() <= ENDS && matches!(ends[..], [first, second, ..] if second as f64 >= ALIKE * first as f64)
    }

    /// A way with the cells beside it that are not bare.
    fn grown(&self, way: &[usize]) -> BTreeSet<usize> {
        let mut way: BTreeSet<usize> = way.iter().copied().collect();
        for _ in 0..(APPROACH / self.edge) as usize {
            let is_more = |near: usize, cell: usize| !self.surfaces[near].bare && self.is_level(near, cell);
            let more = |&cell: &usize| self.within(cell, 1).filter(move |&near| is_more(near, cell));
            let more: Vec<usize> = way.iter().flat_map(more).collect();
            way.extend(more);
        }
        way
    }

    /// The pieces of the bare ground that a way meets without a step.
    fn beside(&self, way: &BTreeSet<usize>) -> Vec<Vec<usize>> {
        let is_met =
            |near: usize, cell: usize| !way.contains(&near) && self.surfaces[near].bare && self.is_level(near, cell);
        let met = |&cell: &usize| self.within(cell, 1).filter(move |&near| is_met(near, cell));
        let is_apart = |cell: usize, near: usize| {
            let is_wall = |wall: usize| way.contains(&wall) || self.is_lower(wall, cell);
            self.between(cell, near).into_iter().all(|key| self.index.find(key).is_some_and(is_wall))
        };
        let joined = |cell: usize| self.within(cell, APART).filter(move |&near| !is_apart(cell, near));
        pieces(way.iter().flat_map(met).collect(), joined)
    }

    /// Whether bare ground without a step goes on from cells far enough beside a way.
    fn is_land(&self, cells: &[usize], way: &BTreeSet<usize>) -> bool {
        let most = (LAND / self.edge.powi(2)).ceil() as usize;
        let mut found: BTreeSet<usize> = cells.iter().copied().collect();
        let mut open = cells.to_vec();
        while let Some(cell) = open.pop() {
            if found.len() >= most {
                break;
            }
            let is_next = |&near: &usize| !way.contains(&near) && self.surfaces[near].bare && self.is_level(near, cell);
            open.extend(self.within(cell, 1).filter(is_next).filter(|&near| found.insert(near)));
        }
        found.len() >= most
    }

    /// The cell next to the mean of these.
    fn middle(&self, way: &[usize]) -> Option<usize> {
        let keys = || way.iter().map(|&cell| self.index.keys()[cell].map(f64::from));
        let [x, y] = keys().fold([0.0; 2], |[x, y], key| [x + key[0], y + key[1]]).map(|sum| sum / way.len() as f64);
        let away = |&cell: &usize| {
            let key = self.index.keys()[cell].map(f64::from);
            (key[0] - x).hypot(key[1] - y)
        };
        way.iter().copied().min_by(|a, b| away(a).total_cmp(&away(b)))
    }

    /// Whether cells next to each other have no step between them.
    fn is_level(&self, a: usize, b: usize) -> bool {
        (self.height(a) - self.height(b)).abs() <= LEVEL * self.edge.max(1.0)
    }

    /// Whether a cell has ground lower than another.
    fn is_lower(&self, cell: usize, than: usize) -> bool {
        self.is_below(self.surfaces[cell].lowest, than)
    }

    /// Whether a height is so far below a cell that ground there is lower.
    fn is_below(&self, height: f32, cell: usize) -> bool {
        f64::from(height) < self.height(cell) - DROP
    }

    /// The cells in the middle between two: twice the same, one of the two, or both between.
    fn between(&self, a: usize, b: usize) -> [[i32; 2]; 2] {
        let [a, b] = [a, b].map(|cell| self.index.keys()[cell]);
        let middle = |axis: usize, up: i32| (a[axis].saturating_add(b[axis]) + up).div_euclid(2);
        [[middle(0, 0), middle(1, 1)], [middle(0, 1), middle(1, 0)]]
    }

    fn height(&self, cell: usize) -> f64 {
        f64::from(self.surfaces[cell].height)
    }

    fn ahead(&self, key: [i32; 2], direction: [i32; 2], steps: i32) -> [i32; 2] {
        [0, 1].map(|axis| key[axis].saturating_add(steps * direction[axis]))
    }

    /// Metres to the next cell in a direction.
    fn run(&self, step: [i32; 2]) -> f64 {
        self.edge * length(step)
    }

    /// From the middle of a cell to that of another, metres.
    fn distance(&self, cell: usize, key: [i32; 2]) -> f64 {
        let [x, y] = self.index.keys()[cell];
        self.run([key[0].saturating_sub(x), key[1].saturating_sub(y)])
    }

    /// Occupied cells around a cell, at most `reach` away along each axis, itself included.
    fn within(&self, cell: usize, reach: i32) -> impl Iterator<Item = usize> + '_ {
        block(self.index.keys()[cell], reach).filter_map(|key| self.index.find(key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};

    /// A point of a scan.
    struct Spot {
        z: f64,
        code: u8,
    }

    /// 80 x 80 m at 4 points a square metre; none where there is no spot.
    fn found(spot: impl Fn(f64, f64) -> Option<Spot>) -> Vec<Crossing> {
        let at = (0..25_600).map(|i| [f64::from(i % 160) / 2.0 + 0.2, f64::from(i / 160) / 2.0 + 0.2]);
        let mut rows: Vec<[f64; 3]> = Vec::new();
        let mut codes = Vec::new();
        for [x, y] in at {
            if let Some(Spot { z, code }) = spot(x, y) {
                rows.push([x, y, z]);
                codes.push(code);
            }
        }
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let land = Land { points: &points, codes: &codes, free: 1, density: 4.0 };
        crossings(&land, &Monitor::default()).unwrap()
    }

    /// A ditch along y through the middle.
    struct Ditch {
        depth: f64,
        /// Of its floor, metres.
        floor: f64,
        /// Rise of its banks.
        slope: f64,
    }

    impl Ditch {
        fn height(&self, x: f64) -> f64 {
            (self.slope * ((x - 40.0).abs() - self.floor / 2.0) - self.depth).clamp(-self.depth, 0.0)
        }
    }

    const SMALL: Ditch = Ditch { depth: 1.2, floor: 3.0, slope: 0.67 };
    const NARROW: Ditch = Ditch { depth: 1.2, floor: 2.4, slope: 0.67 };
    const CUTTING: Ditch = Ditch { depth: 4.0, floor: 12.0, slope: 20.0 };

    /// A ditch with a deck of a width, turned, of a class.
    fn bridged(ditch: &Ditch, width: f64, turn: f64, code: u8) -> impl Fn(f64, f64) -> Option<Spot> + '_ {
        move |x, y| match ((y - 40.0) - turn * (x - 40.0)).abs() < width / 2.0 * turn.hypot(1.0)
            && ditch.height(x) < 0.0
        {
            true => Some(Spot { z: 0.0, code }),
            false => Some(Spot { z: ditch.height(x), code: GROUND }),
        }
    }

    #[test]
    fn cells_that_are_passed_over_drop_in_no_direction() {
        let keys: Vec<[i32; 2]> = (0..3600).map(|i| [i / 60, i % 60]).filter(|[x, y]| (x * y) % 7 != 3).collect();
        let surface = |&[x, y]: &[i32; 2]| {
            let height = if (x - 30).abs() < 2 || (y - 20).abs() < 1 { -2.0 } else { 0.01 * x as f32 };
            Surface { height, lowest: height, highest: height, bare: true }
        };
        let surfaces: Vec<Surface> = keys.iter().map(surface).collect();
        let index = CellIndex::new(keys);
        let scene = Scene { index: &index, surfaces, edge: 1.0 };
        let brinks = scene.brinks(&Monitor::default()).unwrap();
        let drops = |&cell: &usize| {
            let mut axes = AXES.into_iter().chain(BETWEEN).flat_map(|[x, y]| [[x, y], [-x, -y]]);
            axes.any(|direction| matches!(scene.next(cell, cell, direction), Some(Next::Drop(_))))
        };
        let dropping: Vec<usize> = (0..scene.surfaces.len()).filter(drops).collect();
        assert!(dropping.len() > 300 && dropping.iter().all(|cell| brinks.binary_search(cell).is_ok()));
        assert!(brinks.len() < scene.surfaces.len() / 2, "{}", brinks.len());
    }

    #[test]
    fn a_deck_across_a_ditch_is_found_whatever_its_class() {
        for ditch in [SMALL, CUTTING] {
            for (width, turn) in [(4.0, 0.0), (6.0, 0.4), (12.0, 0.2)] {
                for code in [GROUND, BUILDING, 1] {
                    let places = found(bridged(&ditch, width, turn, code));
                    let [place] = places[..] else { panic!("{width} {turn} {code}: {places:?}") };
                    assert!((place.width - width).abs() < 2.5, "{width} {turn} {code}: {place:?}");
                    assert!((place.fall - ditch.depth).abs() < 0.1, "{width} {turn} {code}: {place:?}");
                }
            }
        }
    }

    #[test]
    fn a_wide_deck_across_a_narrow_ditch_is_found_in_any_direction() {
        for degrees in [-71.0_f64, -50.0, -33.0, -12.0, 4.0, 17.0, 29.0, 60.0, 77.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            for width in [9.0, 15.0] {
                let deck = bridged(&NARROW, width, 0.0, GROUND);
                let turned = |x: f64, y: f64| {
                    let [x, y] = [x - 40.0, y - 40.0];
                    deck(40.0 + cos * x - sin * y, 40.0 + sin * x + cos * y)
                };
                let places = found(turned);
                let [place] = places[..] else { panic!("{width} {degrees}: {places:?}") };
                assert!((place.width - width).abs() < 3.0, "{width} {degrees}: {place:?}");
            }
        }
    }

    #[test]
    fn a_spur_that_meets_ground_along_one_side_is_none() {
        let ground = |z: f64| Some(Spot { z, code: GROUND });
        // 30 m wide at its foot, 8 m at its tip, with walls.
        let spur = |x: f64, y: f64| {
            let is_spur = (x - 40.0).abs() < 8.0 && (y - 40.0).abs() < 4.0 + 0.7 * (48.0 - x).max(0.0);
            ground(if is_spur || x < 32.0 { 0.0 } else { -4.0 })
        };
        assert!(found(spur).is_empty());
    }

    #[test]
    fn building_beyond_the_ends_of_a_deck_does_not_hide_it() {
        let leaks = |x: f64, y: f64| {
            let near = (x - 40.0).abs() < 8.5 && (y - 40.0).abs() < 5.0;
            bridged(&CUTTING, 8.0, 0.0, BUILDING)(x, y)
                .map(|Spot { z, code }| Spot { z, code: if near && z == 0.0 { BUILDING } else { code } })
        };
        assert_eq!(found(leaks).len(), 1);
    }

    #[test]
    fn slopes_of_earth_shallow_ditches_piers_and_roofs_are_none() {
        let ground = |z: f64| Some(Spot { z, code: GROUND });
        // A dam with sides of 1 : 2, higher than the rule needs.
        let dam = |x: f64, y: f64| ground(CUTTING.height(x).max(0.5 * (6.0 - (y - 40.0).abs())).min(0.0));
        assert!(found(dam).is_empty());
        assert!(found(|x, _| ground(CUTTING.height(x))).is_empty());
        let shallow = Ditch { depth: 0.6, ..SMALL };
        assert!(found(bridged(&shallow, 4.0, 0.0, GROUND)).is_empty());
        let pier = |x: f64, y: f64| ground(if x < 41.0 && (y - 40.0).abs() < 3.0 { 0.0 } else { CUTTING.height(x) });
        assert!(found(pier).is_empty());
        let house = |x: f64, y: f64| match (x - 40.0).abs() < 6.0 && (y - 40.0).abs() < 4.0 {
            true => Some(Spot { z: 3.0, code: BUILDING }),
            false => ground(0.0),
        };
        assert!(found(house).is_empty());
        // Hills of 3 m every 12 m.
        let hills = |x: f64, y: f64| ground(1.5 * (x / 1.9).sin() * (y / 1.9).sin());
        assert!(found(hills).is_empty());
        assert!(found(|_, _| None).is_empty());
    }
}
