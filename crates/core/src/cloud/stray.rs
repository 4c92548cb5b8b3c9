//! Stray points: a few points so far from all others that they cannot belong to the scene.
//!
//! A record of zeros in a cloud with national coordinates, or an echo kilometres away, would extend every grid and cost
//! all other points their precision in `f32`. Such points are ignored, like points that are not finite.

use super::{Bounds, Cloud, around};
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};

/// Number of sampled points from which the core of the scene is found.
const SAMPLES: usize = 4096;

/// Share of the sample that is left out at each end of an axis.
const TAIL: f64 = 0.05;

/// If more than this share of the points are far away, the cloud consists of scattered sites and none are stray.
const MOST: f64 = 0.01;

/// Number of points tested at a time.
const PIECE: usize = 1 << 16;

/// Smallest number of points for which stray points are searched.
const FEWEST: usize = 100;

/// Groups are found only for points within this many cells of the core.
const FARTHEST: f64 = 1e12;

/// Parameters of the search for stray points. The defaults are wide enough that no part of a scene is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrayParams {
    /// A point is stray only if its distance from the bounding box of all others exceeds this multiple of the box's
    /// diagonal; above 0. Infinity disables the search.
    pub distance: f64,
    /// ... and if its group has at most this share of the cloud's points (or three points); 0..=0.01.
    pub share: f64,
}

impl Default for StrayParams {
    fn default() -> Self {
        Self { distance: 5.0, share: 0.001 }
    }
}

impl StrayParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        if self.distance.is_nan() || self.distance <= 0.0 {
            return Err(Error::parameter("distance", self.distance, "above 0"));
        }
        match (0.0..=MOST).contains(&self.share) {
            true => Ok(()),
            false => Err(Error::parameter("share", self.share, "0 to 0.01")),
        }
    }
}

/// The stray points of a cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Strays {
    /// Their indices in the cloud, ascending.
    pub index: Vec<u32>,
    /// Smallest and largest coordinates of all other finite points; `None` if there is none.
    pub bounds: Option<Bounds>,
}

impl Strays {
    /// Finds the stray points of a cloud.
    ///
    /// The middle nine tenths of a sample on each axis are the core of the scene. Points farther from its box than
    /// `distance` diagonals are candidates. They are sorted into cells as wide as that diagonal, and adjacent cells
    /// form a group. Small groups that are also that far from the bounding box of all remaining points are stray. Two
    /// sites far apart are two large groups, so that neither is stray. One pass over the points for a cloud without far
    /// points, two more otherwise.
    ///
    /// # Errors
    /// If a parameter is out of range, or the work was cancelled.
    pub fn find(cloud: &Cloud, params: &StrayParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        let Some(bounds) = cloud.bounds_watched(monitor)? else { return Ok(Self::default()) };
        let none = Self { index: Vec::new(), bounds: Some(bounds) };
        let Some(core) = core(cloud) else { return Ok(none) };
        let reach = params.distance * diagonal(&core);
        // NaN fails too: no core, or a core without extent.
        if !(reach > 0.0 && reach.is_finite() && corner_away(&bounds, &core) > reach) {
            return Ok(none);
        }
        let is_far = |i: u32| finite(cloud.xyz(i as usize)).is_some_and(|at| away(at, &core) > reach);
        let far = map_ordered(cloud.len().div_ceil(PIECE), monitor, |piece| {
            let points = piece * PIECE..((piece + 1) * PIECE).min(cloud.len());
            Ok(points.map(|i| i as u32).filter(|&i| is_far(i)).collect::<Vec<_>>())
        })?;
        let far = far.concat();
        let few = ((params.share * cloud.len() as f64) as usize).max(3);
        let small = small_groups(cloud, &far, &core, few);
        if small.is_empty() || small.len() as f64 > (MOST * cloud.len() as f64).max(3.0) {
            return Ok(none);
        }
        let body = bounds_without(cloud, &small);
        let reach = params.distance * body.as_ref().map_or(f64::NAN, diagonal);
        let stray = |i: &u32| body.as_ref().is_some_and(|body| away(cloud.xyz(*i as usize), body) > reach);
        let index: Vec<u32> = small.into_iter().filter(stray).collect();
        let bounds = bounds_without(cloud, &index);
        Ok(Self { index, bounds })
    }

    /// A warning for the user; `None` if there are none.
    pub fn warning(&self, cloud: &Cloud) -> Option<String> {
        let first = *self.index.first()?;
        let [x, y, z] = cloud.xyz(first as usize);
        let (count, lie) = match self.index.len() {
            1 => ("1 point".to_string(), "lies"),
            n => (format!("{n} points"), "lie"),
        };
        Some(format!("{count} {lie} far from all others (the first is number {first} at {x}, {y}, {z})"))
    }
}

fn finite(at: [f64; 3]) -> Option<[f64; 3]> {
    at.iter().all(|v| v.is_finite()).then_some(at)
}

/// The bounding box of the middle of a sample; `None` for a small cloud.
fn core(cloud: &Cloud) -> Option<Bounds> {
    let step = cloud.len().div_ceil(SAMPLES).max(1);
    let sample: Vec<[f64; 3]> = (0..cloud.len()).step_by(step).filter_map(|i| finite(cloud.xyz(i))).collect();
    if sample.len() < FEWEST {
        return None;
    }
    let tail = (TAIL * sample.len() as f64) as usize;
    let ends = [0, 1, 2].map(|a| {
        let mut axis: Vec<f64> = sample.iter().map(|p| p[a]).collect();
        axis.sort_unstable_by(f64::total_cmp);
        [axis[tail], axis[axis.len() - 1 - tail]]
    });
    Some([ends.map(|e| e[0]), ends.map(|e| e[1])])
}

fn diagonal([low, high]: &Bounds) -> f64 {
    (0..3).map(|a| (high[a] - low[a]).powi(2)).sum::<f64>().sqrt()
}

/// Distance of a position from a box.
fn away(at: [f64; 3], [low, high]: &Bounds) -> f64 {
    (0..3).map(|a| (low[a] - at[a]).max(at[a] - high[a]).max(0.0).powi(2)).sum::<f64>().sqrt()
}

/// The largest distance of a corner of `outer` from `inner`.
fn corner_away(outer: &Bounds, inner: &Bounds) -> f64 {
    (0..3).map(|a| (inner[0][a] - outer[0][a]).max(outer[1][a] - inner[1][a]).max(0.0).powi(2)).sum::<f64>().sqrt()
}

/// The points, ascending, whose group has at most `few` points.
fn small_groups(cloud: &Cloud, far: &[u32], core: &Bounds, few: usize) -> Vec<u32> {
    let size = diagonal(core);
    let cell = |i: u32| {
        let at = cloud.xyz(i as usize);
        [0, 1, 2].map(|a| ((at[a] - core[0][a]) / size).floor().clamp(-FARTHEST, FARTHEST) as i64)
    };
    let mut members: Vec<([i64; 3], u32)> = far.iter().map(|&i| (cell(i), i)).collect();
    members.sort_unstable();
    let cells: Vec<&[([i64; 3], u32)]> = members.chunk_by(|a, b| a.0 == b.0).collect();
    let mut seen = vec![false; cells.len()];
    let mut small = Vec::new();
    for start in 0..cells.len() {
        let mut group = Vec::new();
        let mut open = if std::mem::replace(&mut seen[start], true) { Vec::new() } else { vec![start] };
        while let Some(c) = open.pop() {
            group.push(c);
            for offset in (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]) {
                let near = [0, 1, 2].map(|a| cells[c][0].0[a] + offset[a]);
                match cells.binary_search_by_key(&near, |cell| cell[0].0) {
                    Ok(found) if !std::mem::replace(&mut seen[found], true) => open.push(found),
                    _ => {}
                }
            }
        }
        if group.iter().map(|&c| cells[c].len()).sum::<usize>() <= few {
            small.extend(group.iter().flat_map(|&c| cells[c]).map(|m| m.1));
        }
    }
    small.sort_unstable();
    small
}

/// The bounds of all finite points except these (ascending).
fn bounds_without(cloud: &Cloud, without: &[u32]) -> Option<Bounds> {
    let mut starts: Vec<usize> = without.iter().map(|&i| i as usize + 1).collect();
    starts.insert(0, 0);
    let ends = without.iter().map(|&i| i as usize).chain([cloud.len()]);
    let parts = starts.iter().zip(ends).filter_map(|(&start, end)| cloud.bounds_of(start..end));
    parts.reduce(around)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    /// A town block, 200 m wide, in national coordinates.
    fn town(points: usize) -> Vec<[f64; 3]> {
        let mut s = stream(7, 7);
        let mut place =
            || [500_000.0 + 200.0 * s.uniform(), 5_200_000.0 + 150.0 * s.uniform(), 400.0 + 20.0 * s.uniform()];
        (0..points).map(|_| place()).collect()
    }

    fn found(rows: &[[f64; 3]]) -> Vec<u32> {
        Strays::find(&Cloud::from_rows(rows).unwrap(), &StrayParams::default(), &Monitor::default()).unwrap().index
    }

    #[test]
    fn a_clean_cloud_has_none() {
        assert!(found(&town(3000)).is_empty());
        // A bird, a pit, a chimney and one point that is not finite.
        let mut rows = town(3000);
        rows.extend([
            [500_100.0, 5_200_050.0, 900.0],
            [500_090.0, 5_200_050.0, 100.0],
            [500_300.0, 5_200_050.0, 480.0],
        ]);
        rows.push([f64::NAN, 0.0, 0.0]);
        assert!(found(&rows).is_empty());
        assert!(found(&[]).is_empty() && found(&vec![[1.0, 2.0, 3.0]; 500]).is_empty());
    }

    #[test]
    fn points_far_away_are_found_and_do_not_stretch_the_bounds() {
        let clean = town(3000);
        let bounds = Cloud::from_rows(&clean).unwrap().bounds();
        for strays in [
            vec![[0.0; 3]],
            vec![[0.0; 3], [0.0; 3]],
            vec![[0.0; 3], [500_000.0, 5_210_000.0, 400.0]],
            vec![[500_100.0, 5_200_100.0, -9999.0], [1e12, -1e12, 0.0], [1e300, 0.0, 0.0]],
        ] {
            let mut rows = clean.clone();
            strays.iter().zip([1500, 0, 77]).for_each(|(&stray, at)| rows.insert(at, stray));
            rows.push([f64::INFINITY, 0.0, 0.0]);
            let cloud = Cloud::from_rows(&rows).unwrap();
            let found = Strays::find(&cloud, &StrayParams::default(), &Monitor::default()).unwrap();
            let expected: Vec<u32> = (0..rows.len() as u32).filter(|&i| strays.contains(&rows[i as usize])).collect();
            assert_eq!(found.index, expected, "{strays:?}");
            assert_eq!(found.bounds, bounds);
            assert!(found.warning(&cloud).unwrap().starts_with(&format!("{} point", strays.len())));
        }
    }

    #[test]
    fn two_sites_and_scattered_places_are_no_strays() {
        let mut rows = town(3000);
        rows.extend(town(1000).iter().map(|p| [p[0] + 50_000.0, p[1], p[2]]));
        assert!(found(&rows).is_empty());
        // A site with a hundredth of the points.
        rows.extend(town(40).iter().map(|p| [p[0] - 90_000.0, p[1], p[2]]));
        assert!(found(&rows).is_empty());
        rows.push([0.0; 3]);
        assert_eq!(found(&rows), [4040]);
        let mut scattered = town(3000);
        scattered.extend((0..60).map(|i| [f64::from(i) * 1e6, -1e7, 0.0]));
        assert!(found(&scattered).is_empty());
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let cloud = Cloud::from_rows(&town(200)).unwrap();
        for (bad, name) in [
            (StrayParams { distance: 0.0, ..Default::default() }, "distance"),
            (StrayParams { share: 0.5, ..Default::default() }, "share"),
        ] {
            assert!(Strays::find(&cloud, &bad, &Monitor::default()).unwrap_err().to_string().contains(name));
        }
    }
}
