//! The squares that divide training clouds: folds of the first stage, and squares without optional columns.

use super::FoldParams;
use crate::cloud::{Cloud, Column, MetricCloud, Values};
use crate::error::Result;
use crate::random::stream;
use crate::recipes::training::checkerboard::Checkerboard;

/// The squares of one cloud.
#[derive(Clone, Copy)]
pub(super) struct Squares<'a> {
    pub(super) params: &'a FoldParams,
    /// Metres per unit of the cloud.
    pub(super) metres: f64,
    /// Seed of the choice of squares without optional columns.
    pub(super) seed: u64,
}

impl Squares<'_> {
    pub(super) fn board(&self) -> Checkerboard {
        Checkerboard { square: self.params.square, metres: self.metres }
    }

    /// The colour of the checkerboard, 0 or 1.
    pub(super) fn fold(&self, xyz: [f64; 3]) -> usize {
        self.board().colour(xyz)
    }

    /// Whether the points of this square are described without optional columns.
    fn lacks(&self, xyz: [f64; 3]) -> bool {
        let [x, y] = self.board().of(xyz).map(|v| v as u64);
        let square = x.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
        stream(self.seed ^ 0x6d69_7373, square).uniform() < self.params.missing
    }

    /// The cloud without the values of these columns in some squares; `None` if it has none of them, or all stay.
    pub(super) fn with_missing(&self, scene: &MetricCloud<'_>, names: &[String]) -> Result<Option<Cloud>> {
        let cloud = scene.cloud;
        if self.params.missing <= 0.0 || !names.iter().any(|name| cloud.column(name).is_some()) {
            return Ok(None);
        }
        let lacks: Vec<bool> = (0..cloud.len()).map(|i| self.lacks(cloud.xyz(i))).collect();
        let mut changed = cloud.clone();
        for name in names {
            let Some(column) = cloud.column(name) else { continue };
            let value = |i: usize| if lacks[i] { f64::NAN } else { column.values.get(i) };
            let values = (0..cloud.len()).map(|i| value(i) as f32).collect();
            changed.set_column(Column::new(name.clone(), Values::F32(values)))?;
        }
        Ok(Some(changed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::Monitor;

    #[test]
    fn squares_alternate_and_about_the_share_lacks_its_columns() {
        let params = FoldParams { square: 10.0, missing: 0.25 };
        let squares = Squares { params: &params, metres: 1.0, seed: 3 };
        assert_eq!(
            [[5.0, 5.0, 0.0], [15.0, 5.0, 9.0], [15.0, 15.0, 0.0], [-5.0, 5.0, 0.0]].map(|p| squares.fold(p)),
            [0, 1, 0, 1]
        );
        let rows: Vec<[f64; 3]> =
            (0..10_000).map(|i| [f64::from(i % 100) * 10.0, f64::from(i / 100) * 10.0, 0.0]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        let names = ["ReturnNumber".to_string(), "Red".to_string()];
        cloud.set_column(Column::new("ReturnNumber", Values::U8(vec![1; 10_000]))).unwrap();
        let scene = MetricCloud::new(&cloud, None, &Monitor::default()).unwrap();
        let changed = squares.with_missing(&scene, &names).unwrap().unwrap();
        let values = &changed.column("ReturnNumber").unwrap().values;
        let missing = (0..10_000).filter(|&i| values.get(i).is_nan()).count();
        assert!((2300..2700).contains(&missing) && changed.column("Red").is_none(), "{missing}");
        let all = FoldParams { missing: 0.0, ..params };
        assert!(Squares { params: &all, ..squares }.with_missing(&scene, &names).unwrap().is_none());
    }
}
