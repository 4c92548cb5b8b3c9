//! The two fully connected layers at the end of a network.

use super::build::{Builder, affine};
use crate::error::Result;
use crate::nn::layers::{Dropped, Linear, rectify, stop_below};
use crate::nn::parameters::{Gradients, Parameters, add_gradient};
use crate::nn::scalar::Scalar;
use crate::nn::tape::LinearIds;
use crate::parallel::Monitor;
use crate::random::Stream;

/// What a pass is for.
pub enum Mode<'a> {
    /// Nothing is dropped.
    Prediction,
    /// Channels are dropped at random.
    Training(&'a mut Stream),
}

/// Two fully connected layers: rectified channels, of which some are dropped in training, then scores.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Connected {
    hidden: LinearIds,
    pub(super) head: LinearIds,
    dropout: f64,
}

/// Numbers of values between the layers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Widths {
    pub(super) inputs: usize,
    pub(super) hidden: usize,
    pub(super) classes: usize,
}

impl Widths {
    /// Number of parameters of both layers; `None` if it overflows.
    pub(super) fn parameters(self) -> Option<usize> {
        affine(self.inputs, self.hidden)?.checked_add(affine(self.hidden, self.classes)?)
    }
}

impl Connected {
    /// The layers; a share of `dropout` of the hidden channels is dropped in training.
    pub(super) fn new<T: Scalar>(build: &mut Builder<'_, T>, widths: Widths, dropout: f64) -> Self {
        let hidden = build.linear("hidden", widths.inputs, widths.hidden);
        Self { hidden, head: build.linear("classes", widths.hidden, widths.classes), dropout }
    }

    /// Passes rows through both layers.
    ///
    /// # Errors
    /// If the rows do not fit, or the work was cancelled.
    pub(super) fn pass<'a, T: Scalar>(
        &'a self,
        parameters: &'a Parameters<T>,
        flat: Vec<T>,
        mode: Mode<'_>,
        monitor: &Monitor,
    ) -> Result<ConnectedPass<'a, T>> {
        let mut hidden = linear(parameters, self.hidden).forward(&flat, monitor)?;
        rectify(&mut hidden);
        let dropped = match mode {
            Mode::Prediction => None,
            Mode::Training(draws) => Some(Dropped::apply(&mut hidden, self.dropout, draws)?),
        };
        let scores = linear(parameters, self.head).forward(&hidden, monitor)?;
        Ok(ConnectedPass { layers: self, parameters, flat, hidden, dropped, scores })
    }
}

/// A pass through both layers.
pub(super) struct ConnectedPass<'a, T> {
    layers: &'a Connected,
    parameters: &'a Parameters<T>,
    flat: Vec<T>,
    /// The hidden channels, rectified, after dropout.
    pub(super) hidden: Vec<T>,
    dropped: Option<Dropped<T>>,
    /// A row of scores a sample.
    pub(super) scores: Vec<T>,
}

impl<T: Scalar> ConnectedPass<'_, T> {
    /// Adds the gradients of the parameters, given that with respect to the scores; returns that with respect to the rows.
    ///
    /// # Errors
    /// If the lengths differ, or the work was cancelled.
    pub(super) fn backward(self, gradient: &[T], gradients: &mut Gradients<T>, monitor: &Monitor) -> Result<Vec<T>> {
        let Connected { hidden, head, .. } = *self.layers;
        let found = linear(self.parameters, head).backward(&self.hidden, gradient, monitor)?;
        add_gradient(gradients, head.weights, &found.weights);
        add_gradient(gradients, head.bias, &found.bias);
        let mut towards = found.values;
        if let Some(dropped) = &self.dropped {
            dropped.scale(&mut towards);
        }
        stop_below(&mut towards, &self.hidden);
        let found = linear(self.parameters, hidden).backward(&self.flat, &towards, monitor)?;
        add_gradient(gradients, hidden.weights, &found.weights);
        add_gradient(gradients, hidden.bias, &found.bias);
        Ok(found.values)
    }
}

fn linear<T: Scalar>(parameters: &Parameters<T>, ids: LinearIds) -> Linear<'_, T> {
    Linear { weights: parameters.get(ids.weights), bias: parameters.get(ids.bias) }
}
