//! Tests that compare layers and optimisers with the results of torch for the same inputs
//! (`scripts/torch_reference.py`).

use super::arrays::{Array, Arrays};
use super::dense::{self, DenseConvolution, Grid};
use super::layers::{BatchNorm, Linear, Moments, cross_entropy, softmax};
use super::parameters::{Parameters, Role};
use super::scalar::Scalar;
use super::sites::{Connections, Convolution, Kernel, KernelMap, Sites};
use super::sparse::{self, Shape, SparseConvolution, SparseFilter, SparseTensor};
use super::tape::{NormIds, Tape};
use super::training::{Optimiser, OptimiserState};
use super::workspace::Workspace;
use crate::parallel::Monitor;
use std::path::Path;

/// The arrays of one file.
struct Reference(Arrays);

/// An array as torch lays it out.
struct Torch<T> {
    shape: Vec<usize>,
    values: Vec<T>,
}

impl Reference {
    fn read(bytes: &[u8]) -> Self {
        Self(Arrays::from_bytes(bytes, Path::new("reference")).unwrap())
    }

    fn array<T: Scalar>(&self, case: &str, name: &str) -> Torch<T> {
        let own = format!("{case}.{name}");
        let found = self.0.iter().find(|(name, _)| **name == own).map(|(_, array)| array);
        let Some(Array::Single(shape, values)) = found else { panic!("no array {own}") };
        Torch { shape: shape.clone(), values: values.iter().map(|&v| T::of(f64::from(v))).collect() }
    }

    fn values<T: Scalar>(&self, case: &str, name: &str) -> Vec<T> {
        self.array(case, name).values
    }
}

impl<T: Scalar> Torch<T> {
    /// The values of (a, b, all other axes) in another order of these three.
    fn ordered(&self, order: [usize; 3]) -> Vec<T> {
        let (a, b) = (self.shape[0], self.shape[1]);
        let lengths = [a, b, self.values.len() / (a * b)];
        let [i, j, k] = order.map(|axis| lengths[axis]);
        let places = (0..i).flat_map(|i| (0..j).flat_map(move |j| (0..k).map(move |k| [i, j, k])));
        let value = |place: [usize; 3]| {
            let mut at = [0; 3];
            order.into_iter().zip(place).for_each(|(axis, place)| at[axis] = place);
            self.values[(at[0] * lengths[1] + at[1]) * lengths[2] + at[2]]
        };
        places.map(value).collect()
    }

    /// The channels of a cell side by side, of (sample, channel, cells).
    fn rows(&self) -> Vec<T> {
        self.ordered([0, 2, 1])
    }

    /// A matrix of inputs by outputs for each position, of (output, input, positions).
    fn matrices(&self) -> Vec<T> {
        self.ordered([2, 1, 0])
    }
}

/// Relative error below 1e-5 in single and 1e-7 in double precision (results are stored in single precision), with a tenth
/// of that of the largest value beside, as sums cancel.
fn same<T: Scalar>(what: &str, found: &[T], expected: &[T]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let share = if size_of::<T>() == 8 { 1e-7 } else { 1e-5 };
    let largest = expected.iter().map(|v| v.wide().abs()).fold(0.0, f64::max);
    for (at, (found, expected)) in found.iter().zip(expected).enumerate() {
        let (found, expected) = (found.wide(), expected.wide());
        let most = share * expected.abs() + 0.1 * share * largest;
        assert!((found - expected).abs() <= most, "{what}, value {at}: {found}, torch: {expected}");
    }
}

/// All cells of a grid as sites.
fn full<const D: usize>(samples: usize, extent: &[usize]) -> Sites<D> {
    let cells: usize = extent.iter().product();
    let key = |number: usize| {
        let mut rest = number % cells;
        let mut position = [0; D];
        for (axis, &length) in extent.iter().enumerate().rev() {
            (position[axis], rest) = ((rest % length) as i64, rest / length);
        }
        Sites::<D>::key((number / cells) as u32, position).unwrap()
    };
    Sites::of_keys((0..samples * cells).map(key).collect(), &Monitor::default()).unwrap()
}

fn convolutions() -> Reference {
    Reference::read(include_bytes!("testdata/convolutions.safetensors"))
}

const GRIDS: [&str; 4] = ["line", "image", "cube", "scattered"];

fn dense_convolution<T: Scalar>() {
    let (all, monitor) = (convolutions(), Monitor::default());
    for case in GRIDS {
        let x = all.array::<T>(case, "x");
        let grid = Grid::new(x.shape[0], &x.shape[2..]).unwrap();
        let (weights, bias) = (all.values::<T>(case, "weights"), all.values::<T>(case, "bias"));
        let layer = DenseConvolution { grid: &grid, size: 3, weights: &weights, bias: &bias };
        same(case, &layer.forward(&x.rows(), &monitor).unwrap(), &all.array(case, "y").rows());
        let found = layer.backward(&x.rows(), &all.array(case, "towards").rows(), &monitor).unwrap();
        same(case, &found.values, &all.array(case, "dx").rows());
        same(case, &found.weights, &all.values(case, "dweights"));
        same(case, &found.bias, &all.values(case, "dbias"));
    }
}

#[test]
fn dense_convolutions_are_those_of_torch() {
    dense_convolution::<f32>();
    dense_convolution::<f64>();
}

/// On what is stored: responses, inputs and weights that are not 0.
fn sparse_convolution<T: Scalar>() {
    let (all, monitor) = (convolutions(), Monitor::default());
    for case in GRIDS {
        let x = all.array::<T>(case, "x");
        let (samples, extent) = (x.shape[0], &x.shape[2..]);
        let weights = all.array::<T>(case, "weights");
        let channels = [weights.shape[1], weights.shape[0]];
        let filter = SparseFilter::of_dense(channels, 3, extent.len(), weights.values).unwrap();
        let filter = filter.pruned(|_, weight| weight != T::ZERO);
        assert!(filter.density() < 0.8);
        let bias = all.values::<T>(case, "bias");
        let layer = SparseConvolution { filter: &filter, bias: &bias, selection: None };
        let input = SparseTensor::of_dense(Shape::new(samples, channels[0], extent).unwrap(), &x.values).unwrap();
        let found = layer.forward(&input, &monitor).unwrap();
        let of = |name: &str, keys: &[u64]| -> Vec<T> {
            let values = all.values::<T>(case, name);
            keys.iter().map(|&key| values[key as usize]).collect()
        };
        same(case, found.values(), &of("y", found.keys()));
        // Where nothing is stored torch has the term alone.
        let mut rest = all.values::<T>(case, "y");
        found.keys().iter().for_each(|&key| rest[key as usize] = T::ZERO);
        let cells: usize = extent.iter().product();
        let terms = (0..rest.len()).map(|at| (rest[at], bias[at / cells % channels[1]]));
        assert!(terms.clone().all(|(y, term)| y == T::ZERO || y == term), "{case}");
        assert!(case != "scattered" || terms.filter(|(y, _)| *y != T::ZERO).count() > 200);
        let towards = found.with_values(of("towards", found.keys())).unwrap();
        let slopes = layer.backward(&input, &towards, &monitor).unwrap();
        same(case, &slopes.values, &of("dx", input.keys()));
        same(case, &slopes.weights, &of("dweights", filter.keys()));
        same(case, &slopes.bias, &all.values(case, "dbias"));
    }
}

#[test]
fn direct_sparse_convolutions_are_those_of_torch_on_what_is_stored() {
    sparse_convolution::<f32>();
    sparse_convolution::<f64>();
}

fn submanifold<T: Scalar, const D: usize>(case: &str, dilation: usize) {
    let (all, monitor) = (convolutions(), Monitor::default());
    let x = all.array::<T>(case, "x");
    let sites = full::<D>(x.shape[0], &x.shape[2..]);
    let kernel = Kernel { dilation, padding: dilation, ..Kernel::centred(3) };
    let map = KernelMap::new(&sites, &sites, kernel, &monitor).unwrap();
    let (weights, bias) = (all.array::<T>(case, "weights"), all.values::<T>(case, "bias"));
    let connections = Connections::centred(&map);
    let layer =
        Convolution { connections, weights: &weights.matrices(), inputs: weights.shape[1], outputs: bias.len() };
    let mut found = layer.forward(&x.rows(), &monitor).unwrap();
    found.chunks_mut(bias.len()).for_each(|row| row.iter_mut().zip(&bias).for_each(|(v, &b)| *v += b));
    same(case, &found, &all.array(case, "y").rows());
    let slopes = layer.backward(&x.rows(), &all.array(case, "towards").rows(), &monitor).unwrap();
    same(case, &slopes.values, &all.array(case, "dx").rows());
    same(case, &slopes.weights, &all.array(case, "dweights").matrices());
}

#[test]
fn submanifold_convolutions_of_full_grids_are_those_of_torch() {
    fn all<T: Scalar>() {
        submanifold::<T, 1>("line", 1);
        submanifold::<T, 2>("image", 1);
        submanifold::<T, 3>("cube", 1);
        submanifold::<T, 3>("dilated", 2);
    }
    all::<f32>();
    all::<f64>();
}

fn strided<T: Scalar>() {
    let all = Reference::read(include_bytes!("testdata/strided.safetensors"));
    let monitor = Monitor::default();
    let fine = full::<3>(2, &[4, 6, 4]);
    let coarse = fine.coarser(2, &monitor).unwrap();
    for (name, kernel) in
        [("cubes", Kernel::cubes(2)), ("overlapping", Kernel { size: 3, stride: 2, dilation: 1, padding: 1 })]
    {
        let down = KernelMap::new(&fine, &coarse, kernel, &monitor).unwrap();
        let up = down.transposed(&monitor).unwrap();
        let connections = Connections::directed(&down, &up);
        // The weights of a transposed convolution are (input, output, positions).
        let transposed = format!("transposed-{name}");
        for (case, connections, order) in
            [(name, connections, [2, 1, 0]), (&transposed, connections.reversed(), [2, 0, 1])]
        {
            let weights = all.array::<T>(case, "weights");
            let (inputs, outputs) = (weights.shape[order[1]], weights.shape[order[2]]);
            let layer = Convolution { connections, weights: &weights.ordered(order), inputs, outputs };
            let x = all.array::<T>(case, "x").rows();
            same(case, &layer.forward(&x, &monitor).unwrap(), &all.array(case, "y").rows());
            let slopes = layer.backward(&x, &all.array(case, "towards").rows(), &monitor).unwrap();
            same(case, &slopes.values, &all.array(case, "dx").rows());
            same(case, &slopes.weights, &all.array(case, "dweights").ordered(order));
        }
    }
}

#[test]
fn strided_and_transposed_convolutions_of_full_grids_are_those_of_torch() {
    strided::<f32>();
    strided::<f64>();
}

fn layers() -> Reference {
    Reference::read(include_bytes!("testdata/layers.safetensors"))
}

fn norm<T: Scalar>() {
    let all = layers();
    let get = |name: &str| all.values::<T>("norm", name);
    let (scale, shift, x) = (get("scale"), get("shift"), get("x"));
    let layer = BatchNorm { scale: &scale, shift: &shift, epsilon: T::of(1e-5) };
    let moments = Moments::of(&x, 5);
    let mut found = x.clone();
    layer.forward(&mut found, &moments, &[], false);
    same("training", &found, &get("y"));
    let slopes = layer.backward(&x, &moments, get("towards"));
    same("values", &slopes.values, &get("dx"));
    same("scale", &slopes.scale, &get("dscale"));
    same("shift", &slopes.shift, &get("dshift"));
    let mut found = x.clone();
    layer.forward(&mut found, &Moments { mean: get("mean"), variance: get("variance") }, &[], false);
    same("evaluation", &found, &get("evaluated"));

    // The running moments that the tape follows.
    let mut parameters = Parameters::<T>::default();
    let mut add = |name: &str, role| {
        let id = parameters.constant(name, 5, 0.0, role);
        parameters.get_mut(id).copy_from_slice(&get(name));
        id
    };
    let (mean, variance) = (add("mean", Role::Statistic), add("variance", Role::Statistic));
    let norm = NormIds { scale: add("scale", Role::Bias), shift: add("shift", Role::Bias), mean, variance };
    let (workspace, monitor) = (Workspace::default(), Monitor::default());
    let mut tape = Tape::training(&parameters, &workspace, &monitor);
    let input = tape.input(x, 5);
    tape.norm(input, None, norm);
    let followed = tape.followed();
    drop(tape);
    followed[0].store(&mut parameters);
    same("running mean", parameters.get(mean), &get("mean-after"));
    same("running variance", parameters.get(variance), &get("variance-after"));
}

#[test]
fn batch_normalisation_is_that_of_torch() {
    norm::<f32>();
    norm::<f64>();
}

fn connected<T: Scalar>() {
    let (all, monitor) = (layers(), Monitor::default());
    let get = |name: &str| all.values::<T>("linear", name);
    // (output, input) in torch.
    let (weights, bias) = (all.array::<T>("linear", "weights").matrices(), get("bias"));
    let layer = Linear { weights: &weights, bias: &bias };
    same("linear", &layer.forward(&get("x"), &monitor).unwrap(), &get("y"));
    let slopes = layer.backward(&get("x"), &get("towards"), &monitor).unwrap();
    same("values", &slopes.values, &get("dx"));
    same("weights", &slopes.weights, &all.array("linear", "dweights").matrices());
    same("bias", &slopes.bias, &get("dbias"));

    let get = |name: &str| all.values::<T>("entropy", name);
    let mut scores = get("x");
    let loss = cross_entropy(&scores, &get("targets"), 4);
    same("loss", &[T::of(loss.value)], &get("y"));
    same("gradient", &loss.gradient, &get("dx"));
    softmax(&mut scores, 4);
    same("probabilities", &scores, &get("probabilities"));
}

#[test]
fn linear_layers_and_cross_entropy_are_those_of_torch() {
    connected::<f32>();
    connected::<f64>();
}

#[test]
fn max_pooling_is_that_of_torch() {
    let all = layers();
    for case in ["pool2", "pool3"] {
        let x = all.array::<f32>(case, "x");
        let grid = Grid::new(x.shape[0], &x.shape[2..]).unwrap();
        let pooled = dense::max_pool(&grid, &x.rows(), x.shape[1], 2).unwrap();
        assert_eq!(pooled.values, all.array::<f32>(case, "y").rows());
        let towards = all.array::<f32>(case, "towards").rows();
        assert_eq!(pooled.backward(&towards), all.array::<f32>(case, "dx").rows());

        // Values that are not negative; windows without an entry have no gradient.
        let case = format!("sparse-{case}");
        let x = all.array::<f32>(&case, "x");
        let shape = Shape::new(x.shape[0], x.shape[1], &x.shape[2..]).unwrap();
        let tensor = SparseTensor::of_dense(shape, &x.values).unwrap();
        let pooled = sparse::max_pool(&tensor, 2).unwrap();
        assert_eq!(pooled.tensor.to_dense(), all.values::<f32>(&case, "y"));
        let of = |name: &str, keys: &[u64]| -> Vec<f32> {
            let values = all.values::<f32>(&case, name);
            keys.iter().map(|&key| values[key as usize]).collect()
        };
        assert_eq!(pooled.backward(&of("towards", pooled.tensor.keys())), of("dx", tensor.keys()));
    }
}

fn optimisers<T: Scalar>() {
    let all = Reference::read(include_bytes!("testdata/optimisers.safetensors"));
    let (weights, bias) = (all.values::<T>("given", "weights"), all.values::<T>("given", "bias"));
    let slopes = all.values::<T>("given", "gradients");
    for (name, optimiser) in [
        ("sgd", Optimiser::Sgd { momentum: 0.9, decay: 0.05 }),
        ("adagrad", Optimiser::Adagrad { epsilon: 1e-10 }),
        ("adadelta", Optimiser::Adadelta { rho: 0.9, epsilon: 1e-6 }),
        ("adamw", Optimiser::AdamW { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, decay: 0.2 }),
    ] {
        let mut parameters = Parameters::default();
        let first = parameters.constant("weights", weights.len(), 0.0, Role::Weight);
        let second = parameters.constant("bias", bias.len(), 0.0, Role::Bias);
        parameters.get_mut(first).copy_from_slice(&weights);
        parameters.get_mut(second).copy_from_slice(&bias);
        let (mut state, mut found) = (OptimiserState::default(), Vec::new());
        for (step, slopes) in slopes.chunks(weights.len() + bias.len()).enumerate() {
            let (of_weights, of_bias) = slopes.split_at(weights.len());
            let rate = 0.1 / (1 + step / 5) as f64;
            optimiser.step(&mut parameters, &vec![of_weights.to_vec(), of_bias.to_vec()], rate, &mut state).unwrap();
            found.extend(parameters.iter().flat_map(|parameter| parameter.values.clone()));
        }
        same(name, &found, &all.values(name, "steps"));
    }
}

#[test]
fn ten_steps_of_every_optimiser_are_those_of_torch() {
    optimisers::<f32>();
    optimisers::<f64>();
}
