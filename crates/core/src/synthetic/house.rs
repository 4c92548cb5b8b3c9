//! Houses: walls with windows and a door, and a roof that overhangs them.

use super::classes::BUILDING;
use super::geometry::{Vector, add, sub, unit};
use super::ground::Ground;
use super::shapes::{Opening, Wall};
use super::world::{Block, Frame, Solid, World};
use crate::random::Stream;

/// Thickness of a roof, measured upright.
const THICKNESS: f64 = 0.18;

/// Kind of a roof.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Roof {
    Gable,
    Hip,
    Flat,
}

/// A house; the ridge runs along x, the door is at low y.
#[derive(Clone, Copy, Debug)]
pub(super) struct House {
    /// Size along x and y; x is not less than y.
    pub(super) size: [f64; 2],
    /// Height of the walls.
    pub(super) wall: f64,
    pub(super) roof: Roof,
    /// Rise of the roof per metre.
    pub(super) slope: f64,
    pub(super) overhang: f64,
}

impl House {
    /// A house of random size.
    pub(super) fn random(random: &mut Stream) -> Self {
        let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
        let depth = between(5.0, 8.0);
        let size = [between(depth, 10.5), depth];
        let (slope, overhang) = (between(25f64, 45.0).to_radians().tan(), between(0.15, 0.6));
        let storeys = between(1.0, 3.0).floor();
        let wall = storeys * 2.8 + between(0.1, 0.5);
        let roof = [Roof::Gable, Roof::Gable, Roof::Hip, Roof::Flat][random.below(4)];
        Self { size, wall, roof, slope, overhang }
    }

    /// The corners of the walls, counter-clockwise from low x and y, at a height.
    fn corners(&self, z: f64) -> [Vector; 4] {
        let [x, y] = self.size.map(|size| size / 2.0);
        [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]]
    }

    /// Adds the house at a frame on the ground; it is raised until all its corners are above the ground.
    pub(super) fn build(&self, world: &mut World, ground: &Ground, frame: &Frame, random: &mut Stream) {
        let place = frame.place([0.0; 3]);
        let heights = self.corners(0.0).map(|at| ground.below(frame.place(at))[2]);
        let frame = &frame.inner([0.0, 0.0, heights.into_iter().fold(f64::MIN, f64::max) + 0.06 - place[2]], 0.0);
        let corners = self.corners(0.0);
        let walls: Vec<u32> = (0..4)
            .map(|i| {
                let line = [corners[i], corners[(i + 1) % 4]];
                let along = unit(sub(line[1], line[0]));
                let openings = self.openings(self.size[i % 2], i == 0, random);
                let wall = Wall {
                    line,
                    up: [-1.5, self.wall],
                    back: [-along[1], along[0], 0.0],
                    openings,
                    class: BUILDING,
                    floor: None,
                };
                let surface = wall.build(world, frame);
                ground.stand(world, line.map(|at| frame.place(at)), surface);
                surface
            })
            .collect();
        for i in 0..4 {
            let [foot, top] = [corners[i], [corners[i][0], corners[i][1], self.wall]].map(|at| frame.place(at));
            world.edge([ground.below(foot), top], [walls[(i + 3) % 4], walls[i]]);
        }
        match self.roof {
            Roof::Gable => self.gable(world, frame, &walls, random),
            Roof::Hip => self.hip(world, frame, &walls),
            Roof::Flat => self.flat(world, frame, &walls),
        }
    }

    /// Windows of each storey, one of them a door.
    fn openings(&self, length: f64, front: bool, random: &mut Stream) -> Vec<Opening> {
        let count = ((length - 0.6) / 2.2).floor().max(1.0);
        let (depth, width) = (0.08 + 0.14 * random.uniform(), 0.8 + 0.7 * random.uniform());
        let storeys = (self.wall / 2.8).floor().max(1.0) as usize;
        let door = random.below(count as usize);
        let mut openings = Vec::new();
        for storey in 0..storeys {
            for i in 0..count as usize {
                let middle = length * (i as f64 + 0.5) / count;
                let along = [middle - width / 2.0, middle + width / 2.0];
                let base = 2.8 * storey as f64;
                if front && storey == 0 && i == door {
                    openings.push(Opening { along, up: [0.05, 2.1], depth: depth + 0.05 });
                } else if random.uniform() < 0.75 {
                    openings.push(Opening { along, up: [base + 0.9, base + 2.2], depth });
                }
            }
        }
        openings
    }

    fn gable(&self, world: &mut World, frame: &Frame, walls: &[u32], random: &mut Stream) {
        let [x, y] = self.size.map(|size| size / 2.0);
        let under = |at: f64| self.wall + self.slope * (y - at.abs());
        let (end, eave) = (x + self.overhang, y + self.overhang);
        let profile = [[-eave, 0.0], [-eave, THICKNESS], [0.0, THICKNESS], [eave, THICKNESS], [eave, 0.0], [0.0, 0.0]];
        let corners = [-end, end].into_iter().flat_map(|x| profile.map(|[y, up]| [x, y, under(y) + up])).collect();
        let faces = [[1, 2, 8, 7], [2, 3, 9, 8], [0, 1, 7, 6], [3, 4, 10, 9], [5, 0, 6, 11], [4, 5, 11, 10]];
        let caps = [[0, 5, 2, 1], [5, 4, 3, 2], [6, 7, 8, 11], [11, 8, 9, 10]];
        let faces = faces.into_iter().chain(caps).map(Vec::from).collect();
        let roof = world.solid(&Solid { corners, faces, class: BUILDING }, frame);
        let [low, high] = [4, 5].map(|face: usize| roof[face]);
        let at = |x: f64, y: f64| frame.place([x, y, under(y)]);
        world.edge([at(-x, -y), at(x, -y)], [walls[0], low]);
        world.edge([at(-x, y), at(x, y)], [walls[2], high]);
        for (x, wall) in [(x, walls[1]), (-x, walls[3])] {
            world.polygon(&[at(x, -y), at(x, y), at(x, 0.0)], wall);
            world.edge([at(x, -y), at(x, 0.0)], [wall, low]);
            world.edge([at(x, y), at(x, 0.0)], [wall, high]);
        }
        if random.uniform() < 0.6 {
            let at = [(random.uniform() - 0.5) * x, y * (0.2 + 0.2 * random.uniform())];
            let top = under(0.0) + 0.4 + 0.5 * random.uniform();
            let low = [at[0], at[1], under(at[1] + 0.5)];
            let chimney = Block { low, high: [at[0] + 0.6, at[1] + 0.5, top], class: BUILDING, open: [true, false] };
            let sides = chimney.build(world, frame);
            for (line, side) in chimney.foot(0).into_iter().zip(sides) {
                let line = line.map(|[x, y, _]| frame.place([x, y, under(y) + THICKNESS]));
                world.edge(line, [side, roof[1]]);
            }
        }
    }

    fn hip(&self, world: &mut World, frame: &Frame, walls: &[u32]) {
        let out = self.overhang;
        let wider = |z: f64| self.corners(z).map(|[x, y, z]| add([x, y, z], [out.copysign(x), out.copysign(y), 0.0]));
        let top = self.wall + THICKNESS;
        let [x, y] = self.size.map(|size| size / 2.0);
        let ridge = |x: f64| [x, 0.0, top + self.slope * (y + out)];
        // A house as deep as it is wide would have no ridge.
        let end = (x - y).max(0.2);
        let corners = wider(self.wall).into_iter().chain(wider(top)).chain([ridge(-end), ridge(end)]).collect();
        let soffit = vec![3, 2, 1, 0];
        let sides = (0..4).map(|i| vec![i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4]);
        let planes = [vec![4, 5, 9, 8], vec![5, 6, 9], vec![6, 7, 8, 9], vec![7, 4, 8]];
        let faces = [soffit].into_iter().chain(sides).chain(planes).collect();
        let roof = world.solid(&Solid { corners, faces, class: BUILDING }, frame);
        self.meet(world, frame, walls, roof[0]);
    }

    fn flat(&self, world: &mut World, frame: &Frame, walls: &[u32]) {
        let [x, y] = self.size.map(|size| size / 2.0 + self.overhang);
        let (low, high) = ([-x, -y, self.wall], [x, y, self.wall + 0.3]);
        let soffit = world.surface(BUILDING);
        let slab = Block { low, high, class: BUILDING, open: [true, false] };
        let sides = slab.build(world, frame);
        let lines = slab.foot(0).map(|line| line.map(|at| frame.place(at)));
        world.polygon(&lines.map(|line| line[0]), soffit);
        lines.into_iter().zip(sides).for_each(|(line, side)| world.edge(line, [side, soffit]));
        self.meet(world, frame, walls, soffit);
    }

    /// Adds the creases between the walls and a flat surface above them.
    fn meet(&self, world: &mut World, frame: &Frame, walls: &[u32], surface: u32) {
        let top = self.corners(self.wall).map(|at| frame.place(at));
        for (i, &wall) in walls.iter().enumerate() {
            world.edge([top[i], top[(i + 1) % 4]], [wall, surface]);
        }
    }
}
