//! Which of the missing positions count.

use super::super::polylines::distance;
use super::{LineScores, ScoreParams, apart};
use crate::cloud::Positions;
use crate::error::Result;
use crate::parallel::{Monitor, watched};
use std::collections::HashMap;

/// Counts missing positions in their order, except those within `forgiven` of a found one or of one that is already
/// counted. The scores hold nothing but these numbers. O(n log n).
pub(super) fn counted(
    found: &Positions,
    missing: &Positions,
    params: &ScoreParams,
    monitor: &Monitor,
) -> Result<LineScores> {
    let reach = params.forgiven * (1.0 + 1e-6);
    let apart = apart(found, missing, monitor)?;
    let mut counted = Counted { size: reach, cells: HashMap::new() };
    let mut scores = LineScores::default();
    for piece in watched(missing.len(), monitor) {
        for i in piece? {
            let number = if apart[i] <= reach {
                &mut scores.forgiven
            } else if counted.add(missing.xyz(i)) {
                &mut scores.false_negatives
            } else {
                &mut scores.repeated
            };
            *number += 1;
        }
    }
    Ok(scores)
}

/// Counted positions by cells of the size of the least distance.
struct Counted {
    size: f64,
    cells: HashMap<[i64; 3], Vec<[f32; 3]>>,
}

impl Counted {
    /// Counts a position unless one that is counted is within the least distance.
    fn add(&mut self, at: [f32; 3]) -> bool {
        if self.size <= 0.0 {
            return true;
        }
        let cell = at.map(|v| (f64::from(v) / self.size).floor() as i64);
        let near = |other: &[f32; 3]| distance(*other, at) <= self.size;
        for step in 0..27i64 {
            let [x, y, z] = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
            let place = [cell[0].saturating_add(x), cell[1].saturating_add(y), cell[2].saturating_add(z)];
            if self.cells.get(&place).is_some_and(|others| others.iter().any(near)) {
                return false;
            }
        }
        self.cells.entry(cell).or_default().push(at);
        true
    }
}
