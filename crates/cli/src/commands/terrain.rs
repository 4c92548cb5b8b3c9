//! `scansion terrain`: terrain and surface models, height contours, and outlines of buildings.

use super::{Context, sources};
use crate::args::{Format, GroundArgs, Terrain};
use crate::exit_code::Failure;
use scansion_core::cloud::crs::unknown_vertical;
use scansion_core::cloud::{Cloud, MetricCloud, Raster, names};
use scansion_core::io::{self, Columns, Drawing, Georeference};
use scansion_core::terrain::{
    self, Footprint, FootprintParams, GroundChoice, GroundParams, Isoline, IsolineParams, ProductParams, Survey,
    footprints, heights_above_ground, isolines, normalised, surface_model, terrain_model,
};
use scansion_core::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};

pub(crate) fn run(args: &Terrain, context: &Context<'_>) -> std::result::Result<(), Failure> {
    let rasters = [&args.output, &args.dsm, &args.chm].into_iter().flatten();
    rasters.map(PathBuf::as_path).try_for_each(io::check_raster_output)?;
    args.contours.iter().try_for_each(|path| io::check_drawing_output(path))?;
    args.footprints.iter().try_for_each(|path| io::check_outline_output(path))?;
    isoline_params(args, 1.0).validate()?;
    let params = ProductParams { reach: args.reach, ..product_params(&args.ground)? };
    params.validate()?;
    footprint_params(args).validate()?;
    let mut options = context.read_options();
    options.columns = Columns::Only(vec![names::CLASSIFICATION.into(), names::WITHHELD.into()]);
    let inputs = sources::expanded(&args.inputs)?;
    let (cloud, notes) = io::read_together(&inputs, &options)?;
    notes.iter().for_each(|note| context.printer.note(note));
    args.footprints.iter().try_for_each(|_| footprint_params(args).check(&cloud))?;
    inputs.iter().take(1).for_each(|input| context.tell_unit(input, &cloud));
    cloud.crs.as_deref().and_then(unknown_vertical).iter().for_each(|text| context.printer.note(text));
    let scene = MetricCloud::new(&cloud, None, &context.monitor)?;
    let survey = match [&args.output, &args.chm, &args.contours, &args.footprints].iter().any(|path| path.is_some()) {
        true => survey(&scene, &params, context)?,
        false => {
            let survey = Survey::of_points(&scene, &params, &context.monitor)?;
            Some(&survey.note).filter(|note| !note.is_empty()).iter().for_each(|note| context.printer.note(note));
            survey
        }
    };
    let surveyed = Surveyed { survey: &survey, params: &params, metres: scene.metres };
    let mut made = rasters_of(&surveyed, args, context)?;
    // Everything is computed before the first file is written.
    if let Some(path) = &args.footprints {
        let heights = heights_above_ground(&scene, &survey, &params, &context.monitor)?;
        let found = footprints(&scene, &heights, &footprint_params(args), &context.monitor)?;
        made.outlines = Some((Outlines::of(path, &found), found));
    }
    made.write(&cloud, scene.metres, context)?;
    context.printer.data(&match context.printer.format {
        Format::Json => serde_json::to_string_pretty(&made.report()).unwrap_or_default(),
        format => made.text(format),
    })
}

/// The parameters of the arguments.
pub(crate) fn product_params(args: &GroundArgs) -> Result<ProductParams> {
    let ground = match args.ground_filter {
        true => GroundChoice::Filter,
        false if args.ground_classes.is_empty() => GroundChoice::Auto,
        false => GroundChoice::Classes(args.ground_classes.clone()),
    };
    let code = |word: &str| {
        let wrong = |_| Error::parameter("noise-classes", word, "codes 0..255 separated by commas, or none");
        word.trim().parse::<u8>().map_err(wrong)
    };
    let noise = match args.noise_classes.as_deref() {
        None => None,
        Some("none") => Some(Vec::new()),
        Some(codes) => Some(codes.split(',').map(code).collect::<Result<_>>()?),
    };
    let own = GroundParams::default();
    let filter = GroundParams {
        window: args.window.unwrap_or(own.window),
        slope: args.slope.unwrap_or(own.slope),
        wall: args.wall.unwrap_or(own.wall),
        ..own
    };
    let own = ProductParams::default();
    Ok(ProductParams { cell: args.cell.unwrap_or(own.cell), ground, filter, noise, ..own })
}

/// The ground of a cloud; tells how it was found, and of the cloud's oddities.
pub(crate) fn survey(scene: &MetricCloud<'_>, params: &ProductParams, context: &Context<'_>) -> Result<Survey> {
    scene.oddities().iter().for_each(|text| context.printer.warning(text));
    let survey = Survey::new(scene, params, &context.monitor)?;
    context.printer.note(&survey.note);
    Ok(survey)
}

fn footprint_params(args: &Terrain) -> FootprintParams {
    FootprintParams {
        classes: args.building_classes.clone(),
        alpha: args.alpha,
        min_area: args.min_area,
        tolerance: args.tolerance,
    }
}

/// The parameters of height contours of a cloud with that many metres per unit.
fn isoline_params(args: &Terrain, metres: f64) -> IsolineParams {
    IsolineParams { interval: args.interval, min_length: args.min_length / metres, ..IsolineParams::default() }
}

/// What rasters are made of.
struct Surveyed<'a> {
    survey: &'a Survey,
    params: &'a ProductParams,
    /// Metres per unit of the cloud.
    metres: f64,
}

/// The requested rasters and height contours in the unit of the cloud.
fn rasters_of(surveyed: &Surveyed<'_>, args: &Terrain, context: &Context<'_>) -> Result<Made> {
    let Surveyed { survey, params, metres } = *surveyed;
    let needed = |paths: &[&Option<PathBuf>]| paths.iter().any(|path| path.is_some());
    let on_terrain = needed(&[&args.output, &args.chm, &args.contours]);
    let terrain = on_terrain.then(|| terrain_model(survey, params, &context.monitor)).transpose()?;
    let surface =
        needed(&[&args.dsm, &args.chm]).then(|| surface_model(survey, params.cell, &context.monitor)).transpose()?;
    let above = match (&args.chm, &surface, &terrain) {
        (Some(_), Some(surface), Some(terrain)) => Some(normalised(surface, terrain)?),
        _ => None,
    };
    let in_unit = |raster: Option<Raster>| raster.map(|raster| raster.in_unit(metres)).transpose();
    let (terrain, surface, above) = (in_unit(terrain)?, in_unit(surface)?, in_unit(above)?);
    let mut made = Made::default();
    if let (Some(path), Some(terrain)) = (&args.contours, &terrain) {
        let lines = isolines(terrain, &isoline_params(args, metres), &context.monitor)?;
        made.contours = Some((Contours::of(path, &lines, metres), lines));
    }
    for (name, path, raster) in
        [("terrain", &args.output, terrain), ("surface", &args.dsm, surface), ("above terrain", &args.chm, above)]
    {
        if let (Some(path), Some(raster)) = (path, raster) {
            made.rasters.push((Product::of(name, path, &raster), raster));
        }
    }
    Ok(made)
}

/// What was made.
#[derive(Default)]
struct Made {
    rasters: Vec<(Product, Raster)>,
    contours: Option<(Contours, Vec<Isoline>)>,
    outlines: Option<(Outlines, Vec<Footprint>)>,
}

/// A raster, in the unit of the cloud.
#[derive(Serialize)]
struct Product {
    product: &'static str,
    file: PathBuf,
    columns: usize,
    rows: usize,
    cell: f64,
    cells_without_data: usize,
    lowest: Option<f64>,
    highest: Option<f64>,
}

/// Height contours, in the unit of the cloud; length in m.
#[derive(Serialize)]
struct Contours {
    product: &'static str,
    file: PathBuf,
    lines: usize,
    length: f64,
    lowest: Option<f64>,
    highest: Option<f64>,
}

impl Contours {
    fn of(file: &Path, lines: &[Isoline], metres: f64) -> Self {
        let length = metres * lines.iter().map(Isoline::length).sum::<f64>();
        let [lowest, highest] = [lines.first(), lines.last()].map(|line| line.map(|line| line.height));
        Self { product: "contours", file: file.to_path_buf(), lines: lines.len(), length, lowest, highest }
    }
}

/// The outlines of buildings; area in m².
#[derive(Serialize)]
struct Outlines {
    product: &'static str,
    file: PathBuf,
    buildings: usize,
    area: f64,
}

impl Outlines {
    fn of(file: &Path, found: &[Footprint]) -> Self {
        let area = found.iter().fold(0.0, |sum, building| sum + building.area);
        Self { product: "buildings", file: file.to_path_buf(), buildings: found.len(), area }
    }
}

impl Product {
    fn of(product: &'static str, file: &Path, raster: &Raster) -> Self {
        let heights = || raster.values().iter().copied().filter(|v| !v.is_nan());
        Self {
            product,
            file: file.to_path_buf(),
            columns: raster.columns(),
            rows: raster.rows(),
            cell: raster.cell(),
            cells_without_data: raster.values().len() - heights().count(),
            lowest: heights().reduce(f64::min),
            highest: heights().reduce(f64::max),
        }
    }
}

impl Made {
    /// Writes all files, those of lines and outlines in the unit of the cloud.
    fn write(&self, cloud: &Cloud, metres: f64, context: &Context<'_>) -> Result<()> {
        for (product, raster) in &self.rasters {
            io::write_raster(&product.file, raster, &Georeference::of(cloud), &context.monitor)?;
            context.tell_no_place(&product.file, cloud);
        }
        if let Some((contours, lines)) = &self.contours {
            let lines = lines.iter().map(Isoline::drawn).collect();
            io::write_drawing(&contours.file, &Drawing { lines, place: Georeference::of(cloud) }, &context.monitor)?;
            context.tell_no_place(&contours.file, cloud);
        }
        if let Some((outlines, found)) = &self.outlines {
            let found = terrain::outlines(found, metres);
            io::write_outlines(&outlines.file, &found, &Georeference::of(cloud), &context.monitor)?;
        }
        Ok(())
    }

    fn report(&self) -> Vec<serde_json::Value> {
        let rasters = self.rasters.iter().map(|(product, _)| serde_json::to_value(product));
        let contours = self.contours.iter().map(|(contours, _)| serde_json::to_value(contours));
        rasters
            .chain(contours)
            .chain(self.outlines.iter().map(|(outlines, _)| serde_json::to_value(outlines)))
            .filter_map(std::result::Result::ok)
            .collect()
    }

    fn text(&self, format: Format) -> String {
        let row = |cells: [String; 7]| match format {
            Format::Csv => cells.join(",") + "\n",
            _ => {
                let [name, columns, rows, cell, empty, lowest, highest] = cells;
                format!("{name:<14} {columns:>8} {rows:>8} {cell:>10} {empty:>12} {lowest:>10} {highest:>10}\n")
            }
        };
        let number = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.2}"));
        let mut text = String::new();
        if !self.rasters.is_empty() {
            text += &row(["product", "columns", "rows", "cell", "without data", "lowest", "highest"].map(String::from));
        }
        for (p, _) in &self.rasters {
            let counts = [p.columns, p.rows].map(|n| n.to_string());
            let [columns, rows] = counts;
            let cells = p.cells_without_data.to_string();
            text +=
                &row([p.product.into(), columns, rows, p.cell.to_string(), cells, number(p.lowest), number(p.highest)]);
        }
        if let Some((found, _)) = &self.contours {
            let (lines, length) = (found.lines, found.length);
            let [lowest, highest] = [found.lowest, found.highest].map(number);
            text += &match format {
                Format::Csv => format!("contours,length,lowest,highest\n{lines},{length:.1},{lowest},{highest}\n"),
                _ if lines == 0 => "no height contours\n".to_string(),
                _ => {
                    let many = if lines == 1 { "height contour" } else { "height contours" };
                    format!("{lines} {many} from {lowest} to {highest}, {length:.0} m\n")
                }
            };
        }
        if let Some((found, _)) = &self.outlines {
            text += &match format {
                Format::Csv => format!("buildings,area\n{},{:.1}\n", found.buildings, found.area),
                _ => {
                    let many = if found.buildings == 1 { "building" } else { "buildings" };
                    format!("{} {many}, {:.0} m²\n", found.buildings, found.area)
                }
            };
        }
        text
    }
}
