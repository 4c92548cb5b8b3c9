//! Features of the point itself: height above the ground, colour, intensity, returns.

use crate::cloud::{Cloud, MetricCloud, Values, names};
use crate::error::{Error, Result};
use crate::features::definition::Feature;
use crate::features::params::FeatureSet;
use crate::parallel::{Monitor, map_watched, watched};

/// One feature of the points themselves, ready for reading.
#[derive(Clone, Debug)]
pub(super) struct Own<'a> {
    values: &'a Values,
    form: Form,
}

#[derive(Clone, Copy, Debug)]
enum Form {
    Times(f64),
    /// v / (v + median).
    Relative(f64),
}

impl Own<'_> {
    /// The feature of a point of the cloud.
    pub(super) fn get(&self, point: u32) -> f32 {
        let value = self.values.get(point as usize);
        match self.form {
            Form::Times(factor) => (value * factor) as f32,
            Form::Relative(median) if value + median > 0.0 => (value / (value + median)) as f32,
            Form::Relative(_) => 0.0,
        }
    }
}

/// The source of a feature of the points themselves.
#[derive(Clone)]
pub(super) enum PointSource<'a> {
    /// One column, transformed.
    One(Own<'a>),
    /// The quotient of two columns.
    Ratio(&'a Values, &'a Values),
    /// Values of all points.
    Given(&'a [f32]),
    /// The cloud does not have it.
    Missing,
}

impl PointSource<'_> {
    /// The feature of a point of the cloud.
    pub(super) fn get(&self, point: u32) -> f32 {
        match self {
            Self::One(own) => own.get(point),
            Self::Given(values) => values[point as usize],
            Self::Missing => f32::NAN,
            Self::Ratio(a, b) => {
                let below = b.get(point as usize);
                if below > 0.0 { (a.get(point as usize) / below) as f32 } else { 0.0 }
            }
        }
    }
}

/// The sources of the set's features of the points themselves, with their keys.
///
/// # Errors
/// If the cloud lacks a column (the message names it and lists the existing ones), or the work was cancelled.
pub(super) fn sources<'a>(
    scene: &MetricCloud<'a>,
    set: &FeatureSet,
    monitor: &Monitor,
) -> Result<Vec<(Feature, PointSource<'a>)>> {
    let full = if set.colour { full_colour(scene.cloud, monitor)? } else { 1.0 };
    let of = |feature| match source(scene, feature, full) {
        Err(_) if set.optional && feature != Feature::Elevation => Ok(PointSource::Missing),
        other => other,
    };
    set.own().map(|d| Ok((d.feature, of(d.feature)?))).collect()
}

/// The sources of the dimensions that the set uses as they are.
///
/// # Errors
/// If the cloud lacks one; the message lists the existing ones.
pub(super) fn dimensions<'a>(cloud: &'a Cloud, set: &FeatureSet) -> Result<Vec<PointSource<'a>>> {
    let of = |name: &String| match column(cloud, name) {
        Err(_) if set.optional => Ok(PointSource::Missing),
        other => other.map(|values| PointSource::One(Own { values, form: Form::Times(1.0) })),
    };
    set.dimensions.iter().map(of).collect()
}

/// The source of a feature; full colour is `full`.
fn source<'a>(scene: &MetricCloud<'a>, feature: Feature, full: f64) -> Result<PointSource<'a>> {
    let cloud = scene.cloud;
    let plain = |name| Ok(PointSource::One(Own { values: column(cloud, name)?, form: Form::Times(1.0) }));
    match feature {
        Feature::Elevation => scene.heights.map(PointSource::Given).ok_or_else(|| {
            Error::parameter("features.height", true, "false: this method does not look for the ground")
        }),
        Feature::Red | Feature::Green | Feature::Blue => channel(cloud, feature.definition().name, full),
        Feature::RelativeIntensity => {
            let values = column(cloud, names::INTENSITY)?;
            Ok(PointSource::One(Own { values, form: Form::Relative(median(values)) }))
        }
        Feature::ReturnRatio => {
            Ok(PointSource::Ratio(column(cloud, names::RETURN_NUMBER)?, column(cloud, names::NUMBER_OF_RETURNS)?))
        }
        other => plain(other.definition().name),
    }
}

/// One of the three channels, where full colour is `full`.
fn channel<'a>(cloud: &'a Cloud, name: &str, full: f64) -> Result<PointSource<'a>> {
    Ok(PointSource::One(Own { values: column(cloud, name)?, form: Form::Times(1.0 / full) }))
}

/// What full red, green or blue is in a cloud: colours are scaled by the range of their type, and 16-bit colours that
/// stay below 256 are 8-bit ones. Looks at the values of the channels that are there, and only as far as it must.
fn full_colour(cloud: &Cloud, monitor: &Monitor) -> Result<f64> {
    let mut full = 1.0;
    for values in names::COLOUR.iter().filter_map(|name| cloud.column(name)).map(|column| &column.values) {
        for piece in watched(values.len(), monitor) {
            let most = piece?.map(|i| values.get(i)).fold(0.0, f64::max);
            if most >= 256.0 {
                return Ok(65535.0);
            }
            if most > 1.0 {
                full = 255.0;
            }
        }
    }
    Ok(full)
}

/// Red, green and blue, 0..=1, of the points `at` of a cloud, scaled like the features of these names.
/// O(n) for n points of the cloud.
///
/// # Errors
/// If the cloud lacks a colour (the message names it and lists the existing columns), or the work was cancelled.
pub fn colours(cloud: &Cloud, at: &[u32], monitor: &Monitor) -> Result<Vec<[f32; 3]>> {
    let full = full_colour(cloud, monitor)?;
    let [red, green, blue] = names::COLOUR;
    let channels = [channel(cloud, red, full)?, channel(cloud, green, full)?, channel(cloud, blue, full)?];
    map_watched(at.len(), monitor, |i| [0, 1, 2].map(|c: usize| channels[c].get(at[i])))
}

fn column<'a>(cloud: &'a Cloud, name: &str) -> Result<&'a Values> {
    cloud.column(name).map(|c| &c.values).ok_or_else(|| {
        let known: Vec<&str> = cloud.columns().iter().map(|c| c.name.as_str()).collect();
        Error::input(format!("a feature needs the column {name}; the cloud has: {}", known.join(", ")))
    })
}

fn median(values: &Values) -> f64 {
    let mut all: Vec<f64> = values.to_f64().into_iter().filter(|v| v.is_finite()).collect();
    if all.is_empty() {
        return 0.0;
    }
    let middle = all.len() / 2;
    *all.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Column;
    use crate::parallel::Monitor;

    #[test]
    fn own_features_have_known_values_and_missing_columns_are_named() {
        let mut cloud = Cloud::from_rows(&[[0.0; 3], [1.0; 3], [2.0; 3]]).unwrap();
        let set = FeatureSet { colour: true, intensity: true, returns: true, ..FeatureSet::default() };
        let features = |cloud: &Cloud, set: &FeatureSet, point: u32| {
            let scene = MetricCloud::new(cloud, None, &Monitor::default())?;
            let features = sources(&scene, set, &Monitor::default())?;
            Ok::<_, Error>(features.iter().map(|(_, source)| source.get(point)).collect::<Vec<f32>>())
        };
        let message = features(&cloud, &set, 0).unwrap_err().to_string();
        assert!(message.contains("Red"), "{message}");
        let optional = FeatureSet { optional: true, ..set.clone() };
        assert!(features(&cloud, &optional, 0).unwrap().iter().all(|v| v.is_nan()));
        assert!(features(&cloud, &FeatureSet { height: true, ..optional }, 0).is_err());
        for name in names::COLOUR {
            cloud.set_column(Column::new(name, Values::U16(vec![0, 51, 255]))).unwrap();
        }
        cloud.set_column(Column::new("Intensity", Values::U16(vec![100, 300, 200]))).unwrap();
        cloud.set_column(Column::new("ReturnNumber", Values::U8(vec![1, 1, 0]))).unwrap();
        cloud.set_column(Column::new("NumberOfReturns", Values::U8(vec![1, 2, 0]))).unwrap();
        let row = |point| features(&cloud, &set, point).unwrap();
        assert_eq!(row(1), [0.2, 0.2, 0.2, 0.6, 1.0, 2.0, 0.5]);
        assert_eq!(row(2)[6], 0.0, "no returns at all");
        // One value above 255, far behind in the last channel, shows that all have 16 bits.
        let mut blue = vec![0; 200_000];
        blue[190_000] = 51_400;
        let mut wide = Cloud::from_rows(&vec![[0.0; 3]; blue.len()]).unwrap();
        for (name, values) in names::COLOUR.into_iter().zip([vec![7; blue.len()], vec![0; blue.len()], blue]) {
            wide.set_column(Column::new(name, Values::U16(values))).unwrap();
        }
        let found = colours(&wide, &[190_000], &Monitor::default()).unwrap();
        assert_eq!(found, [[7.0 / 65535.0, 0.0, 51_400.0 / 65535.0]]);
        let cancelled = Monitor::default();
        cancelled.cancel();
        assert!(matches!(colours(&wide, &[0], &cancelled), Err(Error::Interrupted)));
        let own = FeatureSet { dimensions: vec!["Intensity".into(), "Amplitude".into()], ..FeatureSet::default() };
        assert!(dimensions(&cloud, &own).err().unwrap().to_string().contains("column Amplitude; the cloud has: Red"));
        let optional = FeatureSet { optional: true, ..own };
        let found = dimensions(&cloud, &optional).unwrap();
        assert_eq!(found[0].get(1), 300.0);
        assert!(found[1].get(1).is_nan());
    }
}
