//! Codes of classes: their names, those of the input that are kept, and those that are written over.

use super::Context;
use scansion_core::classes::ClassTable;
use scansion_core::cloud::{Cloud, CodeScheme, names};
use serde::Serialize;
use std::collections::BTreeMap;

/// A class of the input that is written over.
#[derive(Debug, Serialize)]
pub(crate) struct Replaced {
    code: u32,
    name: String,
    points: u64,
}

/// The name of a code; codes of no class are those of unclassified, stray and kept points.
pub(crate) fn name_of(code: u8, classes: &ClassTable) -> String {
    let other = ClassTable::from_codes(&[code]);
    let class = classes.position(code).map_or(other.classes().first(), |c| classes.classes().get(c));
    class.map_or_else(String::new, |class| class.name.clone())
}

/// The codes of points without a class.
pub(crate) fn unclassified(cloud: &Cloud) -> &'static [u8] {
    match cloud.scheme {
        CodeScheme::Own | CodeScheme::S3dis => &[0, 1],
        known => known.unlabelled(),
    }
}

/// Classes of the input that are written over, but are none of the `known` ones, which a result may have, and not `open`
/// to be named.
pub(crate) fn replaced(cloud: &Cloud, codes: &[u8], known: &[u8], open: &[u8]) -> Vec<Replaced> {
    let Some(old) = cloud.column(names::CLASSIFICATION).map(|c| &c.values) else { return Vec::new() };
    let (mut counts, mut large) = ([0u64; 256], BTreeMap::<u32, u64>::new());
    for (i, &new) in codes.iter().enumerate() {
        let old = old.get(i);
        if old > 255.0 {
            *large.entry(old as u32).or_default() += 1;
        } else {
            counts[usize::from(old as u8)] += u64::from(old as u8 != new);
        }
    }
    let lost =
        (0u8..=255).zip(counts).filter(|(code, points)| *points > 0 && !known.contains(code) && !open.contains(code));
    let scheme = |code| ClassTable::named(&[code], cloud.scheme, &cloud.class_names);
    let lost = lost.map(|(code, points)| Replaced { code: code.into(), name: name_of(code, &scheme(code)), points });
    let large = large.into_iter().map(|(code, points)| Replaced { code, name: format!("class {code}"), points });
    lost.chain(large).collect()
}

/// Says which classes of the input are lost and why, and how to keep them; `None` if none is.
pub(crate) fn lost(why: &str, replaced: &[Replaced]) -> Option<String> {
    let text = |class: &Replaced| format!("{} {} ({} points)", class.code, class.name, class.points);
    let list = replaced.iter().map(text).collect::<Vec<_>>().join(", ");
    let kept = replaced.iter().filter(|class| class.code <= 255).map(|class| class.code.to_string());
    let kept = kept.collect::<Vec<_>>().join(",");
    let advice = if kept.is_empty() { String::new() } else { format!("; --keep {kept} keeps them") };
    (!replaced.is_empty()).then(|| format!("classes that {why} were replaced: {list}{advice}"))
}

/// The codes of `--keep` that no point of the inputs so far has.
pub(crate) struct Kept {
    /// Whether an input was read.
    read: bool,
    absent: Vec<u8>,
}

impl Kept {
    pub(crate) fn new(codes: &[u8]) -> Self {
        Self { read: false, absent: codes.to_vec() }
    }

    /// Whether an input was read.
    pub(crate) fn read(&self) -> bool {
        self.read
    }

    /// Looks for the codes in an input.
    pub(crate) fn look(&mut self, cloud: &Cloud) {
        self.read = true;
        let values = cloud.column(names::CLASSIFICATION).map(|column| &column.values);
        let has = |code: u8| values.is_some_and(|v| (0..v.len()).any(|i| (v.get(i) - f64::from(code)).abs() < 0.5));
        self.absent.retain(|&code| !has(code));
    }

    /// Warns of the codes that no input has.
    pub(crate) fn tell(&self, context: &Context<'_>) {
        if self.read && !self.absent.is_empty() {
            let codes = self.absent.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
            let text =
                format!("--keep {codes}: no point of the input has this class (--keep takes codes of the input)");
            context.printer.warning(&text);
        }
    }
}
