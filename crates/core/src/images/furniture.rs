//! Legend, colour bar and scale bar.

use super::canvas::{Frame, INK, Image, LEGEND, MARGIN};
use super::palette::{label, ramp, round_step, ticks};
use super::text::{self, Style};
use super::values::{LegendEntry, Paint};
use crate::cloud::Cloud;
use crate::cloud::crs::angles;

const FAINT: [u8; 3] = [105, 110, 116];
const SIZE: f32 = 19.0;

/// What a picture shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scene<'a> {
    pub(super) cloud: &'a Cloud,
    /// Number of points, without stray ones.
    pub(super) points: usize,
}

/// Draws legend, colour bar and scale bar.
pub(super) fn draw(image: &mut Image, frame: &Frame, paint: &Paint<'_>, scene: Scene<'_>) {
    let x = i64::from(frame.x + frame.w + MARGIN);
    let y = i64::from(frame.y);
    match paint {
        Paint::Ramp { name, low, high, .. } => {
            ColourBar { name, range: [*low, *high], corner: [x, y], height: i64::from(frame.h.min(420)) }.draw(image);
        }
        _ => entries(image, [x, y], &paint.entries()),
    }
    scale_bar(image, frame, scene.cloud);
    let count = format!("{} points", grouped(scene.points));
    let width = text::width(16.0, &count);
    let place = [frame.x as f32 + frame.w as f32 - width, frame.y as f32 + frame.h as f32 + 30.0];
    text::draw(image, place, Style { size: 16.0, colour: FAINT }, &count);
}

/// Lines of a name in the legend, at most.
const LINES: usize = 2;

fn entries(image: &mut Image, [x, y]: [i64; 2], entries: &[LegendEntry]) {
    let mut top = y;
    for LegendEntry { colour, name, share } in entries {
        image.rectangle([x, top], [22, 22], *colour);
        let room = LEGEND as f32 - MARGIN as f32 - 32.0 - text::width(16.0, share) - 8.0;
        let right = x as f32 + (LEGEND - MARGIN) as f32 - text::width(16.0, share);
        text::draw(image, [right, top as f32 + 17.0], Style { size: 16.0, colour: FAINT }, share);
        let lines = wrapped(name, room);
        for (line, own) in (0..).zip(&lines) {
            let place = [x as f32 + 32.0, (top + 22 * line) as f32 + 18.0];
            text::draw(image, place, Style { size: SIZE, colour: INK }, own);
        }
        top += 32 + 22 * (lines.len() as i64 - 1);
    }
}

/// The lines of a name that are at most `room` pixels wide, broken between words; what does not fit into [`LINES`] is cut, with
/// an ellipsis in its place.
fn wrapped(name: &str, room: f32) -> Vec<String> {
    let fits = |text: &str| text::width(SIZE, text) <= room;
    let mut lines = vec![String::new()];
    for word in name.split_whitespace() {
        let last = lines.len() == LINES;
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if last || fits(&format!("{line} {word}")) => *line = format!("{line} {word}"),
            _ => lines.push(word.to_string()),
        }
    }
    for line in lines.iter_mut().filter(|line| !fits(line)) {
        while !fits(&format!("{line}…")) && line.pop().is_some() {}
        line.push('…');
    }
    lines
}

/// The colour ramp with its values.
struct ColourBar<'a> {
    name: &'a str,
    /// Values at the lower and the upper end.
    range: [f64; 2],
    /// Upper left corner, pixels.
    corner: [i64; 2],
    /// Height with the name, pixels.
    height: i64,
}

impl ColourBar<'_> {
    fn draw(&self, image: &mut Image) {
        let Self { name, range: [low, high], corner: [x, y], height } = *self;
        text::draw(image, [x as f32, y as f32 + 16.0], Style { size: SIZE, colour: INK }, name);
        let (top, height) = (y + 34, (height - 50).max(80));
        for v in 0..height {
            let colour = ramp(1.0 - v as f64 / (height - 1) as f64).map(|c| c as u8);
            image.rectangle([x, top + v], [22, 1], colour);
        }
        for tick in ticks(low, high, 6) {
            let v = top + ((high - tick) / (high - low) * (height - 1) as f64).round() as i64;
            image.rectangle([x + 22, v], [6, 1], INK);
            text::draw(image, [x as f32 + 34.0, v as f32 + 6.0], Style { size: 16.0, colour: INK }, &label(tick));
        }
    }
}

/// Units of length in pictures: name, the larger one with its multiple.
struct Unit {
    /// Units per unit of the coordinates.
    per_unit: f64,
    name: String,
    large: &'static str,
    multiple: f64,
}

impl Unit {
    /// Feet if the coordinates are feet (international or US survey), angles if they are angles, else metres.
    fn of(cloud: &Cloud) -> Self {
        if let Some(radians) = cloud.angle() {
            return Self { per_unit: 1.0, name: angles(radians), large: "", multiple: f64::INFINITY };
        }
        let metres = cloud.metres_per_unit.unwrap_or(1.0);
        match (metres - FOOT).abs() < 1e-5 {
            true => Self { per_unit: 1.0, name: "ft".into(), large: "mi", multiple: 5280.0 },
            false => Self { per_unit: metres, name: "m".into(), large: "km", multiple: 1000.0 },
        }
    }

    fn label(&self, length: f64) -> String {
        match length >= self.multiple {
            true => format!("{} {}", label(length / self.multiple), self.large),
            false => format!("{} {}", label(length), self.name),
        }
    }
}

/// Metres in a foot.
const FOOT: f64 = 0.3048;

/// A scale bar of a round length, at most a quarter of the picture's width.
fn scale_bar(image: &mut Image, frame: &Frame, cloud: &Cloud) {
    let unit = Unit::of(cloud);
    let most = 0.25 * f64::from(frame.w) * frame.unit * unit.per_unit;
    let length = match most / 2.5 >= unit.multiple {
        true => unit.multiple * round_step(most / 2.5 / unit.multiple),
        false => round_step(most / 2.5),
    };
    let pixels = (length / unit.per_unit / frame.unit).round() as i64;
    let (x, y) = (i64::from(frame.x), i64::from(frame.y + frame.h) + 22);
    image.rectangle([x, y], [pixels, 4], INK);
    image.rectangle([x, y - 5], [2, 9], INK);
    image.rectangle([x + pixels - 2, y - 5], [2, 9], INK);
    let place = [(x + pixels) as f32 + 10.0, y as f32 + 8.0];
    text::draw(image, place, Style { size: 17.0, colour: INK }, &unit.label(length));
}

/// A number with its digits in groups of three.
fn grouped(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_in_feet_where_the_coordinates_are() {
        let mut cloud = Cloud::from_rows(&[]).unwrap();
        assert_eq!([5.0, 2000.0].map(|length| Unit::of(&cloud).label(length)), ["5 m", "2 km"]);
        for metres in [0.3048, 1200.0 / 3937.0] {
            cloud.metres_per_unit = Some(metres);
            assert_eq!([500.0, 10_560.0].map(|length| Unit::of(&cloud).label(length)), ["500 ft", "2 mi"]);
        }
    }

    #[test]
    fn angles_and_short_lengths_have_a_scale_bar_too() {
        let mut cloud = Cloud::from_rows(&[]).unwrap();
        assert_eq!(Unit::of(&cloud).label(2e-4), "0.0002 m");
        cloud.crs = Some("EPSG:4326".into());
        assert_eq!([2e-5, 5.0].map(|angle| Unit::of(&cloud).label(angle)), ["0.00002 degrees", "5 degrees"]);
    }

    #[test]
    fn long_names_take_two_lines_and_are_never_cut_without_a_sign() {
        assert_eq!(wrapped("ground", 185.0), ["ground"]);
        assert_eq!(wrapped("building > high vegetation", 185.0), ["building > high", "vegetation"]);
        let long = wrapped("a very long name of a class that somebody once thought of", 185.0);
        assert!(long.len() == 2 && long[1].ends_with('…') && text::width(SIZE, &long[1]) <= 185.0, "{long:?}");
        let word = wrapped(&"w".repeat(100), 185.0);
        assert!(word.len() == 1 && word[0].ends_with('…'), "{word:?}");
        assert_eq!(wrapped("", 185.0), [""]);
    }

    #[test]
    fn digits_are_grouped() {
        assert_eq!([grouped(7), grouped(1234), grouped(1_234_567)], ["7", "1 234", "1 234 567"]);
    }
}
