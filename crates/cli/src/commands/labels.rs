//! Labels of the inputs according to the arguments, with a message about what counts as unlabelled.

use super::Context;
use crate::args::LabelArgs;
use scansion_core::classes::LabelMap;
use scansion_core::cloud::{Cloud, CodeScheme};
use scansion_core::io;
use scansion_core::recipes::{LabelFile, LabelParams, Labels, read_labels};
use scansion_core::{Error, Result};
use std::path::Path;

/// Label settings of all inputs of a run; each `--map-of` must name one of them.
pub(crate) struct LabelSource<'a> {
    args: &'a LabelArgs,
    /// An input and its own map.
    own: Vec<(&'a Path, LabelMap)>,
}

impl<'a> LabelSource<'a> {
    /// Finds the input of each `--map-of`.
    ///
    /// # Errors
    /// If a map is invalid, no input or several have that name, or an input gets two maps.
    pub(crate) fn new(args: &'a LabelArgs, inputs: &[&'a Path]) -> Result<Self> {
        let all = || inputs.iter().map(|i| i.display().to_string()).collect::<Vec<_>>().join(", ");
        let mut own: Vec<(&Path, LabelMap)> = Vec::new();
        for of in &args.map_of {
            let wrong = |allowed: String| Error::parameter("map-of", of, allowed);
            let (file, map) = of.rsplit_once(':').ok_or_else(|| wrong("FILE:OLD=NEW,...".into()))?;
            let mut named = inputs.iter().filter(|input| input.ends_with(file));
            let input = named.next().ok_or_else(|| wrong(format!("the name of an input: {}", all())))?;
            if let Some(other) = named.find(|other| *other != input) {
                let (a, b) = (input.display(), other.display());
                return Err(wrong(format!("the name of one input; {a} and {b} are meant, give their folders")));
            }
            if own.iter().any(|(known, _)| known == input) {
                return Err(wrong(format!("one map an input; {} has another", input.display())));
            }
            own.push((input, map.parse()?));
        }
        Ok(Self { args, own })
    }

    /// The map from `--map-of` for an input.
    pub(crate) fn own_map(&self, input: &Path) -> Option<&LabelMap> {
        self.own.iter().find(|(known, _)| *known == input).map(|(_, map)| map)
    }

    /// Label settings of an input, in the form that the core expects.
    pub(crate) fn params(&self, input: &Path) -> Result<LabelParams> {
        Ok(LabelParams {
            dimension: self.args.label_dimension.clone(),
            map: self.own_map(input).cloned().map_or_else(|| self.args.map.join(",").parse(), Ok)?,
            unlabelled: self.args.unlabelled.codes(),
            classes: self.args.classes.clone(),
        })
    }

    /// The labels of an input; prints which points count as unlabelled.
    pub(crate) fn read(&self, input: &Path, cloud: &Cloud, context: &Context<'_>) -> Result<Labels> {
        self.read_as((input, cloud), &self.params(input)?, context)
    }

    /// The same with another map.
    pub(crate) fn read_mapped(
        &self,
        (input, cloud): (&Path, &Cloud),
        map: &LabelMap,
        context: &Context<'_>,
    ) -> Result<Labels> {
        self.read_as((input, cloud), &LabelParams { map: map.clone(), ..self.params(input)? }, context)
    }

    fn read_as(&self, (input, cloud): (&Path, &Cloud), params: &LabelParams, context: &Context<'_>) -> Result<Labels> {
        if cloud.column(&params.dimension).is_none() {
            // Only some columns were read; the file has the complete list.
            let known =
                io::inspect_with(input, context.columns).map(|info| info.dimensions.join(", ")).unwrap_or_default();
            let (path, wanted) = (input.display(), &params.dimension);
            return Err(Error::input(format!(
                "{path}: no dimension {wanted} to take labels from; it has: {known} (--label-dimension takes another)"
            )));
        }
        let labels = read_labels(cloud, params).map_err(|e| Error::input(format!("{}: {e}", input.display())))?;
        if let Some(note) = note(cloud, params, &labels) {
            context.printer.note(&format!("{}: {note}", input.display()));
        }
        Ok(labels)
    }

    /// A table of picked labels, polygons, or the labels of a cloud.
    pub(crate) fn picked(&self, path: &Path, context: &Context<'_>) -> Result<LabelFile> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        if ["csv", "txt", "tsv", "geojson", "json"].contains(&extension.as_str()) {
            let params = self.params(path)?;
            return Ok(LabelFile::read_mapped(path, &params.map)?.limited(&params));
        }
        let cloud = io::read_with(path, &context.read_options())?;
        let labels = self.read(path, &cloud, context)?;
        Ok(LabelFile::of_cloud(path, &cloud, &labels))
    }

    /// Classes in `--classes` that no input has.
    pub(crate) fn absent<'l>(&self, labels: impl Iterator<Item = &'l Labels>) -> Option<String> {
        let mut points = [0u64; 256];
        labels.for_each(|l| points.iter_mut().zip(l.counts()).for_each(|(sum, n)| *sum += n));
        let list = |codes: Vec<u8>| codes.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
        let absent: Vec<u8> = self.args.classes.iter().copied().filter(|&c| points[usize::from(c)] == 0).collect();
        let found = (0..=255u8).filter(|&code| points[usize::from(code)] > 0).collect();
        (!absent.is_empty()).then(|| {
            format!("--classes asks for {}, which no point has after --map (found: {})", list(absent), list(found))
        })
    }
}

/// A message: the codes that count as unlabelled, and the number of unlabelled points.
fn note(cloud: &Cloud, params: &LabelParams, labels: &Labels) -> Option<String> {
    let (scheme, skipped) = (params.scheme(cloud), params.unlabelled_in(cloud));
    let list = skipped.iter().map(u8::to_string).collect::<Vec<_>>().join(" and ");
    let rule = match (&params.unlabelled, scheme) {
        (None, CodeScheme::Own) if labels.counts()[0] > 0 => {
            return Some(format!(
                "{}: every code is a class, 0 too ({} points); --unlabelled 0 if it means that there is no label; {} of {} \
                 points are unlabelled and skipped",
                params.dimension,
                labels.counts()[0],
                labels.unlabelled,
                cloud.len()
            ));
        }
        (None, CodeScheme::Asprs) if !skipped.is_empty() => {
            format!(" ({} of LAS: codes {list} count as unlabelled; --unlabelled none to keep them)", params.dimension)
        }
        (None, list_of) if !skipped.is_empty() => {
            let says = if skipped.len() == 1 { "code LIST counts" } else { "codes LIST count" }.replace("LIST", &list);
            format!(" ({}: {says} as unlabelled; --unlabelled none to keep them)", list_of.name())
        }
        _ => String::new(),
    };
    (labels.unlabelled > 0)
        .then(|| format!("{} of {} points are unlabelled and skipped{rule}", labels.unlabelled, cloud.len()))
}
