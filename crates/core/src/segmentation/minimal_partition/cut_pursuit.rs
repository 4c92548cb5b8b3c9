//! ℓ0 cut pursuit: piecewise-constant approximation of values on a graph.
//!
//! L. Landrieu, G. Obozinski, *Cut pursuit: fast algorithms to learn piecewise constant functions on general weighted
//! graphs*, SIAM J. Imaging Sciences 10(4), 2017, section 3; as used by S. Guinard, L. Landrieu, ISPRS Archives
//! XLII-1/W1, 2017, section 3.1. Minimises Q = Σ m_i ‖f_i − x_c(i)‖² + ρ Σ w_ij [c(i) ≠ c(j)].
//!
//! | paper | here |
//! |---|---|
//! | f, m | rows and weights of [`Signal`] |
//! | ρ (no factor ½) | [`CutPursuitParams::strength`] |
//! | w | weights of the [`Graph`] |
//! | c | segments of the [`Partition`] |

mod bisect;
mod coarse;
mod iterate;
mod params;
mod piece;
mod smooth;
mod two_means;

pub use params::{CutPursuitParams, CutPursuitSteps, Preset};

use super::Signal;
use super::cutoff::absorb_small;
use super::merge::trivial_partition;
use super::regions::{Objective, Regions, energy};
use crate::error::Result;
use crate::graph::Graph;
use crate::parallel::Monitor;
use crate::segmentation::Partition;
use coarse::in_cycles;

/// Result of [`cut_pursuit`].
#[derive(Clone, Debug, PartialEq)]
pub struct CutPursuit {
    /// The segments of the iterate of least energy, after the cutoff.
    pub partition: Partition,
    /// Mean of each segment, `width` values each.
    pub centroids: Vec<f64>,
    /// Q of the partition: fit + strength · boundary. With a cutoff it may be above that of the last iterate.
    pub energy: f64,
    /// Iterations of splitting and merging over all cycles.
    pub iterations: usize,
    /// True if no segment could be split any more or Q fell by less than the tolerance.
    pub converged: bool,
    /// Q at the start and after every iteration; on a graph that was coarsened, after every cycle.
    pub trace: Vec<f64>,
}

/// Segments on which the signal is nearly constant, with short boundaries.
///
/// Every iteration splits each open segment in two by a minimum cut between two means, and then merges adjacent
/// segments, largest gain first, while Q falls. A split may raise Q temporarily, because the cut does not compare with
/// the undivided segment: the best partition found is returned, or `guard` forbids such splits. Then nodes move across
/// boundaries one by one while Q falls. Large graphs are cut on a coarser graph first.
///
/// # Returns
/// The partition, the mean of each segment, Q, and the course of the iterations. Strength 0 gives the connected sets of
/// equal values, an infinite strength the connected components (over edges of positive weight).
///
/// # Complexity
/// An iteration costs 2-means and `flow_steps` minimum cuts inside each open segment, and O(m log m) for merging; O(n ·
/// width + m) memory. Coarsening costs O(m log m) a cycle and leaves about a sixteenth of the nodes.
///
/// # Determinism
/// The random stream of a split depends on the seed, the segment's smallest node and the round: the same bytes for any
/// number of threads.
///
/// # Errors
/// If the signal has not a row for each node, a parameter is out of range, or the work was cancelled.
pub fn cut_pursuit(signal: &Signal, graph: &Graph, params: &CutPursuitParams, monitor: &Monitor) -> Result<CutPursuit> {
    params.validate()?;
    signal.fits(graph.len())?;
    let objective = Objective { signal, graph, strength: params.strength };
    let mut found = match trivial_partition(signal, graph, params.strength, monitor)? {
        Some(partition) => {
            let energy = energy(objective, &partition, monitor)?;
            CutPursuit { partition, centroids: vec![], energy, iterations: 0, converged: true, trace: vec![energy] }
        }
        None => in_cycles(signal, graph, params, monitor)?,
    };
    if params.cutoff > 0.0 {
        found.partition = absorb_small(objective, found.partition, params.cutoff, monitor)?;
        found.energy = energy(objective, &found.partition, monitor)?;
    }
    found.centroids = Regions::of_segments(signal, &found.partition, monitor)?.into_means();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Stream, stream};
    use crate::segmentation::{MergeParams, merge};

    const STRENGTH: f64 = 0.5;

    fn normal(random: &mut Stream) -> f64 {
        (-2.0 * (1.0 - random.uniform()).ln()).sqrt() * (std::f64::consts::TAU * random.uniform()).cos()
    }

    fn chain(nodes: u32) -> Graph {
        let pairs: Vec<[u32; 2]> = (1..nodes).map(|v| [v - 1, v]).collect();
        Graph::new(nodes as usize, &pairs, &vec![1.0; pairs.len()]).unwrap()
    }

    /// Constant stretches of two values, with noise.
    fn noisy_stretches(seed: u64, nodes: usize) -> Vec<f32> {
        let mut random = stream(seed, 1);
        let count = 2 + random.below(4);
        let ends = random.choose(nodes - 10, count);
        let means: Vec<[f64; 2]> = (0..=count).map(|_| [normal(&mut random), normal(&mut random)]).collect();
        (0..nodes)
            .flat_map(|v| means[ends.iter().filter(|e| **e as usize + 5 <= v).count()])
            .map(|mean| (mean + 0.25 * normal(&mut random)) as f32)
            .collect()
    }

    /// Least energy on a chain by dynamic programming over the place of the last boundary.
    fn chain_optimum(signal: &Signal, strength: f64) -> f64 {
        let mut best = vec![-strength];
        for end in 1..=signal.len() {
            let (mut sum, mut squares) = (vec![0.0; signal.width()], 0.0);
            let costs = (0..end).rev().map(|begin| {
                for (s, &f) in sum.iter_mut().zip(signal.row(begin)) {
                    *s += f64::from(f);
                    squares += f64::from(f).powi(2);
                }
                let explained = sum.iter().map(|s| s * s).sum::<f64>() / (end - begin) as f64;
                best[begin] + strength + squares - explained
            });
            let least = costs.fold(f64::INFINITY, f64::min);
            best.push(least);
        }
        best[signal.len()]
    }

    fn chain_ratios(params: &CutPursuitParams) -> Vec<f64> {
        (0..60)
            .map(|seed| {
                let values = noisy_stretches(seed, 60);
                let signal = Signal::new(&values, 2).unwrap();
                let found = cut_pursuit(&signal, &chain(60), params, &Monitor::default()).unwrap();
                found.energy / chain_optimum(&signal, params.strength)
            })
            .collect()
    }

    #[test]
    fn chains_come_close_to_the_optimum_of_dynamic_programming() {
        let default = CutPursuitParams { strength: STRENGTH, ..Default::default() };
        for (name, params) in [("default", default.clone()), ("as published", default.as_published())] {
            let ratios = chain_ratios(&params);
            let mean = ratios.iter().sum::<f64>() / 60.0;
            let worst = ratios.iter().copied().fold(0.0, f64::max);
            let exact = ratios.iter().filter(|r| **r < 1.0 + 1e-9).count();
            println!("{name}: mean {mean:.4}, worst {worst:.4}, exact {exact} of 60");
            assert!(ratios.iter().all(|r| *r > 1.0 - 1e-9), "nothing is better than the optimum");
            assert!(mean <= 1.01 && worst <= 1.06, "{name}: {mean} {worst}");
        }
    }

    fn random_problem(seed: u64, nodes: u32) -> (Vec<f32>, Vec<f32>, Graph) {
        let mut random = stream(seed, 2);
        let values = (0..2 * nodes).map(|_| random.below(4) as f32 / 2.0 + 0.1 * random.uniform() as f32).collect();
        let weights = (0..nodes).map(|_| 0.5 + random.uniform() as f32).collect();
        let all = (0..nodes).flat_map(|b| (0..b).map(move |a| [a, b]));
        let pairs: Vec<[u32; 2]> = all.filter(|_| random.below(3) == 0).collect();
        let costs: Vec<f32> = pairs.iter().map(|_| 0.5 + random.uniform() as f32).collect();
        (values, weights, Graph::new(nodes as usize, &pairs, &costs).unwrap())
    }

    /// All partitions of `nodes` nodes, as labels numbered in the order of their first node.
    fn all_partitions(nodes: usize) -> Vec<Vec<u32>> {
        let mut all = vec![vec![]];
        for _ in 0..nodes {
            all = all
                .into_iter()
                .flat_map(|labels: Vec<u32>| {
                    let next = labels.iter().map(|l| l + 1).max().unwrap_or(0);
                    (0..=next).map(move |label| [&labels[..], &[label]].concat())
                })
                .collect();
        }
        all
    }

    #[test]
    fn the_energy_is_that_of_the_partition_and_never_below_the_best_of_all() {
        let partitions: Vec<Partition> =
            all_partitions(7).iter().map(|labels| Partition::from_labels(labels).unwrap()).collect();
        let mut exact = 0;
        for seed in 0..40 {
            let (values, weights, graph) = random_problem(seed, 7);
            let signal = Signal::new(&values, 2).unwrap().with_weights(&weights).unwrap();
            let best = partitions
                .iter()
                .map(|p| {
                    energy(Objective { signal: &signal, graph: &graph, strength: 0.3 }, p, &Monitor::default()).unwrap()
                })
                .fold(f64::INFINITY, f64::min);
            let params = CutPursuitParams { strength: 0.3, ..Default::default() };
            let found = cut_pursuit(&signal, &graph, &params, &Monitor::default()).unwrap();
            assert_eq!(
                found.energy,
                energy(
                    Objective { signal: &signal, graph: &graph, strength: 0.3 },
                    &found.partition,
                    &Monitor::default()
                )
                .unwrap()
            );
            assert!(found.energy >= best - 1e-9, "{} {best}", found.energy);
            assert_eq!(found.energy, found.trace.iter().copied().fold(f64::INFINITY, f64::min));
            exact += usize::from(found.energy < best + 1e-9);
        }
        assert!(exact >= 25, "only {exact} of 40 optimal");
    }

    #[test]
    fn the_energy_is_that_of_the_partition_after_the_cutoff() {
        let (signal, graph) = (Signal::new(&[0.0, 1.0, 50.0, 60.0], 1).unwrap(), chain(4));
        let params = CutPursuitParams { strength: 0.01, cutoff: 2.0, ..Default::default() };
        let found = cut_pursuit(&signal, &graph, &params, &Monitor::default()).unwrap();
        assert_eq!(found.partition.segments(), [0, 0, 1, 1]);
        assert!((found.energy - (0.5 + 50.0 + 0.01)).abs() < 1e-9, "{}", found.energy);
        let params = MergeParams { strength: 0.01, cutoff: 2.0 };
        let merged = merge(&signal, &graph, &params, &Monitor::default()).unwrap();
        assert!((merged.energy - found.energy).abs() < 1e-9 && merged.partition == found.partition);
    }

    #[test]
    fn strength_nought_gives_equal_values_and_an_infinite_one_the_pieces() {
        let signal = Signal::new(&[1.0, 1.0, 2.0, 1.0, 5.0, 6.0], 1).unwrap();
        let graph = Graph::new(6, &[[0, 1], [1, 2], [2, 3], [4, 5]], &[1.0; 4]).unwrap();
        let at = |strength| {
            let params = CutPursuitParams { strength, ..Default::default() };
            cut_pursuit(&signal, &graph, &params, &Monitor::default()).unwrap()
        };
        assert_eq!(at(0.0).partition.segments(), [0, 0, 1, 2, 3, 4]);
        assert_eq!(at(0.0).energy, 0.0);
        let pieces = at(f64::INFINITY);
        assert_eq!(pieces.partition.segments(), [0, 0, 0, 0, 1, 1]);
        assert_eq!(pieces.centroids, [1.25, 5.5]);
        assert_eq!(pieces.energy, 0.75 + 0.5);
        assert_eq!(at(1e9).partition, pieces.partition);
        assert_eq!(at(1e-9).partition, at(0.0).partition);
    }

    #[test]
    fn two_nodes_that_cannot_be_parted_are_one_of_twice_the_weight() {
        let mut ratios = Vec::new();
        for seed in 0..30 {
            let values = noisy_stretches(seed, 40);
            let doubled = [&values[..], &values[20..22]].concat();
            let mut pairs = chain(40).edges().to_vec();
            let mut costs = vec![1.0; 39];
            pairs.push([10, 40]);
            costs.push(1e6);
            let mut weights = vec![1.0; 40];
            weights[10] = 2.0;
            let params = CutPursuitParams { strength: STRENGTH, ..Default::default() };
            let twice = Signal::new(&doubled, 2).unwrap();
            let heavy = Signal::new(&values, 2).unwrap().with_weights(&weights).unwrap();
            let graph = Graph::new(41, &pairs, &costs).unwrap();
            let one = cut_pursuit(&twice, &graph, &params, &Monitor::default()).unwrap();
            let other = cut_pursuit(&heavy, &chain(40), &params, &Monitor::default()).unwrap();
            assert_eq!(one.partition.segments()[40], one.partition.segments()[10]);
            let moved = Partition::from_labels(&one.partition.segments()[..40]).unwrap();
            let same = energy(
                Objective { signal: &heavy, graph: &chain(40), strength: STRENGTH },
                &moved,
                &Monitor::default(),
            )
            .unwrap();
            assert!((same - one.energy).abs() < 1e-9, "{same} {}", one.energy);
            ratios.push(one.energy / other.energy);
        }
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        assert!((mean - 1.0).abs() < 0.01, "{ratios:?}");
    }

    #[test]
    fn the_guard_makes_the_energy_fall_in_every_round() {
        for seed in 0..60 {
            let values = noisy_stretches(seed, 60);
            let signal = Signal::new(&values, 2).unwrap();
            let params = CutPursuitParams { strength: 0.2, ..Default::default() }.as_published();
            let steps = CutPursuitSteps { guard: true, ..params.steps };
            let params = CutPursuitParams { steps, ..params };
            let found = cut_pursuit(&signal, &chain(60), &params, &Monitor::default()).unwrap();
            assert!(found.trace.windows(2).all(|w| w[1] <= w[0]), "{:?}", found.trace);
        }
    }

    /// Square fields of 12 x 12 nodes on a grid, with noise as large as a third of the contrast.
    fn noisy_fields(side: u32) -> (Vec<f32>, Graph) {
        let mut random = stream(5, 3);
        let field = |v: u32| (v % side / 12 * 5 + v / side / 12 * 3) % 7;
        let values = (0..side * side)
            .flat_map(|v| [field(v) % 3, field(v) % 4].map(|m| (f64::from(m) + 0.33 * normal(&mut random)) as f32))
            .collect();
        let across = (0..side * side).filter(|v| v % side + 1 < side).map(|v| [v, v + 1]);
        let pairs: Vec<[u32; 2]> = across.chain((0..side * (side - 1)).map(|v| [v, v + side])).collect();
        (values, Graph::new((side * side) as usize, &pairs, &vec![1.0; pairs.len()]).unwrap())
    }

    #[test]
    fn a_coarse_graph_leads_to_no_higher_energy() {
        let (values, graph) = noisy_fields(120);
        let signal = Signal::new(&values, 2).unwrap();
        let run = |params: CutPursuitParams| cut_pursuit(&signal, &graph, &params, &Monitor::default()).unwrap();
        let default = CutPursuitParams { strength: 0.5, ..Default::default() };
        let (coarse, published) = (run(default.clone()), run(default.as_published()));
        println!(
            "coarse {} {}, published {} {}",
            coarse.energy,
            coarse.partition.len(),
            published.energy,
            published.partition.len()
        );
        assert!(coarse.energy <= 1.001 * published.energy);
        assert_eq!(
            coarse.energy,
            energy(Objective { signal: &signal, graph: &graph, strength: 0.5 }, &coarse.partition, &Monitor::default())
                .unwrap()
        );
        assert!(coarse.trace.windows(2).all(|w| w[1] <= w[0]), "{:?}", coarse.trace);
    }

    /// The same problem with node v called `names[v]`.
    fn renamed(values: &[f32], graph: &Graph, names: &[u32]) -> (Vec<f32>, Graph) {
        let mut moved = vec![0.0; values.len()];
        for (v, &name) in names.iter().enumerate() {
            moved[2 * name as usize..][..2].copy_from_slice(&values[2 * v..][..2]);
        }
        let pairs: Vec<[u32; 2]> = graph.edges().iter().map(|e| e.map(|v| names[v as usize])).collect();
        (moved, Graph::new(names.len(), &pairs, graph.weights()).unwrap())
    }

    #[test]
    fn other_names_of_the_nodes_change_the_energy_by_less_than_a_hundredth() {
        let (values, graph) = noisy_fields(48);
        let params = CutPursuitParams { strength: STRENGTH, ..Default::default() };
        let energies: Vec<f64> = (0..8)
            .map(|seed| {
                let mut names: Vec<u32> = (0..48 * 48).collect();
                if seed > 0 {
                    stream(seed, 4).shuffle(&mut names);
                }
                let (moved, other) = renamed(&values, &graph, &names);
                let signal = Signal::new(&moved, 2).unwrap();
                let found = cut_pursuit(&signal, &other, &params, &Monitor::default()).unwrap();
                let of: Vec<u32> = names.iter().map(|&n| found.partition.segments()[n as usize]).collect();
                let back = Partition::from_labels(&of).unwrap();
                let original = energy(
                    Objective { signal: &Signal::new(&values, 2).unwrap(), graph: &graph, strength: STRENGTH },
                    &back,
                    &Monitor::default(),
                )
                .unwrap();
                assert!((original - found.energy).abs() < 1e-6 * original, "a partition costs the same by any names");
                found.energy
            })
            .collect();
        let (least, most) = energies.iter().fold((f64::INFINITY, 0.0f64), |(l, m), &e| (l.min(e), m.max(e)));
        assert!(most < 1.01 * least, "{energies:?}");
    }

    #[test]
    fn any_number_of_threads_gives_the_same_partition() {
        let (values, graph) = noisy_fields(60);
        let signal = Signal::new(&values, 2).unwrap();
        for coarse_above in [1000, 10_000] {
            let params = CutPursuitParams {
                strength: 0.5,
                steps: CutPursuitSteps { coarse_above: Some(coarse_above), ..Default::default() },
                ..Default::default()
            };
            let with = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| cut_pursuit(&signal, &graph, &params, &Monitor::default()).unwrap())
            };
            let alone = with(1);
            assert!(alone.partition.len() > 20, "{}", alone.partition.len());
            assert_eq!(alone, with(3));
        }
    }

    #[test]
    fn small_and_odd_inputs_have_plain_answers() {
        let params = CutPursuitParams::default();
        let run = |values: &[f32], graph: &Graph| {
            cut_pursuit(&Signal::new(values, 1).unwrap(), graph, &params, &Monitor::default())
        };
        assert!(run(&[], &chain(0)).unwrap().partition.is_empty());
        assert_eq!(run(&[3.0], &chain(1)).unwrap().centroids, [3.0]);
        assert_eq!(run(&[3.0, 4.0], &chain(2)).unwrap().centroids, [3.0, 4.0]);
        assert_eq!(run(&[3.0, 3.1], &chain(2)).unwrap().partition.len(), 1);
        assert_eq!(run(&[2.0; 50], &chain(50)).unwrap().energy, 0.0);
        let lonely = Graph::new(3, &[], &[]).unwrap();
        assert_eq!(run(&[2.0; 3], &lonely).unwrap().partition.len(), 3);
        assert!(run(&[2.0; 3], &chain(4)).is_err());
        let cancelled = Monitor::default();
        cancelled.cancel();
        let signal = Signal::new(&[0.0; 5], 1).unwrap();
        assert!(cut_pursuit(&signal, &chain(5), &params, &cancelled).is_err());
    }
}
