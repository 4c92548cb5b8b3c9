//! The binary: passes its arguments to the library and returns the exit code.

fn main() -> std::process::ExitCode {
    scansion_cli::run(std::env::args_os()).into()
}
