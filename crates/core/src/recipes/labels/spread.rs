//! Labels of a few points, spread over the segments that these points are in.

use super::Labels;
use crate::cloud::{Cloud, Values};
use crate::error::{Error, Result};
use std::collections::HashMap;

impl Labels {
    /// The labels spread over the segments of a column of the cloud: [`Labels::spread`].
    ///
    /// # Errors
    /// If the cloud lacks the column.
    pub fn spread_over(&self, cloud: &Cloud, dimension: &str) -> Result<Self> {
        let column = cloud.column(dimension).ok_or_else(|| {
            let known: Vec<&str> = cloud.columns().iter().map(|c| c.name.as_str()).collect();
            Error::input(format!("no column {dimension} with segments; the cloud has: {}", known.join(", ")))
        })?;
        Ok(self.spread(&column.values))
    }

    /// All points of a segment get the most frequent label of its labelled points. Segments in which several labels are
    /// equally frequent keep what they have, and so do points of no segment (number 0). One segment number a point.
    ///
    /// O(points).
    pub fn spread(&self, segments: &Values) -> Self {
        let segment = |i: usize| Some(segments.get(i).to_bits()).filter(|&bits| bits << 1 != 0);
        let mut votes: HashMap<u64, HashMap<u8, u64>> = HashMap::new();
        for (i, code) in self.codes.iter().enumerate() {
            if let (Some(code), Some(segment)) = (code, segment(i)) {
                *votes.entry(segment).or_default().entry(*code).or_default() += 1;
            }
        }
        let winners: HashMap<u64, u8> = votes.iter().filter_map(|(&of, votes)| Some((of, winner(votes)?))).collect();
        let spread = |(i, own): (usize, &Option<u8>)| segment(i).and_then(|of| winners.get(&of).copied()).or(*own);
        self.changed(self.codes.iter().enumerate().map(spread).collect())
    }
}

/// The label with the most votes, if it is the only one.
fn winner(votes: &HashMap<u8, u64>) -> Option<u8> {
    let most = votes.values().max()?;
    let mut first = votes.iter().filter(|(_, count)| *count == most).map(|(&code, _)| code);
    first.next().filter(|_| first.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{CodeScheme, Column};

    #[test]
    fn segments_take_their_most_frequent_label_and_ties_keep_theirs() {
        let mut cloud = Cloud::from_rows(&[[0.0; 3]; 11]).unwrap();
        cloud.set_column(Column::new("ClusterID", Values::U32(vec![1, 1, 1, 1, 2, 2, 2, 3, 3, 0, 0]))).unwrap();
        let codes = [Some(5), None, Some(2), Some(5), Some(2), Some(6), None, None, None, Some(6), None];
        let labels = Labels::new(codes.to_vec(), CodeScheme::Asprs);
        let spread = labels.spread_over(&cloud, "ClusterID").unwrap();
        let five = Some(5);
        assert_eq!(spread.codes, [five, five, five, five, Some(2), Some(6), None, None, None, Some(6), None]);
        assert_eq!((spread.unlabelled, spread.scheme), (4, CodeScheme::Asprs));
        assert!(labels.spread_over(&cloud, "Segment").unwrap_err().to_string().contains("ClusterID"));
    }
}
