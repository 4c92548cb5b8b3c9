//! Exit codes and failures of a run.

use scansion_core::Error;

/// Exit codes, the same for every command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ExitCode {
    /// Success.
    Done = 0,
    /// A failure other than usage or input: writing, memory, or differing files.
    Failed = 1,
    /// The command line is invalid.
    Usage = 2,
    /// Some of several inputs failed, the others succeeded.
    Partly = 3,
    /// An input is malformed, unsupported or does not fit the model.
    BadInput = 4,
    /// Ended by SIGHUP: the terminal was closed.
    HungUp = 129,
    /// Interrupted by Ctrl-C (SIGINT).
    Interrupted = 130,
    /// Ended by SIGTERM.
    Terminated = 143,
}

impl From<ExitCode> for std::process::ExitCode {
    fn from(code: ExitCode) -> Self {
        Self::from(code as u8)
    }
}

/// The reason why a command failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The arguments contradict each other.
    Usage(String),
    /// An error of the core.
    Core(Error),
    /// The system cannot create threads.
    Resource(String),
    /// Two files differ; the differences were printed.
    Different,
    /// This many of several inputs failed; each was reported when it happened.
    Partly {
        /// Inputs that failed.
        failed: usize,
        /// Inputs in all.
        inputs: usize,
    },
}

impl Failure {
    /// The exit code of this failure.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Usage(_) | Self::Core(Error::InvalidParameter { .. }) => ExitCode::Usage,
            Self::Different | Self::Resource(_) => ExitCode::Failed,
            Self::Core(Error::SameFile { .. } | Error::OutputName { .. }) => ExitCode::Usage,
            Self::Core(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::AlreadyExists => {
                ExitCode::Usage
            }
            Self::Core(Error::Interrupted) => crate::interrupt::exit_code(),
            Self::Core(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => ExitCode::BadInput,
            Self::Core(Error::Io { .. } | Error::Memory { .. }) => ExitCode::Failed,
            Self::Core(_) => ExitCode::BadInput,
            Self::Partly { failed, inputs } if failed == inputs => ExitCode::BadInput,
            Self::Partly { .. } => ExitCode::Partly,
        }
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Usage(message) | Self::Resource(message) => f.write_str(message),
            Self::Core(error @ Error::Malformed { format: "LAS" | "LAZ", .. }) => {
                write!(f, "{error}; if the file is damaged, scansion convert --salvage may read what is intact")
            }
            Self::Core(error) => error.fmt(f),
            Self::Different => f.write_str("the files differ"),
            Self::Partly { failed, inputs } => write!(f, "{failed} of {inputs} inputs failed"),
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Core(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_map_to_the_documented_codes() {
        assert_eq!(Failure::Usage(String::new()).exit_code() as u8, 2);
        assert_eq!(Failure::Core(Error::input("x")).exit_code() as u8, 4);
        assert_eq!(Failure::Partly { failed: 1, inputs: 2 }.exit_code() as u8, 3);
        assert_eq!(Failure::Core(Error::Interrupted).exit_code() as u8, 130);
        let denied = Error::io("x".as_ref(), std::io::ErrorKind::PermissionDenied.into());
        assert_eq!(Failure::Core(denied).exit_code() as u8, 1);
    }
}
