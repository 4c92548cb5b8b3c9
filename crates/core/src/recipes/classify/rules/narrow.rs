//! Buildings that are too small in plan to be any: poles, and a few points in the crown of a tree.

use super::BUILDING;
use super::plan::{PlanRows, SPACINGS, block, cell_edge, groups};
use crate::cloud::Points;
use crate::error::Result;
use crate::parallel::Monitor;

/// Edge of a cell in plan, metres. In thin clouds, which have larger cells, a house may have a handful of points.
const CELL: f64 = 1.0;
/// Cells of a building, at least.
const CELLS: usize = 6;

/// The rows of buildings whose points lie in less than six cells of 1 m that touch each other; none in clouds of less than 2.25
/// points per square metre. `codes` has an entry a point of the cloud. O(n + m log m) for m cells of buildings.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn narrow(points: &Points, codes: &[u8], density: f64, monitor: &Monitor) -> Result<Vec<u32>> {
    let edge = cell_edge(CELL, SPACINGS, density);
    if edge > CELL {
        return Ok(Vec::new());
    }
    let building = |&row: &u32| codes[points.frame.index[row as usize] as usize] == BUILDING;
    let used: Vec<u32> = (0..points.len() as u32).filter(building).collect();
    let cells = PlanRows::new(points, used, edge, monitor)?;
    let near = |cell: usize| block(cells.index.keys()[cell], 1).filter_map(|key| cells.index.find(key));
    let all = groups((0..cells.len()).collect(), near, monitor)?;
    let small = all.into_iter().filter(|group| group.len() < CELLS).flatten();
    Ok(small.flat_map(|cell| cells.of(cell).to_vec()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    #[test]
    fn poles_are_too_narrow_and_sheds_are_not() {
        // A field of 30 m, 4 points per square metre.
        let mut rows: Vec<[f64; 3]> = (0..3600).map(|i| [f64::from(i % 60), f64::from(i / 60), 0.0]).collect();
        rows.iter_mut().for_each(|[x, y, _]| (*x, *y) = (*x / 2.0 + 0.1, *y / 2.0 + 0.1));
        let ground = rows.len();
        // A pole, and roofs of 2 m x 2 m and 3 m x 2 m.
        rows.extend((0..40).map(|i| [5.5, 5.5, f64::from(i) / 5.0]));
        let roof = |x: f64, wide: i32| {
            (0..8 * wide)
                .map(move |i| [x + 0.1 + f64::from(i % (2 * wide)) / 2.0, 10.1 + f64::from(i / (2 * wide)) / 2.0, 3.0])
        };
        rows.extend(roof(10.0, 2));
        let wide = rows.len();
        rows.extend(roof(20.0, 3));
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let codes: Vec<u8> = (0..rows.len()).map(|i| if i < ground { 2 } else { BUILDING }).collect();
        let mut found = narrow(&points, &codes, 4.0, &Monitor::default()).unwrap();
        found.sort_unstable();
        assert_eq!(found, (ground as u32..wide as u32).collect::<Vec<_>>());
        assert!(narrow(&points, &codes, 2.0, &Monitor::default()).unwrap().is_empty());
    }
}
