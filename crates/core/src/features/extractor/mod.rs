//! Feature extraction: the pyramid of a cloud, from which features of points are computed block by block.

pub(super) mod extras;
pub(super) mod spacing;
pub(super) mod stream;
pub(super) mod tiles;

use super::columns::{Columns, TableRows};
use super::params::{FeatureSet, Place};
use super::profile::Profiles;
use super::pyramid::region::Region;
use super::pyramid::slots::Slots;
use super::pyramid::sorted::Sorted;
use super::pyramid::{Job, Part, Stage};
use crate::cloud::{MetricCloud, Points, Positions};
use crate::error::{Error, Result, nearest_names};
use crate::parallel::Monitor;
use crate::voxels::cells::index::block_of;
use crate::voxels::{Grid, Level, build_levels, sorted};
use extras::{PointSource, dimensions, sources};
use spacing::{scale_of, spacing};
use std::sync::Arc;

pub use super::pyramid::Scratch;

/// Selection of features.
#[derive(Clone, Copy, Debug)]
pub enum Wanted<'a> {
    /// All features of the set, in its order.
    All,
    /// These, in this order; others, and intermediate results that only others need, are not computed.
    Names(&'a [String]),
    /// Those named here, with or without scale (`Planarity` selects `Planarity_r0p4` too), in the order of the set; all
    /// if the list is empty.
    Asked(&'a [String]),
}

impl Wanted<'_> {
    /// The selected names, from the names of all features.
    ///
    /// # Errors
    /// If a name matches no feature.
    pub fn names(&self, all: &[String]) -> Result<Vec<String>> {
        match self {
            Self::All => Ok(all.to_vec()),
            Self::Names(names) => Ok(names.to_vec()),
            Self::Asked(asked) => matching(all, asked),
        }
    }
}

/// The plan for a cloud, and its sorted points.
pub(super) struct Planned<'a> {
    pub(super) plan: Plan<'a>,
    pub(super) sorted: Sorted,
}

/// Plan of the computation: parameters, names, and the column of each feature.
#[derive(Clone)]
pub(super) struct Plan<'a> {
    pub(super) set: FeatureSet,
    first_scale: f64,
    names: Vec<String>,
    /// Of each level, from the finest to the coarsest of which a feature is selected.
    slots: Vec<Slots>,
    /// Of the profiles, a layer for each size of cells.
    profile: Columns,
    own: Vec<(usize, PointSource<'a>)>,
}

impl<'a> Plan<'a> {
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The profiles, if any is selected, of points that include all within their reach.
    pub(super) fn profiles(&self, points: &Positions, monitor: &Monitor) -> Result<Arc<Profiles>> {
        match self.profile.is_empty() {
            true => Ok(Arc::default()),
            false => Profiles::new(points, &self.set.profile, monitor).map(Arc::new),
        }
    }

    /// Whether a profile is selected.
    pub(super) fn has_profiles(&self) -> bool {
        !self.profile.is_empty()
    }

    /// Prepares levels, from number `first` on, complete within `region` (or everywhere).
    pub(super) fn stages(
        &self,
        first: usize,
        levels: Vec<Level>,
        region: Option<Region>,
        monitor: &Monitor,
    ) -> Result<Vec<Arc<Stage>>> {
        let stage = |(level, slots): (Level, &Slots)| {
            monitor.check()?;
            Stage::new(Part { level, region }, slots.clone(), &self.set.pyramid, monitor).map(Arc::new)
        };
        levels.into_iter().zip(&self.slots[first..]).map(stage).collect()
    }
}

/// What a plan is made for.
pub(super) struct Selection<'a> {
    pub(super) set: &'a FeatureSet,
    /// Edge of the finest voxel, metres.
    pub(super) first_scale: f64,
    pub(super) wanted: Wanted<'a>,
}

impl<'a> Plan<'a> {
    /// The plan for the selected features of a set.
    pub(super) fn new(scene: &MetricCloud<'a>, selection: Selection<'_>, monitor: &Monitor) -> Result<Self> {
        let Selection { set, first_scale, wanted } = selection;
        let offers = set.offers(first_scale);
        let all: Vec<String> = offers.iter().map(|offer| offer.name.clone()).collect();
        let names = wanted.names(&all)?;
        let (sources, dimensions) = (sources(scene, set, monitor)?, dimensions(scene.cloud, set)?);
        let (mut slots, mut profile, mut own) =
            (vec![Slots::default(); set.pyramid.count(first_scale)], Columns::default(), Vec::new());
        for (offer, column) in offers.iter().zip(columns(&all, &names)?) {
            match (column, offer.place) {
                (Some(column), Place::Level(level, feature)) => slots[level].put(feature, column),
                (Some(column), Place::Profile(number)) => {
                    profile.put(number / Profiles::FEATURES, number % Profiles::FEATURES, column);
                }
                (Some(column), Place::Own(feature)) => {
                    let of = sources.iter().filter(|(own, _)| *own == feature);
                    own.extend(of.map(|(_, source)| (column, source.clone())));
                }
                (Some(column), Place::Dimension(number)) => own.push((column, dimensions[number].clone())),
                (None, _) => {}
            }
        }
        slots.truncate(slots.iter().rposition(|slots| !slots.is_empty()).map_or(0, |last| last + 1));
        Ok(Self { set: set.clone(), first_scale, names, slots, profile, own })
    }

    /// Number of levels of the pyramid up to the coarsest of which a feature is selected.
    pub(super) fn levels(&self) -> usize {
        self.slots.len()
    }
}

impl<'a> Planned<'a> {
    /// Makes the plan, and sorts the cloud's points.
    pub(super) fn new(
        scene: &MetricCloud<'a>,
        set: &FeatureSet,
        wanted: Wanted<'_>,
        monitor: &Monitor,
    ) -> Result<Self> {
        set.validate()?;
        let points = scene.points(monitor)?;
        let first_scale = match set.pyramid.first_scale {
            Some(scale) => scale,
            None => scale_of(spacing(&points, monitor)?),
        };
        let plan = Plan::new(scene, Selection { set, first_scale, wanted }, monitor)?;
        monitor.stage("pyramid", points.len() as u64);
        let grid = Grid::new(&points, first_scale)?;
        let points = sorted(points, &grid, monitor)?;
        Ok(Self { plan, sorted: Sorted::new(points, grid, monitor)? })
    }
}

/// The pyramid of a cloud and everything else that the selected features need.
///
/// Points are in Morton order, so that the points of a block are close together.
pub struct Extractor<'a> {
    plan: Plan<'a>,
    stages: Vec<Arc<Stage>>,
    profiles: Arc<Profiles>,
    queries: Points,
    part: usize,
}

impl<'a> Extractor<'a> {
    /// Points of a block (the last may be smaller): the rows of 144 features stay in the second-level cache.
    pub const BLOCK: usize = 1024;

    /// Builds the pyramid of all finite points, which then have features.
    ///
    /// O(n log n) time; up to 150 bytes a point while it exists. [`Tiles`](super::Tiles) need less.
    ///
    /// # Errors
    /// If a parameter is out of range, a feature name is unknown, the cloud lacks a required column, or voxels are too
    /// small for the extent.
    pub fn prepare(scene: &MetricCloud<'a>, set: &FeatureSet, wanted: Wanted<'_>, monitor: &Monitor) -> Result<Self> {
        let Planned { plan, sorted: Sorted { points, grid, .. } } = Planned::new(scene, set, wanted, monitor)?;
        let levels = build_levels(&points.positions, &grid, plan.levels(), monitor)?;
        let stages = plan.stages(0, levels, None, monitor)?;
        let profiles = plan.profiles(&points.positions, monitor)?;
        Ok(Self { plan, stages, profiles, queries: points, part: 0 })
    }

    /// Edge of the finest voxel, metres.
    pub fn first_scale(&self) -> f64 {
        self.plan.first_scale
    }

    /// Names of the columns.
    pub fn names(&self) -> &[String] {
        &self.plan.names
    }

    /// Number of points with features.
    pub fn len(&self) -> usize {
        self.queries.len()
    }

    /// True if there is no such point.
    pub fn is_empty(&self) -> bool {
        self.queries.is_empty()
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.queries.len().div_ceil(Self::BLOCK)
    }

    /// Computes the features of a block into `rows` (row-major, replaced); returns the cloud index of each row.
    ///
    /// May be called from many threads, each with its own scratch.
    pub fn block(&self, block: usize, scratch: &mut Scratch, rows: &mut Vec<f32>) -> &[u32] {
        let (range, width) = (block_of(block, Self::BLOCK, self.queries.len()), self.plan.names.len());
        // All values are written below.
        rows.resize(range.len() * width, 0.0);
        let mut job = Job { points: &self.queries.positions, range: range.clone(), width, out: rows };
        scratch.begin();
        for stage in &self.stages {
            stage.describe(&mut job, &self.plan.set.pyramid, scratch);
        }
        scratch.finish();
        let at = |row: usize| self.queries.positions.xyz(range.start + row);
        self.profiles.write(at, &self.plan.profile, TableRows { values: rows, width });
        let points = &self.queries.frame.index[range];
        for (slot, source) in &self.plan.own {
            rows.chunks_exact_mut(width).zip(points).for_each(|(row, &point)| row[*slot] = source.get(point));
        }
        points
    }

    /// Number of the part of the cloud; only the first extractor of a part has all of its points.
    pub(crate) fn part(&self) -> usize {
        self.part
    }

    /// The points with features, in their order.
    pub(crate) fn points(&self) -> &Points {
        &self.queries
    }
}

/// The selected names, with or without scale.
fn matching(all: &[String], asked: &[String]) -> Result<Vec<String>> {
    let matches = |name: &str, asked: &str| {
        let (start, rest) = name.split_at(name.floor_char_boundary(asked.len()));
        start.eq_ignore_ascii_case(asked) && (rest.is_empty() || rest.starts_with("_r"))
    };
    if let Some(unknown) = asked.iter().find(|a| !all.iter().any(|name| matches(name, a))) {
        return Err(unknown_feature(all, unknown));
    }
    let named = |name: &&String| asked.is_empty() || asked.iter().any(|a| matches(name, a));
    Ok(all.iter().filter(named).cloned().collect())
}

/// The error about an unknown name, with the three nearest ones, by edits.
fn unknown_feature(all: &[String], unknown: &str) -> Error {
    // A name without its scale stands for all scales: it is compared without theirs.
    let scaled = unknown.contains("_r");
    let plain = |name: &str| if scaled { name } else { name.split("_r").next().unwrap_or(name) }.to_string();
    let mut names: Vec<String> = all.iter().map(|name| plain(name)).collect();
    names.dedup();
    let near = nearest_names(names.iter().map(String::as_str), unknown);
    let expected = format!("one of {} features, e.g. {} (features --list has all)", all.len(), near.join(", "));
    Error::parameter("features", unknown, expected)
}

/// For each feature of the set its column among the selected names, if it is one of them.
fn columns(all: &[String], names: &[String]) -> Result<Vec<Option<usize>>> {
    let mut columns = vec![None; all.len()];
    for (column, name) in names.iter().enumerate() {
        match all.iter().position(|a| a == name) {
            Some(i) if columns[i].is_none() => columns[i] = Some(column),
            Some(_) => return Err(Error::parameter("features", name, "each feature once")),
            None => return Err(unknown_feature(all, name)),
        }
    }
    Ok(columns)
}
