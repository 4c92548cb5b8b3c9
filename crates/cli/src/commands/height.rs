//! `scansion height`: the height of every point above the ground.

use super::Context;
use super::terrain::{product_params, survey};
use crate::args::Height;
use crate::exit_code::Failure;
use scansion_core::cloud::{Column, MetricCloud, Values, names};
use scansion_core::io::{self, Columns, Edit};
use scansion_core::terrain::heights_above_ground;

pub(crate) fn run(args: &Height, context: &Context<'_>) -> Result<(), Failure> {
    io::check_cloud_output(&args.output)?;
    io::check_holds(&args.output, "heights")?;
    let added = [Column::new(names::HEIGHT_ABOVE_GROUND, Values::F32(Vec::new()))];
    io::check_dimensions(&args.input, &args.output, &added)?;
    let params = product_params(&args.ground)?;
    params.validate()?;
    let mut options = context.read_options();
    options.columns = Columns::Only(vec![names::CLASSIFICATION.into(), names::WITHHELD.into()]);
    let cloud = io::read_with(&args.input, &options)?;
    io::check_coordinates(&args.input, &args.output, &cloud, &context.write_options())?;
    let scene = MetricCloud::new(&cloud, None, &context.monitor)?;
    let survey = survey(&scene, &params, context)?;
    let mut heights = heights_above_ground(&scene, &survey, &params, &context.monitor)?;
    let metres = scene.metres as f32;
    heights.iter_mut().for_each(|height| *height /= metres);
    drop(survey);
    drop(cloud);
    let edits = [Edit::Dimension(Column::new(names::HEIGHT_ABOVE_GROUND, Values::F32(heights)))];
    let report = io::rewrite(&args.input, &args.output, &edits, &context.write_options())?;
    context.report(&args.output, &report);
    Ok(())
}
