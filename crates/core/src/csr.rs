//! Groups of indices in compressed form (CSR), used for neighbours, graphs and partitions.

use crate::error::{Error, Result};
use crate::parallel::{Monitor, watched};

/// `items[offsets[g]..offsets[g + 1]]` are the members of group `g`.
///
/// Invariants (see [`Csr::check`]): `offsets` starts at 0, never falls, and ends at `items.len()`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Csr {
    offsets: Vec<u32>,
    items: Vec<u32>,
}

impl Csr {
    /// Builds from parts, checking the invariants and that every item is below `bound`.
    ///
    /// # Errors
    /// If an invariant is violated or an item is not below `bound`.
    pub fn new(offsets: Vec<u32>, items: Vec<u32>, bound: usize) -> Result<Self> {
        let csr = Self { offsets, items };
        csr.check(bound)?;
        Ok(csr)
    }

    /// Groups `0..keys.len()` by `keys[i] < groups`; members stay in ascending order. O(n + groups).
    ///
    /// # Errors
    /// If a key is not below `groups`, or the work was cancelled.
    pub fn group_by(keys: &[u32], groups: usize, monitor: &Monitor) -> Result<Self> {
        let mut offsets = vec![0u32; groups + 1];
        for piece in watched(keys.len(), monitor) {
            for &key in &keys[piece?] {
                let slot = offsets
                    .get_mut(key as usize + 1)
                    .ok_or_else(|| Error::input(format!("group {key} is not below the number of groups {groups}")))?;
                *slot += 1;
            }
        }
        for g in 0..groups {
            offsets[g + 1] += offsets[g];
        }
        let mut next = offsets.clone();
        let mut items = vec![0u32; keys.len()];
        for piece in watched(keys.len(), monitor) {
            for i in piece? {
                let slot = &mut next[keys[i] as usize];
                items[*slot as usize] = i as u32;
                *slot += 1;
            }
        }
        Ok(Self { offsets, items })
    }

    /// The first groups alone.
    pub(crate) fn truncated(mut self, groups: usize) -> Self {
        self.offsets.truncate(groups + 1);
        self.items.truncate(self.offsets.last().map_or(0, |&end| end as usize));
        self
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// True if there is no group.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Members of group `g`.
    pub fn group(&self, g: usize) -> &[u32] {
        &self.items[self.offsets[g] as usize..self.offsets[g + 1] as usize]
    }

    /// All groups in order.
    pub fn groups(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.len()).map(|g| self.group(g))
    }

    /// The offsets, one more than there are groups.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// All members, group after group.
    pub fn items(&self) -> &[u32] {
        &self.items
    }

    /// Checks the invariants. O(n).
    ///
    /// # Errors
    /// If an invariant is violated or an item is not below `bound`.
    pub fn check(&self, bound: usize) -> Result<()> {
        let fine = match (self.offsets.first(), self.offsets.last()) {
            (None, None) => self.items.is_empty(),
            (Some(&first), Some(&last)) => {
                first == 0 && last as usize == self.items.len() && self.offsets.windows(2).all(|w| w[0] <= w[1])
            }
            _ => false,
        };
        if !fine {
            return Err(Error::input(format!("offsets must rise from 0 to the number of items {}", self.items.len())));
        }
        match self.items.iter().find(|&&item| item as usize >= bound) {
            Some(item) => Err(Error::input(format!("item {item} is not below {bound}"))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grouping_keeps_order_inside_groups() {
        let csr = Csr::group_by(&[2, 0, 2, 0, 0], 4, &Monitor::default()).unwrap();
        assert_eq!(csr.groups().collect::<Vec<_>>(), [&[1, 3, 4][..], &[], &[0, 2], &[]]);
        csr.check(5).unwrap();
    }

    #[test]
    fn broken_offsets_and_large_items_are_refused() {
        assert!(Csr::new(vec![0, 2, 1], vec![0], 1).is_err());
        assert!(Csr::new(vec![1, 1], vec![], 1).is_err());
        assert!(Csr::new(vec![0, 1], vec![5], 5).is_err());
        assert!(Csr::new(vec![0, 1], vec![4], 5).is_ok());
        assert!(Csr::group_by(&[3], 3, &Monitor::default()).is_err());
    }
}
