//! `scansion completions` and `scansion man`: the command line for shells and for readers of manual pages.

use super::Context;
use crate::args::{Args, Completions, Man};
use crate::exit_code::Failure;
use clap::{Command, CommandFactory};
use scansion_core::Error;
use scansion_core::io::atomic;
use std::path::Path;

pub(crate) fn completions(args: &Completions, context: &Context<'_>) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Args::command(), "scansion", &mut script);
    context.printer.data(&String::from_utf8_lossy(&script))
}

/// One page for the program and one for each verb.
pub(crate) fn man(args: &Man, context: &Context<'_>) -> Result<(), Failure> {
    std::fs::create_dir_all(&args.folder).map_err(|e| Error::io(&args.folder, e))?;
    let mut program = Args::command().disable_help_subcommand(true);
    program.build();
    let pages = write(program, &args.folder)?;
    context.printer.note(&format!(
        "{}: {pages} pages; man -l {}/scansion.1",
        args.folder.display(),
        args.folder.display()
    ));
    Ok(())
}

/// Writes the page of a command and of those below it; returns their number.
fn write(command: Command, folder: &Path) -> Result<usize, Error> {
    let below: Vec<Command> = command.get_subcommands().filter(|verb| !verb.is_hide_set()).cloned().collect();
    let page = clap_mangen::Man::new(command).manual("Scansion");
    let path = folder.join(page.get_filename());
    let mut text = Vec::new();
    page.render(&mut text).map_err(|e| Error::io(&path, e))?;
    atomic::write_bytes(&path, &text)?;
    below.into_iter().try_fold(1, |pages, verb| write(verb, folder).map(|more| pages + more))
}
