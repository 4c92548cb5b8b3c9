//! Forest and fingerprint as named arrays, and the check of every index when they are read.

use super::binning::Binning;
use super::fingerprint::Fingerprint;
use super::forest::{Forest, LEAF_CUT, Node};
use super::params::MAX_DEPTH;
use crate::error::{Error, Result};
use safetensors::{Dtype, SafeTensors};
use std::path::Path;

/// A named array: name, type, length, little-endian bytes.
pub(super) type Array = (&'static str, Dtype, usize, Vec<u8>);

/// A number with a fixed little-endian form.
trait Number: Sized + Copy {
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

fn array<T: Number>(name: &'static str, values: impl IntoIterator<Item = T>) -> Array {
    let mut bytes = Vec::new();
    values.into_iter().for_each(|v| v.write(&mut bytes));
    (name, T::DTYPE, bytes.len() / T::SIZE, bytes)
}

/// The arrays of a model.
pub(super) fn encode(forest: &Forest, print: &Fingerprint) -> Vec<Array> {
    let widths = 0..forest.width();
    vec![
        array("cut_counts", widths.clone().map(|f| forest.binning.cuts(f).len() as u32)),
        array("cuts", widths.flat_map(|f| forest.binning.cuts(f).iter().copied())),
        array("node_left", forest.nodes.iter().map(|n| n.left)),
        array("node_feature", forest.nodes.iter().map(|n| n.feature)),
        array("node_cut", forest.nodes.iter().map(|n| n.cut)),
        array("roots", forest.roots.iter().copied()),
        array("leaves", forest.leaves.iter().copied()),
        array("importance", forest.importance.iter().copied()),
        array("print_quantiles", print.quantiles.iter().copied()),
        array("print_means", print.means.iter().copied()),
        array("print_density", [print.density]),
        array("print_class_counts", print.class_counts.iter().copied()),
    ]
}

/// Arrays being read, and the file they come from.
pub(super) struct Reader<'a> {
    pub(super) path: &'a Path,
    pub(super) tensors: SafeTensors<'a>,
}

/// Says what is wrong in a model file.
pub(super) fn malformed(path: &Path, field: &str, found: impl ToString, allowed: impl Into<String>) -> Error {
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
    fn wrong(&self, field: &str, found: impl ToString, allowed: impl Into<String>) -> Error {
        malformed(self.path, field, found, allowed)
    }

    fn read<T: Number>(&self, name: &str, expected: Option<usize>) -> Result<Vec<T>> {
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

    /// The forest of `width` features and `classes` classes, every index checked.
    pub(super) fn forest(&self, width: usize, classes: usize) -> Result<Forest> {
        let left = self.read::<u32>("node_left", None)?;
        let feature = self.read::<u16>("node_feature", Some(left.len()))?;
        let cut = self.read::<u16>("node_cut", Some(left.len()))?;
        let nodes = left.into_iter().zip(feature).zip(cut).map(|((left, feature), cut)| Node { left, feature, cut });
        let forest = Forest {
            classes,
            binning: self.binning(width)?,
            nodes: nodes.collect(),
            roots: self.read("roots", None)?,
            leaves: self.read("leaves", None)?,
            importance: self.read("importance", Some(width))?,
        };
        self.check_leaves(&forest)?;
        if let Some(i) = forest.importance.iter().find(|i| !(i.is_finite() && **i >= 0.0)) {
            return Err(self.wrong("importance", i, "finite numbers from 0 up"));
        }
        self.check_trees(&forest)?;
        Ok(forest)
    }

    /// The fingerprint of `width` features and `classes` classes.
    pub(super) fn fingerprint(&self, width: usize, classes: usize) -> Result<Fingerprint> {
        Ok(Fingerprint {
            quantiles: self.read("print_quantiles", Some(width * Fingerprint::LEVELS.len()))?,
            means: self.read("print_means", Some(width))?,
            density: self.read("print_density", Some(1))?[0],
            class_counts: self.read("print_class_counts", Some(classes))?,
        })
    }

    fn binning(&self, width: usize) -> Result<Binning> {
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

    fn check_leaves(&self, forest: &Forest) -> Result<()> {
        let rows = forest.leaves.chunks_exact(forest.classes);
        if !rows.remainder().is_empty() || rows.len() < forest.classes {
            return Err(self.wrong("leaves", forest.leaves.len(), format!("whole rows of {} classes", forest.classes)));
        }
        let fine =
            |row: &[f32]| row.iter().all(|p| (0.0..=1.0).contains(p)) && (row.iter().sum::<f32>() - 1.0).abs() < 1e-3;
        match rows.enumerate().find(|(_, row)| !fine(row)) {
            Some((i, row)) => {
                Err(self.wrong(&format!("leaves at row {i}"), format!("{row:?}"), "0 to 1, summing to 1"))
            }
            None => Ok(()),
        }
    }

    fn check_trees(&self, forest: &Forest) -> Result<()> {
        let (roots, count) = (&forest.roots, forest.nodes.len());
        let rising = roots.windows(2).all(|w| w[0] < w[1]);
        if roots.first() != Some(&0) || !rising || roots.last().is_none_or(|&r| r as usize >= count) {
            return Err(self.wrong(
                "roots",
                format!("{:?}", &roots[..roots.len().min(8)]),
                format!("rising from 0, below {count}"),
            ));
        }
        let ends = roots[1..].iter().map(|&r| r as usize).chain([count]);
        roots.iter().zip(ends).try_for_each(|(&root, end)| self.check_tree(forest, root as usize..end))
    }

    /// Children stand behind their parent inside the tree and have one parent each: no cycle, no stray node.
    fn check_tree(&self, forest: &Forest, range: std::ops::Range<usize>) -> Result<()> {
        let mut depth = vec![0usize; range.len()];
        for i in range.clone() {
            let node = forest.nodes[i];
            self.check_node(forest, i, range.end)?;
            let own = depth[i - range.start];
            if own > MAX_DEPTH + 1 || (own == 0 && i > range.start) {
                let allowed = format!("one parent, depth up to {MAX_DEPTH}");
                return Err(self.wrong(
                    &format!("node_left at node {i}"),
                    format!("depth {}", own.wrapping_sub(1)),
                    allowed,
                ));
            }
            if node.cut != LEAF_CUT {
                for child in [node.left as usize - range.start, node.left as usize + 1 - range.start] {
                    if depth[child] != 0 {
                        return Err(self.wrong(
                            &format!("node_left at node {i}"),
                            node.left,
                            "children without another parent",
                        ));
                    }
                    depth[child] = own.max(1) + 1;
                }
            }
        }
        Ok(())
    }

    fn check_node(&self, forest: &Forest, i: usize, end: usize) -> Result<()> {
        let node = forest.nodes[i];
        let (feature, left) = (usize::from(node.feature), node.left as usize);
        let wrong =
            |field: &str, found: usize, allowed| Err(self.wrong(&format!("{field} at node {i}"), found, allowed));
        if feature >= forest.width() {
            return wrong("node_feature", feature, format!("below {}", forest.width()));
        }
        if node.cut == LEAF_CUT {
            let rows = forest.leaves.len() / forest.classes;
            return if left < rows { Ok(()) } else { wrong("node_left", left, format!("a leaf row below {rows}")) };
        }
        if left <= i || left + 1 >= end {
            return wrong("node_left", left, format!("above {i}, below {}", end - 1));
        }
        let cuts = forest.binning.cuts(feature).len();
        match usize::from(node.cut) < cuts {
            true => Ok(()),
            false => wrong("node_cut", usize::from(node.cut), format!("below {cuts}")),
        }
    }
}
