//! Made-up labelled scenes for methods that are trained.

use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::random::stream;
use scansion_core::recipes::{LabelParams, LabelledCloud, read_labels};

/// A labelled field of 60 x 60 m on a slope with flat-roofed houses (6) and round trees (5), two points a metre.
///
/// # Panics
/// Never: the scene is well formed.
#[must_use]
pub fn village(seed: u64) -> LabelledCloud {
    let mut random = stream(seed, 1);
    let mut spot = |low: f64, high: f64| low + (high - low) * random.uniform();
    let houses: Vec<[f64; 3]> = (0..4)
        .map(|i| [8.0 + 26.0 * f64::from(i % 2) + spot(0.0, 4.0), 8.0 + 26.0 * f64::from(i / 2), spot(4.0, 9.0)])
        .collect();
    let trees: Vec<[f64; 3]> =
        (0..6).map(|i| [5.0 + 9.0 * f64::from(i), 27.0 + spot(-1.0, 1.0), spot(3.0, 7.0)]).collect();
    let (mut rows, mut codes) = (Vec::new(), Vec::new());
    for (i, j) in (0..120).flat_map(|i| (0..120).map(move |j| (i, j))) {
        let (x, y) = (f64::from(i) * 0.5, f64::from(j) * 0.5);
        let ground = 0.05 * x + 0.02 * spot(-1.0, 1.0);
        let house = houses.iter().find(|h| (h[0]..h[0] + 12.0).contains(&x) && (h[1]..h[1] + 10.0).contains(&y));
        let tree = trees.iter().find(|t| (x - t[0]).hypot(y - t[1]) < 2.5);
        let (z, code) = match (house, tree) {
            (Some(h), _) => (h[2] + 3.0, 6),
            (None, Some(t)) => (ground + spot(0.3, t[2]), 5),
            (None, None) => (ground, 2),
        };
        rows.push([x, y, z]);
        codes.push(code);
    }
    labelled(&rows, &codes)
}

/// Points with labels; code 0 is none.
///
/// # Panics
/// If there are not as many codes as points.
#[must_use]
pub fn labelled(rows: &[[f64; 3]], codes: &[u8]) -> LabelledCloud {
    let mut cloud = Cloud::from_rows(rows).expect("a well-formed scene");
    cloud.set_column(Column::new("Classification", Values::U8(codes.to_vec()))).expect("a well-formed scene");
    let labels = read_labels(&cloud, &LabelParams { unlabelled: Some(vec![0]), ..LabelParams::default() })
        .expect("a well-formed scene");
    LabelledCloud { cloud, labels }
}
