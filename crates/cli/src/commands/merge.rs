//! `scansion merge`: merges several files into one.

use super::{Context, sources};
use crate::args::Merge;
use crate::exit_code::Failure;
use scansion_core::io::{self, run};

pub(crate) fn run(args: &Merge, context: &Context<'_>) -> Result<(), Failure> {
    let (inputs, output) = args.inputs_and_output();
    if args.output.is_none() && output.exists() && !inputs.iter().any(|input| input == output) {
        let name = output.display();
        let text =
            format!("the last name, {name}, is the output, and it exists; to replace it, name it with -o {name}");
        return Err(Failure::Usage(text));
    }
    let inputs = sources::expanded(inputs)?;
    if inputs.len() < 2 {
        return Err(Failure::Usage("merge needs two inputs or more, then the output (or -o OUT)".into()));
    }
    inputs.iter().for_each(|input| run::expect(input));
    io::check_cloud_output(output)?;
    let report = io::merge(&inputs, output, &context.write_options())?;
    context.report(output, &report);
    Ok(())
}
