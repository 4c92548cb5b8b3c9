//! Scenes for the tests of this folder.

use super::PointAttributes;
use crate::cloud::{Cloud, Points, Positions};
use crate::random::stream;

/// Points from rows, in local coordinates.
pub(super) fn points_of(rows: &[[f64; 3]]) -> Positions {
    Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0).positions
}

/// Points with all attributes that supervoxels use.
pub(super) struct TestScene {
    pub(super) points: Positions,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) colours: Vec<[f32; 3]>,
}

impl TestScene {
    pub(super) fn attributes(&self) -> PointAttributes<'_> {
        PointAttributes { normals: Some(&self.normals), colours: Some(&self.colours) }
    }
}

/// A floor of 12 m x 9 m and a wall of 12 m x 6 m on it, 25 points a square metre, with a step in colour at x = 6 m,
/// and three points high above.
pub(super) fn floor_and_wall() -> TestScene {
    let mut s = stream(11, 0);
    let (mut rows, mut normals, mut colours) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..2700 {
        rows.push([s.uniform() * 12.0, s.uniform() * 9.0, s.uniform() * 0.02]);
        normals.push([0.0, 0.0, 1.0]);
    }
    for _ in 0..1800 {
        rows.push([s.uniform() * 12.0, 9.0 + s.uniform() * 0.02, s.uniform() * 6.0]);
        normals.push([0.0, -1.0, 0.0]);
    }
    for i in 0..3 {
        rows.push([f64::from(i), 3.0, 40.0]);
        normals.push([1.0, 0.0, 0.0]);
    }
    for row in &rows {
        colours.push(if row[0] < 6.0 { [1.0, 0.2, 0.1] } else { [0.1, 0.6, 0.2] });
    }
    TestScene { points: points_of(&rows), normals, colours }
}
