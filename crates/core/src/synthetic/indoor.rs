//! A room with windows, a door, furniture and pillars.

use super::classes;
use super::geometry::{Vector, sub, unit};
use super::shapes::{Cylinder, Opening, Wall, ball};
use super::world::{Block, Frame, World};
use crate::random::{Stream, stream};

/// The world of a room around the origin, at most `extent` metres from it to each side; and places for scanners.
pub(super) fn room(seed: u64, extent: f64) -> (World, Vec<Vector>) {
    let mut world = World::default();
    let mut random = stream(seed, 0);
    let mut within = |low: f64, high: f64| low + (high - low) * random.uniform();
    let most = (extent * 1.4).min(6.0);
    let half = [within(most * 0.6, most), within(most * 0.5, most * 0.85)];
    let height = within(2.4, 3.4);
    let frame = Frame::new([0.0; 3], within(0.0, 1.5));
    let floor = world.surface(classes::GROUND);
    let ceiling = world.surface(classes::BUILDING);
    // The floor goes on below the walls, into the door.
    let [x, y] = half.map(|size| size + 0.5);
    for (surface, z) in [(floor, 0.0), (ceiling, height)] {
        world.polygon(&[[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]].map(|at| frame.place(at)), surface);
    }
    let mut room = Room { world: &mut world, random: &mut random, frame, half, height, floor };
    room.walls(ceiling);
    room.furnish(ceiling);
    let places = [[0.25, 0.1], [-0.45, -0.2], [0.55, -0.25], [-0.1, 0.25]];
    let places = places.map(|[x, y]| frame.place([x * half[0], y * half[1], 1.5]));
    (world, places.to_vec())
}

struct Room<'a> {
    world: &'a mut World,
    random: &'a mut Stream,
    frame: Frame,
    /// Half of the size along x and y.
    half: [f64; 2],
    height: f64,
    floor: u32,
}

impl Room<'_> {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.random.uniform()
    }

    fn walls(&mut self, ceiling: u32) {
        let [x, y] = self.half;
        let corners = [[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]];
        let up = |at: Vector| self.frame.place([at[0], at[1], self.height]);
        let tops = corners.map(up);
        let mut walls = Vec::new();
        for i in 0..4 {
            let line = [corners[i], corners[(i + 1) % 4]];
            let along = unit(sub(line[1], line[0]));
            let openings = self.openings(2.0 * self.half[i % 2], i == 1);
            let back = [along[1], -along[0], 0.0];
            let wall = Wall {
                line,
                up: [0.0, self.height],
                back,
                openings,
                class: classes::BUILDING,
                floor: Some(self.floor),
            };
            walls.push(wall.build(self.world, &self.frame));
        }
        for i in 0..4 {
            self.world.edge([tops[i], tops[(i + 1) % 4]], [walls[i], ceiling]);
            self.world.edge([self.frame.place(corners[i]), tops[i]], [walls[(i + 3) % 4], walls[i]]);
        }
    }

    fn openings(&mut self, length: f64, door: bool) -> Vec<Opening> {
        let count = (length / 2.4).floor().max(1.0) as usize;
        let mut openings = Vec::new();
        for i in 0..count {
            let middle = length * (i as f64 + 0.5) / count as f64;
            let (depth, width) = (self.within(0.06, 0.3), self.within(0.8, 1.5));
            let along = [middle - width / 2.0, middle + width / 2.0];
            match (door && i == 0, self.random.uniform() < 0.45) {
                (true, _) => openings.push(Opening { along, up: [0.0, 2.05], depth: depth.min(0.2) }),
                (false, true) => openings.push(Opening { along, up: [0.9, self.height - 0.3], depth }),
                _ => {}
            }
        }
        openings
    }

    fn furnish(&mut self, ceiling: u32) {
        let [x, y] = self.half;
        for side in [-1.0, 1.0] {
            // Shelves and cupboards stand a little before the walls along x.
            let mut at = 0.4 - x;
            while at < x - 1.8 {
                let width = self.within(0.6, 1.4);
                let turn = if side < 0.0 { 0.0 } else { std::f64::consts::PI };
                let frame = self.frame.inner([at + width / 2.0, side * (y - 0.07), 0.0], turn);
                match self.random.below(4) {
                    0 => self.shelf(&frame, width),
                    1 => {
                        let high = [width / 2.0, 0.5, self.within(0.7, 2.0)];
                        self.block([[-width / 2.0, 0.0, 0.0], high], [true, false]).fit(
                            self.world,
                            &frame,
                            [Some(self.floor), None],
                        );
                    }
                    _ => {}
                }
                at += width + self.within(0.2, 1.2);
            }
        }
        for place in [[-0.75, 0.25], [0.65, 0.3], [0.1, -0.35], [-0.15, 0.05]] {
            if self.random.uniform() < 0.75 {
                let frame = self.frame.inner([place[0] * x, place[1] * y, 0.0], self.random.uniform() * 3.0);
                self.table(&frame);
            }
        }
        let pillar = Cylinder {
            centre: [-0.75 * x, -0.35 * y],
            radius: self.within(0.15, 0.3),
            up: [0.0, self.height],
            class: classes::BUILDING,
            lid: false,
        };
        let side = pillar.build(self.world, &self.frame);
        for (z, surface) in [(0.0, self.floor), (self.height, ceiling)] {
            pillar
                .ring(z)
                .into_iter()
                .for_each(|line| self.world.edge(line.map(|at| self.frame.place(at)), [side, surface]));
        }
        let bin = Cylinder {
            centre: [0.85 * x, -0.1 * y],
            radius: 0.18,
            up: [0.0, self.within(0.3, 0.7)],
            class: classes::FURNITURE,
            lid: true,
        };
        let side = bin.build(self.world, &self.frame);
        bin.ring(0.0)
            .into_iter()
            .for_each(|line| self.world.edge(line.map(|at| self.frame.place(at)), [side, self.floor]));
        let radius = self.within(0.1, 0.35);
        ball(self.world, &self.frame.inner([0.35 * x, -0.05 * y, 0.0], 0.0), radius, classes::FURNITURE);
    }

    fn block(&self, [low, high]: [Vector; 2], open: [bool; 2]) -> Block {
        Block { low, high, class: classes::FURNITURE, open }
    }

    /// A plate on four legs, and chairs before it.
    fn table(&mut self, frame: &Frame) {
        let half = [self.within(0.4, 0.8), self.within(0.3, 0.45)];
        let height = self.within(0.68, 0.78);
        let top = self.plate(frame, [half, [height, height + 0.04]], 0.05);
        for side in [-1.0, 1.0] {
            if self.random.uniform() < 0.7 {
                let turn = if side < 0.0 { 0.0 } else { std::f64::consts::PI };
                let shift = self.within(-0.1, 0.3);
                let chair = frame.inner([shift, side * (half[1] + 0.35), 0.0], turn);
                let seat = self.plate(&chair, [[0.21, 0.2], [0.43, 0.46]], 0.035);
                let back = self.block([[-0.2, -0.2, 0.46], [0.2, -0.165, 0.9]], [true, false]);
                back.fit(self.world, &chair, [Some(seat), None]);
            }
        }
        if self.random.uniform() < 0.6 {
            let low = [self.within(-0.3, 0.0), self.within(-0.2, 0.0), height + 0.04];
            let high = [low[0] + self.within(0.1, 0.4), low[1] + 0.2, low[2] + self.within(0.05, 0.4)];
            self.block([low, high], [true, false]).fit(self.world, frame, [Some(top), None]);
        }
    }

    /// A plate of half sizes, from a lowest to a highest z, on four square legs. Returns its upper surface.
    fn plate(&mut self, frame: &Frame, [half, [low, high]]: [[f64; 2]; 2], leg: f64) -> u32 {
        let [x, y] = half;
        let [under, upper] = [0; 2].map(|_| self.world.surface(classes::FURNITURE));
        for (surface, z) in [(under, low), (upper, high)] {
            self.world.polygon(&[[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]].map(|at| frame.place(at)), surface);
        }
        let open = [true; 2];
        self.block([[-x, -y, low], [x, y, high]], open).fit(self.world, frame, [Some(under), Some(upper)]);
        for [sx, sy] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
            let at = [sx * (x - 0.05 - leg / 2.0), sy * (y - 0.04 - leg / 2.0)];
            let ends = [[at[0] - leg / 2.0, at[1] - leg / 2.0, 0.0], [at[0] + leg / 2.0, at[1] + leg / 2.0, low]];
            self.block(ends, open).fit(self.world, frame, [Some(self.floor), Some(under)]);
        }
        upper
    }

    /// Boards between two sides, open to the front, its back at y = 0.
    fn shelf(&mut self, frame: &Frame, width: f64) {
        let (x, y, z) = (width / 2.0, 0.32, self.within(1.2, 2.1));
        let thick = 0.025;
        let rear = self.world.surface(classes::FURNITURE);
        let wall = |y: f64| [[-x, y, 0.0], [x, y, 0.0], [x, y, z], [-x, y, z]].map(|at| frame.place(at));
        self.world.polygon(&wall(0.0), rear);
        let closed = [true, false];
        let mut inner = Vec::new();
        for side in [-1.0, 1.0] {
            let [a, b] = [side * x, side * (x - thick)];
            let board = self.block([[a.min(b), 0.0, 0.0], [a.max(b), y, z]], closed);
            let surfaces = board.build(self.world, frame);
            for (line, &surface) in board.foot(0).iter().zip(&surfaces) {
                self.world.edge(line.map(|at| frame.place(at)), [surface, self.floor]);
            }
            let facing = if side < 0.0 { 1 } else { 3 };
            let inside = surfaces[facing];
            self.world.edge([[b, 0.0, 0.0], [b, 0.0, z]].map(|at| frame.place(at)), [rear, inside]);
            inner.push(inside);
        }
        let boards = 3 + self.random.below(3);
        for i in 0..=boards {
            let low = 0.05 + (z - 0.1) * i as f64 / boards as f64;
            let [under, upper] = [0; 2].map(|_| self.world.surface(classes::FURNITURE));
            let front = self.world.surface(classes::FURNITURE);
            let w = x - thick;
            let place = |x: f64, y: f64, z: f64| frame.place([x, y, z]);
            for (surface, z) in [(under, low), (upper, low + thick)] {
                self.world.polygon(
                    &[place(-w, 0.0, z), place(w, 0.0, z), place(w, y - 0.01, z), place(-w, y - 0.01, z)],
                    surface,
                );
                self.world.edge([place(-w, 0.0, z), place(w, 0.0, z)], [rear, surface]);
                self.world.edge([place(-w, y - 0.01, z), place(w, y - 0.01, z)], [front, surface]);
                for (x, &side) in [-w, w].into_iter().zip(&inner) {
                    self.world.edge([place(x, 0.0, z), place(x, y - 0.01, z)], [side, surface]);
                }
            }
            let y = y - 0.01;
            self.world.polygon(
                &[place(-w, y, low), place(w, y, low), place(w, y, low + thick), place(-w, y, low + thick)],
                front,
            );
        }
    }
}
