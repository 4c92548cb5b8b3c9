//! The colour of each point.

use super::palette::{ramp, segment_colour};
use super::{ColourBy, RenderParams};
use crate::classes::{Class, ClassTable, preset};
use crate::cloud::{Cloud, Values, names};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, watched};

/// Number of sampled points that determine the ends of the ramp.
const SAMPLES: usize = 200_000;
const RIGHT: [u8; 3] = [205, 208, 210];
const WRONG: [u8; 3] = [200, 30, 45];
const APART: [u8; 3] = [232, 230, 222];

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

    /// 0 correct, 1 wrong, 2 not compared.
    fn kind(&self, point: usize) -> usize {
        let (truth, named) = (self.truth.get(point), self.prediction.get(point));
        // Negative or NaN means no label.
        match truth >= 0.0 && self.compared[usize::from(truth as u8)] {
            true => usize::from((truth - named).abs() > 0.0 || named.is_nan()),
            false => 2,
        }
    }
}

fn column<'a>(cloud: &'a Cloud, name: &str) -> Result<&'a Values> {
    cloud.column(name).map(|c| &c.values).ok_or_else(|| {
        let known: Vec<&str> = cloud.columns().iter().map(|c| c.name.as_str()).collect();
        Error::input(format!("no column {name} to draw; the cloud has: {}", known.join(", ")))
    })
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
        }
    }

    fn classes(cloud: &'a Cloud, classes: &ClassTable, monitor: &Monitor) -> Result<Self> {
        let values = cloud.column(names::CLASSIFICATION).map(|c| &c.values);
        let mut counts = vec![0u64; 256];
        for points in watched(cloud.len(), monitor) {
            points?.for_each(|i| counts[values.map_or(0, |v| usize::from(v.get(i) as u8))] += 1);
        }
        let of = |code: u8| {
            let known = classes.classes().iter().find(|c| c.code == code).cloned();
            known.unwrap_or_else(|| preset::named(code, cloud.scheme.likely(), &cloud.class_names))
        };
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
                table[values.map_or(0, |v| usize::from(v.get(i) as u8))].colour.map(f32::from)
            }
            Self::Ramp { values, low, high, .. } => {
                let value = values.map_or_else(|| cloud.xyz(i)[2], |v| v.get(i));
                ramp((value - low) / (high - low))
            }
            Self::Segments { values, .. } => segment_colour(values.get(i) as u32).map(f32::from),
            Self::Own { channels, factor } => channels.map(|v| (v.get(i) * factor) as f32),
            Self::Agreement(compared) => [RIGHT, WRONG, APART][compared.kind(i)].map(f32::from),
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
                seen.map(|(class, &n)| entry(class.colour, format!("{} {}", class.code, class.name), percent(n, all)))
                    .collect()
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
            _ => Vec::new(),
        }
    }
}
