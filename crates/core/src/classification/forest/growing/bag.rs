//! Bootstrap sampling of one tree.

use crate::classification::params::Bootstrap;
use crate::random::Stream;

/// Number of times each of `count` samples was drawn.
pub(in crate::classification) fn bag(bootstrap: Bootstrap, count: usize, random: &mut Stream) -> Vec<u32> {
    let mut times = vec![0u32; count];
    match bootstrap {
        Bootstrap::None => times.fill(1),
        Bootstrap::WithReplacement => (0..count).for_each(|_| times[random.below(count)] += 1),
        Bootstrap::WithoutReplacement(share) => {
            let wanted = ((share * count as f64).round() as usize).clamp(1, count);
            random.choose(count, wanted).into_iter().for_each(|i| times[i as usize] = 1);
        }
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn bags_hold_what_their_kind_promises() {
        let mut random = stream(3, 0);
        let with = bag(Bootstrap::WithReplacement, 10_000, &mut random);
        assert_eq!(with.iter().sum::<u32>(), 10_000);
        let unique = with.iter().filter(|&&t| t > 0).count();
        assert!((6200..6450).contains(&unique), "{unique}");
        let without = bag(Bootstrap::WithoutReplacement(0.632), 10_000, &mut random);
        assert!(without.iter().all(|&t| t <= 1) && without.iter().sum::<u32>() == 6320);
        assert_eq!(bag(Bootstrap::None, 3, &mut random), [1, 1, 1]);
        assert_eq!(bag(Bootstrap::WithoutReplacement(0.1), 1, &mut random), [1]);
    }
}
