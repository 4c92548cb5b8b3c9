//! Inputs, outputs, recipes and models named by the arguments.

use crate::args::RecipeArgs;
use crate::exit_code::Failure;
use globset::{GlobBuilder, GlobSet};
use scansion_core::cloud::crs::same_length;
use scansion_core::io::read_ascii_grid;
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{AnyRecipe, Model, PyramidRecipe, default_model};
use scansion_core::terrain::ElevationModel;
use scansion_core::{Error, Result, io};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The recipe from name or file, settings and seed (flags before recipe before defaults).
pub(crate) fn any_recipe(args: &RecipeArgs) -> Result<AnyRecipe> {
    let base = match &args.recipe {
        None => AnyRecipe::named("pyramid")?,
        Some(path) => match path.to_str().filter(|name| AnyRecipe::is_name(name)) {
            Some(name) => AnyRecipe::named(name)?,
            None if !path.exists() && path.extension().is_none() => {
                let names = format!("{}, or a TOML file", AnyRecipe::names().join(", "));
                return Err(Error::parameter("recipe", path.display(), names));
            }
            None => AnyRecipe::from_toml(&text(path)?).map_err(|e| Error::input(format!("{}: {e}", path.display())))?,
        },
    };
    let recipe = base.with_settings(args.set.iter().map(String::as_str))?;
    let recipe = match args.seed {
        Some(seed) => recipe.with_seed(seed),
        None => recipe,
    };
    recipe.validate()?;
    Ok(recipe)
}

/// The pyramid recipe from the arguments.
pub(crate) fn recipe(args: &RecipeArgs) -> Result<PyramidRecipe> {
    match any_recipe(args)? {
        AnyRecipe::Pyramid(recipe) => Ok(*recipe),
        other => Err(Error::parameter("recipe", other.name(), "pyramid for this command")),
    }
}

/// Fails if `--unit` differs from the unit that the recipe states, which clouds of a trained model would have too.
pub(crate) fn check_unit(recipe: Option<f64>, given: Option<f64>) -> std::result::Result<(), Failure> {
    match (recipe, given) {
        (Some(recipe), Some(given)) if !same_length(recipe, given) => {
            Err(Failure::Usage(format!("--unit {given}: the recipe says metres_per_unit = {recipe}; give one of them")))
        }
        _ => Ok(()),
    }
}

/// The text of a file.
pub(crate) fn text(path: &Path) -> Result<String> {
    io::open::text(path, io::open::MOST_SETTINGS)
}

/// The elevation model in that file, an ESRI ASCII grid.
pub(crate) fn elevation(path: Option<&Path>, monitor: &Monitor) -> Result<Option<ElevationModel>> {
    path.map(|path| ElevationModel::from_raster(read_ascii_grid(path)?, monitor)).transpose()
}

/// The model in that file, or the built-in one.
pub(crate) fn model(path: Option<&Path>) -> Result<Model> {
    path.filter(|path| !is_builtin(path)).map_or_else(default_model, Model::load)
}

/// Whether an argument is the name of the built-in model.
pub(crate) fn is_builtin(path: &Path) -> bool {
    ["built-in", "builtin", "default"].iter().any(|name| path.as_os_str() == *name) && !path.exists()
}

/// Pairs each input with its output: a file for one input, a folder for several, if it is a folder already, or if its
/// name ends in a separator.
pub(crate) fn outputs(inputs: &[PathBuf], output: &Path) -> std::result::Result<Vec<(PathBuf, PathBuf)>, Failure> {
    let folder = output.is_dir() || output.to_string_lossy().ends_with(std::path::is_separator);
    if let ([input], false) = (inputs, folder) {
        return Ok(vec![(input.clone(), output.to_path_buf())]);
    }
    if !folder && io::is_cloud_name(output) {
        let (name, count) = (output.display(), inputs.len());
        let text =
            format!("{name} is the name of one file, but there are {count} inputs: name a folder, e.g. classified/");
        return Err(Failure::Usage(text));
    }
    std::fs::create_dir_all(output).map_err(|e| Error::io(output, e))?;
    let mut pairs: Vec<(PathBuf, PathBuf)> = Vec::new();
    for input in inputs {
        let name = input.file_name().ok_or_else(|| Failure::Usage(format!("{} is not a file", input.display())))?;
        // COPC is not written.
        let plain = name.to_str().and_then(|n| Some(format!("{}.laz", n.strip_suffix(".copc.laz")?)));
        let target = output.join(plain.as_deref().map_or(name, OsStr::new));
        if let Some((other, _)) = pairs.iter().find(|(_, t)| *t == target) {
            let text =
                format!("{} and {} would both be written to {}", other.display(), input.display(), target.display());
            return Err(Failure::Usage(text));
        }
        pairs.push((input.clone(), target));
    }
    Ok(pairs)
}

/// Replaces inputs with `*`, `?`, `[...]` and `{a,b}` in file names by the matching files, sorted by name, for shells
/// that do not expand patterns. The name of an existing file is used as it is.
pub(crate) fn expanded(inputs: &[PathBuf]) -> std::result::Result<Vec<PathBuf>, Failure> {
    let mut all = Vec::new();
    for input in inputs {
        let name = input.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if !name.contains(['*', '?', '[', '{']) || input.exists() {
            all.push(input.clone());
            continue;
        }
        let folder = input.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
        let fits = matcher(&name);
        let names = entries.filter_map(|e| e.ok().map(|e| e.file_name()));
        let mut found: Vec<_> = names.filter(|n| fits(n)).collect();
        found.sort();
        if found.is_empty() {
            return Err(Error::io(input, std::io::ErrorKind::NotFound.into()).into());
        }
        all.extend(found.into_iter().map(|n| input.with_file_name(n)));
    }
    Ok(all)
}

/// Longest pattern in bytes; file names have at most 255.
const LONGEST_PATTERN: usize = 1024;

/// Whether names match a pattern as in a shell: hidden names only match patterns that start with a dot, a backslash is
/// a character like any other, and a pattern that is not valid (a bracket that is never closed) matches nothing.
fn matcher(pattern: &str) -> impl Fn(&OsStr) -> bool {
    let valid = Some(pattern).filter(|p| p.len() <= LONGEST_PATTERN);
    let glob = valid.and_then(|p| GlobBuilder::new(p).backslash_escape(false).build().ok());
    // A set of one: it reports what a single pattern would panic at.
    let globs = GlobSet::new(glob).unwrap_or_default();
    let hidden = pattern.starts_with('.');
    move |name| (hidden || name.as_encoded_bytes().first() != Some(&b'.')) && globs.is_match(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_match_as_in_a_shell() {
        for (pattern, name, expected) in [
            ("*.laz", "a.laz", true),
            ("*.laz", "a.las", false),
            ("*.laz", ".a.laz", false),
            ("tile_?_*.la[sz]", "tile_3_x.y.las", true),
            ("tile_[0-4].laz", "tile_5.laz", false),
            ("[!a]*b*", "xabcb", true),
            ("[!a]*b*", "abcb", false),
            ("a[", "a[", false),
            ("*a*a*a", "aaab", false),
            ("**.laz", "a.laz", true),
            ("?", "\n", true),
            ("[]a]*", "]b", true),
            ("[a-]?", "-b", true),
            ("[z-a]", "b", false),
            (".*", ".a.laz", true),
            ("a\\*", "a\\b", true),
            ("tile_{1,12}_*", "tile_12_a", true),
            ("tile_{1,12}_*", "tile_2_a", false),
            ("tile}_*", "tile}_a", false),
        ] {
            assert_eq!(matcher(pattern)(OsStr::new(name)), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn long_and_deep_patterns_match_nothing() {
        for pattern in
            ["*".repeat(100_000), "{".repeat(100_000), "{".repeat(400) + &"}".repeat(400), "[!a]".repeat(9000)]
        {
            assert!(!matcher(&pattern)(OsStr::new("a.laz")));
        }
    }

    #[test]
    fn two_inputs_of_one_name_are_refused() {
        let folder = std::env::temp_dir().join(format!("scansion-outputs-{}", std::process::id()));
        let inputs = [PathBuf::from("a/x.laz"), PathBuf::from("b/x.laz")];
        assert!(matches!(outputs(&inputs, &folder), Err(Failure::Usage(_))));
        let one = outputs(&inputs[..1], &folder).unwrap();
        assert_eq!(one[0].1, folder.join("x.laz"));
        std::fs::remove_dir(&folder).unwrap();
        // A name that ends in a separator is a folder, also for one input; a .laz is none for several.
        let named = PathBuf::from(format!("{}/", folder.display()));
        assert_eq!(outputs(&inputs[..1], &named).unwrap()[0].1, folder.join("x.laz"));
        std::fs::remove_dir(&folder).unwrap();
        let two = [PathBuf::from("x.laz"), PathBuf::from("y.laz")];
        let file = folder.with_extension("laz");
        assert!(matches!(outputs(&two, &file), Err(Failure::Usage(text)) if text.contains("2 inputs")));
        assert!(!file.exists());
    }
}
