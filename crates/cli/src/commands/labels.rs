//! Labels of the inputs according to the arguments, with a message about what counts as unlabelled.

use super::Context;
use crate::args::LabelArgs;
use scansion_core::classes::LabelMap;
use scansion_core::cloud::{Cloud, CodeScheme, Values};
use scansion_core::io;
use scansion_core::recipes::{LabelFile, LabelParams, Labels, read_labels};
use scansion_core::{Error, Result};
use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::path::Path;

/// Codes that a message lists.
const SHOWN: usize = 30;

/// Label settings of all inputs of a run; each `--map-of` must name one of them.
pub(crate) struct LabelSource<'a> {
    args: &'a LabelArgs,
    /// An input and its own map.
    own: Vec<(&'a Path, LabelMap)>,
    /// The maps that were used so far.
    used: RefCell<Vec<UsedMap>>,
    /// Whether a map was used for a table or lines, whose codes are not known here.
    tables: Cell<bool>,
}

/// A map of codes, and the codes of the inputs that it changed.
struct UsedMap {
    map: LabelMap,
    option: &'static str,
    codes: BTreeSet<u32>,
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
        Ok(Self { args, own, used: RefCell::default(), tables: Cell::default() })
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
        let Some(column) = cloud.column(&params.dimension) else {
            // Only some columns were read; the file has the complete list.
            let known =
                io::inspect_with(input, context.columns).map(|info| info.dimensions.join(", ")).unwrap_or_default();
            let (path, wanted) = (input.display(), &params.dimension);
            return Err(Error::input(format!(
                "{path}: no dimension {wanted} to take labels from; it has: {known} (--label-dimension takes another)"
            )));
        };
        self.remember(input, &params.map, &column.values);
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
            self.tables.set(true);
            return Ok(LabelFile::read_mapped(path, &params.map)?.limited(&params));
        }
        let cloud = io::read_with(path, &context.read_options())?;
        let labels = self.read(path, &cloud, context)?;
        Ok(LabelFile::of_cloud(path, &cloud, &labels))
    }

    /// Remembers which codes of an input a map could change.
    fn remember(&self, input: &Path, map: &LabelMap, values: &Values) {
        if *map == LabelMap::default() {
            return;
        }
        let common = self.args.map.join(",").parse::<LabelMap>().is_ok_and(|common| common == *map);
        let option = match self.own_map(input) == Some(map) {
            true => "--map-of",
            false if common => "--map",
            false => "--map-truth",
        };
        let (codes, mut used) = (codes_of(values), self.used.borrow_mut());
        match used.iter_mut().find(|other| other.map == *map) {
            Some(other) => other.codes.extend(codes),
            None => used.push(UsedMap { map: map.clone(), option, codes }),
        }
    }

    /// Codes in maps that no input has.
    pub(crate) fn unused(&self) -> Vec<String> {
        match self.tables.get() {
            true => Vec::new(),
            false => self.used.borrow().iter().filter_map(|used| unused(&used.map, &used.codes, used.option)).collect(),
        }
    }

    /// Classes in `--classes` that no input has.
    pub(crate) fn absent<'l>(&self, labels: impl Iterator<Item = &'l Labels>) -> Option<String> {
        let mut points = [0u64; 256];
        labels.for_each(|l| points.iter_mut().zip(l.counts()).for_each(|(sum, n)| *sum += n));
        absent(&self.args.classes, &points)
    }
}

/// The classes of `--classes` that no point has, in words; `points` are counts by code.
pub(super) fn absent(classes: &[u8], points: &[u64; 256]) -> Option<String> {
    let list = |codes: Vec<u8>| codes.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    let absent: Vec<u8> = classes.iter().copied().filter(|&c| points[usize::from(c)] == 0).collect();
    let found = (0..=255u8).filter(|&code| points[usize::from(code)] > 0).collect();
    (!absent.is_empty()).then(|| {
        format!("--classes asks for {}, which no point has after --map (found: {})", list(absent), list(found))
    })
}

/// The codes of a map that are not among those of the points, in words.
pub(super) fn unused(map: &LabelMap, codes: &BTreeSet<u32>, option: &str) -> Option<String> {
    let unused = map.unused(codes);
    let found = codes.iter().take(SHOWN).map(u32::to_string).chain((codes.len() > SHOWN).then(|| "...".into()));
    let found = found.collect::<Vec<_>>().join(", ");
    (!unused.is_empty()).then(|| format!("{option} changes no point of {} (found: {found})", unused.join(", ")))
}

/// All whole numbers from 0 on among some values.
pub(super) fn codes_of(values: &Values) -> BTreeSet<u32> {
    let (mut small, mut codes) = ([false; 256], BTreeSet::new());
    for value in (0..values.len()).map(|i| values.get(i)).filter(|value| *value >= 0.0) {
        match small.get_mut(value as usize) {
            Some(found) => *found = true,
            None => {
                codes.insert(value as u32);
            }
        }
    }
    codes.extend((0u32..).zip(small).filter(|(_, found)| *found).map(|(code, _)| code));
    codes
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
