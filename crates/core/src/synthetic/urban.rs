//! A street: a road with pavements, houses with gardens, cars, poles, walls, hedges and trees.

use super::classes;
use super::ground::{Ground, ROAD, STREET};
use super::house::House;
use super::shapes::{Cylinder, car, hedge, tree};
use super::world::{Block, Frame, World};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::random::{Stream, stream};
use std::f64::consts::PI;

/// Width of a lot along the street.
const LOT: f64 = 14.0;
/// Depth of a lot.
const DEPTH: f64 = 17.0;

/// The world of a street along x, `extent` metres from the origin to each side.
pub(super) fn street(seed: u64, extent: f64, monitor: &Monitor) -> Result<(World, Ground)> {
    let mut world = World::default();
    let mut random = stream(seed, 0);
    let ground = Ground::street(&mut world, extent, &mut random);
    let mut lot = 1;
    for side in [-1.0, 1.0] {
        let mut x = -extent + LOT / 2.0;
        while x + LOT / 2.0 <= extent + 1e-9 {
            let mut front = STREET + 0.3;
            while front + DEPTH <= extent {
                monitor.check()?;
                lot += 1;
                let mut random = stream(seed, lot);
                let angle = if side > 0.0 { 0.0 } else { PI };
                let frame = Frame::new([x, side * front, 0.0], angle);
                build_lot(&mut Site { world: &mut world, ground: &ground, random: &mut random }, &frame);
                front += DEPTH;
            }
            x += LOT;
        }
    }
    let mut site = Site { world: &mut world, ground: &ground, random: &mut random };
    site.along_the_road(extent);
    Ok((world, ground))
}

struct Site<'a> {
    world: &'a mut World,
    ground: &'a Ground,
    random: &'a mut Stream,
}

/// Builds on a lot; its frame lies in the middle of its front, y to its rear.
fn build_lot(site: &mut Site<'_>, frame: &Frame) {
    let house = House::random(site.random);
    let setback = site.within(2.0, 4.5);
    let shift = site.within(-0.6, 0.6);
    let turn = site.within(-0.06, 0.06);
    let middle = frame.inner([shift, setback + house.size[1] / 2.0, 0.0], turn);
    house.build(site.world, site.ground, &middle, site.random);
    let rear = setback + house.size[1] + 1.6;
    match site.random.below(4) {
        0 => {
            let size = [site.within(4.0, 10.0), 0.7, site.within(0.8, 1.6)];
            let at = site.on_ground(frame, [-5.0, 0.3]);
            hedge(site.world, &at, size, site.random);
        }
        1 => {
            let end = site.within(-1.0, 3.0);
            site.garden_wall(frame, [[-6.0, 0.3], [end, 0.5]]);
        }
        2 => {
            let at = site.on_ground(&frame.inner([-5.4, 1.0, 0.0], 0.0), [0.0, 2.5]).inner([0.0; 3], PI / 2.0);
            if house.size[0] < 8.0 {
                car(site.world, &at, site.random);
            }
        }
        _ => {
            let at = site.on_ground(frame, [5.0, 1.2]);
            tree(site.world, &at, site.random);
        }
    }
    for _ in 0..site.random.below(3) {
        let [x, y] = [site.within(-6.0, 6.0), site.within(rear, rear + 3.0).min(DEPTH - 1.5)];
        let at = site.on_ground(frame, [x, y]);
        tree(site.world, &at, site.random);
    }
    if rear < DEPTH - 1.0 && site.random.uniform() < 0.4 {
        site.garden_wall(frame, [[-6.5, DEPTH - 0.6], [6.5, DEPTH - 0.4]]);
    }
}

impl Site<'_> {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.random.uniform()
    }

    /// A frame on the ground at a place of another.
    fn on_ground(&self, frame: &Frame, [x, y]: [f64; 2]) -> Frame {
        let place = frame.place([x, y, 0.0]);
        frame.inner([x, y, self.ground.below(place)[2] - place[2]], 0.0)
    }

    /// A low wall of stone over a rectangle.
    fn garden_wall(&mut self, frame: &Frame, [low, high]: [[f64; 2]; 2]) {
        let top = self.within(0.6, 1.6);
        let frame = self.on_ground(frame, [(low[0] + high[0]) / 2.0, low[1]]);
        let x = (high[0] - low[0]) / 2.0;
        let (low, high) = ([-x, 0.0, -1.0], [x, high[1] - low[1], top]);
        self.stand(Block { low, high, class: classes::BUILDING, open: [true, false] }, &frame);
    }

    /// A block that reaches into the ground.
    fn stand(&mut self, block: Block, frame: &Frame) {
        let sides = block.build(self.world, frame);
        for (line, side) in block.foot(0).into_iter().zip(sides) {
            self.ground.stand(self.world, line.map(|at| frame.place(at)), side);
        }
    }

    fn along_the_road(&mut self, extent: f64) {
        let all = Frame::new([0.0; 3], 0.0);
        for side in [-1.0, 1.0] {
            let mut x = -extent + self.within(2.0, 8.0);
            while x < extent - 4.0 {
                if self.random.uniform() < 0.6 {
                    let at = self.on_ground(&all, [x, side * (ROAD - 1.05)]);
                    car(self.world, &at.inner([0.0; 3], if side > 0.0 { PI } else { 0.0 }), self.random);
                }
                x += self.within(6.0, 11.0);
            }
            let mut x = -extent + self.within(1.0, 12.0);
            while x < extent - 1.0 {
                let turn = if side > 0.0 { 0.0 } else { PI };
                let at = self.on_ground(&all, [x, side * (ROAD + 0.4)]).inner([0.0; 3], turn);
                match self.random.below(5) {
                    0 => {
                        let half = self.within(0.2, 0.5);
                        let (low, high) = ([-half, 0.7, -0.5], [half, 1.1, self.within(0.8, 1.5)]);
                        self.stand(Block { low, high, class: classes::FURNITURE, open: [true, false] }, &at);
                    }
                    1 => {
                        let up = [-0.5, self.within(0.8, 1.1)];
                        let bin =
                            Cylinder { centre: [0.0, 0.5], radius: 0.25, up, class: classes::FURNITURE, lid: true };
                        let surface = bin.build(self.world, &at);
                        for line in bin.ring(0.0) {
                            self.ground.stand(self.world, line.map(|p| at.place(p)), surface);
                        }
                    }
                    2 => tree(self.world, &at, self.random),
                    _ => {
                        let (radius, top) = (self.within(0.05, 0.12), self.within(3.0, 7.5));
                        Cylinder { centre: [0.0; 2], radius, up: [-0.5, top], class: classes::POLE, lid: true }
                            .build(self.world, &at);
                    }
                }
                x += self.within(7.0, 13.0);
            }
        }
    }
}
