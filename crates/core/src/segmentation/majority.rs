//! The most frequent label of each segment: the upper bound of any classification of whole segments.

use super::Partition;
use crate::error::{Error, Result};

/// The most frequent label of a segment's nodes.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Majority {
    /// The most frequent label; of equally frequent ones the smallest. `None` if no node has a label.
    pub code: Option<u8>,
    /// Number of nodes with that label.
    pub votes: u32,
    /// Number of nodes with any label.
    pub labelled: u32,
}

/// The most frequent label of each segment, one entry a segment. O(n + 256) for a segment with labels.
///
/// # Errors
/// If there is not one label (or `None`) for each node.
pub fn majorities(partition: &Partition, labels: &[Option<u8>]) -> Result<Vec<Majority>> {
    if labels.len() != partition.nodes() {
        return Err(Error::input(format!("{} labels for {} nodes", labels.len(), partition.nodes())));
    }
    let mut counts = [0u32; 256];
    let count_one = |members: &[u32]| {
        let mut majority = Majority::default();
        let codes = || members.iter().filter_map(|&node| labels[node as usize]);
        codes().for_each(|code| counts[usize::from(code)] += 1);
        for code in codes() {
            let votes = counts[usize::from(code)];
            majority.labelled += 1;
            if votes > majority.votes || (votes == majority.votes && majority.code.is_none_or(|c| code < c)) {
                (majority.code, majority.votes) = (Some(code), votes);
            }
        }
        codes().for_each(|code| counts[usize::from(code)] = 0);
        majority
    };
    Ok(partition.iter().map(count_one).collect())
}

/// Oracle accuracy: the share of the labelled nodes that are right if every segment gets its most frequent label,
/// 0..=1; `None` if no node has a label. O(n) in total.
///
/// # Errors
/// If there is not one label (or `None`) for each node.
pub fn oracle_accuracy(partition: &Partition, labels: &[Option<u8>]) -> Result<Option<f64>> {
    let all = majorities(partition, labels)?;
    let labelled: u64 = all.iter().map(|m| u64::from(m.labelled)).sum();
    let votes: u64 = all.iter().map(|m| u64::from(m.votes)).sum();
    Ok((labelled > 0).then(|| votes as f64 / labelled as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commonest_label_wins_and_ties_go_to_the_smallest() {
        let partition = Partition::from_labels(&[0, 0, 0, 1, 1, 1, 2]).unwrap();
        let labels = [Some(5), Some(2), Some(5), Some(9), Some(3), None, None];
        let majority = |code, votes, labelled| Majority { code, votes, labelled };
        let expected = [majority(Some(5), 2, 3), majority(Some(3), 1, 2), majority(None, 0, 0)];
        assert_eq!(majorities(&partition, &labels).unwrap(), expected);
        assert_eq!(oracle_accuracy(&partition, &labels).unwrap(), Some(3.0 / 5.0));
        assert_eq!(oracle_accuracy(&partition, &[None; 7]).unwrap(), None);
        assert!(majorities(&partition, &labels[1..]).is_err());
    }
}
