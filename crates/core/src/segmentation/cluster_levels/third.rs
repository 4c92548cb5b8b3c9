//! Level 3: categories of the merged segments, by k-means on their descriptors.

use super::first::Object;
use super::k_means::{NumberRows, hartigan};
use super::params::ClusterParams;
use crate::error::Result;
use crate::linalg::arithmetic::Exact;
use crate::linalg::shape::Shape;
use crate::neighbours::stacks::Stacks;
use crate::parallel::{Looks, Monitor};

/// Descriptors without colour: height, size, three shares of eigenvalues, verticality, three lengths of sides.
const PLAIN: usize = 9;
/// Descriptors with colour.
const COLOURED: usize = PLAIN + 3;

/// Merged segments, and the points in them, in the order of the stacks.
pub(super) struct Merged<'a> {
    pub(super) stacks: &'a Stacks,
    /// Segment of each point; `None` for points without.
    pub(super) of: &'a dyn Fn(usize) -> Option<usize>,
    pub(super) objects: &'a [Object],
    /// Height of each point above the ground, in the order of the cloud, not finite where it is not known; else heights above
    /// the lowest point serve.
    pub(super) heights: Option<&'a [f32]>,
    /// Red, green, blue of each point, 0..=1, in the order of the cloud.
    pub(super) colours: Option<&'a [[f32; 3]]>,
}

/// Categories of segments.
#[derive(Clone, Debug, Default)]
pub(super) struct Third {
    /// Category of each segment, from 0 on by increasing mean height.
    pub(super) category: Vec<u32>,
    /// Mean height of each category, metres.
    pub(super) heights: Vec<f64>,
}

/// k-means by Hartigan's rule on standardised descriptors of the segments: mean height, log10 of the number of points,
/// linearity, planarity, sphericity, verticality, the lengths of the sides along the eigenvectors, and mean colour if there
/// is any. Heights that are not finite do not count; a segment without any has the mean of the others.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn third_level(merged: &Merged<'_>, params: &ClusterParams, monitor: &Monitor) -> Result<Third> {
    let width = if merged.colours.is_some() { COLOURED } else { PLAIN };
    let mut values = describe(merged, width, monitor)?;
    let heights: Vec<f64> = values.chunks_exact(width).map(|row| row[0]).collect();
    standardise(&mut values, width);
    let found = hartigan(NumberRows { values: &values, width }, &params.categories, params.seed, monitor)?;
    let count = found.centres.len() / width;
    let (mut sums, mut points) = (vec![0.0; count], vec![0.0; count]);
    for ((&c, height), object) in found.labels.iter().zip(&heights).zip(merged.objects) {
        sums[c as usize] += height * object.spread.count;
        points[c as usize] += object.spread.count;
    }
    let mean = |c: usize| if points[c] > 0.0 { sums[c] / points[c] } else { f64::INFINITY };
    let mut order: Vec<usize> = (0..count).filter(|&c| points[c] > 0.0).collect();
    order.sort_by(|&a, &b| mean(a).total_cmp(&mean(b)).then(a.cmp(&b)));
    let mut number = vec![0; count];
    order.iter().zip(0..).for_each(|(&c, n)| number[c] = n);
    let category = found.labels.iter().map(|&c| number[c as usize]).collect();
    Ok(Third { category, heights: order.into_iter().map(mean).collect() })
}

/// The descriptors, row after row.
fn describe(merged: &Merged<'_>, width: usize, monitor: &Monitor) -> Result<Vec<f64>> {
    let eigen: Vec<_> = merged.objects.iter().map(|object| object.spread.eigen()).collect();
    let lowest = merged.stacks.positions.z.iter().copied().fold(f32::INFINITY, f32::min);
    let mut sides = vec![[[f64::INFINITY, f64::NEG_INFINITY]; 3]; merged.objects.len()];
    let mut sums = vec![[0.0f64; 4]; merged.objects.len()];
    // Points of known height.
    let mut known = vec![0.0f64; merged.objects.len()];
    let mut looks = Looks::at(monitor);
    for i in 0..merged.stacks.len() {
        looks.steps(8)?;
        let Some(o) = (merged.of)(i) else { continue };
        let point = merged.stacks.index[i] as usize;
        let height = merged.heights.map_or(merged.stacks.positions.z[i] - lowest, |heights| heights[point]);
        if height.is_finite() {
            sums[o][0] += f64::from(height);
            known[o] += 1.0;
        }
        if let Some(colours) = merged.colours {
            (0..3).for_each(|c| sums[o][1 + c] += f64::from(colours[point][c]));
        }
        let (at, mean) = (merged.stacks.positions.xyz(i).map(f64::from), merged.objects[o].spread.mean);
        for (side, axis) in sides[o].iter_mut().zip(&eigen[o].vectors) {
            let along: f64 = (0..3).map(|a| (at[a] - mean[a]) * axis[a]).sum();
            *side = [side[0].min(along), side[1].max(along)];
        }
    }
    let heights = mean_heights(&sums, &known);
    let mut values = Vec::with_capacity(merged.objects.len() * width);
    for (o, object) in merged.objects.iter().enumerate() {
        let count = object.spread.count.max(1.0);
        let shape = Shape::of::<Exact>(eigen[o].values);
        let upright = 1.0 - eigen[o].vectors[2][2].abs();
        values.extend([heights[o], count.log10()]);
        values.extend([shape.linearity, shape.planarity, shape.scattering, upright]);
        values.extend(sides[o].map(|[low, high]| if high > low { high - low } else { 0.0 }));
        values.extend((1..1 + width - PLAIN).map(|c| sums[o][c] / count));
    }
    Ok(values)
}

/// The mean of the known heights of each segment, whose sums come first; without any the mean of the other segments.
fn mean_heights(sums: &[[f64; 4]], known: &[f64]) -> Vec<f64> {
    let own = |o: usize| (known[o] > 0.0).then(|| sums[o][0] / known[o]);
    let means: Vec<Option<f64>> = (0..sums.len()).map(own).collect();
    let told: Vec<f64> = means.iter().flatten().copied().collect();
    let middle = told.iter().sum::<f64>() / told.len().max(1) as f64;
    means.into_iter().map(|mean| mean.unwrap_or(middle)).collect()
}

/// Columns of mean 0 and standard deviation 1; 0 where all values are equal.
fn standardise(values: &mut [f64], width: usize) {
    let rows = (values.len() / width).max(1) as f64;
    for column in 0..width {
        let of = |values: &[f64]| values.iter().skip(column).step_by(width).copied().collect::<Vec<f64>>();
        let own = of(values);
        let mean = own.iter().sum::<f64>() / rows;
        let deviation = (own.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / rows).sqrt();
        let scale = if deviation > f64::EPSILON * mean.abs() { 1.0 / deviation } else { 0.0 };
        values.iter_mut().skip(column).step_by(width).for_each(|v| *v = (*v - mean) * scale);
    }
}
