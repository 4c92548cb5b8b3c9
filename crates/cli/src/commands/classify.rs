//! `scansion classify`: classifies every point and keeps everything else in the file.

use super::classified::Summary;
use super::codes::{Kept, replaced, unclassified};
use super::{Context, sources};
use crate::args::Classify;
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::classes::{ClassTable, LabelMap};
use scansion_core::cloud::{Cloud, Column, Values, names};
use scansion_core::io::{self, Columns, Edit, run, salvage};
use scansion_core::recipes::{self, ClassRules, Classified, ClassifyParams, Model};
use std::path::Path;
use std::time::Instant;

/// Mean confidence below which a model is doubted.
const DOUBTFUL: f64 = 0.55;

pub(crate) fn run(args: &Classify, context: &Context<'_>) -> Result<(), Failure> {
    let mut model = sources::model(args.model.as_deref())?;
    model.trained.classes = model.trained.classes.renamed(&context.naming.class_names);
    if !args.set.is_empty() {
        model.fitted = model.fitted.with_settings(args.set.iter().map(String::as_str))?;
    }
    let map: LabelMap = args.map.join(",").parse()?;
    let pairs = sources::outputs(&sources::expanded(&args.inputs)?, &args.output)?;
    tell_unused(&model, &map, args, context)?;
    let builtin = recipes::is_builtin(&model);
    let (mut failed, mut first) = (0, true);
    let mut keep = Kept::new(&args.keep);
    let skipped = |output: &Path| args.skip_existing && output.exists();
    let check = |output: &Path| match skipped(output) {
        true => Ok(false),
        false => check_output(output, args).map(|()| true),
    };
    let checked: Vec<_> = pairs.iter().map(|(_, output)| check(output)).collect();
    for (number, ((input, output), checked)) in pairs.iter().zip(checked).enumerate() {
        context.monitor.file(number + 1, pairs.len());
        let work = || match checked? {
            false => {
                context.printer.note(&format!("{}: it exists and is skipped", output.display()));
                Ok(())
            }
            true => {
                let job = Job { input, output, model: &model, map: &map, builtin };
                let summary = one(&job, &mut keep, args, context)?;
                let data = summary.data(context.printer.format, std::mem::replace(&mut first, false));
                data.map_or(Ok(()), |text| context.printer.data(&text))
            }
        };
        match run::part(work) {
            Err(failure) if pairs.len() == 1 => return Err(failure),
            Err(Failure::Core(Error::Interrupted)) => {
                return Err(Error::Interrupted.into());
            }
            Err(failure) => {
                context.printer.error(&failure.to_string());
                failed += 1;
            }
            Ok(()) => {}
        }
    }
    keep.tell(context);
    if builtin && keep.read() && failed < pairs.len() {
        context.printer.note(&recipes::builtin_limits(&rules(&model, args)?));
    }
    if failed > 0 { Err(Failure::Partly { failed, inputs: pairs.len() }) } else { Ok(()) }
}

/// Fails if the result could not be written to a file of this name.
fn check_output(output: &Path, args: &Classify) -> Result<(), Error> {
    io::check_cloud_output(output)?;
    let Some(name) = &args.to else { return Ok(()) };
    io::check_dimension_name(output, name)?;
    io::check_holds(output, &format!("the dimension {name}"))
}

/// Warns of entries of `--map` for classes that the model does not give.
fn tell_unused(model: &Model, map: &LabelMap, args: &Classify, context: &Context<'_>) -> Result<(), Failure> {
    let given = given(model, args, context)?;
    // Besides the classes: codes of points without a class, and of stray points.
    let known = [given.codes(), vec![given.free_code(), 0, 1, 7]].concat().into_iter().map(u32::from).collect();
    let unused = map.unused(&known);
    if !unused.is_empty() {
        let classes: Vec<String> =
            given.classes().iter().map(|class| format!("{} {}", class.code, class.name)).collect();
        let (codes, has) = (unused.join(", "), classes.join(", "));
        context.printer.warning(&format!("--map changes no point of {codes}: the model's classes are {has}"));
    }
    Ok(())
}

/// A file to classify.
struct Job<'a> {
    input: &'a Path,
    output: &'a Path,
    model: &'a Model,
    map: &'a LabelMap,
    /// Whether the model is the built-in one.
    builtin: bool,
}

fn one(job: &Job<'_>, keep: &mut Kept, args: &Classify, context: &Context<'_>) -> Result<Summary, Failure> {
    let &Job { input, output, model, map, builtin } = job;
    let start = Instant::now();
    if !args.salvage {
        io::check_dimensions(input, output, &dimensions(model, args))?;
        context.tell_replaced(input, args.to.as_deref())?;
    }
    let mut wanted = model.fitted.columns();
    wanted.push(names::CLASSIFICATION.into());
    let mut options = context.read_options();
    options.columns = Columns::Only(wanted);
    let cloud = match args.salvage {
        true => salvage::read_some(input, &options)?,
        false => io::read_with(input, &options)?,
    };
    io::check_coordinates(input, output, &cloud, &context.write_options())?;
    context.tell_unit(input, &cloud);
    let params = ClassifyParams {
        probabilities: args.probabilities,
        metres_per_unit: args.unit.unit,
        regularise: args.regularize,
        elevation: sources::elevation(args.elevation_model.as_deref(), &context.monitor)?,
        statistics: None,
        rules: Some(rules(model, args)?),
    };
    check_kept(&cloud, args)?;
    keep.look(&cloud);
    let result = recipes::classify(&cloud, model, &params, &context.monitor)?;
    result.warnings.iter().for_each(|w| context.printer.warning(&format!("{}: {w}", input.display())));
    if builtin
        && !args.force
        && let Some(why) = recipes::builtin_misfit(&result)
    {
        return Err(Error::input(format!("{}: {why}; --force writes the result all the same", input.display())).into());
    }
    if let Some(mean) = result.mean_confidence().filter(|&mean| !builtin && mean < DOUBTFUL) {
        let name = input.display();
        let text = format!("{name}: the mean confidence is {mean:.2}: the model may not have learned such clouds");
        context.printer.warning(&text);
    }
    let points = cloud.len();
    let codes = merge(&cloud, &result, map, args);
    let given = given(model, args, context)?;
    let replaced = if args.to.is_none() {
        replaced(&cloud, &codes, &mapped(&given, map), unclassified(&cloud))
    } else {
        Vec::new()
    };
    let summary = Summary::new(output, &codes, &result, &given).replacing(replaced);
    drop(cloud);
    let edits = edits((codes, result), (model, map), (args, context))?;
    let report = if args.salvage {
        let (report, losses) = salvage::copy(input, output, &edits, &context.write_options())?;
        context.losses(input, &losses);
        report
    } else {
        io::rewrite(input, output, &edits, &context.write_options())?
    };
    report.notes.iter().for_each(|n| context.printer.note(&format!("{}: {n}", output.display())));
    let seconds = start.elapsed().as_secs_f64();
    let rate = points as f64 / seconds.max(1e-9);
    context.printer.note(&format!(
        "{}: {points} points in {seconds:.1} s ({:.0} k points/s)",
        output.display(),
        rate / 1e3
    ));
    summary.table().lines().for_each(|line| context.printer.note(line));
    summary.notice().iter().for_each(|text| context.printer.warning(text));
    Ok(summary)
}

/// The rules of the model's recipe, with the user's confidence.
fn rules(model: &Model, args: &Classify) -> Result<ClassRules, Failure> {
    let own = model.fitted.rules();
    let rules = ClassRules { abstain: args.abstain.unwrap_or(own.abstain), ..own };
    rules.validate()?;
    Ok(rules)
}

/// All classes of the output.
fn given(model: &Model, args: &Classify, context: &Context<'_>) -> Result<ClassTable, Failure> {
    Ok(rules(model, args)?.given(&model.trained.classes).renamed(&context.naming.class_names))
}

/// What made the classes, as JSON: program, model and its checksum, recipe, regularisation.
fn provenance(model: &Model, args: &Classify) -> Result<String, Failure> {
    let own = model.fitted.regularise().method;
    let file = args.model.as_deref().filter(|path| !sources::is_builtin(path)).and_then(Path::file_name);
    let text = serde_json::json!({
        "program": concat!("scansion ", env!("CARGO_PKG_VERSION")),
        "model": file.map_or("built-in".into(), |name| name.to_string_lossy()),
        "checksum": model.checksum()?,
        "recipe": model.fitted.recipe().name(),
        "settings": args.set,
        "regularise": args.regularize.unwrap_or(own).name(),
    });
    Ok(text.to_string())
}

/// The codes to write: the model's, except where the user wants the old ones kept.
fn merge(cloud: &Cloud, result: &Classified, map: &LabelMap, args: &Classify) -> Vec<u8> {
    let old = cloud.column(names::CLASSIFICATION).map(|c| &c.values);
    let open = unclassified(cloud);
    let keep = |code: u8| args.keep.contains(&code) || (args.only_unclassified && !open.contains(&code));
    let code = |(i, &new): (usize, &u8)| match old.map(|v| v.get(i)) {
        Some(code) if (0.0..=255.0).contains(&code) && keep(code as u8) => code as u8,
        _ => map.apply(new),
    };
    result.codes.iter().enumerate().map(code).collect()
}

/// Fails if a class that is to be kept is above 255.
fn check_kept(cloud: &Cloud, args: &Classify) -> Result<(), Error> {
    let values = cloud.column(names::CLASSIFICATION).filter(|_| args.only_unclassified).map(|c| &c.values);
    let large = values.and_then(|v| (0..v.len()).map(|i| (i, v.get(i))).find(|(_, code)| *code > 255.0));
    match large {
        Some((i, code)) => Err(Error::input(format!(
            "point {i} has class {code}, which cannot be kept (allowed: 0 to 255); leave out --only-unclassified"
        ))),
        None => Ok(()),
    }
}

/// The codes of some classes in the output.
fn mapped(classes: &ClassTable, map: &LabelMap) -> Vec<u8> {
    classes.classes().iter().map(|class| map.apply(class.code)).collect()
}

/// The names of the codes that are written; a code that is a class of its own keeps its name where others become it too.
fn written_names(classes: &ClassTable, map: &LabelMap) -> Vec<(u8, String)> {
    let (own, others): (Vec<_>, Vec<_>) = classes.classes().iter().partition(|c| map.apply(c.code) == c.code);
    let mut names: Vec<(u8, String)> = own.into_iter().map(|c| (c.code, c.name.clone())).collect();
    for class in others {
        let code = map.apply(class.code);
        if names.iter().all(|(taken, _)| *taken != code) {
            names.push((code, class.name.clone()));
        }
    }
    names
}

/// The dimensions that will be written, still empty.
fn dimensions(model: &Model, args: &Classify) -> Vec<Column> {
    let mut list: Vec<String> = Vec::new();
    if !args.no_extra {
        list.extend([names::CONFIDENCE.into(), names::ENTROPY.into()]);
    }
    if args.probabilities {
        list.extend(probabilities(model));
    }
    let own = args.to.iter().map(|name| Column::new(name, Values::U8(Vec::new())));
    own.chain(list.into_iter().map(|name| Column::new(name, Values::F32(Vec::new())))).collect()
}

/// The dimensions with the probabilities of a model's classes: `P_` and the name, or the code if an earlier class has that name.
fn probabilities(model: &Model) -> Vec<String> {
    let mut list: Vec<String> = Vec::new();
    for class in model.trained.classes.classes() {
        let name = names::probability_of(&class.name);
        list.push(if list.contains(&name) { names::probability_of(&class.code.to_string()) } else { name });
    }
    list
}

fn edits(
    (codes, result): (Vec<u8>, Classified),
    (model, map): (&Model, &LabelMap),
    (args, context): (&Classify, &Context<'_>),
) -> Result<Vec<Edit>, Failure> {
    let mut edits = vec![match &args.to {
        Some(name) => Edit::Dimension(Column::new(name, Values::U8(codes))),
        None => Edit::Classification(codes),
    }];
    if !args.no_extra {
        // The list of names in a file is that of Classification.
        if args.to.is_none() {
            edits.push(Edit::ClassNames(written_names(&given(model, args, context)?, map)));
            let own = context.naming.class_names.iter().map(|(&code, own)| (code, own.name.clone()));
            edits.push(Edit::OtherClassNames(own.collect()));
        }
        edits.push(Edit::Provenance(provenance(model, args)?));
        edits.push(Edit::Dimension(Column::new(names::CONFIDENCE, Values::F32(result.confidence))));
        edits.push(Edit::Dimension(Column::new(names::ENTROPY, Values::F32(result.entropy))));
    }
    if let Some(probabilities) = result.probabilities {
        let classes = model.trained.classes.classes();
        for (c, name) in self::probabilities(model).into_iter().enumerate() {
            let values = probabilities.chunks_exact(classes.len()).map(|p| p[c]).collect();
            edits.push(Edit::Dimension(Column::new(name, Values::F32(values))));
        }
    }
    Ok(edits)
}
