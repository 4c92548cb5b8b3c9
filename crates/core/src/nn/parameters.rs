//! The parameters of a network: named arrays.

use super::scalar::Scalar;
use crate::error::{Error, Result};
use crate::random::Stream;

/// What a parameter is to training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Factors of values: weight decay and pruning apply to them.
    Weight,
    /// Terms, and factors of normalised channels.
    Bias,
    /// Means and variances of channels: no gradient, followed during training.
    Statistic,
}

impl Role {
    /// The role of a parameter whose name ends in `.weights`, `.mean`, `.variance`, or otherwise.
    fn of(name: &str) -> Self {
        match name.rsplit('.').next() {
            Some("weights") => Self::Weight,
            Some("mean" | "variance") => Self::Statistic,
            _ => Self::Bias,
        }
    }
}

/// A named array.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter<T> {
    /// Its name, unique in the network.
    pub name: String,
    /// Length along each axis, the last running fastest.
    pub shape: Vec<usize>,
    /// The values.
    pub values: Vec<T>,
    /// What it is to training.
    pub role: Role,
}

/// The place of a parameter in [`Parameters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterId(usize);

impl ParameterId {
    /// The gradient of this parameter.
    pub(super) fn of_mut<T>(self, gradients: &mut Gradients<T>) -> &mut [T] {
        &mut gradients[self.0]
    }
}

/// The parameters of a network in a fixed order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters<T> {
    all: Vec<Parameter<T>>,
}

/// One gradient a parameter, in the order of [`Parameters`].
pub type Gradients<T> = Vec<Vec<T>>;

impl<T: Scalar> Parameters<T> {
    /// Adds a parameter whose values are all the same.
    pub fn constant(&mut self, name: impl Into<String>, count: usize, value: f64, role: Role) -> ParameterId {
        let values = vec![T::of(value); count];
        self.add(Parameter { name: name.into(), shape: vec![count], values, role })
    }

    /// Adds weights drawn from a normal distribution of mean 0 and variance 2 / `fan_in` (K. He et al., *Delving deep into
    /// rectifiers*, ICCV 2015).
    pub fn drawn(
        &mut self,
        name: impl Into<String>,
        shape: &[usize],
        fan_in: usize,
        draws: &mut Stream,
    ) -> ParameterId {
        let deviation = (2.0 / fan_in.max(1) as f64).sqrt();
        let count = shape.iter().product();
        let values = (0..count).map(|_| T::of(deviation * draws.normal())).collect();
        self.add(Parameter { name: name.into(), shape: shape.to_vec(), values, role: Role::Weight })
    }

    /// Adds weights drawn from a normal distribution of mean 0 that is cut off at two standard deviations.
    pub fn drawn_within(
        &mut self,
        name: impl Into<String>,
        shape: &[usize],
        deviation: f64,
        draws: &mut Stream,
    ) -> ParameterId {
        let mut draw = || {
            loop {
                let value = draws.normal();
                if value.abs() <= 2.0 {
                    return T::of(deviation * value);
                }
            }
        };
        let values = (0..shape.iter().product()).map(|_| draw()).collect();
        self.add(Parameter { name: name.into(), shape: shape.to_vec(), values, role: Role::Weight })
    }

    fn add(&mut self, parameter: Parameter<T>) -> ParameterId {
        self.all.push(parameter);
        ParameterId(self.all.len() - 1)
    }

    /// The name of a parameter.
    pub fn name(&self, id: ParameterId) -> &str {
        &self.all[id.0].name
    }

    /// The values of a parameter.
    pub fn get(&self, id: ParameterId) -> &[T] {
        &self.all[id.0].values
    }

    /// The values of a parameter.
    pub fn get_mut(&mut self, id: ParameterId) -> &mut [T] {
        &mut self.all[id.0].values
    }

    /// All of them in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Parameter<T>> {
        self.all.iter()
    }

    /// All of them in order.
    pub fn iter_mut(&mut self) -> impl ExactSizeIterator<Item = &mut Parameter<T>> {
        self.all.iter_mut()
    }

    /// The same parameters in the order of their names.
    #[must_use]
    pub fn sorted(mut self) -> Self {
        self.all.sort_by(|a, b| a.name.cmp(&b.name));
        self
    }

    /// Parameters with names and values from a file; what each is to training follows from the end of its name.
    pub fn of_arrays(arrays: impl IntoIterator<Item = (String, Vec<usize>, Vec<T>)>) -> Self {
        let of = |(name, shape, values): (String, Vec<usize>, Vec<T>)| {
            let role = Role::of(&name);
            Parameter { name, shape, values, role }
        };
        Self { all: arrays.into_iter().map(of).collect() }
    }

    /// Number of values that training changes.
    pub fn trained(&self) -> usize {
        let learned = self.all.iter().filter(|parameter| parameter.role != Role::Statistic);
        learned.map(|parameter| parameter.values.len()).sum()
    }

    /// Gradients that are all 0.
    pub fn no_gradients(&self) -> Gradients<T> {
        self.all.iter().map(|parameter| vec![T::ZERO; parameter.values.len()]).collect()
    }

    /// Replaces all values, for instance by those of a file.
    ///
    /// # Errors
    /// If a name or length differs, or a value is not finite.
    pub fn replace(&mut self, name: &str, values: Vec<T>) -> Result<()> {
        let own = self.all.iter_mut().find(|parameter| parameter.name == name);
        let own = own.ok_or_else(|| Error::ModelMismatch(format!("the network has no parameter {name}")))?;
        if own.values.len() != values.len() {
            let (found, expected) = (values.len(), own.values.len());
            return Err(Error::ModelMismatch(format!("{found} values of {name} (allowed: {expected})")));
        }
        if !values.iter().all(|value| value.finite()) {
            return Err(Error::ModelMismatch(format!("a value of {name} is not finite")));
        }
        own.values = values;
        Ok(())
    }
}

/// Adds a gradient to that of a parameter.
pub(super) fn add_gradient<T: Scalar>(gradients: &mut Gradients<T>, id: ParameterId, gradient: &[T]) {
    gradients[id.0].iter_mut().zip(gradient).for_each(|(sum, &value)| *sum += value);
}
