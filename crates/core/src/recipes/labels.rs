//! Labels of a cloud as codes, with the unlabelled points counted.

use crate::classes::LabelMap;
use crate::cloud::{Cloud, names};
use crate::error::{Error, Result};

/// How labels are taken from a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelParams {
    /// Column that holds the codes.
    pub dimension: String,
    /// Applied to the codes before anything else.
    pub map: LabelMap,
    /// Codes (after mapping) that mean "nobody has said".
    pub unlabelled: Vec<u8>,
    /// If not empty, only these codes (after mapping) count; all others are unlabelled.
    pub classes: Vec<u8>,
}

impl Default for LabelParams {
    fn default() -> Self {
        Self {
            dimension: names::CLASSIFICATION.into(),
            map: LabelMap::default(),
            unlabelled: vec![0, 1],
            classes: Vec::new(),
        }
    }
}

/// One label a point.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Labels {
    /// Code of each point; `None` where it is unlabelled.
    pub codes: Vec<Option<u8>>,
    /// Points without a label.
    pub unlabelled: u64,
}

impl Labels {
    /// The labels at `indices`, in that order.
    pub fn select(&self, indices: &[u32]) -> Self {
        let codes: Vec<Option<u8>> = indices.iter().map(|&i| self.codes[i as usize]).collect();
        let unlabelled = codes.iter().filter(|c| c.is_none()).count() as u64;
        Self { codes, unlabelled }
    }

    /// Points that carry each code.
    pub fn counts(&self) -> [u64; 256] {
        let mut counts = [0; 256];
        self.codes.iter().flatten().for_each(|&c| counts[usize::from(c)] += 1);
        counts
    }
}

/// Reads the labels of a cloud. Negative values and NaN count as unlabelled.
///
/// # Errors
/// The column is absent (the message lists the columns), or a value is not a whole number in 0..=255.
pub fn read_labels(cloud: &Cloud, params: &LabelParams) -> Result<Labels> {
    let column = cloud.column(&params.dimension).ok_or_else(|| {
        let known: Vec<&str> = cloud.columns().iter().map(|c| c.name.as_str()).collect();
        Error::input(format!("no column {} to take labels from; the cloud has: {}", params.dimension, known.join(", ")))
    })?;
    let mut labels = Labels { codes: Vec::with_capacity(cloud.len()), unlabelled: 0 };
    for i in 0..cloud.len() {
        let code = code_of(column.values.get(i), i, &params.dimension)?.map(|c| params.map.apply(c));
        let code = code
            .filter(|c| !params.unlabelled.contains(c) && (params.classes.is_empty() || params.classes.contains(c)));
        labels.unlabelled += u64::from(code.is_none());
        labels.codes.push(code);
    }
    Ok(labels)
}

fn code_of(value: f64, point: usize, dimension: &str) -> Result<Option<u8>> {
    if value.is_nan() || value < 0.0 {
        return Ok(None);
    }
    let code = value as u8;
    if (f64::from(code) - value).abs() > 0.0 {
        return Err(Error::input(format!(
            "{dimension} of point {point} is {value}; labels are whole numbers in 0..=255"
        )));
    }
    Ok(Some(code))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};

    fn cloud(values: Vec<f32>) -> Cloud {
        let mut cloud = Cloud::from_rows(&vec![[0.0; 3]; values.len()]).unwrap();
        cloud.set_column(Column::new("Classification", Values::F32(values))).unwrap();
        cloud
    }

    #[test]
    fn negative_values_and_asked_codes_are_unlabelled() {
        let params = LabelParams { map: "4=5".parse().unwrap(), ..LabelParams::default() };
        let labels = read_labels(&cloud(vec![-1.0, 2.0, 1.0, 4.0, f32::NAN]), &params).unwrap();
        assert_eq!(labels.codes, [None, Some(2), None, Some(5), None]);
        assert_eq!(labels.unlabelled, 3);
    }

    #[test]
    fn labels_out_of_range_are_refused_with_point_and_value() {
        for bad in [256.0, 2.5] {
            let message = read_labels(&cloud(vec![2.0, bad]), &LabelParams::default()).unwrap_err().to_string();
            assert!(message.contains("point 1") && message.contains(&bad.to_string()), "{message}");
        }
        assert!(read_labels(&Cloud::from_rows(&[]).unwrap(), &LabelParams::default()).is_err());
    }
}
