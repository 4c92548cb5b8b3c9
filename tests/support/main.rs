//! The program for the tests: the same one line as the binary `scansion`, built beside them.

fn main() -> std::process::ExitCode {
    scansion_cli::run(std::env::args_os()).into()
}
