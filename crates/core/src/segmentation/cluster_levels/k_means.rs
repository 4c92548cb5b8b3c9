//! k-means with the number of clusters chosen by Hartigan's rule.

use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor, map_ordered};
use crate::random::stream;
use serde::{Deserialize, Serialize};

/// The first centres of k-means.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum KMeansStart {
    /// Random rows, each with a probability in proportion to its squared distance from those already drawn (D. Arthur, S.
    /// Vassilvitskii, *k-means++*, SODA 2007), several times.
    #[default]
    PlusPlus,
    /// The largest anomalous patterns: clusters that are split off one after the other, each around the row farthest from
    /// the mean (B. Mirkin, *Clustering for data mining*, 2005; M. Chiang, B. Mirkin 2010, section 3.2). No random draws.
    AnomalousPattern,
}

/// Parameters of [`hartigan`].
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct HartiganParams {
    /// The number of clusters is the least k for which (W_k / W_k+1 − 1)(n − k − 1) is at most this.
    pub threshold: f64,
    /// Most clusters; also at most n − 2.
    pub most: usize,
    /// The first centres.
    pub start: KMeansStart,
    /// Random starts for each number of clusters, of which the best is kept; at least 1.
    pub restarts: usize,
    /// Most iterations of a start; at least 1.
    pub iterations: usize,
    /// The centres are found on a sample of this many rows if there are more; at least 3.
    pub sample: usize,
}

impl Default for HartiganParams {
    fn default() -> Self {
        Self { threshold: 10.0, most: 50, start: KMeansStart::PlusPlus, restarts: 10, iterations: 100, sample: 5000 }
    }
}

impl HartiganParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] with the value found and what is allowed.
    pub fn validate(&self) -> Result<()> {
        let threshold = self.threshold >= 0.0 && self.threshold.is_finite();
        range(threshold, "categories.threshold", self.threshold, "0 or more, finite")?;
        range(self.most > 0, "categories.most", self.most as f64, "1 or more")?;
        range(self.restarts > 0, "categories.restarts", self.restarts as f64, "1 or more")?;
        range(self.iterations > 0, "categories.iterations", self.iterations as f64, "1 or more")?;
        range(self.sample > 2, "categories.sample", self.sample as f64, "3 or more")
    }
}

/// Refuses a parameter that is not fine.
pub(super) fn range(fine: bool, name: &'static str, value: f64, expected: &str) -> Result<()> {
    if fine { Ok(()) } else { Err(Error::parameter(name, value, expected)) }
}

/// Clusters of rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KMeans {
    /// Cluster of each row, from 0 on.
    pub labels: Vec<u32>,
    /// Centre of each cluster, row after row.
    pub centres: Vec<f64>,
    /// W_1, W_2, ...: the least sum of squared distances to the centres that was found for each number of clusters; never
    /// rises.
    pub within: Vec<f64>,
}

/// Rows of numbers.
#[derive(Clone, Copy, Debug)]
pub struct NumberRows<'a> {
    /// Row after row.
    pub values: &'a [f64],
    /// Numbers in a row, at least 1.
    pub width: usize,
}

impl<'a> NumberRows<'a> {
    fn len(&self) -> usize {
        self.values.len() / self.width.max(1)
    }

    fn row(&self, i: usize) -> &'a [f64] {
        &self.values[i * self.width..(i + 1) * self.width]
    }
}

/// k-means with the least number of clusters that Hartigan's rule accepts.
///
/// J. A. Hartigan, *Clustering algorithms*, Wiley 1975; M. M.-T. Chiang, B. Mirkin, *Intelligent choice of the number of
/// clusters in k-means clustering*, Journal of Classification 27(1), 2010, doi:10.1007/s00357-010-9049-5: with W_k the
/// sum of squared distances to the centres of k clusters, k is taken if (W_k / W_k+1 − 1)(n − k − 1) ≤ 10. The rule needs
/// rows of many dimensions or few rows: two halves of one Gaussian cluster of d dimensions reduce W by a share of about
/// 0.64 / d, which is significant by the rule for more than 16 d rows. Besides the starts asked for, the centres of k
/// clusters and the row farthest from them are a start of k + 1. O(k restarts iterations n width).
///
/// # Errors
/// If a parameter is out of range, values are not rows of this width, or the work was cancelled.
pub fn hartigan(rows: NumberRows<'_>, params: &HartiganParams, seed: u64, monitor: &Monitor) -> Result<KMeans> {
    params.validate()?;
    if rows.width == 0 || !rows.values.len().is_multiple_of(rows.width) {
        return Err(Error::input(format!("{} values are not rows of {}", rows.values.len(), rows.width)));
    }
    if rows.values.is_empty() {
        return Ok(KMeans::default());
    }
    let chosen = stream(seed, 0).choose(rows.len(), params.sample);
    let values: Vec<f64> = chosen.iter().flat_map(|&i| rows.row(i as usize)).copied().collect();
    let sample = NumberRows { values: &values, width: rows.width };
    let (n, search) = (sample.len(), CentreSearch { rows: sample, params, seed, monitor });
    let mut best = search.improved(mean(sample))?;
    let patterns = match params.start {
        KMeansStart::PlusPlus => Vec::new(),
        KMeansStart::AnomalousPattern => search.anomalous_patterns()?,
    };
    let mut within = vec![best.within];
    for k in 1..params.most.min(n.saturating_sub(2)) {
        if best.within <= 0.0 {
            break;
        }
        let next = search.best(k + 1, &best, &patterns)?;
        within.push(next.within);
        let rule = (best.within / next.within - 1.0) * (n - k - 1) as f64;
        if rule <= params.threshold {
            break;
        }
        best = next;
    }
    let mut looks = Looks::at(monitor);
    let label = |i: usize| {
        looks.steps(best.centres.len())?;
        Ok(nearest(rows.row(i), &best.centres, rows.width).0 as u32)
    };
    let labels = (0..rows.len()).map(label).collect::<Result<_>>()?;
    Ok(KMeans { labels, centres: best.centres, within })
}

/// Centres, and the sum of squared distances to them.
#[derive(Clone, Debug)]
struct Solution {
    centres: Vec<f64>,
    within: f64,
}

/// The search for centres.
struct CentreSearch<'a> {
    rows: NumberRows<'a>,
    params: &'a HartiganParams,
    seed: u64,
    monitor: &'a Monitor,
}

impl CentreSearch<'_> {
    /// The best of all starts for k clusters; ties: the first.
    fn best(&self, k: usize, fewer: &Solution, patterns: &[Vec<f64>]) -> Result<Solution> {
        let random = match self.params.start {
            KMeansStart::PlusPlus => self.params.restarts,
            KMeansStart::AnomalousPattern => usize::from(patterns.len() >= k),
        };
        let all = map_ordered(1 + random, self.monitor, |start| {
            let centres = match (start, self.params.start) {
                (0, _) => self.one_more(fewer),
                (_, KMeansStart::PlusPlus) => self.plus_plus(k, start as u64),
                (_, KMeansStart::AnomalousPattern) => patterns[..k].concat(),
            };
            self.improved(centres)
        })?;
        let lower = |a: Solution, b: Solution| if b.within < a.within { b } else { a };
        all.into_iter().reduce(lower).ok_or_else(|| Error::input("no start of k-means"))
    }

    /// The centres, and the row farthest from its nearest one.
    fn one_more(&self, fewer: &Solution) -> Vec<f64> {
        let width = self.rows.width;
        let far = |i: usize| nearest(self.rows.row(i), &fewer.centres, width).1;
        let farthest = (0..self.rows.len()).fold((0, -1.0), |best, i| {
            let apart = far(i);
            if apart > best.1 { (i, apart) } else { best }
        });
        [&fewer.centres, self.rows.row(farthest.0)].concat()
    }

    fn plus_plus(&self, k: usize, start: u64) -> Vec<f64> {
        let rows = self.rows;
        let mut random = stream(self.seed, (k as u64) << 32 | start);
        let mut centres = rows.row(random.below(rows.len())).to_vec();
        let mut apart: Vec<f64> = (0..rows.len()).map(|i| squared(rows.row(i), &centres)).collect();
        for _ in 1..k {
            let total: f64 = apart.iter().sum();
            let mut left = random.uniform() * total;
            let taken = apart.iter().position(|d| {
                left -= d;
                left < 0.0
            });
            let centre = rows.row(taken.unwrap_or(0));
            apart.iter_mut().enumerate().for_each(|(i, d)| *d = d.min(squared(rows.row(i), centre)));
            centres.extend(centre);
        }
        centres
    }

    /// Centres of the anomalous patterns, the largest first.
    fn anomalous_patterns(&self) -> Result<Vec<Vec<f64>>> {
        let (rows, origin) = (self.rows, mean(self.rows));
        let mut left: Vec<usize> = (0..rows.len()).collect();
        let mut found: Vec<(usize, Vec<f64>)> = Vec::new();
        while !left.is_empty() {
            self.monitor.check()?;
            let far = |&i: &usize| squared(rows.row(i), &origin);
            let farthest = left.iter().fold(left[0], |best, i| if far(i) > far(&best) { *i } else { best });
            let mut centre = rows.row(farthest).to_vec();
            let mut members = vec![farthest];
            for _ in 0..self.params.iterations {
                let near = |&&i: &&usize| squared(rows.row(i), &centre) < far(&i);
                let next: Vec<usize> = left.iter().filter(near).copied().collect();
                if next.is_empty() || next == members {
                    break;
                }
                centre = mean_of(rows, &next);
                members = next;
            }
            left.retain(|i| members.binary_search(i).is_err());
            found.push((members.len(), centre));
        }
        found.sort_by_key(|(size, _)| std::cmp::Reverse(*size));
        Ok(found.into_iter().map(|(_, centre)| centre).collect())
    }

    /// Lloyd's iterations: each row to its nearest centre (ties: the first), each centre to the mean of its rows. A
    /// centre without rows stays.
    fn improved(&self, mut centres: Vec<f64>) -> Result<Solution> {
        let (rows, width) = (self.rows, self.rows.width);
        let mut before = f64::INFINITY;
        for _ in 0..self.params.iterations {
            self.monitor.check()?;
            let mut sums = vec![0.0; centres.len()];
            let mut counts = vec![0usize; centres.len() / width];
            let mut within = 0.0;
            for i in 0..rows.len() {
                let (centre, apart) = nearest(rows.row(i), &centres, width);
                within += apart;
                counts[centre] += 1;
                sums[centre * width..].iter_mut().zip(rows.row(i)).for_each(|(sum, v)| *sum += v);
            }
            if within >= before {
                break;
            }
            before = within;
            for (c, &count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                (c * width..(c + 1) * width).for_each(|v| centres[v] = sums[v] / count as f64);
            }
        }
        let within = (0..rows.len()).map(|i| nearest(rows.row(i), &centres, width).1).sum();
        Ok(Solution { centres, within })
    }
}

/// The nearest centre and the squared distance to it.
fn nearest(row: &[f64], centres: &[f64], width: usize) -> (usize, f64) {
    let all = centres.chunks_exact(width).enumerate();
    all.fold((0, f64::INFINITY), |best, (c, centre)| {
        let apart = squared(row, centre);
        if apart < best.1 { (c, apart) } else { best }
    })
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn mean(rows: NumberRows<'_>) -> Vec<f64> {
    mean_of(rows, &(0..rows.len()).collect::<Vec<_>>())
}

fn mean_of(rows: NumberRows<'_>, members: &[usize]) -> Vec<f64> {
    let mut sums = vec![0.0; rows.width];
    members.iter().for_each(|&i| sums.iter_mut().zip(rows.row(i)).for_each(|(sum, v)| *sum += v));
    sums.iter().map(|sum| sum / members.len().max(1) as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 10;

    /// Normally distributed clusters far from each other, and the cluster of each row.
    fn blobs(clusters: usize, rows: usize) -> (Vec<f64>, Vec<usize>) {
        let mut random = stream(3, clusters as u64);
        let normal = |random: &mut crate::random::Stream| (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0;
        let centres: Vec<Vec<f64>> =
            (0..clusters).map(|_| (0..WIDTH).map(|_| 40.0 * random.uniform()).collect()).collect();
        let of: Vec<usize> = (0..rows).map(|i| i % clusters).collect();
        let values = of.iter().flat_map(|&c| centres[c].iter().map(|v| v + normal(&mut random)).collect::<Vec<_>>());
        (values.collect(), of)
    }

    #[test]
    fn the_number_of_blobs_is_found_by_both_starts() {
        for start in [KMeansStart::PlusPlus, KMeansStart::AnomalousPattern] {
            for clusters in [1, 2, 3, 5, 8] {
                let (values, of) = blobs(clusters, 12 * clusters.max(3));
                let params = HartiganParams { start, ..HartiganParams::default() };
                let rows = NumberRows { values: &values, width: WIDTH };
                let found = hartigan(rows, &params, 0, &Monitor::default()).unwrap();
                assert_eq!(found.centres.len(), clusters * WIDTH, "{start:?}");
                let same = |i: usize, j: usize| (of[i] == of[j]) == (found.labels[i] == found.labels[j]);
                assert!((0..of.len()).all(|i| (0..i).all(|j| same(i, j))), "{start:?}, {clusters}");
                assert!(found.within.windows(2).all(|w| w[1] <= w[0]), "{:?}", found.within);
            }
        }
    }

    #[test]
    fn within_is_the_sum_of_squared_distances_of_the_best_split_of_few_rows() {
        // All splits of 9 numbers into two intervals; the optimum of 2-means in one dimension is one of them.
        let values = [1.0, 2.0, 4.0, 4.5, 5.0, 11.0, 12.0, 13.5, 14.0];
        let cost = |part: &[f64]| {
            let mean = part.iter().sum::<f64>() / part.len() as f64;
            part.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>()
        };
        let best = (1..9).map(|c| cost(&values[..c]) + cost(&values[c..])).fold(f64::INFINITY, f64::min);
        let rows = NumberRows { values: &values, width: 1 };
        let found = hartigan(rows, &HartiganParams::default(), 0, &Monitor::default()).unwrap();
        assert!((found.within[0] - cost(&values)).abs() < 1e-9 && (found.within[1] - best).abs() < 1e-9);
    }

    #[test]
    fn equal_and_few_rows_are_one_cluster_and_nonsense_is_refused() {
        let params = HartiganParams::default();
        let of = |values: &[f64], width| hartigan(NumberRows { values, width }, &params, 0, &Monitor::default());
        assert_eq!(of(&[2.0; 40], 2).unwrap().labels, [0; 20]);
        assert_eq!(of(&[1.0, 9.0], 1).unwrap().labels, [0; 2]);
        assert!(of(&[], 3).unwrap().labels.is_empty());
        assert!(of(&[1.0, 2.0], 3).is_err() && of(&[1.0], 0).is_err());
        let bad = HartiganParams { restarts: 0, ..params.clone() };
        assert!(hartigan(NumberRows { values: &[1.0], width: 1 }, &bad, 0, &Monitor::default()).is_err());
    }

    #[test]
    fn the_clusters_are_the_same_for_any_number_of_threads() {
        let (values, _) = blobs(6, 3000);
        let params = HartiganParams { sample: 500, most: 12, ..HartiganParams::default() };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let rows = NumberRows { values: &values, width: WIDTH };
            pool.install(|| hartigan(rows, &params, 7, &Monitor::default())).unwrap()
        };
        assert_eq!(with(1), with(3));
    }
}
