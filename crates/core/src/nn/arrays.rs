//! Files of named arrays: checkpoints and networks, as safetensors.

use crate::error::{Error, Result};
use crate::io::{atomic, open};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

/// The key of the text in the metadata.
const KEY: &str = "scansion";
/// What stands before the checksum, which is on a line of its own before the text. The metadata have one key only, as the
/// order of several is not fixed.
const CHECKSUM: &str = "sha256 ";

/// An array of a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Array {
    /// Lengths along the axes, and values.
    Single(Vec<usize>, Vec<f32>),
    /// Values of double precision.
    Double(Vec<f64>),
    /// Whole numbers.
    Whole(Vec<u64>),
}

/// Named arrays, and a text that says what they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrays {
    /// The text.
    pub text: String,
    all: BTreeMap<String, Array>,
}

impl Arrays {
    /// No arrays yet.
    pub fn new(text: String) -> Self {
        Self { text, all: BTreeMap::new() }
    }

    /// Adds an array.
    pub fn put(&mut self, name: impl Into<String>, array: Array) {
        self.all.insert(name.into(), array);
    }

    /// All arrays, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&String, &Array)> {
        self.all.iter()
    }

    /// Values of single precision.
    ///
    /// # Errors
    /// If there is no such array, or it has another type or length.
    pub fn single(&self, name: &str, length: usize) -> Result<&[f32]> {
        match self.all.get(name) {
            Some(Array::Single(_, values)) if values.len() == length => Ok(values),
            other => Err(self.lacks(name, other, &format!("{length} values of 32 bits"))),
        }
    }

    /// Values of double precision.
    ///
    /// # Errors
    /// If there is no such array, or it has another type.
    pub fn double(&self, name: &str) -> Result<&[f64]> {
        match self.all.get(name) {
            Some(Array::Double(values)) => Ok(values),
            other => Err(self.lacks(name, other, "values of 64 bits")),
        }
    }

    /// Whole numbers.
    ///
    /// # Errors
    /// If there is no such array, or it has another type.
    pub fn whole(&self, name: &str) -> Result<&[u64]> {
        match self.all.get(name) {
            Some(Array::Whole(values)) => Ok(values),
            other => Err(self.lacks(name, other, "whole numbers")),
        }
    }

    fn lacks(&self, name: &str, found: Option<&Array>, allowed: &str) -> Error {
        let found = match found {
            None => "no such array".to_string(),
            Some(Array::Single(_, values)) => format!("{} values of 32 bits", values.len()),
            Some(Array::Double(values)) => format!("{} values of 64 bits", values.len()),
            Some(Array::Whole(values)) => format!("{} whole numbers", values.len()),
        };
        Error::ModelMismatch(format!("array {name}: {found} (allowed: {allowed})"))
    }

    /// SHA-256 of the text and of names, types, shapes and values of all arrays, in hexadecimal digits.
    fn checksum(&self) -> String {
        let mut sum = Sha256::new();
        let mut feed = |bytes: &[u8]| {
            sum.update((bytes.len() as u64).to_le_bytes());
            sum.update(bytes);
        };
        feed(self.text.as_bytes());
        for (name, array) in &self.all {
            let (_, kind, shape, bytes) = array.encoded(name);
            feed(name.as_bytes());
            feed(format!("{kind:?} {shape:?}").as_bytes());
            feed(&bytes);
        }
        sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// The bytes of the file, a checksum included; the same arrays give the same bytes.
    ///
    /// # Errors
    /// If the encoder fails, which no arrays are known to cause.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let refused = |e: &dyn std::fmt::Display| Error::input(format!("arrays cannot be written: {e}"));
        let bytes: Vec<(&String, Dtype, Vec<usize>, Vec<u8>)> =
            self.all.iter().map(|(name, array)| array.encoded(name)).collect();
        let views = bytes.iter().map(|(name, kind, shape, bytes)| {
            TensorView::new(*kind, shape.clone(), bytes).map(|view| (*name, view)).map_err(|e| refused(&e))
        });
        let text = format!("{CHECKSUM}{}\n{}", self.checksum(), self.text);
        let metadata = Some([(KEY.to_string(), text)].into_iter().collect());
        safetensors::serialize(views.collect::<Result<Vec<_>>>()?, metadata).map_err(|e| refused(&e))
    }

    /// Reads what [`Arrays::to_bytes`] gave, or gave before there were checksums.
    ///
    /// # Errors
    /// [`Error::Malformed`] if the bytes are damaged, have another checksum, other types, or values that are not finite.
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self> {
        Self::read(bytes, path).map(|read| read.arrays)
    }

    /// Reads what [`Arrays::to_bytes`] gave; without a checksum it is refused.
    ///
    /// # Errors
    /// As [`Arrays::from_bytes`].
    pub fn from_checked_bytes(bytes: &[u8], path: &Path) -> Result<Self> {
        let Read { arrays, has_checksum } = Self::read(bytes, path)?;
        match has_checksum {
            true => Ok(arrays),
            false => Err(malformed(path, "checksum", "none", "SHA-256; a file of an older version must be made again")),
        }
    }

    fn read(bytes: &[u8], path: &Path) -> Result<Read> {
        let wrong = |found: &dyn std::fmt::Display, allowed: &str| malformed(path, "header", found, allowed);
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| wrong(&e, "safetensors"))?;
        let text = metadata.metadata().as_ref().and_then(|all| all.get(KEY));
        let text = text.ok_or_else(|| wrong(&"no text of this program", "a file that this program wrote"))?;
        let after = text.strip_prefix(CHECKSUM).and_then(|rest| rest.split_once('\n'));
        let (checksum, text) = after.map_or((None, text.as_str()), |(checksum, text)| (Some(checksum), text));
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| wrong(&e, "safetensors"))?;
        let mut all = Self::new(text.to_string());
        for (name, view) in tensors.iter() {
            let array = Array::decoded(&view).ok_or_else(|| {
                malformed(path, name, format!("{:?}", view.dtype()), "finite numbers of F32, F64 or U64")
            })?;
            all.put(name, array);
        }
        match checksum.filter(|stored| *stored != all.checksum()) {
            Some(stored) => Err(malformed(path, "checksum", stored, all.checksum())),
            None => Ok(Read { arrays: all, has_checksum: checksum.is_some() }),
        }
    }

    /// Writes the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        atomic::write_bytes(path, &self.to_bytes()?)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// As [`Arrays::from_bytes`]; or if it cannot be read.
    pub fn load(path: &Path) -> Result<Self> {
        Self::from_bytes(&open::bytes(path, open::MOST_MODEL)?, path)
    }

    /// Reads a file that must have a checksum, as checkpoints have.
    ///
    /// # Errors
    /// As [`Arrays::from_checked_bytes`]; or if it cannot be read.
    pub fn load_checked(path: &Path) -> Result<Self> {
        Self::from_checked_bytes(&open::bytes(path, open::MOST_MODEL)?, path)
    }
}

/// The arrays of a file.
struct Read {
    arrays: Arrays,
    has_checksum: bool,
}

fn malformed(path: &Path, field: &str, found: impl std::fmt::Display, allowed: impl Into<String>) -> Error {
    Error::Malformed {
        path: path.to_path_buf(),
        format: "safetensors",
        field: field.to_string(),
        place: "byte 0".into(),
        found: found.to_string(),
        allowed: allowed.into(),
    }
}

impl Array {
    /// Number of values of single precision.
    pub fn singles(&self) -> usize {
        match self {
            Self::Single(_, values) => values.len(),
            _ => 0,
        }
    }

    fn encoded<'a>(&self, name: &'a String) -> (&'a String, Dtype, Vec<usize>, Vec<u8>) {
        match self {
            Self::Single(shape, all) => {
                (name, Dtype::F32, shape.clone(), all.iter().flat_map(|v| v.to_le_bytes()).collect())
            }
            Self::Double(all) => {
                (name, Dtype::F64, vec![all.len()], all.iter().flat_map(|v| v.to_le_bytes()).collect())
            }
            Self::Whole(all) => (name, Dtype::U64, vec![all.len()], all.iter().flat_map(|v| v.to_le_bytes()).collect()),
        }
    }

    fn decoded(view: &TensorView<'_>) -> Option<Self> {
        let (four, _) = view.data().as_chunks::<4>();
        let (eight, _) = view.data().as_chunks::<8>();
        match view.dtype() {
            Dtype::F32 => {
                let values: Vec<f32> = four.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
                values.iter().all(|v| v.is_finite()).then(|| Self::Single(view.shape().to_vec(), values))
            }
            Dtype::F64 => {
                let values: Vec<f64> = eight.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect();
                values.iter().all(|v| v.is_finite()).then_some(Self::Double(values))
            }
            Dtype::U64 => Some(Self::Whole(eight.iter().map(|&bytes| u64::from_le_bytes(bytes)).collect())),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> Arrays {
        let mut arrays = Arrays::new("a text".into());
        arrays.put("b", Array::Single(vec![2, 1], vec![1.0, -0.5]));
        arrays.put("a", Array::Double(vec![0.1]));
        arrays.put("c", Array::Whole(vec![7, u64::MAX]));
        arrays
    }

    #[test]
    fn arrays_survive_their_file() {
        let bytes = some().to_bytes().unwrap();
        let read = Arrays::from_bytes(&bytes, Path::new("x")).unwrap();
        assert_eq!((&read, read.to_bytes().unwrap()), (&some(), bytes));
        assert_eq!((read.single("b", 2).unwrap(), read.whole("c").unwrap()[0]), (&[1.0, -0.5][..], 7));
        assert!(read.single("b", 3).unwrap_err().to_string().contains("2 values of 32 bits (allowed: 3"));
        assert!(read.double("c").is_err() && read.whole("d").unwrap_err().to_string().contains("no such array"));
    }

    #[test]
    fn every_flipped_bit_is_refused() {
        let bytes = some().to_bytes().unwrap();
        assert_eq!(Arrays::from_checked_bytes(&bytes, Path::new("x")).unwrap(), some());
        for bit in 0..8 * bytes.len() {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(Arrays::from_checked_bytes(&flipped, Path::new("x")).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn files_without_a_checksum_are_read_where_it_is_not_needed() {
        let all = some();
        let bytes: Vec<_> = all.all.iter().map(|(name, array)| array.encoded(name)).collect();
        let views = bytes
            .iter()
            .map(|(name, kind, shape, bytes)| (*name, TensorView::new(*kind, shape.clone(), bytes).unwrap()));
        let metadata = Some([(KEY.to_string(), all.text.clone())].into_iter().collect());
        let old = safetensors::serialize(views, metadata).unwrap();
        assert_eq!(Arrays::from_bytes(&old, Path::new("x")).unwrap(), all);
        let message = Arrays::from_checked_bytes(&old, Path::new("x")).unwrap_err().to_string();
        assert!(message.contains("older version"), "{message}");
    }

    #[test]
    fn damaged_files_are_refused() {
        let bytes = some().to_bytes().unwrap();
        for cut in 0..bytes.len() {
            assert!(Arrays::from_bytes(&bytes[..cut], Path::new("x")).is_err(), "{cut}");
        }
        let mut wrong = some();
        wrong.put("a", Array::Double(vec![f64::NAN]));
        let message = Arrays::from_bytes(&wrong.to_bytes().unwrap(), Path::new("x")).unwrap_err().to_string();
        assert!(message.contains("finite"), "{message}");
    }
}
