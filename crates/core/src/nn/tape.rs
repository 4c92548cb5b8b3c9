//! Automatic differentiation: the operations of a forward pass are written down and then run through backwards.

use super::layers::{BatchNorm, Linear, Moments, stop_below};
use super::parameters::{Gradients, ParameterId, Parameters, add_gradient};
use super::scalar::Scalar;
use super::sites::{Connections, Convolution};
use super::workspace::Workspace;
use crate::error::Result;
use crate::parallel::Monitor;
use rayon::prelude::*;

/// Added to variances.
const EPSILON: f64 = 1e-5;
/// Share of the running moments that a training step replaces.
const MOMENTUM: f64 = 0.1;
/// Rows that one task takes.
const BLOCK: usize = 4096;

/// Rows of channels on the tape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Value(usize);

/// Parameters of a normalisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NormIds {
    /// Factors.
    pub scale: ParameterId,
    /// Terms.
    pub shift: ParameterId,
    /// Running means.
    pub mean: ParameterId,
    /// Running variances.
    pub variance: ParameterId,
}

/// Parameters of a product with a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinearIds {
    /// The matrix.
    pub weights: ParameterId,
    /// The terms.
    pub bias: ParameterId,
}

/// An operation and its inputs.
enum Operation<'a, T> {
    Input,
    Convolution {
        of: Value,
        weights: ParameterId,
        connections: Connections<'a>,
    },
    /// Normalisation, plus another value if there is one, rectified.
    Norm {
        of: Value,
        beside: Option<Value>,
        norm: NormIds,
        moments: Moments<T>,
    },
    Joined {
        left: Value,
        right: Value,
    },
    Linear {
        of: Value,
        linear: LinearIds,
    },
}

struct Node<'a, T> {
    operation: Operation<'a, T>,
    values: Vec<T>,
    channels: usize,
}

/// The operations of one pass over a batch.
pub struct Tape<'a, T: Scalar> {
    parameters: &'a Parameters<T>,
    workspace: &'a Workspace<T>,
    monitor: &'a Monitor,
    /// Whether normalisation uses the moments of the batch, and values are kept for the backward pass.
    training: bool,
    nodes: Vec<Node<'a, T>>,
}

/// New running moments of a normalisation.
#[derive(Clone, Debug, PartialEq)]
pub struct Followed<T> {
    norm: NormIds,
    moments: Moments<T>,
}

impl<'a, T: Scalar> Tape<'a, T> {
    /// A tape for training.
    pub fn training(parameters: &'a Parameters<T>, workspace: &'a Workspace<T>, monitor: &'a Monitor) -> Self {
        Self { parameters, workspace, monitor, training: true, nodes: Vec::new() }
    }

    /// A tape for prediction.
    pub fn prediction(parameters: &'a Parameters<T>, workspace: &'a Workspace<T>, monitor: &'a Monitor) -> Self {
        Self { parameters, workspace, monitor, training: false, nodes: Vec::new() }
    }

    /// The values, row-major.
    pub fn values(&self, value: Value) -> &[T] {
        &self.nodes[value.0].values
    }

    /// Takes the values away.
    pub fn take(&mut self, value: Value) -> Vec<T> {
        std::mem::take(&mut self.nodes[value.0].values)
    }

    /// Number of channels.
    fn channels(&self, value: Value) -> usize {
        self.nodes[value.0].channels
    }

    fn push(&mut self, operation: Operation<'a, T>, values: Vec<T>, channels: usize) -> Value {
        self.nodes.push(Node { operation, values, channels });
        Value(self.nodes.len() - 1)
    }

    /// Frees values that prediction does not need any more; in training they are needed for the gradients.
    pub fn forget(&mut self, value: Value) {
        if !self.training {
            let values = self.take(value);
            self.workspace.recycle(values);
        }
    }

    /// Rows of so many channels.
    pub fn input(&mut self, values: Vec<T>, channels: usize) -> Value {
        self.push(Operation::Input, values, channels)
    }

    /// A convolution.
    ///
    /// # Errors
    /// If the channels do not fit the weights, or the work was cancelled.
    pub fn convolution(&mut self, of: Value, weights: ParameterId, connections: Connections<'a>) -> Result<Value> {
        let layer = self.layer(of, weights, connections);
        let (values, channels) = (layer.forward_in(self.values(of), self.workspace, self.monitor)?, layer.outputs);
        Ok(self.push(Operation::Convolution { of, weights, connections }, values, channels))
    }

    fn layer(&self, of: Value, weights: ParameterId, connections: Connections<'a>) -> Convolution<'a, T> {
        let (weights, inputs) = (self.parameters.get(weights), self.channels(of));
        let outputs = weights.len() / (connections.map().volume() * inputs).max(1);
        Convolution { connections, weights, inputs, outputs }
    }

    /// Batch normalisation, then `beside` is added if there is one, then negative values become 0.
    pub fn norm(&mut self, of: Value, beside: Option<Value>, norm: NormIds) -> Value {
        let channels = self.channels(of);
        let moments = match self.training {
            true => Moments::of(self.values(of), channels),
            false => Moments {
                mean: self.parameters.get(norm.mean).to_vec(),
                variance: self.parameters.get(norm.variance).to_vec(),
            },
        };
        let mut values = match self.training {
            true => self.workspace.copied(self.values(of)),
            false => self.take(of),
        };
        let other = beside.map(|other| self.values(other)).unwrap_or_default();
        self.batch_norm(norm).forward(&mut values, &moments, other, true);
        self.push(Operation::Norm { of, beside, norm, moments }, values, channels)
    }

    fn batch_norm(&self, norm: NormIds) -> BatchNorm<'a, T> {
        let (scale, shift) = (self.parameters.get(norm.scale), self.parameters.get(norm.shift));
        BatchNorm { scale, shift, epsilon: T::of(EPSILON) }
    }

    /// The channels of both, side by side.
    pub fn joined(&mut self, left: Value, right: Value) -> Value {
        let (first, second) = (self.channels(left), self.channels(right));
        let channels = first + second;
        let mut values = self.workspace.zeros(self.values(left).len() / first.max(1) * channels);
        let rows = self.values(left).par_chunks(BLOCK * first).zip(self.values(right).par_chunks(BLOCK * second));
        values.par_chunks_mut(BLOCK * channels).zip(rows).for_each(|(out, (left, right))| {
            let rows = left.chunks_exact(first).zip(right.chunks_exact(second));
            for (out, (left, right)) in out.chunks_exact_mut(channels).zip(rows) {
                out[..first].copy_from_slice(left);
                out[first..].copy_from_slice(right);
            }
        });
        self.push(Operation::Joined { left, right }, values, channels)
    }

    /// A product with a matrix.
    ///
    /// # Errors
    /// If the channels do not fit, or the work was cancelled.
    pub fn linear(&mut self, of: Value, linear: LinearIds) -> Result<Value> {
        let layer = self.product(linear);
        let (values, channels) = (layer.forward(self.values(of), self.monitor)?, layer.bias.len());
        Ok(self.push(Operation::Linear { of, linear }, values, channels))
    }

    fn product(&self, linear: LinearIds) -> Linear<'a, T> {
        Linear { weights: self.parameters.get(linear.weights), bias: self.parameters.get(linear.bias) }
    }

    /// Gradients of a loss with respect to all parameters, given that with respect to the last value.
    ///
    /// # Errors
    /// If a length does not fit, or the work was cancelled.
    pub fn backward(&self, gradient: Vec<T>) -> Result<Gradients<T>> {
        let mut found = self.parameters.no_gradients();
        let mut open: Vec<Vec<T>> = vec![Vec::new(); self.nodes.len()];
        if let Some(last) = open.last_mut() {
            *last = gradient;
        }
        for place in (0..self.nodes.len()).rev() {
            let (node, mut own) = (&self.nodes[place], std::mem::take(&mut open[place]));
            if own.is_empty() {
                continue;
            }
            match &node.operation {
                Operation::Input => {}
                Operation::Convolution { of, weights, connections } => {
                    let layer = self.layer(*of, *weights, *connections);
                    let gradient = layer.backward_in(self.values(*of), &own, self.workspace, self.monitor)?;
                    add_gradient(&mut found, *weights, &gradient.weights);
                    self.add(&mut open[of.0], gradient.values);
                    self.workspace.recycle(own);
                }
                Operation::Norm { of, beside, norm, moments } => {
                    stop_below(&mut own, &node.values);
                    if let Some(beside) = beside {
                        self.add(&mut open[beside.0], self.workspace.copied(&own));
                    }
                    let gradient = self.batch_norm(*norm).backward(self.values(*of), moments, own);
                    add_gradient(&mut found, norm.scale, &gradient.scale);
                    add_gradient(&mut found, norm.shift, &gradient.shift);
                    self.add(&mut open[of.0], gradient.values);
                }
                Operation::Joined { left, right } => {
                    let first = self.channels(*left);
                    let part = |range: std::ops::Range<usize>| {
                        let width = range.len();
                        let mut part = self.workspace.zeros(own.len() / node.channels * width);
                        let rows = own.par_chunks(BLOCK * node.channels);
                        part.par_chunks_mut(BLOCK * width).zip(rows).for_each(|(part, rows)| {
                            let rows = rows.chunks_exact(node.channels);
                            part.chunks_exact_mut(width)
                                .zip(rows)
                                .for_each(|(p, row)| p.copy_from_slice(&row[range.clone()]));
                        });
                        part
                    };
                    self.add(&mut open[left.0], part(0..first));
                    self.add(&mut open[right.0], part(first..node.channels));
                    self.workspace.recycle(own);
                }
                Operation::Linear { of, linear } => {
                    let gradient = self.product(*linear).backward(self.values(*of), &own, self.monitor)?;
                    add_gradient(&mut found, linear.weights, &gradient.weights);
                    add_gradient(&mut found, linear.bias, &gradient.bias);
                    self.add(&mut open[of.0], gradient.values);
                }
            }
        }
        Ok(found)
    }

    fn add(&self, sum: &mut Vec<T>, values: Vec<T>) {
        if sum.is_empty() {
            *sum = values;
            return;
        }
        sum.par_iter_mut().zip(&values).for_each(|(sum, &value)| *sum += value);
        self.workspace.recycle(values);
    }

    /// The running moments after this pass.
    pub fn followed(&self) -> Vec<Followed<T>> {
        let mixed = |old: &[T], new: &[T], factor: f64| -> Vec<T> {
            let (keep, take) = (T::of(1.0 - MOMENTUM), T::of(MOMENTUM * factor));
            old.iter().zip(new).map(|(&old, &new)| keep * old + take * new).collect()
        };
        let of = |node: &Node<'_, T>| {
            let Operation::Norm { norm, moments, .. } = &node.operation else { return None };
            let rows = (node.values.len() / node.channels.max(1)) as f64;
            // The running variance has the divisor n − 1.
            let moments = Moments {
                mean: mixed(self.parameters.get(norm.mean), &moments.mean, 1.0),
                variance: mixed(self.parameters.get(norm.variance), &moments.variance, rows / (rows - 1.0).max(1.0)),
            };
            Some(Followed { norm: *norm, moments })
        };
        self.nodes.iter().filter_map(of).collect()
    }
}

impl<T: Scalar> Followed<T> {
    /// Stores the moments.
    pub fn store(&self, parameters: &mut Parameters<T>) {
        parameters.get_mut(self.norm.mean).copy_from_slice(&self.moments.mean);
        parameters.get_mut(self.norm.variance).copy_from_slice(&self.moments.variance);
    }
}

impl<T: Scalar> Drop for Tape<'_, T> {
    fn drop(&mut self) {
        self.nodes.drain(..).for_each(|node| self.workspace.recycle(node.values));
    }
}
