//! A sparse U-Net: classes of all sites of a scene.
//!
//! O. Ronneberger, P. Fischer, T. Brox, *U-Net*, MICCAI 2015, with the sub-manifold convolutions of Graham et al. 2018
//! (doi:10.1109/CVPR.2018.00961) and residual connections.

use super::build::{affine, limited};
use crate::error::{Error, Result};
use crate::nn::parameters::{ParameterId, Parameters, Role};
use crate::nn::scalar::Scalar;
use crate::nn::sites::{Connections, Kernel, KernelMap, Sites};
use crate::nn::tape::{LinearIds, NormIds, Tape, Value};
use crate::parallel::Monitor;
use crate::random::{Stream, stream};
use serde::{Deserialize, Serialize};

/// Shape of the network.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UNetParams {
    /// Channels of each level, 2 to 7 levels of 1 to 512; the cells of each level are twice as large as those of the one
    /// before. Multiples of 16 are fastest.
    pub widths: Vec<usize>,
}

impl Default for UNetParams {
    fn default() -> Self {
        Self { widths: vec![16, 32, 64, 96] }
    }
}

impl UNetParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(&self) -> Result<()> {
        let fine = (2..=7).contains(&self.widths.len()) && self.widths.iter().all(|width| (1..=512).contains(width));
        match fine {
            true => Ok(()),
            false => Err(Error::parameter("widths", format!("{:?}", self.widths), "2 to 7 numbers from 1 to 512")),
        }
    }

    /// Number of values, statistics included, of a network for rows of `inputs` channels and so many classes; nothing is
    /// allocated.
    ///
    /// # Errors
    /// If a value is out of range, or there are more than 2^31 values.
    pub fn values(&self, inputs: usize, classes: usize) -> Result<usize> {
        self.validate()?;
        // Weights; scale, shift, mean and variance of each channel.
        let unit = |volume: usize, inputs: usize, outputs: usize| {
            volume.checked_mul(inputs)?.checked_add(4)?.checked_mul(outputs)
        };
        let level = |(number, &width): (usize, &usize)| -> Option<usize> {
            let enter = match number.checked_sub(1) {
                None => unit(27, inputs, width)?,
                Some(above) => unit(8, self.widths[above], width)?,
            };
            let residual = unit(27, width, width)?.checked_mul(2)?;
            let leave = match self.widths.get(number + 1) {
                None => 0,
                Some(&below) => {
                    let convolutions = unit(27, 2 * width, width)?.checked_add(unit(27, width, width)?)?;
                    unit(8, below, width)?.checked_add(convolutions)?
                }
            };
            enter.checked_add(residual)?.checked_add(leave)
        };
        let head = affine(self.widths[0], classes);
        limited(self.widths.iter().enumerate().map(level).fold(head, |sum, own| sum?.checked_add(own?)))
    }

    /// Cells of the finest level that the class of a cell depends on, in each direction.
    pub fn reach(&self) -> usize {
        let levels = self.widths.len() as u32;
        // Two convolutions on the way down and two on the way up, and the rounding to coarser cells.
        (0..levels).map(|level| (if level + 1 == levels { 3 } else { 5 }) << level).sum()
    }
}

/// A convolution and the normalisation after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Unit {
    weights: ParameterId,
    norm: NormIds,
}

/// The parameters of a level.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Level {
    /// From the level above (from the inputs at the first).
    enter: Unit,
    /// Two convolutions with a residual connection around them.
    residual: [Unit; 2],
    /// From the level below, and two convolutions after that; absent at the last level.
    leave: Option<Leave>,
}

/// The way up into a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Leave {
    up: Unit,
    merge: Unit,
    last: Unit,
}

/// The network: which parameter is used where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UNet {
    levels: Vec<Level>,
    head: LinearIds,
    width: usize,
}

/// The sites of a scene on all levels, and which of them are connected.
#[derive(Clone, Debug)]
pub struct SceneLevels {
    sites: Vec<Sites<3>>,
    /// Sub-manifold convolutions on each level.
    within: Vec<KernelMap>,
    /// From each level to the next coarser one.
    down: Vec<KernelMap>,
    /// Back again.
    up: Vec<KernelMap>,
}

impl SceneLevels {
    /// The levels above these sites.
    ///
    /// # Errors
    /// If there are 2^32 sites or more, or the work was cancelled.
    pub fn new(sites: Sites<3>, levels: usize, monitor: &Monitor) -> Result<Self> {
        let mut scene = Self { sites: vec![sites], within: Vec::new(), down: Vec::new(), up: Vec::new() };
        for level in 0..levels {
            let own = &scene.sites[level];
            scene.within.push(KernelMap::new(own, own, Kernel::centred(3), monitor)?);
            if level + 1 < levels {
                let coarse = own.coarser(2, monitor)?;
                let down = KernelMap::new(own, &coarse, Kernel::cubes(2), monitor)?;
                scene.up.push(down.transposed(monitor)?);
                scene.down.push(down);
                scene.sites.push(coarse);
            }
        }
        Ok(scene)
    }

    /// The sites of the finest level.
    pub fn sites(&self) -> &Sites<3> {
        &self.sites[0]
    }

    /// Pairs of sites of the finest level that touch each other, in both directions.
    pub fn touching(&self) -> usize {
        self.within[0].pairs() - self.sites[0].len()
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        let maps = self.within.iter().chain(&self.down).chain(&self.up);
        self.sites.iter().map(Sites::bytes).sum::<usize>() + maps.map(KernelMap::bytes).sum::<usize>()
    }
}

impl UNet {
    /// A network with parameters drawn by a seed, for rows of `inputs` channels and `classes` classes.
    ///
    /// # Errors
    /// As [`UNetParams::values`].
    pub fn new<T: Scalar>(
        params: &UNetParams,
        inputs: usize,
        classes: usize,
        seed: u64,
    ) -> Result<(Self, Parameters<T>)> {
        params.values(inputs, classes)?;
        let mut parameters = Parameters::default();
        let mut build = Builder { parameters: &mut parameters, draws: stream(seed, 0) };
        let widths = &params.widths;
        let mut levels = Vec::with_capacity(widths.len());
        for (level, &width) in widths.iter().enumerate() {
            let name = |part: &str| format!("level{level}.{part}");
            let enter = match level {
                0 => build.unit(&name("enter"), 27, [inputs, width]),
                _ => build.unit(&name("enter"), 8, [widths[level - 1], width]),
            };
            let residual = [0, 1].map(|i| build.unit(&name(&format!("residual{i}")), 27, [width; 2]));
            let leave = widths.get(level + 1).map(|&below| Leave {
                up: build.unit(&name("up"), 8, [below, width]),
                merge: build.unit(&name("merge"), 27, [2 * width, width]),
                last: build.unit(&name("last"), 27, [width; 2]),
            });
            levels.push(Level { enter, residual, leave });
        }
        let head = build.linear("head", [widths[0], classes]);
        Ok((Self { levels, head, width: widths[0] }, parameters))
    }

    /// Channels of the features that the scores are taken from.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Weights (features by classes, row-major) and biases of the scores.
    pub fn head<'a, T: Scalar>(&self, parameters: &'a Parameters<T>) -> (&'a [T], &'a [T]) {
        (parameters.get(self.head.weights), parameters.get(self.head.bias))
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// The channels of each site before the scores of the classes are taken from them. `inputs` has one row a site.
    ///
    /// # Errors
    /// If the inputs do not fit the network, or the work was cancelled.
    pub fn features<'a, T: Scalar>(
        &self,
        tape: &mut Tape<'a, T>,
        scene: &'a SceneLevels,
        inputs: Value,
    ) -> Result<Value> {
        let last = self.levels.len() - 1;
        let mut skipped = Vec::with_capacity(last);
        let mut at = inputs;
        for (level, own) in self.levels.iter().enumerate() {
            let within = Connections::centred(&scene.within[level]);
            let through = match level {
                0 => within,
                _ => Connections::directed(&scene.down[level - 1], &scene.up[level - 1]),
            };
            let entered = unit(tape, at, own.enter, through)?;
            let [first, second] = own.residual;
            let inner = unit(tape, entered, first, within)?;
            let raw = tape.convolution(inner, second.weights, within)?;
            tape.forget(inner);
            at = tape.norm(raw, Some(entered), second.norm);
            tape.forget(entered);
            if level < last {
                skipped.push(at);
            }
        }
        for (level, own) in self.levels.iter().enumerate().rev() {
            let (Some(leave), Some(beside)) = (own.leave, skipped.get(level).copied()) else { continue };
            let within = Connections::centred(&scene.within[level]);
            let up = Connections::directed(&scene.up[level], &scene.down[level]);
            let raised = unit(tape, at, leave.up, up)?;
            let both = tape.joined(beside, raised);
            [at, beside, raised].into_iter().for_each(|value| tape.forget(value));
            let merged = unit(tape, both, leave.merge, within)?;
            tape.forget(both);
            at = unit(tape, merged, leave.last, within)?;
            tape.forget(merged);
        }
        Ok(at)
    }

    /// The scores of the classes of each site.
    ///
    /// # Errors
    /// As [`UNet::features`].
    pub fn scores<'a, T: Scalar>(
        &self,
        tape: &mut Tape<'a, T>,
        scene: &'a SceneLevels,
        inputs: Value,
    ) -> Result<Value> {
        let features = self.features(tape, scene, inputs)?;
        tape.linear(features, self.head)
    }
}

/// A convolution, normalised and rectified.
fn unit<'a, T: Scalar>(tape: &mut Tape<'a, T>, of: Value, unit: Unit, through: Connections<'a>) -> Result<Value> {
    let raw = tape.convolution(of, unit.weights, through)?;
    Ok(tape.norm(raw, None, unit.norm))
}

/// Adds the parameters of layers.
struct Builder<'a, T> {
    parameters: &'a mut Parameters<T>,
    draws: Stream,
}

impl<T: Scalar> Builder<'_, T> {
    fn unit(&mut self, name: &str, volume: usize, [inputs, outputs]: [usize; 2]) -> Unit {
        let shape = [volume, inputs, outputs];
        let weights = self.parameters.drawn(format!("{name}.weights"), &shape, volume * inputs, &mut self.draws);
        let mut constant =
            |part: &str, value, role| self.parameters.constant(format!("{name}.{part}"), outputs, value, role);
        let norm = NormIds {
            scale: constant("scale", 1.0, Role::Bias),
            shift: constant("shift", 0.0, Role::Bias),
            mean: constant("mean", 0.0, Role::Statistic),
            variance: constant("variance", 1.0, Role::Statistic),
        };
        Unit { weights, norm }
    }

    fn linear(&mut self, name: &str, [inputs, outputs]: [usize; 2]) -> LinearIds {
        let shape = [inputs, outputs];
        LinearIds {
            weights: self.parameters.drawn(format!("{name}.weights"), &shape, inputs, &mut self.draws),
            bias: self.parameters.constant(format!("{name}.bias"), outputs, 0.0, Role::Bias),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::layers::cross_entropy;
    use crate::nn::testing::{differences, numbers, relative_error};
    use crate::nn::training::{Optimiser, OptimiserState};
    use crate::nn::workspace::Workspace;

    /// A floor and a box on it, in one or two samples.
    fn scene(samples: u32, levels: usize) -> SceneLevels {
        let mut keys = Vec::new();
        for sample in 0..samples {
            for x in 0..12 {
                for y in 0..12 {
                    let z = if (4..8).contains(&x) && (3..9).contains(&y) { 4 } else { 1 };
                    keys.push(Sites::<3>::key(sample, [x, y, z]).unwrap());
                }
            }
        }
        SceneLevels::new(Sites::of_keys(keys, &Monitor::default()).unwrap(), levels, &Monitor::default()).unwrap()
    }

    #[test]
    fn values_are_counted_without_building_the_network() {
        for params in [UNetParams::default(), UNetParams { widths: vec![5, 3] }] {
            let (_, parameters) = UNet::new::<f32>(&params, 6, 4, 1).unwrap();
            let built: usize = parameters.iter().map(|parameter| parameter.values.len()).sum();
            assert_eq!(params.values(6, 4).unwrap(), built);
        }
        let large = UNet::new::<f32>(&UNetParams::default(), 6, usize::MAX / 4, 1).unwrap_err().to_string();
        assert!(large.contains("allowed: up to 2147483648"), "{large}");
    }

    fn roofs(scene: &SceneLevels) -> Vec<f64> {
        let sites = scene.sites();
        (0..sites.len()).flat_map(|i| if sites.position(i).1[2] == 4 { [0.0, 1.0] } else { [1.0, 0.0] }).collect()
    }

    #[test]
    fn gradients_of_all_parameters_are_those_of_finite_differences() {
        let (monitor, workspace) = (Monitor::default(), Workspace::default());
        let scene = scene(2, 3);
        let params = UNetParams { widths: vec![3, 4, 5] };
        let (net, parameters) = UNet::new::<f64>(&params, 2, 2, 7).unwrap();
        let (inputs, targets) = (numbers(1, scene.sites().len() * 2), roofs(&scene));
        let loss = |parameters: &Parameters<f64>| {
            let mut tape = Tape::training(parameters, &workspace, &monitor);
            let at = tape.input(inputs.clone(), 2);
            let scores = net.scores(&mut tape, &scene, at).unwrap();
            let loss = cross_entropy(tape.values(scores), &targets, 2);
            (loss.value, tape.backward(loss.gradient).unwrap())
        };
        let (_, gradients) = loss(&parameters);
        for (place, parameter) in parameters.iter().enumerate().filter(|(_, p)| p.role != Role::Statistic) {
            let slopes = differences(&parameter.values, 6, |values| {
                let mut moved = parameters.clone();
                moved.replace(&parameter.name, values.to_vec()).unwrap();
                loss(&moved).0
            });
            // Kinks of rectified values lie within a step of some of them.
            let error = relative_error(&gradients[place], &slopes);
            assert!(error < 1e-3, "{}: {error}", parameter.name);
        }
    }

    #[test]
    fn a_network_learns_a_scene_and_predicts_alone_what_it_predicts_in_a_batch() {
        let (monitor, workspace) = (Monitor::default(), Workspace::default());
        let (two, params) = (scene(2, 3), UNetParams { widths: vec![8, 8, 8] });
        let (net, mut parameters) = UNet::new::<f32>(&params, 1, 2, 3).unwrap();
        let targets: Vec<f32> = roofs(&two).into_iter().map(|t| t as f32).collect();
        let ones = |scene: &SceneLevels| vec![1.0f32; scene.sites().len()];
        let mut state = OptimiserState::default();
        for _ in 0..60 {
            let (gradients, followed) = {
                let mut tape = Tape::training(&parameters, &workspace, &monitor);
                let at = tape.input(ones(&two), 1);
                let scores = net.scores(&mut tape, &two, at).unwrap();
                let loss = cross_entropy(tape.values(scores), &targets, 2);
                (tape.backward(loss.gradient).unwrap(), tape.followed())
            };
            Optimiser::default().step(&mut parameters, &gradients, 0.01, &mut state).unwrap();
            followed.iter().for_each(|moments| moments.store(&mut parameters));
        }
        let predict = |scene: &SceneLevels| {
            let mut tape = Tape::prediction(&parameters, &workspace, &monitor);
            let at = tape.input(ones(scene), 1);
            let scores = net.scores(&mut tape, scene, at).unwrap();
            tape.take(scores)
        };
        let (alone, batch) = (scene(1, 3), predict(&two));
        let right = |scores: &[f32]| {
            scores.chunks(2).zip(targets.chunks(2)).filter(|(s, t)| (s[1] > s[0]) == (t[1] > t[0])).count()
        };
        assert_eq!(right(&batch), two.sites().len());
        assert_eq!(predict(&alone), batch[..alone.sites().len() * 2]);
    }

    #[test]
    fn cells_beyond_the_reach_do_not_matter() {
        let (monitor, workspace) = (Monitor::default(), Workspace::default());
        let params = UNetParams { widths: vec![2, 3, 4] };
        let (net, parameters) = UNet::new::<f32>(&params, 1, 2, 5).unwrap();
        let row = |count: i64| {
            let keys = (0..count).map(|x| Sites::<3>::key(0, [x, 0, 0]).unwrap()).collect();
            SceneLevels::new(Sites::of_keys(keys, &monitor).unwrap(), 3, &monitor).unwrap()
        };
        let run = |scene: &SceneLevels| {
            let mut tape = Tape::prediction(&parameters, &workspace, &monitor);
            let at = tape.input((0..scene.sites().len()).map(|i| (i % 7) as f32).collect(), 1);
            let scores = net.scores(&mut tape, scene, at).unwrap();
            tape.take(scores)
        };
        let (short, long, reach) = (run(&row(200)), run(&row(400)), params.reach());
        assert_eq!(short[..2 * (200 - reach)], long[..2 * (200 - reach)]);
        let first = short.iter().zip(&long).position(|(s, l)| s != l).unwrap() / 2;
        assert!(200 - first <= reach && 200 - first > reach / 2, "{first}, {reach}");
    }
}
