//! `scansion merge`: merges several files into one.

use super::{Context, sources};
use crate::args::Merge;
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::io::{self, run};

pub(crate) fn run(args: &Merge, context: &Context<'_>) -> Result<(), Failure> {
    let (inputs, output) = args.inputs_and_output();
    let inputs = sources::expanded(inputs)?;
    inputs.iter().for_each(|input| run::expect(input));
    let checked = io::check_cloud_output(output);
    if let Err(Error::SameFile { .. }) = &checked {
        return Ok(checked?);
    }
    if args.output.is_none() && output.exists() && !inputs.iter().any(|input| input == output) {
        let name = output.display();
        let text = format!("the last name, {name}, is the output, and it exists; to replace it: -o {name} --overwrite");
        return Err(Failure::Usage(text));
    }
    if inputs.len() < 2 {
        return Err(Failure::Usage("merge needs two inputs or more, then the output (or -o OUT)".into()));
    }
    checked?;
    let report = io::merge(&inputs, output, &context.write_options())?;
    context.report(output, &report);
    Ok(())
}
