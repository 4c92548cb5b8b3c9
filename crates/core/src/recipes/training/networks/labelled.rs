//! The labelled points of a cloud that a network learns from, and how they are drawn.

use crate::classes::ClassTable;
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::random::Stream;
use crate::recipes::training::sources::SampleSource;
use sha2::Digest;

/// The class of a point without one.
pub(in crate::recipes) const NONE: u16 = u16::MAX;

/// The classes of the points of a cloud, or of a thinned copy of one.
pub(in crate::recipes) struct Labelled {
    /// Class of each point, [`NONE`] without one.
    pub(in crate::recipes) labels: Vec<u16>,
    /// For each class the points that may be drawn.
    centres: Vec<Vec<u32>>,
}

impl Labelled {
    /// The classes of the points of a source; `codes` are those of all points of its cloud.
    pub(in crate::recipes) fn new(
        points: &Points,
        codes: &[Option<u8>],
        source: &SampleSource,
        classes: &ClassTable,
    ) -> Self {
        let class = |&point: &u32| {
            let position = codes[point as usize].and_then(|code| classes.position(code));
            position.map_or(NONE, |position| position as u16)
        };
        let labels: Vec<u16> = points.frame.index.iter().map(class).collect();
        let row_of = points.frame.rows(codes.len());
        let mut centres = vec![Vec::new(); classes.len()];
        for candidate in &source.candidates {
            let row = row_of[candidate.point as usize];
            let class = labels.get(row as usize).copied().filter(|&class| class != NONE);
            if let Some(class) = class {
                centres[usize::from(class)].push(row);
            }
        }
        Self { labels, centres }
    }

    /// Whether any point may be drawn.
    pub(in crate::recipes) fn can_be_drawn(&self) -> bool {
        self.centres.iter().any(|points| !points.is_empty())
    }

    /// Feeds classes and points to a checksum.
    pub(in crate::recipes) fn feed(&self, sum: &mut impl Digest) {
        self.labels.iter().for_each(|label| sum.update(label.to_le_bytes()));
        self.centres.iter().flatten().for_each(|point| sum.update(point.to_le_bytes()));
    }
}

/// A labelled point that was drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::recipes) struct Drawn {
    /// Number of the cloud.
    pub(in crate::recipes) scene: usize,
    /// The point in it.
    pub(in crate::recipes) point: u32,
    /// Its class.
    pub(in crate::recipes) class: usize,
}

/// Draws a class, each equally often, then one of its points.
///
/// # Errors
/// If there is none.
pub(in crate::recipes) fn drawn(scenes: &[&Labelled], draws: &mut Stream) -> Result<Drawn> {
    let count = scenes.first().map_or(0, |scene| scene.centres.len());
    let own = |class: usize| scenes.iter().map(move |scene| &scene.centres[class]);
    let classes: Vec<usize> = (0..count).filter(|&class| own(class).any(|points| !points.is_empty())).collect();
    let none = || Error::input("no labelled point to learn from");
    let class = *classes.get(draws.below(classes.len())).ok_or_else(none)?;
    let mut number = draws.below(own(class).map(Vec::len).sum());
    for (scene, points) in own(class).enumerate() {
        if let Some(&point) = points.get(number) {
            return Ok(Drawn { scene, point, class });
        }
        number -= points.len();
    }
    Err(none())
}
