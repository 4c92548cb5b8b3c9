//! For every cell of a grid the nearest filled cell.

use crate::error::Result;
use crate::parallel::{Looks, Monitor};

/// For every cell the nearest filled cell by Euclidean distance; itself if it is filled. At least one must be.
///
/// P. F. Felzenszwalb, D. P. Huttenlocher, *Distance transforms of sampled functions*, Theory of Computing 8, 2012:
/// first along the columns, then the lower envelope of parabolas along every row. O(cells).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn nearest_filled(filled: &[bool], columns: usize, monitor: &Monitor) -> Result<Vec<u32>> {
    let mut looks = Looks::at(monitor);
    let mut nearest = nearest_in_column(filled, columns, &mut looks)?;
    let mut envelope = Envelope::default();
    let mut old = Vec::with_capacity(columns);
    for (r, row) in nearest.chunks_mut(columns).enumerate() {
        looks.steps(columns)?;
        old.clear();
        old.extend_from_slice(row);
        envelope.build(&old, r, columns);
        envelope.read(&old, row);
    }
    Ok(nearest)
}

const NONE: u32 = u32::MAX;

/// The nearest filled cell of the same column; the lower of two equally near ones.
fn nearest_in_column(filled: &[bool], columns: usize, looks: &mut Looks<'_>) -> Result<Vec<u32>> {
    let own = |i: usize| if filled[i] { i as u32 } else { NONE };
    let mut nearest: Vec<u32> = (0..filled.len()).map(own).collect();
    for i in columns..filled.len() {
        looks.step()?;
        if nearest[i] == NONE {
            nearest[i] = nearest[i - columns];
        }
    }
    let row = |i: u32| i as usize / columns;
    for i in (0..filled.len().saturating_sub(columns)).rev() {
        looks.step()?;
        let (below, above) = (nearest[i], nearest[i + columns]);
        let here = row(i as u32);
        if above != NONE && row(above) > here && (below == NONE || row(above) - here < here - row(below)) {
            nearest[i] = above;
        }
    }
    Ok(nearest)
}

/// The lower envelope of the parabolas (x − column)² + height² of a row, and where each of them begins.
#[derive(Default)]
struct Envelope {
    column: Vec<usize>,
    from: Vec<f64>,
}

impl Envelope {
    fn build(&mut self, nearest: &[u32], row: usize, columns: usize) {
        self.column.clear();
        self.from.clear();
        let height = |c: usize| {
            let apart = (nearest[c] as usize / columns).abs_diff(row) as f64;
            apart * apart + (c * c) as f64
        };
        for c in (0..columns).filter(|&c| nearest[c] != NONE) {
            let mut from = f64::NEG_INFINITY;
            while let (Some(&last), Some(&begin)) = (self.column.last(), self.from.last()) {
                from = (height(c) - height(last)) / (2.0 * (c - last) as f64);
                if from > begin {
                    break;
                }
                self.column.pop();
                self.from.pop();
                from = f64::NEG_INFINITY;
            }
            self.column.push(c);
            self.from.push(from);
        }
    }

    fn read(&self, old: &[u32], row: &mut [u32]) {
        let mut part = 0;
        for (c, slot) in row.iter_mut().enumerate() {
            while self.from.get(part + 1).is_some_and(|&from| from < c as f64) {
                part += 1;
            }
            if let Some(&source) = self.column.get(part) {
                *slot = old[source];
            }
        }
    }
}
