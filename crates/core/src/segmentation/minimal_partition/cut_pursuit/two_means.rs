//! The start of a split: two means by k-means++ and Lloyd's steps.

use super::super::regions::weighted_mean;
use super::piece::Piece;
use crate::random::Stream;

/// The two means of a cut.
pub(super) type Means = [Vec<f64>; 2];

/// Random starts of 2-means (D. Arthur, S. Vassilvitskii, *k-means++*, SODA 2007); nothing if all rows are equal.
/// O(restarts · n · width).
pub(super) fn starts(piece: &Piece, restarts: usize, random: &mut Stream) -> Option<Vec<Means>> {
    (0..restarts).map(|_| seeds(piece, random)).collect()
}

/// Side of each node in the best of the 2-means that begin with these. O(starts · steps · n · width).
pub(super) fn two_means(piece: &Piece, starts: &[Means], steps: usize) -> Vec<bool> {
    let mut best: (f64, Vec<bool>) = (f64::INFINITY, vec![false; piece.len()]);
    for start in starts {
        let means = lloyd(piece, start.clone(), steps);
        let mut inertia = 0.0;
        let sides = piece
            .rows()
            .map(|(row, weight)| {
                let [a, b] = means.each_ref().map(|mean| square_distance(row, mean));
                inertia += weight * a.min(b);
                b < a
            })
            .collect();
        if inertia < best.0 {
            best = (inertia, sides);
        }
    }
    best.1
}

/// Means of both sides; nothing if one side is empty.
pub(super) fn means_of_sides(piece: &Piece, sides: &[bool]) -> Option<Means> {
    let mut means = [false, true].map(|_| vec![0.0; piece.width]);
    let totals = [false, true].map(|side| {
        let rows = piece.rows().zip(sides).filter(|(_, s)| **s == side).map(|(row, _)| row);
        weighted_mean(rows, &mut means[usize::from(side)])
    });
    totals.iter().all(|total| *total > 0.0).then_some(means)
}

/// First seed uniform, second with probability proportional to m ‖f − first‖².
fn seeds(piece: &Piece, random: &mut Stream) -> Option<Means> {
    if piece.len() < 2 {
        return None;
    }
    let seed = |at: usize| piece.values[at * piece.width..][..piece.width].iter().map(|&f| f64::from(f)).collect();
    let first: Vec<f64> = seed(random.below(piece.len()));
    let mut reach = Vec::with_capacity(piece.len());
    let mut total = 0.0;
    for (row, weight) in piece.rows() {
        total += weight * square_distance(row, &first);
        reach.push(total);
    }
    if total <= 0.0 {
        return None;
    }
    let drawn = random.uniform() * total;
    let at = reach.partition_point(|sum| *sum <= drawn).min(piece.len() - 1);
    Some([first, seed(at)])
}

fn lloyd(piece: &Piece, mut means: Means, steps: usize) -> Means {
    let mut sides = vec![false; piece.len()];
    for _ in 0..steps {
        let mut changed = false;
        for (side, (row, _)) in sides.iter_mut().zip(piece.rows()) {
            let nearer = square_distance(row, &means[1]) < square_distance(row, &means[0]);
            changed |= nearer != *side;
            *side = nearer;
        }
        match means_of_sides(piece, &sides) {
            Some(next) if changed => means = next,
            _ => break,
        }
    }
    means
}

fn square_distance(row: &[f32], mean: &[f64]) -> f64 {
    row.iter().zip(mean).map(|(&f, x)| (f64::from(f) - x) * (f64::from(f) - x)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn line(values: &[f32]) -> Piece {
        Piece { width: 1, values: values.to_vec(), weights: vec![1.0; values.len()], ..Piece::default() }
    }

    #[test]
    fn two_clumps_are_found() {
        let piece = line(&[0.0, 0.1, 5.0, 5.1, 0.05]);
        let sides = two_means(&piece, &starts(&piece, 3, &mut stream(0, 0)).unwrap(), 5);
        assert!([1, 4].iter().all(|&i| sides[i] == sides[0]) && [2, 3].iter().all(|&i| sides[i] != sides[0]));
        let means = means_of_sides(&piece, &[false, false, true, true, false]).unwrap();
        assert!((means[0][0] - 0.05).abs() < 1e-7 && (means[1][0] - 5.05).abs() < 1e-6);
    }

    #[test]
    fn equal_rows_have_no_two_means() {
        assert!(starts(&line(&[2.0; 4]), 3, &mut stream(0, 0)).is_none());
        assert!(starts(&line(&[2.0]), 3, &mut stream(0, 0)).is_none());
        assert!(means_of_sides(&line(&[1.0, 2.0]), &[true, true]).is_none());
    }
}
