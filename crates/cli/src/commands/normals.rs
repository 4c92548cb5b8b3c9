//! `scansion normals`: the normal of every point.

use super::Context;
use crate::args::Normals;
use crate::exit_code::Failure;
use scansion_core::cloud::{Column, MetricCloud, Values, names};
use scansion_core::graph::NormalParams;
use scansion_core::io::{self, Columns, Edit};

pub(crate) fn run(args: &Normals, context: &Context<'_>) -> Result<(), Failure> {
    io::check_cloud_output(&args.output)?;
    io::check_holds(&args.output, "normals")?;
    io::check_dimensions(
        &args.input,
        &args.output,
        &names::NORMAL.map(|name| Column::new(name, Values::F32(Vec::new()))),
    )?;
    let params = NormalParams { neighbours: args.neighbours, orientation: args.orientation.clone() };
    params.validate()?;
    let mut options = context.read_options();
    options.columns = Columns::Only(Vec::new());
    let cloud = io::read_with(&args.input, &options)?;
    io::check_coordinates(&args.input, &args.output, &cloud, &context.write_options())?;
    let scene = MetricCloud::new(&cloud, None, &context.monitor)?;
    scene.oddities().iter().for_each(|text| context.printer.warning(text));
    let points = scene.points(&context.monitor)?;
    let found = params.find(&points, &context.monitor)?;
    let mut axes = [(); 3].map(|()| vec![f32::NAN; cloud.len()]);
    for (&i, normal) in points.frame.index.iter().zip(&found.directions) {
        axes.iter_mut().zip(normal).for_each(|(axis, &part)| axis[i as usize] = part);
    }
    drop(points);
    drop(found);
    drop(cloud);
    let columns = names::NORMAL.into_iter().zip(axes).map(|(name, axis)| Column::new(name, Values::F32(axis)));
    let edits: Vec<Edit> = columns.map(Edit::Dimension).collect();
    let report = io::rewrite(&args.input, &args.output, &edits, &context.write_options())?;
    context.report(&args.output, &report);
    Ok(())
}
