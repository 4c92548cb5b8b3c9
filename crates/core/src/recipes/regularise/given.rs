//! Regularisation of a cloud with dimensions that hold class probabilities, from any program.

use super::{Probabilities, RegulariseParams, regularise};
use crate::classes::ClassTable;
use crate::cloud::{Cloud, CodeScheme, MetricCloud, names};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, watched};
use std::str::FromStr;

/// A class, and the dimension with its probability at each point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassDimension {
    /// Name of the dimension.
    pub name: String,
    /// Code of the class.
    pub code: u8,
}

impl FromStr for ClassDimension {
    type Err = Error;

    /// Reads `NAME=CODE`.
    fn from_str(text: &str) -> Result<Self> {
        let bad = || Error::parameter("probabilities", text, "DIMENSION=CODE, e.g. P_roof=6, codes 0..255");
        let (name, code) = text.rsplit_once('=').ok_or_else(bad)?;
        match (name.trim(), code.trim().parse()) {
            ("", _) | (_, Err(_)) => Err(bad()),
            (name, Ok(code)) => Ok(Self { name: name.into(), code }),
        }
    }
}

impl ClassDimension {
    /// The dimensions of a file that are named as `classify --probabilities` names them: `P_` and the name of a class of
    /// the ASPRS list (`class N` in formats without one), or its code. `known` are further classes.
    ///
    /// # Errors
    /// If there are fewer than two, or one has neither the name nor the code of a class.
    pub fn among(dimensions: &[String], known: &ClassTable) -> Result<Vec<Self>> {
        let codes: Vec<u8> = (0..=255).collect();
        let lists = [CodeScheme::Asprs, CodeScheme::Own].map(|scheme| ClassTable::of_scheme(&codes, scheme));
        let code = |name: &str| {
            let mut all = known.classes().iter().chain(lists.iter().flat_map(ClassTable::classes));
            let named = all.find(|class| names::probability_of(&class.name) == name).map(|class| class.code);
            named.or_else(|| name.strip_prefix("P_")?.parse().ok())
        };
        let own = dimensions.iter().filter(|name| name.starts_with("P_"));
        let found = own.map(|name| match code(name) {
            Some(code) => Ok(Self { name: name.clone(), code }),
            None => Err(Error::parameter("probabilities", name, "a name or code of a class after P_, or NAME=CODE")),
        });
        let found = found.collect::<Result<Vec<_>>>()?;
        match found.len() {
            0 | 1 => Err(Error::input(format!(
                "{} of the dimensions hold probabilities (P_...), at least 2 are needed; classify --probabilities writes \
                 them, or name them as NAME=CODE",
                found.len()
            ))),
            _ => Ok(found),
        }
    }
}

/// Labels from the probabilities in a cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegularisedCloud {
    /// Code of each point.
    pub codes: Vec<u8>,
    /// Probability of its class on which the decision is based, 0..1.
    pub confidence: Vec<f32>,
    /// Number of points whose class is not their own most probable one.
    pub changed: u64,
    /// Energy of the labels, if the method minimises one.
    pub energy: Option<f64>,
}

/// Labels that are consistent among neighbours, from class probabilities in a cloud's dimensions.
///
/// The values of a point are divided by their sum, so that percentages and counts of votes will do; where all are 0, any
/// class is as probable as any other. Points that are stray or not finite have their most probable class. O(points x
/// classes) memory.
///
/// # Errors
/// If a dimension is missing, a value is negative or not finite, a class is named twice, a parameter is out of range, or the
/// work was cancelled.
pub fn regularise_cloud(
    scene: &MetricCloud<'_>,
    classes: &[ClassDimension],
    params: &RegulariseParams,
    monitor: &Monitor,
) -> Result<RegularisedCloud> {
    let own = shares(scene.cloud, classes, monitor)?;
    let points = scene.some_points(monitor)?;
    let width = classes.len();
    let row = |i: usize| &own[i * width..][..width];
    let mut values = Vec::with_capacity(points.len() * width);
    points.frame.index.iter().for_each(|&i| values.extend_from_slice(row(i as usize)));
    let found = regularise(&points.positions, Probabilities { values: &values, classes: width }, params, monitor)?;
    let best: Vec<usize> = own.chunks_exact(width).map(crate::classification::argmax).collect();
    let mut result = RegularisedCloud {
        codes: best.iter().map(|&c| classes[c].code).collect(),
        confidence: best.iter().enumerate().map(|(i, &c)| row(i)[c]).collect(),
        changed: 0,
        energy: found.energy,
    };
    for (place, &i) in points.frame.index.iter().enumerate() {
        let (i, label) = (i as usize, usize::from(found.labels[place]));
        result.changed += u64::from(label != best[i]);
        result.codes[i] = classes[label].code;
        result.confidence[i] = found.row(place, width)[label];
    }
    Ok(result)
}

/// Row-major `points x classes`: the values of the dimensions, each row with the sum 1.
fn shares(cloud: &Cloud, classes: &[ClassDimension], monitor: &Monitor) -> Result<Vec<f32>> {
    if classes.len() < 2 {
        return Err(Error::parameter("probabilities", classes.len(), "2 classes or more"));
    }
    for (i, class) in classes.iter().enumerate() {
        if let Some(other) = classes[..i].iter().find(|other| other.code == class.code) {
            let text = format!("{}={}", class.name, class.code);
            return Err(Error::parameter("probabilities", text, format!("another code than that of {}", other.name)));
        }
    }
    let column = |class: &ClassDimension| {
        let found = cloud.column(&class.name).map(|column| &column.values);
        found.ok_or_else(|| Error::input(format!("the cloud has no dimension {}", class.name)))
    };
    let columns = classes.iter().map(column).collect::<Result<Vec<_>>>()?;
    let mut all = Vec::with_capacity(cloud.len() * classes.len());
    for piece in watched(cloud.len(), monitor) {
        for i in piece? {
            let start = all.len();
            for (values, class) in columns.iter().zip(classes) {
                let value = values.get(i);
                if !(value >= 0.0 && value.is_finite()) {
                    let text = format!("{}: found {value} at point {i}, expected 0 or more", class.name);
                    return Err(Error::input(text));
                }
                all.push(value as f32);
            }
            normalise(&mut all[start..]);
        }
    }
    Ok(all)
}

fn normalise(row: &mut [f32]) {
    let sum: f64 = row.iter().map(|&value| f64::from(value)).sum();
    let even = 1.0 / row.len() as f32;
    row.iter_mut().for_each(|value| *value = if sum > 0.0 { (f64::from(*value) / sum) as f32 } else { even });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};
    use crate::recipes::Regularise;

    fn cloud(rows: &[[f64; 3]], columns: &[(&str, Vec<f32>)]) -> Cloud {
        let mut cloud = Cloud::from_rows(rows).unwrap();
        for (name, values) in columns {
            cloud.set_column(Column::new(*name, Values::F32(values.clone()))).unwrap();
        }
        cloud
    }

    fn classes() -> Vec<ClassDimension> {
        ["P_ground=2", "votes=6"].map(|text| text.parse().unwrap()).to_vec()
    }

    fn run(cloud: &Cloud, method: Regularise) -> Result<RegularisedCloud> {
        let params = RegulariseParams { method, neighbours: 2, ..RegulariseParams::default() };
        let scene = MetricCloud::new(cloud, None, &Monitor::default()).unwrap();
        regularise_cloud(&scene, &classes(), &params, &Monitor::default())
    }

    #[test]
    fn votes_become_shares_and_the_field_outvotes_one_point() {
        let rows: Vec<[f64; 3]> = (0..9).map(|i| [f64::from(i) * 0.1, 0.0, 0.0]).collect();
        // The point in the middle is for the other class by 6 votes of 10.
        let votes = (0..9).map(|i| if i == 4 { 6.0 } else { 1.0 }).collect();
        let ground = (0..9).map(|i| if i == 4 { 4.0 } else { 9.0 }).collect();
        let cloud = cloud(&rows, &[("P_ground", ground), ("votes", votes)]);
        let alone = run(&cloud, Regularise::None).unwrap();
        assert_eq!((alone.codes[4], alone.changed), (6, 0));
        // A hundredth of each row is shared evenly.
        let smoothed = |p: f32| 0.99 * p + 0.005;
        assert!((alone.confidence[4] - smoothed(0.6)).abs() < 1e-6, "{}", alone.confidence[4]);
        assert!((alone.confidence[0] - smoothed(0.9)).abs() < 1e-6);
        let field = run(&cloud, Regularise::PointCrf).unwrap();
        assert_eq!((field.codes, field.changed), (vec![2; 9], 1));
    }

    #[test]
    fn points_without_values_follow_their_neighbours_and_wrong_values_are_named() {
        let rows: Vec<[f64; 3]> = (0..5).map(|i| [f64::from(i) * 0.1, 0.0, 0.0]).collect();
        let none =
            cloud(&rows, &[("P_ground", vec![0.0, 0.1, 0.0, 0.1, 0.1]), ("votes", vec![0.9, 0.8, 0.0, 0.9, 0.8])]);
        assert_eq!(run(&none, Regularise::PointCrf).unwrap().codes, [6; 5]);
        let bad = cloud(&rows, &[("P_ground", vec![0.5; 5]), ("votes", vec![0.5, 0.5, -1.0, 0.5, 0.5])]);
        assert!(run(&bad, Regularise::None).unwrap_err().to_string().contains("votes: found -1 at point 2"));
        let missing = cloud(&rows, &[("P_ground", vec![0.5; 5])]);
        assert!(run(&missing, Regularise::None).unwrap_err().to_string().contains("no dimension votes"));
    }

    #[test]
    fn dimensions_are_found_by_the_names_and_codes_of_classes() {
        let names = ["P_Ground", "P_ground", "P_high_vegetation", "P_64", "P_class_9", "Confidence"].map(String::from);
        let found = ClassDimension::among(&names[1..], &ClassTable::default()).unwrap();
        assert_eq!(found.iter().map(|class| class.code).collect::<Vec<_>>(), [2, 5, 64, 9]);
        let own: ClassTable = "7=Ground,2".parse().unwrap();
        assert_eq!(ClassDimension::among(&names[..2], &own).unwrap()[0].code, 7);
        assert!(ClassDimension::among(&names[..2], &ClassTable::default()).is_err());
        assert!(ClassDimension::among(&names[5..], &ClassTable::default()).unwrap_err().to_string().contains("0 of"));
        for bad in ["P_roof", "=6", "roof=256"] {
            assert!(bad.parse::<ClassDimension>().is_err(), "{bad}");
        }
    }
}
