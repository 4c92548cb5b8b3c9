//! The points sorted by cell, with one array for each coordinate and attribute.

use super::super::PointAttributes;
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Monitor, map_watched, watched};
use crate::voxels::cells::Cells;
use crate::voxels::rows::RowGrid;

/// Points sorted by the cells of edge S.
pub(super) struct Sorted {
    pub(super) grid: RowGrid,
    /// Items are the original indices of the points.
    pub(super) cells: Cells<u64>,
    pub(super) positions: Positions,
    /// Empty if there are none.
    pub(super) normals: [Vec<f32>; 3],
    /// Empty if there are none.
    pub(super) colours: [Vec<f32>; 3],
}

impl Sorted {
    pub(super) fn new(
        points: &Positions,
        attributes: &PointAttributes<'_>,
        size: f64,
        monitor: &Monitor,
    ) -> Result<Self> {
        let grid = RowGrid::new(points.iter(), size, "size")?;
        let cells = Cells::new(points.len(), |i| grid.key(points.xyz(i)), monitor)?;
        let items = &cells.items;
        let rows = |rows: Option<&[[f32; 3]]>| {
            let rows = rows.unwrap_or_default();
            let column = |a: usize| match rows.len() {
                0 => Ok(Vec::new()),
                _ => map_watched(items.len(), monitor, |i| rows[items[i] as usize][a]),
            };
            Ok([column(0)?, column(1)?, column(2)?])
        };
        let positions = points.select(items, monitor)?;
        let (normals, colours) = (rows(attributes.normals)?, rows(attributes.colours)?);
        Ok(Self { grid, cells, positions, normals, colours })
    }

    /// Number of points.
    pub(super) fn len(&self) -> usize {
        self.positions.len()
    }

    /// Position of a sorted point.
    pub(super) fn place(&self, i: usize) -> [f32; 3] {
        self.positions.xyz(i)
    }

    /// Colour of a sorted point, if there are colours.
    pub(super) fn colour(&self, i: usize) -> Option<[f32; 3]> {
        let [r, g, b] = &self.colours;
        (!r.is_empty()).then(|| [r[i], g[i], b[i]])
    }

    /// Values of the sorted points in the original order.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn in_order_of_points(&self, values: &[u32], monitor: &Monitor) -> Result<Vec<u32>> {
        let mut out = vec![0; values.len()];
        for piece in watched(values.len(), monitor) {
            piece?.for_each(|at| out[self.cells.items[at] as usize] = values[at]);
        }
        Ok(out)
    }
}
