//! Any recipe: what a model file or a TOML file contains.

use super::objects::ObjectsRecipe;
use super::recipe::{Recipe, explained, set_key};
use super::regularise::RegulariseParams;
use super::weak::WeakRecipe;
use crate::error::{Error, Result};

/// The parameters of one of the published methods. The key `recipe` at the top of its TOML says which; without it, the
/// pyramid recipe.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyRecipe {
    /// Hackel 2018, chapter 4.4: multi-scale features and a random forest.
    Pyramid(Box<Recipe>),
    /// Guinard & Landrieu 2017: few labels, segments and a conditional random field.
    Weak(Box<WeakRecipe>),
    /// Hasanpour Zaryabi et al. 2022: classifies segments instead of points.
    Objects(Box<ObjectsRecipe>),
}

impl AnyRecipe {
    /// The names of the recipes that are built in.
    pub const NAMES: [&'static str; 3] = ["pyramid", "weak", "objects"];

    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pyramid(_) => "pyramid",
            Self::Weak(_) => "weak",
            Self::Objects(_) => "objects",
        }
    }

    /// The recipe with that name, with all defaults.
    ///
    /// # Errors
    /// If the name is not in [`AnyRecipe::NAMES`].
    pub fn named(name: &str) -> Result<Self> {
        match name {
            "pyramid" => Ok(Self::Pyramid(Box::default())),
            "weak" => Ok(Self::Weak(Box::default())),
            "objects" => Ok(Self::Objects(Box::default())),
            _ => Err(Error::parameter("recipe", name, Self::NAMES.join(", "))),
        }
    }

    /// Reads TOML; the message about a wrong key gives its line and the nearest valid key.
    ///
    /// # Errors
    /// If the text is not TOML, or a recipe, key or value is unknown.
    pub fn from_toml(text: &str) -> Result<Self> {
        let table: toml::Table = explained(text)?;
        match table.get("recipe").map(|kind| kind.as_str().unwrap_or_default()) {
            None | Some("pyramid") => Ok(Self::Pyramid(Box::new(Recipe::from_toml(text)?))),
            Some("weak") => Ok(Self::Weak(Box::new(explained(text)?))),
            Some("objects") => Ok(Self::Objects(Box::new(explained(text)?))),
            Some(other) => Err(Error::parameter("recipe", other, Self::NAMES.join(", "))),
        }
    }

    /// The recipe as TOML, with all values written out.
    ///
    /// # Errors
    /// Never for values that pass [`AnyRecipe::validate`].
    pub fn to_toml(&self) -> Result<String> {
        let text = match self {
            Self::Pyramid(recipe) => return recipe.to_toml(),
            Self::Weak(recipe) => toml::to_string(recipe),
            Self::Objects(recipe) => toml::to_string(recipe),
        };
        text.map_err(|e| Error::input(format!("recipe cannot be written as TOML: {e}")))
    }

    /// Checks all parts.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        match self {
            Self::Pyramid(recipe) => recipe.validate(),
            Self::Weak(recipe) => recipe.validate(),
            Self::Objects(recipe) => recipe.validate(),
        }
    }

    /// Applies `section.key=value` settings, each value read as TOML (a bare word counts as text).
    ///
    /// # Errors
    /// As [`AnyRecipe::from_toml`].
    pub fn with_settings<'a>(&self, settings: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let mut table: toml::Table = self.to_toml()?.parse().map_err(|e| Error::input(format!("recipe: {e}")))?;
        for setting in settings {
            set_key(&mut table, setting)?;
        }
        Self::from_toml(&table.to_string())
    }

    /// The same recipe with another seed.
    pub fn with_seed(mut self, seed: u64) -> Self {
        match &mut self {
            Self::Pyramid(recipe) => recipe.seed = seed,
            Self::Weak(recipe) => recipe.seed = seed,
            Self::Objects(recipe) => recipe.seed = seed,
        }
        self
    }

    /// The regularisation of the labels.
    pub fn regularise(&self) -> &RegulariseParams {
        match self {
            Self::Pyramid(recipe) => &recipe.regularise,
            Self::Weak(recipe) => &recipe.regularise,
            Self::Objects(recipe) => &recipe.regularise,
        }
    }

    /// Columns of a cloud that the recipe reads, besides labels.
    pub fn columns(&self) -> Vec<String> {
        match self {
            Self::Pyramid(recipe) => recipe.features.columns().into_iter().map(String::from).collect(),
            Self::Weak(recipe) => recipe.columns(),
            Self::Objects(recipe) => recipe.columns(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segmentation::Intent;

    #[test]
    fn recipes_survive_toml_and_tell_their_kind() {
        for name in AnyRecipe::NAMES {
            let recipe = AnyRecipe::named(name).unwrap().with_seed(3);
            let text = recipe.to_toml().unwrap();
            assert!(text.contains(&format!("recipe = \"{name}\"")), "{text}");
            assert_eq!(AnyRecipe::from_toml(&text).unwrap(), recipe);
        }
        assert!(matches!(AnyRecipe::from_toml("seed = 1").unwrap(), AnyRecipe::Pyramid(_)));
        assert!(AnyRecipe::named("strong").unwrap_err().to_string().contains("weak"));
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
    }
}
