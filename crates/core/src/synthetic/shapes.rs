//! Shapes that scenes are made of: walls with openings, round bodies, cars, trees, hedges.

use super::classes;
use super::geometry::{Form, Patch, Vector, add, scaled, unit};
use super::world::{Block, Frame, Leaves, Solid, World};
use crate::random::Stream;

/// Flat sides of a round body; less than 30 degrees from one to the next, so that none of them is a crease.
const SIDES: usize = 24;

/// Least radius of a body whose rim is a crease; that of a pole is not seen as one.
const THIN: f64 = 0.15;

/// A window or door that is set back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opening {
    /// From and to along the wall, in metres from its start.
    pub(super) along: [f64; 2],
    /// Lowest and highest z.
    pub(super) up: [f64; 2],
    pub(super) depth: f64,
}

/// An upright wall over a line.
#[derive(Clone, Debug)]
pub(super) struct Wall {
    /// Start and end; z is not used.
    pub(super) line: [Vector; 2],
    /// Lowest and highest z.
    pub(super) up: [f64; 2],
    /// The direction in which its openings are set back.
    pub(super) back: Vector,
    /// Openings that do not overlap. One that starts at the lowest z goes down to the floor.
    pub(super) openings: Vec<Opening>,
    pub(super) class: u8,
    /// A flat floor that the wall stands on, which goes on into its doors.
    pub(super) floor: Option<u32>,
}

impl Wall {
    fn size(&self) -> f64 {
        let [a, b] = self.line;
        (b[0] - a[0]).hypot(b[1] - a[1])
    }

    /// The place at a length, height and depth.
    fn place(&self, along: f64, up: f64, depth: f64) -> Vector {
        let [a, b] = self.line;
        let ahead = unit([b[0] - a[0], b[1] - a[1], 0.0]);
        let [x, y, _] = add(add(a, scaled(ahead, along)), scaled(self.back, depth));
        [x, y, up]
    }

    /// Adds the wall with its openings, and the creases in and around them; those at its own sides are added by the
    /// caller, except with a floor. Returns its surface.
    pub(super) fn build(&self, world: &mut World, frame: &Frame) -> u32 {
        let surface = world.surface(self.class);
        let breaks = |own: [f64; 2], of: fn(&Opening) -> [f64; 2]| {
            let mut all: Vec<f64> = self.openings.iter().flat_map(of).chain(own).collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            all
        };
        let (columns, rows) = (breaks([0.0, self.size()], |o| o.along), breaks(self.up, |o| o.up));
        for s in columns.windows(2) {
            for z in rows.windows(2) {
                let [s_middle, z_middle] = [(s[0] + s[1]) / 2.0, (z[0] + z[1]) / 2.0];
                let holds = |[low, high]: [f64; 2], value: f64| low < value && value < high;
                if !self.openings.iter().any(|o| holds(o.along, s_middle) && holds(o.up, z_middle)) {
                    let corners = [[s[0], z[0]], [s[1], z[0]], [s[1], z[1]], [s[0], z[1]]];
                    world.polygon(&corners.map(|[s, z]| frame.place(self.place(s, z, 0.0))), surface);
                }
            }
            let door = |o: &&Opening| o.up[0] <= self.up[0] && o.along[0] < s[1] && s[0] < o.along[1];
            if let Some(floor) = self.floor.filter(|_| self.openings.iter().find(door).is_none()) {
                world.edge([0, 1].map(|i| frame.place(self.place(s[i], self.up[0], 0.0))), [surface, floor]);
            }
        }
        self.openings.iter().for_each(|opening| self.open(world, frame, surface, opening));
        surface
    }

    fn open(&self, world: &mut World, frame: &Frame, wall: u32, opening: &Opening) {
        let Opening { along: [s0, s1], up: [z0, z1], depth } = *opening;
        let ring = [[s0, z0], [s1, z0], [s1, z1], [s0, z1]];
        let [front, rear] = [0.0, depth].map(|depth| ring.map(|[s, z]| frame.place(self.place(s, z, depth))));
        let pane = world.surface(self.class);
        world.polygon(&rear, pane);
        // The lower, right, upper and left side of the recess.
        let open = z0 <= self.up[0];
        let floor = self.floor.filter(|_| open);
        let sides: Vec<Option<u32>> =
            (0..4).map(|i| if open && i == 0 { floor } else { Some(world.surface(self.class)) }).collect();
        for (i, side) in sides.iter().enumerate() {
            let next = (i + 1) % 4;
            let Some(side) = *side else { continue };
            world.edge([rear[i], rear[next]], [pane, side]);
            if !(open && i == 0) {
                world.polygon(&[front[i], front[next], rear[next], rear[i]], side);
                world.edge([front[i], front[next]], [wall, side]);
            }
            if let Some(other) = sides[next] {
                world.edge([front[next], rear[next]], [side, other]);
            }
        }
    }
}

/// An upright cylinder.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cylinder {
    pub(super) centre: [f64; 2],
    pub(super) radius: f64,
    /// Lowest and highest z.
    pub(super) up: [f64; 2],
    pub(super) class: u8,
    /// Whether it is closed at the top.
    pub(super) lid: bool,
}

impl Cylinder {
    /// The lines around it at a height, in the frame.
    pub(super) fn ring(&self, z: f64) -> Vec<[Vector; 2]> {
        let at = |i: usize| {
            let angle = std::f64::consts::TAU * (i % SIDES) as f64 / SIDES as f64;
            [self.centre[0] + self.radius * angle.cos(), self.centre[1] + self.radius * angle.sin(), z]
        };
        (0..SIDES).map(|i| [at(i), at(i + 1)]).collect()
    }

    /// Adds the cylinder, and the crease at its lid. Returns the surface of its side.
    pub(super) fn build(&self, world: &mut World, frame: &Frame) -> u32 {
        let side = world.surface(self.class);
        let [low, high] =
            self.up.map(|z| self.ring(z).into_iter().map(|line| line.map(|at| frame.place(at))).collect::<Vec<_>>());
        for (l, h) in low.iter().zip(&high) {
            world.polygon(&[l[0], l[1], h[1], h[0]], side);
        }
        if self.lid {
            let top = world.surface(self.class);
            let corners: Vec<Vector> = high.iter().map(|line| line[0]).collect();
            world.polygon(&corners, top);
            if self.radius >= THIN {
                high.iter().for_each(|&line| world.edge(line, [side, top]));
            }
        }
        side
    }
}

/// A body with the profile of an arc in x and z, from the lowest to the highest x.
fn arch([low, high]: [Vector; 2], class: u8) -> Solid {
    let arc = |i: usize| {
        let share = i as f64 / 12.0;
        // An arc that turns by 110 degrees in all.
        let angle = (share - 0.5) * 1.92;
        let (x, z) =
            (0.5 + angle.sin() / (2.0 * f64::sin(0.96)), (angle.cos() - f64::cos(0.96)) / (1.0 - f64::cos(0.96)));
        [low[0] + x * (high[0] - low[0]), low[2] + z * (high[2] - low[2])]
    };
    let corners = (0..26).map(|i| {
        let [x, z] = arc(i % 13);
        [x, if i < 13 { low[1] } else { high[1] }, z]
    });
    let mut faces: Vec<Vec<usize>> = (0..12).map(|i| vec![i, i + 1, i + 14, i + 13]).collect();
    faces.push((0..13).rev().collect());
    faces.push((13..26).collect());
    Solid { corners: corners.collect(), faces, class }
}

/// Adds a car: a box with a rounded top, on wheels. Its frame lies on the ground below its middle, x ahead.
pub(super) fn car(world: &mut World, frame: &Frame, random: &mut Stream) {
    let half = [1.9 + 0.5 * random.uniform(), 0.82 + 0.12 * random.uniform()];
    let waist = 0.75 + 0.25 * random.uniform();
    let class = classes::VEHICLE;
    let body = Block { low: [-half[0], -half[1], 0.25], high: [half[0], half[1], waist], class, open: [false, true] };
    let sides = body.build(world, frame);
    let top = world.surface(class);
    let corners = body.foot(1).map(|line| frame.place(line[0]));
    world.polygon(&corners, top);
    for (line, &side) in body.foot(1).into_iter().zip(&sides) {
        world.edge(line.map(|at| frame.place(at)), [side, top]);
    }
    let cabin =
        [[-half[0] * 0.7, 0.1 - half[1], waist], [half[0] * 0.5, half[1] - 0.1, waist + 0.5 + 0.2 * random.uniform()]];
    let surfaces = world.solid(&arch(cabin, class), frame);
    let [low, high] = cabin;
    let foot = |x: [f64; 2], y: [f64; 2]| [0, 1].map(|i| frame.place([x[i], y[i], waist]));
    let (x, y) = ([low[0], high[0]], [low[1], high[1]]);
    let lines = [foot([x[0]; 2], y), foot([x[1]; 2], y), foot(x, [y[0]; 2]), foot(x, [y[1]; 2])];
    for (line, face) in lines.into_iter().zip([0, 11, 12, 13]) {
        world.edge(line, [surfaces[face], top]);
    }
    let wheels = world.surface(class);
    for place in [[-1.2, -1.0], [-1.2, 1.0], [1.2, -1.0], [1.2, 1.0]] {
        let corner = frame.place([place[0], place[1] * (half[1] - 0.05), 0.3]);
        let sides = [frame.direction([0.3, 0.0, 0.0]), [0.0, 0.0, 0.3]];
        world.patches.push(Patch { corner, sides, form: Form::Disc, surface: wheels });
    }
}

/// Adds a tree: a trunk, and leaves in a few balls. Its frame lies on the ground.
pub(super) fn tree(world: &mut World, frame: &Frame, random: &mut Stream) {
    let height = 2.2 + 3.0 * random.uniform();
    let radius = 0.08 + 0.14 * random.uniform();
    let class = classes::VEGETATION;
    Cylinder { centre: [0.0; 2], radius, up: [-0.5, height + 0.5], class, lid: false }.build(world, frame);
    let reach = 0.9 + 0.9 * random.uniform();
    let balls: Vec<Vector> = (0..4)
        .map(|_| [0, 1, 2].map(|a| random.normal() * reach * 0.45 + if a == 2 { height + reach } else { 0.0 }))
        .collect();
    Leaves { count: 1400, radius: 0.09, class }.build(world, random, |random| {
        let ball = balls[random.below(balls.len())];
        let direction = unit([random.normal(), random.normal(), random.normal()]);
        frame.place(add(ball, scaled(direction, reach * random.uniform().powf(0.4))))
    });
}

/// Adds a hedge over a box whose lowest z is on the ground.
pub(super) fn hedge(world: &mut World, frame: &Frame, size: Vector, random: &mut Stream) {
    let count = (350.0 * size[0] * size[1] * size[2]).clamp(200.0, 3000.0) as usize;
    Leaves { count, radius: 0.07, class: classes::VEGETATION }.build(world, random, |random| {
        let mut at = [0, 1, 2].map(|a| random.uniform() * size[a]);
        at[1] = size[1] * (0.5 + 0.5 * (at[1] / size[1] * 2.0 - 1.0).cbrt());
        at[2] += 0.06 * random.normal();
        frame.place(at)
    });
}

/// Adds a ball: facets that are no creases.
pub(super) fn ball(world: &mut World, frame: &Frame, radius: f64, class: u8) {
    let surface = world.surface(class);
    let at = |i: usize, j: usize| {
        let [around, up] = [i % SIDES, j].map(|v| std::f64::consts::TAU * v as f64 / SIDES as f64);
        frame.place([radius * up.sin() * around.cos(), radius * up.sin() * around.sin(), radius - radius * up.cos()])
    };
    for j in 0..SIDES / 2 {
        for i in 0..SIDES {
            world.polygon(&[at(i, j), at(i + 1, j), at(i + 1, j + 1)], surface);
            world.polygon(&[at(i, j), at(i + 1, j + 1), at(i, j + 1)], surface);
        }
    }
}
