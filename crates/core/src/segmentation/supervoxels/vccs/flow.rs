//! Growth of supervoxels over adjacent voxels.

use super::super::describe::dot;
use super::super::{NO_SUPERVOXEL, PointAttributes, VccsParams};
use super::mean::{Sum, Voxel, means};
use super::voxels::Voxels;
use crate::error::{Error, Result};
use crate::graph::UnionFind;
use crate::parallel::{Looks, Monitor, watched};
use rayon::prelude::*;

/// Voxels that one task updates.
const BLOCK: usize = 4096;
/// Centres whose sums are in memory at the same time, 104 bytes each.
const CENTRES: usize = 1 << 20;

/// The distance D: a factor for each of the three differences.
#[derive(Clone, Copy, Debug)]
pub(super) struct Metric {
    spatial: f32,
    colour: f32,
    normal: f32,
}

impl Metric {
    /// A missing attribute gets no weight.
    pub(super) fn new(params: &VccsParams, attributes: &PointAttributes<'_>) -> Self {
        let given = |there: bool, weight: f64| if there { weight as f32 } else { 0.0 };
        Self {
            spatial: (params.weights.spatial / params.size) as f32,
            colour: given(attributes.colours.is_some(), params.weights.colour),
            normal: given(attributes.normals.is_some(), params.weights.normal),
        }
    }

    #[inline(always)]
    fn between(&self, a: &Voxel, b: &Voxel) -> f32 {
        let far = |a: [f32; 3], b: [f32; 3]| {
            let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
            (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
        };
        self.normal * (1.0 - dot(a.normal, b.normal).abs())
            + self.colour * far(a.colour, b.colour)
            + self.spatial * far(a.place, b.place)
    }
}

/// The state of the growth.
pub(super) struct Flow<'a> {
    voxels: &'a Voxels,
    metric: Metric,
    centres: Vec<Voxel>,
    owners: Vec<u32>,
}

impl<'a> Flow<'a> {
    /// Initialises each supervoxel with the voxel of its seed.
    pub(super) fn new(voxels: &'a Voxels, metric: Metric, seeds: &[u32]) -> Self {
        let mut flow = Self { voxels, metric, centres: Vec::new(), owners: vec![NO_SUPERVOXEL; voxels.len()] };
        flow.restart(seeds);
        flow
    }

    /// Starts again from these seeds.
    pub(super) fn restart(&mut self, seeds: &[u32]) {
        self.owners.fill(NO_SUPERVOXEL);
        seeds.iter().zip(0..).for_each(|(&seed, s)| self.owners[seed as usize] = s);
        self.centres.clear();
        self.centres.extend(seeds.iter().map(|&s| self.voxels.voxels[s as usize]));
    }

    /// Supervoxel of each voxel, or none.
    pub(super) fn into_owners(self) -> Vec<u32> {
        self.owners
    }

    /// Runs at most this many steps, each followed by an update of the centres.
    pub(super) fn expand(&mut self, steps: usize, monitor: &Monitor) -> Result<()> {
        for _ in 0..steps {
            if !self.step(|_| true, monitor)? {
                break;
            }
            self.move_centres(monitor)?;
        }
        Ok(())
    }

    /// Updates the wanted voxels; false if nothing changed.
    fn step(&mut self, wanted: impl Fn(u32) -> bool + Sync, monitor: &Monitor) -> Result<bool> {
        let mut chosen = vec![NO_SUPERVOXEL; self.owners.len()];
        chosen.par_chunks_mut(BLOCK).enumerate().try_for_each(|(b, block)| {
            monitor.check()?;
            let choose = |v| if wanted(self.owners[v]) { self.choose(v) } else { self.owners[v] };
            block.iter_mut().zip(b * BLOCK..).for_each(|(slot, v)| *slot = choose(v));
            Ok::<(), Error>(())
        })?;
        let changed = chosen != self.owners;
        self.owners = chosen;
        Ok(changed)
    }

    /// The nearest of the supervoxels of a voxel and its neighbours, the smaller of equally near ones.
    #[inline(always)]
    fn choose(&self, v: usize) -> u32 {
        let own = self.owners[v];
        let (mut best, mut least, mut seen) = (own, None, own);
        for &u in self.voxels.near.group(v) {
            let other = self.owners[u as usize];
            if other == seen || other == own || other == NO_SUPERVOXEL {
                continue;
            }
            seen = other;
            let limit = *least.get_or_insert_with(|| self.distance(v, own));
            let d = self.distance(v, other);
            if d < limit || (d <= limit && other < best) {
                (best, least) = (other, Some(d));
            }
        }
        best
    }

    #[inline(always)]
    fn distance(&self, v: usize, owner: u32) -> f32 {
        let centre = self.centres.get(owner as usize);
        centre.map_or(f32::INFINITY, |centre| self.metric.between(&self.voxels.voxels[v], centre))
    }

    /// Moves each centre to the mean of its voxels; centres without voxels stay. Centres are handled in blocks, so that the
    /// sums are small compared with the voxels.
    fn move_centres(&mut self, monitor: &Monitor) -> Result<()> {
        for (centres, first) in self.centres.chunks_mut(CENTRES).zip((0..).step_by(CENTRES)) {
            let mut sums = vec![Sum::default(); centres.len()];
            for piece in watched(self.owners.len(), monitor) {
                let piece = piece?;
                for (voxel, &owner) in self.voxels.voxels[piece.clone()].iter().zip(&self.owners[piece]) {
                    if let Some(sum) = sums.get_mut((owner as usize).wrapping_sub(first)) {
                        sum.add(voxel);
                    }
                }
            }
            let blocks = centres.par_chunks_mut(BLOCK).zip(sums.par_chunks(BLOCK));
            blocks.for_each(|(centres, sums)| {
                let mut moved = vec![Voxel::default(); sums.len()];
                means(sums, &mut moved);
                let occupied = centres.iter_mut().zip(moved).zip(sums).filter(|(_, sum)| !sum.is_empty());
                occupied.for_each(|((centre, mean), _)| *centre = mean);
            });
        }
        Ok(())
    }

    /// For each supervoxel with voxels the one nearest to its mean, the first of equally near ones.
    pub(super) fn nearest_to_means(&self, monitor: &Monitor) -> Result<Vec<u32>> {
        let mut best = vec![(f32::INFINITY, NO_SUPERVOXEL); self.centres.len()];
        for piece in watched(self.owners.len(), monitor) {
            for v in piece? {
                let (voxel, owner) = (&self.voxels.voxels[v], self.owners[v]);
                let Some(centre) = self.centres.get(owner as usize) else { continue };
                let d: f32 = (0..3).map(|a| (voxel.place[a] - centre.place[a]).powi(2)).sum();
                let slot = &mut best[owner as usize];
                if d < slot.0 {
                    *slot = (d, v as u32);
                }
            }
        }
        Ok(best.into_iter().map(|(_, v)| v).filter(|&v| v != NO_SUPERVOXEL).collect())
    }

    /// The connected component of its supervoxel that each voxel belongs to, named by the component's first voxel.
    fn pieces(&self, monitor: &Monitor) -> Result<Vec<u32>> {
        let owners = &self.owners;
        let mut sets = UnionFind::new(owners.len());
        for piece in watched(owners.len(), monitor) {
            for v in piece?.filter(|&v| owners[v] != NO_SUPERVOXEL) {
                let near = self.voxels.near.group(v).iter();
                let alike = near.filter(|u| (**u as usize) > v && owners[**u as usize] == owners[v]);
                alike.for_each(|&u| _ = sets.unite(v as u32, u));
            }
        }
        sets.roots(monitor)
    }

    /// Components that are separated from the largest component of their supervoxel (the first of equal ones) join an
    /// adjacent supervoxel, if there is one.
    pub(super) fn mend(&mut self, monitor: &Monitor) -> Result<()> {
        let pieces = self.pieces(monitor)?;
        // The size of a component is stored at its first voxel.
        let mut sizes = vec![0u32; pieces.len()];
        for piece in watched(pieces.len(), monitor) {
            pieces[piece?].iter().for_each(|&p| sizes[p as usize] += 1);
        }
        let mut looks = Looks::at(monitor);
        let mut largest = vec![NO_SUPERVOXEL; self.centres.len()];
        for (&piece, &owner) in pieces.iter().zip(&self.owners) {
            looks.step()?;
            if let Some(best) = largest.get_mut(owner as usize)
                && (*best == NO_SUPERVOXEL || sizes[piece as usize] > sizes[*best as usize])
            {
                *best = piece;
            }
        }
        for (owner, piece) in self.owners.iter_mut().zip(pieces) {
            looks.step()?;
            if largest.get(*owner as usize).is_some_and(|&best| best != piece) {
                *owner = NO_SUPERVOXEL;
            }
        }
        while self.step(|owner| owner == NO_SUPERVOXEL, monitor)? {}
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::points_of;
    use super::*;

    /// Two seeds at the ends of a row of 21 voxels.
    fn row(steps: usize) -> Vec<u32> {
        let rows: Vec<[f64; 3]> = (0..21).map(|i| [f64::from(i) + 0.5, 0.5, 0.5]).collect();
        let none = PointAttributes::default();
        let voxels = Voxels::new(&points_of(&rows), &none, 1.0, &Monitor::default()).unwrap();
        let metric = Metric::new(&VccsParams::default(), &none);
        let mut flow = Flow::new(&voxels, metric, &[0, 20]);
        flow.expand(steps, &Monitor::default()).unwrap();
        flow.into_owners()
    }

    #[test]
    fn a_supervoxel_grows_one_voxel_a_step() {
        for steps in 1..9 {
            let owners = row(steps);
            assert_eq!(owners.iter().filter(|o| **o == 0).count(), steps + 1);
            assert_eq!(owners.iter().filter(|o| **o == 1).count(), steps + 1);
        }
    }

    #[test]
    fn two_supervoxels_meet_in_the_middle() {
        let owners = row(50);
        assert!(owners[..10].iter().all(|&o| o == 0) && owners[11..].iter().all(|&o| o == 1));
    }

    #[test]
    fn a_part_that_is_cut_off_joins_its_neighbour() {
        let rows: Vec<[f64; 3]> = (0..9).map(|i| [f64::from(i) + 0.5, 0.5, 0.5]).collect();
        let none = PointAttributes::default();
        let voxels = Voxels::new(&points_of(&rows), &none, 1.0, &Monitor::default()).unwrap();
        let mut flow = Flow::new(&voxels, Metric::new(&VccsParams::default(), &none), &[0, 4]);
        flow.owners = vec![0, 0, 0, 1, 1, 0, 0, NO_SUPERVOXEL, NO_SUPERVOXEL];
        flow.mend(&Monitor::default()).unwrap();
        assert_eq!(flow.into_owners(), [0, 0, 0, 1, 1, 1, 1, 1, 1]);
    }
}
