//! An offline page for labelling segments: two pictures of each, and a table to save.

use super::Suggestion;
use crate::classes::{Class, ClassTable};
use crate::cloud::{Cloud, Column, Values, names};
use crate::error::Result;
use crate::images::{ColourBy, RenderParams, View, render};
use crate::parallel::Monitor;
use crate::recipes::Segmented;
use base64::prelude::{BASE64_STANDARD, Engine};
use std::fmt::Write;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Largest number of points around a segment in a picture.
const MOST: usize = 60_000;
/// Colour of the segment, and of its surroundings.
const OWN: [u8; 3] = [214, 39, 100];
const OTHER: [u8; 3] = [196, 199, 203];
/// Class codes that are offered where nothing is known about the classes.
const CODES: [u8; 14] = [2, 3, 4, 5, 6, 7, 9, 10, 11, 13, 14, 15, 17, 64];
/// Surroundings that are shown on each side, in lengths of the segment, and at least, metres.
const MARGIN: f64 = 0.6;
const LEAST_MARGIN: f64 = 2.5;
/// From where the oblique picture is seen, degrees.
const AZIMUTH: f64 = 30.0;
const ELEVATION: f64 = 30.0;
/// Points that hide less than this of a segment are drawn, metres.
const CLOSE: f64 = 0.3;

/// The page, with places for what belongs to one cloud.
const TEMPLATE: &str = include_str!("../../../assets/suggestions.html");

/// An HTML page for labelling the suggested segments without a network: each from above and from the side with its
/// surroundings, keys for `classes` (well-known ones if there are none) and for own ones, and a button that saves the
/// table `cluster_id,class` for [`LabelFile`](crate::recipes::LabelFile). The browser keeps the choices until then.
///
/// # Errors
/// If the work was cancelled.
pub fn suggestion_page(
    found: &[Suggestion],
    segmented: &Segmented,
    classes: &ClassTable,
    monitor: &Monitor,
) -> Result<String> {
    monitor.stage("pictures", found.len() as u64);
    let mut figures = String::new();
    for suggestion in found {
        monitor.check()?;
        figures.push_str(&figure(suggestion, segmented, monitor)?);
        monitor.advance(1);
    }
    let offered = if classes.is_empty() { ClassTable::from_codes(&CODES) } else { classes.clone() };
    let pair = |class: &Class| (class.code, class.name.clone());
    let pairs: Vec<(u8, String)> = offered.classes().iter().map(pair).collect();
    // In a script, the sign < could end it.
    let classes = serde_json::to_string(&pairs).unwrap_or_default().replace('<', "\\u003c");
    let page = TEMPLATE.replace("{classes}", &classes).replace("{page}", &format!("{:016x}", name(found, segmented)));
    Ok(page.replace("{figures}", &figures))
}

/// A number that tells the pages of one browser apart.
fn name(found: &[Suggestion], segmented: &Segmented) -> u64 {
    let mut hasher = DefaultHasher::new();
    segmented.points.frame.origin.map(f64::to_bits).hash(&mut hasher);
    let segments: Vec<_> = found.iter().map(|s| (s.cluster_id, s.point, s.points)).collect();
    (segmented.clusters.len(), segmented.partition.len(), segments).hash(&mut hasher);
    hasher.finish()
}

fn figure(suggestion: &Suggestion, segmented: &Segmented, monitor: &Monitor) -> Result<String> {
    let crop = Crop::new(suggestion, segmented);
    let [x, y, z] = crop.extent();
    let mut text = format!(
        "<article data-id=\"{id}\" tabindex=\"0\"><h2>segment {id}</h2>\n<p>{} points, {x:.1} x {y:.1} m, {z:.1} m high, uncertainty {:.2}</p>",
        suggestion.points,
        suggestion.uncertainty,
        id = suggestion.cluster_id
    );
    let side = View::Oblique { azimuth_deg: AZIMUTH, elevation_deg: ELEVATION };
    for (view, name) in [(View::Map, "from above"), (side, "from the side")] {
        let params = RenderParams {
            view,
            by: ColourBy::Colour,
            width: 460,
            height: Some(360),
            legend: false,
            ..RenderParams::default()
        };
        let picture = render(&crop.cloud(view)?, &ClassTable::default(), &params, &Monitor::default())?;
        let picture = BASE64_STANDARD.encode(picture.to_png(monitor)?);
        let _ = write!(text, "<img alt=\"{name}\" src=\"data:image/png;base64,{picture}\">");
    }
    text.push_str("<select></select></article>\n");
    Ok(text)
}

/// A segment and its surroundings, in metres.
struct Crop {
    own: Vec<[f64; 3]>,
    others: Vec<[f64; 3]>,
    /// Corners of the segment's box.
    low: [f64; 3],
    high: [f64; 3],
}

impl Crop {
    fn new(suggestion: &Suggestion, segmented: &Segmented) -> Self {
        let segment = suggestion.cluster_id.saturating_sub(1);
        let points = &segmented.points.positions;
        let at = |i: usize| points.xyz(i).map(f64::from);
        let members = segmented.partition.members(segment as usize);
        let own: Vec<[f64; 3]> = members.iter().map(|&i| at(i as usize)).collect();
        let low = [0, 1, 2].map(|a| own.iter().map(|p| p[a]).fold(f64::INFINITY, f64::min));
        let high = [0, 1, 2].map(|a| own.iter().map(|p| p[a]).fold(f64::NEG_INFINITY, f64::max));
        let longest = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let margin = (MARGIN * longest).max(LEAST_MARGIN);
        let near = |p: &[f64; 3]| (0..3).all(|a| low[a] - margin <= p[a] && p[a] <= high[a] + margin);
        let segments = segmented.partition.segments();
        let others = (0..points.len()).filter(|&i| segments[i] != segment).map(at).filter(near).collect();
        Self { own, others, low, high }
    }

    /// Sides of the segment's box.
    fn extent(&self) -> [f64; 3] {
        [0, 1, 2].map(|a| self.high[a] - self.low[a])
    }

    /// The points in their colours, thinned if there are many, without those that hide the segment in that view.
    fn cloud(&self, view: View) -> Result<Cloud> {
        let toward = match view {
            View::Map => [0.0, 0.0, 1.0],
            View::Oblique { azimuth_deg, elevation_deg } => {
                let ((sa, ca), (se, ce)) = (azimuth_deg.to_radians().sin_cos(), elevation_deg.to_radians().sin_cos());
                [-sa * ce, -ca * ce, se]
            }
        };
        let depth = |p: &[f64; 3]| (0..3).map(|a| p[a] * toward[a]).sum::<f64>();
        let nearest = self.own.iter().map(depth).fold(f64::NEG_INFINITY, f64::max) + CLOSE;
        let behind: Vec<[f64; 3]> = self.others.iter().copied().filter(|p| depth(p) <= nearest).collect();
        let thin = |points: &[[f64; 3]]| -> Vec<[f64; 3]> {
            points.iter().copied().step_by(points.len().div_ceil(MOST).max(1)).collect()
        };
        let (own, behind) = (thin(&self.own), thin(&behind));
        let mut cloud = Cloud::from_rows(&[own.as_slice(), &behind].concat())?;
        for (channel, name) in names::COLOUR.into_iter().enumerate() {
            let values = [vec![OWN[channel]; own.len()], vec![OTHER[channel]; behind.len()]].concat();
            cloud.set_column(Column::new(name, Values::U8(values)))?;
        }
        Ok(cloud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_hides_a_segment_is_left_out_of_the_picture() {
        let own = vec![[0.0, 0.0, 1.0], [1.0, 1.0, 2.0]];
        let others = vec![[0.5, 0.5, 9.0], [0.5, 0.5, 0.0], [0.5, -9.0, 2.0]];
        let crop = Crop { own, others, low: [0.0, 0.0, 1.0], high: [1.0, 1.0, 2.0] };
        let heights = |view| {
            let cloud = crop.cloud(view).unwrap();
            (0..cloud.len()).map(|i| cloud.xyz(i)).collect::<Vec<_>>()
        };
        let map = heights(View::Map);
        assert!(!map.contains(&[0.5, 0.5, 9.0]) && map.contains(&[0.5, 0.5, 0.0]));
        let side = heights(View::Oblique { azimuth_deg: 0.0, elevation_deg: 0.0 });
        assert!(!side.contains(&[0.5, -9.0, 2.0]) && side.contains(&[0.5, 0.5, 9.0]));
    }
}
