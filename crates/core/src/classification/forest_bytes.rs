//! A forest alone as bytes, without recipe and names: for copies between processes (Python's pickle).

use super::codec::{Reader, encode, malformed};
use super::fingerprint::Fingerprint;
use super::forest::Forest;
use crate::error::{Error, Result};
use safetensors::SafeTensors;
use safetensors::tensor::TensorView;
use std::collections::HashMap;
use std::path::Path;

const KEY: &str = "scansion forest";

impl Forest {
    /// The forest as safetensors; the same forest gives the same bytes. Use [`Model`](super::Model) for files to keep.
    ///
    /// # Errors
    /// None that is known; failures of the encoder are passed on.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let refused = |e: &dyn std::fmt::Display| Error::input(format!("forest cannot be written: {e}"));
        let arrays = encode(self, &Fingerprint::default());
        let views = arrays.iter().map(|(name, dtype, len, bytes)| {
            TensorView::new(*dtype, vec![*len], bytes).map(|view| (*name, view)).map_err(|e| refused(&e))
        });
        let shape = format!("{} {}", self.width(), self.classes());
        let metadata = Some(HashMap::from([(KEY.to_string(), shape)]));
        safetensors::serialize(views.collect::<Result<Vec<_>>>()?, metadata).map_err(|e| refused(&e))
    }

    /// Reads what [`Forest::to_bytes`] wrote; every index is checked.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the field.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let path = Path::new("forest in memory");
        let wrong = |e: &dyn std::fmt::Display| malformed(path, "header", e, "the header of a forest");
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| wrong(&e))?;
        let shape = metadata.metadata().as_ref().and_then(|m| m.get(KEY)).ok_or_else(|| wrong(&"no shape"))?;
        let numbers: Vec<usize> = shape.split(' ').filter_map(|n| n.parse().ok()).collect();
        let (Some(&width @ 1..=65_534), Some(&classes @ 1..=65_535)) = (numbers.first(), numbers.get(1)) else {
            return Err(wrong(shape));
        };
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| wrong(&e))?;
        Reader { path, tensors }.forest(width, classes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classification::{ForestParams, Samples};
    use crate::parallel::Monitor;

    #[test]
    fn a_forest_survives_its_bytes_and_cut_bytes_are_refused() {
        let features: Vec<f32> = (0..60).map(|i| i as f32).collect();
        let labels: Vec<u16> = (0..30).map(|i| i % 3).collect();
        let samples = Samples { features: &features, width: 2, labels: &labels, weights: None, classes: 300 };
        let params = ForestParams { trees: 3, ..ForestParams::breiman() };
        let forest = Forest::fit(&samples, &params, &Monitor::default()).unwrap();
        let bytes = forest.to_bytes().unwrap();
        assert_eq!(Forest::from_bytes(&bytes).unwrap(), forest);
        for cut in [0, 8, 60, bytes.len() - 1] {
            assert!(Forest::from_bytes(&bytes[..cut]).is_err());
        }
    }
}
