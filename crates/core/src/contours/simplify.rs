//! Fewer vertices of a line: the algorithm of Douglas and Peucker in space.
//!
//! D. H. Douglas, T. K. Peucker, *Algorithms for the reduction of the number of points required to represent a
//! digitized line or its caricature*, Cartographica 10(2), 1973.

use super::params::zero_or_more;
use crate::error::{Error, Result};

/// The vertices of a line that remain, ascending: every other one is at most `tolerance` metres from the segment
/// between the vertices that remain before and after it.
///
/// The first and the last always remain; so does the vertex farthest from the first one if the line is closed. With a
/// tolerance of 0 only vertices exactly on their segment go. Of equally far vertices the first remains. O(n²) at worst,
/// O(n log n) on average.
///
/// # Errors
/// If the tolerance is negative or not finite, or a coordinate is not finite.
pub fn simplify(vertices: &[[f32; 3]], tolerance: f64) -> Result<Vec<usize>> {
    zero_or_more("tolerance", tolerance)?;
    if let Some(at) = vertices.iter().position(|v| v.iter().any(|c| !c.is_finite())) {
        return Err(Error::input(format!("vertex {at} at {:?} (allowed: finite numbers)", vertices[at])));
    }
    let Some(last) = vertices.len().checked_sub(1) else { return Ok(Vec::new()) };
    let mut kept = vec![false; vertices.len()];
    (kept[0], kept[last]) = (true, true);
    let mut open = vec![[0, last]];
    while let Some([first, end]) = open.pop() {
        let (mut far, mut most) = (first, tolerance);
        for at in first + 1..end {
            let apart = from_segment(vertices[at], [vertices[first], vertices[end]]);
            if apart > most {
                (far, most) = (at, apart);
            }
        }
        if far > first {
            kept[far] = true;
            open.extend([[first, far], [far, end]]);
        }
    }
    Ok((0..vertices.len()).filter(|&at| kept[at]).collect())
}

/// Distance of a position from a segment, metres.
pub(super) fn from_segment(at: [f32; 3], [from, to]: [[f32; 3]; 2]) -> f64 {
    let [at, from, to] = [at, from, to].map(|v| v.map(f64::from));
    let way = [0, 1, 2].map(|i| to[i] - from[i]);
    let apart = [0, 1, 2].map(|i| at[i] - from[i]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let squared = dot(way, way);
    let share = if squared > 0.0 { (dot(apart, way) / squared).clamp(0.0, 1.0) } else { 0.0 };
    let rest = [0, 1, 2].map(|i| apart[i] - share * way[i]);
    dot(rest, rest).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    #[test]
    fn ends_remain_and_what_goes_is_near() {
        for seed in 0..60 {
            let mut random = stream(seed, 3);
            let mut at = [0.0f32; 3];
            let line: Vec<[f32; 3]> = (0..2 + seed as usize)
                .map(|_| {
                    at = at.map(|c| c + random.normal() as f32);
                    at
                })
                .collect();
            let mut before = usize::MAX;
            for tolerance in [0.0, 0.5, 1.0, 3.0, 100.0] {
                let kept = simplify(&line, tolerance).unwrap();
                assert_eq!([kept.first(), kept.last()], [Some(&0), Some(&(line.len() - 1))]);
                for w in kept.windows(2) {
                    let between = (w[0] + 1..w[1]).map(|i| from_segment(line[i], [line[w[0]], line[w[1]]]));
                    assert!(between.fold(0.0, f64::max) <= tolerance);
                }
                assert!(tolerance > 0.0 || kept.len() == line.len());
                assert!(kept.len() <= before);
                before = kept.len();
            }
            assert_eq!(before, 2);
        }
    }

    #[test]
    fn collinear_vertices_go_and_closed_lines_keep_their_shape() {
        let straight: Vec<[f32; 3]> = (0..9).map(|i| [i as f32, 2.0 * i as f32, 0.0]).collect();
        assert_eq!(simplify(&straight, 0.0).unwrap(), [0, 8]);
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]];
        assert_eq!(simplify(&square, 0.1).unwrap(), [0, 1, 2, 3, 4]);
        // A vertex beyond the end of its segment is as far as it is from that end.
        assert_eq!(simplify(&[[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]], 0.5).unwrap(), [0, 1, 2]);
    }

    #[test]
    fn few_vertices_and_nonsense() {
        assert!(simplify(&[], 0.1).unwrap().is_empty());
        assert_eq!(simplify(&[[1.0; 3]], 0.1).unwrap(), [0]);
        assert_eq!(simplify(&[[1.0; 3]; 4], 0.0).unwrap(), [0, 3]);
        assert!(simplify(&[[0.0; 3]], -1.0).is_err() && simplify(&[[f32::NAN; 3]], 0.0).is_err());
    }
}
