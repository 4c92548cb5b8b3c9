//! Inputs, outputs, recipes and models as the arguments name them.

use crate::args::{LabelArgs, RecipeArgs};
use crate::exit_code::Failure;
use scansion_core::classification::Model;
use scansion_core::recipes::{LabelParams, Recipe, default_model};
use scansion_core::{Error, Result};
use std::path::{Path, PathBuf};

/// The recipe that file, settings and seed give together (flag before recipe before default).
pub(crate) fn recipe(args: &RecipeArgs) -> Result<Recipe> {
    let base = match &args.recipe {
        Some(path) => Recipe::from_toml(&text(path)?).map_err(|e| Error::input(format!("{}: {e}", path.display())))?,
        None => Recipe::default(),
    };
    let mut recipe = base.with_settings(args.set.iter().map(String::as_str))?;
    recipe.seed = args.seed.unwrap_or(recipe.seed);
    recipe.validate()?;
    Ok(recipe)
}

fn text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|e| Error::io(path, e))
}

/// Label settings of an input as the core wants them.
pub(crate) fn labels(args: &LabelArgs, input: &Path) -> Result<LabelParams> {
    let named = |of: &&String| of.rsplit_once(':').is_some_and(|(file, _)| input.ends_with(file));
    let own = args.map_of.iter().find(named).and_then(|of| of.rsplit_once(':'));
    Ok(LabelParams {
        dimension: args.label_dimension.clone(),
        map: own.map_or(&args.map[..], |(_, map)| map).parse()?,
        unlabelled: args.unlabelled.clone(),
        classes: args.classes.clone(),
    })
}

/// The model of that file, or the built-in one.
pub(crate) fn model(path: Option<&Path>) -> Result<Model> {
    path.map_or_else(default_model, Model::load)
}

/// Pairs each input with its output: a file for one input, a folder for several (or if it is one already).
pub(crate) fn outputs(inputs: &[PathBuf], output: &Path) -> std::result::Result<Vec<(PathBuf, PathBuf)>, Failure> {
    if let ([input], false) = (inputs, output.is_dir()) {
        return Ok(vec![(input.clone(), output.to_path_buf())]);
    }
    std::fs::create_dir_all(output).map_err(|e| Error::io(output, e))?;
    let mut pairs: Vec<(PathBuf, PathBuf)> = Vec::new();
    for input in inputs {
        let name = input.file_name().ok_or_else(|| Failure::Usage(format!("{} is not a file", input.display())))?;
        let target = output.join(name);
        if let Some((other, _)) = pairs.iter().find(|(_, t)| *t == target) {
            let text =
                format!("{} and {} would both be written to {}", other.display(), input.display(), target.display());
            return Err(Failure::Usage(text));
        }
        pairs.push((input.clone(), target));
    }
    Ok(pairs)
}

/// Refuses to replace an input by its own result unless the user asked for it.
pub(crate) fn guard_input(input: &Path, output: &Path, overwrite: bool) -> std::result::Result<(), Failure> {
    let same = match (input.canonicalize(), output.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    };
    match same && !overwrite {
        true => Err(Failure::Usage(format!("{} is input and output; say --overwrite to replace it", input.display()))),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_inputs_of_one_name_are_refused() {
        let folder = std::env::temp_dir().join(format!("scansion-outputs-{}", std::process::id()));
        let inputs = [PathBuf::from("a/x.laz"), PathBuf::from("b/x.laz")];
        assert!(matches!(outputs(&inputs, &folder), Err(Failure::Usage(_))));
        let one = outputs(&inputs[..1], &folder).unwrap();
        assert_eq!(one[0].1, folder.join("x.laz"));
        std::fs::remove_dir(&folder).unwrap();
    }
}
