//! Numbers, cut points, nodes and fingerprints as named arrays of a model file.

mod node_check;

use crate::classification::binning::Binning;
use crate::classification::fingerprint::Fingerprint;
use crate::classification::nodes::Node;
use crate::error::{Error, Result};
use safetensors::{Dtype, SafeTensors};
use std::path::Path;

/// A named array: name, type, length, little-endian bytes.
pub(crate) type Array = (&'static str, Dtype, usize, Vec<u8>);

/// A number with a fixed little-endian form.
pub(in crate::classification) trait Number: Sized + Copy {
    const DTYPE: Dtype;
    const SIZE: usize;
    fn write(self, to: &mut Vec<u8>);
    fn read(bytes: &[u8]) -> Self;
}

macro_rules! number {
    ($($kind:ty: $dtype:ident),*) => {$(
        impl Number for $kind {
            const DTYPE: Dtype = Dtype::$dtype;
            const SIZE: usize = size_of::<$kind>();
            fn write(self, to: &mut Vec<u8>) {
                to.extend_from_slice(&self.to_le_bytes());
            }
            fn read(bytes: &[u8]) -> Self {
                let mut own = [0; size_of::<$kind>()];
                own.copy_from_slice(bytes);
                Self::from_le_bytes(own)
            }
        }
    )*};
}

number!(u16: U16, u32: U32, u64: U64, f32: F32, f64: F64);

pub(in crate::classification) fn array<T: Number>(name: &'static str, values: impl IntoIterator<Item = T>) -> Array {
    let mut bytes = Vec::new();
    values.into_iter().for_each(|v| v.write(&mut bytes));
    (name, T::DTYPE, bytes.len() / T::SIZE, bytes)
}

/// Thresholds.
pub(in crate::classification) fn cut_arrays(binning: &Binning) -> Vec<Array> {
    let widths = 0..binning.width();
    vec![
        array("cut_counts", widths.clone().map(|f| binning.cuts(f).len() as u32)),
        array("cuts", widths.flat_map(|f| binning.cuts(f).iter().copied())),
    ]
}

/// Nodes and roots.
pub(in crate::classification) fn node_arrays(nodes: &[Node], roots: &[u32]) -> Vec<Array> {
    vec![
        array("node_left", nodes.iter().map(|n| n.left)),
        array("node_feature", nodes.iter().map(|n| n.feature)),
        array("node_cut", nodes.iter().map(|n| n.cut)),
        array("roots", roots.iter().copied()),
    ]
}

/// The arrays of a fingerprint.
pub(crate) fn print_arrays(print: &Fingerprint) -> Vec<Array> {
    vec![
        array("print_quantiles", print.quantiles.iter().copied()),
        array("print_means", print.means.iter().copied()),
        array("print_density", [print.density]),
        array("print_class_counts", print.class_counts.iter().copied()),
    ]
}

/// Arrays that are being read, and their file.
pub(crate) struct Reader<'a> {
    pub(crate) path: &'a Path,
    pub(crate) tensors: SafeTensors<'a>,
    /// What the names of the arrays begin with in the file.
    pub(crate) prefix: &'static str,
}

/// The error for a malformed model file.
pub(crate) fn malformed(path: &Path, field: &str, found: impl ToString, allowed: impl Into<String>) -> Error {
    let (field, place) = field.split_once(" at ").unwrap_or((field, "header"));
    Error::Malformed {
        path: path.to_path_buf(),
        format: "model",
        field: field.into(),
        place: place.into(),
        found: found.to_string(),
        allowed: allowed.into(),
    }
}

impl Reader<'_> {
    pub(in crate::classification) fn wrong(
        &self,
        field: &str,
        found: impl ToString,
        allowed: impl Into<String>,
    ) -> Error {
        malformed(self.path, field, found, allowed)
    }

    pub(in crate::classification) fn read<T: Number>(&self, name: &str, expected: Option<usize>) -> Result<Vec<T>> {
        let name = &format!("{}{name}", self.prefix);
        let tensor = self.tensors.tensor(name).map_err(|e| self.wrong(name, e, "a one-dimensional array"))?;
        if tensor.dtype() != T::DTYPE || tensor.shape().len() != 1 {
            let found = format!("{:?} {:?}", tensor.dtype(), tensor.shape());
            return Err(self.wrong(name, found, format!("one-dimensional {:?}", T::DTYPE)));
        }
        let values: Vec<T> = tensor.data().chunks_exact(T::SIZE).map(T::read).collect();
        match expected {
            Some(count) if count != values.len() => {
                Err(self.wrong(name, format!("{} values", values.len()), format!("{count} values")))
            }
            _ => Ok(values),
        }
    }

    /// The nodes of all trees; their indices are not checked.
    pub(in crate::classification) fn nodes(&self) -> Result<Vec<Node>> {
        let left = self.read::<u32>("node_left", None)?;
        let feature = self.read::<u16>("node_feature", Some(left.len()))?;
        let cut = self.read::<u16>("node_cut", Some(left.len()))?;
        let nodes = left.into_iter().zip(feature).zip(cut);
        Ok(nodes.map(|((left, feature), cut)| Node { left, feature, cut }).collect())
    }

    /// The importance of `width` features.
    pub(in crate::classification) fn importance(&self, width: usize) -> Result<Vec<f64>> {
        let importance: Vec<f64> = self.read("importance", Some(width))?;
        match importance.iter().find(|i| !(i.is_finite() && **i >= 0.0)) {
            Some(i) => Err(self.wrong("importance", i, "finite numbers from 0 up")),
            None => Ok(importance),
        }
    }

    /// Whether there is a fingerprint.
    pub(crate) fn has_fingerprint(&self) -> bool {
        self.tensors.tensor(&format!("{}print_density", self.prefix)).is_ok()
    }

    /// The fingerprint of `width` features and `classes` classes.
    pub(crate) fn fingerprint(&self, width: usize, classes: usize) -> Result<Fingerprint> {
        Ok(Fingerprint {
            quantiles: self.read("print_quantiles", Some(width * Fingerprint::LEVELS.len()))?,
            means: self.read("print_means", Some(width))?,
            density: self.read("print_density", Some(1))?[0],
            class_counts: self.read("print_class_counts", Some(classes))?,
        })
    }

    pub(in crate::classification) fn binning(&self, width: usize) -> Result<Binning> {
        let counts = self.read::<u32>("cut_counts", Some(width))?;
        let cuts = self.read::<f32>("cuts", Some(counts.iter().map(|&c| c as usize).sum()))?;
        let mut rest = cuts.as_slice();
        let mut by_feature = Vec::with_capacity(width);
        for &count in &counts {
            let (own, after) = rest.split_at(count as usize);
            by_feature.push(own.to_vec());
            rest = after;
        }
        Binning::new(by_feature)
            .map_err(|e| self.wrong("cuts", e, "finite, strictly ascending, at most 65535 a feature"))
    }
}
