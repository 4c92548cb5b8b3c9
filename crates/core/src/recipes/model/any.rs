//! Any recipe, and any trained one: the list of the published methods.

use crate::error::{Error, Result};
use crate::parallel::Monitor;
use crate::recipes::auto_context::AutoContextRecipe;
use crate::recipes::classify::rules::ClassRules;
use crate::recipes::classify::statistics::CloudStatistics;
use crate::recipes::classify::{Classified, Job};
use crate::recipes::clusters::ClustersRecipe;
use crate::recipes::contours::ContoursRecipe;
use crate::recipes::labels::LabelledCloud;
use crate::recipes::model::Model;
use crate::recipes::objects::ObjectsRecipe;
use crate::recipes::pyramid::PyramidRecipe;
use crate::recipes::regularise::{Regularise, RegulariseParams};
use crate::recipes::spheres::SpheresRecipe;
#[cfg(test)]
use crate::recipes::system::height::HeightRecipe;
use crate::recipes::system::report::Report;
use crate::recipes::system::{Fitted, System, TrainOptions, TrainingResult};
use crate::recipes::unet::UNetRecipe;
use crate::recipes::weak::WeakRecipe;
use crate::recipes::windows::WindowsRecipe;
use crate::settings::changes::{explained, with_defaults, with_keys};
use serde::Serialize;

/// Makes [`AnyRecipe`] and [`AnyFitted`] from a list of methods; one that is `only in test` is compiled for tests only.
macro_rules! systems {
    ($($(#[$doc:meta])* $name:ident: $recipe:ty $(, only in $cfg:ident)?;)*) => {
        /// The recipe of one of the published methods. The key `recipe` at the top of its TOML says which; without it,
        /// the pyramid recipe.
        #[derive(Clone, Debug, PartialEq)]
        pub enum AnyRecipe {
            $($(#[cfg($cfg)])? $(#[$doc])* $name(Box<$recipe>),)*
        }

        /// A recipe of one of the published methods, with what was learned.
        #[derive(Clone, Debug, PartialEq)]
        pub enum AnyFitted {
            $($(#[cfg($cfg)])? $(#[$doc])* $name(Box<Fitted<$recipe>>),)*
        }

        impl AnyRecipe {
            /// The names of the recipes.
            pub fn names() -> Vec<&'static str> {
                let mut names = Vec::new();
                $($(#[cfg($cfg)])? {
                    names.push(<$recipe>::NAME);
                    names.extend(<$recipe>::PRESETS);
                })*
                names
            }

            /// Its name.
            pub fn name(&self) -> &'static str {
                match self { $($(#[cfg($cfg)])? Self::$name(recipe) => recipe.name(),)* }
            }

            /// The recipe with that name, with all defaults, or as in its paper.
            ///
            /// # Errors
            /// If the name is neither in [`AnyRecipe::names`] nor in [`AnyRecipe::PAPERS`].
            pub fn named(name: &str) -> Result<Self> {
                if let Some(paper) = Self::paper(name) {
                    return paper;
                }
                $($(#[cfg($cfg)])? {
                    if let Some(recipe) = <$recipe>::named(name) {
                        return Ok(Self::$name(Box::new(recipe)));
                    }
                })*
                Err(unknown(name))
            }

            /// Reads TOML that somebody has written: values not given are the defaults of the recipe, in each section too. The
            /// message about a wrong key gives its line and the nearest valid key.
            ///
            /// # Errors
            /// If the text is not TOML, or a recipe, key or value is unknown.
            pub fn from_toml(text: &str) -> Result<Self> {
                let name = recipe_of(text)?;
                $($(#[cfg($cfg)])? {
                    if let Some(defaults) = <$recipe>::named(&name) {
                        return Ok(Self::$name(Box::new(with_defaults(text, &defaults)?)));
                    }
                })*
                Err(unknown(&name))
            }

            /// Reads TOML in which all values are written out, as by [`AnyRecipe::to_toml`]: an absent optional value is none.
            ///
            /// # Errors
            /// As [`AnyRecipe::from_toml`].
            fn complete(text: &str) -> Result<Self> {
                let name = recipe_of(text)?;
                $($(#[cfg($cfg)])? {
                    if <$recipe>::named(&name).is_some() {
                        return Ok(Self::$name(Box::new(explained(text)?)));
                    }
                })*
                Err(unknown(&name))
            }

            /// The recipe as TOML, with all values written out.
            ///
            /// # Errors
            /// Never for values that pass [`AnyRecipe::validate`].
            pub fn to_toml(&self) -> Result<String> {
                match self { $($(#[cfg($cfg)])? Self::$name(recipe) => written(recipe),)* }
            }

            /// Checks all parts.
            ///
            /// # Errors
            /// Names the field, its value and what is allowed.
            pub fn validate(&self) -> Result<()> {
                match self { $($(#[cfg($cfg)])? Self::$name(recipe) => recipe.validate(),)* }
            }

            /// The same recipe with another seed.
            pub fn with_seed(self, seed: u64) -> Self {
                match self { $($(#[cfg($cfg)])? Self::$name(recipe) => Self::$name(Box::new(recipe.with_seed(seed))),)* }
            }

            /// Columns of a cloud that the recipe reads, besides labels.
            pub fn columns(&self) -> Vec<String> {
                match self { $($(#[cfg($cfg)])? Self::$name(recipe) => recipe.columns(),)* }
            }

            /// Metres per unit of the coordinates that the recipe prescribes; `None`: what each cloud says, else 1.
            pub fn metres_per_unit(&self) -> Option<f64> {
                match self { $($(#[cfg($cfg)])? Self::$name(recipe) => recipe.metres_per_unit(),)* }
            }

            /// Largest distance, metres, between a label picked by hand and the nearest point.
            pub fn label_distance(&self) -> f64 {
                match self { $($(#[cfg($cfg)])? Self::$name(recipe) => recipe.label_distance(),)* }
            }

            /// Checks that the method takes all options of a training: [`System::check_options`].
            ///
            /// # Errors
            /// As [`System::check_options`].
            pub fn check_options(&self, options: &TrainOptions) -> Result<()> {
                match self { $($(#[cfg($cfg)])? Self::$name(recipe) => recipe.check_options(options),)* }
            }

            /// Trains a model on labelled clouds: [`System::train`].
            ///
            /// # Errors
            /// As [`System::train`].
            pub fn train(
                &self,
                clouds: &[LabelledCloud],
                options: &TrainOptions,
                monitor: &Monitor,
            ) -> Result<(Model, Box<dyn Report>)> {
                match self {
                    $($(#[cfg($cfg)])? Self::$name(recipe) => {
                        let TrainingResult { fitted, trained, report } = recipe.train(clouds, options, monitor)?;
                        Ok((Model { fitted: fitted.into(), trained }, Box::new(report)))
                    })*
                }
            }
        }

        impl AnyFitted {
            /// The settings in use.
            pub fn recipe(&self) -> AnyRecipe {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => AnyRecipe::$name(Box::new(fitted.recipe.clone())),)* }
            }

            /// What was learned besides the classifier, as TOML; empty if nothing.
            pub(in crate::recipes) fn learned_toml(&self) -> Result<String> {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => written(&fitted.learned),)* }
            }

            /// What was learned, with other settings of the same recipe.
            fn with_recipe(&self, recipe: AnyRecipe) -> Result<Self> {
                match (self, recipe) {
                    $($(#[cfg($cfg)])? (Self::$name(own), AnyRecipe::$name(recipe)) => {
                        Ok(Self::$name(Box::new(Fitted { recipe: *recipe, learned: own.learned.clone() })))
                    })*
                    (_, other) => Err(Error::parameter("recipe", other.name(), self.recipe().name())),
                }
            }

            /// Combines a recipe and what was learned, as read from a model file.
            pub(in crate::recipes) fn from_toml(recipe: &str, learned: &str) -> Result<Self> {
                match AnyRecipe::complete(recipe)? {
                    $($(#[cfg($cfg)])? AnyRecipe::$name(recipe) => {
                        recipe.validate()?;
                        let learned = explained(learned)?;
                        Ok(Self::$name(Box::new(Fitted { recipe: *recipe, learned })))
                    })*
                }
            }

            fn training_only(&self) -> &'static [&'static str] {
                match self { $($(#[cfg($cfg)])? Self::$name(_) => <$recipe>::TRAINING_ONLY,)* }
            }

            /// Seed of all random draws.
            pub fn seed(&self) -> u64 {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => fitted.recipe.seed(),)* }
            }

            /// Regularisation of the labels.
            pub fn regularise(&self) -> &RegulariseParams {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => fitted.recipe.regularise(),)* }
            }

            /// What the classes become in the end.
            pub fn rules(&self) -> ClassRules {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => fitted.recipe.rules(),)* }
            }

            /// Columns of a cloud that classification reads.
            pub fn columns(&self) -> Vec<String> {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => fitted.recipe.columns(),)* }
            }

            pub(in crate::recipes) fn bytes_a_point(&self, method: Regularise) -> u64 {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => fitted.recipe.bytes_a_point(method),)* }
            }

            pub(in crate::recipes) fn metres_per_unit(&self) -> Option<f64> {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => fitted.recipe.metres_per_unit(),)* }
            }

            pub(in crate::recipes) fn lowest_density(&self) -> f64 {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => fitted.recipe.lowest_density(),)* }
            }

            pub(in crate::recipes) fn statistics(&self, job: &Job<'_>, monitor: &Monitor) -> Result<CloudStatistics> {
                match self { $($(#[cfg($cfg)])? Self::$name(fitted) => <$recipe>::statistics(fitted, job, monitor),)* }
            }

            pub(in crate::recipes) fn classify(&self, job: &Job<'_>, monitor: &Monitor) -> Result<Classified> {
                match self {
                    $($(#[cfg($cfg)])? Self::$name(fitted) => {
                        fitted.recipe.check_elevation(job.params.elevation.is_some())?;
                        <$recipe>::classify(fitted, job, monitor)
                    })*
                }
            }
        }

        $($(#[cfg($cfg)])? impl From<$recipe> for AnyRecipe {
            fn from(recipe: $recipe) -> Self {
                Self::$name(Box::new(recipe))
            }
        }

        $(#[cfg($cfg)])? impl From<Fitted<$recipe>> for AnyFitted {
            fn from(fitted: Fitted<$recipe>) -> Self {
                Self::$name(Box::new(fitted))
            }
        })*
    };
}

systems! {
    /// Hackel 2018, chapter 4.4: multi-scale features and a random forest.
    Pyramid: PyramidRecipe;
    /// Guinard & Landrieu 2017: few labels, segments and a conditional random field.
    Weak: WeakRecipe;
    /// Hasanpour Zaryabi et al. 2022: classifies segments instead of points.
    Objects: ObjectsRecipe;
    /// Heights above the ground and auto-context, for airborne (the built-in model), mobile and indoor scans.
    AutoContext: AutoContextRecipe;
    /// Grilli et al. 2021: clusters on four levels and a few features in spheres.
    Clusters: ClustersRecipe;
    /// Thomas et al. 2018: features in spheres of several radii.
    Spheres: SpheresRecipe;
    /// A sparse convolutional network: Graham et al. 2018, Hackel 2018, chapter 6.
    UNet: UNetRecipe;
    /// Hackel 2018, section 4.5: contours, lines along the edges of objects.
    Contours: ContoursRecipe;
    /// Hackel 2018, section 5.4.3: a network on the occupied cells around a point at five scales.
    Windows: WindowsRecipe;
    /// The example of CONTRIBUTING.md.
    Height: HeightRecipe, only in test;
}

impl AnyRecipe {
    /// Applies `section.key=value` settings, each value read as TOML (a bare word counts as text).
    ///
    /// # Errors
    /// As [`AnyRecipe::from_toml`].
    pub fn with_settings<'a>(&self, settings: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let table: toml::Table = self.to_toml()?.parse().map_err(|e| Error::input(format!("recipe: {e}")))?;
        with_keys(&table, settings, |table| Self::complete(&table.to_string()))
    }
}

impl AnyFitted {
    /// The same with other settings; what was learned stays.
    ///
    /// # Errors
    /// As [`AnyRecipe::with_settings`], or if a value is out of range, or a setting has an effect in training only.
    pub fn with_settings<'a>(&self, settings: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let settings: Vec<&str> = settings.into_iter().collect();
        let key = |setting: &&str| setting.split('=').next().unwrap_or_default().trim().to_string();
        let under = |key: &String| {
            let begins =
                |start: &&str| key.strip_prefix(start).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
            self.training_only().iter().any(begins)
        };
        if let Some(idle) = settings.iter().map(key).find(under) {
            return Err(Error::parameter(
                "set",
                idle,
                "a setting that classification reads: this one only has an effect in training",
            ));
        }
        let recipe = self.recipe().with_settings(settings)?;
        recipe.validate()?;
        self.with_recipe(recipe)
    }
}

/// The name of the recipe that a TOML text contains.
fn recipe_of(text: &str) -> Result<String> {
    let table: toml::Table = explained(text)?;
    match table.get("recipe") {
        None => Ok(PyramidRecipe::NAME.into()),
        Some(name) => Ok(name.as_str().unwrap_or_default().into()),
    }
}

fn unknown(name: &str) -> Error {
    Error::parameter("recipe", name, [&AnyRecipe::names()[..], &AnyRecipe::PAPERS].concat().join(", "))
}

fn written(value: &impl Serialize) -> Result<String> {
    toml::to_string(value).map_err(|e| Error::input(format!("recipe cannot be written as TOML: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segmentation::Intent;

    #[test]
    fn recipes_survive_toml_and_tell_their_kind() {
        for name in AnyRecipe::names() {
            let recipe = AnyRecipe::named(name).unwrap().with_seed(3);
            let text = recipe.to_toml().unwrap();
            assert!(text.contains(&format!("recipe = \"{name}\"")), "{text}");
            assert_eq!(AnyRecipe::from_toml(&text).unwrap(), recipe);
        }
        assert!(matches!(AnyRecipe::from_toml("seed = 1").unwrap(), AnyRecipe::Pyramid(_)));
        assert!(AnyRecipe::named("strong").unwrap_err().to_string().contains("weak"));
        assert!(AnyRecipe::from_toml("recipe = 3").unwrap_err().to_string().contains("weak"));
    }

    #[test]
    fn settings_reach_the_weak_recipe_and_wrong_keys_are_named() {
        let weak = AnyRecipe::named("weak").unwrap();
        let AnyRecipe::Weak(set) =
            weak.with_settings(["regularise.partition.intent.strength=0.4", "labels.per_class=15"]).unwrap()
        else {
            panic!("another kind")
        };
        assert_eq!((set.regularise.partition.intent, set.labels.per_class), (Intent::Strength(0.4), 15));
        let message = weak.with_settings(["labels.per_klass=15"]).unwrap_err().to_string();
        assert!(message.contains("did you mean `per_class`"), "{message}");
        // A section of one key.
        let message = weak.with_settings(["shares.pwer=1", "shares.power=0.5"]).unwrap_err().to_string();
        assert!(message.contains("did you mean `power`"), "{message}");
    }

    #[test]
    fn what_was_learned_outlasts_new_settings() {
        let learned = "shares = [0.25, 0.75]\nroad = []\nlabels = []\n";
        let fitted = AnyFitted::from_toml("recipe = \"weak\"", learned).unwrap();
        let changed = fitted.with_settings(["regularise.strength=2"]).unwrap();
        assert_eq!(changed.regularise().strength, 2.0);
        assert_eq!(changed.learned_toml().unwrap(), fitted.learned_toml().unwrap());
        assert!(fitted.with_settings(["shares.power=2"]).is_err());
        let idle = fitted.with_settings(["labels.per_class=3"]).unwrap_err().to_string();
        assert!(idle.contains("labels.per_class") && idle.contains("only has an effect in training"), "{idle}");
        assert!(fitted.with_settings(["labels.hold=false"]).is_ok());
        assert!(AnyFitted::from_toml("recipe = \"pyramid\"", learned).is_err());
        let wrong = AnyFitted::from_toml("recipe = \"weak\"\n[forest]\ntrees = 0", learned).unwrap_err().to_string();
        assert!(wrong.contains("trees"), "{wrong}");
    }
}
