//! Module `images`: pictures of clouds.

use crate::call::call;
use crate::cloud::Cloud;
use crate::convert::vector;
use crate::error::raise;
use crate::json;
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use scansion_core::classes::ClassTable;
use scansion_core::cloud::{Column, Values, names};
use scansion_core::images::{self, ColourBy, Image, RenderParams, View};
use scansion_core::io::{self, atomic};
use scansion_core::parallel::Monitor;
use scansion_core::{Cloud as CoreCloud, Error};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Settings from Python.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    by: String,
    angles: Option<(f64, f64)>,
    width: u32,
    height: Option<u32>,
    shading: bool,
    legend: bool,
    title: Option<String>,
    range: Option<(f64, f64)>,
    clip: Option<(f64, f64)>,
    /// Whether each pair of a true class and another has its own colour.
    changes: bool,
    /// True classes that are compared.
    classes: Vec<u8>,
    /// Lines drawn over the cloud.
    lines: Vec<Vec<[f64; 3]>>,
}

/// Temporary column with the true classes.
const TRUTH: &str = "Truth";

/// Draws a cloud, and writes it as PNG if a path is given. With true classes, shows where the classes differ.
#[pyfunction]
#[pyo3(signature = (cloud, settings, path = None, truth = None, n_jobs = None))]
pub(crate) fn render<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    settings: &str,
    path: Option<PathBuf>,
    truth: Option<PyReadonlyArray1<'_, i16>>,
    n_jobs: Option<i64>,
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let params = json::settings::<Settings>(settings)?.params(truth.is_some(), &cloud.inner);
    let mut cloud = Arc::clone(&cloud.inner);
    if let Some(truth) = &truth {
        let values = Values::I16(vector(truth, "truth")?.to_vec());
        Arc::make_mut(&mut cloud).set_column(Column::new(TRUTH, values)).map_err(raise)?;
    }
    let image = call(py, n_jobs, |monitor| {
        path.as_deref().map_or(Ok(()), |path| check(path, &params.view))?;
        let image = images::render(&cloud, &ClassTable::default(), &params, monitor)?;
        path.map_or(Ok(()), |path| save(&image, path, monitor)).map(|()| image)
    })?;
    let shape = [image.height as usize, image.width as usize, 3];
    PyArray1::from_vec(py, image.rgb).reshape(shape)
}

/// Fails before drawing if the picture could not be written.
fn check(path: &Path, view: &View) -> scansion_core::Result<()> {
    if path.extension().and_then(|e| e.to_str()) != Some("png") {
        let reason = "pictures are written as .png".to_string();
        return Err(Error::OutputName { path: path.to_path_buf(), reason });
    }
    io::check_output(path)?;
    match view {
        View::Map => io::check_output(&path.with_extension("pgw")),
        View::Oblique { .. } => Ok(()),
    }
}

fn save(image: &Image, path: PathBuf, monitor: &Monitor) -> scansion_core::Result<()> {
    atomic::write_bytes(&path, &image.to_png(monitor)?)?;
    match image.world_file() {
        Some(world) => atomic::write_bytes(&path.with_extension("pgw"), world.as_bytes()),
        None => Ok(()),
    }
}

impl Settings {
    fn params(self, truth: bool, cloud: &CoreCloud) -> RenderParams {
        let oblique = |(azimuth_deg, elevation_deg)| View::Oblique { azimuth_deg, elevation_deg };
        let prediction = names::CLASSIFICATION.to_string();
        RenderParams {
            view: self.angles.map_or(View::Map, oblique),
            by: match (truth, self.changes) {
                (true, false) => ColourBy::Agreement { truth: TRUTH.into(), prediction, classes: self.classes },
                (true, true) => ColourBy::Change { truth: TRUTH.into(), prediction, classes: self.classes },
                (false, _) => ColourBy::named(Some(&self.by), cloud),
            },
            width: self.width,
            height: self.height,
            shading: self.shading,
            legend: self.legend,
            title: self.title,
            range: self.range,
            clip: self.clip,
            lines: self.lines,
        }
    }
}
