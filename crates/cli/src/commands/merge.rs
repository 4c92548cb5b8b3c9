//! `scansion merge`: merges several files into one.

use super::{Context, sources};
use crate::args::Merge;
use crate::exit_code::Failure;
use scansion_core::io::{self, run};

pub(crate) fn run(args: &Merge, context: &Context<'_>) -> Result<(), Failure> {
    let Some((output, inputs)) = args.files.split_last() else {
        return Err(Failure::Usage("merge needs inputs and an output".into()));
    };
    let inputs = sources::expanded(inputs)?;
    inputs.iter().for_each(|input| run::expect(input));
    io::check_cloud_output(output)?;
    let report = io::merge(&inputs, output, &context.write_options())?;
    context.report(output, &report);
    Ok(())
}
