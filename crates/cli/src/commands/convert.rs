//! `scansion convert`: converts a file to another format.

use super::Context;
use crate::args::Convert;
use crate::exit_code::Failure;
use scansion_core::io::{self, Bounds, ConvertParams, salvage};

pub(crate) fn run(args: &Convert, context: &Context<'_>) -> Result<(), Failure> {
    let output = args.output();
    io::check_cloud_output(output)?;
    if args.salvage {
        let (report, losses) = salvage::copy(&args.input, output, &[], &context.write_options())?;
        context.losses(&args.input, &losses);
        context.report(output, &report);
        return Ok(());
    }
    let params =
        ConvertParams { point_format: args.point_format, bounds: bounds(&args.bounds)?, resolution: args.resolution };
    let report = io::convert(&args.input, output, &params, &context.write_options())?;
    context.report(output, &report);
    if report.points == 0 {
        context.printer.warning(&format!("{}: it has no points", output.display()));
    }
    Ok(())
}

/// A box in plan, or in space.
pub(super) fn bounds(numbers: &[f64]) -> Result<Option<Bounds>, Failure> {
    match *numbers {
        [] => Ok(None),
        [x, y, to_x, to_y] => Ok(Some([[x, y, f64::NEG_INFINITY], [to_x, to_y, f64::INFINITY]])),
        [x, y, z, to_x, to_y, to_z] => Ok(Some([[x, y, z], [to_x, to_y, to_z]])),
        _ => Err(Failure::Usage(format!("--bounds: found {} numbers, expected 4 or 6", numbers.len()))),
    }
}
