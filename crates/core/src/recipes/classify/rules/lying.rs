//! Buildings that lie on the ground of the ground filter: slopes, embankments and terraces that the stages take for roofs.
//!
//! Where they touch houses they are one component with these, which stands above the ground; so they are judged apart.

use super::BUILDING;
use super::plan::{PlanRows, SPACINGS, cell_edge};
use crate::cloud::Points;
use crate::error::Result;
use crate::parallel::Monitor;

/// A scan that was classified, and what the ground filter makes of it.
pub(super) struct Filtered<'a> {
    pub(super) points: &'a Points,
    /// A code for each point of the cloud.
    pub(super) codes: &'a [u8],
    /// Whether each point of the cloud lies on the ground of the filter.
    pub(super) lying: &'a [bool],
    /// Points per square metre.
    pub(super) density: f64,
}

/// The codes, with `free` in place of buildings that do not lie on the ground of the filter. Cells of `edge` metres in which
/// most building points stand above it are those of a wall, whose foot lies on the ground. O(n).
pub(super) fn lying_buildings(scan: &Filtered<'_>, edge: f64, free: u8, monitor: &Monitor) -> Result<Vec<u8>> {
    let Filtered { points, codes, lying, density } = *scan;
    let point = |row: u32| points.frame.index[row as usize] as usize;
    let used = (0..points.len() as u32).filter(|&row| codes[point(row)] == BUILDING).collect();
    let cells = PlanRows::new(points, used, cell_edge(edge, SPACINGS, density), monitor)?;
    let mut left: Vec<u8> = codes.iter().map(|&code| if code == BUILDING { free } else { code }).collect();
    for cell in 0..cells.len() {
        let rows = cells.of(cell);
        let found = || rows.iter().filter(|&&row| lying[point(row)]);
        if 2 * found().count() >= rows.len() {
            found().for_each(|&row| left[point(row)] = BUILDING);
        }
    }
    Ok(left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, MetricCloud};
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
        let scan = Filtered { points: &points, codes: &codes, lying: &lying, density: 4.0 };
        let left = lying_buildings(&scan, 1.0, 1, &Monitor::default()).unwrap();
        assert_eq!(left, [1, 1, 1, 1, 6, 6, 2, 1]);
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
