//! Labels of a cloud as class codes; unlabelled points are counted.

pub(in crate::recipes) mod file;
mod spread;

use crate::classes::{ClassTable, LabelMap};
use crate::cloud::{ClassNames, Cloud, CodeScheme, names};
use crate::error::{Error, Result};

/// Parameters of reading labels from a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelParams {
    /// Column with the codes.
    pub dimension: String,
    /// Mapping of codes, applied first; it also gives codes above 255 one in 0..=255.
    pub map: LabelMap,
    /// Codes (after mapping) that mean "unlabelled". `None`: in the column `Classification` those of the cloud's
    /// [`CodeScheme`] (LAS: 0 and 1; Semantic3D: 0; others: none), in other columns none.
    pub unlabelled: Option<Vec<u8>>,
    /// If not empty, only these codes (after mapping) count; all others are unlabelled.
    pub classes: Vec<u8>,
}

impl Default for LabelParams {
    fn default() -> Self {
        Self {
            dimension: names::CLASSIFICATION.into(),
            map: LabelMap::default(),
            unlabelled: None,
            classes: Vec::new(),
        }
    }
}

impl LabelParams {
    /// The list that the codes in that column belong to: that of the cloud, but for other columns than `Classification`
    /// only if it is not simply that of the file format.
    pub fn scheme(&self, cloud: &Cloud) -> CodeScheme {
        let of_format = [CodeScheme::Asprs, CodeScheme::Semantic3d].contains(&cloud.scheme);
        if self.dimension == names::CLASSIFICATION || !of_format { cloud.scheme } else { CodeScheme::Own }
    }

    /// The codes (after mapping) that mean "unlabelled" in a cloud. A code in `classes` is always a class.
    pub fn unlabelled_in(&self, cloud: &Cloud) -> Vec<u8> {
        match &self.unlabelled {
            Some(codes) => codes.clone(),
            None => {
                let codes = self.scheme(cloud).unlabelled().iter().copied();
                codes.filter(|code| !self.classes.contains(code)).collect()
            }
        }
    }

    fn validate(&self) -> Result<()> {
        let both = self.unlabelled.iter().flatten().find(|code| self.classes.contains(code));
        match both {
            Some(code) => {
                Err(Error::parameter("unlabelled", code, "codes that are not among the classes that are asked for"))
            }
            None => Ok(()),
        }
    }
}

/// Lines along the edges of a cloud, in its coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EdgeLines {
    /// The lines.
    pub lines: Vec<Vec<[f64; 3]>>,
    /// Lines that may be edges or not, such as those that were scanned too sparsely; nothing is learned from points near
    /// them.
    pub unsure: Vec<Vec<[f64; 3]>>,
}

/// One label for each point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Labels {
    /// Code of each point; `None` if it is unlabelled.
    pub codes: Vec<Option<u8>>,
    /// Number of points without a label.
    pub unlabelled: u64,
    /// The list that the codes belong to, which gives the names of the classes.
    pub scheme: CodeScheme,
    /// Names that take precedence over those of the list.
    pub names: ClassNames,
    /// The lines that the labels follow from, for the recipe that learns lines; none otherwise.
    pub edges: EdgeLines,
}

impl Labels {
    /// The labels at `indices`, in that order.
    pub fn select(&self, indices: &[u32]) -> Self {
        self.changed(indices.iter().map(|&i| self.codes[i as usize]).collect())
    }

    /// Other codes of the same list.
    pub(in crate::recipes) fn changed(&self, codes: Vec<Option<u8>>) -> Self {
        Self { names: self.names.clone(), edges: self.edges.clone(), ..Self::new(codes, self.scheme) }
    }

    /// The classes with these codes.
    pub fn class_table(&self, codes: &[u8]) -> ClassTable {
        ClassTable::named(codes, self.scheme, &self.names)
    }

    /// The labels of these points, as they are known.
    pub(in crate::recipes) fn of(&self, points: &[u32]) -> Vec<Option<u8>> {
        points.iter().map(|&i| self.codes.get(i as usize).copied().flatten()).collect()
    }

    /// Labels from codes; counts the unlabelled points.
    pub fn new(codes: Vec<Option<u8>>, scheme: CodeScheme) -> Self {
        let unlabelled = codes.iter().filter(|c| c.is_none()).count() as u64;
        Self { codes, unlabelled, scheme, names: ClassNames::new(), edges: EdgeLines::default() }
    }

    /// Number of points with each code.
    pub fn counts(&self) -> [u64; 256] {
        let mut counts = [0; 256];
        self.codes.iter().flatten().for_each(|&c| counts[usize::from(c)] += 1);
        counts
    }
}

/// Reads the labels of a cloud. Negative values and NaN always count as unlabelled.
///
/// # Errors
/// If the column is absent (the message lists the columns), a value is not a whole number in 0..=255, or a code is
/// given both as a class and as unlabelled.
pub fn read_labels(cloud: &Cloud, params: &LabelParams) -> Result<Labels> {
    params.validate()?;
    let column = cloud.column(&params.dimension).ok_or_else(|| {
        let known: Vec<&str> = cloud.columns().iter().map(|c| c.name.as_str()).collect();
        Error::input(format!("no column {} to take labels from; the cloud has: {}", params.dimension, known.join(", ")))
    })?;
    let skipped = params.unlabelled_in(cloud);
    let counts = |c: &u8| !skipped.contains(c) && (params.classes.is_empty() || params.classes.contains(c));
    let label = |i| Ok(code_of(column.values.get(i), i, params)?.filter(counts));
    let codes = (0..cloud.len()).map(label).collect::<Result<Vec<_>>>()?;
    Ok(Labels { names: cloud.class_names.clone(), ..Labels::new(codes, params.scheme(cloud)) })
}

/// A cloud and its labels.
#[derive(Clone, Debug)]
pub struct LabelledCloud {
    /// The cloud.
    pub cloud: Cloud,
    /// One label for each of its points.
    pub labels: Labels,
}

/// The code of a value, mapped.
fn code_of(value: f64, point: usize, params: &LabelParams) -> Result<Option<u8>> {
    if value.is_nan() || value < 0.0 {
        return Ok(None);
    }
    match params.map.of_value(value) {
        Some(code) => Ok(Some(code)),
        None => Err(Error::input(format!(
            "{} of point {point} is {value}; labels are whole numbers in 0..=255, others need a --map, e.g. {value}=5",
            params.dimension
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};

    fn cloud(values: Vec<f32>, scheme: CodeScheme) -> Cloud {
        let mut cloud = Cloud::from_rows(&vec![[0.0; 3]; values.len()]).unwrap();
        cloud.set_column(Column::new("other", Values::F32(values.clone()))).unwrap();
        cloud.set_column(Column::new("Classification", Values::F32(values))).unwrap();
        cloud.scheme = scheme;
        cloud
    }

    fn codes(scheme: CodeScheme, params: &LabelParams) -> Vec<Option<u8>> {
        read_labels(&cloud(vec![-1.0, 0.0, 1.0, 2.0, f32::NAN], scheme), params).unwrap().codes
    }

    #[test]
    fn what_is_unlabelled_depends_on_the_list_of_codes() {
        let auto = LabelParams::default();
        assert_eq!(codes(CodeScheme::Asprs, &auto), [None, None, None, Some(2), None]);
        assert_eq!(codes(CodeScheme::Semantic3d, &auto), [None, None, Some(1), Some(2), None]);
        assert_eq!(codes(CodeScheme::Own, &auto), [None, Some(0), Some(1), Some(2), None]);
        let other = LabelParams { dimension: "other".into(), ..auto.clone() };
        assert_eq!(codes(CodeScheme::Asprs, &other), [None, Some(0), Some(1), Some(2), None]);
        let asked = LabelParams { unlabelled: Some(vec![2]), ..auto.clone() };
        assert_eq!(codes(CodeScheme::Asprs, &asked), [None, Some(0), Some(1), None, None]);
        let none = LabelParams { unlabelled: Some(Vec::new()), ..auto.clone() };
        assert_eq!(codes(CodeScheme::Asprs, &none), [None, Some(0), Some(1), Some(2), None]);
        let classes = LabelParams { classes: vec![1, 2], ..auto };
        assert_eq!(codes(CodeScheme::Asprs, &classes), [None, None, Some(1), Some(2), None]);
        let both = LabelParams { unlabelled: Some(vec![1]), ..classes };
        assert!(read_labels(&cloud(vec![1.0], CodeScheme::Own), &both).is_err());
    }

    #[test]
    fn codes_are_mapped_before_they_are_left_out() {
        let params = LabelParams { map: "4=5,1=6,2=1".parse().unwrap(), ..LabelParams::default() };
        let labels = read_labels(&cloud(vec![-1.0, 2.0, 1.0, 4.0, f32::NAN], CodeScheme::Asprs), &params).unwrap();
        assert_eq!(labels.codes, [None, None, Some(6), Some(5), None]);
        assert_eq!(labels.unlabelled, 3);
    }

    #[test]
    fn labels_out_of_range_are_refused_with_point_and_value() {
        for bad in [256.0, 2.5] {
            let cloud = cloud(vec![2.0, bad], CodeScheme::Own);
            let message = read_labels(&cloud, &LabelParams::default()).unwrap_err().to_string();
            assert!(message.contains("point 1") && message.contains(&bad.to_string()), "{message}");
        }
        assert!(read_labels(&Cloud::from_rows(&[]).unwrap(), &LabelParams::default()).is_err());
    }
}
