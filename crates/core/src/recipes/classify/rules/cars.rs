//! Cars: groups of points that are like cars one by one, and have the size of cars and free ground around them.

use super::plan::{SPACINGS, block, cell_edge, plan_cell, quantile};
use super::{BUILDING, GROUND, LOW};
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::graph::UnionFind;
use crate::parallel::{Monitor, watched};
use crate::voxels::cells::Cells;
use crate::voxels::cells::index::{CellIndex, Walk};
use serde::{Deserialize, Serialize};

/// Directions within a quarter turn in which the smallest rectangle is looked for.
const DIRECTIONS: u32 = 36;
/// Share of the points beyond each side of the rectangle.
const BEYOND: f64 = 0.02;
/// Cells that are no cars are grouped again by points of this much more probability, until `HIGHEST`: 0.9,
/// with room for the rounding of sums.
const STEP: f64 = 0.2;
const HIGHEST: f64 = 0.91;
/// A group of at least this mean probability needs only this share of `fill`: cars that stand at an angle in a row.
const CERTAIN: f64 = 0.8;
const CERTAIN_FILL: f64 = 0.875;

/// Which groups of points are cars: one car, or several side by side. Only used by models that know cars.
///
/// The points that may be cars lie in cells in plan; cells that touch, 8 neighbours a cell, are a group if each holds a
/// point of at least `probability`. What is no car may still hold one, beside a hedge for instance: its cells are grouped
/// again by points of 0.2 more, and so on up to 0.9. Heights are above the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CarParams {
    /// Points of a group, at least. 0: no cars are looked for.
    pub points: usize,
    /// Least probability to be a car, 0..=1, of one point in each cell of a group, where groups are largest.
    pub probability: f64,
    /// Least mean of the probabilities of all its points, 0..=1.
    pub mean_probability: f64,
    /// Least edge of a cell, metres, above 0; clouds of less than 2.25 points per cell have cells of 1.5 point spacings.
    pub cell: f64,
    /// Least length of the smallest rectangle around the points, metres. Beside a wall or under a tree only a part of a
    /// car is seen.
    pub length: f64,
    /// Its least width, metres.
    pub width: f64,
    /// Least area of the cells of a group as a share of that rectangle, 0 or more: hedges around a corner have less.
    /// Seven eighths of it are enough if the mean of the probabilities is 0.8 or more.
    pub fill: f64,
    /// Least and largest area of the cells of a group, square metres.
    pub area: [f64; 2],
    /// Least and largest height of the top, the 95th percentile, metres.
    pub top: [f64; 2],
    /// Least median of the heights, metres: less is a flower bed or a kerb.
    pub middle: f64,
    /// Least 10th percentile of the heights, metres: pulses that hit bushes reach farther down.
    pub bottom: f64,
    /// Least share of the cells around a group that hold ground, 0..=1.
    pub ground_around: f64,
    /// Largest share of them that hold other things higher than `thing`, 0..=1: cars stand free, bushes beside others.
    pub things_around: f64,
    /// Least height of such a thing, metres.
    pub thing: f64,
}

impl Default for CarParams {
    fn default() -> Self {
        Self {
            points: 12,
            probability: 0.1,
            mean_probability: 0.4,
            cell: 0.5,
            length: 2.0,
            width: 1.0,
            fill: 0.85,
            area: [2.5, 200.0],
            top: [1.1, 2.9],
            middle: 0.7,
            bottom: 0.4,
            ground_around: 0.5,
            things_around: 0.5,
            thing: 0.3,
        }
    }
}

/// Points with their classes so far.
pub(super) struct Named<'a> {
    pub(super) points: &'a Points,
    /// Code of each point of the cloud.
    pub(super) codes: &'a [u8],
    /// Probability of each point of the cloud to be a car.
    pub(super) cars: &'a [f32],
    /// Height of each row above the ground, metres.
    pub(super) heights: &'a [f32],
    /// Points per square metre.
    pub(super) density: f64,
}

/// What lies in a cell of a group or beside one.
#[derive(Clone, Copy, Debug, Default)]
struct Holds {
    ground: bool,
    things: bool,
}

/// Points that may be cars by cells, of which each has one that is like a car, and what lies in and beside the cells.
struct Groups {
    /// The points, as rows.
    rows: Vec<u32>,
    /// Places in `rows` by cell.
    cells: Cells<[i32; 2]>,
    /// The highest probability of each cell.
    highest: Vec<f64>,
    /// Whether the points of each cell are cars.
    taken: Vec<bool>,
    /// These cells and those that touch them.
    around: CellIndex<[i32; 2]>,
    holds: Vec<Holds>,
    /// Edge of a cell, metres.
    edge: f64,
}

impl Named<'_> {
    fn at(&self, row: u32) -> usize {
        self.points.frame.index[row as usize] as usize
    }

    /// Probability of a row to be a car, 0 for what has no class of cars.
    fn car(&self, row: u32) -> f64 {
        let point = self.at(row);
        if (LOW..=BUILDING).contains(&self.codes[point]) { f64::from(self.cars[point]) } else { 0.0 }
    }

    /// Mean of the probabilities of rows to be a car.
    fn mean(&self, rows: &[u32]) -> f64 {
        rows.iter().map(|&row| self.car(row)).sum::<f64>() / rows.len() as f64
    }
}

impl CarParams {
    /// The same, but without effect.
    pub fn none() -> Self {
        Self { points: 0, ..Self::default() }
    }

    pub(super) fn validate(&self) -> Result<()> {
        let shares = [
            ("classes.cars.probability", self.probability),
            ("classes.cars.mean_probability", self.mean_probability),
            ("classes.cars.ground_around", self.ground_around),
            ("classes.cars.things_around", self.things_around),
        ];
        for (name, share) in shares {
            if !(0.0..=1.0).contains(&share) {
                return Err(Error::parameter(name, share, "0 to 1"));
            }
        }
        for (name, [low, high]) in [("classes.cars.area", self.area), ("classes.cars.top", self.top)] {
            if !(low >= 0.0 && high >= low && high.is_finite()) {
                return Err(Error::parameter(name, format!("[{low}, {high}]"), "two ascending numbers, 0 or more"));
            }
        }
        if !(self.fill >= 0.0 && self.fill.is_finite()) {
            return Err(Error::parameter("classes.cars.fill", self.fill, "0 or more"));
        }
        let lengths = [
            ("classes.cars.length", self.length),
            ("classes.cars.width", self.width),
            ("classes.cars.middle", self.middle),
            ("classes.cars.bottom", self.bottom),
            ("classes.cars.thing", self.thing),
        ];
        for (name, value) in lengths {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::parameter(name, value, "metres, 0 or more"));
            }
        }
        match self.cell > 0.0 && self.cell.is_finite() {
            true => Ok(()),
            false => Err(Error::parameter("classes.cars.cell", self.cell, "metres, above 0")),
        }
    }

    /// The rows of cars. O(n) for n points, and O(m log m) for the m in cells with a point that is like a car.
    pub(super) fn among(&self, named: &Named<'_>, monitor: &Monitor) -> Result<Vec<u32>> {
        let mut found = Vec::new();
        if self.points == 0 {
            return Ok(found);
        }
        let mut groups = self.groups(named, monitor)?;
        for least in self.levels() {
            for group in groups.of_at_least(least, monitor)? {
                monitor.check()?;
                let rows: Vec<u32> = group.iter().flat_map(|&cell| groups.of(cell)).collect();
                if self.are_free(&groups, &group)
                    && self.are_cars(named, &rows)
                    && self.are_full(named, &rows, groups.area(&group))
                {
                    group.iter().for_each(|&cell| groups.taken[cell as usize] = true);
                    found.extend(rows);
                }
            }
        }
        Ok(found)
    }

    /// The probabilities of which each cell of a group has one, ascending.
    fn levels(&self) -> impl Iterator<Item = f64> {
        let least = self.probability;
        (0..).map(move |step| least + STEP * f64::from(step)).take_while(move |&level| level <= HIGHEST.max(least))
    }

    /// The points in cells with a point that is like a car, and what these cells and those beside them hold.
    fn groups(&self, named: &Named<'_>, monitor: &Monitor) -> Result<Groups> {
        let edge = cell_edge(self.cell, SPACINGS, named.density);
        let all = named.points.len();
        let mut keys: Vec<[i32; 2]> = Vec::new();
        for piece in watched(all, monitor) {
            let like = |&row: &u32| named.car(row) > 0.0 && named.car(row) >= self.probability;
            keys.extend(piece?.map(|row| row as u32).filter(like).map(|row| plan_cell(named.points, row, edge)));
        }
        let sorted = |mut keys: Vec<[i32; 2]>| {
            keys.sort_unstable();
            keys.dedup();
            CellIndex::new(keys)
        };
        let own = sorted(keys);
        let around = sorted(own.keys().iter().flat_map(|&key| block(key, 1)).collect());
        let (mut rows, mut holds) = (Vec::new(), vec![Holds::default(); around.keys().len()]);
        for piece in watched(if holds.is_empty() { 0 } else { all }, monitor) {
            for row in piece?.map(|row| row as u32) {
                let key = plan_cell(named.points, row, edge);
                let Some(cell) = around.find(key) else { continue };
                holds[cell].ground |= named.codes[named.at(row)] == GROUND;
                holds[cell].things |= f64::from(named.heights[row as usize]) > self.thing;
                if named.car(row) > 0.0 && own.find(key).is_some() {
                    rows.push(row);
                }
            }
        }
        let cells = Cells::new(rows.len(), |i| plan_cell(named.points, rows[i], edge), monitor)?;
        let most = |cell| cells.of(cell).iter().map(|&place| named.car(rows[place as usize])).fold(0.0, f64::max);
        let highest = (0..cells.len()).map(most).collect();
        Ok(Groups { taken: vec![false; cells.len()], highest, around, holds, rows, cells, edge })
    }

    /// Whether a group of cells has the area of cars, ground around it, and few other things.
    fn are_free(&self, groups: &Groups, group: &[u32]) -> bool {
        let own: Vec<[i32; 2]> = group.iter().map(|&cell| groups.cells.keys[cell as usize]).collect();
        let mut beside: Vec<[i32; 2]> = own.iter().flat_map(|&key| block(key, 1)).collect();
        beside.sort_unstable();
        beside.dedup();
        beside.retain(|key| own.binary_search(key).is_err());
        let share = |is: fn(&Holds) -> bool| {
            let count =
                beside.iter().filter_map(|&key| groups.around.find(key)).filter(|&cell| is(&groups.holds[cell]));
            count.count() as f64 / beside.len().max(1) as f64
        };
        within(groups.area(group), self.area)
            && share(|cell| cell.ground) >= self.ground_around
            && share(|cell| cell.things) <= self.things_around
    }

    /// Whether points are enough, certain enough, and as high as cars.
    fn are_cars(&self, named: &Named<'_>, rows: &[u32]) -> bool {
        if rows.len() < self.points || named.mean(rows) < self.mean_probability {
            return false;
        }
        let mut heights: Vec<f64> = rows.iter().map(|&row| f64::from(named.heights[row as usize])).collect();
        within(quantile(&mut heights, 0.95), self.top)
            && quantile(&mut heights, 0.5) >= self.middle
            && quantile(&mut heights, 0.1) >= self.bottom
    }

    /// Whether points are as long and wide as cars, and their cells, of this area, fill the rectangle around them.
    fn are_full(&self, named: &Named<'_>, rows: &[u32], area: f64) -> bool {
        let plan = rows.iter().map(|&row| named.points.positions.xyz(row as usize));
        let [length, width] = smallest_rectangle(&plan.map(|[x, y, _]| [x, y].map(f64::from)).collect::<Vec<_>>());
        let fill = if named.mean(rows) >= CERTAIN { CERTAIN_FILL * self.fill } else { self.fill };
        length >= self.length && width >= self.width && area >= fill * length * width
    }
}

impl Groups {
    /// The rows of a cell.
    fn of(&self, cell: u32) -> impl Iterator<Item = u32> {
        self.cells.of(cell as usize).iter().map(|&place| self.rows[place as usize])
    }

    /// Square metres of the cells of a group.
    fn area(&self, group: &[u32]) -> f64 {
        group.len() as f64 * self.edge * self.edge
    }

    /// The groups of cells that are not taken and have a point of at least this probability; the cells of each ascend.
    fn of_at_least(&self, least: f64, monitor: &Monitor) -> Result<Vec<Vec<u32>>> {
        let open = |&cell: &u32| !self.taken[cell as usize] && self.highest[cell as usize] >= least;
        let open: Vec<u32> = (0..self.cells.len() as u32).filter(open).collect();
        let keys: Vec<[i32; 2]> = open.iter().map(|&cell| self.cells.keys[cell as usize]).collect();
        let mut joined = UnionFind::new(open.len());
        if !open.is_empty() {
            let mut walk = Walk::<1>::new(&keys, 0);
            for place in 0..open.len() {
                walk.around(place, |near, _| _ = joined.unite(place as u32, near as u32));
            }
        }
        let roots = joined.roots(monitor)?;
        let mut order: Vec<u32> = (0..open.len() as u32).collect();
        order.sort_unstable_by_key(|&place| (roots[place as usize], place));
        let groups = order.chunk_by(|&a, &b| roots[a as usize] == roots[b as usize]);
        Ok(groups.map(|group| group.iter().map(|&place| open[place as usize]).collect()).collect())
    }
}

fn within(value: f64, [low, high]: [f64; 2]) -> bool {
    (low..=high).contains(&value)
}

/// Length and width, metres, of the smallest rectangle around points in plan, without the outermost points of each side.
fn smallest_rectangle(points: &[[f64; 2]]) -> [f64; 2] {
    let mut along = vec![0.0; points.len()];
    let mut extent = |[x, y]: [f64; 2]| {
        along.iter_mut().zip(points).for_each(|(value, at)| *value = x * at[0] + y * at[1]);
        quantile(&mut along, 1.0 - BEYOND) - quantile(&mut along, BEYOND)
    };
    let mut smallest = [f64::INFINITY; 2];
    for step in 0..DIRECTIONS {
        let (sin, cos) = (f64::from(step) * std::f64::consts::FRAC_PI_2 / f64::from(DIRECTIONS)).sin_cos();
        let sides = [extent([cos, sin]), extent([-sin, cos])];
        if sides[0] * sides[1] < smallest[0] * smallest[1] {
            smallest = sides;
        }
    }
    [smallest[0].max(smallest[1]), smallest[0].min(smallest[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    /// Flat ground of 40 x 40 m with a point each 25 cm, and blocks on it: x, y, length, width, height, whether the
    /// points are like a car.
    struct Scene {
        points: Points,
        codes: Vec<u8>,
        cars: Vec<f32>,
        heights: Vec<f32>,
    }

    #[derive(Clone, Copy)]
    struct Block {
        at: [f64; 2],
        /// Length, width, height.
        size: [f64; 3],
        /// To be a car.
        probability: f32,
    }

    impl Block {
        fn holds(&self, [x, y]: [f64; 2]) -> bool {
            let ([u, v], [length, width, _]) = (self.at, self.size);
            x >= u && x < u + length && y >= v && y < v + width
        }
    }

    fn car(at: [f64; 2], size: [f64; 3]) -> Block {
        Block { at, size, probability: 0.95 }
    }

    fn thing(at: [f64; 2], size: [f64; 3]) -> Block {
        Block { at, size, probability: 0.05 }
    }

    fn scene(blocks: &[Block]) -> Scene {
        let mut rows = Vec::new();
        let mut scene = Scene { points: Points::default(), codes: Vec::new(), cars: Vec::new(), heights: Vec::new() };
        for i in 0..160 * 160 {
            let [x, y] = [f64::from(i % 160), f64::from(i / 160)].map(|v| 0.25 * v + 0.1);
            let (height, probability, code) = match blocks.iter().find(|block| block.holds([x, y])) {
                Some(block) => (block.size[2], block.probability, 5),
                None => (0.0, 0.05, 2),
            };
            rows.push([x, y, height]);
            scene.codes.push(code);
            scene.cars.push(probability);
            scene.heights.push(height as f32);
        }
        scene.points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        scene
    }

    /// For each block, the share of its points that are found.
    fn found(blocks: &[Block]) -> Vec<f64> {
        let Scene { points, codes, cars, heights } = &scene(blocks);
        let named = Named { points, codes, cars, heights, density: 16.0 };
        let rows = CarParams::default().among(&named, &Monitor::default()).unwrap();
        let share = |block: &Block| {
            let inside = |row: &u32| {
                let [x, y, _] = points.positions.xyz(*row as usize).map(f64::from);
                block.holds([x + points.frame.origin[0], y + points.frame.origin[1]])
            };
            let all = (0..points.len() as u32).filter(inside).count();
            rows.iter().filter(|row| inside(row)).count() as f64 / all as f64
        };
        blocks.iter().map(share).collect()
    }

    #[test]
    fn cars_stand_free_and_have_the_size_of_cars() {
        let size = [4.5, 1.8, 1.5];
        assert_eq!(found(&[car([5.0, 5.0], size), car([20.0, 5.0], [1.8, 4.5, 1.5])]), [1.0, 1.0]);
        // Three side by side, closer than a cell.
        let row: Vec<Block> = (0..3).map(|i| car([10.0, 10.0 + 2.1 * f64::from(i)], size)).collect();
        assert_eq!(found(&row), [1.0; 3]);
        // Too low, too high, too small, not like cars.
        assert_eq!(found(&[car([5.0, 5.0], [4.5, 1.8, 0.4])]), [0.0]);
        assert_eq!(found(&[car([5.0, 5.0], [4.5, 1.8, 3.5])]), [0.0]);
        assert_eq!(found(&[car([5.0, 5.0], [1.4, 1.4, 1.5])]), [0.0]);
        assert_eq!(found(&[thing([5.0, 5.0], size)]), [0.0]);
        assert_eq!(found(&[Block { probability: 0.35, ..car([5.0, 5.0], size) }]), [0.0]);
        assert_eq!(found(&[Block { probability: 0.45, ..car([5.0, 5.0], size) }]), [1.0]);
        // Hedges of the same height on both sides.
        let hedges = [thing([4.5, 4.0], [5.5, 1.0, 1.5]), thing([4.5, 6.8], [5.5, 1.0, 1.5])];
        assert_eq!(found(&[car([5.0, 5.0], size), hedges[0], hedges[1]]), [0.0; 3]);
        // A longer hedge beside it that is a little like a car: the car alone is one.
        let beside = Block { probability: 0.2, ..thing([4.5, 7.1], [9.0, 1.0, 1.5]) };
        assert_eq!(found(&[car([5.0, 5.0], size), beside]), [1.0, 0.0]);
        // Four at an angle in a row fill three quarters of their rectangle, enough if they are surely cars.
        let slanted = |probability| {
            let each =
                |i: i32| Block { probability, ..car([10.0 + 4.0 * f64::from(i), 10.0 + 2.0 * f64::from(i)], size) };
            (0..4).map(each).collect::<Vec<_>>()
        };
        assert_eq!(found(&slanted(0.95)), [1.0; 4]);
        assert_eq!(found(&slanted(0.75)), [0.0; 4]);
        // An angle of hedges does not fill its rectangle.
        let angle = [car([5.0, 5.0], [8.0, 1.0, 1.5]), car([5.0, 6.0], [1.0, 8.0, 1.5])];
        assert_eq!(found(&angle), [0.0; 2]);
        // A wall on one side does no harm.
        assert_eq!(found(&[car([5.0, 5.0], size), thing([4.0, 6.8], [8.0, 0.3, 2.0])])[0], 1.0);
    }

    #[test]
    fn the_smallest_rectangle_of_a_turned_one_is_itself() {
        let (sin, cos) = 0.61_f64.sin_cos();
        let grid = (0..40).flat_map(|i| (0..16).map(move |j| [0.1 * f64::from(i), 0.1 * f64::from(j)]));
        let turned: Vec<[f64; 2]> = grid.map(|[x, y]| [cos * x - sin * y, sin * x + cos * y]).collect();
        let [length, width] = smallest_rectangle(&turned);
        assert!((length - 3.9).abs() < 0.25 && (width - 1.5).abs() < 0.25, "{length} {width}");
    }

    #[test]
    fn nothing_is_found_without_points_or_rule() {
        let empty = Named { points: &Points::default(), codes: &[], cars: &[], heights: &[], density: 0.0 };
        assert!(CarParams::default().among(&empty, &Monitor::default()).unwrap().is_empty());
        let Scene { points, codes, cars, heights } = &scene(&[car([5.0, 5.0], [4.5, 1.8, 1.5])]);
        let named = Named { points, codes, cars, heights, density: 16.0 };
        assert!(CarParams::none().among(&named, &Monitor::default()).unwrap().is_empty());
        assert!(CarParams { top: [2.0, 1.0], ..CarParams::default() }.validate().is_err());
        assert!(CarParams { probability: 1.5, ..CarParams::default() }.validate().is_err());
        assert!(CarParams { cell: 0.0, ..CarParams::default() }.validate().is_err());
        assert!(CarParams::none().validate().is_ok());
    }
}
