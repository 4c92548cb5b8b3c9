//! A soft-max classifier as named arrays.

use super::Linear;
use crate::classification::arrays::{Array, Reader, array};
use crate::classification::learner::Stored;
use crate::error::Result;

impl Stored for Linear {
    const TITLE: &'static str = "scansion linear";

    fn arrays(&self) -> Vec<Array> {
        vec![
            array("linear_weights", self.weights.iter().copied()),
            array("linear_bias", self.bias.iter().copied()),
            array("linear_means", self.means.iter().copied()),
            array("importance", self.importance.iter().copied()),
        ]
    }

    fn from_arrays(reader: &Reader<'_>, width: usize, classes: usize) -> Result<Self> {
        let finite = |name: &'static str, count: usize| -> Result<Vec<f32>> {
            let values: Vec<f32> = reader.read(name, Some(count))?;
            match values.iter().find(|v| !v.is_finite()) {
                Some(wrong) => Err(reader.wrong(name, wrong, "finite numbers")),
                None => Ok(values),
            }
        };
        Ok(Self {
            classes,
            weights: finite("linear_weights", width * classes)?,
            bias: finite("linear_bias", classes)?,
            means: finite("linear_means", width)?,
            importance: reader.importance(width)?,
        })
    }
}
