//! The iterations of cut pursuit: split the open segments, merge, compare the energy.

use super::super::links::{EdgeLinks, contract};
use super::super::merge::{GREEDY_LINKS, merge_further};
use super::super::refine::move_boundary_nodes;
use super::super::regions::{Objective, Regions, energy};
use super::bisect::Scratch;
use super::piece::{Segments, WholeProblem};
use super::{CutPursuit, CutPursuitParams};
use crate::error::Result;
use crate::parallel::{Looks, Monitor, map_ordered_with};
use crate::random::stream;
use crate::segmentation::Partition;

/// State between iterations.
pub(super) struct Pursuit<'a> {
    source: WholeProblem<'a>,
    params: &'a CutPursuitParams,
    monitor: &'a Monitor,
    partition: Partition,
    /// Segments that no cut splits any further.
    saturated: Vec<bool>,
    found: CutPursuit,
}

impl<'a> Pursuit<'a> {
    pub(super) fn new(
        objective: Objective<'a>,
        partition: Partition,
        params: &'a CutPursuitParams,
        monitor: &'a Monitor,
    ) -> Result<Self> {
        let energy = energy(objective, &partition, monitor)?;
        let found = CutPursuit {
            partition: partition.clone(),
            centroids: Vec::new(),
            energy,
            iterations: 0,
            converged: false,
            trace: vec![energy],
        };
        let saturated = vec![false; partition.len()];
        let source = WholeProblem { objective, incidence: objective.graph.incidence(monitor)? };
        Ok(Self { source, params, monitor, partition, saturated, found })
    }

    pub(super) fn run(mut self) -> Result<CutPursuit> {
        self.monitor.stage("cut pursuit", self.params.steps.max_iterations as u64);
        while self.found.iterations < self.params.steps.max_iterations {
            if !self.round()? {
                self.found.converged = true;
                break;
            }
            self.monitor.advance(1);
        }
        Ok(self.found)
    }

    /// One iteration; false if nothing was left to split or the energy fell too little.
    fn round(&mut self) -> Result<bool> {
        let splits = self.split_open_segments()?;
        if splits.iter().all(|(_, parts)| parts.is_none()) {
            return Ok(false);
        }
        self.divide(&splits)?;
        if self.params.steps.backward {
            self.merge()?;
        }
        if self.params.steps.moves {
            self.move_nodes()?;
        }
        let energy = energy(self.source.objective, &self.partition, self.monitor)?;
        let before = self.found.trace.last().copied().unwrap_or(energy);
        self.found.trace.push(energy);
        self.found.iterations += 1;
        if energy < self.found.energy {
            self.found.energy = energy;
            self.found.partition = self.partition.clone();
        }
        let gained = before - energy;
        let little = gained >= 0.0 && gained < self.params.steps.tolerance * before;
        Ok(!(little || self.saturated.iter().all(|s| *s)))
    }

    /// The parts of each open segment, in parallel.
    fn split_open_segments(&self) -> Result<Vec<(usize, Option<Vec<u32>>)>> {
        let mut position = vec![0u32; self.partition.nodes()];
        let mut looks = Looks::at(self.monitor);
        for members in self.partition.iter() {
            looks.steps(members.len())?;
            (0u32..).zip(members).for_each(|(at, &node)| position[node as usize] = at);
        }
        let open: Vec<usize> = (0..self.partition.len()).filter(|&s| !self.saturated[s]).collect();
        let segments = Segments { partition: &self.partition, position: &position };
        let round = (self.found.iterations as u64) << 32;
        map_ordered_with(0..open.len(), self.monitor, Scratch::default, |scratch, i| {
            let segment = open[i];
            scratch.piece.gather(&self.source, &segments, segment, self.monitor)?;
            let smallest = self.partition.members(segment).first().copied().unwrap_or_default();
            let mut random = stream(self.params.seed, round | u64::from(smallest));
            Ok((segment, scratch.split(self.params, &mut random, self.monitor)?))
        })
    }

    /// Turns the parts into segments; a segment that stayed whole is saturated.
    fn divide(&mut self, splits: &[(usize, Option<Vec<u32>>)]) -> Result<()> {
        let mut smallest = vec![0u32; self.partition.nodes()];
        let mut looks = Looks::at(self.monitor);
        for members in self.partition.iter() {
            looks.steps(members.len())?;
            members.iter().for_each(|&node| smallest[node as usize] = members[0]);
        }
        let mut closed = vec![false; self.partition.nodes()];
        for (segment, members) in self.partition.iter().enumerate() {
            closed[members[0] as usize] = self.saturated[segment];
        }
        for (segment, parts) in splits {
            let members = self.partition.members(*segment);
            looks.steps(members.len())?;
            match parts {
                None => closed[members[0] as usize] = true,
                Some(parts) => {
                    for (&node, &part) in members.iter().zip(parts) {
                        smallest[node as usize] = members[part as usize];
                    }
                }
            }
        }
        self.partition = Partition::from_labels_watched(&smallest, self.monitor)?;
        self.saturated = self.partition.iter().map(|members| closed[members[0] as usize]).collect();
        Ok(())
    }

    /// Merges segments while the energy falls; merged segments are open again.
    fn merge(&mut self) -> Result<()> {
        let Objective { signal, graph, strength } = self.source.objective;
        let links = contract(&EdgeLinks::weighted(graph, strength), self.partition.segments(), self.monitor)?;
        let regions = Regions::of_segments(signal, &self.partition, self.monitor)?;
        let became = merge_further(regions, links, GREEDY_LINKS, self.monitor)?.became;
        let joined = Partition::from_labels_watched(&became, self.monitor)?;
        self.saturated = joined.iter().map(|parts| parts.len() == 1 && self.saturated[parts[0] as usize]).collect();
        self.partition = self.partition.coarser(&joined, self.monitor)?;
        Ok(())
    }

    /// Moves boundary nodes; changed segments are open again.
    fn move_nodes(&mut self) -> Result<()> {
        let WholeProblem { objective, ref incidence } = self.source;
        let moved = move_boundary_nodes(objective, incidence, &self.partition, self.monitor)?;
        let before = |members: &[u32]| self.partition.segments()[members[0] as usize] as usize;
        let same = |members: &[u32]| self.partition.members(before(members)) == members;
        self.saturated = moved.iter().map(|members| self.saturated[before(members)] && same(members)).collect();
        self.partition = moved;
        Ok(())
    }
}
