//! Squares that divide clouds in plan, coloured like a checkerboard.

use crate::cloud::MetricCloud;

/// A checkerboard on a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::recipes) struct Checkerboard {
    /// Edge of a square, metres.
    pub(in crate::recipes) square: f64,
    /// Metres per unit of the cloud.
    pub(in crate::recipes) metres: f64,
}

impl Checkerboard {
    /// Squares of this edge, or of a quarter of the longer side of the cloud.
    pub(in crate::recipes) fn of_cloud(scene: &MetricCloud<'_>, square: Option<f64>) -> Self {
        let side = |[low, high]: [[f64; 3]; 2]| (high[0] - low[0]).max(high[1] - low[1]) * scene.metres;
        let quarter = scene.strays.bounds.map_or(0.0, side) / 4.0;
        Self { square: square.unwrap_or(if quarter > 0.0 { quarter } else { 1.0 }), metres: scene.metres }
    }

    /// The place of a point, in squares.
    pub(in crate::recipes) fn place(&self, xyz: [f64; 3]) -> [f64; 2] {
        [xyz[0], xyz[1]].map(|v| v * self.metres / self.square)
    }

    /// The square that a point is in.
    pub(in crate::recipes) fn of(&self, xyz: [f64; 3]) -> [i64; 2] {
        self.place(xyz).map(|v| v.floor() as i64)
    }

    /// The colour of the square that a point is in, 0 or 1.
    pub(in crate::recipes) fn colour(&self, xyz: [f64; 3]) -> usize {
        let [x, y] = self.of(xyz);
        (x.wrapping_add(y) & 1) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::parallel::Monitor;

    #[test]
    fn squares_alternate_and_are_a_quarter_of_the_longer_side() {
        let board = Checkerboard { square: 10.0, metres: 1.0 };
        let at = [[5.0, 5.0, 0.0], [15.0, 5.0, 9.0], [15.0, 15.0, 0.0], [-5.0, 5.0, 0.0]];
        assert_eq!(at.map(|xyz| board.colour(xyz)), [0, 1, 0, 1]);
        let cloud = Cloud::from_rows(&[[0.0, 0.0, 0.0], [100.0, 40.0, 3.0]]).unwrap();
        let scene = MetricCloud::new(&cloud, Some(0.5), &Monitor::default()).unwrap();
        assert_eq!(Checkerboard::of_cloud(&scene, None), Checkerboard { square: 12.5, metres: 0.5 });
        assert_eq!(Checkerboard::of_cloud(&scene, Some(3.0)).square, 3.0);
    }
}
