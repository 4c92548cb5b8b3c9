//! The points of a survey, and which of them are ground.

use super::params::{GroundChoice, ProductParams};
use crate::cloud::{Cloud, CodeScheme, MetricCloud, Points, Values, names};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::terrain::ground_points;

/// Classes of noise in ASPRS codes: low and high points.
const NOISE: [u8; 2] = [7, 18];

/// Class of ground in ASPRS codes.
const GROUND: u8 = 2;

/// Classes that are noise, if the user names none: those of ASPRS codes; other codes have none.
pub fn noise_classes(scheme: CodeScheme) -> &'static [u8] {
    match scheme {
        CodeScheme::Asprs => &NOISE,
        _ => &[],
    }
}

/// The points of a cloud without noise, withheld and stray points, and which of them are ground.
#[derive(Clone, Debug)]
pub struct Survey {
    /// The points, in metres.
    pub points: Points,
    /// Whether each is ground; at least one is, unless the ground was not asked for.
    pub is_ground: Vec<bool>,
    /// How many ground points there are and how they were found, and how many points are withheld, for the user; empty if
    /// there is nothing to tell.
    pub note: String,
}

impl Survey {
    /// Finds the ground points of a cloud. O(points), and that of [`ground_points`] if the ground filter is used.
    ///
    /// # Errors
    /// If there is no point or no ground point, a class is requested and the cloud has none, a parameter is out of
    /// range, or the work was cancelled.
    pub fn new(scene: &MetricCloud<'_>, params: &ProductParams, monitor: &Monitor) -> Result<Self> {
        let Self { points, note: withheld, .. } = Self::of_points(scene, params, monitor)?;
        let mut survey = Self::with_ground(points, Codes::of(scene.cloud), params, monitor)?;
        if !withheld.is_empty() {
            survey.note = format!("{}; {withheld}", survey.note);
        }
        Ok(survey)
    }

    /// The points alone, for a surface model: no point is ground. O(points).
    ///
    /// # Errors
    /// If there is no point, a parameter is out of range, or the work was cancelled.
    pub fn of_points(scene: &MetricCloud<'_>, params: &ProductParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        let codes = Codes::of(scene.cloud);
        let noise = params.noise.as_deref().unwrap_or_else(|| noise_classes(scene.cloud.scheme));
        let all = scene.some_points(monitor)?;
        let withheld = Withheld::of(scene.cloud);
        let left_out = |point: u32| withheld.has(point) || codes.among(point, noise);
        let rows = 0..all.len() as u32;
        let kept: Vec<u32> = rows.filter(|&row| !left_out(all.frame.index[row as usize])).collect();
        let note = match all.frame.index.iter().filter(|&&point| withheld.has(point)).count() {
            0 => String::new(),
            1 => "1 withheld point is left out".into(),
            count => format!("{count} withheld points are left out"),
        };
        let points = if kept.len() == all.len() { all } else { all.select(&kept, monitor)? };
        if points.is_empty() {
            let text = format!("all points are noise (classes {noise:?}) or withheld: there is no terrain");
            return Err(Error::input(text));
        }
        Ok(Self { is_ground: vec![false; points.len()], points, note })
    }

    fn with_ground(points: Points, codes: Codes<'_>, params: &ProductParams, monitor: &Monitor) -> Result<Self> {
        let of = |wanted: &[u8]| -> Vec<bool> { points.frame.index.iter().map(|&i| codes.among(i, wanted)).collect() };
        let (is_ground, how) = match &params.ground {
            GroundChoice::Classes(wanted) => (of(wanted), format!("of {}", listed(wanted))),
            GroundChoice::Filter => (ground_points(&points, &params.filter, monitor)?, "by the ground filter".into()),
            GroundChoice::Auto => match of(&[GROUND]) {
                known if known.contains(&true) => (known, format!("of {}", listed(&[GROUND]))),
                _ => {
                    let how = format!("by the ground filter, because no point has class {GROUND}");
                    (ground_points(&points, &params.filter, monitor)?, how)
                }
            },
        };
        let count = is_ground.iter().filter(|&&ground| ground).count();
        if count == 0 {
            let advice = "name the classes that are ground, or use the ground filter";
            return Err(Error::input(format!("no ground point {how}: {advice}")));
        }
        let note = format!("ground: {count} of {} points, {how}", points.len());
        Ok(Self { points, is_ground, note })
    }
}

/// The class codes of a cloud, if it has any.
#[derive(Clone, Copy)]
pub(super) struct Codes<'a>(Option<&'a Values>);

impl<'a> Codes<'a> {
    pub(super) fn of(cloud: &'a Cloud) -> Self {
        Self(cloud.column(names::CLASSIFICATION).map(|column| &column.values))
    }

    /// Whether the code of a point of the cloud is one of these.
    pub(super) fn among(self, point: u32, wanted: &[u8]) -> bool {
        let has = |codes: &Values| wanted.iter().any(|&code| (codes.get(point as usize) - f64::from(code)).abs() < 0.5);
        !wanted.is_empty() && self.0.is_some_and(has)
    }
}

/// The marks of withheld points, if a cloud has any.
#[derive(Clone, Copy)]
pub(super) struct Withheld<'a>(Option<&'a Values>);

impl<'a> Withheld<'a> {
    pub(super) fn of(cloud: &'a Cloud) -> Self {
        Self(cloud.column(names::WITHHELD).map(|column| &column.values))
    }

    /// Whether a point of the cloud is withheld.
    pub(super) fn has(self, point: u32) -> bool {
        self.0.is_some_and(|marks| marks.get(point as usize) > 0.0)
    }
}

/// `class 2`, `classes 2, 9`.
pub(super) fn listed(codes: &[u8]) -> String {
    let word = if codes.len() == 1 { "class" } else { "classes" };
    format!("{word} {}", codes.iter().map(u8::to_string).collect::<Vec<_>>().join(", "))
}
