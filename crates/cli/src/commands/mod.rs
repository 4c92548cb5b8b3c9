//! One file per command: read, one call of the core, write.

mod classified;
mod classify;
mod codes;
mod contours;
mod convert;
mod demo;
mod diff;
mod evaluate;
mod feature_rows;
mod features;
mod filter;
mod height;
mod info;
mod labels;
mod merge;
mod model;
mod normals;
mod regularize;
mod render;
mod segment;
mod shell;
mod sources;
mod suggest;
mod terrain;
mod train;

use crate::args::{Args, Command, Global};
use crate::exit_code::Failure;
use crate::interrupt::Interruptible;
use crate::pipes::Pipes;
use crate::printer::Printer;
use crate::progress::Progress;
use crate::threads;
use scansion_core::Error;
use scansion_core::classes::preset;
use scansion_core::cloud::{ClassNames, Cloud, CodeScheme, OwnClass};
use scansion_core::io::run::{Rules, expect, run};
use scansion_core::io::salvage::Losses;
use scansion_core::io::{self, Georeference, ReadOptions, RewriteReport, WriteOptions};
use scansion_core::parallel::Monitor;
use std::path::Path;

/// What the class codes mean, as far as the user says.
#[derive(Clone, Debug, Default)]
pub(crate) struct Naming {
    pub(crate) scheme: Option<CodeScheme>,
    pub(crate) class_names: ClassNames,
}

impl Naming {
    /// The list by name or from a file, and single names, which come first.
    fn new(args: &Global) -> Result<Self, Failure> {
        let named = args.scheme.as_deref().map(|name| (name, CodeScheme::named(name)));
        let (scheme, mut class_names) = match named {
            None => (None, ClassNames::new()),
            Some((_, Some(scheme))) => (Some(scheme), ClassNames::new()),
            Some((path, None)) => (Some(CodeScheme::Own), Self::file(Path::new(path))?),
        };
        if let Some(names) = &args.names {
            let own =
                names.classes().iter().map(|class| (class.code, OwnClass { name: class.name.clone(), colour: None }));
            class_names.extend(own);
        }
        Ok(Self { scheme, class_names })
    }

    fn file(path: &Path) -> Result<ClassNames, Error> {
        if !path.exists() && path.extension().is_none() {
            let names = CodeScheme::ALL.map(CodeScheme::name).join(", ");
            return Err(Error::parameter("scheme", path.display(), format!("{names}, or a TOML file")));
        }
        let table = preset::from_toml(&sources::text(path)?);
        table.map(|table| table.names()).map_err(|e| Error::input(format!("{}: {e}", path.display())))
    }
}

/// The context of every command.
pub(crate) struct Context<'a> {
    pub(crate) printer: &'a Printer,
    pub(crate) monitor: Monitor,
    /// Metres per unit of all inputs, if given by the user.
    pub(crate) unit: Option<f64>,
    /// Scale of LAS outputs, if given by the user.
    pub(crate) scale: Option<[f64; 3]>,
    /// Names of the columns of text files, if given by the user.
    pub(crate) columns: &'a [String],
    /// What the class codes mean, if given by the user.
    pub(crate) naming: Naming,
}

impl Context<'_> {
    /// Options for writing, with this run's scale, progress and cancellation.
    pub(crate) fn write_options(&self) -> WriteOptions {
        let text_columns = self.columns.to_vec();
        let mut options = WriteOptions { scale: self.scale, text_columns, ..WriteOptions::default() };
        options.monitor.clone_from(&self.monitor);
        options
    }

    /// Options for reading all columns, with this run's unit, progress and cancellation.
    pub(crate) fn read_options(&self) -> ReadOptions {
        let text_columns = self.columns.to_vec();
        let Naming { scheme, class_names } = self.naming.clone();
        let metres_per_unit = self.unit;
        let mut options = ReadOptions { metres_per_unit, text_columns, scheme, class_names, ..ReadOptions::default() };
        options.monitor.clone_from(&self.monitor);
        options
    }

    /// Says which unit is assumed for a cloud that has none, if the user has not said it.
    pub(crate) fn tell_unit(&self, input: &Path, cloud: &Cloud) {
        if self.unit.is_none() && cloud.unit_is_unknown() {
            let name = input.display();
            let what = if cloud.crs.is_some() { "its reference system tells no unit" } else { "the file has no unit" };
            self.printer.note(&format!("{name}: {what}: metres are assumed; --unit 0.3048 for feet"));
        }
    }

    /// Says that the dimension for the classes (`--to`) replaces one of the input.
    pub(crate) fn tell_replaced(&self, input: &Path, to: Option<&str>) -> Result<(), Error> {
        let Some(to) = to else { return Ok(()) };
        if io::inspect_with(input, self.columns)?.dimensions.iter().any(|name| name == to) {
            let name = input.display();
            self.printer.note(&format!("{name}: it has a dimension {to}, which the classes replace in the output"));
        }
        Ok(())
    }

    /// Says that files of this format have no reference system, if the cloud has one.
    pub(crate) fn tell_no_place(&self, output: &Path, cloud: &Cloud) {
        let extension = output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        if Georeference::of(cloud).is_known() && ["asc", "dxf", "obj", "ply"].contains(&&extension[..]) {
            self.printer.note(&format!("{}: .{extension} files have no reference system", output.display()));
        }
    }

    /// Warns about losses of a damaged file.
    pub(crate) fn losses(&self, input: &Path, losses: &Losses) {
        losses.notes.iter().for_each(|n| self.printer.warning(&format!("{}: {n}", input.display())));
        self.printer.note(&format!("{}: {}", input.display(), losses.summary()));
    }

    /// Prints what was written and what had to change.
    pub(crate) fn report(&self, output: &Path, report: &RewriteReport) {
        report.notes.iter().for_each(|n| self.printer.note(&format!("{}: {n}", output.display())));
        self.printer.note(&format!("{}: {} points", output.display(), report.points));
    }
}

/// Runs the command in a pool of the requested size, with progress and Ctrl-C.
pub(crate) fn dispatch(args: &mut Args, printer: &Printer) -> Result<(), Failure> {
    let running = Interruptible::begin();
    let pipes = Pipes::open(&mut args.command, args.global.stdout_format.as_deref(), printer)?;
    run_in_pool(args, &running, printer)?;
    pipes.finish()
}

/// Runs the command on files.
fn run_in_pool(args: &Args, running: &Interruptible, printer: &Printer) -> Result<(), Failure> {
    let (unit, scale) = (args.command.unit(), args.command.scale().map_err(Failure::Usage)?);
    let monitor = running.monitor();
    let progress = Progress::watch(&monitor, &args.global);
    let overwrite = args.global.overwrite;
    let (replace, existing) = (args.command.replace(overwrite), args.command.existing(overwrite));
    let rules = Rules { monitor: monitor.clone(), replace, existing };
    let outcome = threads::with_pool(args.global.threads, || {
        run(rules, || {
            args.command.inputs().into_iter().for_each(expect);
            // The class list is an input of the run: it is not written over, and waiting for it ends with a signal.
            let naming = Naming::new(&args.global)?;
            let (monitor, columns) = (monitor.clone(), &args.global.columns);
            command(&args.command, &Context { printer, monitor, unit, scale, columns, naming })
        })
    });
    drop(progress);
    monitor.take_warnings().iter().for_each(|text| printer.warning(text));
    outcome?
}

fn command(command: &Command, context: &Context<'_>) -> Result<(), Failure> {
    match command {
        Command::Demo(demo) => demo::run(demo, context),
        Command::Info(info) => info::run(info, context),
        Command::Convert(convert) => convert::run(convert, context),
        Command::Merge(merge) => merge::run(merge, context),
        Command::Diff(diff) => diff::run(diff, context),
        Command::Features(features) => features::run(features, context),
        Command::Normals(normals) => normals::run(normals, context),
        Command::Train(train) => train::run(train, context),
        Command::Classify(classify) => classify::run(classify, context),
        Command::Regularize(regularize) => regularize::run(regularize, context),
        Command::Segment(segment) => segment::run(segment, context),
        Command::Suggest(suggest) => suggest::run(suggest, context),
        Command::Terrain(terrain) => terrain::run(terrain, context),
        Command::Contours(args) => contours::run(args, context),
        Command::Height(height) => height::run(height, context),
        Command::Filter(filter) => filter::run(filter, context),
        Command::Evaluate(evaluate) => evaluate::run(evaluate, context),
        Command::Render(render) => render::run(render, context),
        Command::Model(model) => model::run(model, context),
        Command::Completions(asked) => shell::completions(asked, context),
        Command::Man(asked) => shell::man(asked, context),
    }
}
