//! Boosted trees as named arrays; every index is checked when they are read.

use crate::classification::arrays::{Array, Reader, array, cut_arrays, node_arrays};
use crate::classification::boosting::Boosting;
use crate::classification::learner::Stored;
use crate::classification::nodes::Trees;
use crate::error::Result;

impl Stored for Boosting {
    const TITLE: &'static str = "scansion boosting";

    fn arrays(&self) -> Vec<Array> {
        let mut arrays = cut_arrays(&self.binning);
        arrays.extend(node_arrays(&self.nodes, &self.roots));
        arrays.extend([
            array("answers", self.leaf_values.iter().copied()),
            array("importance", self.importance.iter().copied()),
            array("present", self.present.iter().copied()),
            array("start", self.start.iter().copied()),
            array("twins", self.twins.iter().copied()),
        ]);
        arrays
    }

    fn from_arrays(reader: &Reader<'_>, width: usize, classes: usize) -> Result<Self> {
        let twins = reader.ascending("twins", width)?;
        let nodes = reader.nodes()?;
        let model = Self {
            classes,
            width,
            present: reader.ascending("present", classes)?,
            start: reader.read("start", None)?,
            binning: reader.binning(width + twins.len())?,
            roots: reader.read("roots", None)?,
            leaf_values: reader.read("answers", Some(nodes.len()))?,
            importance: reader.importance(width)?,
            nodes,
            twins,
        };
        reader.check_boosting(&model)?;
        Ok(model)
    }
}

impl Reader<'_> {
    fn check_boosting(&self, model: &Boosting) -> Result<()> {
        let groups = model.groups();
        if model.present.is_empty() || model.start.len() != groups {
            let found = format!("{} of {} classes", model.start.len(), model.present.len());
            return Err(self.wrong("start", found, format!("{groups} values, 1 or more classes")));
        }
        if !model.roots.len().is_multiple_of(groups.max(1)) || (groups == 0 && !model.roots.is_empty()) {
            return Err(self.wrong("roots", model.roots.len(), format!("a multiple of {groups}")));
        }
        if let Some(x) = model.leaf_values.iter().chain(&model.start).find(|x| !x.is_finite()) {
            return Err(self.wrong("answers", x, "finite numbers"));
        }
        if !model.binning.fits_u8() || model.binning.width() > 65_534 {
            return Err(self.wrong("cuts", model.binning.width(), "at most 65534 features of 255 cuts"));
        }
        if model.roots.is_empty() && model.nodes.is_empty() {
            return Ok(());
        }
        let trees = Trees { nodes: &model.nodes, roots: &model.roots, binning: &model.binning };
        self.check_trees(&trees, &|i, left| left == i)
    }

    /// Numbers below `end`, each larger than the one before.
    fn ascending(&self, name: &str, end: usize) -> Result<Vec<u16>> {
        let values: Vec<u16> = self.read(name, None)?;
        let rising = values.windows(2).all(|w| w[0] < w[1]);
        match rising && values.last().is_none_or(|&v| usize::from(v) < end) {
            true => Ok(values),
            false => Err(self.wrong(name, format!("{values:?}"), format!("ascending numbers below {end}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::classification::testing::blobs;
    use crate::classification::{Boosting, BoostingParams};
    use crate::parallel::Monitor;

    fn model() -> Boosting {
        let mut data = blobs(300, 4, 3, 0.0);
        data.features.iter_mut().step_by(5).for_each(|v| *v = f32::NAN);
        let params = BoostingParams { rounds: 4, max_leaves: 5, ..BoostingParams::default() };
        Boosting::fit(&data.samples(), &params, &Monitor::default()).unwrap()
    }

    fn refused(change: impl FnOnce(&mut Boosting)) -> String {
        let mut model = model();
        change(&mut model);
        Boosting::from_bytes(&model.to_bytes().unwrap()).unwrap_err().to_string()
    }

    #[test]
    fn boosted_trees_survive_their_bytes_and_cut_bytes_are_refused() {
        let model = model();
        assert!(!model.twins.is_empty());
        let bytes = model.to_bytes().unwrap();
        assert_eq!(Boosting::from_bytes(&bytes).unwrap(), model);
        for cut in [0, 8, 60, bytes.len() - 1] {
            assert!(Boosting::from_bytes(&bytes[..cut]).is_err());
        }
    }

    #[test]
    fn values_that_do_not_fit_are_named() {
        assert!(refused(|m| m.nodes[0].left = 0).contains("node_left"));
        assert!(refused(|m| m.nodes[0].cut = 999).contains("node_cut"));
        assert!(refused(|m| m.nodes[0].feature = 99).contains("node_feature"));
        assert!(refused(|m| m.leaf_values[1] = f32::NAN).contains("answers"));
        assert!(refused(|m| m.present[2] = 3).contains("present"));
        assert!(refused(|m| m.start.push(0.0)).contains("start"));
        assert!(refused(|m| m.twins[0] = 77).contains("twins"));
        assert!(refused(|m| m.roots.truncate(2)).contains("roots"));
        assert!(refused(|m| m.importance[0] = -1.0).contains("importance"));
        let leaf = |m: &mut Boosting| {
            let i = m.nodes.iter().position(|n| n.cut == u16::MAX).unwrap();
            m.nodes[i].left += 1;
        };
        assert!(refused(leaf).contains("node_left"));
    }
}
