//! Features of segments as objects: 18 numbers for shape and colour, and heights above ground.

use super::Partition;
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::features::definition::Group;
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::{self, Shape};
use crate::linalg::{Sym3, mean};
use crate::parallel::{Monitor, map_ordered_with};

/// Segments that one task describes.
const BLOCK: usize = 32;

/// Attributes of each point other than its position.
#[derive(Clone, Copy, Debug, Default)]
pub struct ObjectAttributes<'a> {
    /// Red, green and blue, 0..=1.
    pub colours: Option<&'a [[f32; 3]]>,
    /// Height above ground, metres; not a number where it is not known.
    pub heights: Option<&'a [f32]>,
}

/// The features of each segment: those of [`Group::SegmentShape`], then [`Group::SegmentColour`] if there are colours,
/// then [`Group::SegmentHeight`] if there are heights. Row-major, one row a segment. e = λ / Σλ of the covariance
/// (divisor n).
///
/// E. Hasanpour Zaryabi, M. Saadatseresht, E. Ghanbari Parmehr, *An object-based classification framework for ALS point
/// cloud in urban areas*, ISPRS Annals X-4/W1, 2022, Table 3, with its misprints corrected: the ratios are shares of the
/// sum of the three means and sum to 1 (0 for black), the variance of z is Σ(z − z̄)²/n. Mean z is taken from the
/// coordinates of the file and depends on the elevation of the scene: use heights above ground instead. A segment whose
/// points coincide has eigenvalue features 0; one without a known height has NaN as heights. O(n).
///
/// # Errors
/// If partition, points and attributes differ in length, or the work was cancelled.
pub fn object_features(
    points: &Points,
    partition: &Partition,
    attributes: &ObjectAttributes<'_>,
    monitor: &Monitor,
) -> Result<FeatureTable> {
    let (n, colours, heights) = (points.len(), attributes.colours, attributes.heights);
    let lengths = [
        ("segments", partition.nodes()),
        ("colours", colours.map_or(n, <[_]>::len)),
        ("heights", heights.map_or(n, <[_]>::len)),
    ];
    if let Some((name, found)) = lengths.into_iter().find(|(_, found)| *found != n) {
        return Err(Error::input(format!("{name} of {found} points for {n} points")));
    }
    let mut names: Vec<String> = Group::SegmentShape.names().collect();
    names.extend(colours.iter().flat_map(|_| Group::SegmentColour.names()));
    names.extend(heights.iter().flat_map(|_| Group::SegmentHeight.names()));
    monitor.stage("object features", n as u64);
    let parts = map_ordered_with(0..partition.len().div_ceil(BLOCK), monitor, Vec::new, |places, block| {
        let mut rows = Vec::with_capacity(BLOCK * names.len());
        for segment in block * BLOCK..((block + 1) * BLOCK).min(partition.len()) {
            let members = partition.members(segment);
            geometric(points, members, places, &mut rows);
            colours.iter().for_each(|all| spectral(all, members, &mut rows));
            heights.iter().for_each(|all| rows.extend(height(all, members)));
            monitor.advance(members.len() as u64);
        }
        Ok(rows)
    })?;
    Ok(FeatureTable { names, values: parts.concat() })
}

fn geometric(points: &Points, members: &[u32], places: &mut Vec<[f64; 3]>, row: &mut Vec<f32>) {
    places.clear();
    places.extend(members.iter().map(|&i| points.positions.xyz(i as usize).map(f64::from)));
    let centre = mean(places);
    let scatter = Sym3::scatter(places, centre, places.len().max(1) as f64);
    let e = shape::normalised::<Exact, f64>(scatter.eigen().values);
    let found = Shape::of::<Exact>(e);
    let features = [
        found.linearity,
        found.planarity,
        found.scattering,
        e[2],
        shape::omnivariance::<Exact, f64>(e),
        found.anisotropy,
        shape::eigenentropy::<Exact, f64>(e),
        centre[2] + points.frame.origin[2],
        scatter.diagonal[2],
    ];
    row.extend(features.map(|v| v as f32));
}

fn spectral(colours: &[[f32; 3]], members: &[u32], row: &mut Vec<f32>) {
    let (mut sum, mut low, mut high) = ([0.0f64; 3], [f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for colour in members.iter().map(|&i| colours[i as usize]) {
        for a in 0..3 {
            sum[a] += f64::from(colour[a]);
            (low[a], high[a]) = (low[a].min(colour[a]), high[a].max(colour[a]));
        }
    }
    let n = members.len().max(1) as f64;
    let all: f64 = sum.iter().sum();
    row.extend(sum.map(|v| (v / n) as f32));
    row.extend(sum.map(|v| if all > 0.0 { (v / all) as f32 } else { 0.0 }));
    row.extend([0, 1, 2].map(|a| high[a] - low[a]));
}

fn height(heights: &[f32], members: &[u32]) -> [f32; 2] {
    let known = members.iter().map(|&i| heights[i as usize]).filter(|h| h.is_finite());
    let (n, sum, most) = known.fold((0u32, 0.0f64, f32::NAN), |(n, s, m), h| (n + 1, s + f64::from(h), m.max(h)));
    [if n > 0 { (sum / f64::from(n)) as f32 } else { f32::NAN }, most]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    fn box_corners() -> Points {
        let rows: Vec<[f64; 3]> =
            (0..8).map(|i| [f64::from(i & 1) * 4.0, f64::from(i >> 1 & 1) * 2.0, 7.0 + f64::from(i >> 2)]).collect();
        Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0)
    }

    fn whole(n: usize) -> Partition {
        Partition::from_labels(&vec![0; n]).unwrap()
    }

    #[test]
    fn the_corners_of_a_box_have_known_features() {
        // Variances 4, 1, 1/4: e = 16/21, 4/21, 1/21.
        let none = ObjectAttributes::default();
        let table = object_features(&box_corners(), &whole(8), &none, &Monitor::default()).unwrap();
        let e = [16.0f64 / 21.0, 4.0 / 21.0, 1.0 / 21.0];
        let entropy: f64 = e.iter().map(|v| -v * v.ln()).sum();
        let expected =
            [0.75, 3.0 / 16.0, 1.0 / 16.0, e[2], (e[0] * e[1] * e[2]).cbrt(), 15.0 / 16.0, entropy, 7.5, 0.25];
        assert_eq!(table.names, Group::SegmentShape.names().collect::<Vec<_>>());
        for (found, expected) in table.row(0).iter().zip(expected) {
            assert!((f64::from(*found) - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn colour_ratios_sum_to_one_and_ranges_are_largest_minus_smallest() {
        let colours: Vec<[f32; 3]> = (0..8).map(|i| [i as f32 / 8.0, 0.5, 0.25]).collect();
        let attributes = ObjectAttributes { colours: Some(&colours), heights: None };
        let table = object_features(&box_corners(), &whole(8), &attributes, &Monitor::default()).unwrap();
        assert_eq!(table.width(), 18);
        let row = &table.row(0)[9..];
        let expected = [0.4375, 0.5, 0.25, 0.4375 / 1.1875, 0.5 / 1.1875, 0.25 / 1.1875, 0.875, 0.0, 0.0];
        assert!(row.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6), "{row:?}");
        assert!((row[3..6].iter().sum::<f32>() - 1.0).abs() < 1e-6);
        let black = ObjectAttributes { colours: Some(&[[0.0; 3]; 8]), heights: None };
        let table = object_features(&box_corners(), &whole(8), &black, &Monitor::default()).unwrap();
        assert_eq!(table.row(0)[9..], [0.0; 9]);
    }

    #[test]
    fn heights_that_are_not_known_do_not_count() {
        let heights = [1.0, f32::NAN, 3.0, f32::NAN, 2.0, 2.0, 2.0, 2.0];
        let attributes = ObjectAttributes { colours: None, heights: Some(&heights) };
        let halves = Partition::from_labels(&[0, 1, 0, 1, 2, 2, 2, 2]).unwrap();
        let table = object_features(&box_corners(), &halves, &attributes, &Monitor::default()).unwrap();
        assert_eq!((table.rows(), table.names[9..].to_vec()), (3, Group::SegmentHeight.names().collect()));
        assert_eq!(table.row(0)[9..], [2.0, 3.0]);
        assert!(table.row(1)[9..].iter().all(|v| v.is_nan()));
        assert!(table.row(2)[0] >= 0.0 && table.row(2)[8] == 0.0);
    }

    #[test]
    fn single_points_have_features_and_wrong_lengths_are_refused() {
        let alone = Partition::from_labels(&[0, 1, 2, 3, 4, 5, 6, 7]).unwrap();
        let none = ObjectAttributes::default();
        let table = object_features(&box_corners(), &alone, &none, &Monitor::default()).unwrap();
        assert_eq!(table.row(7), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 8.0, 0.0]);
        assert!(object_features(&box_corners(), &whole(7), &none, &Monitor::default()).is_err());
        let short = ObjectAttributes { colours: None, heights: Some(&[1.0]) };
        assert!(object_features(&box_corners(), &whole(8), &short, &Monitor::default()).is_err());
    }
}
