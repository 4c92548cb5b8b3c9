//! Pictures of clouds and of confusion matrices, drawn without a display.

mod camera;
mod canvas;
mod confusion;
mod furniture;
mod lines;
mod palette;
mod raster;
mod shade;
mod text;
mod values;

pub use canvas::Image;
pub use confusion::confusion_picture;
pub use palette::segment_colour;

use crate::classes::ClassTable;
use crate::cloud::{Cloud, StrayParams, Strays, names};
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use camera::Camera;
use canvas::Frame;
use raster::Raster;
use values::Paint;

/// The viewpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum View {
    /// From above, north up.
    #[default]
    Map,
    /// From the side, in parallel projection.
    Oblique {
        /// Viewing direction, degrees clockwise from north.
        azimuth_deg: f64,
        /// Elevation of the viewpoint above the horizon, degrees, 0..=90.
        elevation_deg: f64,
    },
}

/// The quantity shown by colour.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ColourBy {
    /// The class.
    #[default]
    Class,
    /// The height.
    Height,
    /// The points' own colour.
    Colour,
    /// A numeric column.
    Dimension(String),
    /// A column of segment numbers: every segment has a colour of its own, 0 (no segment) is grey.
    Segments(String),
    /// As agreement, with a colour for each pair of a true class and another.
    Change {
        /// Column with the true class.
        truth: String,
        /// Column with the predicted class.
        prediction: String,
        /// True classes to compare; empty for all.
        classes: Vec<u8>,
    },
    /// Agreement of a predicted class (second column) with the true one (first column).
    Agreement {
        /// Column with the true class.
        truth: String,
        /// Column with the predicted class.
        prediction: String,
        /// True classes to compare; empty for all.
        classes: Vec<u8>,
    },
}

impl ColourBy {
    /// The quantity of that name: class, height, rgb, or a column; in any case, but a column of just that name comes first.
    /// Without a name the class if there is one, else the height.
    pub fn named(asked: Option<&str>, cloud: &Cloud) -> Self {
        let Some(asked) = asked else {
            return match cloud.column(names::CLASSIFICATION) {
                Some(_) => Self::Class,
                None => Self::Height,
            };
        };
        let folded = || cloud.columns().iter().find(|column| column.name.eq_ignore_ascii_case(asked));
        let name = cloud.column(asked).or_else(folded).map_or(asked, |column| &column.name);
        match asked.to_ascii_lowercase().as_str() {
            "class" => Self::Class,
            "height" => Self::Height,
            "rgb" => Self::Colour,
            _ if name.starts_with("ClusterID") => Self::Segments(name.to_string()),
            _ => Self::Dimension(name.to_string()),
        }
    }
}

/// Parameters of [`render`].
#[derive(Clone, Debug, PartialEq)]
pub struct RenderParams {
    /// The viewpoint.
    pub view: View,
    /// The quantity shown by colour.
    pub by: ColourBy,
    /// Width in pixels, 200..=8000.
    pub width: u32,
    /// Height in pixels; if absent, from the shape of the cloud.
    pub height: Option<u32>,
    /// Shade the relief.
    pub shading: bool,
    /// Draw legend and scale bar.
    pub legend: bool,
    /// Title above the picture.
    pub title: Option<String>,
    /// Values at the ends of the colour ramp; if absent, the 2nd and 98th percentile.
    pub range: Option<(f64, f64)>,
    /// Draw only points of these heights (z, both ends included), e.g. those below a ceiling.
    pub clip: Option<(f64, f64)>,
    /// Lines drawn over the cloud, in its coordinates; faint where points are in front of them.
    pub lines: Vec<Vec<[f64; 3]>>,
}

impl Default for RenderParams {
    fn default() -> Self {
        Self {
            view: View::Map,
            by: ColourBy::Class,
            width: 1600,
            height: None,
            shading: true,
            legend: true,
            title: None,
            range: None,
            clip: None,
            lines: Vec::new(),
        }
    }
}

impl RenderParams {
    fn validate(&self) -> Result<()> {
        for (name, value) in [("width", Some(self.width)), ("height", self.height)] {
            if value.is_some_and(|v| !(200..=8000).contains(&v)) {
                return Err(Error::parameter(name, value.unwrap_or(0), "200..8000 pixels"));
            }
        }
        if let Some((low, high)) = self.clip.filter(|(low, high)| low > high || low.is_nan() || high.is_nan()) {
            return Err(Error::parameter("clip", format!("{low}..{high}"), "LOW..HIGH"));
        }
        match self.view {
            View::Oblique { azimuth_deg, elevation_deg }
                if !azimuth_deg.is_finite() || !(0.0..=90.0).contains(&elevation_deg) =>
            {
                Err(Error::parameter("elevation", elevation_deg, "0..90 degrees, and a finite azimuth"))
            }
            _ => Ok(()),
        }
    }
}

/// Draws a cloud. Each pixel shows the point nearest to the viewer; points that are not finite are left out. A few stray
/// points far from all others do not count for the extent of the picture.
///
/// O(points + pixels) time; the bytes do not depend on the number of threads.
///
/// # Errors
/// If a parameter is out of range, a column is absent, no line lies in the picture, or the work was cancelled.
pub fn render(cloud: &Cloud, classes: &ClassTable, params: &RenderParams, monitor: &Monitor) -> Result<Image> {
    params.validate()?;
    if let Some((low, high)) = params.clip {
        let height = |&i: &u32| (low..=high).contains(&cloud.xyz(i as usize)[2]);
        let part = cloud.select(&(0..cloud.len() as u32).filter(height).collect::<Vec<_>>());
        let within = |line: &Vec<[f64; 3]>| line.iter().all(|at| (low..=high).contains(&at[2]));
        let lines = params.lines.iter().filter(|line| within(line)).cloned().collect();
        return render(&part, classes, &RenderParams { clip: None, lines, ..params.clone() }, monitor);
    }
    let paint = Paint::new(cloud, classes, params, monitor)?;
    let strays = Strays::find(cloud, &StrayParams::default(), monitor)?;
    if let Some(&first) = strays.index.first() {
        let ([x, y, z], count) = (cloud.xyz(first as usize), strays.index.len());
        monitor.warn(format!(
            "the picture does not reach to points far from all others: {count} (the first is at {x}, {y}, {z})"
        ));
    }
    let Some(bounds) = strays.bounds else {
        let mut image = Image::blank(params.width, params.height.unwrap_or(300));
        text::draw(&mut image, [40.0, 60.0], text::Style { size: 28.0, colour: canvas::INK }, "no points");
        return Ok(image);
    };
    let camera = Camera::new(params.view, bounds);
    let frame = Frame::new(params, &camera);
    let raster = Raster::new(cloud, &camera, &frame, monitor)?;
    let mut image = Image::blank(frame.width, frame.height);
    let light = match params.shading {
        true => shade::light(&raster, params.view, monitor)?,
        false => raster::filled(raster.points.len(), 1.0, monitor)?,
    };
    let colour = |pixel: usize, point: u32| paint.colour(cloud, point).map(|c| c * light[pixel]);
    raster.fill(&mut image, &frame, colour, monitor)?;
    let over = lines::Over { camera: &camera, frame: &frame, raster: &raster };
    if !over.draw(&mut image, &params.lines) && !params.lines.is_empty() {
        return Err(Error::input("no line lies in the picture (allowed: lines in the coordinates of the cloud)"));
    }
    if let Some(title) = &params.title {
        text::draw(&mut image, [canvas::MARGIN as f32, 40.0], text::Style { size: 26.0, colour: canvas::INK }, title);
    }
    if params.legend {
        let scene = furniture::Scene { cloud, points: cloud.len() - strays.index.len() };
        furniture::draw(&mut image, &frame, &paint, scene);
    }
    image.world = (params.view == View::Map).then(|| frame.world(&camera));
    Ok(image)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};

    /// A box of 4 m on a plane of 20 m.
    fn scene() -> Cloud {
        let mut rows = Vec::new();
        let mut codes = Vec::new();
        for i in 0..200 {
            for j in 0..200 {
                let (x, y) = (f64::from(i) * 0.1, f64::from(j) * 0.1);
                let on_box = (8.0..12.0).contains(&x) && (8.0..12.0).contains(&y);
                rows.push([x, y, if on_box { 5.0 } else { 0.0 }]);
                codes.push(if on_box { 6 } else { 2 });
            }
        }
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud.set_column(Column::new("Classification", Values::U8(codes))).unwrap();
        cloud
    }

    #[test]
    fn stray_points_do_not_shrink_the_picture_and_clipped_ones_are_not_drawn() {
        let params = RenderParams { legend: false, ..RenderParams::default() };
        let draw = |cloud: &Cloud, params: &RenderParams| {
            render(cloud, &ClassTable::default(), params, &Monitor::default()).unwrap()
        };
        let plain = scene();
        let mut rows: Vec<[f64; 3]> = (0..plain.len()).map(|i| plain.xyz(i)).collect();
        rows.extend([[1e4, 1e4, 0.0], [-1e4, 5.0, 3.0]]);
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        let mut codes = plain.column("Classification").unwrap().values.to_f64();
        codes.extend([2.0, 2.0]);
        let codes = codes.into_iter().map(|code| code as u8).collect();
        cloud.set_column(Column::new("Classification", Values::U8(codes))).unwrap();
        assert_eq!(draw(&cloud, &params).rgb, draw(&plain, &params).rgb);
        let (monitor, legend) = (Monitor::default(), RenderParams { legend: true, ..params.clone() });
        let image = render(&cloud, &ClassTable::default(), &legend, &monitor).unwrap();
        assert_eq!(image.rgb, draw(&plain, &legend).rgb, "the number of points is that of those shown");
        let told = monitor.take_warnings();
        assert!(told.len() == 1 && told[0].contains("2 (the first is at 10000, 10000, 0)"), "{told:?}");
        let clipped = draw(&cloud, &RenderParams { clip: Some((-1.0, 4.0)), ..params.clone() });
        let red = |image: &Image| image.rgb.chunks_exact(3).filter(|c| c[0] > 150 && c[1] < 90).count();
        assert!(red(&draw(&cloud, &params)) > 1000 && red(&clipped) == 0);
        let wrong = RenderParams { clip: Some((4.0, 1.0)), ..params };
        assert!(render(&cloud, &ClassTable::default(), &wrong, &Monitor::default()).is_err());
    }

    #[test]
    fn each_change_of_class_has_its_colour_and_line_in_the_legend() {
        let mut cloud = scene();
        let truth = cloud.column("Classification").unwrap().values.to_f64();
        let found = truth.iter().enumerate().map(|(i, &code)| match (code as u8, i % 10) {
            (6, _) => 5,
            (_, 0) => 9,
            (code, _) => code,
        });
        cloud.set_column(Column::new("Found", Values::U8(found.collect()))).unwrap();
        let by = ColourBy::Change { truth: "Classification".into(), prediction: "found".into(), classes: Vec::new() };
        let params = RenderParams { by, ..RenderParams::default() };
        let none = Paint::new(&cloud, &ClassTable::default(), &params, &Monitor::default()).err().unwrap();
        assert!(none.to_string().contains("nearest: Found"), "{none}");
        let by = ColourBy::Change { truth: "Classification".into(), prediction: "Found".into(), classes: Vec::new() };
        let params = RenderParams { by, ..RenderParams::default() };
        let paint = Paint::new(&cloud, &ClassTable::default(), &params, &Monitor::default()).unwrap();
        let entries: Vec<String> = paint.entries().iter().map(|e| format!("{} {}", e.name, e.share)).collect();
        // 38,400 points of the plane, a tenth of which is water now; all 1,600 of the box are vegetation.
        assert_eq!(entries, ["as in the truth 86.4 %", "ground > water 9.6 %", "building > high vegetation 4.0 %"]);
        let colours: Vec<[u8; 3]> = paint.entries().iter().map(|e| e.colour).collect();
        assert!(colours[0] != colours[1] && colours[1] != colours[2]);
    }

    #[test]
    fn names_are_found_in_any_case() {
        let mut cloud = scene();
        for name in ["Height", "ClusterID"] {
            cloud.set_column(Column::new(name, Values::F32(vec![0.0; 40_000]))).unwrap();
        }
        let named = |asked: &str| ColourBy::named(Some(asked), &cloud);
        assert_eq!(
            [named("CLASS"), named("height"), named("RGB")],
            [ColourBy::Class, ColourBy::Height, ColourBy::Colour]
        );
        assert_eq!(named("classification"), ColourBy::Dimension("Classification".into()));
        assert_eq!(named("clusterid"), ColourBy::Segments("ClusterID".into()));
        assert_eq!(ColourBy::named(None, &Cloud::from_rows(&[]).unwrap()), ColourBy::Height);
    }

    #[test]
    fn only_points_of_the_asked_true_classes_are_compared() {
        let mut cloud = scene();
        let truth = cloud.column("Classification").unwrap().values.to_f64();
        // The box has no label in the truth; a tenth of the plane has another class.
        let other = |(i, code): (usize, &f64)| {
            if *code == 6.0 {
                1
            } else if i % 10 == 0 {
                9
            } else {
                2
            }
        };
        cloud.set_column(Column::new("Truth", Values::U8(truth.iter().enumerate().map(other).collect()))).unwrap();
        let shares = |classes: &[u8]| {
            let by = ColourBy::Agreement {
                truth: "Truth".into(),
                prediction: "Classification".into(),
                classes: classes.to_vec(),
            };
            let params = RenderParams { by, ..RenderParams::default() };
            let paint = Paint::new(&cloud, &ClassTable::default(), &params, &Monitor::default()).unwrap();
            let entries = paint.entries().into_iter().map(|entry| format!("{} {}", entry.name, entry.share));
            entries.collect::<Vec<_>>()
        };
        // 40,000 points, of them 1,600 of the box and 3,840 of the other class.
        assert_eq!(shares(&[]), ["as in the truth 86.4 %", "different 13.6 %"]);
        assert_eq!(shares(&[2, 9]), ["as in the truth 90.0 %", "different 10.0 %", "not compared "]);
        assert_eq!(shares(&[2]), ["as in the truth 100.0 %", "different 0.0 %", "not compared "]);
    }

    #[test]
    fn codes_that_are_no_class_have_a_line_of_the_legend() {
        let mut cloud = Cloud::from_rows(&[[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]]).unwrap();
        cloud.set_column(Column::new("Classification", Values::I32(vec![2, 0, 300, -1]))).unwrap();
        let params = RenderParams::default();
        let paint = Paint::new(&cloud, &ClassTable::default(), &params, &Monitor::default()).unwrap();
        let entries: Vec<String> = paint.entries().iter().map(|e| format!("{} {}", e.name, e.share)).collect();
        assert_eq!((entries.len(), entries[2].as_str()), (3, "other codes 50.0 %"), "{entries:?}");
        assert_eq!(paint.colour(&cloud, 2), paint.colour(&cloud, 3));
        assert_ne!(paint.colour(&cloud, 1), paint.colour(&cloud, 2));
    }

    #[test]
    fn lines_are_drawn_over_the_cloud_and_must_lie_in_the_picture() {
        let params = RenderParams { shading: false, legend: false, width: 400, ..RenderParams::default() };
        let drawn = |lines: Vec<Vec<[f64; 3]>>| {
            render(&scene(), &ClassTable::default(), &RenderParams { lines, ..params.clone() }, &Monitor::default())
        };
        let [low, high] = scene().bounds().unwrap();
        let pink = |image: &Image| image.rgb.chunks(3).filter(|rgb| rgb == &[225, 0, 90]).count();
        let line = vec![[low[0], low[1], high[2] + 1.0], [high[0], high[1], high[2] + 1.0]];
        assert!(pink(&drawn(vec![line.clone()]).unwrap()) > 300);
        assert_eq!(pink(&drawn(vec![]).unwrap()), 0);
        // A line below the points is faint.
        let below = line.iter().map(|at| [at[0], at[1], low[2] - 100.0]).collect();
        assert!(pink(&drawn(vec![below]).unwrap()) < 300);
        let far = line.iter().map(|at| at.map(|v| v + 1e4)).collect();
        assert!(drawn(vec![far]).unwrap_err().to_string().contains("picture"));
    }

    #[test]
    fn a_box_on_a_plane_has_its_colour_at_its_pixels() {
        let classes = ClassTable::from_codes(&[2, 6]);
        let params = RenderParams { shading: false, legend: false, width: 400, ..RenderParams::default() };
        let image = render(&scene(), &classes, &params, &Monitor::default()).unwrap();
        let at = |x: f64, y: f64| {
            let [a, _, _, e, c, f] = image.world.unwrap();
            let (u, v) = (((x - c) / a).round() as usize, ((y - f) / e).round() as usize);
            let p = 3 * (v * image.width as usize + u);
            [image.rgb[p], image.rgb[p + 1], image.rgb[p + 2]]
        };
        assert_eq!(at(10.0, 10.0), classes.classes()[1].colour);
        assert_eq!(at(3.0, 15.0), classes.classes()[0].colour);
    }

    #[test]
    fn neighbouring_segments_differ_in_colour_and_no_segment_is_grey() {
        let mut cloud = scene();
        let ids = (0..40_000u32).map(|i| if i % 200 < 100 { i / 20_000 } else { 3 }).collect();
        cloud.set_column(Column::new("ClusterID", Values::U32(ids))).unwrap();
        let by = ColourBy::Segments("ClusterID".into());
        let params = RenderParams { by, shading: false, legend: false, width: 400, ..RenderParams::default() };
        let image = render(&cloud, &ClassTable::default(), &params, &Monitor::default()).unwrap();
        let mut colours: Vec<&[u8]> = image.rgb.chunks_exact(3).collect();
        colours.sort_unstable();
        colours.dedup();
        assert!(colours.contains(&&[190u8, 190, 190][..]) && colours.len() >= 4, "{colours:?}");
    }

    #[test]
    fn pictures_decode_again_and_do_not_depend_on_threads() {
        let classes = ClassTable::from_codes(&[2, 6]);
        let view = View::Oblique { azimuth_deg: 30.0, elevation_deg: 35.0 };
        let params = RenderParams { view, title: Some("t".into()), width: 500, ..RenderParams::default() };
        let draw = |n| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(n)
                .build()
                .unwrap()
                .install(|| render(&scene(), &classes, &params, &Monitor::default()).unwrap())
        };
        let (one, three) = (draw(1), draw(3));
        assert_eq!(one.rgb, three.rgb);
        let png = one.to_png(&Monitor::default()).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, one.rgb);
    }

    #[test]
    fn a_cancelled_picture_is_not_drawn() {
        let monitor = Monitor::default();
        let image = render(&scene(), &ClassTable::default(), &RenderParams::default(), &monitor).unwrap();
        monitor.cancel();
        let again = render(&scene(), &ClassTable::default(), &RenderParams::default(), &monitor);
        assert!(matches!(again, Err(Error::Interrupted)));
        assert!(matches!(image.to_png(&monitor), Err(Error::Interrupted)));
    }

    #[test]
    fn few_points_and_odd_clouds_are_drawn() {
        for rows in [
            vec![],
            vec![[5.0, 5.0, 1.0]],
            vec![[0.0; 3]; 50],
            vec![[0.0; 3], [1000.0, 0.1, 0.0], [f64::NAN, 0.0, 0.0]],
        ] {
            let cloud = Cloud::from_rows(&rows).unwrap();
            for view in [View::Map, View::Oblique { azimuth_deg: 0.0, elevation_deg: 20.0 }] {
                let params = RenderParams { view, by: ColourBy::Height, ..RenderParams::default() };
                assert!(render(&cloud, &ClassTable::default(), &params, &Monitor::default()).unwrap().rgb.len() > 1000);
            }
        }
        let missing = RenderParams { by: ColourBy::Dimension("Nothing".into()), ..RenderParams::default() };
        assert!(
            render(&scene(), &ClassTable::default(), &missing, &Monitor::default())
                .unwrap_err()
                .to_string()
                .contains("Nothing")
        );
        let small = RenderParams { width: 5, ..RenderParams::default() };
        assert!(render(&scene(), &ClassTable::default(), &small, &Monitor::default()).is_err());
    }
}
