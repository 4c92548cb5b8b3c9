//! `scansion convert`: the same points in another format.

use super::{Context, sources};
use crate::args::Convert;
use crate::exit_code::Failure;
use scansion_core::io::{self, ConvertParams, salvage};

pub(crate) fn run(args: &Convert, context: &Context<'_>) -> Result<(), Failure> {
    sources::guard_input(&args.input, &args.output, args.overwrite)?;
    sources::refuse_partial(&args.input)?;
    if args.salvage {
        let (report, losses) = salvage::copy(&args.input, &args.output, &[], &context.write_options())?;
        context.losses(&args.input, &losses);
        context.report(&args.output, &report);
        return Ok(());
    }
    let params = ConvertParams { point_format: args.point_format };
    let report = io::convert(&args.input, &args.output, &params, &context.write_options())?;
    context.report(&args.output, &report);
    Ok(())
}
