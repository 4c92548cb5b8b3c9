//! Lines as GeoJSON, with z; the reference system as in outlines.

use super::Drawing;
use crate::error::Result;
use crate::io::maps::{collection, feature, places};
use crate::parallel::{Looks, Monitor};

/// The text of a file; one line of text per line.
pub(super) fn text(drawing: &Drawing, monitor: &Monitor) -> Result<String> {
    let mut looks = Looks::at(monitor);
    let mut features = Vec::with_capacity(drawing.lines.len());
    for line in &drawing.lines {
        looks.steps(line.vertices.len())?;
        features.push(feature("LineString", &places(line.path()), &line.attributes()));
    }
    Ok(collection(&features, &drawing.place))
}
