//! Levels of convolutions, sparse or dense, each with max pooling after it.

use super::build::{Builder, SIZE, affine};
use crate::error::Result;
use crate::nn::dense::{self, DenseConvolution, DensePooled, Grid};
use crate::nn::layers::{rectify, stop_below};
use crate::nn::objects::ObjectShape;
use crate::nn::parameters::{Gradients, ParameterId, Parameters, Role, add_gradient};
use crate::nn::scalar::Scalar;
use crate::nn::sparse::{self, Attention, Pooled, Responses, Selection, SparseConvolution, SparseFilter, SparseTensor};
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Convolutions, then max pooling of two cells along each axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectLevel {
    /// Output channels of each convolution, 1 to 512.
    pub channels: Vec<usize>,
    /// Upper bound ρ_up of the density of each channel, above 0, at most 1; `None` (`"none"`): a dense level, and all after
    /// it.
    #[serde(with = "crate::settings::optional")]
    pub density: Option<f64>,
}

/// A convolution.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Layer {
    weights: ParameterId,
    bias: ParameterId,
    channels: [usize; 2],
    /// Upper bound of the density; `None`: dense.
    density: Option<f64>,
    /// Whether max pooling follows.
    pools: bool,
}

/// Numbers of values of levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Size {
    /// Parameters.
    pub(super) parameters: usize,
    /// Values of a sample after the last level.
    pub(super) flat: usize,
    /// Values of a sample between two layers, where there are most.
    pub(super) widest: usize,
}

impl Size {
    /// The size of levels for samples of a shape; `None` if a number overflows.
    pub(super) fn of(levels: &[ObjectLevel], shape: &ObjectShape) -> Option<Self> {
        let product = |extent: &[usize]| extent.iter().try_fold(1usize, |cells, &length| cells.checked_mul(length));
        let volume = SIZE.checked_pow(u32::try_from(shape.extent.len()).ok()?)?;
        let (mut inputs, mut extent) = (shape.channels, shape.extent.clone());
        let mut size = Self { parameters: 0, flat: 0, widest: product(&extent)?.checked_mul(inputs)? };
        for level in levels {
            let cells = product(&extent)?;
            for &outputs in &level.channels {
                size.parameters = size.parameters.checked_add(affine(inputs.checked_mul(volume)?, outputs)?)?;
                size.widest = size.widest.max(cells.checked_mul(outputs)?);
                inputs = outputs;
            }
            extent.iter_mut().for_each(|length| *length /= 2);
        }
        size.flat = inputs.checked_mul(product(&extent)?)?;
        Some(size)
    }
}

/// The weights of a sparse convolution that were not removed by pruning: their numbers, ascending.
pub type Kept = Vec<u64>;

/// The parameters of a network, and those of its sparse weights that are left.
#[derive(Clone, Copy, Debug)]
pub struct Weights<'a, T> {
    /// The parameters.
    pub parameters: &'a Parameters<T>,
    /// One list a sparse convolution; empty: all weights are left.
    pub kept: &'a [Kept],
}

/// The levels of a network: which parameter is used where.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Levels {
    layers: Vec<Layer>,
    attention: Attention,
    /// Values of a sample after the last level.
    pub(super) flat: usize,
}

impl Levels {
    /// The levels for samples of a shape; the names of their parameters begin with `prefix`.
    pub(super) fn new<T: Scalar>(
        build: &mut Builder<'_, T>,
        prefix: &str,
        levels: &[ObjectLevel],
        shape: &ObjectShape,
    ) -> Self {
        let (mut layers, mut inputs, mut extent) = (Vec::new(), shape.channels, shape.extent.clone());
        let volume = SIZE.pow(extent.len() as u32);
        for (number, level) in levels.iter().enumerate() {
            for (place, &outputs) in level.channels.iter().enumerate() {
                let name = format!("{prefix}level{number}.convolution{place}");
                let dims = [&[outputs, inputs][..], &vec![SIZE; extent.len()]].concat();
                let weights = build.weights(format!("{name}.weights"), &dims, inputs * volume);
                let bias = build.parameters.constant(format!("{name}.bias"), outputs, 0.0, Role::Bias);
                let pools = place + 1 == level.channels.len();
                layers.push(Layer { weights, bias, channels: [inputs, outputs], density: level.density, pools });
                inputs = outputs;
            }
            extent.iter_mut().for_each(|length| *length /= 2);
        }
        let flat = inputs * extent.iter().product::<usize>();
        Self { layers, attention: Attention::default(), flat }
    }

    pub(super) fn with_attention(self, attention: Attention) -> Self {
        Self { attention, ..self }
    }

    /// The weights of each sparse convolution, in their order.
    pub(super) fn sparse_weights(&self) -> Vec<ParameterId> {
        self.layers.iter().filter(|layer| layer.density.is_some()).map(|layer| layer.weights).collect()
    }

    /// Biases of the sparse convolutions.
    pub(super) fn sparse_biases(&self) -> Vec<ParameterId> {
        self.layers.iter().filter(|layer| layer.density.is_some()).map(|layer| layer.bias).collect()
    }

    /// Upper bound of the density of each sparse convolution.
    pub(super) fn densities(&self) -> Vec<f64> {
        self.layers.iter().filter_map(|layer| layer.density).collect()
    }

    /// Passes a batch through all levels.
    ///
    /// # Errors
    /// If the batch does not fit, or the work was cancelled.
    pub(super) fn pass<'a, T: Scalar>(
        &'a self,
        weights: Weights<'a, T>,
        batch: SparseTensor<T>,
        monitor: &Monitor,
    ) -> Result<LevelsPass<'a, T>> {
        let mut pass = LevelsPass { levels: self, weights, steps: Vec::new(), flat: Vec::new(), densities: Vec::new() };
        let mut signal = Signal::Sparse(batch);
        for layer in &self.layers {
            signal = match layer.density {
                Some(_) => pass.sparse(layer, signal, monitor)?,
                None => pass.dense(layer, signal, monitor)?,
            };
            if layer.pools {
                signal = pass.pooled(signal)?;
            }
        }
        pass.flat = pass.filled(signal)?.values;
        Ok(pass)
    }
}

/// Values of whole grids.
struct Rows<T> {
    grid: Grid,
    channels: usize,
    values: Vec<T>,
}

/// Values between layers.
enum Signal<T> {
    Sparse(SparseTensor<T>),
    Dense(Rows<T>),
}

/// What a layer remembers for the gradients.
enum Step<T> {
    Sparse {
        layer: Layer,
        filter: SparseFilter<T>,
        input: SparseTensor<T>,
        output: SparseTensor<T>,
    },
    SparsePool(Pooled<T>),
    /// From entries to whole grids.
    Filled(SparseTensor<T>),
    Dense {
        layer: Layer,
        input: Rows<T>,
        output: Vec<T>,
    },
    DensePool(DensePooled<T>),
}

/// A pass of a batch through the levels.
pub(super) struct LevelsPass<'a, T> {
    levels: &'a Levels,
    weights: Weights<'a, T>,
    steps: Vec<Step<T>>,
    /// What comes out: a row a sample, cell by cell.
    pub(super) flat: Vec<T>,
    /// For each sparse convolution the densities of its channels before the strongest were selected.
    pub(super) densities: Vec<Vec<f64>>,
}

impl<T: Scalar> LevelsPass<'_, T> {
    /// Bytes of the sparse tensors that are kept for the gradients.
    pub(super) fn sparse_bytes(&self) -> usize {
        let bytes = |step: &Step<T>| match step {
            Step::Sparse { input, output, .. } => input.bytes() + output.bytes(),
            _ => 0,
        };
        self.steps.iter().map(bytes).sum()
    }

    /// Adds the gradients of the parameters, given that with respect to what came out.
    ///
    /// # Errors
    /// If the lengths differ, or the work was cancelled.
    pub(super) fn backward(self, towards: Vec<T>, gradients: &mut Gradients<T>, monitor: &Monitor) -> Result<()> {
        let Self { weights, steps, .. } = self;
        let mut back = Back { parameters: weights.parameters, gradients, monitor };
        steps.into_iter().rev().try_fold(towards, |towards, step| back.step(step, towards)).map(|_| ())
    }

    fn sparse(&mut self, layer: &Layer, signal: Signal<T>, monitor: &Monitor) -> Result<Signal<T>> {
        let Signal::Sparse(input) = signal else { return Ok(signal) };
        let filter = self.filter(layer, input.shape().extent.len())?;
        let selection = layer.density.map(|density| Selection { attention: self.levels.attention, density });
        let bias = self.weights.parameters.get(layer.bias);
        let Responses { tensor, densities } =
            SparseConvolution { filter: &filter, bias, selection }.responses(&input, monitor).map_err(|error| {
                let name = self.weights.parameters.name(layer.weights);
                error.within(name.trim_end_matches(".weights"))
            })?;
        // The largest responses above 0 are rectified already.
        let tensor = if self.levels.attention == Attention::Magnitude { tensor.rectified() } else { tensor };
        self.densities.push(densities);
        self.steps.push(Step::Sparse { layer: *layer, filter, input, output: tensor.clone() });
        Ok(Signal::Sparse(tensor))
    }

    /// The weights of the next sparse convolution that are left.
    fn filter(&self, layer: &Layer, axes: usize) -> Result<SparseFilter<T>> {
        let values = self.weights.parameters.get(layer.weights).to_vec();
        let filter = SparseFilter::of_dense(layer.channels, SIZE, axes, values)?;
        Ok(match self.weights.kept.get(self.densities.len()) {
            None => filter,
            Some(kept) => filter.pruned(|i, _| kept.binary_search(&(i as u64)).is_ok()),
        })
    }

    fn dense(&mut self, layer: &Layer, signal: Signal<T>, monitor: &Monitor) -> Result<Signal<T>> {
        let input = self.filled(signal)?;
        let convolution = layer.dense(self.weights.parameters, &input.grid);
        let mut values = convolution.forward(&input.values, monitor)?;
        rectify(&mut values);
        let rows = Rows { grid: input.grid.clone(), channels: layer.channels[1], values: values.clone() };
        self.steps.push(Step::Dense { layer: *layer, input, output: values });
        Ok(Signal::Dense(rows))
    }

    fn pooled(&mut self, signal: Signal<T>) -> Result<Signal<T>> {
        Ok(match signal {
            Signal::Sparse(tensor) => {
                let pooled = sparse::max_pool(&tensor, 2)?;
                let tensor = pooled.tensor.clone();
                self.steps.push(Step::SparsePool(pooled));
                Signal::Sparse(tensor)
            }
            Signal::Dense(rows) => {
                let mut pooled = dense::max_pool(&rows.grid, &rows.values, rows.channels, 2)?;
                let (grid, values) = (pooled.grid.clone(), std::mem::take(&mut pooled.values));
                self.steps.push(Step::DensePool(pooled));
                Signal::Dense(Rows { grid, channels: rows.channels, values })
            }
        })
    }

    /// Values of whole grids, 0 where there is no entry.
    fn filled(&mut self, signal: Signal<T>) -> Result<Rows<T>> {
        let tensor = match signal {
            Signal::Dense(rows) => return Ok(rows),
            Signal::Sparse(tensor) => tensor,
        };
        let (grid, channels) = (Grid::new(tensor.shape().samples, &tensor.shape().extent)?, tensor.shape().channels);
        let mut values = vec![T::ZERO; grid.rows() * channels];
        for (&key, &value) in tensor.keys().iter().zip(tensor.values()) {
            values[place(key, channels, grid.cells())] = value;
        }
        self.steps.push(Step::Filled(tensor));
        Ok(Rows { grid, channels, values })
    }
}

/// A pass backwards.
struct Back<'a, T> {
    parameters: &'a Parameters<T>,
    gradients: &'a mut Gradients<T>,
    monitor: &'a Monitor,
}

impl<T: Scalar> Back<'_, T> {
    /// The gradient with respect to the input of a step; adds to those of its parameters.
    fn step(&mut self, step: Step<T>, mut towards: Vec<T>) -> Result<Vec<T>> {
        match step {
            Step::SparsePool(pooled) => Ok(pooled.backward(&towards)),
            Step::DensePool(pooled) => Ok(pooled.backward(&towards)),
            Step::Filled(tensor) => {
                let (channels, cells) = (tensor.shape().channels, tensor.shape().cells());
                Ok(tensor.keys().iter().map(|&key| towards[place(key, channels, cells)]).collect())
            }
            Step::Dense { layer, input, output } => {
                stop_below(&mut towards, &output);
                let convolution = layer.dense(self.parameters, &input.grid);
                let found = convolution.backward(&input.values, &towards, self.monitor)?;
                add_gradient(self.gradients, layer.weights, &found.weights);
                add_gradient(self.gradients, layer.bias, &found.bias);
                Ok(found.values)
            }
            Step::Sparse { layer, filter, input, output } => {
                let convolution =
                    SparseConvolution { filter: &filter, bias: self.parameters.get(layer.bias), selection: None };
                let found = convolution.backward(&input, &output.with_values(towards)?, self.monitor)?;
                let mut weights = vec![T::ZERO; self.parameters.get(layer.weights).len()];
                filter.keys().iter().zip(&found.weights).for_each(|(&key, &value)| weights[key as usize] = value);
                add_gradient(self.gradients, layer.weights, &weights);
                add_gradient(self.gradients, layer.bias, &found.bias);
                Ok(found.values)
            }
        }
    }
}

impl Layer {
    fn dense<'a, T: Scalar>(&self, parameters: &'a Parameters<T>, grid: &'a Grid) -> DenseConvolution<'a, T> {
        DenseConvolution { grid, size: SIZE, weights: parameters.get(self.weights), bias: parameters.get(self.bias) }
    }
}

/// Place of an entry in grids whose cells have their channels side by side.
fn place(key: u64, channels: usize, cells: usize) -> usize {
    let (plane, cell) = (key as usize / cells, key as usize % cells);
    (plane / channels * cells + cell) * channels + plane % channels
}
