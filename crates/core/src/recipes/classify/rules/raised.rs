//! Ground that is none, as it stands on other ground. The deck of a bridge over land is level with the ground at both ends,
//! with a steep drop on both sides: the ground filter keeps what is level with the land around. An island is higher than
//! all ground around it, such as a roof wider than the filter's window.

use super::plan::{AXES, PlanRows, SPACINGS, block, cell_edge, each_cell, groups, length, quantile};
use super::{DeckParams, GROUND};
use crate::cloud::Points;
use crate::error::Result;
use crate::graph::{Components, UnionFind};
use crate::parallel::{Looks, Monitor, map_watched};
use crate::voxels::cells::index::CellIndex;

/// Greatest distance between the two drops, metres: decks of ground may be those of a motorway.
const WIDTH: f64 = 40.0;
/// Least slope of a drop: 56 degrees, which no embankment of earth has.
const SLOPE: f64 = 1.5;
/// The height of a cell: this share of its points is lower.
const LOW: f64 = 0.25;
/// Cells without ground that are passed on the way.
const GAP: i32 = 2;
/// Least area of a deck, square metres.
const AREA: f64 = 15.0;
/// The ends of a deck: this share of its length.
const END: f64 = 0.25;
/// At most this share of a deck's cells may be level with other ground between the ends.
const BETWEEN: f64 = 0.05;

/// Ground at least this much higher than all ground around it is an island, metres.
const RISE: f64 = 2.5;
/// Neighbouring cells are joined by land up to this slope, or up to a step of so many metres.
const CLIMB: f64 = 1.0;
const THRESHOLD: f64 = 0.5;
/// Area of an island, square metres: no car, and no mountain.
const ISLAND: std::ops::RangeInclusive<f64> = 10.0..=20_000.0;
/// At least this share of an island's border drops to lower ground, in so many of eight directions: land at the edge of a scan
/// drops in fewer.
const SHORE: f64 = 0.95;
const SIDES: u32 = 7;
/// At least this share of the drops leads away from its middle: those of the land around a pit lead inwards.
const OUTWARD: f64 = 0.5;

/// Points with classes.
pub(super) struct Land<'a> {
    pub(super) points: &'a Points,
    /// One a point of the cloud.
    pub(super) codes: &'a [u8],
    /// The code of points that other rules took for parts of decks.
    pub(super) free: u8,
    /// Points per square metre.
    pub(super) density: f64,
}

/// The rows of ground points that are decks of bridges or islands, by cell. O(n log n).
pub(super) fn raised(params: &DeckParams, land: &Land<'_>, monitor: &Monitor) -> Result<Vec<u32>> {
    let Land { points, codes, free, density } = *land;
    let code = |row: u32| codes[points.frame.index[row as usize] as usize];
    let used: Vec<u32> = (0..points.len() as u32).filter(|&row| code(row) == GROUND || code(row) == free).collect();
    let edge = cell_edge(params.cell, SPACINGS, density);
    let cells = PlanRows::new(points, used, edge, monitor)?;
    let rows = |cell: usize| cells.of(cell).iter().copied();
    let z = |row: u32| f64::from(points.positions.z[row as usize]);
    let ground = |cell: usize| rows(cell).filter(|&row| code(row) == GROUND);
    let surface = |cell: usize| Surface {
        highest: ground(cell).map(z).fold(f64::MIN, f64::max) as f32,
        height: low(rows(cell).map(z).collect()),
        ground: low(ground(cell).map(z).collect()),
    };
    let surfaces = map_watched(cells.len(), monitor, surface)?;
    let scene = Scene { params, index: &cells.index, surfaces, edge };
    // Below a rim lies the ground under it.
    let lowest = |cell: usize| f64::from(scene.surfaces[cell].highest) - params.drop / 2.0;
    let mut raised = scene.decks(monitor)?;
    raised.extend(scene.islands(monitor)?);
    raised.sort_unstable();
    raised.dedup();
    Ok(raised.into_iter().flat_map(|cell| ground(cell).filter(move |&row| z(row) >= lowest(cell))).collect())
}

/// Heights of a cell, metres.
#[derive(Clone, Copy, Debug, Default)]
struct Surface {
    /// Its highest ground point.
    highest: f32,
    /// [`LOW`] of its points are lower: a railing is higher.
    height: f32,
    /// The same of its ground points.
    ground: f32,
}

/// The height below which [`LOW`] of the heights are; lowest without any.
fn low(mut heights: Vec<f64>) -> f32 {
    if heights.is_empty() { f32::MIN } else { quantile(&mut heights, LOW) as f32 }
}

/// The cells of a cloud.
struct Scene<'a> {
    params: &'a DeckParams,
    index: &'a CellIndex<[i32; 2]>,
    surfaces: Vec<Surface>,
    /// Edge of a cell, metres.
    edge: f64,
}

/// A step from one cell to the next with ground.
struct Step {
    cell: usize,
    /// Metres in plan.
    run: f64,
    /// Metres downwards.
    fall: f64,
}

/// The border of a piece of land.
#[derive(Clone, Copy, Default)]
struct Border {
    cells: u32,
    /// Sums of the cells' keys.
    sums: [i64; 2],
    /// Steps to other pieces.
    steps: u32,
    /// Those that drop to lower ground.
    drops: u32,
    /// Of these, those that lead away from the middle of the piece.
    outward: u32,
    /// A bit for each of eight directions in which it drops.
    sides: u8,
}

impl Border {
    fn add(&mut self, [x, y]: [i32; 2]) {
        self.cells += 1;
        self.sums = [self.sums[0] + i64::from(x), self.sums[1] + i64::from(y)];
    }

    /// Counts a step down by `fall` from the cell `from` in one of eight directions.
    fn step(&mut self, fall: f64, from: [i32; 2], side: usize) {
        self.steps += 1;
        if fall >= RISE {
            let [x, y] = if side < AXES.len() { AXES[side] } else { AXES[side - AXES.len()].map(|step| -step) };
            let away = |axis: usize| f64::from(from[axis]) - self.sums[axis] as f64 / f64::from(self.cells);
            self.drops += 1;
            self.outward += u32::from(f64::from(x) * away(0) + f64::from(y) * away(1) > 0.0);
            self.sides |= 1 << side;
        }
    }

    fn is_island(&self, edge: f64) -> bool {
        ISLAND.contains(&(f64::from(self.cells) * edge.powi(2)))
            && f64::from(self.drops) >= SHORE * f64::from(self.steps)
            && f64::from(self.outward) >= OUTWARD * f64::from(self.drops)
            && self.sides.count_ones() >= SIDES
    }
}

impl Scene<'_> {
    /// The cells of all islands.
    fn islands(&self, monitor: &Monitor) -> Result<Vec<usize>> {
        let all = 0..self.surfaces.len();
        let mut pieces = UnionFind::new(all.len());
        let mut looks = Looks::at(monitor);
        for cell in all.clone() {
            looks.step()?;
            for step in AXES.iter().filter_map(|&direction| self.step(cell, direction)) {
                if step.fall.abs() <= THRESHOLD.max(CLIMB * step.run) {
                    pieces.unite(cell as u32, step.cell as u32);
                }
            }
        }
        let Components { of: piece, count } = Components::numbered(all.len(), |cell| pieces.root(cell), monitor)?;
        let mut borders = vec![Border::default(); count];
        let keys = self.index.keys();
        all.clone().for_each(|cell| borders[piece[cell] as usize].add(keys[cell]));
        for cell in all.clone() {
            looks.step()?;
            for (axis, &direction) in AXES.iter().enumerate() {
                if let Some(step) = self.step(cell, direction).filter(|step| piece[step.cell] != piece[cell]) {
                    borders[piece[cell] as usize].step(step.fall, keys[cell], axis);
                    borders[piece[step.cell] as usize].step(-step.fall, keys[step.cell], axis + AXES.len());
                }
            }
        }
        Ok(all.filter(|&cell| borders[piece[cell] as usize].is_island(self.edge)).collect())
    }

    /// The cells of all decks.
    fn decks(&self, monitor: &Monitor) -> Result<Vec<usize>> {
        let axes = self.strips(monitor)?;
        let level = |a: usize, b: usize| self.is_level(self.height(a) - self.height(b), self.edge);
        let near =
            |cell: usize| self.around(cell).filter(|&near| axes[near].is_some()).filter(move |&near| level(cell, near));
        let cells = (0..axes.len()).filter(|&cell| axes[cell].is_some()).collect();
        let is_deck = |strip: &Vec<usize>| strip.len() as f64 * self.edge.powi(2) >= AREA && self.is_deck(strip, &axes);
        Ok(groups(cells, near, monitor)?.into_iter().filter(is_deck).flatten().collect())
    }

    /// For each cell between two drops the axis across, a place in [`AXES`].
    fn strips(&self, monitor: &Monitor) -> Result<Vec<Option<u8>>> {
        let of_brink = |cell: usize| {
            let across = |axis: u8| Some((axis, self.strip(cell, AXES[usize::from(axis)])?));
            (0..AXES.len() as u8).filter_map(across).collect()
        };
        let mut axes = vec![None; self.surfaces.len()];
        for (axis, strip) in each_cell(self.surfaces.len(), monitor, of_brink)? {
            for cell in strip {
                axes[cell] = axes[cell].or(Some(axis));
            }
        }
        let strips = (0..axes.len()).filter(|&cell| axes[cell].is_some());
        let mut beside: Vec<usize> =
            strips.flat_map(|cell| self.around(cell)).filter(|&near| axes[near].is_none()).collect();
        beside.sort_unstable();
        beside.dedup();
        let inside: Vec<(usize, u8)> =
            beside.into_iter().filter_map(|cell| Some((cell, self.inside(cell, &axes)?))).collect();
        inside.into_iter().for_each(|(cell, axis)| axes[cell] = Some(axis));
        Ok(axes)
    }

    /// The axis across of the strips on two opposite sides of a cell and level with it: a line of cells across a deck, one of
    /// which holds no points, is of no strip.
    fn inside(&self, cell: usize, axes: &[Option<u8>]) -> Option<u8> {
        let [at_x, at_y] = self.index.keys()[cell];
        let axis = |[x, y]: [i32; 2]| {
            let near = self.index.find([at_x.saturating_add(x), at_y.saturating_add(y)])?;
            axes[near].filter(|_| self.is_level(self.height(cell) - self.height(near), self.edge))
        };
        AXES.into_iter().find_map(|[x, y]| axis([x, y]).and(axis([-x, -y])))
    }

    /// The cells from one that drops in a direction to one that drops in the opposite direction.
    fn strip(&self, brink: usize, [x, y]: [i32; 2]) -> Option<Vec<usize>> {
        self.step(brink, [x, y]).filter(|step| self.is_drop(step))?;
        let mut cells = vec![brink];
        let mut width = 0.0;
        loop {
            let step = self.step(*cells.last()?, [-x, -y])?;
            if self.is_drop(&step) {
                return Some(cells);
            }
            width += step.run;
            if width > WIDTH || !self.is_level(step.fall, step.run) {
                return None;
            }
            cells.push(step.cell);
        }
    }

    /// The step to the next cell with ground in a direction, which may be some cells away.
    fn step(&self, cell: usize, [x, y]: [i32; 2]) -> Option<Step> {
        let [at_x, at_y] = self.index.keys()[cell];
        let find = |steps: i32| {
            let near = self.index.find([at_x.saturating_add(steps * x), at_y.saturating_add(steps * y)])?;
            let run = f64::from(steps) * self.edge * length([x, y]);
            Some(Step { cell: near, run, fall: self.height(cell) - self.height(near) })
        };
        (1..=GAP + 1).find_map(find)
    }

    fn height(&self, cell: usize) -> f64 {
        f64::from(self.surfaces[cell].height)
    }

    fn is_drop(&self, step: &Step) -> bool {
        step.fall >= self.params.drop && step.fall >= SLOPE * step.run
    }

    fn is_level(&self, fall: f64, run: f64) -> bool {
        fall.abs() <= self.params.step * run.max(1.0)
    }

    /// Whether a strip meets other ground without a step at both ends, but hardly between them.
    fn is_deck(&self, strip: &[usize], axes: &[Option<u8>]) -> bool {
        let across = Self::across(strip, axes);
        let along = |cell: usize| {
            let [x, y] = self.index.keys()[cell].map(i64::from);
            y * i64::from(across[0]) - x * i64::from(across[1])
        };
        let from = strip.iter().map(|&cell| along(cell)).min().unwrap_or(0);
        let to = strip.iter().map(|&cell| along(cell)).max().unwrap_or(0);
        let mut ends: Vec<usize> = strip.iter().flat_map(|&cell| self.meets(cell, axes)).collect();
        ends.sort_unstable();
        ends.dedup();
        let mut contacts = [0; 3];
        for cell in ends {
            let place = (along(cell) - from) as f64 / (to - from).max(1) as f64;
            contacts[usize::from(place >= END) + usize::from(place > 1.0 - END)] += 1;
        }
        let [first, between, last] = contacts;
        first > 0 && last > 0 && f64::from(between) <= BETWEEN * strip.len() as f64
    }

    /// The most frequent axis across.
    fn across(strip: &[usize], axes: &[Option<u8>]) -> [i32; 2] {
        let mut counts = [0; AXES.len()];
        strip.iter().filter_map(|&cell| axes[cell]).for_each(|axis| counts[usize::from(axis)] += 1);
        let most = (1..AXES.len()).fold(0, |most, axis| if counts[axis] > counts[most] { axis } else { most });
        AXES[most]
    }

    /// Cells with ground beside a cell and level with it that are of no strip.
    fn meets(&self, cell: usize, axes: &[Option<u8>]) -> impl Iterator<Item = usize> {
        let above = move |near: usize| self.height(cell) - f64::from(self.surfaces[near].ground);
        self.around(cell).filter(move |&near| axes[near].is_none() && self.is_level(above(near), self.edge))
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

    /// A scan of ground.
    struct Scan {
        rows: Vec<[f64; 3]>,
        codes: Vec<u8>,
    }

    /// 120 x 120 m at 4 points a square metre with a cutting along y, 6 m deep and 40 m wide, whose sides have this slope.
    /// Where `deck` gives a height, this is the ground.
    fn cutting(slope: f64, deck: impl Fn(f64, f64) -> Option<f64>) -> Scan {
        let places = (0..57_600).map(|i| [f64::from(i % 240) / 2.0 + 0.2, f64::from(i / 240) / 2.0 + 0.2]);
        let ground = |x: f64| (slope * ((x - 60.0).abs() - 20.0)).clamp(-6.0, 0.0);
        let height = |[x, y]: [f64; 2]| deck(x, y).filter(|_| (x - 60.0).abs() < 20.0).unwrap_or(ground(x));
        let rows: Vec<[f64; 3]> = places.map(|[x, y]| [x, y, height([x, y])]).collect();
        Scan { codes: vec![GROUND; rows.len()], rows }
    }

    /// Square metres of decks, which are at a height of 0.
    fn found(scan: &Scan) -> f64 {
        let points = Points::from_cloud(&Cloud::from_rows(&scan.rows).unwrap(), 1.0);
        let land = Land { points: &points, codes: &scan.codes, free: 1, density: 4.0 };
        let rows = raised(&DeckParams::default(), &land, &Monitor::default()).unwrap();
        assert!(rows.iter().all(|&row| scan.rows[points.frame.index[row as usize] as usize][2] > -0.8));
        rows.len() as f64 / 4.0
    }

    /// A deck of a width along x, askew by `turn`.
    fn deck(width: f64, turn: f64) -> impl Fn(f64, f64) -> Option<f64> {
        move |x, y| ((y - 60.0) - turn * (x - 60.0)).abs().lt(&(width / 2.0)).then_some(0.0)
    }

    #[test]
    fn a_bridge_over_a_cutting_is_found() {
        for (width, turn) in [(4.0, 0.0), (8.0, 0.3), (12.0, 0.0), (28.0, 0.2)] {
            let area = found(&cutting(0.67, deck(width, turn)));
            assert!((0.6..1.0).contains(&(area / (40.0 * width))), "{width} {turn}: {area}");
        }
    }

    #[test]
    fn lines_without_points_on_a_deck_do_not_hide_it() {
        let full = cutting(0.67, deck(8.0, 0.0));
        let hole = |&[x, y, _]: &[f64; 3]| (y - 60.0).abs() < 1.6 && ((x - 50.5).abs() < 0.6 || (x - 60.5).abs() < 0.6);
        let rows: Vec<[f64; 3]> = full.rows.into_iter().filter(|row| !hole(row)).collect();
        let area = found(&Scan { codes: vec![GROUND; rows.len()], rows });
        assert!((220.0..320.0).contains(&area), "{area}");
    }

    #[test]
    fn a_deck_whose_middle_is_unclassified_is_found_with_the_rest() {
        let mut scan = cutting(0.67, deck(8.0, 0.0));
        let middle = |&[x, y, _]: &[f64; 3]| (x - 60.0).abs() < 5.0 && (y - 60.0).abs() < 4.0;
        scan.codes = scan.rows.iter().map(|row| if middle(row) { 1 } else { GROUND }).collect();
        let area = found(&scan);
        assert!((150.0..250.0).contains(&area), "{area}");
    }

    #[test]
    fn embankments_terraces_and_piers_are_no_decks() {
        // A dam with sides of 45 degrees across the cutting.
        let dam = |_: f64, y: f64| Some((7.0 - (y - 60.0).abs()).clamp(-6.0, 0.0));
        assert_eq!(found(&cutting(0.67, dam)), 0.0);
        assert_eq!(found(&cutting(0.67, |_, _| None)), 0.0);
        // Walls instead of slopes, at the whole cutting: a terrace on each side, up to the edges of the scan.
        assert_eq!(found(&cutting(50.0, |_, _| None)), 0.0);
        let pier = |x: f64, y: f64| (x < 65.0 && (y - 60.0).abs() < 4.0).then_some(0.0);
        assert_eq!(found(&cutting(0.67, pier)), 0.0);
        assert_eq!(found(&Scan { rows: Vec::new(), codes: Vec::new() }), 0.0);
    }

    #[test]
    fn a_roof_that_is_level_with_the_land_around_is_an_island_and_one_with_a_ramp_is_none() {
        let roof = |x: f64, y: f64| ((x - 60.0).abs() < 10.0 && (y - 60.0).abs() < 8.0).then_some(0.0);
        let area = found(&cutting(0.67, roof));
        assert!((300.0..=320.0).contains(&area), "{area}");
        let ramp = |x: f64, y: f64| {
            roof(x, y).or(((x - 60.0).abs() < 2.0 && y > 60.0).then(|| (0.5 * (68.0 - y)).clamp(-6.0, 0.0)))
        };
        assert_eq!(found(&cutting(0.67, ramp)), 0.0);
        // Cut off by the edge of the scan.
        let half = |x: f64, y: f64| ((x - 60.0).abs() < 10.0 && y < 16.0).then_some(0.0);
        assert!(found(&cutting(0.67, half)) > 300.0);
    }

    #[test]
    fn the_land_around_a_pit_is_no_island() {
        // 64 x 64 m at 4 points a square metre.
        let inside = |x: f64, y: f64| (x - 32.0).abs() < 20.0 && (y - 32.0).abs() < 20.0;
        let found = |height: &dyn Fn(f64, f64) -> f64| {
            let place = |i: u32| [f64::from(i % 128) / 2.0 + 0.2, f64::from(i / 128) / 2.0 + 0.2];
            let rows: Vec<[f64; 3]> = (0..16_384).map(place).map(|[x, y]| [x, y, height(x, y)]).collect();
            let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
            let codes = vec![GROUND; rows.len()];
            let land = Land { points: &points, codes: &codes, free: 1, density: 4.0 };
            raised(&DeckParams::default(), &land, &Monitor::default()).unwrap().len()
        };
        assert_eq!(found(&|x, y| if inside(x, y) { -9.0 } else { 0.0 }), 0);
        assert!(found(&|x, y| if inside(x, y) { 9.0 } else { 0.0 }) > 6000);
    }
}
