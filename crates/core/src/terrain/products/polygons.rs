//! Polygons from the border of an α-shape.

use crate::terrain::alpha_shape::Place;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// The corners of a closed line; the inside is on its left.
pub(super) type Ring = Vec<Place>;

/// An outer ring (counter-clockwise) and its holes (clockwise).
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Polygon {
    pub(super) rings: Vec<Ring>,
}

impl Polygon {
    /// Area without the holes.
    pub(super) fn area(&self) -> f64 {
        self.rings.iter().map(area).sum()
    }

    /// Closes the holes of a smaller area.
    pub(super) fn close_holes(&mut self, least: f64) {
        let mut first = true;
        self.rings.retain(|ring| std::mem::take(&mut first) || area(ring).abs() >= least);
    }

    /// Whether a position is inside: a ray to the east crosses the rings an odd number of times.
    pub(super) fn holds(&self, at: Place) -> bool {
        self.rings.iter().filter(|ring| within(ring, at)).count() % 2 == 1
    }
}

/// A position as a key.
pub(super) fn key(at: Place) -> [u64; 2] {
    // Adding 0 makes -0 and 0 equal.
    at.map(|v| (v + 0.0).to_bits())
}

/// The polygons whose border consists of these edges (inside on the left), largest outer ring first, without holes of a
/// smaller area.
pub(super) fn polygons(border: &[[Place; 2]], least_hole: f64) -> Vec<Polygon> {
    let rings = rings(border).into_iter().map(|ring| (area(&ring), ring));
    let (mut outer, holes): (Vec<_>, Vec<_>) =
        rings.filter(|(area, _)| *area > 0.0 || -area >= least_hole).partition(|(a, _)| *a > 0.0);
    outer.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut polygons: Vec<Polygon> = outer.into_iter().map(|(_, ring)| Polygon { rings: vec![ring] }).collect();
    for (_, hole) in holes {
        let middle = [0, 1].map(|a| 0.5 * (hole[0][a] + hole[1][a]));
        // The smallest that contains it.
        if let Some(polygon) = polygons.iter_mut().rev().find(|polygon| within(&polygon.rings[0], middle)) {
            polygon.rings.push(hole);
        }
    }
    polygons
}

/// Follows the edges until they are closed. A ring that meets itself at a corner is divided there.
fn rings(border: &[[Place; 2]]) -> Vec<Ring> {
    let mut leaving: HashMap<[u64; 2], Vec<usize>> = HashMap::new();
    border.iter().enumerate().for_each(|(edge, [from, _])| leaving.entry(key(*from)).or_default().push(edge));
    let mut rings = Vec::new();
    let mut used = vec![false; border.len()];
    for start in 0..border.len() {
        let (mut path, mut places, mut next) = (Vec::new(), HashMap::new(), Some(start).filter(|&e| !used[e]));
        while let Some(edge) = next {
            used[edge] = true;
            places.insert(key(border[edge][0]), path.len());
            path.push(edge);
            let end = key(border[edge][1]);
            if let Some(&first) = places.get(&end) {
                let ring: Ring = path.drain(first..).map(|edge| border[edge][0]).collect();
                for &corner in &ring {
                    places.remove(&key(corner));
                }
                rings.push(ring);
            }
            next = path.last().and_then(|&last| turn(border, last, leaving.get(&end)?.iter().filter(|&&e| !used[e])));
        }
    }
    rings
}

/// Of the edges that leave the end of an edge the one that encloses the same inside: the first clockwise from the way back.
fn turn<'a>(border: &[[Place; 2]], edge: usize, leaving: impl Iterator<Item = &'a usize>) -> Option<usize> {
    let direction = |from: Place, to: Place| (to[1] - from[1]).atan2(to[0] - from[0]);
    let back = direction(border[edge][1], border[edge][0]);
    let clockwise = |&&e: &&usize| (back - direction(border[e][0], border[e][1])).rem_euclid(TAU);
    leaving.min_by(|a, b| clockwise(a).total_cmp(&clockwise(b))).copied()
}

/// Area, negative if the ring is clockwise.
pub(super) fn area(ring: &Ring) -> f64 {
    let next = |i: usize| ring[(i + 1) % ring.len()];
    // Relative to a corner, which keeps the products small.
    let local = |p: Place| [p[0] - ring[0][0], p[1] - ring[0][1]];
    let cross = |[a, b]: [Place; 2]| a[0] * b[1] - b[0] * a[1];
    0.5 * (0..ring.len()).map(|i| cross([local(ring[i]), local(next(i))])).sum::<f64>()
}

/// Whether a ray to the east from there crosses the ring an odd number of times.
fn within(ring: &Ring, at: Place) -> bool {
    let crosses = |i: usize| {
        let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
        let east = || a[0] + (at[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > at[0];
        (a[1] <= at[1]) != (b[1] <= at[1]) && east()
    };
    (0..ring.len()).filter(|&i| crosses(i)).count() % 2 == 1
}

/// Whether two sides of the rings cross. O(sides²).
pub(super) fn crossing(rings: &[Ring]) -> bool {
    let sides: Vec<[Place; 2]> =
        rings.iter().flat_map(|ring| (0..ring.len()).map(move |i| [ring[i], ring[(i + 1) % ring.len()]])).collect();
    let side = |[a, b]: [Place; 2], p: Place| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let apart = |s: [Place; 2], t: [Place; 2]| side(s, t[0]) * side(s, t[1]) >= 0.0;
    let far = |s: &[Place; 2], t: &[Place; 2], a: usize| {
        s[0][a].max(s[1][a]) < t[0][a].min(t[1][a]) || t[0][a].max(t[1][a]) < s[0][a].min(s[1][a])
    };
    let cross = |s: &[Place; 2], t: &[Place; 2]| !far(s, t, 0) && !far(s, t, 1) && !apart(*s, *t) && !apart(*t, *s);
    sides.iter().enumerate().any(|(i, s)| sides[i + 1..].iter().any(|t| cross(s, t)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edges around cells (lower left corners) of a unit grid, as an α-shape would have them.
    fn border(cells: &[[i32; 2]]) -> Vec<[Place; 2]> {
        let has = |x: i32, y: i32| cells.contains(&[x, y]);
        let place = |x: i32, y: i32| [f64::from(x), f64::from(y)];
        let mut edges = Vec::new();
        for &[x, y] in cells {
            let sides = [[x, y, x + 1, y], [x + 1, y, x + 1, y + 1], [x + 1, y + 1, x, y + 1], [x, y + 1, x, y]];
            let beside = [has(x, y - 1), has(x + 1, y), has(x, y + 1), has(x - 1, y)];
            let open = sides.iter().zip(beside).filter(|(_, beside)| !beside);
            edges.extend(open.map(|(s, _)| [place(s[0], s[1]), place(s[2], s[3])]));
        }
        edges
    }

    fn areas(cells: &[[i32; 2]]) -> Vec<Vec<f64>> {
        let found = polygons(&border(cells), 0.0);
        assert!(found.iter().all(|p| !crossing(&p.rings)));
        found.iter().map(|p| p.rings.iter().map(area).collect()).collect()
    }

    #[test]
    fn rings_are_outlines_and_holes() {
        let ring: Vec<[i32; 2]> = (0..9).filter(|&i| i != 4).map(|i| [i % 3, i / 3]).collect();
        assert_eq!(areas(&ring), [[9.0, -1.0]]);
        assert_eq!(areas(&[[0, 0], [5, 5], [6, 5]]), [[2.0], [1.0]]);
        let island = [
            ring.iter().map(|&[x, y]| [x + 2, y + 2]).collect(),
            (0..49)
                .filter(|&i| i % 7 == 0 || i % 7 == 6 || i / 7 == 0 || i / 7 == 6)
                .map(|i| [i % 7, i / 7])
                .collect::<Vec<_>>(),
        ]
        .concat();
        assert_eq!(areas(&island), [vec![49.0, -25.0], vec![9.0, -1.0]]);
    }

    #[test]
    fn what_only_touches_at_a_corner_is_divided_there() {
        assert_eq!(areas(&[[0, 0], [1, 1]]), [[1.0], [1.0]]);
        // A hole that touches the outside at a corner.
        let cells = [[0, 0], [1, 0], [2, 0], [0, 1], [2, 1], [0, 2], [1, 2]];
        let found = areas(&cells);
        assert_eq!(found.concat().iter().sum::<f64>(), 7.0);
        assert_eq!(found, [[8.0, -1.0]]);
    }

    #[test]
    fn positions_inside_are_told_from_those_outside() {
        let ring: Vec<[i32; 2]> = (0..9).filter(|&i| i != 4).map(|i| [i % 3, i / 3]).collect();
        let found = &polygons(&border(&ring), 0.5)[0];
        assert!(found.holds([0.5, 1.5]) && !found.holds([1.5, 1.5]) && !found.holds([3.5, 1.5]));
        assert_eq!(polygons(&border(&ring), 2.0)[0].rings.len(), 1);
        let mut open = found.clone();
        open.close_holes(2.0);
        assert_eq!((open.rings.len(), open.area(), found.rings.len()), (1, 9.0, 2));
        let bow = vec![vec![[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]]];
        assert!(crossing(&bow));
    }
}
