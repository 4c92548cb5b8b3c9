//! What lies on the ground of the ground filter: slopes, embankments and terraces that the stages take for roofs, or for low
//! vegetation.
//!
//! Where such roofs touch houses they are one component with these, which stands above the ground; so they are judged apart.

use super::level::{Judged, LevelParams, LevelRows};
use super::plan::{PlanRows, SPACINGS, block, cell_edge, groups};
use super::{BUILDING, HIGH, LOW};
use crate::error::Result;
use crate::parallel::Monitor;

/// A scan that was classified, and what the ground filter makes of it.
pub(super) struct Filtered<'a> {
    pub(super) scan: Judged<'a>,
    /// Whether each point of the cloud lies on the ground of the filter.
    pub(super) lying: &'a [bool],
}

/// Vegetation that lies on the ground of the filter is ground in pieces of less mean confidence
const SURE: f64 = 0.7;
/// and of this area, square metres.
const PIECE: f64 = 10.0;

/// The points with some classes, by cells in plan.
struct LyingCells<'a> {
    filtered: &'a Filtered<'a>,
    cells: PlanRows,
    /// Edge of a cell, metres.
    edge: f64,
}

impl<'a> LyingCells<'a> {
    /// Of the points with these codes, in cells of at least `edge` metres.
    fn new(filtered: &'a Filtered<'_>, has: impl Fn(u8) -> bool, edge: f64, monitor: &Monitor) -> Result<Self> {
        let scan = &filtered.scan;
        let edge = cell_edge(edge, SPACINGS, scan.density);
        let used = (0..scan.points.len() as u32).filter(|&row| has(scan.codes[scan.point(row)])).collect();
        Ok(Self { filtered, cells: PlanRows::new(scan.points, used, edge, monitor)?, edge })
    }

    /// The rows of a cell that lie on the ground of the filter.
    fn of(&self, cell: usize) -> impl Iterator<Item = u32> {
        let Filtered { scan, lying } = self.filtered;
        self.cells.of(cell).iter().copied().filter(|&row| lying[scan.point(row)])
    }

    /// Whether they are half of the rows of a cell at least; in others stands a wall or a bush, whose foot lies on the ground.
    fn lies(&self, cell: usize) -> bool {
        2 * self.of(cell).count() >= self.cells.of(cell).len()
    }
}

/// Rows that are ground after all.
#[derive(Default)]
pub(super) struct LyingRows {
    /// Buildings that are level with the ground around them.
    pub(super) ground: Vec<u32>,
    /// Buildings and vegetation of which the stages are not sure.
    pub(super) doubted: Vec<u32>,
}

/// The buildings and the vegetation on the ground of the filter that are ground; `free` is the code of points without a class.
/// O(n).
pub(super) fn lying(filtered: &Filtered<'_>, level: &LevelParams, free: u8, monitor: &Monitor) -> Result<LyingRows> {
    let codes = buildings(filtered, level.cell, free, monitor)?;
    let LevelRows { ground, mut doubted, .. } = level.rows(&Judged { codes: &codes, ..filtered.scan }, monitor)?;
    if !filtered.scan.confidence.is_empty() {
        doubted.extend(doubted_vegetation(filtered, level.cell, monitor)?);
    }
    Ok(LyingRows { ground, doubted })
}

/// The codes, with `free` in place of buildings that do not lie on the ground of the filter, or in a cell of `edge` metres of
/// which most do not. O(n).
fn buildings(filtered: &Filtered<'_>, edge: f64, free: u8, monitor: &Monitor) -> Result<Vec<u8>> {
    let scan = &filtered.scan;
    let found = LyingCells::new(filtered, |code| code == BUILDING, edge, monitor)?;
    let mut left: Vec<u8> = scan.codes.iter().map(|&code| if code == BUILDING { free } else { code }).collect();
    for cell in (0..found.cells.len()).filter(|&cell| found.lies(cell)) {
        found.of(cell).for_each(|row| left[scan.point(row)] = BUILDING);
    }
    Ok(left)
}

/// The rows of vegetation on the ground of the filter of which the stages are not sure, in pieces of cells of `edge` metres.
/// O(n).
fn doubted_vegetation(filtered: &Filtered<'_>, edge: f64, monitor: &Monitor) -> Result<Vec<u32>> {
    let scan = &filtered.scan;
    let found = LyingCells::new(filtered, |code| (LOW..=HIGH).contains(&code), edge, monitor)?;
    let lies: Vec<bool> = (0..found.cells.len()).map(|cell| found.lies(cell)).collect();
    let index = &found.cells.index;
    let near = |cell: usize| block(index.keys()[cell], 1).filter_map(|key| index.find(key)).filter(|&near| lies[near]);
    let all = (0..lies.len()).filter(|&cell| lies[cell]).collect();
    let doubted = |piece: &Vec<usize>| {
        let rows = || piece.iter().flat_map(|&cell| found.of(cell));
        let sum: f64 = rows().map(|row| f64::from(scan.confidence[scan.point(row)])).sum();
        piece.len() as f64 * found.edge.powi(2) >= PIECE && sum < SURE * rows().count() as f64
    };
    let pieces = groups(all, near, monitor)?.into_iter().filter(doubted);
    Ok(pieces.flatten().flat_map(|cell| found.of(cell)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, MetricCloud, Points};
    use crate::recipes::classify::Classified;
    use crate::recipes::classify::rules::{ClassRules, ClassTable, GROUND, LevelParams};

    fn points(rows: &[[f64; 3]]) -> Points {
        Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0)
    }

    #[test]
    fn the_foot_of_a_wall_is_no_building_that_lies_on_the_ground_but_a_slope_is() {
        // Cells of 1 m at 4 points per square metre: the foot of a wall and three points of it; a slope; a bush on it.
        let rows = [0.1, 1.0, 2.0, 3.0].map(|z| [0.5, 0.5, z]);
        let slope = [[5.3, 0.3, 5.2], [5.7, 0.3, 5.4], [5.3, 0.7, 5.3], [5.7, 0.7, 6.4]];
        let points = points(&[rows, slope].concat());
        let lying = [true, false, false, false, true, true, true, false];
        let codes = [6, 6, 6, 6, 6, 6, 2, 6];
        let scan = Judged { points: &points, codes: &codes, confidence: &[], density: 4.0 };
        let left = buildings(&Filtered { scan, lying: &lying }, 1.0, 1, &Monitor::default()).unwrap();
        assert_eq!(left, [1, 1, 1, 1, 6, 6, 2, 1]);
    }

    #[test]
    fn low_vegetation_that_the_stages_are_not_sure_of_is_ground() {
        // A field, 4 points per square metre, with vegetation in 3 x 4 m, and a bush in other 3 x 4 m.
        let rows: Vec<[f64; 3]> =
            (0..1600).map(|i| [f64::from(i % 40) / 2.0 + 0.2, f64::from(i / 40) / 2.0 + 0.2, 0.0]).collect();
        let within = |[x, y, _]: &[f64; 3], left: f64| *x > left && *x < left + 3.0 && *y > 4.0 && *y < 8.0;
        let points = points(&rows);
        let codes: Vec<u8> = rows.iter().map(|p| if within(p, 4.0) || within(p, 12.0) { HIGH } else { 2 }).collect();
        let lying: Vec<bool> = rows.iter().map(|p| !within(p, 12.0)).collect();
        let found = |confidence: &[f32]| {
            let scan = Judged { points: &points, codes: &codes, confidence, density: 4.0 };
            let (level, monitor) = (LevelParams::default(), Monitor::default());
            let rows = super::lying(&Filtered { scan, lying: &lying }, &level, 1, &monitor).unwrap().doubted;
            let mut found: Vec<usize> = rows.into_iter().map(|row| scan.point(row)).collect();
            found.sort_unstable();
            found
        };
        let patch: Vec<usize> = (0..rows.len()).filter(|&i| within(&rows[i], 4.0)).collect();
        assert_eq!((found(&vec![0.69; rows.len()]), found(&vec![0.71; rows.len()])), (patch, Vec::new()));
        // Nothing is doubted without confidences, as after a field.
        assert!(found(&[]).is_empty());
    }

    /// Shares of the ramps and of the deck that are ground, by the rules. A road on an embankment crosses another one; its
    /// deck of 40 m and its ramps, 12 m on each side, were named building.
    fn ground_of_embankment(is_filtered: bool) -> [f64; 2] {
        let side = |y: f64| (y - 40.0).abs();
        let is_deck = |x: f64, y: f64| (x - 60.0).abs() < 20.0 && side(y) < 6.0;
        let is_ramp = |x: f64, y: f64| (x - 60.0).abs() < 32.0 && side(y) < 6.0 && !is_deck(x, y);
        let height = |x: f64, y: f64| match ((x - 60.0).abs() < 20.0, is_deck(x, y)) {
            (true, false) => 0.0,
            _ => (6.0 - 0.6 * (side(y) - 6.0).max(0.0)).max(0.0),
        };
        // 4 points a square metre.
        let rows: Vec<[f64; 3]> = (0..38_400)
            .map(|i| [f64::from(i % 240) / 2.0 + 0.2, f64::from(i / 240) / 2.0 + 0.2])
            .map(|[x, y]| [x, y, height(x, y)])
            .collect();
        let is_building = |x: f64, y: f64| is_deck(x, y) || is_ramp(x, y);
        let cloud = Cloud::from_rows(&rows).unwrap();
        let mut result = Classified {
            codes: rows.iter().map(|&[x, y, _]| if is_building(x, y) { BUILDING } else { GROUND }).collect(),
            lying: if is_filtered { rows.iter().map(|&[x, y, _]| !is_deck(x, y)).collect() } else { Vec::new() },
            confidence: vec![0.9; rows.len()],
            density: 4.0,
            ..Classified::default()
        };
        let scene = MetricCloud::new(&cloud, None, &Monitor::default()).unwrap();
        let rules = ClassRules { level: LevelParams::default(), ..ClassRules::default() };
        rules.apply(&mut result, &ClassTable::from_codes(&[2, 5, 6]), &scene, &Monitor::default()).unwrap();
        let ground = |part: &dyn Fn(f64, f64) -> bool| {
            let of = rows.iter().zip(&result.codes).filter(|([x, y, _], _)| part(*x, *y));
            let [all, found] = of.fold([0, 0], |[all, found], (_, &code)| [all + 1, found + u32::from(code == GROUND)]);
            f64::from(found) / f64::from(all)
        };
        [ground(&is_ramp), ground(&is_deck)]
    }

    #[test]
    fn the_ramps_of_a_bridge_become_ground_and_its_deck_does_not() {
        let [ramps, deck] = ground_of_embankment(true);
        assert!(ramps > 0.95 && deck == 0.0, "{ramps} {deck}");
        let [ramps, deck] = ground_of_embankment(false);
        assert!(ramps == 0.0 && deck == 0.0, "{ramps} {deck}");
    }
}
