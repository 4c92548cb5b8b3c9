//! The vertical profile of the cloud around a point: heights of the points in its cell of a grid in plan, and the surface
//! of highest points over the cells around.
//!
//! Aerial scans see facades, roof edges and thin layers of vegetation from above, where the nearest points in space tell
//! little; what stands above and below in the same cell, and how even the surface of highest points is, tells them apart.

mod cell;
mod surface;

use super::columns::{Columns, TableRows};
use super::definition::{Feature, Group, scaled_name};
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_each};
use crate::voxels::cells::{Cells, cell_of};
use cell::CellGrid;
use serde::{Deserialize, Serialize};

/// Edges of a cell beyond which no point has an influence: three more cells on each side.
const REACH: f64 = 4.0;

/// Parameters of the profiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ProfileParams {
    /// Edges of the cells in plan, metres; each above 0. Empty: no profiles.
    pub cells: Vec<f64>,
    /// Profiles are made of the means of points in voxels of this edge, metres, so that they depend less on the density;
    /// 0: of the points themselves. Cells should be multiples of it.
    pub voxel: f64,
}

impl Default for ProfileParams {
    fn default() -> Self {
        Self { cells: Vec::new(), voxel: 0.25 }
    }
}

impl ProfileParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(self.voxel >= 0.0 && self.voxel.is_finite()) {
            return Err(Error::parameter("profile.voxel", self.voxel, "metres, 0 or more"));
        }
        match self.cells.iter().find(|&&cell| !(1e-3..=1e4).contains(&cell)) {
            Some(cell) => Err(Error::parameter("profile.cells", cell, "0.001..10000 metres each")),
            None => Ok(()),
        }
    }

    /// Names of the features, cell by cell.
    pub fn names(&self) -> Vec<String> {
        self.offers().map(|(name, _)| name).collect()
    }

    /// Names and keys of the features, cell by cell.
    pub(super) fn offers(&self) -> impl Iterator<Item = (String, Feature)> + '_ {
        let of = |&cell: &f64| Group::Profile.definitions().map(move |d| (scaled_name(d, cell), d.feature));
        self.cells.iter().flat_map(of)
    }

    /// Distance in plan, metres, within which points have an influence.
    pub fn reach(&self) -> f64 {
        REACH * self.cells.iter().copied().fold(0.0, f64::max) + self.voxel
    }
}

/// The profiles of a cloud, or of a part of it with all points within [`ProfileParams::reach`].
#[derive(Clone, Debug, Default)]
pub struct Profiles {
    grids: Vec<CellGrid>,
    /// Half the edge of a voxel: points nearer than this are the point itself.
    own: f32,
}

impl Profiles {
    /// Number of features of a cell size.
    pub const FEATURES: usize = 24;

    /// Sorts the points, or their voxel means, into the cells of each size. O(n log n) a size; about 10 bytes a point and
    /// 60 bytes a cell while they exist. The same bytes for any number of threads.
    ///
    /// # Errors
    /// If a parameter is out of range or the work was cancelled.
    pub fn new(points: &Positions, params: &ProfileParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        if params.cells.is_empty() {
            return Ok(Self::default());
        }
        let means;
        let points = match params.voxel > 0.0 {
            true => {
                means = voxel_means(points, params.voxel, monitor)?;
                &means
            }
            false => points,
        };
        let grids = map_each(&params.cells, monitor, |&size| CellGrid::new(points, size, monitor))?;
        Ok(Self { grids, own: 0.5 * params.voxel as f32 })
    }

    /// The features of a point of the cloud, [`Profiles::FEATURES`] for each cell size, written to `out`; NaN in a cell
    /// without points.
    pub fn describe(&self, at: [f32; 3], out: &mut [f32]) {
        for (grid, out) in self.grids.iter().zip(out.chunks_exact_mut(Self::FEATURES)) {
            grid.profiles(&[at], self.own, |_, values| {
                out.copy_from_slice(&values.unwrap_or([f32::NAN; Self::FEATURES]));
            });
        }
    }

    /// Writes the selected features of points into their rows; `at` is the position of the point of a row.
    pub(super) fn write(&self, at: impl Fn(usize) -> [f32; 3], columns: &Columns, rows: TableRows<'_>) {
        let width = rows.width;
        rows.together(|places, rows| {
            let points: Vec<[f32; 3]> = places.map(&at).collect();
            for (layer, grid) in self.grids.iter().enumerate().filter(|(layer, _)| columns.any(*layer)) {
                grid.profiles(&points, self.own, |i, values| {
                    let row = &mut rows[i * width..][..width];
                    columns.write(layer, values.as_ref().map(|values| &values[..]), row);
                });
            }
        });
    }
}

/// Mean of the points in each voxel.
fn voxel_means(points: &Positions, voxel: f64, monitor: &Monitor) -> Result<Positions> {
    let key = |i: usize| cell_of(points.xyz(i).map(|v| f64::from(v) / voxel));
    let cells = Cells::new(points.len(), key, monitor)?;
    let mean = |c: usize| {
        let of = cells.of(c);
        let sum = of
            .iter()
            .map(|&i| points.xyz(i as usize))
            .fold([0.0f64; 3], |sum, p| [sum[0] + f64::from(p[0]), sum[1] + f64::from(p[1]), sum[2] + f64::from(p[2])]);
        sum.map(|v| (v / of.len() as f64) as f32)
    };
    Ok((0..cells.len()).map(mean).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn raw(cells: &[f64]) -> ProfileParams {
        ProfileParams { cells: cells.to_vec(), voxel: 0.0 }
    }

    fn of(points: &Positions, params: &ProfileParams, at: [f32; 3]) -> Vec<f32> {
        let mut out = vec![0.0; Profiles::FEATURES * params.cells.len()];
        Profiles::new(points, params, &Monitor::default()).unwrap().describe(at, &mut out);
        out
    }

    fn value(row: &[f32], feature: Feature) -> f32 {
        row[Group::Profile.definitions().position(|d| d.feature == feature).unwrap()]
    }

    #[test]
    fn a_column_of_known_heights_has_the_values_of_the_definitions() {
        let heights = [0.0, 1.0, 4.0, 5.0, 10.0];
        let points: Positions = heights.iter().map(|&z| [0.5, 0.5, z]).collect();
        let row = of(&points, &raw(&[1.0]), [0.5, 0.5, 4.0]);
        let expect = [
            (Feature::ProfileRank, 0.5),
            (Feature::GapBelow, 3.0),
            (Feature::GapAbove, 1.0),
            (Feature::ProfileAbove, 6.0),
            (Feature::ProfileBelow, 4.0),
            (Feature::ProfileMedian, 0.0),
            (
                Feature::ProfileDeviation,
                (66.0f32 / 5.0).sqrt() - 0.0 + ((142.0f32 / 5.0 - 16.0).sqrt() - (66.0f32 / 5.0).sqrt()),
            ),
            (Feature::LargestGap, 5.0),
            (Feature::SurfaceAbove3, 6.0),
            (Feature::SurfaceBelow3, 4.0),
            (Feature::SurfaceRange5, 10.0),
            (Feature::SurfaceRoughness3, 0.0),
            (Feature::SurfaceCover5, 1.0 / 25.0),
        ];
        for (feature, wanted) in expect {
            assert!((value(&row, feature) - wanted).abs() < 1e-4, "{feature:?} {} {wanted}", value(&row, feature));
        }
        assert!(of(&points, &raw(&[1.0]), [1.5, 0.5, 4.0]).iter().all(|v| v.is_nan()));
    }

    #[test]
    fn a_tilted_plane_is_even_and_has_its_slope() {
        let points: Positions = (0..900)
            .map(|i| ((i % 30) as f32 + 0.5, (i / 30) as f32 + 0.5))
            .map(|(x, y)| [x, y, 0.3 * x - 0.4 * y])
            .collect();
        let row = of(&points, &raw(&[1.0]), points.xyz(15 * 30 + 15));
        for (feature, wanted) in [
            (Feature::SurfaceSlope3, 0.5),
            (Feature::SurfaceSlope5, 0.5),
            (Feature::SurfaceRoughness5, 0.0),
            (Feature::LeastRoughness3, 0.0),
            (Feature::SurfaceMean5, 0.0),
            (Feature::SurfaceRange3, 1.4),
            (Feature::SurfaceCover5, 1.0),
        ] {
            assert!((value(&row, feature) - wanted).abs() < 1e-3, "{feature:?} {}", value(&row, feature));
        }
    }

    /// A part with all points within reach gives what the whole gives.
    #[test]
    fn a_part_with_its_margin_has_the_bytes_of_the_whole() {
        let mut s = stream(4, 1);
        let points: Positions = (0..20_000)
            .map(|_| [s.uniform() * 80.0, s.uniform() * 60.0, s.uniform() * 6.0].map(|v| v as f32))
            .collect();
        let params = ProfileParams { cells: vec![0.5, 2.0], voxel: 0.25 };
        let reach = params.reach() as f32;
        let near =
            |p: &[f32; 3]| p[0] > 30.0 - reach && p[0] < 40.0 + reach && p[1] > 20.0 - reach && p[1] < 30.0 + reach;
        let part: Positions = points.iter().filter(near).collect();
        let monitor = Monitor::default();
        let (whole, part) =
            (Profiles::new(&points, &params, &monitor).unwrap(), Profiles::new(&part, &params, &monitor).unwrap());
        let (mut a, mut b) = (vec![0.0; 48], vec![0.0; 48]);
        let inside = points.iter().filter(|p| p[0] > 30.0 && p[0] < 40.0 && p[1] > 20.0 && p[1] < 30.0);
        for p in inside {
            whole.describe(p, &mut a);
            part.describe(p, &mut b);
            assert_eq!(a, b);
        }
    }

    #[test]
    fn parameters_out_of_range_are_named_and_names_carry_the_cell() {
        assert!(raw(&[0.0]).validate().unwrap_err().to_string().contains("profile.cells"));
        assert!(ProfileParams { voxel: f64::NAN, ..raw(&[]) }.validate().is_err());
        let names = raw(&[0.5, 2.0]).names();
        assert_eq!((names.len(), names[0].as_str(), names[24].as_str()), (48, "ProfileRank_r0p5", "ProfileRank_r2"));
        assert_eq!(Group::Profile.definitions().count(), Profiles::FEATURES);
    }
}
