//! Independent random streams: one per (seed, index), so that results never depend on the number of threads.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A random stream with the few distributions that the algorithms need.
#[derive(Clone, Debug)]
pub struct Stream(ChaCha8Rng);

/// The stream of item `index` (tree, epoch, tile, fold) under `seed`.
///
/// Two different pairs give independent streams; the same pair gives the same numbers on every machine.
pub fn stream(seed: u64, index: u64) -> Stream {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    Stream(rng)
}

impl Stream {
    /// A uniform 64-bit integer.
    pub fn next_u64(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// A uniform integer in `0..bound` (0 if `bound` is 0). Bias below 2^-32 for bounds below 2^32.
    pub fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.next_u64()) * bound as u128) >> 64) as usize
    }

    /// A uniform number in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A number from the standard normal distribution (Box and Muller's method, one of its two numbers).
    pub fn normal(&mut self) -> f64 {
        let (radius, angle) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
    }

    /// `count` distinct numbers out of `0..n`, ascending (all of them if `count >= n`). O(n) time and memory.
    pub fn choose(&mut self, n: usize, count: usize) -> Vec<u32> {
        let mut chosen = Vec::with_capacity(count.min(n));
        for i in 0..n {
            let wanted = count.min(n) - chosen.len();
            if self.below(n - i) < wanted {
                chosen.push(i as u32);
            }
        }
        chosen
    }

    /// Shuffles in place (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_repeatable_and_differ_by_index() {
        let draw = |seed, index| stream(seed, index).next_u64();
        assert_eq!(draw(1, 2), draw(1, 2));
        assert_ne!(draw(1, 2), draw(1, 3));
        assert_ne!(draw(1, 2), draw(2, 2));
    }

    #[test]
    fn choose_gives_distinct_ascending_numbers_with_equal_chances() {
        let mut hits = [0u32; 10];
        for i in 0..2000 {
            let chosen = stream(7, i).choose(10, 3);
            assert!(chosen.len() == 3 && chosen.windows(2).all(|w| w[0] < w[1]));
            chosen.iter().for_each(|&c| hits[c as usize] += 1);
        }
        assert!(hits.iter().all(|&h| (500..700).contains(&h)), "{hits:?}");
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let mut s = stream(3, 0);
        let all: Vec<f64> = (0..40_000).map(|_| s.normal()).collect();
        let moment = |power: i32| all.iter().map(|v| v.powi(power)).sum::<f64>() / all.len() as f64;
        assert!(moment(1).abs() < 0.02 && (moment(2) - 1.0).abs() < 0.03 && (moment(4) - 3.0).abs() < 0.2);
    }

    #[test]
    fn uniform_lies_in_the_unit_interval() {
        let mut s = stream(0, 0);
        let mean = (0..10_000).map(|_| s.uniform()).inspect(|u| assert!((0.0..1.0).contains(u))).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.02);
    }
}
