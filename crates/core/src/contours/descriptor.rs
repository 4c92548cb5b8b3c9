//! The cumulative shape context of contour candidates.
//!
//! T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich, 2018, section 4.5.2.

use super::likely::Likely;
use super::linking::Candidate;
use super::params::DescriptorParams;
use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::neighbours::Shape;
use crate::neighbours::stacks::Stacks;
use crate::neighbours::sums::{Around, Weighted};
use crate::parallel::{Monitor, map_ordered, map_watched};
use pulp::{Arch, Simd, WithSimd};

/// Number of values of a candidate.
pub const VALUES: usize = 29;

/// Number of bins of each histogram, and of sections.
const BINS: usize = 5;

/// Candidates that one task describes.
const BLOCK: usize = 64;

/// Names of the values, in their order.
pub const VALUE_NAMES: [&str; VALUES] = [
    "chord_angle_0.0_0.2",
    "chord_angle_0.2_0.4",
    "chord_angle_0.4_0.6",
    "chord_angle_0.6_0.8",
    "chord_angle_0.8_1.0",
    "tangent_angle_0.0_0.2",
    "tangent_angle_0.2_0.4",
    "tangent_angle_0.4_0.6",
    "tangent_angle_0.6_0.8",
    "tangent_angle_0.8_1.0",
    "likelihood_0.0_0.2",
    "likelihood_0.2_0.4",
    "likelihood_0.4_0.6",
    "likelihood_0.6_0.8",
    "likelihood_0.8_1.0",
    "section_likelihood_1",
    "section_likelihood_2",
    "section_likelihood_3",
    "section_likelihood_4",
    "section_likelihood_5",
    "straightness",
    "length",
    "longest_step",
    "along_tangent",
    "least_likelihood",
    "cost",
    "second_spread",
    "third_spread",
    "crowd",
];

/// Radius of the surroundings of a node, metres.
const AROUND: f64 = 0.25;

/// Sum of the likelihoods of a straight row of sure nodes within the surroundings of one, 0.025 m apart.
const ROW: f64 = 20.0;

/// The values of each candidate, [`VALUES`] a row, named by [`VALUE_NAMES`].
///
/// Values 0 to 4 are the histogram of |cos| between the directions from every node of the path to every other one and
/// the direction from start to end (equation 4.5), values 5 to 9 that of |cos| between these directions and the tangent
/// at their first node (equation 4.6), values 10 to 14 that of the nodes' likelihoods; bins are of width 0.2, and 1
/// lies in the last. Values 15 to 19 are mean likelihoods of five sections of the path whose numbers of nodes differ by
/// at most one; a path of fewer than five nodes repeats them. Histograms have the sum 1 unless counts are asked for:
/// then the first ten values do not depend on position, rotation, and size. Nodes at one position, and without a
/// tangent, give nothing to the first, and the second histogram.
///
/// Beyond the source: values 20 to 25 are the distance of the ends by the length of the path, this length in metres, the longest
/// step, the mean |cos| between the tangents and the steps from them, the least likelihood of a node, and the cost by the length.
/// The last three are means over the nodes of what is within 0.25 m: the second and third eigenvalue of the scatter of likelihood
/// by the first, large where likely nodes fill a surface or a volume, and the likelihood in all, 1 for a single line. O(n²) for a
/// path of n nodes.
///
/// # Errors
/// If a path is empty or has a node that does not exist, likelihoods or tangents do not fit the nodes, or the work was
/// cancelled.
pub fn describe(
    nodes: &Likely,
    candidates: &[Candidate],
    params: &DescriptorParams,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    nodes.check(monitor)?;
    let around = surroundings(nodes, monitor)?;
    monitor.stage("descriptors", candidates.len() as u64);
    let rows = map_ordered(candidates.len().div_ceil(BLOCK), monitor, |block| {
        let range = block * BLOCK..candidates.len().min((block + 1) * BLOCK);
        let mut rows = Vec::with_capacity(range.len() * VALUES);
        for candidate in &candidates[range] {
            monitor.check()?;
            let path = Path::new(nodes, &candidate.path)?;
            let mut values = path.values(params);
            if !params.without_shape {
                values[4 * BINS..].copy_from_slice(&path.whole(candidate, &around));
            }
            rows.extend(values);
        }
        monitor.advance(BLOCK as u64);
        Ok(rows)
    })?;
    Ok(rows.concat())
}

/// What is near each node: eigenvalues 2 and 3 by 1, and the likelihood.
fn surroundings(nodes: &Likely, monitor: &Monitor) -> Result<Vec<[f32; 3]>> {
    let stacks = Stacks::new(&nodes.positions, AROUND, monitor)?;
    let weights = map_watched(nodes.len(), monitor, |at| nodes.likelihoods[stacks.index[at] as usize])?;
    let weighing = Weighted { weights: &weights };
    let around = Around { stacks: &stacks, radius: AROUND, shape: Shape::Sphere, weighing };
    let found = around.map(&stacks.positions, monitor, |_, near| {
        let [first, second, third] = near.values;
        let share = |value: f64| if first > 0.0 { (value / first) as f32 } else { 0.0 };
        [share(second), share(third), (near.weight / ROW) as f32]
    })?;
    stacks.restored(&found, monitor)
}

struct Path {
    places: Positions,
    /// Unit tangents, or zeros.
    tangents: Positions,
    likelihoods: Vec<f32>,
}

/// How many of some cosines there are, and how many are at least each border of two bins.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    all: u32,
    least: [u32; BINS - 1],
}

impl Tally {
    /// Squares of the borders of the bins.
    const BORDERS: [f32; BINS - 1] = [0.04, 0.16, 0.36, 0.64];

    /// Adds the angle of a unit vector with a vector, given their dot product and the latter's squared length.
    #[inline(always)]
    fn add(&mut self, dot: f32, squared: f32, counts: bool) {
        let counts = counts & (squared > 0.0);
        self.all += u32::from(counts);
        for (least, border) in self.least.iter_mut().zip(Self::BORDERS) {
            *least += u32::from(counts & (dot * dot >= border * squared));
        }
    }

    /// The numbers in the bins.
    fn histogram(&self) -> [u32; BINS] {
        let [a, b, c, d] = self.least;
        [self.all - a, a - b, b - c, c - d, d]
    }
}

/// [`Path::angles`], compiled for each instruction set.
struct Angles<'a>(&'a Path);

impl WithSimd for Angles<'_> {
    type Output = [[u32; BINS]; 2];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [[u32; BINS]; 2] {
        self.0.angles()
    }
}

impl Path {
    fn new(nodes: &Likely, path: &[u32]) -> Result<Self> {
        if path.is_empty() || path.iter().any(|&node| node as usize >= nodes.len()) {
            return Err(Error::input(format!("a path of {} nodes, not all below {}", path.len(), nodes.len())));
        }
        let at = |&node: &u32| node as usize;
        Ok(Self {
            places: path.iter().map(|node| nodes.positions.xyz(at(node))).collect(),
            tangents: path.iter().map(|node| unit(nodes.tangents[at(node)])).collect(),
            likelihoods: path.iter().map(|node| nodes.likelihoods[at(node)]).collect(),
        })
    }

    /// Histograms of the angles between the directions from node to node and the chord, and the tangents.
    #[inline(always)]
    fn angles(&self) -> [[u32; BINS]; 2] {
        let (n, Positions { x, y, z }, tangents) = (self.likelihoods.len(), &self.places, &self.tangents);
        let chord = unit(apart(self.places.xyz(0), self.places.xyz(n - 1)));
        let [mut with_chord, mut with_tangents] = [Tally::default(); 2];
        for i in 0..n {
            let ([px, py, pz], own) = (self.places.xyz(i), tangents.xyz(i));
            let has_own = dot(own, own) > 0.0;
            let rest = i + 1..n;
            let places = x[rest.clone()].iter().zip(&y[rest.clone()]).zip(&z[rest.clone()]);
            let others = tangents.x[rest.clone()].iter().zip(&tangents.y[rest.clone()]).zip(&tangents.z[rest]);
            for (((x, y), z), ((tx, ty), tz)) in places.zip(others) {
                let (way, other) = ([x - px, y - py, z - pz], [*tx, *ty, *tz]);
                let squared = dot(way, way);
                with_chord.add(dot(chord, way), squared, true);
                with_tangents.add(dot(own, way), squared, has_own);
                with_tangents.add(dot(other, way), squared, dot(other, other) > 0.0);
            }
        }
        // Both directions of a pair have the same angle with the chord.
        [with_chord.histogram().map(|count| 2 * count), with_tangents.histogram()]
    }

    fn values(&self, params: &DescriptorParams) -> [f32; VALUES] {
        let n = self.likelihoods.len();
        let [chord, tangents] = Arch::new().dispatch(Angles(self));
        let mut histograms = [chord, tangents, [0; BINS]];
        self.likelihoods.iter().for_each(|&p| histograms[2][bin(p)] += 1);
        let mut values = [0.0; VALUES];
        for (histogram, out) in histograms.iter().zip(values.chunks_exact_mut(BINS)) {
            let sum: u32 = histogram.iter().sum();
            let unit = if params.counts { 1.0 } else { sum.max(1) as f32 };
            out.iter_mut().zip(histogram).for_each(|(out, &count)| *out = count as f32 / unit);
        }
        for section in 0..BINS {
            let (first, end) = match n < BINS {
                // The node at the middle of the section.
                true => ((2 * section + 1) * n / (2 * BINS), (2 * section + 1) * n / (2 * BINS) + 1),
                false => (section * n / BINS, (section + 1) * n / BINS),
            };
            let part = &self.likelihoods[first..end];
            values[3 * BINS + section] = part.iter().sum::<f32>() / part.len() as f32;
        }
        if params.without_shape {
            values[..2 * BINS].fill(0.0);
        }
        values
    }

    /// The values that are not histograms or sections.
    fn whole(&self, candidate: &Candidate, around: &[[f32; 3]]) -> [f32; VALUES - 4 * BINS] {
        let n = self.likelihoods.len();
        let (mut length, mut longest, mut along) = (0.0f32, 0.0f32, 0.0f32);
        for i in 1..n {
            let way = apart(self.places.xyz(i - 1), self.places.xyz(i));
            let step = dot(way, way).sqrt();
            (length, longest) = (length + step, longest.max(step));
            along += dot(way, self.tangents.xyz(i - 1)).abs();
        }
        let chord = apart(self.places.xyz(0), self.places.xyz(n - 1));
        let by_length = |value: f32| if length > 0.0 { value / length } else { 0.0 };
        let least = self.likelihoods.iter().copied().fold(1.0, f32::min);
        let mean = |k: usize| candidate.path.iter().map(|&node| around[node as usize][k]).sum::<f32>() / n as f32;
        let straight = by_length(dot(chord, chord).sqrt());
        let cost = by_length(candidate.cost as f32);
        [straight, length, longest, by_length(along), least, cost, mean(0), mean(1), mean(2)]
    }
}

#[inline(always)]
fn apart(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [b[0] - a[0], b[1] - a[1], b[2] - a[2]]
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector with length 1, or zeros if it has no length.
#[inline(always)]
fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { [0.0; 3] }
}

/// The bin of a likelihood.
fn bin(value: f32) -> usize {
    ((value * BINS as f32) as usize).min(BINS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn values(rows: &[[f64; 3]], tangents: &[[f64; 3]], likelihoods: &[f32]) -> Vec<f32> {
        let rows: Vec<[f32; 3]> = rows.iter().map(|row| row.map(|v| v as f32)).collect();
        let nodes = Likely {
            positions: Positions::from_rows(&rows),
            likelihoods: likelihoods.to_vec(),
            tangents: tangents.iter().map(|row| row.map(|v| v as f32)).collect(),
        };
        let candidate = Candidate { path: (0..rows.len() as u32).collect(), ..Candidate::default() };
        describe(&nodes, &[candidate], &DescriptorParams::default(), &Monitor::default()).unwrap()
    }

    #[test]
    fn a_straight_path_has_all_mass_in_the_last_bins() {
        let rows: Vec<[f64; 3]> = (0..12).map(|i| [f64::from(i), f64::from(2 * i), f64::from(-i)]).collect();
        let found = values(&rows, &[[-1.0, -2.0, 1.0]; 12], &[0.95; 12]);
        assert_eq!(found[..15], [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        assert!(found[15..20].iter().all(|v| (v - 0.95).abs() < 1e-6));
        // With tangents across, the second histogram is in its first bin.
        let across = values(&rows, &[[2.0, -1.0, 0.0]; 12], &[0.95; 12]);
        assert_eq!(across[5..10], [1.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn similarities_leave_the_shape_as_it_is() {
        let mut random = stream(9, 0);
        let mut draw = || [0.0; 3].map(|_: f64| random.uniform() * 4.0 - 2.0);
        let (rows, tangents): (Vec<_>, Vec<_>) = (0..17).map(|_| (draw(), draw())).unzip();
        let before = values(&rows, &tangents, &[0.3; 17]);
        assert!(before[..10].iter().filter(|v| **v > 0.0).count() > 5);
        // A rotation by the quaternion (1, 2, 3, 4) / √30, a scale and a shift.
        let turn =
            [[-20.0, 4.0, 22.0], [20.0, -10.0, 20.0], [10.0, 28.0, 4.0]].map(|row: [f64; 3]| row.map(|v| v / 30.0));
        let turned = |v: &[f64; 3]| turn.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>());
        let moved: Vec<_> = rows.iter().map(|row| turned(row).map(|v| 3.5 * v + 10.0)).collect();
        let after = values(&moved, &tangents.iter().map(turned).collect::<Vec<_>>(), &[0.9; 17]);
        assert_eq!(before[..10], after[..10]);
        for histogram in before.chunks(5).take(3) {
            assert!((histogram.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn angles_and_surroundings_are_those_by_definition() {
        let mut random = stream(5, 1);
        let mut draw = |n: usize, by: f32| -> Vec<[f32; 3]> {
            (0..n).map(|_| [0.0; 3].map(|_: f32| (random.uniform() as f32 - 0.5) * by)).collect()
        };
        let (rows, tangents) = (draw(40, 0.6), draw(40, 1.0));
        let likelihoods: Vec<f32> = (0..40).map(|i| (i % 7) as f32 / 7.0).collect();
        let positions = Positions::from_rows(&rows);
        let nodes = Likely { positions, likelihoods: likelihoods.clone(), tangents: tangents.clone() };
        let path: Vec<u32> = (0..40).collect();
        let mut expected = [[0u32; BINS]; 2];
        let chord = unit(apart(rows[0], rows[39]));
        for (i, j) in (0..40).flat_map(|i| (0..40).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let way = unit(apart(rows[i], rows[j]));
            expected[0][bin(dot(chord, way).abs())] += 1;
            expected[1][bin(dot(unit(tangents[i]), way).abs())] += 1;
        }
        assert_eq!(Path::new(&nodes, &path).unwrap().angles(), expected);
        let found = surroundings(&nodes, &Monitor::default()).unwrap();
        for (i, found) in found.iter().enumerate() {
            let near = |j: &usize| dot(apart(rows[i], rows[*j]), apart(rows[i], rows[*j])) <= (AROUND * AROUND) as f32;
            let near: Vec<usize> = (0..40).filter(near).collect();
            let total: f32 = near.iter().map(|&j| likelihoods[j]).sum();
            assert!((f64::from(found[2]) - f64::from(total) / ROW).abs() < 1e-6);
            assert!(found[0] >= found[1] && found[0] <= 1.0);
        }
        let none = Likely { likelihoods: vec![0.0; 40], ..nodes };
        assert!(surroundings(&none, &Monitor::default()).unwrap().iter().all(|values| *values == [0.0; 3]));
    }

    #[test]
    fn likelihoods_fall_into_bins_and_sections() {
        let rows: Vec<[f64; 3]> = (0..7).map(|i| [f64::from(i), 0.0, 0.0]).collect();
        let found = values(&rows, &[[0.0; 3]; 7], &[0.1, 0.3, 0.5, 0.7, 0.9, 1.0, 0.0]);
        let sevenths = [2.0, 1.0, 1.0, 1.0, 2.0].map(|v: f32| v / 7.0);
        assert_eq!(found[10..15], sevenths);
        assert_eq!(found[15..20], [0.1, 0.3, 0.6, 0.9, 0.5]);
        assert_eq!(found[5..10], [0.0; 5]);
        let two = values(&rows[..2], &[[0.0; 3]; 2], &[0.25, 0.75]);
        assert_eq!(two[15..20], [0.25, 0.25, 0.75, 0.75, 0.75]);
    }

    #[test]
    fn coinciding_nodes_and_one_node_give_numbers_and_counts_are_counted() {
        for n in 1..4 {
            assert!(values(&vec![[1.0; 3]; n], &vec![[0.0; 3]; n], &vec![0.5; n]).iter().all(|v| v.is_finite()));
        }
        let nodes = Likely {
            positions: Positions::from_rows(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
            likelihoods: vec![0.9; 3],
            tangents: vec![[1.0, 0.0, 0.0]; 3],
        };
        let of = |path: &[u32]| {
            let candidate = Candidate { path: path.to_vec(), ..Candidate::default() };
            describe(
                &nodes,
                &[candidate],
                &DescriptorParams { counts: true, ..Default::default() },
                &Monitor::default(),
            )
        };
        let counts = of(&[0, 1, 2]).unwrap();
        assert_eq!([counts[4], counts[9], counts[14]], [6.0, 6.0, 3.0]);
        assert!(of(&[]).is_err() && of(&[3]).is_err());
    }
}
