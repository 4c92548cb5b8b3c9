//! Seeds of the supervoxels.

use super::super::VccsParams;
use super::voxels::Voxels;
use crate::error::Result;
use crate::parallel::{Monitor, map_ordered};
use crate::voxels::cells::Cells;
use crate::voxels::rows::RowGrid;

/// Cells whose seeds one task selects.
const BLOCK: usize = 1024;

/// The voxel nearest to the centre of each occupied cell of edge R_seed (the first of equally near ones), if more than
/// `min_share` · π (R_seed/2)²/R_voxel² voxels, itself included, lie within R_seed/2 of it.
pub(super) fn seeds(voxels: &Voxels, params: &VccsParams, monitor: &Monitor) -> Result<Vec<u32>> {
    let place = |v: usize| voxels.voxels[v].place;
    let grid = RowGrid::new(voxels.voxels.iter().map(|v| v.place), params.size, "size")?;
    let cells = Cells::new(voxels.len(), |v| grid.key(place(v)), monitor)?;
    let radius = params.size / 2.0;
    let least = params.min_share * std::f64::consts::PI * (radius / params.voxel).powi(2);
    let apart = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f32>();
    let nearest = |cell: usize| {
        let middle = grid.centre(cells.keys[cell]);
        let rows = cells.of(cell).iter().map(|&v| (apart(place(v as usize), middle), v));
        rows.reduce(|best, row| if row.0 < best.0 { row } else { best }).map(|best| best.1)
    };
    let crowded = |&seed: &u32| {
        let at = place(seed as usize);
        let around = cells.around(grid.key(at)).flat_map(|cell| cells.of(cell));
        let within = around.filter(|&&v| apart(place(v as usize), at) <= (radius * radius) as f32);
        within.count() as f64 > least
    };
    let parts = map_ordered(cells.len().div_ceil(BLOCK), monitor, |block| {
        let range = block * BLOCK..((block + 1) * BLOCK).min(cells.len());
        Ok(range.filter_map(nearest).filter(crowded).collect::<Vec<u32>>())
    })?;
    Ok(parts.concat())
}

#[cfg(test)]
mod tests {
    use super::super::super::PointAttributes;
    use super::super::super::testing::points_of;
    use super::*;

    #[test]
    fn seeds_stand_in_the_middle_of_cells_and_lonely_ones_fall_away() {
        let mut rows: Vec<[f64; 3]> =
            (0..900).map(|i| [f64::from(i % 30) * 0.1 + 0.05, f64::from(i / 30) * 0.1 + 0.05, 0.5]).collect();
        rows.push([1.5, 1.5, 7.0]);
        let points = points_of(&rows);
        let voxels = Voxels::new(&points, &PointAttributes::default(), 0.1, &Monitor::default()).unwrap();
        let with = |min_share: f64| {
            let params = VccsParams { size: 1.0, voxel: 0.1, min_share, ..VccsParams::default() };
            seeds(&voxels, &params, &Monitor::default()).unwrap()
        };
        assert_eq!((with(0.0).len(), with(0.05).len()), (10, 9));
        for seed in with(0.05) {
            let [x, y, _] = voxels.voxels[seed as usize].place;
            assert!((x.fract() - 0.5).abs() < 0.06 && (y.fract() - 0.5).abs() < 0.06, "{x} {y}");
        }
    }
}
