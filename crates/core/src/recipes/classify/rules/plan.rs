//! Cells in plan, which the rules that look at surroundings share.

use crate::cloud::Points;
use crate::csr::Csr;
use crate::error::Result;
use crate::graph::UnionFind;
use crate::parallel::{Looks, Monitor, map_ordered};
use crate::voxels::cells::index::CellIndex;
use crate::voxels::cells::{Cells, cell_of};
use std::collections::{BTreeMap, BTreeSet};
use std::mem;

/// Spacings of the points to a cell in plan, at least.
pub(super) const SPACINGS: f64 = 1.5;

/// Edge of cells in plan, metres: at least `least` and this many point spacings; `density` is in points per square metre.
pub(super) fn cell_edge(least: f64, spacings: f64, density: f64) -> f64 {
    least.max(spacings / density.max(1e-6).sqrt())
}

/// The cell in plan of a row, of cells with this edge.
pub(in crate::recipes) fn plan_cell(points: &Points, row: u32, edge: f64) -> [i32; 2] {
    let [x, y, _] = points.positions.xyz(row as usize);
    cell_of([x, y].map(|v| f64::from(v) / edge))
}

/// Rows of points by the occupied cells in plan that hold them.
pub(super) struct PlanRows {
    pub(super) index: CellIndex<[i32; 2]>,
    rows: Csr,
}

impl PlanRows {
    /// Of some rows; those of a cell keep their order. O(rows).
    pub(super) fn new(points: &Points, used: Vec<u32>, edge: f64, monitor: &Monitor) -> Result<Self> {
        let mut cells = Cells::new(used.len(), |i| plan_cell(points, used[i], edge), monitor)?;
        cells.items.iter_mut().for_each(|item| *item = used[*item as usize]);
        let index = CellIndex::new(mem::take(&mut cells.keys));
        Ok(Self { index, rows: cells.into_groups(points.len())? })
    }

    /// Number of occupied cells.
    pub(super) fn len(&self) -> usize {
        self.index.keys().len()
    }

    /// The rows of a cell.
    pub(super) fn of(&self, cell: usize) -> &[u32] {
        self.rows.group(cell)
    }
}

/// Cells of a block.
pub(super) const BLOCK: usize = 4096;

/// What `find` finds at each of so many cells, in their order; in parallel.
pub(super) fn each_cell<T: Send>(
    cells: usize,
    monitor: &Monitor,
    find: impl Fn(usize) -> Vec<T> + Sync,
) -> Result<Vec<T>> {
    let found = map_ordered(cells.div_ceil(BLOCK), monitor, |block| {
        Ok((block * BLOCK..((block + 1) * BLOCK).min(cells)).flat_map(&find).collect::<Vec<T>>())
    })?;
    Ok(found.into_iter().flatten().collect())
}

/// The cells in plan at most `reach` cells away along each axis, the own one included.
pub(super) fn block([x, y]: [i32; 2], reach: i32) -> impl Iterator<Item = [i32; 2]> {
    (-reach..=reach).flat_map(move |dx| (-reach..=reach).map(move |dy| [x.saturating_add(dx), y.saturating_add(dy)]))
}

/// The outline of a scan in plan: of each row and of each column of cells the first and the last that hold points.
pub(super) fn outline(points: &Points, edge: f64, monitor: &Monitor) -> Result<BTreeSet<[i32; 2]>> {
    let mut ends = [(); 2].map(|()| BTreeMap::<i32, [i32; 2]>::new());
    let mut looks = Looks::at(monitor);
    let mut last = None;
    for row in 0..points.len() as u32 {
        looks.step()?;
        let [x, y] = plan_cell(points, row, edge);
        // Points beside each other in the list are near each other.
        if last.replace([x, y]) != Some([x, y]) {
            for (ends, [line, place]) in ends.iter_mut().zip([[x, y], [y, x]]) {
                let [first, last] = ends.entry(line).or_insert([place; 2]);
                [*first, *last] = [place.min(*first), place.max(*last)];
            }
        }
    }
    let [columns, rows] = ends;
    let columns = columns.into_iter().flat_map(|(x, ends)| ends.map(|y| [x, y]));
    Ok(columns.chain(rows.into_iter().flat_map(|(y, ends)| ends.map(|x| [x, y]))).collect())
}

/// Length of a step, in cells.
#[inline]
pub(super) fn length([x, y]: [i32; 2]) -> f64 {
    (f64::from(x).powi(2) + f64::from(y).powi(2)).sqrt()
}

/// Four axes in plan.
pub(super) const AXES: [[i32; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];
/// Land is seen from a place this far away, at most, metres.
pub(super) const ACROSS: f64 = 100.0;

/// The number of [`AXES`] along which land lies on both sides of a place: at least two in water, but hardly one at the edge
/// of a scan. `edge` is that of cells, metres.
pub(super) fn axes_with_land([x, y]: [i32; 2], edge: f64, is_land: impl Fn([i32; 2]) -> bool) -> usize {
    let seen = |[dx, dy]: [i32; 2]| {
        let run = edge * length([dx, dy]);
        (1..=(ACROSS / run) as i32).any(|step| is_land([x.saturating_add(step * dx), y.saturating_add(step * dy)]))
    };
    AXES.into_iter().filter(|&[dx, dy]| seen([dx, dy]) && seen([-dx, -dy])).count()
}

/// Groups of cells, which ascend, as `near` joins them; those of a group ascend too.
pub(super) fn groups<I: Iterator<Item = usize>>(
    mut cells: Vec<usize>,
    near: impl Fn(usize) -> I,
    monitor: &Monitor,
) -> Result<Vec<Vec<usize>>> {
    let mut joined = UnionFind::new(cells.last().map_or(0, |last| last + 1));
    let mut looks = Looks::at(monitor);
    for &cell in &cells {
        looks.step()?;
        for near in near(cell) {
            joined.unite(cell as u32, near as u32);
        }
    }
    let roots = joined.roots(monitor)?;
    cells.sort_by_key(|&cell| roots[cell]);
    Ok(cells.chunk_by(|&a, &b| roots[a] == roots[b]).map(<[usize]>::to_vec).collect())
}

/// The pieces that cells form, as `near` joins them.
pub(super) fn pieces<I: Iterator<Item = usize>>(
    mut cells: BTreeSet<usize>,
    near: impl Fn(usize) -> I,
) -> Vec<Vec<usize>> {
    let mut pieces = Vec::new();
    while let Some(first) = cells.pop_first() {
        let mut piece = vec![first];
        let mut done = 0;
        while let Some(&cell) = piece.get(done) {
            piece.extend(near(cell).filter(|near| cells.remove(near)));
            done += 1;
        }
        pieces.push(piece);
    }
    pieces
}

/// The value below which this share of the values lies: the nearest of them. Sorts them in part.
pub(super) fn quantile(values: &mut [f64], share: f64) -> f64 {
    let place = (share * (values.len() - 1) as f64).round() as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}
