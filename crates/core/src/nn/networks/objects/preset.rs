//! Networks for objects by name, each with the settings of its training: as we advise, or with the constants of the thesis.

use super::{ObjectLearning, ObjectNetParams};
use crate::error::{Error, Result};
use crate::settings::changes::changed;
use serde::{Deserialize, Serialize};

/// A network and the settings of its training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectPreset {
    /// The network.
    pub network: ObjectNetParams,
    /// Its training.
    pub learning: ObjectLearning,
}

/// Name and text of those with the constants of the thesis: the files in `assets/networks`.
const PAPERS: [(&str, &str); 2] = [
    ("modelnet-paper", include_str!("../../../../assets/networks/modelnet-paper.toml")),
    ("mnist-paper", include_str!("../../../../assets/networks/mnist-paper.toml")),
];

/// What such a file holds.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Paper {
    network: ObjectNetParams,
    learning: ObjectLearning,
    /// By ascending resolution; none if the bounds are those of the network at every resolution.
    #[serde(default)]
    bounds: Vec<Bounds>,
}

/// Upper bounds of the density of the sparse levels.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Bounds {
    /// Cells along an axis.
    resolution: usize,
    densities: Vec<f64>,
}

impl Paper {
    fn read(text: &str) -> Result<Self> {
        toml::from_str(text).map_err(|e| Error::input(e.to_string()))
    }

    /// The settings for samples of so many cells along each axis: the bounds of the next resolution, or of the highest.
    fn at(self, resolution: usize) -> ObjectPreset {
        let Self { mut network, learning, bounds } = self;
        if let Some(own) = bounds.iter().find(|own| resolution <= own.resolution).or(bounds.last()) {
            let densities = network.levels.iter_mut().filter_map(|level| level.density.as_mut());
            densities.zip(&own.densities).for_each(|(density, &own)| *density = own);
        }
        ObjectPreset { network, learning }
    }
}

impl ObjectPreset {
    /// All names; those that end in `-paper` have the constants of the thesis.
    pub const NAMES: [&'static str; 4] = ["modelnet", "mnist", PAPERS[0].0, PAPERS[1].0];

    /// The settings with that name, for samples of so many cells along each axis.
    ///
    /// # Errors
    /// If the name is not in [`ObjectPreset::NAMES`].
    pub fn named(name: &str, resolution: usize) -> Result<Self> {
        match name {
            "modelnet" => {
                Ok(Self { network: ObjectNetParams::modelnet(resolution), learning: ObjectLearning::default() })
            }
            "mnist" => {
                let network = ObjectNetParams::mnist(ObjectNetParams::MNIST_DENSITY);
                Ok(Self { network, learning: ObjectLearning::mnist() })
            }
            _ => match PAPERS.iter().find(|(known, _)| *known == name) {
                Some((_, text)) => Ok(Paper::read(text)?.at(resolution)),
                None => Err(Error::parameter("network", name, Self::NAMES.join(", "))),
            },
        }
    }

    /// The same with other settings, `network.key=value` and `learning.key=value`, each value read as TOML (a bare word counts
    /// as text).
    ///
    /// # Errors
    /// If a key is unknown, or a value has the wrong type.
    pub fn with_settings<'a>(&self, settings: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        changed(self, settings)
    }

    /// The same with one bound of the density for all sparse levels.
    #[must_use]
    pub fn with_density(mut self, density: f64) -> Self {
        let densities = self.network.levels.iter_mut().filter_map(|level| level.density.as_mut());
        densities.for_each(|own| *own = density);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::objects::{ObjectAugmentation, ObjectShape};
    use crate::nn::sparse::{Attention, DensityParams};
    use crate::nn::training::{Optimiser, Schedule};

    fn bounds(name: &str, resolution: usize) -> Vec<Option<f64>> {
        ObjectPreset::named(name, resolution).unwrap().network.levels.iter().map(|level| level.density).collect()
    }

    #[test]
    fn the_presets_of_the_thesis_have_its_constants() {
        // The learning rate, epochs and optimiser of section 6.4, b1 = b2 = o = 0.1 and the largest λ of 6.4.3, whose penalty
        // has no factor 1/2 and no smoothing.
        let ObjectPreset { network, learning } = ObjectPreset::named("modelnet-paper", 64).unwrap();
        let regulariser = DensityParams {
            strength: 2.0 * 0.3,
            density: 1.0,
            offset: 0.1,
            above: 0.1,
            below: 0.1,
            smoothing: 0.0,
            biases: true,
        };
        let expected = ObjectLearning {
            epochs: 90,
            batch: 32,
            rate: 0.001,
            schedule: Schedule::Constant,
            optimiser: Optimiser::Adagrad { epsilon: 1e-10 },
            regulariser,
            pruning: 1e-4,
            balance: 0.0,
            augment: ObjectAugmentation { turn: true, mirror: false, jitter: 0.01, shift: 0 },
            seed: 0,
        };
        assert_eq!(learning, expected);
        assert_eq!(network, ObjectNetParams { deviation: Some(0.1), ..ObjectNetParams::modelnet(64) });
        // The first nine of twelve convolutions are sparse.
        let convolutions = |sparse: bool| -> usize {
            network.levels.iter().filter(|l| l.density.is_some() == sparse).map(|l| l.channels.len()).sum()
        };
        assert_eq!([convolutions(true), convolutions(false)], [9, 3]);

        // Ten epochs at a rate of 0.01 without regularisation, bounds up to 0.095, section 6.4.2.
        let ObjectPreset { network, learning } = ObjectPreset::named("mnist-paper", 28).unwrap();
        let augment = ObjectAugmentation { turn: false, ..expected.augment };
        let regulariser = DensityParams { strength: 0.0, ..regulariser };
        let own = ObjectLearning { epochs: 10, rate: 0.01, regulariser, pruning: 5e-3, augment, ..expected };
        assert_eq!(learning, own);
        assert_eq!(network, ObjectNetParams { dropout: 0.0, deviation: Some(0.1), ..ObjectNetParams::mnist(0.095) });
        assert_eq!(network.attention, Attention::Positive);
    }

    #[test]
    fn settings_choose_another_optimiser() {
        let preset = ObjectPreset::named("mnist-paper", 28).unwrap();
        let optimiser = |settings: &[&str]| preset.with_settings(settings.iter().copied()).unwrap().learning.optimiser;
        let given = ["learning.optimiser.sgd.momentum=0.9", "learning.optimiser.sgd.decay=0.01"];
        assert_eq!(optimiser(&given), Optimiser::Sgd { momentum: 0.9, decay: 0.01 });
        assert_eq!(optimiser(&["learning.optimiser={ adam-w = {} }"]), Optimiser::default());
        assert_eq!(optimiser(&["learning.optimiser.adagrad.epsilon=0.1"]), Optimiser::Adagrad { epsilon: 0.1 });
        let levels = preset.with_settings(["network.levels=[{ channels = [2], density = \"none\" }]"]).unwrap();
        assert_eq!(levels.network.levels.iter().map(|l| l.density).collect::<Vec<_>>(), [None]);
        let message = preset.with_settings(["network.hiden=3"]).unwrap_err().to_string();
        assert!(message.contains("hiden") && message.contains("did you mean `hidden`"), "{message}");
    }

    #[test]
    fn at_16_cells_all_levels_have_the_same_bound_as_printed() {
        let same = |density: f64| vec![Some(density), Some(density), Some(density), None];
        for resolution in [8, 16] {
            assert_eq!(bounds("modelnet-paper", resolution), same(0.33));
        }
        for resolution in [17, 32, 64, 65, 128, 256] {
            assert_eq!(bounds("modelnet-paper", resolution), bounds("modelnet", resolution));
        }
        let one = ObjectPreset::named("modelnet-paper", 16).unwrap().with_density(0.06).network;
        assert_eq!(one.levels.iter().map(|level| level.density).collect::<Vec<_>>(), same(0.06));
        assert_eq!(bounds("mnist-paper", 16), [Some(0.095); 2]);
    }

    #[test]
    fn all_names_are_known_and_valid() {
        for name in ObjectPreset::NAMES {
            let (edge, axes) = if name.starts_with("mnist") { (28, 2) } else { (32, 3) };
            let ObjectPreset { network, learning } = ObjectPreset::named(name, edge).unwrap();
            let shape = ObjectShape { channels: 1, extent: vec![edge; axes] };
            network.validate(&shape).unwrap();
            learning.validate().unwrap();
            learning.augment.validate(&shape).unwrap();
        }
        let message = ObjectPreset::named("alexnet", 32).unwrap_err().to_string();
        assert!(message.contains("alexnet") && message.contains("modelnet-paper"), "{message}");
    }

    #[test]
    fn the_files_leave_no_setting_to_the_defaults() {
        for (name, text) in PAPERS {
            let written: toml::Table = text.parse().unwrap();
            let all = toml::Table::try_from(ObjectPreset::named(name, 32).unwrap()).unwrap();
            for section in ["network", "learning"] {
                let keys = |table: &toml::Table| {
                    let mut keys = vec![];
                    for (key, value) in table[section].as_table().unwrap() {
                        keys.extend(
                            value.as_table().iter().flat_map(|t| t.keys()).map(|inner| format!("{key}.{inner}")),
                        );
                        keys.push(key.clone());
                    }
                    keys.sort();
                    keys
                };
                assert_eq!(keys(&written), keys(&all), "{name}");
            }
        }
    }
}
