//! Segmentation error: share of the object boundaries that a segmentation misses, in plan.

use crate::cloud::Positions;
use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor, map_watched};
use crate::segmentation::{Partition, majorities};
use serde::{Deserialize, Serialize};

/// Largest number of cells of a class image.
const LIMIT: f64 = 268_435_456.0;

/// Treatment of cells without a labelled point.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EmptyCells {
    /// Ignored: they have no boundaries.
    #[default]
    Ignored,
    /// Background of no class, as in an ordinary image: holes in the scan have boundaries in both images.
    Background,
}

/// Parameters of [`segmentation_error`].
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentationErrorParams {
    /// Edge of a raster cell, metres, above 0: about the point spacing.
    pub cell: f64,
    /// Treatment of cells without a labelled point.
    pub empty: EmptyCells,
}

impl Default for SegmentationErrorParams {
    fn default() -> Self {
        Self { cell: 0.3, empty: EmptyCells::Ignored }
    }
}

/// Boundary cells of one class.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassEdges {
    /// The class.
    pub code: u8,
    /// Number of boundary cells of the truth.
    pub reference: u64,
    /// Number of boundary cells of the result.
    pub found: u64,
    /// Number of boundary cells of both.
    pub common: u64,
    /// Share of the true boundary cells that the result does not have, 0..=1 (Eq. 10): 1 − recall.
    pub error: f64,
    /// Share of the result's boundary cells that are true, 0..=1; 0 if there are none.
    pub precision: f64,
}

/// The segmentation error of Hasanpour Zaryabi et al. 2022.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentationError {
    /// Classes that have boundaries in the truth, ascending.
    pub classes: Vec<ClassEdges>,
    /// Mean error of these classes (Eq. 11), NaN if there are none.
    pub error: f64,
    /// Mean precision of these classes, NaN if there are none.
    pub precision: f64,
}

/// A raster of classes, row after row.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassImage {
    /// Number of columns.
    pub width: usize,
    /// The class of each cell, if any.
    pub codes: Vec<Option<u8>>,
}

/// A partition of points whose classes are known.
#[derive(Clone, Copy, Debug)]
pub struct LabelledPartition<'a> {
    /// The points.
    pub points: &'a Positions,
    /// Their segments.
    pub partition: &'a Partition,
    /// True class of each point; `None` if unknown.
    pub truth: &'a [Option<u8>],
}

/// Share of the boundaries of the true classes that a partition does not have.
///
/// Hasanpour Zaryabi et al. 2022, Eq. 10 and 11. Truth and result are seen from above: each cell has the class of its
/// highest labelled point; the result's class is the most frequent true class of the segment of that point. The
/// boundary of a class B in either image is (dilate(B) − B) ∪ (B − erode(B)) with the 3 x 3 square. The error is 1 −
/// recall, so that more segments never increase it; compare the precision too. O(points + cells).
///
/// # Errors
/// If there is not one segment and one label (or `None`) a point, the cell is not above 0, or the raster would have more
/// than 2^28 cells, or the work was cancelled.
pub fn segmentation_error(
    labelled: LabelledPartition<'_>,
    params: &SegmentationErrorParams,
    monitor: &Monitor,
) -> Result<SegmentationError> {
    let LabelledPartition { points, partition, truth } = labelled;
    let majority = majorities(partition, truth)?;
    if truth.len() != points.len() {
        return Err(Error::input(format!("{} labels for {} points", truth.len(), points.len())));
    }
    let (width, top) = top_points(points, truth, params.cell, monitor)?;
    let image = |code: &(dyn Fn(usize) -> Option<u8> + Sync)| {
        let cell = |cell: usize| if top[cell] == NOTHING { None } else { code(top[cell] as usize) };
        map_watched(top.len(), monitor, cell).map(|codes| ClassImage { width, codes })
    };
    let reference = image(&|i| truth[i])?;
    let found = image(&|i| majority[partition.segments()[i] as usize].code)?;
    compare_edges(&reference, &found, params.empty, monitor)
}

const NOTHING: u32 = u32::MAX;

/// Number of columns, and the highest labelled point in each cell, the first of equally high ones.
fn top_points(points: &Positions, truth: &[Option<u8>], cell: f64, monitor: &Monitor) -> Result<(usize, Vec<u32>)> {
    let mut looks = Looks::at(monitor);
    let bad = |found: String| Error::parameter("cell", found, "metres, above 0, at most 2^28 cells in all");
    if !cell.is_finite() || cell <= 0.0 {
        return Err(bad(cell.to_string()));
    }
    let span = |axis: &[f32]| axis.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    let [(west, east), (south, north)] = [span(&points.x), span(&points.y)];
    let cells = |low: f32, high: f32| ((f64::from(high) - f64::from(low)) / cell).floor().max(0.0) + 1.0;
    let (width, height) = (cells(west, east), cells(south, north));
    // False if a coordinate is NaN, too.
    let fits = width * height <= LIMIT;
    if !fits {
        return Err(bad(format!("{cell}: {width} x {height} cells")));
    }
    let mut top = vec![NOTHING; width as usize * height as usize];
    for i in (0..points.len()).filter(|&i| truth[i].is_some()) {
        looks.step()?;
        let column = ((f64::from(points.x[i]) - f64::from(west)) / cell) as usize;
        let row = ((f64::from(points.y[i]) - f64::from(south)) / cell) as usize;
        let slot = &mut top[row * width as usize + column];
        if *slot == NOTHING || points.z[i] > points.z[*slot as usize] {
            *slot = i as u32;
        }
    }
    Ok((width as usize, top))
}

/// A set of classes.
type Codes = [u64; 4];

/// Compares the boundaries of two class images of equal size, class by class. O(cells).
///
/// # Errors
/// If the images differ in size, or the work was cancelled.
pub fn compare_edges(
    reference: &ClassImage,
    found: &ClassImage,
    empty: EmptyCells,
    monitor: &Monitor,
) -> Result<SegmentationError> {
    let mut looks = Looks::at(monitor);
    let (width, cells) = (reference.width, reference.codes.len());
    if width != found.width || cells != found.codes.len() || !cells.is_multiple_of(width.max(1)) {
        let (w, c) = (found.width, found.codes.len());
        return Err(Error::input(format!("images of {cells} cells in rows of {width}, and {c} in rows of {w}")));
    }
    let mut counts = [[0u64; 3]; 256];
    for cell in 0..cells {
        // Nine steps: the cell and its eight neighbours are read.
        looks.steps(9)?;
        let sets = [reference, found].map(|image| edges_at(image, cell, empty));
        for word in 0..4 {
            let mut left = sets[0][word] | sets[1][word];
            while left != 0 {
                let bit = left & left.wrapping_neg();
                let count = &mut counts[64 * word + left.trailing_zeros() as usize];
                let [a, b] = sets.map(|set| u64::from(set[word] & bit != 0));
                [a, b, a & b].iter().zip(count).for_each(|(one, slot)| *slot += one);
                left ^= bit;
            }
        }
    }
    let share = |part: u64, whole: u64| part as f64 / whole.max(1) as f64;
    let row = |(code, &[reference, found, common]): (u8, &[u64; 3])| ClassEdges {
        code,
        reference,
        found,
        common,
        error: share(reference - common, reference),
        precision: share(common, found),
    };
    let classes: Vec<ClassEdges> = (0..=255).zip(&counts).filter(|(_, c)| c[0] > 0).map(row).collect();
    let mean = |value: fn(&ClassEdges) -> f64| classes.iter().map(value).sum::<f64>() / classes.len() as f64;
    Ok(SegmentationError { error: mean(|c| c.error), precision: mean(|c| c.precision), classes })
}

/// The classes of whose boundary a cell is a part. Cells beyond the border of the image do not count.
fn edges_at(image: &ClassImage, cell: usize, empty: EmptyCells) -> Codes {
    let mut set = [0; 4];
    let own = image.codes[cell];
    let counts = |code: Option<u8>| code.is_some() || empty == EmptyCells::Background;
    if !counts(own) {
        return set;
    }
    let height = image.codes.len() / image.width;
    let (x, y) = (cell % image.width, cell / image.width);
    for row in y.saturating_sub(1)..(y + 2).min(height) {
        for column in x.saturating_sub(1)..(x + 2).min(image.width) {
            let other = image.codes[row * image.width + column];
            if other != own && counts(other) {
                // Outer boundary of the neighbour's class, inner boundary of the cell's own one.
                [own, other].into_iter().flatten().for_each(|c| set[usize::from(c / 64)] |= 1 << (c % 64));
            }
        }
    }
    set
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Points};
    use crate::random::stream;

    fn image(rows: &[&str]) -> ClassImage {
        let code = |c: u8| (c != b'.').then(|| c - b'0');
        ClassImage { width: rows[0].len(), codes: rows.iter().flat_map(|r| r.bytes().map(code)).collect() }
    }

    #[test]
    fn one_cell_has_a_ring_of_eight_and_itself() {
        let truth = image(&["22222", "22222", "22622", "22222", "22222"]);
        let all = compare_edges(&truth, &truth, EmptyCells::Ignored, &Monitor::default()).unwrap();
        assert_eq!(all.classes.iter().map(|c| (c.code, c.reference)).collect::<Vec<_>>(), [(2, 9), (6, 9)]);
        assert_eq!((all.error, all.precision), (0.0, 1.0));
        let lonely = image(&[".....", ".....", "..6..", ".....", "....."]);
        let count = |empty| {
            compare_edges(&lonely, &lonely, empty, &Monitor::default()).unwrap().classes.first().map(|c| c.reference)
        };
        assert_eq!((count(EmptyCells::Background), count(EmptyCells::Ignored)), (Some(9), None));
        let nothing = compare_edges(&lonely, &lonely, EmptyCells::Ignored, &Monitor::default()).unwrap();
        assert!(nothing.error.is_nan() && nothing.precision.is_nan());
    }

    #[test]
    fn edges_at_other_places_are_missed() {
        let truth = image(&["2266222222", "2266222222"]);
        let found = image(&["2222222662", "2222222662"]);
        let all = compare_edges(&truth, &found, EmptyCells::Ignored, &Monitor::default()).unwrap();
        assert_eq!((all.error, all.precision), (1.0, 0.0));
        let nothing = image(&["2222222222", "2222222222"]);
        assert_eq!(compare_edges(&truth, &nothing, EmptyCells::Ignored, &Monitor::default()).unwrap().error, 1.0);
        assert!(compare_edges(&nothing, &truth, EmptyCells::Ignored, &Monitor::default()).unwrap().classes.is_empty());
        assert!(compare_edges(&truth, &image(&["22"]), EmptyCells::Ignored, &Monitor::default()).is_err());
    }

    #[test]
    fn edges_are_those_of_dilation_and_erosion() {
        let mut s = stream(51, 0);
        let (width, height) = (13, 11);
        let mut random = || {
            let code = |v: usize| (v > 0).then_some(v as u8);
            ClassImage { width, codes: (0..width * height).map(|_| code(s.below(4))).collect() }
        };
        for _ in 0..20 {
            let (truth, found) = (random(), random());
            let all = compare_edges(&truth, &found, EmptyCells::Background, &Monitor::default()).unwrap();
            for class in all.classes {
                let edges = |image: &ClassImage| -> Vec<bool> {
                    let inside = |x: i64, y: i64| {
                        let there = (0..width as i64).contains(&x) && (0..height as i64).contains(&y);
                        there.then(|| image.codes[y as usize * width + x as usize] == Some(class.code))
                    };
                    let around = |x: i64, y: i64| (-1..2).flat_map(move |a| (-1..2).map(move |b| (x + a, y + b)));
                    let cells = (0..height as i64).flat_map(|y| (0..width as i64).map(move |x| (x, y)));
                    let dilated = |x, y| around(x, y).any(|(x, y)| inside(x, y) == Some(true));
                    let eroded = |x, y| around(x, y).all(|(x, y)| inside(x, y) != Some(false));
                    cells.map(|(x, y)| dilated(x, y) && !eroded(x, y)).collect()
                };
                let (a, b) = (edges(&truth), edges(&found));
                let count = |keep: &dyn Fn(usize) -> bool| (0..a.len()).filter(|&i| keep(i)).count() as u64;
                assert_eq!(class.reference, count(&|i| a[i]));
                assert_eq!((class.found, class.common), (count(&|i| b[i]), count(&|i| a[i] && b[i])));
            }
        }
    }

    #[test]
    fn segments_take_the_majority_and_the_highest_point_is_seen() {
        // Two by three cells; the last one holds a low point of another class below.
        let rows = [[0.5, 0.5, 0.0], [1.5, 0.5, 0.0], [2.5, 0.5, 9.0], [2.5, 0.5, 1.0], [0.5, 1.5, 0.0]];
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0).positions;
        let truth = [Some(2), Some(2), Some(6), Some(2), None];
        let params = SegmentationErrorParams { cell: 1.0, ..Default::default() };
        let error = |labels: &[u32]| {
            let partition = Partition::from_labels(labels).unwrap();
            segmentation_error(
                LabelledPartition { points: &points, partition: &partition, truth: &truth },
                &params,
                &Monitor::default(),
            )
            .unwrap()
        };
        assert_eq!((error(&[0, 0, 1, 0, 0]).error, error(&[0, 1, 2, 3, 4]).error), (0.0, 0.0));
        assert_eq!(error(&[0, 0, 0, 0, 0]).error, 1.0);
        assert_eq!(error(&[0, 0, 1, 0, 0]).classes[0].reference, 2);
        let partition = Partition::from_labels(&[0; 5]).unwrap();
        for cell in [0.0, f64::NAN, 1e-9] {
            let params = SegmentationErrorParams { cell, ..Default::default() };
            assert!(
                segmentation_error(
                    LabelledPartition { points: &points, partition: &partition, truth: &truth },
                    &params,
                    &Monitor::default()
                )
                .is_err()
            );
        }
    }
}
