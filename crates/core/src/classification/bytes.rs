//! Serialises a classifier alone, without recipe and names: for copies between processes (Python's pickle).

use crate::classification::arrays::{Reader, malformed};
use crate::classification::boosting::Boosting;
use crate::classification::forest::Forest;
use crate::classification::learner::Stored;
use crate::error::{Error, Result};
use safetensors::SafeTensors;
use safetensors::tensor::TensorView;
use std::path::Path;

macro_rules! bytes {
    ($($trained:ty),*) => {$(
        impl $trained {
            /// The trees as safetensors; the same trees give the same bytes. Use [`Model`](crate::recipes::Model) for
            /// files to keep.
            ///
            /// # Errors
            /// If the encoder fails, which no valid trees are known to cause.
            pub fn to_bytes(&self) -> Result<Vec<u8>> {
                write(self)
            }

            /// Reads what `to_bytes` wrote; every index is checked.
            ///
            /// # Errors
            /// [`Error::Malformed`] naming the field.
            pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
                read(bytes)
            }
        }
    )*};
}

bytes!(Forest, Boosting);

/// Arrays, and the number of features and classes, which the arrays alone do not tell.
fn write<T: Stored>(trained: &T) -> Result<Vec<u8>> {
    let refused = |e: &dyn std::fmt::Display| Error::input(format!("classifier cannot be written: {e}"));
    let arrays = trained.arrays();
    let views = arrays.iter().map(|(name, dtype, len, bytes)| {
        TensorView::new(*dtype, vec![*len], bytes).map(|view| (*name, view)).map_err(|e| refused(&e))
    });
    let shape = format!("{} {}", trained.width(), trained.classes());
    let metadata = Some([(T::TITLE.to_string(), shape)].into_iter().collect());
    safetensors::serialize(views.collect::<Result<Vec<_>>>()?, metadata).map_err(|e| refused(&e))
}

fn read<T: Stored>(bytes: &[u8]) -> Result<T> {
    let path = Path::new("classifier in memory");
    let wrong = |e: &dyn std::fmt::Display| malformed(path, "header", e, format!("the header of a {}", T::TITLE));
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| wrong(&e))?;
    let shape = metadata.metadata().as_ref().and_then(|m| m.get(T::TITLE)).ok_or_else(|| wrong(&"no shape"))?;
    let numbers: Vec<usize> = shape.split(' ').filter_map(|n| n.parse().ok()).collect();
    let (Some(&width @ 1..=65_534), Some(&classes @ 1..=65_535)) = (numbers.first(), numbers.get(1)) else {
        return Err(wrong(shape));
    };
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| wrong(&e))?;
    T::from_arrays(&Reader { path, tensors, prefix: "" }, width, classes)
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
