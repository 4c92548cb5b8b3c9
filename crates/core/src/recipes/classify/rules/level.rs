//! Buildings that do not stand above the ground around them: hilltops, terraces and decks of bridges, which the trees
//! take for roofs because they are flat and high.

use super::plan::{PlanRows, SPACINGS, cell_edge, outline};
use super::{BUILDING, GROUND};
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::graph::UnionFind;
use crate::parallel::{Monitor, watched};
use crate::voxels::cells::index::Walk;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// When a building is level with the ground around it.
///
/// Cells in plan that hold building points are joined to components, 8 neighbours a cell, unless their highest building
/// points differ by more than the edge of a cell (and `step`; in thin clouds, which have larger cells, 1.5 edges): ground
/// beside a house that was named building is no part of the house. Each pair of a building cell and a neighbour that holds
/// ground, but no building, and each building cell that holds ground itself, is level, drops, or does not count: by the step
/// from the building point to the ground point that are nearest in plan. Building points more than 1 m below the highest of
/// their cell, which may lie on a wall, are left out, and so are pairs whose points are more than the edge of a cell apart.
/// A level pair is flush if its step is at most 0.15 m and the ground a piece of 1,000 m² or more, without steps: the brink of a
/// pit, a quarry or a quay is flush with the land behind it and drops on the other side, while a roof is hardly flush with any
/// ground but a part of itself that was named ground.
///
/// What lies on the ground of the ground filter is judged apart. If the stages are not sure of such a component of 40 m² or
/// more (mean confidence below 0.8), it is ground if more than a quarter of its pairs that are level or drop are level: slopes
/// and terraces between houses have walls and hedges on most sides.
///
/// A component that drops, but also covers more than 0.75 of the outline of the scan, encloses it, and becomes unclassified: the
/// rim of a pit that ends with the scan looks like the roofs around a courtyard. A building that is cut by the edge of a scan
/// covers at most three quarters, unless it lies at all four sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LevelParams {
    /// A component is no building if more than this share of its pairs that are level or drop are level; 0..=1. 1: by `flush`
    /// only.
    pub share: f64,
    /// Nor if more than this share of them are flush; 0..=1. 1: by `share` only.
    pub flush: f64,
    /// It is ground if more than this share are level, else unclassified; 0..=1. 1: never. Points higher than `drop` above
    /// the lowest of their cell are unclassified.
    pub ground: f64,
    /// Largest step of a level pair, metres; 0 or more.
    pub step: f64,
    /// Pairs with a larger step are level, too, up to this slope (height by distance, 0 to 1): embankments in thin clouds.
    pub slope: f64,
    /// Least step down of a pair that drops, metres; not below `step`. A slope that drops is also steeper than 1.
    pub drop: f64,
    /// Level pairs that a component must have at least.
    pub pairs: usize,
    /// Least edge of a cell, metres, above 0; clouds of less than 2.25 points per cell have cells of 1.5 point spacings.
    pub cell: f64,
}

impl Default for LevelParams {
    fn default() -> Self {
        Self { share: 0.55, flush: 0.35, ground: 0.9, step: 0.5, slope: 0.75, drop: 1.5, pairs: 3, cell: 1.0 }
    }
}

/// Rows of building points by the ground around them, each ascending by cell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct LevelRows {
    /// Those that are ground.
    pub(super) ground: Vec<u32>,
    /// Those that are ground because the stages are not sure of them.
    pub(super) doubted: Vec<u32>,
    /// Those that may be a deck or a terrace.
    pub(super) unknown: Vec<u32>,
    /// Those that enclose the scan: roofs around a courtyard, or the rim of a pit.
    pub(super) enclosing: Vec<u32>,
    /// Others, which stand above the ground on most sides.
    pub(super) standing: Vec<u32>,
}

impl LevelRows {
    /// These rows, but those that stand by what is known `later`, and the rows that only then are level; `points` is the number
    /// of all rows.
    pub(super) fn revised(self, later: Self, points: usize) -> Self {
        let marked = |lists: &[&Vec<u32>]| {
            let mut marks = vec![false; points];
            lists.iter().copied().flatten().for_each(|&row| marks[row as usize] = true);
            marks
        };
        let (found, standing) = (marked(&[&self.ground, &self.unknown]), marked(&[&later.standing]));
        let without = |rows: Vec<u32>, marks: &[bool]| -> Vec<u32> {
            rows.into_iter().filter(|&row| !marks[row as usize]).collect()
        };
        Self {
            ground: [without(self.ground, &standing), without(later.ground, &found)].concat(),
            unknown: [without(self.unknown, &standing), without(later.unknown, &found)].concat(),
            ..later
        }
    }
}

/// Building points lower than this below the highest of their cell may be of a wall, metres.
const WALL: f32 = 1.0;
/// Largest step of a flush pair, metres.
const FLUSH: f64 = 0.15;
/// Least area of the ground that a brink is flush with, square metres.
const LAND: f64 = 1000.0;
/// A component that covers more than this share of the outline of a scan encloses it.
const ENCLOSING: f64 = 0.75;
/// Components of less mean confidence are doubted,
const SURE: f64 = 0.8;
/// if they have this area, square metres;
const PIECE: f64 = 40.0;
/// they are ground if more than this share of their pairs that are level or drop are level.
const DOUBTED: f64 = 0.25;
/// Slope from which on a step is a wall.
const STEEP: f64 = 1.0;
/// Slope from which on cells of thin clouds are not of one roof.
const ROOF: f64 = 1.5;
/// Points of a cell that are compared with those of another, about at most.
const SAMPLES: usize = 16;

/// From a building point to the ground point that is nearest in plan.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// In plan, metres.
    distance: f64,
    /// Metres, positive if the ground is lower.
    height: f64,
}

impl Step {
    /// The shortest one between these points.
    fn shortest(building: &[[f32; 3]], ground: &[[f32; 3]]) -> Option<Self> {
        let pairs = building.iter().flat_map(|own| ground.iter().map(move |near| (own, near)));
        // The distances squared are enough to compare.
        let step = |([x, y, z], [nx, ny, nz]): (&[f32; 3], &[f32; 3])| Self {
            distance: f64::from(x - nx).powi(2) + f64::from(y - ny).powi(2),
            height: f64::from(z - nz),
        };
        let shortest = pairs.map(step).min_by(|a, b| a.distance.total_cmp(&b.distance))?;
        Some(Self { distance: shortest.distance.sqrt(), ..shortest })
    }
}

/// Pairs of a component.
#[derive(Clone, Copy, Debug, Default)]
struct Pairs {
    level: u32,
    drop: u32,
    /// Of the level ones.
    flush: u32,
}

impl Pairs {
    /// Counts a step of one of the two kinds; `land` is whether it leads to a large piece of ground.
    fn count(&mut self, params: &LevelParams, step: Step, land: bool) {
        let Step { distance, height } = step;
        let level = height.abs() < params.step.max(params.slope * distance);
        self.level += u32::from(level);
        self.flush += u32::from(level && land && height.abs() <= FLUSH);
        self.drop += u32::from(height > params.drop.max(STEEP * distance));
    }

    fn plus(self, other: Self) -> Self {
        Self { level: self.level + other.level, drop: self.drop + other.drop, flush: self.flush + other.flush }
    }

    /// Whether so many pairs are more than this share of all.
    fn exceed(&self, pairs: u32, share: f64) -> bool {
        f64::from(pairs) > share * f64::from(self.level + self.drop)
    }

    /// Whether the component is level with the ground by its share of level or of flush pairs.
    fn is_level(&self, params: &LevelParams) -> bool {
        self.exceed(self.level, params.share) || self.exceed(self.flush, params.flush)
    }
}

/// The first and the last cell along each axis.
#[derive(Clone, Copy, Debug)]
struct Extent {
    low: [i32; 2],
    high: [i32; 2],
}

impl Extent {
    fn of(keys: &[[i32; 2]]) -> Self {
        let mut extent = Self { low: [i32::MAX; 2], high: [i32::MIN; 2] };
        keys.iter().for_each(|&key| extent.include(key));
        extent
    }

    fn include(&mut self, key: [i32; 2]) {
        for (axis, place) in key.into_iter().enumerate() {
            self.low[axis] = self.low[axis].min(place);
            self.high[axis] = self.high[axis].max(place);
        }
    }

    /// Whether it takes more than half of another one along both axes.
    fn spans(&self, all: &Self) -> bool {
        let cells = |extent: &Self, axis: usize| i64::from(extent.high[axis]) - i64::from(extent.low[axis]) + 1;
        (0..2).all(|axis| 2 * cells(self, axis) > cells(all, axis))
    }
}

/// A scan whose buildings are judged.
#[derive(Clone, Copy)]
pub(super) struct Judged<'a> {
    pub(super) points: &'a Points,
    /// A code for each point of the cloud.
    pub(super) codes: &'a [u8],
    /// The confidence in each of them; empty: nothing is doubted.
    pub(super) confidence: &'a [f32],
    /// Points per square metre.
    pub(super) density: f64,
}

impl Judged<'_> {
    /// The point of the cloud that a row is.
    pub(super) fn point(&self, row: u32) -> usize {
        self.points.frame.index[row as usize] as usize
    }
}

/// The cells in plan that hold building or ground.
struct Scene<'a> {
    params: &'a LevelParams,
    scan: Judged<'a>,
    /// Rows of `points` that are building or ground.
    cells: PlanRows,
    /// Whether each cell holds building.
    building: Vec<bool>,
    /// Edge of a cell, metres.
    edge: f64,
}

impl LevelParams {
    /// The same, but without effect.
    pub fn none() -> Self {
        Self { share: 1.0, flush: 1.0, ..Self::default() }
    }

    /// Whether some buildings may be level by them.
    pub(super) fn search(&self) -> bool {
        self.share < 1.0 || self.flush < 1.0
    }

    pub(super) fn validate(&self) -> Result<()> {
        let shares = [
            ("classes.level.share", self.share),
            ("classes.level.flush", self.flush),
            ("classes.level.ground", self.ground),
        ];
        for (name, share) in shares {
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
        if !(0.0..=STEEP).contains(&self.slope) {
            return Err(Error::parameter("classes.level.slope", self.slope, "a slope, 0 to 1"));
        }
        match self.cell > 0.0 && self.cell.is_finite() {
            true => Ok(()),
            false => Err(Error::parameter("classes.level.cell", self.cell, "metres, above 0")),
        }
    }

    /// The building points that are level with the ground around them. O(n).
    pub(super) fn rows(&self, scan: &Judged<'_>, monitor: &Monitor) -> Result<LevelRows> {
        let code = |row: u32| scan.codes[scan.point(row)];
        let all = 0..scan.points.len() as u32;
        let used: Vec<u32> = all.filter(|&row| matches!(code(row), BUILDING | GROUND)).collect();
        let edge = cell_edge(self.cell, SPACINGS, scan.density);
        let cells = PlanRows::new(scan.points, used, edge, monitor)?;
        let mut scene = Scene { params: self, scan: *scan, cells, building: Vec::new(), edge };
        scene.building = (0..scene.cells.len()).map(|cell| scene.buildings(cell).next().is_some()).collect();
        scene.found(monitor)
    }
}

impl Scene<'_> {
    /// Whether the cells are larger than the least edge, as in thin clouds.
    fn wide(&self) -> bool {
        self.edge > self.params.cell
    }

    /// The rows of a cell.
    fn rows(&self, cell: usize) -> impl Iterator<Item = u32> {
        self.cells.of(cell).iter().copied()
    }

    /// The rows of a cell that are building.
    fn buildings(&self, cell: usize) -> impl Iterator<Item = u32> {
        self.rows(cell).filter(|&row| self.scan.codes[self.scan.point(row)] == BUILDING)
    }

    /// The rows of a cell that are ground.
    fn grounds(&self, cell: usize) -> impl Iterator<Item = u32> {
        self.rows(cell).filter(|&row| self.scan.codes[self.scan.point(row)] == GROUND)
    }

    /// Some of these points.
    fn sample(&self, rows: impl Iterator<Item = u32>, lowest: f32) -> Vec<[f32; 3]> {
        let places = rows.map(|row| self.scan.points.positions.xyz(row as usize));
        let all: Vec<[f32; 3]> = places.filter(|[_, _, z]| *z >= lowest).collect();
        let stride = all.len().div_ceil(SAMPLES).max(1);
        all.into_iter().step_by(stride).collect()
    }

    /// The shortest step from these building points to the ground of a cell, if it is not longer than the edge of a cell.
    fn shortest(&self, top: &[[f32; 3]], cell: usize) -> Option<Step> {
        Step::shortest(top, &self.sample(self.grounds(cell), f32::MIN)).filter(|step| step.distance <= self.edge)
    }

    /// Some building points near the top of a cell.
    fn top(&self, cell: usize) -> Vec<[f32; 3]> {
        self.sample(self.buildings(cell), self.highest(cell) - WALL)
    }

    /// Whether the ground of each cell belongs to a piece of [`LAND`] that can be walked over without a step. There must be cells.
    fn land(&self, monitor: &Monitor) -> Result<Vec<bool>> {
        let z = |row: u32| f64::from(self.scan.points.positions.z[row as usize]);
        let lowest: Vec<f64> =
            (0..self.cells.len()).map(|cell| self.grounds(cell).map(z).fold(f64::INFINITY, f64::min)).collect();
        let step = self.params.step.max(self.params.slope * self.edge);
        let mut pieces = UnionFind::new(lowest.len());
        let mut walk = Walk::<1>::new(self.cells.index.keys(), 0);
        for piece in watched(lowest.len(), monitor) {
            for cell in piece?.filter(|&cell| lowest[cell].is_finite()) {
                walk.around(cell, |near, _| {
                    if (lowest[cell] - lowest[near]).abs() <= step {
                        pieces.unite(cell as u32, near as u32);
                    }
                });
            }
        }
        let roots = pieces.roots(monitor)?;
        let mut cells = vec![0u32; lowest.len()];
        roots.iter().for_each(|&root| cells[root as usize] += 1);
        let area = |root: u32| f64::from(cells[root as usize]) * self.edge.powi(2);
        Ok(roots.into_iter().map(|root| area(root) >= LAND).collect())
    }

    /// The height of the highest building point of a cell.
    fn highest(&self, cell: usize) -> f32 {
        self.buildings(cell).map(|row| self.scan.points.positions.z[row as usize]).fold(f32::MIN, f32::max)
    }

    fn found(&self, monitor: &Monitor) -> Result<LevelRows> {
        let mut components = UnionFind::new(self.building.len());
        let pairs = self.pairs(&mut components, monitor)?;
        let enclosing = self.enclosing(&mut components, monitor)?;
        let doubted = self.doubted(&mut components);
        let mut found = LevelRows::default();
        for cell in (0..self.building.len()).filter(|&cell| self.building[cell]) {
            let root = components.root(cell as u32);
            let pairs = pairs[&root];
            let least = self.params.pairs.max(1);
            let doubted = doubted.contains(&root) && pairs.exceed(pairs.level, DOUBTED);
            let level = doubted || pairs.is_level(self.params);
            if pairs.drop as usize >= least && !level {
                let list = if enclosing.contains(&root) { &mut found.enclosing } else { &mut found.standing };
                list.extend(self.buildings(cell));
            }
            if (pairs.level as usize) < least || !level {
                continue;
            }
            let ground = pairs.exceed(pairs.level, self.params.ground);
            let z = |row: u32| self.scan.points.positions.z[row as usize];
            let lowest = self.buildings(cell).map(z).fold(f32::MAX, f32::min);
            for row in self.buildings(cell) {
                // Wires above a hilltop are part of its component.
                let low = f64::from(z(row) - lowest) <= self.params.drop;
                let list = match (low && ground, low && doubted) {
                    (true, _) => &mut found.ground,
                    (false, true) => &mut found.doubted,
                    (false, false) => &mut found.unknown,
                };
                list.push(row);
            }
        }
        Ok(found)
    }

    /// The roots of the components that are large and of low confidence.
    fn doubted(&self, components: &mut UnionFind) -> BTreeSet<u32> {
        let confidence = self.scan.confidence;
        if confidence.is_empty() {
            return BTreeSet::new();
        }
        // Cells, points, and the sum of their confidence.
        let mut sums = BTreeMap::<u32, [f64; 3]>::new();
        for cell in (0..self.building.len()).filter(|&cell| self.building[cell]) {
            let [cells, points, sum] = sums.entry(components.root(cell as u32)).or_default();
            *cells += 1.0;
            for row in self.buildings(cell) {
                *points += 1.0;
                *sum += f64::from(confidence[self.scan.point(row)]);
            }
        }
        let area = self.edge.powi(2);
        let doubted = |[cells, points, sum]: [f64; 3]| cells * area >= PIECE && sum < SURE * points;
        sums.into_iter().filter(|&(_, sums)| doubted(sums)).map(|(root, _)| root).collect()
    }

    /// The roots of the components that enclose the scan.
    fn enclosing(&self, components: &mut UnionFind, monitor: &Monitor) -> Result<BTreeSet<u32>> {
        let all = Extent::of(self.cells.index.keys());
        let mut extents = BTreeMap::<u32, Extent>::new();
        for (cell, &key) in self.cells.index.keys().iter().enumerate().filter(|(cell, _)| self.building[*cell]) {
            extents.entry(components.root(cell as u32)).or_insert(Extent::of(&[key])).include(key);
        }
        if !extents.values().any(|extent| extent.spans(&all)) {
            return Ok(BTreeSet::new());
        }
        let outline = outline(self.scan.points, self.edge, monitor)?;
        let mut covered = BTreeMap::<u32, usize>::new();
        for key in &outline {
            if let Some(cell) = self.cells.index.find(*key).filter(|&cell| self.building[cell]) {
                *covered.entry(components.root(cell as u32)).or_default() += 1;
            }
        }
        let most = ENCLOSING * outline.len() as f64;
        Ok(covered.into_iter().filter(|(_, cells)| *cells as f64 > most).map(|(root, _)| root).collect())
    }

    /// Joins the building cells to components, and counts the pairs of each, by its root.
    fn pairs(&self, components: &mut UnionFind, monitor: &Monitor) -> Result<BTreeMap<u32, Pairs>> {
        let mut own = vec![Pairs::default(); self.building.len()];
        if self.building.contains(&true) {
            let land = self.land(monitor)?;
            let highest: Vec<f32> = (0..self.building.len()).map(|cell| self.highest(cell)).collect();
            // In thin clouds the highest points of neighbours differ more on any roof.
            let joined = self.params.step.max(if self.wide() { ROOF } else { STEEP } * self.edge);
            let mut walk = Walk::<1>::new(self.cells.index.keys(), 0);
            for piece in watched(self.building.len(), monitor) {
                for cell in piece?.filter(|&cell| self.building[cell]) {
                    let top = self.top(cell);
                    walk.around(cell, |near, _| {
                        if self.building[near] {
                            let fall = f64::from(highest[cell] - highest[near]);
                            if fall.abs() <= joined {
                                components.unite(cell as u32, near as u32);
                            }
                        } else if let Some(step) = self.shortest(&top, near) {
                            own[cell].count(self.params, step, land[near]);
                        }
                    });
                    if let Some(step) = self.shortest(&top, cell) {
                        own[cell].count(self.params, step, land[cell]);
                    }
                }
            }
        }
        let mut sums = BTreeMap::<u32, Pairs>::new();
        for (cell, own) in own.iter().enumerate().filter(|(cell, _)| self.building[*cell]) {
            let sum = sums.entry(components.root(cell as u32)).or_default();
            *sum = sum.plus(*own);
        }
        Ok(sums)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    struct Named {
        points: Points,
        codes: Vec<u8>,
    }

    impl Named {
        fn new(rows: &[[f64; 3]], codes: Vec<u8>) -> Self {
            Self { points: Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0), codes }
        }

        fn buildings(&self) -> usize {
            self.codes.iter().filter(|&&code| code == BUILDING).count()
        }

        /// What these parameters find with so many points per square metre.
        fn found_by(&self, params: &LevelParams, density: f64) -> LevelRows {
            self.doubted_by(params, density, &[])
        }

        fn doubted_by(&self, params: &LevelParams, density: f64, confidence: &[f32]) -> LevelRows {
            let scan = Judged { points: &self.points, codes: &self.codes, confidence, density };
            params.rows(&scan, &Monitor::default()).unwrap()
        }
    }

    /// Ground in the squares of 60 x 40 m, with something else in the place of some of them: height and code.
    fn scene(ground: impl Fn(f64, f64) -> f64, other: impl Fn(f64, f64) -> Option<f64>) -> Named {
        let places = (0..9600).map(|i| (f64::from(i % 120) / 2.0 + 0.2, f64::from(i / 120) / 2.0 + 0.2));
        let point = |(x, y)| match other(x, y) {
            Some(z) => ([x, y, z], BUILDING),
            None => ([x, y, ground(x, y)], GROUND),
        };
        let (rows, codes): (Vec<[f64; 3]>, Vec<u8>) = places.map(point).unzip();
        Named::new(&rows, codes)
    }

    /// Numbers of points that become ground and that become unclassified.
    fn found(scene: &Named) -> [usize; 2] {
        let rows = scene.found_by(&LevelParams::default(), 4.0);
        [rows.ground.len(), rows.unknown.len()]
    }

    #[test]
    fn houses_stand_and_hilltops_and_decks_do_not() {
        let inside = |v: f64, [low, high]: [f64; 2]| v > low && v < high;
        let house = |x: f64, y: f64| (inside(x, [20.0, 30.0]) && inside(y, [10.0, 20.0])).then_some(5.0);
        assert_eq!(found(&scene(|_, _| 0.0, house)), [0, 0]);
        // Built into a slope: level with it on the upper side.
        assert_eq!(found(&scene(|x, _| if x > 30.0 { 5.0 } else { 0.0 }, house)), [0, 0]);
        // The flat top of a hill.
        let hill = |x: f64, y: f64| (8.0 - 0.4 * (x - 30.0).hypot(y - 20.0)).clamp(0.0, 5.0);
        let hilltop = scene(hill, |x, y| (hill(x, y) > 4.5).then_some(hill(x, y)));
        assert_eq!(found(&hilltop), [hilltop.buildings(), 0]);
        // A wire above it, which was taken for a part of the building: the cells that it crosses, 6 m of one row, stand out.
        let wire = |y: f64| (y * 10.0).round() as i64 % 100 == 2;
        let high = |x: f64, y: f64| if inside(x, [27.0, 33.0]) && wire(y) { 15.0 } else { hill(x, y) };
        let crossed = scene(hill, |x, y| (hill(x, y) > 4.5).then_some(high(x, y)));
        assert_eq!(found(&crossed), [crossed.buildings() - 24, 0]);
        // A bridge over a narrow cutting: 6 m long, 16 m wide.
        let cutting = |x: f64| if inside(x, [27.0, 33.0]) { -6.0 } else { 0.0 };
        let bridge =
            scene(|x, _| cutting(x), |x, y| (inside(x, [27.0, 33.0]) && inside(y, [12.0, 28.0])).then_some(0.1));
        assert_eq!(found(&bridge), [0, bridge.buildings()]);
        // The brinks of a cutting, and a bridge over it that joins them.
        let brink = |x: f64, y: f64| {
            let open = inside(x, [27.0, 33.0]) && !inside(y, [18.0, 22.0]);
            (inside(x, [26.0, 34.0]) && !open).then_some(0.0)
        };
        let brinks = scene(|x, _| cutting(x), brink);
        assert_eq!(found(&brinks), [0, brinks.buildings()]);
        let by_share = LevelParams { flush: 1.0, ..LevelParams::default() };
        let rows = brinks.found_by(&by_share, 4.0);
        assert_eq!([rows.ground.len(), rows.unknown.len()], [0, 0]);
        // A flat roof of which a part was named ground.
        let hall = |x: f64, y: f64| inside(x, [10.0, 50.0]) && inside(y, [5.0, 35.0]);
        let part = |x: f64, y: f64| inside(x, [14.0, 40.0]) && inside(y, [9.0, 31.0]) && !inside(x, [24.0, 30.0]);
        let roof = scene(|x, y| if hall(x, y) { 6.0 } else { 0.0 }, |x, y| (hall(x, y) && !part(x, y)).then_some(6.0));
        assert_eq!(found(&roof), [0, 0]);
        // Roofs around a courtyard that the scan ends with, or the rim of a pit; and roofs at two of the four sides.
        let roofs = |yard: [[f64; 2]; 2]| {
            let inside = move |x: f64, y: f64| inside(x, yard[0]) && inside(y, yard[1]);
            scene(|_, _| -8.0, move |x, y| (!inside(x, y)).then_some(0.0))
        };
        let of_kinds = |scene: &Named| {
            let rows = scene.found_by(&LevelParams::default(), 4.0);
            [rows.enclosing.len(), rows.standing.len()]
        };
        let closed = roofs([[12.0, 48.0], [10.0, 30.0]]);
        assert_eq!(of_kinds(&closed), [closed.buildings(), 0]);
        let corner = roofs([[12.0, 61.0], [-1.0, 30.0]]);
        assert_eq!(of_kinds(&corner), [0, corner.buildings()]);
        // With every pair level it takes more than a share of 1.
        let none = bridge.found_by(&LevelParams::none(), 4.0);
        assert!(none.ground.is_empty() && none.unknown.is_empty());
    }

    #[test]
    fn ground_beside_a_house_on_a_slope_that_was_named_building_is_ground_and_the_house_stays() {
        let slope = |x: f64| 0.4 * x;
        let part = |x: f64, y: f64, [left, right]: [f64; 2]| x > left && x < right && y > 15.0 && y < 25.0;
        let house = |x: f64, y: f64| part(x, y, [25.0, 35.0]).then_some(17.0);
        let patch = |x: f64, y: f64| ((x * 0.7).sin() * (y * 0.9).sin() > -0.2).then_some(slope(x));
        let hill = scene(|x, _| slope(x), |x, y| house(x, y).or_else(|| patch(x, y)));
        let of_house = scene(|x, _| slope(x), house);
        let [ground, unknown] = found(&hill);
        let patches = hill.buildings() - of_house.buildings();
        assert!(
            unknown == 0 && patches > 3000 && ground <= patches && ground * 10 > patches * 9,
            "{ground} of {patches}"
        );
    }

    #[test]
    fn a_terrace_that_the_stages_are_not_sure_of_is_ground_and_a_canopy_is_none() {
        // Terraces, 10 m wide, of which each is 3 m higher; 8 x 12 m of one, or a canopy above it, were named building.
        let terrace = |x: f64| 3.0 * (x / 10.0).floor();
        let within = |x: f64, y: f64, left: f64| x > left && x < left + 8.0 && y > 14.0 && y < 26.0;
        let patch = |left: f64, raised: f64| {
            scene(|x, _| terrace(x), move |x, y| within(x, y, left).then_some(terrace(x) + raised))
        };
        let doubted = |scene: &Named, confidence: f32| {
            let confidence = vec![confidence; scene.codes.len()];
            let rows = scene.doubted_by(&LevelParams::default(), 4.0, &confidence).doubted;
            rows.len() as f64 / scene.buildings() as f64
        };
        // At the lower brink: the ground below drops along one of the long sides.
        let brink = patch(30.0, 0.0);
        assert_eq!([0.5, 0.79, 0.81, 1.0].map(|confidence| doubted(&brink, confidence)), [1.0, 1.0, 0.0, 0.0]);
        // A canopy drops on all sides.
        assert_eq!(doubted(&patch(31.0, 4.0), 0.5), 0.0);
    }

    /// A row of the ground, 0.35 points a square metre, and on it an embankment, 6 m high and 10 m wide at the top, or a house
    /// of that width; only the top is named building.
    fn thin(foot: f64) -> Named {
        // A low-discrepancy sequence: Roberts 2018, with the plastic number.
        let place =
            |i: u32| [100.0 * (f64::from(i) * 0.754_877_666).fract(), 60.0 * (f64::from(i) * 0.569_840_291).fract()];
        let height = |y: f64| (6.0 - ((y - 30.0).abs() - 5.0) * 6.0 / foot).clamp(0.0, 6.0);
        let rows: Vec<[f64; 3]> = (0..2100).map(place).map(|[x, y]| [x, y, height(y)]).collect();
        let codes = rows.iter().map(|&[_, _, z]| if z >= 6.0 { BUILDING } else { GROUND }).collect();
        Named::new(&rows, codes)
    }

    #[test]
    fn the_top_of_an_embankment_in_a_thin_cloud_is_ground_and_a_long_house_is_none() {
        let found = |foot: f64| {
            let scene = thin(foot);
            let rows = scene.found_by(&LevelParams::default(), 0.35);
            (rows.ground.len(), rows.unknown.len(), scene.buildings())
        };
        // Slopes of 1 : 1.5.
        let (ground, unknown, named) = found(9.0);
        assert_eq!((ground, unknown), (named, 0));
        // Walls.
        let (ground, unknown, named) = found(0.01);
        assert!(ground + unknown == 0 && named > 100, "{ground} {unknown} of {named}");
    }

    #[test]
    fn clouds_without_buildings_or_ground_have_none() {
        assert_eq!(found(&scene(|_, _| 0.0, |_, _| None)), [0, 0]);
        assert_eq!(found(&scene(|_, _| 0.0, |_, _| Some(1.0))), [0, 0]);
        assert_eq!(found(&Named { points: Points::default(), codes: Vec::new() }), [0, 0]);
        assert!(LevelParams { share: 1.5, ..LevelParams::default() }.validate().is_err());
        assert!(LevelParams { step: 2.0, ..LevelParams::default() }.validate().is_err());
        assert!(LevelParams { slope: 1.1, ..LevelParams::default() }.validate().is_err());
    }
}
