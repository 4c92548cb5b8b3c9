//! Height contours: lines of equal height of a raster.

use crate::cloud::Raster;
use crate::error::{Error, Result};
use crate::io::DrawnLine;
use crate::parallel::{Looks, Monitor};
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Most heights with a line.
const MOST_LEVELS: f64 = 100_000.0;
/// Largest number of a line, counted from the base: whole numbers up to it and one more are exact.
const LAST_NUMBER: f64 = (1u64 << 52) as f64;

/// Parameters of height contours, in the unit of the raster.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IsolineParams {
    /// Difference of height from one line to the next; above 0.
    pub interval: f64,
    /// A height with a line; the others lie whole intervals above and below.
    pub base: f64,
    /// Shorter lines are left out; from 0 on.
    pub min_length: f64,
}

impl Default for IsolineParams {
    /// No paper: a line every metre, and none around single bumps.
    fn default() -> Self {
        Self { interval: 1.0, base: 0.0, min_length: 5.0 }
    }
}

impl IsolineParams {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(self.interval > 0.0 && self.interval.is_finite()) {
            return Err(Error::parameter("interval", self.interval, "finite, above 0"));
        }
        if !self.base.is_finite() {
            return Err(Error::parameter("base", self.base, "finite"));
        }
        match self.min_length >= 0.0 {
            true => Ok(()),
            false => Err(Error::parameter("min_length", self.min_length, "0 or more")),
        }
    }

    /// The number of the lowest line that is not below a height.
    fn first_from(&self, height: f64) -> f64 {
        ((height - self.base) / self.interval).ceil()
    }

    /// The height of a line.
    fn height(&self, number: f64) -> f64 {
        self.base + number * self.interval
    }
}

/// A line of equal height.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Isoline {
    /// Its height.
    pub height: f64,
    /// Whether it is every fifth line, counted from the base (index contour).
    pub index: bool,
    /// Places, the higher ground to their left; of a closed line the first is not repeated at the end.
    pub vertices: Vec<[f64; 2]>,
    /// Whether it leads back to its beginning.
    pub closed: bool,
}

impl Isoline {
    /// The line in space, on the layer `contour` or `index-contour`, with the property `elevation` (rounded to 12 digits after
    /// the point, so that 0.3 is not 0.30000000000000004).
    pub fn drawn(&self) -> DrawnLine {
        let elevation = (self.height * 1e12).round() / 1e12;
        let elevation = if elevation.is_finite() { elevation } else { self.height };
        let (layer, colour) = if self.index { ("index-contour", [120, 72, 24]) } else { ("contour", [180, 130, 80]) };
        DrawnLine {
            vertices: self.vertices.iter().map(|&[x, y]| [x, y, elevation]).collect(),
            layer: layer.into(),
            closed: self.closed,
            colour,
            properties: [("elevation".into(), json!(elevation))].into_iter().collect(),
        }
    }

    /// Its length in plan.
    pub fn length(&self) -> f64 {
        let far = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let open: f64 = self.vertices.windows(2).map(|pair| far(&pair[0], &pair[1])).sum();
        match (self.closed, self.vertices.first(), self.vertices.last()) {
            (true, Some(first), Some(last)) => open + far(last, first),
            _ => open,
        }
    }
}

/// Lines of equal height (marching squares on the centres of the cells: W. E. Lorensen, H. E. Cline, *Marching cubes*,
/// SIGGRAPH 1987, doi:10.1145/37401.37422, in the plane), the lowest first; heights between the centres are linear along the
/// edges of their lattice. Lines end at holes (NaN) and at the border. Where two pairs of opposite centres differ, the mean
/// of the four decides. O(cells + vertices log vertices).
///
/// # Errors
/// If a parameter is out of range, the heights need too many lines, or the work was cancelled.
pub fn isolines(raster: &Raster, params: &IsolineParams, monitor: &Monitor) -> Result<Vec<Isoline>> {
    params.validate()?;
    let heights = || raster.values().iter().copied().filter(|height| !height.is_nan());
    let (Some(low), Some(high)) = (heights().reduce(f64::min), heights().reduce(f64::max)) else {
        return Ok(Vec::new());
    };
    let (first, end) = (params.first_from(low), params.first_from(high) + 1.0);
    if end - first > MOST_LEVELS {
        let expected = format!("an interval that gives at most {MOST_LEVELS} lines between {low} and {high}");
        return Err(Error::parameter("interval", params.interval, expected));
    }
    if first.abs().max(end.abs()) > LAST_NUMBER {
        let expected = format!("an interval and a base that count {low} to {high} in at most 2^52 lines");
        return Err(Error::parameter("interval", params.interval, expected));
    }
    let mut looks = Looks::at(monitor);
    let mut found = Vec::new();
    let levels = Levels { params, first, count: (end - first) as usize };
    let pieces = levels.pieces(raster, &mut looks)?;
    for (number, mut pieces) in pieces.into_iter().enumerate() {
        let number = first + number as f64;
        let height = params.height(number);
        looks.steps(pieces.len())?;
        for Chain { edges, closed } in chains(&mut pieces) {
            let mut vertices: Vec<_> = edges.iter().map(|&edge| crossing(raster, edge, height)).collect();
            vertices.dedup();
            if closed && vertices.len() > 1 && vertices.first() == vertices.last() {
                vertices.pop();
            }
            let line = Isoline { height, index: number % 5.0 == 0.0, vertices, closed };
            let least = if closed { 3 } else { 2 };
            if line.vertices.len() >= least && line.length() >= params.min_length {
                found.push(line);
            }
        }
    }
    Ok(found)
}

/// A piece of a line within a square of four centres, from an edge of the lattice to another one.
type Piece = [usize; 2];

/// The heights with a line between the lowest and the highest of a raster.
struct Levels<'a> {
    params: &'a IsolineParams,
    /// Number of the lowest.
    first: f64,
    count: usize,
}

impl Levels<'_> {
    /// The pieces of the lines of each level.
    fn pieces(&self, raster: &Raster, looks: &mut Looks<'_>) -> Result<Vec<Vec<Piece>>> {
        let (columns, values) = (raster.columns(), raster.values());
        let mut pieces = vec![Vec::new(); self.count];
        for row in 1..raster.rows() {
            looks.steps(columns)?;
            for column in 1..columns {
                let south_west = (row - 1) * columns + column - 1;
                let corners = [south_west, south_west + 1, south_west + columns + 1, south_west + columns];
                let square = Square { corners, heights: corners.map(|corner| values[corner]) };
                if square.heights.iter().all(|height| !height.is_nan()) {
                    self.cross(&square, &mut pieces);
                }
            }
        }
        Ok(pieces)
    }

    /// Adds the pieces of all lines through a square.
    fn cross(&self, square: &Square, pieces: &mut [Vec<Piece>]) {
        let low = square.heights.into_iter().fold(f64::INFINITY, f64::min);
        let high = square.heights.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let mut number = self.params.first_from(low);
        while self.params.height(number) <= high {
            if let Some(pieces) = pieces.get_mut((number - self.first) as usize) {
                square.cross(self.params.height(number), pieces);
            }
            number += 1.0;
        }
    }
}

/// Four neighbouring centres, counter-clockwise from the south-west.
struct Square {
    corners: [usize; 4],
    heights: [f64; 4],
}

impl Square {
    /// Adds the pieces of a line through the square.
    ///
    /// Along the border, counter-clockwise, a piece begins where the height falls below that of the line and ends where it
    /// next rises above it: so the higher ground is on its left.
    fn cross(&self, height: f64, pieces: &mut Vec<Piece>) {
        let inside = self.heights.map(|own| own >= height);
        let falls = |side: usize| inside[side] && !inside[(side + 1) % 4];
        let rises = |side: usize| !inside[side] && inside[(side + 1) % 4];
        let saddle = (0..4).filter(|&side| falls(side)).count() == 2;
        let low_middle = saddle && self.heights.iter().sum::<f64>() / 4.0 < height;
        for side in (0..4).filter(|&side| falls(side)) {
            // In a saddle whose middle is low, a piece goes round the higher corner before it.
            let step = if low_middle { 3 } else { 1 };
            let end = (1..4).map(|i| (side + i * step) % 4).find(|&side| rises(side));
            pieces.extend(end.map(|end| [self.edge(side), self.edge(end)]));
        }
    }

    /// The edge of the lattice from a corner to the next one: twice the number of its western or southern centre, and 1 more
    /// if it leads north.
    fn edge(&self, side: usize) -> usize {
        let [south_west, south_east, _, north_west] = self.corners;
        [2 * south_west, 2 * south_east + 1, 2 * north_west, 2 * south_west + 1][side]
    }
}

/// Where a line crosses an edge of the lattice.
fn crossing(raster: &Raster, edge: usize, height: f64) -> [f64; 2] {
    let (centre, north) = (edge / 2, edge % 2 == 1);
    let other = if north { centre + raster.columns() } else { centre + 1 };
    let (from, to) = (raster.values()[centre], raster.values()[other]);
    let share = (height - from) / (to - from);
    let mut at = [centre % raster.columns(), centre / raster.columns()].map(|cells| cells as f64 + 0.5);
    at[usize::from(north)] += share;
    [0, 1].map(|axis| raster.origin()[axis] + at[axis] * raster.cell())
}

/// The edges of the lattice that a line crosses; if it is closed, the first is not repeated.
struct Chain {
    edges: Vec<usize>,
    closed: bool,
}

/// Joins pieces to lines: first those with a beginning, by its edge.
fn chains(pieces: &mut [Piece]) -> Vec<Chain> {
    pieces.sort_unstable();
    let mut ends: Vec<usize> = pieces.iter().map(|piece| piece[1]).collect();
    ends.sort_unstable();
    let begins = |piece: &Piece| ends.binary_search(&piece[0]).is_err();
    let open: Vec<usize> = (0..pieces.len()).filter(|&i| begins(&pieces[i])).collect();
    let mut used = vec![false; pieces.len()];
    let mut found = Vec::new();
    for start in open.into_iter().chain(0..pieces.len()) {
        if used[start] {
            continue;
        }
        let (mut edges, mut next) = (vec![pieces[start][0]], Some(start));
        while let Some(piece) = next.filter(|&piece| !used[piece]) {
            used[piece] = true;
            edges.push(pieces[piece][1]);
            next = pieces.binary_search_by_key(&pieces[piece][1], |other| other[0]).ok();
        }
        let closed = edges.len() > 1 && edges.first() == edges.last();
        if closed {
            edges.pop();
        }
        found.push(Chain { edges, closed });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: IsolineParams = IsolineParams { interval: 1.0, base: 0.0, min_length: 0.0 };

    /// Cells of 1 with their south-west corner at 0, 0.
    fn raster(columns: usize, rows: usize, height: impl Fn(f64, f64) -> f64) -> Raster {
        let at = |i: usize| height((i % columns) as f64 + 0.5, (i / columns) as f64 + 0.5);
        Raster::new([0.0; 2], 1.0, columns, (0..columns * rows).map(at).collect()).unwrap()
    }

    fn lines(raster: &Raster, params: &IsolineParams) -> Vec<Isoline> {
        isolines(raster, params, &Monitor::default()).unwrap()
    }

    /// Twice the signed area.
    fn turn(line: &Isoline) -> f64 {
        let next = line.vertices.iter().cycle().skip(1);
        line.vertices.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
    }

    #[test]
    fn a_slope_has_straight_lines_at_equal_distances() {
        let params = IsolineParams { interval: 0.5, base: 0.25, min_length: 0.0 };
        let found = lines(&raster(20, 6, |x, _| 0.1 * x + 7.0), &params);
        assert_eq!(found.iter().map(|line| line.height).collect::<Vec<_>>(), [7.25, 7.75, 8.25, 8.75]);
        for line in &found {
            assert!(!line.closed && (line.length() - 5.0).abs() < 1e-12 && line.index == (line.height == 7.75));
            let x = (line.height - 7.0) / 0.1;
            assert!(line.vertices.iter().all(|at| (at[0] - x).abs() < 1e-9));
            // The higher ground lies in the east, the left of somebody who goes south.
            assert!(line.vertices.windows(2).all(|pair| pair[1][1] < pair[0][1]));
        }
    }

    #[test]
    fn a_cone_has_circles_and_a_pit_turns_them_round() {
        for sign in [-1.0, 1.0] {
            let found = lines(&raster(60, 60, |x, y| sign * (x - 30.2).hypot(y - 29.7)), &ALL);
            let whole: Vec<_> =
                found.iter().filter(|line| line.height.abs() < 29.0 && line.height.abs() > 1.5).collect();
            assert_eq!(whole.len(), 27);
            for line in whole {
                let radius = line.height.abs();
                assert!(line.closed && turn(line) * sign < 0.0);
                assert!((line.length() / (2.0 * std::f64::consts::PI * radius) - 1.0).abs() < 0.05);
                let off = |at: &[f64; 2]| ((at[0] - 30.2).hypot(at[1] - 29.7) - radius).abs();
                // Linear along edges of 1: the sagitta of the cone's curvature.
                assert!(line.vertices.iter().all(|at| off(at) < 0.13 / radius));
            }
        }
    }

    #[test]
    fn vertices_are_where_the_bilinear_surface_has_the_height() {
        let rough = raster(40, 30, |x, y| 3.0 * (0.37 * x).sin() + 2.0 * (0.53 * y + 0.2 * x).cos());
        let found = lines(&rough, &IsolineParams { interval: 0.3, ..ALL });
        assert!(found.len() > 30 && found.iter().any(|line| line.closed) && found.iter().any(|line| !line.closed));
        for line in &found {
            for &at in &line.vertices {
                assert!((rough.bilinear(at) - line.height).abs() < 1e-9);
            }
            let step = |pair: &[[f64; 2]]| (pair[0][0] - pair[1][0]).hypot(pair[0][1] - pair[1][1]);
            assert!(line.vertices.windows(2).all(|pair| step(pair) <= 2f64.sqrt() + 1e-9));
        }
        // Every edge of the lattice between a lower and a higher centre is crossed once.
        let crossed: usize = found.iter().map(|line| line.vertices.len()).sum();
        let over = |a: f64, b: f64| ((a.max(b) / 0.3).ceil() - (a.min(b) / 0.3).ceil()) as usize;
        let (columns, values) = (rough.columns(), rough.values());
        let east = (0..values.len()).filter(|i| i % columns + 1 < columns).map(|i| over(values[i], values[i + 1]));
        let north = (0..values.len() - columns).map(|i| over(values[i], values[i + columns]));
        assert_eq!(crossed, east.chain(north).sum::<usize>());
    }

    #[test]
    fn saddles_are_decided_by_their_middle() {
        for low in [0.0, 0.9] {
            let saddle = Raster::new([0.0; 2], 1.0, 2, vec![1.5, low, low, 1.5]).unwrap();
            let found = lines(&saddle, &ALL);
            let at_one: Vec<_> = found.iter().filter(|line| line.height == 1.0).collect();
            assert_eq!(at_one.len(), 2);
            // A low middle separates the two high corners: each line stays on the side of its corner.
            let side = |at: &[f64; 2]| at[0] + at[1] - 2.0;
            let same = |line: &&&Isoline| line.vertices.iter().all(|at| side(at) * side(&line.vertices[0]) > 0.0);
            assert_eq!(at_one.iter().filter(same).count(), if low == 0.0 { 2 } else { 0 });
        }
    }

    #[test]
    fn a_line_is_drawn_at_its_height() {
        let found = lines(&raster(9, 3, |x, _| 0.1 * x), &IsolineParams { interval: 0.1, ..ALL });
        let drawn: Vec<_> = found.iter().map(Isoline::drawn).collect();
        let of = |number: usize| drawn.iter().find(|line| line.properties["elevation"] == json!(number as f64 / 10.0));
        assert_eq!(of(3).unwrap().layer, "contour");
        let index = of(5).unwrap();
        assert_eq!((index.layer.as_str(), index.closed), ("index-contour", false));
        assert!(index.vertices.iter().all(|at| at[2] == 0.5));
    }

    #[test]
    fn flat_ground_holes_and_short_lines_give_no_lines() {
        assert!(lines(&raster(5, 5, |_, _| 2.0), &ALL).is_empty());
        assert!(lines(&raster(3, 3, |_, _| f64::NAN), &ALL).is_empty());
        assert!(lines(&raster(1, 9, |_, y| y), &ALL).is_empty());
        let slope = |x: f64, y: f64| if (x - 10.5).hypot(y - 10.5) < 3.0 { f64::NAN } else { 0.1 * x };
        let found = lines(&raster(21, 21, slope), &ALL);
        assert_eq!(found.len(), 3, "the line through the hole ends there: {found:?}");
        assert!(lines(&raster(21, 21, slope), &IsolineParams { min_length: 10.0, ..ALL }).len() == 1);
    }

    #[test]
    fn parameters_out_of_range_are_errors() {
        let slope = raster(9, 9, |x, _| x);
        for (params, name) in [
            (IsolineParams { interval: 0.0, ..ALL }, "interval"),
            (IsolineParams { interval: 1e-9, ..ALL }, "interval"),
            (IsolineParams { base: f64::NAN, ..ALL }, "base"),
            (IsolineParams { base: 1e300, ..ALL }, "2^52"),
            (IsolineParams { min_length: -1.0, ..ALL }, "min_length"),
        ] {
            let error = isolines(&slope, &params, &Monitor::default()).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        let monitor = Monitor::default();
        monitor.cancel();
        assert!(isolines(&slope, &ALL, &monitor).is_err());
    }
}
