//! A cloud's pyramid in parts: the fine levels are held for one part at a time, the coarse ones for the whole cloud.
//!
//! A part is a cube of voxels with a margin around it, extended to all heights. Voxels of all levels nest, so that
//! inside a part its levels equal those of the whole cloud. A point whose neighbours, or their neighbours, might lie
//! outside the margin is reported and computed again with a wider one. The features are therefore the same bytes as
//! those of [`Extractor::prepare`].

use super::{Extractor, Plan, Planned, Selection, Wanted};
use crate::cloud::{MetricCloud, Points, Positions};
use crate::error::Result;
use crate::features::params::FeatureSet;
use crate::features::profile::Profiles;
use crate::features::pyramid::region::{Margin, Region};
use crate::features::pyramid::sorted::Sorted;
use crate::parallel::Monitor;
use crate::voxels::{LevelLimits, build_levels, coarse_levels};
use std::ops::Range;
use std::sync::Arc;

/// Largest number of points of a part.
const PART: usize = 1 << 20;

/// The same if there are profiles: in a thin cloud each point has cells of its own, of some hundred bytes.
const PART_OF_PROFILES: usize = 1 << 18;

/// Levels with more than one in this many of the points are held in parts.
const COARSE_SHARE: usize = 8;

/// Width of the margin in voxels of the coarsest fine level, unless columns need more. Every voxel of the margin costs time,
/// and so do points that need more.
const MARGIN: u32 = 8;

/// A cloud's sorted points and coarse levels.
pub struct Tiles<'a> {
    plan: Plan<'a>,
    sorted: Sorted,
    fine: usize,
    coarse: Vec<Arc<crate::features::pyramid::Stage>>,
    parts: Vec<Range<usize>>,
}

impl<'a> Tiles<'a> {
    /// Sorts the points and builds the coarse levels.
    ///
    /// O(n log n) time; about 20 bytes a point while it exists, twice that during the construction.
    ///
    /// # Errors
    /// As [`Extractor::prepare`].
    pub fn prepare(scene: &MetricCloud<'a>, set: &FeatureSet, wanted: Wanted<'_>, monitor: &Monitor) -> Result<Self> {
        Self::planned(Planned::new(scene, set, wanted, monitor)?, monitor)
    }

    /// The same points for other features of the same set; they are not sorted again.
    ///
    /// # Errors
    /// As [`Tiles::prepare`].
    pub(crate) fn reselect(self, scene: &MetricCloud<'a>, wanted: Wanted<'_>, monitor: &Monitor) -> Result<Self> {
        let Self { plan, sorted, coarse, .. } = self;
        drop(coarse);
        let selection = Selection { set: &plan.set, first_scale: plan.first_scale, wanted };
        let plan = Plan::new(scene, selection, monitor)?;
        Self::planned(Planned { plan, sorted }, monitor)
    }

    fn planned(planned: Planned<'a>, monitor: &Monitor) -> Result<Self> {
        let most = if planned.plan.has_profiles() { PART_OF_PROFILES } else { PART };
        Self::with_parts(planned, most, monitor)
    }

    /// Parts of at most `most` points.
    fn with_parts(planned: Planned<'a>, most: usize, monitor: &Monitor) -> Result<Self> {
        let Planned { plan, sorted } = planned;
        let count = sorted.points.len();
        let most_points = if count <= most { usize::MAX } else { count / COARSE_SHARE };
        let limits = LevelLimits { levels: plan.levels(), most_points };
        let (fine, levels) = coarse_levels(&sorted.points.positions, &sorted.grid, limits, monitor)?;
        let coarse = plan.stages(fine, levels, None, monitor)?;
        let mut parts = Vec::new();
        Octants { sorted: &sorted, most }.divide(0..count, 63, &mut parts);
        Ok(Self { plan, sorted, fine, coarse, parts })
    }

    /// Total number of points.
    pub fn len(&self) -> usize {
        self.sorted.points.len()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.sorted.points.is_empty()
    }

    /// Edge of the finest voxel, metres.
    pub fn first_scale(&self) -> f64 {
        self.plan.first_scale
    }

    /// Names of the columns.
    pub fn names(&self) -> &[String] {
        self.plan.names()
    }

    /// Names of all features of the set.
    pub(crate) fn offered(&self) -> Vec<String> {
        self.plan.set.names(self.plan.first_scale)
    }

    /// Index in the cloud of each sorted point.
    pub(crate) fn indices(&self) -> &[u32] {
        &self.sorted.points.frame.index
    }

    /// The point in the middle of each voxel, in the sorted order. The voxels are those of the level of the pyramid whose
    /// edge, metres, is the nearest. O(n) time for all of them.
    pub(crate) fn middles(&self, edge: f64) -> impl Iterator<Item = Middle> {
        let Sorted { points, grid, .. } = &self.sorted;
        let level = (edge / grid.size).log2().round().clamp(0.0, 20.0) as u32;
        let code = move |i: usize| grid.code(points.positions.xyz(i)) >> (3 * level);
        let mut next = (!points.is_empty()).then(|| (0, code(0)));
        std::iter::from_fn(move || {
            let (first, here) = next?;
            next = (first + 1..points.len()).map(|i| (i, code(i))).find(|&(_, code)| code != here);
            let end = next.map_or(points.len(), |(i, _)| i);
            Some(Middle { place: middle_of(&points.positions, first..end) as u32, end: end as u32 })
        })
    }

    /// Calls `describe` with an extractor of each part's points for which `wanted` holds (by their index in the cloud), and
    /// again, with a wider margin, for the rows that it returns.
    ///
    /// # Errors
    /// Those of `describe`, or if the work was cancelled.
    pub(crate) fn each(
        &self,
        wanted: impl Fn(u32) -> bool,
        monitor: &Monitor,
        mut describe: impl FnMut(&Extractor<'_>) -> Result<Vec<usize>>,
    ) -> Result<()> {
        let index = self.indices();
        for (number, part) in self.parts.iter().enumerate() {
            let mut places: Vec<u32> = part.clone().filter(|&i| wanted(index[i])).map(|i| i as u32).collect();
            if places.is_empty() {
                continue;
            }
            let profiles = self.profiles(&places, monitor)?;
            for attempt in 0.. {
                if places.is_empty() {
                    break;
                }
                let mut loose = Vec::new();
                for near in self.near_each_other(&places, attempt) {
                    let bare = self.extractor(near, attempt, monitor)?;
                    let rows = describe(&Extractor { profiles: profiles.clone(), part: number, ..bare })?;
                    loose.extend(rows.into_iter().map(|row| near[row]));
                }
                places = loose;
            }
        }
        Ok(())
    }

    /// The points within `reach` metres in plan of the box around those at these places, in the sorted order.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(crate) fn around(&self, box_of: &Positions, reach: f64, monitor: &Monitor) -> Result<Points> {
        self.sorted.around(box_of, reach, monitor)
    }

    /// The profiles around the points at these places.
    fn profiles(&self, places: &[u32], monitor: &Monitor) -> Result<Arc<Profiles>> {
        if !self.plan.has_profiles() {
            return Ok(Arc::default());
        }
        let own = self.sorted.points.positions.select(places, monitor)?;
        let near = self.around(&own, self.plan.set.profile.reach(), monitor)?;
        self.plan.profiles(&near.positions, monitor)
    }

    /// The places of an attempt, in the same order, divided into those that share an extractor: those of the first attempt
    /// do; of the others, which are few, those that are not farther apart than the margin is wide.
    fn near_each_other<'p>(&self, places: &'p [u32], attempt: u32) -> Vec<&'p [u32]> {
        if attempt == 0 {
            return vec![places];
        }
        let Margin { level, voxels } = self.margin(attempt);
        let most = (self.sorted.grid.size * f64::from(1u32 << level) * f64::from(voxels)) as f32;
        let at = |place: u32| self.sorted.points.positions.xyz(place as usize);
        let mut groups = Vec::new();
        let mut rest = places;
        while let Some(&first) = rest.first() {
            let is_near = |&&place: &&u32| (0..2).all(|a| (at(place)[a] - at(first)[a]).abs() <= most);
            let (near, others) = rest.split_at(rest.iter().take_while(is_near).count());
            groups.push(near);
            rest = others;
        }
        groups
    }

    /// The margin of attempt number `attempt`, from 0: 4^attempt times as wide as the first.
    fn margin(&self, attempt: u32) -> Margin {
        let columns = (4.0 * self.plan.set.pyramid.column_radius).ceil() as u32;
        let voxels = MARGIN.max(columns).saturating_mul(4u32.saturating_pow(attempt));
        Margin { level: self.fine.saturating_sub(1), voxels }
    }

    /// Prepares the fine levels around the points at these positions (ascending); row r of its blocks belongs to
    /// `places[r]`.
    ///
    /// # Errors
    /// If the work was cancelled.
    fn extractor(&self, places: &[u32], attempt: u32, monitor: &Monitor) -> Result<Extractor<'_>> {
        let mut stages = Vec::new();
        if self.fine > 0 {
            let (region, held) = Region::around(&self.sorted, places, self.margin(attempt), monitor)?;
            let held = self.sorted.points.positions.select(&held, monitor)?;
            stages =
                self.plan.stages(0, build_levels(&held, &self.sorted.grid, self.fine, monitor)?, region, monitor)?;
        }
        stages.extend(self.coarse.iter().cloned());
        let queries = self.sorted.points.select(places, monitor)?;
        Ok(Extractor { plan: self.plan.clone(), stages, profiles: Arc::default(), queries, part: 0 })
    }
}

/// The point in the middle of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Middle {
    /// Its place in the sorted order.
    pub(crate) place: u32,
    /// The place after the last point of the voxel, which is that of the first point of the next voxel.
    pub(crate) end: u32,
}

/// The point of a range that is nearest to the mean of all of them; the first of several.
fn middle_of(positions: &Positions, range: Range<usize>) -> usize {
    if range.len() < 3 {
        return range.start;
    }
    let mut sum = [0.0f64; 3];
    for i in range.clone() {
        sum.iter_mut().zip(positions.xyz(i)).for_each(|(s, v)| *s += f64::from(v));
    }
    let mean = sum.map(|s| s / range.len() as f64);
    let distance = |i: usize| {
        let at = positions.xyz(i);
        (0..3).map(|a| (f64::from(at[a]) - mean[a]).powi(2)).sum::<f64>()
    };
    let first = (range.start, distance(range.start));
    range.map(|i| (i, distance(i))).fold(first, |best, other| if other.1 < best.1 { other } else { best }).0
}

/// The division of sorted points into octants of octants, until none has more than `most` points.
struct Octants<'a> {
    sorted: &'a Sorted,
    most: usize,
}

impl Octants<'_> {
    /// Splits a range of points by the three bits below `bits` of their codes.
    fn divide(&self, range: Range<usize>, bits: u32, parts: &mut Vec<Range<usize>>) {
        if range.is_empty() {
            return;
        }
        if range.len() <= self.most || bits == 0 {
            parts.push(range);
            return;
        }
        let Sorted { points, grid, .. } = self.sorted;
        let octant = |i: usize| grid.code(points.positions.xyz(i)) >> (bits - 3) & 7;
        let mut first = range.start;
        for o in 0..8 {
            let (mut low, mut high) = (first, range.end);
            while low < high {
                let middle = low + (high - low) / 2;
                if octant(middle) <= o { low = middle + 1 } else { high = middle }
            }
            self.divide(first..low, bits - 3, parts);
            first = low;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::random::stream;

    #[test]
    fn features_in_parts_have_the_bytes_of_the_whole() {
        let mut s = stream(12, 0);
        let mut rows: Vec<[f64; 3]> =
            (0..30_000).map(|_| [s.uniform() * 90.0, s.uniform() * 70.0, s.uniform() * 0.4]).collect();
        rows.extend((0..3000).map(|_| [20.0 + s.uniform() * 5.0, 30.0 + s.uniform() * 5.0, s.uniform() * 9.0]));
        // Far away from all others.
        rows.extend([[45.0, 20.0, 60.0], [200.0, 10.0, 0.0], [201.0, 10.0, 0.0]]);
        let cloud = Cloud::from_rows(&rows).unwrap();
        let mut set = FeatureSet::default();
        (set.pyramid.levels, set.pyramid.first_scale) = (Some(6), Some(0.1));
        set.profile.cells = vec![0.5, 2.0];
        let monitor = Monitor::default();
        let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
        let whole = Extractor::prepare(&scene, &set, Wanted::All, &monitor).unwrap();
        let width = whole.names().len();
        let mut wanted = vec![0.0f32; cloud.len() * width];
        let (mut scratch, mut block) = (crate::features::Scratch::default(), Vec::new());
        for b in 0..whole.blocks() {
            let points = whole.block(b, &mut scratch, &mut block).to_vec();
            assert!(scratch.loose().is_empty());
            points.iter().zip(block.chunks(width)).for_each(|(&p, row)| {
                wanted[p as usize * width..][..width].copy_from_slice(row);
            });
        }
        let planned = Planned::new(&scene, &set, Wanted::All, &monitor).unwrap();
        let tiles = Tiles::with_parts(planned, 2000, &monitor).unwrap();
        assert!(tiles.parts.len() > 16 && tiles.fine > 1 && tiles.fine < 6, "{} {}", tiles.parts.len(), tiles.fine);
        let (mut seen, mut again) = (0, 0);
        let describe = |extractor: &Extractor<'_>| {
            let mut loose = Vec::new();
            for b in 0..extractor.blocks() {
                let points = extractor.block(b, &mut scratch, &mut block).to_vec();
                for (r, (&p, row)) in points.iter().zip(block.chunks(width)).enumerate() {
                    match scratch.loose().contains(&(r as u32)) {
                        true => loose.push(b * Extractor::BLOCK + r),
                        false => {
                            assert_eq!(row, &wanted[p as usize * width..][..width], "point {p}");
                            seen += 1;
                        }
                    }
                }
            }
            again += loose.len();
            Ok(loose)
        };
        tiles.each(|point| point % 3 > 0, &monitor, describe).unwrap();
        assert!(seen == (0..cloud.len()).filter(|p| p % 3 > 0).count() && again > 0, "{seen} {again}");
    }

    #[test]
    fn places_of_a_further_attempt_share_an_extractor_only_if_they_are_near_each_other() {
        let mut s = stream(5, 3);
        let rows: Vec<[f64; 3]> = (0..9000).map(|_| [400.0, 300.0, 2.0].map(|edge| s.uniform() * edge)).collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        let mut set = FeatureSet::default();
        (set.pyramid.levels, set.pyramid.first_scale) = (Some(3), Some(0.5));
        let monitor = Monitor::default();
        let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
        let planned = Planned::new(&scene, &set, Wanted::All, &monitor).unwrap();
        let tiles = Tiles::with_parts(planned, 2000, &monitor).unwrap();
        let Margin { level, voxels } = tiles.margin(1);
        let width = 0.5 * f64::from(1u32 << level) * f64::from(voxels);
        assert!(tiles.fine > 0 && tiles.margin(0).voxels * 4 == voxels && width < 300.0, "{width}");
        let places: Vec<u32> = (0..9000).step_by(40).collect();
        assert_eq!(tiles.near_each_other(&places, 0), [&places[..]]);
        let groups = tiles.near_each_other(&places, 1);
        assert!(groups.len() > 1 && groups.concat() == places);
        for group in groups {
            let at = |i: usize| tiles.sorted.points.positions.xyz(group[i] as usize);
            let apart = |i: usize| (0..2).map(|a| (at(i)[a] - at(0)[a]).abs()).fold(0.0, f32::max);
            assert!((0..group.len()).all(|i| f64::from(apart(i)) <= width));
        }
    }

    #[test]
    fn the_point_in_the_middle_of_a_voxel_is_the_nearest_to_its_mean() {
        let mut s = stream(5, 0);
        let rows: Vec<[f64; 3]> = (0..3000).map(|_| [0; 3].map(|_| s.uniform() * 6.0)).collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        let mut set = FeatureSet::default();
        (set.pyramid.levels, set.pyramid.first_scale) = (Some(3), Some(0.25));
        let monitor = Monitor::default();
        let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
        let tiles = Tiles::prepare(&scene, &set, Wanted::All, &monitor).unwrap();
        let positions = &tiles.sorted.points.positions;
        for (edge, size) in [(0.25, 0.25f32), (0.9, 1.0), (0.01, 0.25)] {
            let voxel = |i: usize| positions.xyz(i).map(|v| (v / size) as u32);
            let middles = tiles.middles(edge);
            let (mut first, mut seen) = (0, std::collections::HashSet::new());
            for middle in middles {
                let own = voxel(first);
                assert!(seen.insert(own), "each voxel once");
                let all: Vec<usize> = (0..positions.len()).filter(|&i| voxel(i) == own).collect();
                assert_eq!(all, (first..middle.end as usize).collect::<Vec<_>>());
                let mean =
                    |a: usize| all.iter().map(|&i| f64::from(positions.xyz(i)[a])).sum::<f64>() / all.len() as f64;
                let mean = [mean(0), mean(1), mean(2)];
                let distance =
                    |i: usize| (0..3).map(|a| (f64::from(positions.xyz(i)[a]) - mean[a]).powi(2)).sum::<f64>();
                let least = all.iter().map(|&i| distance(i)).fold(f64::INFINITY, f64::min);
                assert!(distance(middle.place as usize) <= least + 1e-12);
                first = middle.end as usize;
            }
            assert_eq!(first, positions.len());
        }
    }
}
