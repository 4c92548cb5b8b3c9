//! The command line of Scansion: `run(args)` is the whole program.
//!
//! Data go to stdout, everything else to stderr. A command reads, calls the core once, and writes.

mod args;
mod commands;
mod exit_code;
mod interrupt;
mod pipes;
mod printer;
mod progress;
mod threads;

pub use exit_code::ExitCode;

use clap::Parser;
use std::ffi::OsString;
use std::io::Write;

/// Runs the program with these arguments (the first is the program's name) and returns the exit code.
///
/// Never panics on bad input: every failure is one message on stderr and an exit code.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let mut args = match args::Args::try_parse_from(arguments) {
        Ok(args) => args,
        Err(error) => return usage(&error),
    };
    let printer = printer::Printer::new(&args.global);
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| commands::dispatch(&mut args, &printer)));
    match outcome {
        Ok(Ok(())) => ExitCode::Done,
        // Not an error: the answer, already printed on stdout.
        Ok(Err(exit_code::Failure::Different)) => ExitCode::Failed,
        Ok(Err(failure)) => {
            printer.error(&failure.to_string());
            failure.exit_code()
        }
        Err(_) => {
            printer.error("internal error; please report it with the command and, if you can, the file");
            ExitCode::Failed
        }
    }
}

/// `--help` and `--version` are not failures.
fn usage(error: &clap::Error) -> ExitCode {
    let shown = error.print();
    if error.to_string().contains("invalid float literal") {
        let _ = writeln!(std::io::stderr(), "A number is written with a point, e.g. 0.5");
    }
    if shown.is_err() || error.use_stderr() { ExitCode::Usage } else { ExitCode::Done }
}
