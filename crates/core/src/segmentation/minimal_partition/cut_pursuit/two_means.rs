//! Initialisation of a split: 2-means by k-means++ and Lloyd iterations.

use super::super::regions::weighted_mean;
use super::piece::Piece;
use crate::error::Result;
use crate::parallel::{Looks, Monitor};
use crate::random::Stream;

/// The two means of a cut.
pub(super) type Means = [Vec<f64>; 2];

/// Random starts of 2-means (D. Arthur, S. Vassilvitskii, *k-means++*, SODA 2007); nothing if all rows are equal.
/// O(restarts · n · width).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn starts(
    piece: &Piece,
    restarts: usize,
    random: &mut Stream,
    monitor: &Monitor,
) -> Result<Option<Vec<Means>>> {
    (0..restarts).map(|_| seeds(piece, random, monitor).transpose()).collect::<Option<Result<_>>>().transpose()
}

/// The better side of each node in the best of several 2-means with these starts. O(starts · steps · n · width).
///
/// # Errors
/// If the work was cancelled.
pub(super) fn two_means(piece: &Piece, starts: &[Means], steps: usize, monitor: &Monitor) -> Result<Vec<bool>> {
    let mut looks = Looks::at(monitor);
    let mut best: (f64, Vec<bool>) = (f64::INFINITY, vec![false; piece.len()]);
    for start in starts {
        let means = lloyd(piece, start.clone(), steps, monitor)?;
        let mut inertia = 0.0;
        let mut sides = Vec::with_capacity(piece.len());
        for (row, weight) in piece.rows() {
            looks.step()?;
            let [a, b] = means.each_ref().map(|mean| square_distance(row, mean));
            inertia += weight * a.min(b);
            sides.push(b < a);
        }
        if inertia < best.0 {
            best = (inertia, sides);
        }
    }
    Ok(best.1)
}

/// Means of both sides; nothing if one side is empty.
///
/// # Errors
/// If the work was cancelled.
pub(super) fn means_of_sides(piece: &Piece, sides: &[bool], monitor: &Monitor) -> Result<Option<Means>> {
    let mut looks = Looks::at(monitor);
    let mut means = [false, true].map(|_| vec![0.0; piece.width]);
    let mut both = true;
    for (side, mean) in [false, true].into_iter().zip(&mut means) {
        let rows = piece.rows().zip(sides).filter(|(_, s)| **s == side).map(|(row, _)| row);
        both &= weighted_mean(rows, mean, &mut looks)? > 0.0;
    }
    Ok(both.then_some(means))
}

/// First seed uniform, second with probability proportional to m ‖f − first‖².
fn seeds(piece: &Piece, random: &mut Stream, monitor: &Monitor) -> Result<Option<Means>> {
    if piece.len() < 2 {
        return Ok(None);
    }
    let mut looks = Looks::at(monitor);
    let seed = |at: usize| piece.values[at * piece.width..][..piece.width].iter().map(|&f| f64::from(f)).collect();
    let first: Vec<f64> = seed(random.below(piece.len()));
    let mut reach = Vec::with_capacity(piece.len());
    let mut total = 0.0;
    for (row, weight) in piece.rows() {
        looks.step()?;
        total += weight * square_distance(row, &first);
        reach.push(total);
    }
    if total <= 0.0 {
        return Ok(None);
    }
    let drawn = random.uniform() * total;
    let at = reach.partition_point(|sum| *sum <= drawn).min(piece.len() - 1);
    Ok(Some([first, seed(at)]))
}

fn lloyd(piece: &Piece, mut means: Means, steps: usize, monitor: &Monitor) -> Result<Means> {
    let mut looks = Looks::at(monitor);
    let mut sides = vec![false; piece.len()];
    for _ in 0..steps {
        let mut changed = false;
        for (side, (row, _)) in sides.iter_mut().zip(piece.rows()) {
            looks.step()?;
            let nearer = square_distance(row, &means[1]) < square_distance(row, &means[0]);
            changed |= nearer != *side;
            *side = nearer;
        }
        match means_of_sides(piece, &sides, monitor)? {
            Some(next) if changed => means = next,
            _ => break,
        }
    }
    Ok(means)
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
        let monitor = Monitor::default();
        let begin = starts(&piece, 3, &mut stream(0, 0), &monitor).unwrap().unwrap();
        let sides = two_means(&piece, &begin, 5, &monitor).unwrap();
        assert!([1, 4].iter().all(|&i| sides[i] == sides[0]) && [2, 3].iter().all(|&i| sides[i] != sides[0]));
        let means = means_of_sides(&piece, &[false, false, true, true, false], &monitor).unwrap().unwrap();
        assert!((means[0][0] - 0.05).abs() < 1e-7 && (means[1][0] - 5.05).abs() < 1e-6);
    }

    #[test]
    fn equal_rows_have_no_two_means() {
        let monitor = Monitor::default();
        for values in [&[2.0; 4][..], &[2.0]] {
            assert!(starts(&line(values), 3, &mut stream(0, 0), &monitor).unwrap().is_none());
        }
        assert!(means_of_sides(&line(&[1.0, 2.0]), &[true, true], &monitor).unwrap().is_none());
    }
}
