//! The values that a partition approximates.

use crate::error::{Error, Result};

/// A vector of `width` values at each node, and the weight of each node.
#[derive(Clone, Copy, Debug)]
pub struct Signal<'a> {
    values: &'a [f32],
    width: usize,
    weights: Option<&'a [f32]>,
}

impl<'a> Signal<'a> {
    /// Values node after node, `width` each; every node has the weight 1. O(n · width).
    ///
    /// # Errors
    /// If `width` is 0, the length is no multiple of it, or a value is not finite.
    pub fn new(values: &'a [f32], width: usize) -> Result<Self> {
        if width == 0 || !values.len().is_multiple_of(width) {
            return Err(Error::input(format!("{} values are no rows of {width} (allowed: 1 or more)", values.len())));
        }
        match values.iter().position(|v| !v.is_finite()) {
            Some(at) => Err(Error::input(format!(
                "value {} of node {} is {} (allowed: finite numbers)",
                at % width,
                at / width,
                values[at]
            ))),
            None => Ok(Self { values, width, weights: None }),
        }
    }

    /// The same values where node i has the weight `weights[i]` (for a voxel: its number of points).
    ///
    /// # Errors
    /// If there is not one positive finite weight for each node.
    pub fn with_weights(self, weights: &'a [f32]) -> Result<Self> {
        if weights.len() != self.len() {
            return Err(Error::input(format!("{} weights for {} nodes", weights.len(), self.len())));
        }
        match weights.iter().position(|w| !(w.is_finite() && *w > 0.0)) {
            Some(at) => Err(Error::input(format!("weight {} of node {at} (allowed: positive, finite)", weights[at]))),
            None => Ok(Self { weights: Some(weights), ..self }),
        }
    }

    /// The same weights with other values, as many and finite.
    pub(super) fn with_values<'b>(self, values: &'b [f32]) -> Signal<'b>
    where
        'a: 'b,
    {
        Signal { values, ..self }
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.values.len() / self.width
    }

    /// True if there is no node.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Number of values per node.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Values of a node.
    pub fn row(&self, node: usize) -> &'a [f32] {
        &self.values[node * self.width..][..self.width]
    }

    /// Weight of a node.
    pub fn weight(&self, node: usize) -> f64 {
        self.weights.map_or(1.0, |w| f64::from(w[node]))
    }

    /// Fails unless the signal has one row for each of `nodes` nodes.
    pub(super) fn fits(&self, nodes: usize) -> Result<()> {
        if self.len() == nodes {
            return Ok(());
        }
        Err(Error::input(format!("values for {} nodes, but the graph has {nodes}", self.len())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_weights_belong_to_nodes() {
        let signal = Signal::new(&[1.0, 2.0, 3.0, 4.0], 2).unwrap();
        assert_eq!((signal.len(), signal.row(1), signal.weight(1)), (2, &[3.0, 4.0][..], 1.0));
        assert_eq!(signal.with_weights(&[1.0, 2.5]).unwrap().weight(1), 2.5);
    }

    #[test]
    fn what_is_not_finite_or_does_not_fit_is_refused() {
        let message = Signal::new(&[0.0, 1.0, f32::NAN, 0.0], 2).unwrap_err().to_string();
        assert!(message.contains("value 0 of node 1"), "{message}");
        assert!(Signal::new(&[0.0; 3], 2).is_err() && Signal::new(&[], 0).is_err());
        let signal = Signal::new(&[0.0; 2], 1).unwrap();
        assert!(signal.with_weights(&[1.0]).is_err() && signal.with_weights(&[1.0, 0.0]).is_err());
        assert!(signal.fits(3).is_err());
    }
}
