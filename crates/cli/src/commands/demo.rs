//! `scansion demo`: all steps on a small real scan that is built in.

use super::{Context, sources};
use crate::args::Demo;
use crate::exit_code::Failure;
use scansion_core::Error;
use scansion_core::classes::{ClassTable, LabelMap};
use scansion_core::cloud::{Column, Values, names};
use scansion_core::evaluation::{Confusion, report};
use scansion_core::images::{self, ColourBy, RenderParams, View};
use scansion_core::io::{self, Edit, atomic};
use scansion_core::recipes::{self, ClassifyParams, LabelParams, read_labels};

/// A crop of IGN's LiDAR HD (MIT licence, see `assets/README.md`) that the built-in model was not trained on.
const SCAN: &[u8] = include_bytes!("../../assets/demo.laz");

pub(crate) fn run(args: &Demo, context: &Context<'_>) -> Result<(), Failure> {
    let folder = &args.output;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let (scan, classified) = (folder.join("scan.laz"), folder.join("classified.laz"));
    atomic::write_bytes(&scan, SCAN)?;

    let mut cloud = io::read_with(&scan, &context.read_options())?;
    let params = LabelParams { map: recipes::BUILTIN_MAP.parse()?, ..LabelParams::default() };
    let truth = read_labels(&cloud, &params)?.codes;
    let model = sources::model(None)?;
    let result = recipes::classify(&cloud, &model, &ClassifyParams::default(), &context.monitor)?;
    result.warnings.iter().for_each(|w| context.printer.warning(w));
    let map: LabelMap = recipes::BUILTIN_MAP.parse()?;
    let found: Vec<u8> = result.codes.iter().map(|&code| map.apply(code)).collect();
    let confusion = Confusion::from_options(&truth, &found)?;

    let edits = [
        Edit::Classification(result.codes.clone()),
        Edit::Dimension(Column::new(names::CONFIDENCE, Values::F32(result.confidence))),
        Edit::Dimension(Column::new(names::ENTROPY, Values::F32(result.entropy))),
    ];
    io::rewrite(&scan, &classified, &edits, &context.write_options())?;
    cloud.set_column(Column::new(names::CLASSIFICATION, Values::U8(result.codes)))?;
    let views = [("map.png", View::Map), ("oblique.png", View::Oblique { azimuth_deg: 30.0, elevation_deg: 35.0 })];
    for (name, view) in views {
        let title = Some("Classified by Scansion's built-in model".to_string());
        let picture = RenderParams { view, by: ColourBy::Class, title, ..RenderParams::default() };
        let image = images::render(&cloud, &ClassTable::default(), &picture, &context.monitor)?;
        atomic::write_bytes(&folder.join(name), &image.to_png(&context.monitor)?)?;
    }
    atomic::write_bytes(&folder.join("scores.json"), report::to_json(&confusion)?.as_bytes())?;
    context.printer.data(&report::to_table(&confusion))?;
    context.printer.data(&next(folder))?;
    context.printer.note(&recipes::builtin_limits(&model.fitted.rules()));
    Ok(())
}

fn next(folder: &std::path::Path) -> String {
    let f = folder.display();
    format!(
        "\nIn {f}: scan.laz (as scanned), classified.laz (with Confidence and Entropy), map.png, oblique.png, \
         scores.json

What to do next:
  scansion classify my.laz -o classified.laz               classify every point of your own scan
  scansion train labelled.laz -o my.model                  train on your own labels
  scansion classify my.laz -o classified.laz -m my.model   and use the trained model
  scansion render classified.laz -o side.png --view oblique"
    )
}
