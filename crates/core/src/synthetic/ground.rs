//! The ground outdoors: gently undulating, with a road between kerbs along x.

use super::classes;
use super::geometry::{Form, Patch, Vector, between, sub};
use super::world::World;
use crate::random::Stream;

/// Half of the width of the road, in metres.
pub(super) const ROAD: f64 = 3.5;
/// Half of the width of the street between lots: the road, and a pavement on both sides.
pub(super) const STREET: f64 = 5.5;
/// Height of a kerb.
const KERB: f64 = 0.13;
/// A height that changes over the ground: amplitude, phase, and change of phase per metre of x and y.
#[derive(Clone, Copy, Debug)]
struct Wave {
    height: f64,
    phase: f64,
    turn: [f64; 2],
}

/// The ground: strips of cells, from low to high y.
#[derive(Clone, Debug)]
pub(super) struct Ground {
    strips: Vec<Strip>,
}

#[derive(Clone, Debug)]
struct Strip {
    low: [f64; 2],
    step: [f64; 2],
    cells: [usize; 2],
    /// Heights of the nodes, row by row along x.
    heights: Vec<f64>,
    /// Surface of the first cell; the others follow row by row.
    surface: u32,
}

impl Ground {
    /// Adds ground of `extent` metres from the origin to each side, with a road along x whose kerbs are creases.
    pub(super) fn street(world: &mut World, extent: f64, random: &mut Stream) -> Self {
        let waves = [0.14, 0.1, 0.06, 0.05].map(|height| {
            let (angle, length) = (random.uniform() * std::f64::consts::TAU, 18.0 + 25.0 * random.uniform());
            let turn = [angle.cos(), angle.sin()].map(|v| v * std::f64::consts::TAU / length);
            Wave { height, phase: random.uniform() * 6.3, turn }
        });
        let height = |x: f64, y: f64| {
            // Across the street the ground is level.
            let away = ((y.abs() - STREET) / 5.0).clamp(0.0, 1.0);
            let at =
                |y: f64| waves.iter().map(|w| w.height * (w.phase + w.turn[0] * x + w.turn[1] * y).sin()).sum::<f64>();
            at(0.0) * (1.0 - away) + at(y) * away
        };
        let strips = [[-extent, -ROAD], [-ROAD, ROAD], [ROAD, extent]].map(|[low, high]| {
            let cells = [2.0 * extent, high - low].map(|size| size.ceil() as usize);
            let step = [2.0 * extent / cells[0] as f64, (high - low) / cells[1] as f64];
            let offset = if low < 0.0 && high > 0.0 { -KERB } else { 0.0 };
            let node = |i: usize| {
                let (x, y) = (i % (cells[0] + 1), i / (cells[0] + 1));
                height(-extent + x as f64 * step[0], low + y as f64 * step[1]) + offset
            };
            let heights = (0..(cells[0] + 1) * (cells[1] + 1)).map(node).collect();
            Strip { low: [-extent, low], step, cells, heights, surface: 0 }.built(world)
        });
        let ground = Self { strips: strips.into() };
        ground.kerb(world, 0, 1);
        ground.kerb(world, 2, 1);
        ground
    }

    /// Adds the kerb between a pavement and the road.
    fn kerb(&self, world: &mut World, pavement: usize, road: usize) {
        let (above, below) = (&self.strips[pavement], &self.strips[road]);
        let last = |strip: &Strip| strip.cells[1];
        let [upper, lower] = if pavement < road { [last(above), 0] } else { [0, last(below)] };
        for x in 0..above.cells[0] {
            let surface = world.surface(classes::ROAD);
            let top = [above.node(x, upper), above.node(x + 1, upper)];
            let foot = [below.node(x, lower), below.node(x + 1, lower)];
            world.polygon(&[foot[0], foot[1], top[1], top[0]], surface);
            let cell = |strip: &Strip, row: usize| strip.cell_surface([x, row.min(strip.cells[1] - 1)]);
            world.edge(top, [surface, cell(above, upper)]);
            world.edge(foot, [surface, cell(below, lower)]);
        }
    }

    fn strip(&self, y: f64) -> &Strip {
        let last = self.strips.len() - 1;
        self.strips[..last]
            .iter()
            .find(|strip| y < strip.low[1] + strip.step[1] * strip.cells[1] as f64)
            .unwrap_or(&self.strips[last])
    }

    /// Height of the ground at x, y.
    pub(super) fn height(&self, x: f64, y: f64) -> f64 {
        let strip = self.strip(y);
        let ([i, j], [u, v]) = strip.cell([x, y]);
        let z = |i: usize, j: usize| strip.heights[j * (strip.cells[0] + 1) + i];
        let (right, left) = (z(i + 1, j), z(i, j + 1));
        match u + v <= 1.0 {
            true => z(i, j) + u * (right - z(i, j)) + v * (left - z(i, j)),
            false => z(i + 1, j + 1) + (1.0 - u) * (left - z(i + 1, j + 1)) + (1.0 - v) * (right - z(i + 1, j + 1)),
        }
    }

    /// The place on the ground below or above another.
    pub(super) fn below(&self, [x, y, _]: Vector) -> Vector {
        [x, y, self.height(x, y)]
    }

    /// Adds the crease where an upright surface over the line stands on the ground, one for each flat piece of the
    /// ground. The line must not cross a kerb.
    pub(super) fn stand(&self, world: &mut World, line: [Vector; 2], surface: u32) {
        let strip = self.strip(between(line, 0.5)[1]);
        for pair in strip.cuts(line).windows(2) {
            let [x, y, _] = between(line, (pair[0] + pair[1]) / 2.0);
            let ends = [pair[0], pair[1]].map(|share| self.below(between(line, share)));
            world.edge(ends, [surface, strip.cell_surface(strip.cell([x, y]).0)]);
        }
    }
}

impl Strip {
    /// The same after its cells were added.
    fn built(mut self, world: &mut World) -> Self {
        for j in 0..self.cells[1] {
            for i in 0..self.cells[0] {
                let middle = self.low[1] + (j as f64 + 0.5) * self.step[1];
                let surface = world.surface(if middle.abs() < STREET { classes::ROAD } else { classes::GROUND });
                if [i, j] == [0, 0] {
                    self.surface = surface;
                }
                let [right, left] = [self.node(i + 1, j), self.node(i, j + 1)];
                for corner in [self.node(i, j), self.node(i + 1, j + 1)] {
                    let sides = [sub(right, corner), sub(left, corner)];
                    world.patches.push(Patch { corner, sides, form: Form::Triangle, surface });
                }
            }
        }
        self
    }

    fn node(&self, i: usize, j: usize) -> Vector {
        let [x, y] = [self.low[0] + i as f64 * self.step[0], self.low[1] + j as f64 * self.step[1]];
        [x, y, self.heights[j * (self.cells[0] + 1) + i]]
    }

    fn cell_surface(&self, [i, j]: [usize; 2]) -> u32 {
        self.surface + (j * self.cells[0] + i) as u32
    }

    /// The shares of a line at which it enters another triangle, with 0 and 1.
    fn cuts(&self, line: [Vector; 2]) -> Vec<f64> {
        let ends = line.map(|at| [0, 1].map(|a| (at[a] - self.low[a]) / self.step[a]));
        let mut cuts = vec![0.0, 1.0];
        // Triangles are bounded by whole numbers of steps along x, along y, and of both together.
        for along in [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
            let [from, to] = ends.map(|[x, y]| x * along[0] + y * along[1]);
            let whole = from.min(to).ceil() as i64..=from.max(to).floor() as i64;
            cuts.extend(whole.map(|at| (at as f64 - from) / (to - from)).filter(|share| (0.0..1.0).contains(share)));
        }
        cuts.sort_by(f64::total_cmp);
        cuts
    }

    /// The cell of a place, and its coordinates in it.
    fn cell(&self, at: [f64; 2]) -> ([usize; 2], [f64; 2]) {
        let steps = [0, 1].map(|a| (at[a] - self.low[a]) / self.step[a]);
        let cell = [0, 1].map(|a| (steps[a].max(0.0) as usize).min(self.cells[a] - 1));
        (cell, [0, 1].map(|a| steps[a] - cell[a] as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::super::geometry::Ray;
    use super::super::tree::Tree;
    use super::*;
    use crate::random::stream;

    #[test]
    fn heights_are_those_of_the_surface() {
        let mut world = World::default();
        let ground = Ground::street(&mut world, 20.0, &mut stream(1, 0));
        let tree = Tree::new(world.patches);
        let mut random = stream(2, 0);
        for _ in 0..300 {
            let [x, y] = [0; 2].map(|_| (random.uniform() - 0.5) * 39.0);
            let hit = tree.first(&Ray::new([x, y, 50.0], [0.0, 0.0, -1.0]), [0.0, 99.0]).unwrap();
            assert!((50.0 - hit.range - ground.height(x, y)).abs() < 1e-9, "{x} {y}");
        }
        assert!((ground.height(3.0, 3.6) - ground.height(3.0, 3.4) - KERB).abs() < 0.01);
    }
}
