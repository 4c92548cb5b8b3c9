//! Division of the segments into training and evaluation.

use crate::error::{Error, Result};
use crate::random::stream;
use crate::voxels::cells::cell_of;
use serde::{Deserialize, Serialize};

/// Parameters of the division.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectTraining {
    /// Share of the labelled segments used for training, above 0..=1 (Hasanpour Zaryabi et al. 2022: 0.3); the others
    /// are for evaluation. 1 trains on all.
    pub share: f64,
    /// Draw whole squares of `square` metres instead of segments, so that most evaluated segments have no neighbour in
    /// the training set.
    pub disjoint: bool,
    /// Edge of these squares, metres; above 0.
    pub square: f64,
    /// A segment has its majority class only if at least this share of its labelled points has it, 0..=1.
    pub purity: f64,
}

impl Default for ObjectTraining {
    fn default() -> Self {
        Self { share: 0.3, disjoint: false, square: 20.0, purity: 0.0 }
    }
}

impl ObjectTraining {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if !(self.share > 0.0 && self.share <= 1.0) {
            return Err(Error::parameter("training.share", self.share, "above 0, up to 1"));
        }
        if !(self.square > 0.0 && self.square.is_finite()) {
            return Err(Error::parameter("training.square", self.square, "metres, above 0"));
        }
        match (0.0..=1.0).contains(&self.purity) {
            true => Ok(()),
            false => Err(Error::parameter("training.purity", self.purity, "0 to 1")),
        }
    }
}

/// A labelled segment: its class and position, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Labelled {
    pub(super) code: u8,
    pub(super) at: [f64; 2],
}

/// Whether each of the labelled segments is used for training.
///
/// Draws the given share of each class, at least one segment; or whole squares in random order until they hold the
/// share of all segments. The result depends only on the arguments.
pub(super) fn split(segments: &[Labelled], params: &ObjectTraining, seed: u64) -> Vec<bool> {
    match params.disjoint {
        true => by_square(segments, params, seed),
        false => by_class(segments, params.share, seed),
    }
}

fn by_class(segments: &[Labelled], share: f64, seed: u64) -> Vec<bool> {
    let mut chosen = vec![false; segments.len()];
    for code in 0..=255u8 {
        let mut members: Vec<usize> = (0..segments.len()).filter(|&s| segments[s].code == code).collect();
        if members.is_empty() {
            continue;
        }
        stream(seed, 0x6f62_6a65 ^ u64::from(code) << 32).shuffle(&mut members);
        let count = ((members.len() as f64 * share).round() as usize).clamp(1, members.len());
        members[..count].iter().for_each(|&s| chosen[s] = true);
    }
    chosen
}

fn by_square(segments: &[Labelled], params: &ObjectTraining, seed: u64) -> Vec<bool> {
    let square = |s: &Labelled| cell_of(s.at.map(|v| v / params.square));
    let mut squares: Vec<[i32; 2]> = segments.iter().map(square).collect();
    squares.sort_unstable();
    squares.dedup();
    stream(seed, 0x7371_7561).shuffle(&mut squares);
    let wanted = (segments.len() as f64 * params.share).ceil() as usize;
    let mut chosen = vec![false; segments.len()];
    let mut count = 0;
    for drawn in squares {
        if count >= wanted {
            break;
        }
        for (s, chosen) in segments.iter().zip(&mut chosen).filter(|(s, _)| square(s) == drawn) {
            *chosen = s.at.iter().all(|v| v.is_finite());
            count += 1;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segments() -> Vec<Labelled> {
        (0..200).map(|i| Labelled { code: if i % 10 == 0 { 6 } else { 2 }, at: [f64::from(i), 0.5] }).collect()
    }

    #[test]
    fn the_share_is_taken_of_every_class_and_a_rare_class_gives_one() {
        let mut all = segments();
        all.push(Labelled { code: 9, at: [0.0; 2] });
        let chosen = split(&all, &ObjectTraining::default(), 3);
        let count = |code: u8| all.iter().zip(&chosen).filter(|(s, c)| s.code == code && **c).count();
        assert_eq!((count(2), count(6), count(9)), (54, 6, 1));
        assert_ne!(chosen, split(&all, &ObjectTraining::default(), 4));
    }

    #[test]
    fn squares_are_learned_from_as_a_whole_or_not_at_all() {
        let all = segments();
        let params = ObjectTraining { disjoint: true, ..ObjectTraining::default() };
        let chosen = split(&all, &params, 3);
        for square in chosen.chunks_exact(20) {
            assert!(square.iter().all(|c| *c == square[0]));
        }
        assert_eq!(chosen.iter().filter(|c| **c).count(), 60);
    }
}
