//! What `scansion classify` says about its result: as a table, JSON or CSV.

use super::codes::{Replaced, lost, name_of};
use crate::args::Format;
use scansion_core::classes::ClassTable;
use scansion_core::recipes::Classified;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;

/// The classes that are written for a file.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    /// The file.
    output: String,
    points: usize,
    /// Points per square metre.
    density: f64,
    classes: Vec<ClassShare>,
    /// Classes of the input that are written over although the model does not know them.
    replaced: Vec<Replaced>,
    /// Share of the feature values outside the middle 90 % of those in training, and beyond all of them.
    outside: Option<f64>,
    beyond: Option<f64>,
    warnings: Vec<String>,
}

/// A class of the output.
#[derive(Debug, Serialize)]
struct ClassShare {
    code: u8,
    name: String,
    points: u64,
    share: f64,
    /// Mean over its points.
    confidence: f64,
}

impl Summary {
    /// Counts the codes that are written.
    pub(crate) fn new(output: &Path, codes: &[u8], result: &Classified, classes: &ClassTable) -> Self {
        let mut sums = vec![(0u64, 0.0f64); 256];
        for (&code, &confidence) in codes.iter().zip(&result.confidence) {
            let (count, sum) = &mut sums[usize::from(code)];
            (*count, *sum) = (*count + 1, *sum + f64::from(confidence));
        }
        let share = |(code, (points, sum)): (u8, (u64, f64))| ClassShare {
            code,
            name: name_of(code, classes),
            points,
            share: points as f64 / codes.len() as f64,
            confidence: sum / points as f64,
        };
        let found = (0u8..=255).zip(sums).filter(|(_, (points, _))| *points > 0);
        Self {
            output: output.display().to_string(),
            points: codes.len(),
            density: result.density,
            classes: found.map(share).collect(),
            replaced: Vec::new(),
            outside: result.fit.map(|fit| fit.outside),
            beyond: result.fit.map(|fit| fit.beyond),
            warnings: result.warnings.clone(),
        }
    }

    /// The same, with the classes of the input that are written over.
    pub(crate) fn replacing(self, replaced: Vec<Replaced>) -> Self {
        Self { replaced, ..self }
    }

    /// What replaces which classes of the input, and how to keep them; `None` if none is lost.
    pub(crate) fn notice(&self) -> Option<String> {
        lost("the model does not know", &self.replaced).map(|text| format!("{}: {text}", self.output))
    }

    /// What goes to stdout; nothing if a table on stderr was asked for.
    ///
    /// One JSON object a line; the header of CSV only before the `first` file.
    pub(crate) fn data(&self, format: Format, first: bool) -> Option<String> {
        match format {
            Format::Table => None,
            Format::Json => serde_json::to_string(self).ok(),
            Format::Csv if first => Some(format!("file,code,class,points,share,confidence\n{}", self.csv())),
            Format::Csv => Some(self.csv()),
        }
    }

    fn csv(&self) -> String {
        let mut text = String::new();
        for ClassShare { code, name, points, share, confidence } in &self.classes {
            let [file, name] = [&self.output, name].map(|text| format!("\"{}\"", text.replace('"', "\"\"")));
            let _ = writeln!(text, "{file},{code},{name},{points},{share},{confidence}");
        }
        text
    }

    /// A table of the classes, and how the cloud compares with the training.
    pub(crate) fn table(&self) -> String {
        let mut text = format!("{:>5}  {:<20} {:>12} {:>8} {:>11}\n", "code", "class", "points", "share", "confidence");
        for ClassShare { code, name, points, share, confidence } in &self.classes {
            let _ = writeln!(text, "{code:>5}  {name:<20} {points:>12} {:>6.2} % {confidence:>11.2}", 100.0 * share);
        }
        if let (Some(outside), Some(beyond)) = (self.outside, self.beyond) {
            let _ = writeln!(
                text,
                "feature values: {:.0} % outside the middle 90 % of those in training, {:.1} % beyond all of them",
                100.0 * outside,
                100.0 * beyond
            );
        }
        text
    }
}
