//! One file a verb: read, one call of the core, write.

mod classify;
mod demo;
mod evaluate;
mod features;
mod info;
mod model;
mod render;
mod sources;
mod train;

use crate::args::{Args, Command};
use crate::exit_code::Failure;
use crate::interrupt;
use crate::printer::Printer;
use crate::progress::Progress;
use crate::threads;
use scansion_core::parallel::Monitor;

/// What every command gets.
pub(crate) struct Context<'a> {
    pub(crate) printer: &'a Printer,
    pub(crate) monitor: Monitor,
}

/// Runs the command in a pool of the asked size, with progress and Ctrl-C.
pub(crate) fn dispatch(args: &Args, printer: &Printer) -> Result<(), Failure> {
    let context = Context { printer, monitor: interrupt::monitor() };
    let _progress = Progress::watch(&context.monitor, &args.global);
    threads::with_pool(args.global.threads, || match &args.command {
        Command::Demo(demo) => demo::run(demo, &context),
        Command::Info(info) => info::run(info, &context),
        Command::Features(features) => features::run(features, &context),
        Command::Train(train) => train::run(train, &context),
        Command::Classify(classify) => classify::run(classify, &context),
        Command::Evaluate(evaluate) => evaluate::run(evaluate, &context),
        Command::Render(render) => render::run(render, &context),
        Command::Model(model) => model::run(model, &context),
    })?
}
