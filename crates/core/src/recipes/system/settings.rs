//! Settings of the regularisation alone, and the tests of the settings of recipes.

use crate::error::{Error, Result};
use crate::recipes::RegulariseParams;
use crate::settings::changes::{explained, with_keys};
use serde::{Deserialize, Serialize};

/// The section of a recipe, alone.
#[derive(Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Section {
    regularise: RegulariseParams,
}

impl RegulariseParams {
    /// Applies settings `regularise.key=value` as recipes have them, each value read as TOML (a bare word counts as text).
    ///
    /// # Errors
    /// If a key is unknown, or a value has the wrong type.
    pub fn with_settings<'a>(&self, settings: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let wrong = |e: &dyn std::fmt::Display| Error::input(format!("settings: {e}"));
        let table = toml::Table::try_from(Section { regularise: self.clone() }).map_err(|e| wrong(&e))?;
        Ok(with_keys(&table, settings, |table| explained::<Section>(&table.to_string()))?.regularise)
    }
}

#[cfg(test)]
mod tests {
    use crate::classification::MaxFeatures;
    use crate::features::{Column, PyramidParams};
    use crate::recipes::RegulariseParams;
    use crate::recipes::{AnyRecipe, PyramidRecipe};
    use crate::segmentation::Intent;

    fn changed(setting: &str) -> crate::Result<PyramidRecipe> {
        match AnyRecipe::named("pyramid")?.with_settings([setting])? {
            AnyRecipe::Pyramid(recipe) => Ok(*recipe),
            other => panic!("{}", other.name()),
        }
    }

    #[test]
    fn a_wrong_key_names_itself_its_line_and_the_nearest() {
        let message = AnyRecipe::from_toml("seed = 1\n[forest]\ntreees = 3\n").unwrap_err().to_string();
        assert!(
            message.contains("treees") && message.contains("line 3") && message.contains("did you mean `trees`"),
            "{message}"
        );
    }

    #[test]
    fn values_that_are_not_written_are_those_of_the_recipe() {
        for name in AnyRecipe::names() {
            let default = AnyRecipe::named(name).unwrap();
            let section = if default.to_toml().unwrap().contains("[forest]") { "[forest]\n" } else { "" };
            let written = format!("recipe = \"{name}\"\n{section}");
            assert_eq!(AnyRecipe::from_toml(&written).unwrap(), default, "{name}");
            assert_eq!(AnyRecipe::from_toml(&default.to_toml().unwrap()).unwrap(), default, "{name}");
        }
        let read = |text: &str| AnyRecipe::from_toml(text).unwrap();
        let set = |name: &str, setting: &str| AnyRecipe::named(name).unwrap().with_settings([setting]).unwrap();
        let pairs = [
            ("recipe = \"weak\"\n[regularise]\nstrength = 2.0\n", set("weak", "regularise.strength=2.0")),
            ("recipe = \"airborne\"\n[features]\nreturns = false\n", set("airborne", "features.returns=false")),
            ("[forest]\nmax_features = { count = 5 }\n", set("pyramid", "forest.max_features.count=5")),
        ];
        for (text, expected) in pairs {
            assert_eq!(read(text), expected, "{text}");
        }
        // Another choice than that of the default takes its place.
        let text = "recipe = \"weak\"\n[regularise.partition.intent]\nsmallest-object = 0.5\n";
        let partition = |recipe: &AnyRecipe| recipe.to_toml().unwrap().contains("smallest-object = 0.5");
        assert!(partition(&read(text)), "{}", read(text).to_toml().unwrap());
    }

    #[test]
    fn settings_reach_nested_keys() {
        assert_eq!(changed("forest.trees=7").unwrap().forest.trees, 7);
        assert_eq!(changed("seed=3").unwrap().seed, 3);
        assert_eq!(changed("forest.max_features.count=5").unwrap().forest.max_features, MaxFeatures::Count(5));
        assert_eq!(changed("regularise.strength=inf").unwrap().regularise.strength, f64::INFINITY);
        // A table changes what it names and keeps the rest.
        let pyramid = changed("features.pyramid={ levels = 3, column = \"cell\" }").unwrap().features.pyramid;
        assert_eq!(
            pyramid,
            PyramidParams { first_scale: None, levels: Some(3), column: Column::Cell, ..PyramidParams::default() }
        );
        for bad in ["seed.forest=5", "forest.trees", "forest.trees=many"] {
            assert!(changed(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn another_choice_takes_the_place_of_the_default() {
        let weak = |setting: &str| match AnyRecipe::named("weak").unwrap().with_settings([setting]).unwrap() {
            AnyRecipe::Weak(recipe) => recipe.regularise.partition.intent,
            other => panic!("{}", other.name()),
        };
        assert_eq!(weak("regularise.partition.intent.smallest-object=0.5"), Intent::SmallestObject(0.5));
        assert_eq!(weak("regularise.partition.intent={ strength = inf }"), Intent::Strength(f64::INFINITY));
    }

    #[test]
    fn every_optional_value_can_be_none_and_is_written() {
        let airborne = AnyRecipe::named("airborne").unwrap();
        let scale = |recipe: AnyRecipe| match recipe {
            AnyRecipe::AutoContext(recipe) => recipe.features.pyramid.first_scale,
            other => panic!("{}", other.name()),
        };
        assert_eq!(scale(airborne.clone()), Some(0.25));
        for word in ["none", "0"] {
            assert_eq!(
                scale(airborne.with_settings([format!("features.pyramid.first_scale={word}").as_str()]).unwrap()),
                None
            );
            let text = format!(
                "recipe = \"airborne\"\n[features.pyramid]\nfirst_scale = {}",
                if word == "0" { "0" } else { "\"none\"" }
            );
            assert_eq!(scale(AnyRecipe::from_toml(&text).unwrap()), None);
        }
        for (name, key) in [
            ("pyramid", "features.metres_per_unit"),
            ("pyramid", "regularise.choice.square"),
            ("pyramid", "forest.max_depth"),
            ("weak", "features.pyramid.first_scale"),
            ("objects", "metres_per_unit"),
            ("objects", "segments.colour"),
        ] {
            let none = AnyRecipe::named(name).unwrap().with_settings([format!("{key}=none").as_str()]).unwrap();
            let last = key.rsplit('.').next().unwrap();
            assert!(none.to_toml().unwrap().contains(&format!("{last} = \"none\"")), "{name} {key}");
        }
    }

    #[test]
    fn deep_keys_and_values_are_refused_and_do_not_take_the_stack() {
        let key = vec!["a"; 60_000].join(".") + "=1";
        let message = changed(&key).unwrap_err().to_string();
        assert!(message.contains("at most 16 parts") && message.len() < 200, "{message}");
        for value in ["[".repeat(60_000), "{a=".repeat(60_000), format!("{}1", "a.".repeat(60_000))] {
            assert!(changed(&format!("forest.trees={value}")).is_err());
        }
        for text in [
            format!("{}=1", vec!["a"; 60_000].join(".")),
            format!("[{}]", vec!["a"; 60_000].join(".")),
            format!("seed = {}", "[".repeat(60_000)),
        ] {
            assert!(AnyRecipe::from_toml(&text).is_err());
        }
    }

    #[test]
    fn settings_are_those_of_recipes() {
        let params = RegulariseParams::default().with_settings(["regularise.strength=3"]).unwrap();
        assert!((params.strength - 3.0).abs() < 1e-12);
        let wrong = params.with_settings(["regularise.strenght=3"]).unwrap_err().to_string();
        assert!(wrong.contains("did you mean `strength`"), "{wrong}");
        // A key without its section is refused, whatever follows.
        for setting in ["regularise.method=segment-crf", "regularise.strength=3"] {
            let wrong = params.with_settings(["strength=5", setting]).unwrap_err().to_string();
            assert!(wrong.contains("unknown field `strength`"), "{setting}: {wrong}");
        }
    }
}
