//! Optimisers: how gradients change parameters. The formulas are those of PyTorch, so that runs can be compared step by step.

use crate::error::{Error, Result};
use crate::nn::parameters::{Gradients, Parameters, Role};
use crate::nn::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// A way to change parameters by their gradients. In settings it is a table of one key, its name (`sgd`, `adagrad`,
/// `adadelta` or `adam-w`); values that are not given are those of PyTorch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Optimiser {
    /// Stochastic gradient descent with momentum.
    Sgd {
        /// Share of the last step that is kept, 0..1; 0 if not given.
        #[serde(default)]
        momentum: f64,
        /// Weight decay, added to the gradient of weights; 0 if not given.
        #[serde(default)]
        decay: f64,
    },
    /// J. Duchi, E. Hazan, Y. Singer, *Adaptive subgradient methods*, JMLR 2011.
    Adagrad {
        /// Added to the root of the sum of squares; 1e-10 if not given.
        #[serde(default = "usual::adagrad_epsilon")]
        epsilon: f64,
    },
    /// M. D. Zeiler, *ADADELTA*, 2012, arXiv:1212.5701.
    Adadelta {
        /// Share of the running means that is kept, 0..1; 0.9 if not given.
        #[serde(default = "usual::rho")]
        rho: f64,
        /// Added under the roots; 1e-6 if not given.
        #[serde(default = "usual::adadelta_epsilon")]
        epsilon: f64,
    },
    /// I. Loshchilov, F. Hutter, *Decoupled weight decay regularization*, ICLR 2019.
    AdamW {
        /// Share of the running mean of gradients that is kept, 0..1; 0.9 if not given.
        #[serde(default = "usual::beta1")]
        beta1: f64,
        /// Share of the running mean of squares that is kept, 0..1; 0.999 if not given.
        #[serde(default = "usual::beta2")]
        beta2: f64,
        /// Added to the root; 1e-8 if not given.
        #[serde(default = "usual::adam_w_epsilon")]
        epsilon: f64,
        /// Weight decay, as a share of the learning rate; 0.01 if not given.
        #[serde(default = "usual::adam_w_decay")]
        decay: f64,
    },
}

impl Default for Optimiser {
    fn default() -> Self {
        Self::AdamW {
            beta1: usual::beta1(),
            beta2: usual::beta2(),
            epsilon: usual::adam_w_epsilon(),
            decay: usual::adam_w_decay(),
        }
    }
}

/// The values that PyTorch has by default.
mod usual {
    pub(super) fn adagrad_epsilon() -> f64 {
        1e-10
    }

    pub(super) fn rho() -> f64 {
        0.9
    }

    pub(super) fn adadelta_epsilon() -> f64 {
        1e-6
    }

    pub(super) fn beta1() -> f64 {
        0.9
    }

    pub(super) fn beta2() -> f64 {
        0.999
    }

    pub(super) fn adam_w_epsilon() -> f64 {
        1e-8
    }

    pub(super) fn adam_w_decay() -> f64 {
        0.01
    }
}

/// What an optimiser remembers from step to step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OptimiserState<T> {
    /// Number of steps.
    pub steps: u64,
    /// Up to two arrays a parameter, in the order of the parameters.
    pub memory: [Vec<Vec<T>>; 2],
}

impl Optimiser {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the value that is out of range.
    pub fn validate(self) -> Result<()> {
        let share = |name: &'static str, value: f64| match (0.0..1.0).contains(&value) {
            true => Ok(()),
            false => Err(Error::parameter(name, value, "0 up to below 1")),
        };
        let above = |name: &'static str, value: f64| match value > 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(Error::parameter(name, value, "above 0")),
        };
        let decays = |value: f64| match (0.0..=1.0).contains(&value) {
            true => Ok(()),
            false => Err(Error::parameter("decay", value, "0 to 1")),
        };
        match self {
            Self::Sgd { momentum, decay } => share("momentum", momentum).and_then(|()| decays(decay)),
            Self::Adagrad { epsilon } => above("epsilon", epsilon),
            Self::Adadelta { rho, epsilon } => share("rho", rho).and_then(|()| above("epsilon", epsilon)),
            Self::AdamW { beta1, beta2, epsilon, decay } => share("beta1", beta1)
                .and_then(|()| share("beta2", beta2))
                .and_then(|()| above("epsilon", epsilon))
                .and_then(|()| decays(decay)),
        }
    }

    /// Changes the parameters by one step; statistics stay.
    ///
    /// # Errors
    /// If a gradient is not finite: names the step and the parameter. The parameters are then as before.
    pub fn step<T: Scalar>(
        self,
        parameters: &mut Parameters<T>,
        gradients: &Gradients<T>,
        rate: f64,
        state: &mut OptimiserState<T>,
    ) -> Result<()> {
        for (parameter, gradient) in parameters.iter().zip(gradients) {
            if !gradient.iter().all(|g| g.finite()) {
                return Err(Error::input(format!(
                    "training, step {}: a gradient of {} is not finite; choose a lower learning rate",
                    state.steps + 1,
                    parameter.name
                )));
            }
        }
        state.steps += 1;
        for memory in &mut state.memory {
            memory.resize(parameters.iter().len(), Vec::new());
        }
        let [first, second] = &mut state.memory;
        let memories = first.iter_mut().zip(second);
        for ((parameter, gradient), (first, second)) in parameters.iter_mut().zip(gradients).zip(memories) {
            if parameter.role == Role::Statistic {
                continue;
            }
            for memory in [&mut *first, &mut *second] {
                memory.resize(gradient.len(), T::ZERO);
            }
            let rule = Rule { optimiser: self, rate, steps: state.steps, decays: parameter.role == Role::Weight };
            let values = parameter.values.iter_mut().zip(gradient).zip(first.iter_mut().zip(second));
            values.for_each(|((value, &gradient), (first, second))| {
                *value = rule.changed(*value, gradient, [first, second]);
            });
        }
        Ok(())
    }
}

/// One step of an optimiser.
struct Rule {
    optimiser: Optimiser,
    rate: f64,
    steps: u64,
    /// Whether weight decay applies.
    decays: bool,
}

impl Rule {
    /// The new value.
    fn changed<T: Scalar>(&self, value: T, gradient: T, [first, second]: [&mut T; 2]) -> T {
        let of = T::of;
        let rate = of(self.rate);
        match self.optimiser {
            Optimiser::Sgd { momentum, decay } => {
                let decay = if self.decays { decay } else { 0.0 };
                let gradient = gradient + of(decay) * value;
                // The first step has no momentum: the memory is the gradient itself.
                *first = if self.steps == 1 { gradient } else { of(momentum) * *first + gradient };
                value - rate * *first
            }
            Optimiser::Adagrad { epsilon } => {
                *first += gradient * gradient;
                value - rate * gradient / (first.root() + of(epsilon))
            }
            Optimiser::Adadelta { rho, epsilon } => {
                *first = of(rho) * *first + of(1.0 - rho) * gradient * gradient;
                let change = (*second + of(epsilon)).root() / (*first + of(epsilon)).root() * gradient;
                *second = of(rho) * *second + of(1.0 - rho) * change * change;
                value - rate * change
            }
            Optimiser::AdamW { beta1, beta2, epsilon, decay } => {
                let decay = if self.decays { decay } else { 0.0 };
                let value = value * of(1.0 - self.rate * decay);
                *first = of(beta1) * *first + of(1.0 - beta1) * gradient;
                *second = of(beta2) * *second + of(1.0 - beta2) * gradient * gradient;
                let steps = self.steps as f64;
                let size = of(self.rate / (1.0 - beta1.powf(steps)));
                let root = second.root() / of((1.0 - beta2.powf(steps)).sqrt());
                value - size * *first / (root + of(epsilon))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Optimiser; 4] = [
        Optimiser::Sgd { momentum: 0.9, decay: 0.0 },
        Optimiser::Adagrad { epsilon: 1e-10 },
        Optimiser::Adadelta { rho: 0.9, epsilon: 1e-6 },
        Optimiser::AdamW { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, decay: 0.0 },
    ];

    fn one(value: f64) -> Parameters<f64> {
        let mut parameters = Parameters::default();
        parameters.constant("w", 1, value, Role::Weight);
        parameters
    }

    #[test]
    fn first_steps_follow_the_formulas() {
        // With gradient 2 and rate 0.1.
        let expected = [
            1.0 - 0.1 * 2.0,
            1.0 - 0.1 * 2.0 / 2.0,
            1.0 - 0.1 * 2.0 * (1e-6f64).sqrt() / (0.4f64 + 1e-6).sqrt(),
            1.0 - 0.1,
        ];
        for (optimiser, expected) in ALL.into_iter().zip(expected) {
            let (mut parameters, mut state) = (one(1.0), OptimiserState::default());
            optimiser.step(&mut parameters, &vec![vec![2.0]], 0.1, &mut state).unwrap();
            let found = parameters.iter().next().unwrap().values[0];
            assert!((found - expected).abs() < 1e-8, "{optimiser:?}: {found}, {expected}");
        }
    }

    #[test]
    fn every_optimiser_finds_the_bottom_of_a_parabola() {
        for (optimiser, rate, steps) in
            ALL.into_iter().zip([0.05, 0.5, 1.0, 0.05]).zip([300, 300, 4000, 600]).map(|((o, r), s)| (o, r, s))
        {
            let (mut parameters, mut state) = (one(3.0), OptimiserState::default());
            for _ in 0..steps {
                let at = parameters.iter().next().unwrap().values[0];
                optimiser.step(&mut parameters, &vec![vec![2.0 * (at - 1.0)]], rate, &mut state).unwrap();
            }
            let found = parameters.iter().next().unwrap().values[0];
            assert!((found - 1.0).abs() < 0.05, "{optimiser:?}: {found}");
        }
    }

    #[test]
    fn gradients_that_are_not_finite_stop_training_with_step_and_parameter() {
        let (mut parameters, mut state) = (one(3.0), OptimiserState::default());
        let optimiser = Optimiser::default();
        optimiser.step(&mut parameters, &vec![vec![1.0]], 0.1, &mut state).unwrap();
        let before = parameters.clone();
        let message = optimiser.step(&mut parameters, &vec![vec![f64::NAN]], 0.1, &mut state).unwrap_err().to_string();
        assert!(message.contains("step 2") && message.contains("of w is"), "{message}");
        assert_eq!(parameters, before);
        assert!(Optimiser::Adagrad { epsilon: 0.0 }.validate().unwrap_err().to_string().contains("epsilon"));
        assert!(ALL.into_iter().all(|optimiser| optimiser.validate().is_ok()));
    }

    #[test]
    fn values_that_are_not_given_are_those_of_pytorch() {
        // torch.optim 2.5: SGD, Adagrad, Adadelta and AdamW, without arguments.
        let read = |text: &str| {
            let table: toml::Table = text.parse().unwrap();
            table["optimiser"].clone().try_into::<Optimiser>()
        };
        for (text, expected) in [
            ("optimiser.sgd = {}", Optimiser::Sgd { momentum: 0.0, decay: 0.0 }),
            ("optimiser.sgd.momentum = 0.9", Optimiser::Sgd { momentum: 0.9, decay: 0.0 }),
            ("optimiser.adagrad = {}", Optimiser::Adagrad { epsilon: 1e-10 }),
            ("optimiser.adadelta = {}", Optimiser::Adadelta { rho: 0.9, epsilon: 1e-6 }),
            ("optimiser.adam-w = {}", Optimiser::AdamW { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, decay: 0.01 }),
        ] {
            assert_eq!(read(text).unwrap(), expected, "{text}");
        }
        assert!(read("optimiser.sgd.momentun = 0.9").unwrap_err().to_string().contains("momentun"));
        assert!(read("optimiser = { sgd = {}, adagrad = {} }").is_err());
    }
}
