//! The columns of a table that the features of one level fill.

use crate::features::definition::{ALL, Feature, Group};

/// The column of each selected feature of one level.
#[derive(Clone, Debug)]
pub(in crate::features) struct Slots {
    /// By key.
    columns: [Option<usize>; ALL.len()],
}

impl Default for Slots {
    fn default() -> Self {
        Self { columns: [None; ALL.len()] }
    }
}

impl Slots {
    /// Selects a feature.
    pub(in crate::features) fn put(&mut self, feature: Feature, column: usize) {
        self.columns[feature as usize] = Some(column);
    }

    /// The feature's column if it is selected.
    #[inline(always)]
    pub(in crate::features) fn column(&self, feature: Feature) -> Option<usize> {
        self.columns[feature as usize]
    }

    /// Whether no feature is selected.
    pub(in crate::features) fn is_empty(&self) -> bool {
        self.columns.iter().all(Option::is_none)
    }

    /// Whether a feature of the group is selected.
    pub(in crate::features) fn any(&self, group: Group) -> bool {
        group.definitions().any(|d| self.column(d.feature).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_selected_feature_selects_its_group() {
        let mut slots = Slots::default();
        assert!(Group::ALL.iter().all(|&group| !slots.any(group)));
        slots.put(Feature::LineFeature, 7);
        assert_eq!((slots.column(Feature::LineFeature), slots.column(Feature::Sum)), (Some(7), None));
        assert!(slots.any(Group::Contour) && !slots.any(Group::Covariance) && !slots.any(Group::Height));
    }
}
