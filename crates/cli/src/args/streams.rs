//! The inputs and outputs that may be `-`, for stdin and stdout.

use super::Command;
use std::path::PathBuf;

/// What a command reads and writes.
#[derive(Default)]
pub(crate) struct Streams<'a> {
    pub(crate) inputs: Vec<&'a mut PathBuf>,
    pub(crate) output: Option<&'a mut PathBuf>,
    /// Extension of the format of an output without a name.
    pub(crate) format: &'static str,
}

impl Command {
    /// The clouds that are read, and the cloud, table or picture that is written.
    pub(crate) fn streams(&mut self) -> Streams<'_> {
        let cloud = |inputs, output| Streams { inputs, output: Some(output), format: "las" };
        let read = |inputs| Streams { inputs, ..Streams::default() };
        match self {
            Self::Info(args) => read(args.inputs.iter_mut().collect()),
            Self::Convert(args) => {
                let output = args.output.as_mut().or(args.named_output.as_mut());
                Streams { inputs: vec![&mut args.input], output, format: "las" }
            }
            Self::Merge(args) => match &mut args.output {
                Some(output) => cloud(args.files.iter_mut().collect(), output),
                None => match args.files.split_last_mut() {
                    Some((output, inputs)) => cloud(inputs.iter_mut().collect(), output),
                    None => Streams::default(),
                },
            },
            Self::Diff(args) => read(vec![&mut args.a, &mut args.b]),
            Self::Features(args) => {
                Streams { inputs: args.input.iter_mut().collect(), output: args.output.as_mut(), format: "csv" }
            }
            Self::Normals(args) => cloud(vec![&mut args.input], &mut args.output),
            Self::Train(args) => read(args.inputs.iter_mut().collect()),
            Self::Classify(args) => cloud(args.inputs.iter_mut().collect(), &mut args.output),
            Self::Regularize(args) => cloud(vec![&mut args.input], &mut args.output),
            Self::Segment(args) => cloud(vec![&mut args.input], &mut args.output),
            Self::Suggest(args) => read(vec![&mut args.input]),
            Self::Terrain(args) => {
                Streams { inputs: args.inputs.iter_mut().collect(), output: args.output.as_mut(), format: "tif" }
            }
            Self::Contours(args) => {
                Streams { inputs: vec![&mut args.input], output: Some(&mut args.output), format: "geojson" }
            }
            Self::Height(args) => cloud(vec![&mut args.input], &mut args.output),
            Self::Filter(args) => cloud(vec![&mut args.input], &mut args.output),
            Self::Evaluate(args) => read(std::iter::once(&mut args.truth).chain(args.prediction.as_mut()).collect()),
            Self::Render(args) => {
                let inputs = args.inputs.iter_mut().chain(args.truth.as_mut());
                Streams { inputs: inputs.collect(), output: Some(&mut args.output), format: "png" }
            }
            Self::Demo(_) | Self::Model(_) | Self::Completions(_) | Self::Man(_) => Streams::default(),
        }
    }
}
