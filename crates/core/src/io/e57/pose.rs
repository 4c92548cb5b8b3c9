//! The pose of a scan.

use super::guard::bad;
use crate::error::{Mismatch, Result};
use ::e57::Transform;
use std::path::Path;

/// A rotation and a translation: p -> R p + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    rows: [[f64; 3]; 3],
    shift: [f64; 3],
}

impl Pose {
    /// The pose in a file, if there is one. The quaternion is normalised.
    ///
    /// # Errors
    /// If a number is not finite, or the quaternion is zero.
    pub(super) fn new(path: &Path, pose: Option<&Transform>) -> Result<Option<Self>> {
        let Some(Transform { rotation: q, translation: t }) = pose else { return Ok(None) };
        let length = (q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z).sqrt();
        let shift = [t.x, t.y, t.z];
        if !(length.is_finite() && length > 1e-9 && shift.iter().all(|v| v.is_finite())) {
            return Err(bad(
                path,
                "pose",
                "XML".into(),
                Mismatch::new(format!("{q:?} {t:?}"), "finite numbers, a rotation that is not 0"),
            ));
        }
        let [w, x, y, z] = [q.w, q.x, q.y, q.z].map(|v| v / length);
        let rows = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        Ok(Some(Self { rows, shift }))
    }

    pub(super) fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|a| {
            let row = self.rows[a];
            row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + self.shift[a]
        })
    }
}
