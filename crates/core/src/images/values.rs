//! The colour of each point.

use super::palette::{ramp, segment_colour};
use super::{ColourBy, RenderParams};
use crate::classes::{Class, ClassTable, preset};
use crate::cloud::{Cloud, Values, names};
use crate::error::{Error, Result, nearest_names};
use crate::parallel::{Monitor, watched};
use std::collections::HashMap;

/// Number of sampled points that determine the ends of the ramp.
const SAMPLES: usize = 200_000;
const RIGHT: [u8; 3] = [205, 208, 210];
const WRONG: [u8; 3] = [200, 30, 45];
const APART: [u8; 3] = [232, 230, 222];
/// Colour of codes that are no class.
const UNKNOWN: [u8; 3] = [90, 90, 96];
/// Place of the codes that are no class, behind those of 0 to 255.
const OTHER: usize = 256;

/// The quantity shown by colour, with everything needed to evaluate it.
#[derive(Clone, Debug)]
pub(super) enum Paint<'a> {
    /// Classes by code, and the number of points of each.
    Classes { values: Option<&'a Values>, table: Vec<Class>, counts: Vec<u64> },
    /// Numbers on a colour ramp.
    Ramp { name: String, values: Option<&'a Values>, low: f64, high: f64 },
    /// Segments, each with a colour of its own.
    Segments { values: &'a Values, count: usize },
    /// The points' own colours, with the factor to 0..=255.
    Own { channels: [&'a Values; 3], factor: f64 },
    /// Correct or wrong.
    Agreement(Agreement<'a>),
    /// Which class became which.
    Change(Change<'a>),
}

/// Pairs of classes that are compared: those that differ have colours of their own.
#[derive(Clone, Debug)]
pub(super) struct Change<'a> {
    compared: Agreement<'a>,
    /// Colour of each pair (true code * 256 + other code) that occurs.
    colours: HashMap<u16, [u8; 3]>,
    /// The legend: the most frequent pairs, with names and numbers of points, and the number of other pairs' points.
    lines: Vec<(u16, String, u64)>,
    others: u64,
}

/// Pairs in the legend.
const MOST_PAIRS: usize = 14;

impl<'a> Change<'a> {
    fn new(compared: Agreement<'a>, names: impl Fn(u8) -> String, monitor: &Monitor) -> Result<Self> {
        let mut counts: HashMap<u16, u64> = HashMap::new();
        for points in watched(compared.truth.len(), monitor) {
            points?.filter_map(|i| compared.pair(i)).for_each(|pair| *counts.entry(pair).or_default() += 1);
        }
        let mut sorted: Vec<(u16, u64)> = counts.into_iter().collect();
        sorted.sort_by_key(|&(pair, points)| (std::cmp::Reverse(points), pair));
        let colours = (1..).zip(&sorted).map(|(rank, &(pair, _))| (pair, segment_colour(rank))).collect();
        let line = |&(pair, points): &(u16, u64)| {
            let [from, to] = pair.to_be_bytes();
            (pair, format!("{} > {}", names(from), names(to)), points)
        };
        let lines = sorted.iter().take(MOST_PAIRS).map(line).collect();
        let others = sorted.iter().skip(MOST_PAIRS).map(|(_, points)| points).sum();
        Ok(Self { compared, colours, lines, others })
    }

    fn colour(&self, point: usize) -> [u8; 3] {
        match self.compared.pair(point) {
            Some(pair) => self.colours.get(&pair).copied().unwrap_or(WRONG),
            None => [RIGHT, WRONG, APART][self.compared.kind(point)],
        }
    }

    fn entries(&self) -> Vec<LegendEntry> {
        let [right, wrong, _] = self.compared.counts;
        let share = |n: u64| format!("{:.1} %", 100.0 * n as f64 / (right + wrong).max(1) as f64);
        let line = |(pair, name, points): &(u16, String, u64)| LegendEntry {
            colour: self.colours.get(pair).copied().unwrap_or(WRONG),
            name: name.clone(),
            share: share(*points),
        };
        let same = LegendEntry { colour: RIGHT, name: "as in the truth".into(), share: share(right) };
        let others = LegendEntry { colour: WRONG, name: "other pairs".into(), share: share(self.others) };
        let rest = (self.others > 0).then_some(others);
        std::iter::once(same).chain(self.lines.iter().map(line)).chain(rest).collect()
    }
}

/// Two class columns that are compared.
#[derive(Clone, Debug)]
pub(super) struct Agreement<'a> {
    truth: &'a Values,
    prediction: &'a Values,
    /// The true classes that are compared, by code.
    compared: Vec<bool>,
    /// Number of points that are correct, wrong, and not compared.
    counts: [u64; 3],
}

impl<'a> Agreement<'a> {
    fn new([truth, prediction]: [&'a Values; 2], classes: &[u8], monitor: &Monitor) -> Result<Self> {
        let compared = (0..=255).map(|code| classes.is_empty() || classes.contains(&code)).collect();
        let mut found = Self { truth, prediction, compared, counts: [0; 3] };
        for points in watched(truth.len(), monitor) {
            points?.for_each(|i| found.counts[found.kind(i)] += 1);
        }
        Ok(found)
    }

    /// The true and the other code of a point that is wrong, if both are codes.
    fn pair(&self, point: usize) -> Option<u16> {
        let (truth, named) = (self.truth.get(point), self.prediction.get(point));
        let both = self.kind(point) == 1 && (0.0..256.0).contains(&named) && truth < 256.0;
        both.then(|| u16::from_be_bytes([truth as u8, named as u8]))
    }

    /// 0 correct, 1 wrong, 2 not compared.
    fn kind(&self, point: usize) -> usize {
        let (truth, named) = (self.truth.get(point), self.prediction.get(point));
        // Negative or NaN means no label.
        let chosen = |truth: f64| match self.compared.get(truth as usize) {
            Some(&chosen) => chosen,
            None => self.compared.iter().all(|&chosen| chosen),
        };
        match truth >= 0.0 && chosen(truth) {
            true => usize::from((truth - named).abs() > 0.0 || named.is_nan()),
            false => 2,
        }
    }
}

fn column<'a>(cloud: &'a Cloud, name: &str) -> Result<&'a Values> {
    cloud.column(name).map(|c| &c.values).ok_or_else(|| {
        let known: Vec<&str> = cloud.columns().iter().map(|c| c.name.as_str()).collect();
        let near = nearest_names(known.iter().copied(), name).join(", ");
        Error::input(format!("no column {name} to draw; nearest: {near}; the cloud has: {}", known.join(", ")))
    })
}

/// The class of a code: as the caller calls it, else the cloud.
fn class_of(cloud: &Cloud, classes: &ClassTable, code: u8) -> Class {
    let known = classes.classes().iter().find(|class| class.code == code).cloned();
    known.unwrap_or_else(|| preset::named(code, cloud.scheme.likely(), &cloud.class_names))
}

/// A line of the legend.
pub(super) struct LegendEntry {
    pub(super) colour: [u8; 3],
    pub(super) name: String,
    /// Share of the points in percent; empty for none.
    pub(super) share: String,
}

impl<'a> Paint<'a> {
    pub(super) fn new(
        cloud: &'a Cloud,
        classes: &ClassTable,
        params: &RenderParams,
        monitor: &Monitor,
    ) -> Result<Self> {
        match &params.by {
            ColourBy::Class => Self::classes(cloud, classes, monitor),
            ColourBy::Height => Ok(Self::on_ramp("height".into(), None, cloud, params)),
            ColourBy::Dimension(name) => Ok(Self::on_ramp(name.clone(), Some(column(cloud, name)?), cloud, params)),
            ColourBy::Segments(name) => Self::segments(column(cloud, name)?, monitor),
            ColourBy::Colour => Self::own(cloud, monitor),
            ColourBy::Agreement { truth, prediction, classes } => {
                let columns = [column(cloud, truth)?, column(cloud, prediction)?];
                Ok(Self::Agreement(Agreement::new(columns, classes, monitor)?))
            }
            ColourBy::Change { truth, prediction, classes: asked } => {
                let columns = [column(cloud, truth)?, column(cloud, prediction)?];
                let name = |code: u8| class_of(cloud, classes, code).name;
                Ok(Self::Change(Change::new(Agreement::new(columns, asked, monitor)?, name, monitor)?))
            }
        }
    }

    fn classes(cloud: &'a Cloud, classes: &ClassTable, monitor: &Monitor) -> Result<Self> {
        let values = cloud.column(names::CLASSIFICATION).map(|c| &c.values);
        let mut counts = vec![0u64; OTHER + 1];
        for points in watched(cloud.len(), monitor) {
            points?.for_each(|i| counts[place_of(values, i)] += 1);
        }
        let of = |code: u8| class_of(cloud, classes, code);
        Ok(Self::Classes { values, table: (0..=255).map(of).collect(), counts })
    }

    fn segments(values: &'a Values, monitor: &Monitor) -> Result<Self> {
        let mut ids: Vec<u32> = Vec::new();
        let mut sorted = 0;
        for points in watched(values.len(), monitor) {
            ids.extend(points?.map(|i| values.get(i) as u32).filter(|&s| s > 0));
            if ids.len() >= 2 * sorted {
                ids.sort_unstable();
                ids.dedup();
                sorted = ids.len();
            }
        }
        ids.sort_unstable();
        ids.dedup();
        Ok(Self::Segments { values, count: ids.len() })
    }

    fn on_ramp(name: String, values: Option<&'a Values>, cloud: &Cloud, params: &RenderParams) -> Self {
        let value = |i: usize| values.map_or_else(|| cloud.xyz(i)[2], |v| v.get(i));
        let step = cloud.len().div_ceil(SAMPLES).max(1);
        let mut sample: Vec<f64> = (0..cloud.len()).step_by(step).map(value).filter(|v| v.is_finite()).collect();
        sample.sort_by(f64::total_cmp);
        let at = |share: f64| sample.get((share * sample.len().saturating_sub(1) as f64).round() as usize).copied();
        let (low, high) = params.range.unwrap_or((at(0.02).unwrap_or(0.0), at(0.98).unwrap_or(1.0)));
        Self::Ramp { name, values, low, high: if high > low { high } else { low + 1.0 } }
    }

    fn own(cloud: &'a Cloud, monitor: &Monitor) -> Result<Self> {
        let [r, g, b] = names::COLOUR;
        let channels = [column(cloud, r)?, column(cloud, g)?, column(cloud, b)?];
        let mut largest = 0.0;
        for points in watched(cloud.len(), monitor) {
            let points = points?;
            largest = channels.iter().flat_map(|v| points.clone().map(|i| v.get(i))).fold(largest, f64::max);
        }
        Ok(Self::Own { channels, factor: if largest > 255.0 { 255.0 / 65535.0 } else { 1.0 } })
    }

    /// Colour of a point, 0..=255.
    pub(super) fn colour(&self, cloud: &Cloud, point: u32) -> [f32; 3] {
        let i = point as usize;
        match self {
            Self::Classes { values, table, .. } => {
                table.get(place_of(*values, i)).map_or(UNKNOWN, |class| class.colour).map(f32::from)
            }
            Self::Ramp { values, low, high, .. } => {
                let value = values.map_or_else(|| cloud.xyz(i)[2], |v| v.get(i));
                ramp((value - low) / (high - low))
            }
            Self::Segments { values, .. } => segment_colour(values.get(i) as u32).map(f32::from),
            Self::Own { channels, factor } => channels.map(|v| (v.get(i) * factor) as f32),
            Self::Agreement(compared) => [RIGHT, WRONG, APART][compared.kind(i)].map(f32::from),
            Self::Change(change) => change.colour(i).map(f32::from),
        }
    }

    /// Lines of the legend.
    pub(super) fn entries(&self) -> Vec<LegendEntry> {
        let entry = |colour, name, share| LegendEntry { colour, name, share };
        let percent = |n: u64, all: u64| format!("{:.1} %", 100.0 * n as f64 / all.max(1) as f64);
        match self {
            Self::Classes { table, counts, values: Some(_) } => {
                let all: u64 = counts.iter().sum();
                let seen = table.iter().zip(counts).filter(|(_, n)| **n > 0);
                let named = |class: &Class| format!("{} {}", class.code, class.name);
                let others =
                    (counts[OTHER] > 0).then(|| entry(UNKNOWN, "other codes".into(), percent(counts[OTHER], all)));
                seen.map(|(class, &n)| entry(class.colour, named(class), percent(n, all))).chain(others).collect()
            }
            Self::Segments { count, .. } => {
                vec![entry(segment_colour(1), format!("{count} segments"), String::new())]
            }
            Self::Agreement(Agreement { counts: [right, wrong, apart], .. }) => {
                let share = |n: u64| percent(n, right + wrong);
                let mut lines = vec![
                    entry(RIGHT, "as in the truth".into(), share(*right)),
                    entry(WRONG, "different".into(), share(*wrong)),
                ];
                lines.extend((*apart > 0).then(|| entry(APART, "not compared".into(), String::new())));
                lines
            }
            Self::Change(change) => change.entries(),
            _ => Vec::new(),
        }
    }
}

/// Place of a point's class in the counts: its code, or [`OTHER`].
fn place_of(values: Option<&Values>, point: usize) -> usize {
    match values.map_or(0.0, |v| v.get(point)) {
        code if (0.0..OTHER as f64).contains(&code) => code as usize,
        _ => OTHER,
    }
}
