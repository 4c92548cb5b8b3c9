//! The pyramid recipe: all parameters that determine a result, saved as TOML.

use super::TrainingParams;
use super::regularise::RegulariseParams;
use crate::classification::{BaggingParams, BoostingParams, ClassifierKind, ClassifierParams, ForestParams};
use crate::error::{Error, Result};
use crate::features::FeatureSet;
use serde::{Deserialize, Serialize};

/// The name of the recipe, in its TOML.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PyramidKind {
    /// Hackel 2018, chapter 4.4.
    #[default]
    Pyramid,
}

/// The parameters of the pyramid recipe (Hackel 2018, chapter 4.4); the defaults are the paper's.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Recipe {
    /// Always `pyramid`.
    pub recipe: PyramidKind,
    /// Seed of all random draws.
    pub seed: u64,
    /// The classifier: `rf` (the paper's), `gbt` or `bagging`; each has its own section of parameters.
    pub classifier: ClassifierKind,
    /// Features and their scales.
    pub features: FeatureSet,
    /// Selection of the training points.
    pub training: TrainingParams,
    /// The forest (`rf`).
    pub forest: ForestParams,
    /// Gradient-boosted trees (`gbt`).
    pub boosting: BoostingParams,
    /// Bagging.
    pub bagging: BaggingParams,
    /// Regularisation of the labels; Hackel 2018 has none.
    pub regularise: RegulariseParams,
}

impl Recipe {
    /// Reads TOML; the message about a wrong key gives its line and the nearest valid key.
    ///
    /// # Errors
    /// If the text is not TOML, or a key or value is unknown.
    pub fn from_toml(text: &str) -> Result<Self> {
        explained(text)
    }

    /// The recipe as TOML, with all values written out.
    ///
    /// # Errors
    /// Never for values that pass [`Recipe::validate`].
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::input(format!("recipe cannot be written as TOML: {e}")))
    }

    /// Checks all parts.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        self.features.validate()?;
        self.training.validate()?;
        self.forest.validate()?;
        self.boosting.validate()?;
        self.bagging.validate()?;
        self.regularise.validate()
    }

    /// Parameters of the selected classifier.
    pub fn classifier(&self) -> ClassifierParams {
        self.classifier.choose(&self.forest, &self.boosting, &self.bagging)
    }

    /// Limits the depth of the selected classifier's trees.
    pub fn set_max_depth(&mut self, depth: Option<usize>) {
        match self.classifier {
            ClassifierKind::Forest => self.forest.max_depth = depth,
            ClassifierKind::Boosting => self.boosting.max_depth = depth,
            ClassifierKind::Bagging => self.bagging.max_depth = depth,
        }
    }

    /// Applies `section.key=value` settings, each value read as TOML (a bare word counts as text).
    ///
    /// # Errors
    /// As [`Recipe::from_toml`].
    pub fn with_settings<'a>(&self, settings: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let mut table: toml::Table = self.to_toml()?.parse().map_err(|e| Error::input(format!("recipe: {e}")))?;
        for setting in settings {
            set_key(&mut table, setting)?;
        }
        Self::from_toml(&table.to_string())
    }
}

/// Largest number of parts of a key; those of recipes have up to four.
const DEEPEST: usize = 16;

/// Sets one `a.b.c=value` in a TOML table.
///
/// # Errors
/// If the setting has no `=`, an empty key, or a key of too many parts.
pub fn set_key(table: &mut toml::Table, setting: &str) -> Result<()> {
    let bad = || Error::parameter("set", setting, "key=value, e.g. forest.trees=100");
    let (key, value) = setting.split_once('=').ok_or_else(bad)?;
    let value = parse_value(value.trim());
    let mut parts: Vec<&str> = key.trim().split('.').take(DEEPEST + 1).collect();
    if parts.len() > DEEPEST {
        let start: String = key.trim().chars().take(40).collect();
        return Err(Error::parameter("set", format!("{start}..."), format!("a key of at most {DEEPEST} parts")));
    }
    let last = parts.pop().filter(|k| !k.is_empty()).ok_or_else(bad)?;
    let mut here = table;
    for part in parts {
        let next = here.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        if !next.is_table() {
            // A choice given as a word becomes one with a value, e.g. forest.max_features.count=5.
            *next = toml::Value::Table(toml::Table::new());
        }
        here = next.as_table_mut().ok_or_else(bad)?;
    }
    here.insert(last.to_string(), value);
    Ok(())
}

fn parse_value(text: &str) -> toml::Value {
    format!("v = {text}")
        .parse::<toml::Table>()
        .ok()
        .and_then(|mut t| t.remove("v"))
        .unwrap_or_else(|| toml::Value::String(text.to_string()))
}

/// Reads TOML; error messages give the place and suggest the intended key.
pub(super) fn explained<T: serde::de::DeserializeOwned>(text: &str) -> Result<T> {
    toml::from_str(text).map_err(|e| Error::input(format!("recipe: {}", explain(&e.to_string()))))
}

/// Adds "did you mean" to serde's message about an unknown field.
fn explain(message: &str) -> String {
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    match (message.contains("unknown field"), quoted.split_first()) {
        (true, Some((wrong, valid))) => match valid.iter().min_by_key(|v| strsim::levenshtein(wrong, v)) {
            Some(near) => format!("{}\nhelp: did you mean `{near}`?", message.trim_end()),
            None => message.to_string(),
        },
        _ => message.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_survives_toml() {
        let mut recipe = Recipe { seed: 7, ..Recipe::default() };
        assert_eq!(Recipe::from_toml(&recipe.to_toml().unwrap()).unwrap(), recipe);
        recipe.features.pyramid.first_scale = None;
        assert_eq!(Recipe::from_toml(&recipe.to_toml().unwrap()).unwrap(), recipe);
    }

    #[test]
    fn a_wrong_key_names_itself_its_line_and_the_nearest() {
        let message = Recipe::from_toml("seed = 1\n[forest]\ntreees = 3\n").unwrap_err().to_string();
        assert!(
            message.contains("treees") && message.contains("line 3") && message.contains("did you mean `trees`"),
            "{message}"
        );
    }

    #[test]
    fn settings_reach_nested_keys() {
        let recipe = Recipe::default().with_settings(["forest.trees=7", "seed=3"]).unwrap();
        assert_eq!((recipe.forest.trees, recipe.seed), (7, 3));
        let counted = Recipe::default().with_settings(["forest.max_features.count=5"]).unwrap();
        assert_eq!(counted.forest.max_features, crate::classification::MaxFeatures::Count(5));
        assert!(Recipe::default().with_settings(["seed.forest=5"]).is_err());
        assert!(Recipe::default().with_settings(["forest.trees"]).is_err());
        assert!(Recipe::default().with_settings(["forest.trees=many"]).is_err());
    }

    #[test]
    fn deep_keys_and_values_are_refused_and_do_not_take_the_stack() {
        let key = vec!["a"; 60_000].join(".") + "=1";
        let message = Recipe::default().with_settings([&key[..]]).unwrap_err().to_string();
        assert!(message.contains("at most 16 parts") && message.len() < 200, "{message}");
        for value in ["[".repeat(60_000), "{a=".repeat(60_000), format!("{}1", "a.".repeat(60_000))] {
            assert!(Recipe::default().with_settings([&format!("forest.trees={value}")[..]]).is_err());
        }
        for text in [format!("{}=1", vec!["a"; 60_000].join(".")), format!("[{}]", vec!["a"; 60_000].join("."))] {
            assert!(Recipe::from_toml(&text).is_err());
            assert!(crate::recipes::AnyRecipe::from_toml(&text).is_err());
        }
        assert!(Recipe::from_toml(&format!("seed = {}", "[".repeat(60_000))).is_err());
    }
}
