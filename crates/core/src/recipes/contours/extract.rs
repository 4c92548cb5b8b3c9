//! From rated candidates to lines.

use super::classes::Sides;
use super::scaled::{LocalLines, Scale};
use super::stages::ContourStages;
use crate::contours::{Polyline, TraceParams, trace};
use crate::error::Result;
use crate::parallel::Monitor;
use serde::Serialize;

/// A line along an edge.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ContourLine {
    /// The vertices in the coordinates of the cloud; the first is not repeated at the end of a closed line.
    pub vertices: Vec<[f64; 3]>,
    /// Whether a last piece leads from the last vertex to the first.
    pub closed: bool,
    /// Metres.
    pub length: f64,
    /// Probability of the likeliest candidate along each piece of the line, mean by length, 0 to 1.
    pub confidence: f32,
    /// The most frequent classes beside the line, ascending; one twice if there is only one; `None` without classes.
    pub classes: Option<[u8; 2]>,
}

/// The lines of a cloud.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Contours {
    /// The lines.
    pub lines: Vec<ContourLine>,
    /// Edge of a voxel, metres.
    pub voxel: f64,
    /// Number of points that were looked at.
    pub points: usize,
    /// Number of seeds.
    pub seeds: usize,
    /// Number of candidates.
    pub candidates: usize,
    /// Energy of the random field before the first sweep and after each.
    pub energies: Vec<f64>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

impl ContourStages {
    /// The lines that the random field chooses from the candidates.
    ///
    /// # Errors
    /// If a parameter is outside its range, or the work was cancelled.
    pub fn lines(&self, params: &TraceParams, monitor: &Monitor) -> Result<Contours> {
        let mut traced = trace(&self.candidates, &self.probabilities, params, monitor)?;
        traced.polylines.retain(|line| line.confidence >= self.min_confidence);
        let sides = self.codes.as_ref().and_then(|codes| Sides::of(&self.points, codes));
        let classes = match &sides {
            Some(sides) => sides.beside(&traced.polylines, monitor)?,
            None => vec![None; traced.polylines.len()],
        };
        let place = Place { origin: self.points.frame.origin, scale: self.scale };
        let lines = traced.polylines.iter().zip(classes).map(|(line, classes)| place.drawn(line, classes));
        Ok(Contours {
            lines: lines.collect(),
            voxel: self.scale.voxel,
            points: self.points.len(),
            seeds: self.candidates.seeds.len(),
            candidates: self.candidates.list.len(),
            energies: traced.choice.trace,
            warnings: self.warnings.clone(),
        })
    }

    /// The edge of a voxel, metres.
    pub fn voxel(&self) -> f64 {
        self.scale.voxel
    }

    /// Lines in the coordinates of the cloud as lines among the nodes of the candidates.
    pub fn local(&self, lines: &[Vec<[f64; 3]>]) -> Vec<Polyline> {
        let metres = self.scale.metres * self.scale.factor();
        LocalLines { metres, origin: self.points.frame.origin }.of(lines)
    }
}

/// Where scaled lines lie.
pub(super) struct Place {
    pub(super) origin: [f64; 3],
    pub(super) scale: Scale,
}

impl Place {
    /// A line in the coordinates of the cloud.
    pub(super) fn drawn(&self, line: &Polyline, classes: Option<[u8; 2]>) -> ContourLine {
        let factor = self.scale.factor();
        let world =
            |at: &[f32; 3]| std::array::from_fn(|a| (f64::from(at[a]) + self.origin[a]) / (self.scale.metres * factor));
        let mut vertices: Vec<[f64; 3]> = line.vertices.iter().map(world).collect();
        let closed = line.is_closed();
        if closed {
            vertices.pop();
        }
        ContourLine { vertices, closed, length: line.length() / factor, confidence: line.confidence, classes }
    }
}
