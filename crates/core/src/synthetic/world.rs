//! The world that is scanned: surfaces with classes, and the creases between them.

use super::geometry::{Form, Patch, Vector, add, cross, dot, length, scaled, sub, unit};

/// Cosine of the least angle of a crease, 30 degrees.
const CREASE: f64 = 0.866_025_403_784_438_6;

/// A crease: where two surfaces meet at an angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) ends: [Vector; 2],
    pub(super) surfaces: [u32; 2],
}

/// Surfaces made of patches, and the creases between them.
#[derive(Clone, Debug, Default)]
pub(super) struct World {
    pub(super) patches: Vec<Patch>,
    /// Class of each surface.
    pub(super) classes: Vec<u8>,
    pub(super) edges: Vec<Edge>,
}

/// Turns and moves what is built around the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    origin: Vector,
    /// Cosine and sine of the turn around z.
    turn: [f64; 2],
}

impl Frame {
    /// The frame at this place, turned to the left by `angle` radians.
    pub(super) fn new(origin: Vector, angle: f64) -> Self {
        Self { origin, turn: [angle.cos(), angle.sin()] }
    }

    pub(super) fn direction(&self, [x, y, z]: Vector) -> Vector {
        let [cos, sin] = self.turn;
        [cos * x - sin * y, sin * x + cos * y, z]
    }

    pub(super) fn place(&self, at: Vector) -> Vector {
        add(self.origin, self.direction(at))
    }

    /// A frame inside this one.
    pub(super) fn inner(&self, origin: Vector, angle: f64) -> Self {
        let [cos, sin] = self.turn;
        let [c, s] = [angle.cos(), angle.sin()];
        Self { origin: self.place(origin), turn: [cos * c - sin * s, sin * c + cos * s] }
    }
}

/// A body with flat convex faces; faces that nobody sees are left out.
#[derive(Clone, Debug, Default)]
pub(super) struct Solid {
    pub(super) corners: Vec<Vector>,
    /// Corners of each face in order around it.
    pub(super) faces: Vec<Vec<usize>>,
    pub(super) class: u8,
}

impl World {
    /// A new surface.
    pub(super) fn surface(&mut self, class: u8) -> u32 {
        self.classes.push(class);
        self.classes.len() as u32 - 1
    }

    /// Adds a flat convex polygon to a surface.
    pub(super) fn polygon(&mut self, corners: &[Vector], surface: u32) {
        let &[corner, ref others @ ..] = corners else { return };
        if let &[b, c, d] = others
            && length(sub(add(b, d), add(corner, c))) < 1e-9
        {
            let sides = [sub(b, corner), sub(d, corner)];
            self.patches.push(Patch { corner, sides, form: Form::Parallelogram, surface });
            return;
        }
        for pair in others.windows(2) {
            let sides = [sub(pair[0], corner), sub(pair[1], corner)];
            self.patches.push(Patch { corner, sides, form: Form::Triangle, surface });
        }
    }

    /// Adds a crease.
    pub(super) fn edge(&mut self, ends: [Vector; 2], surfaces: [u32; 2]) {
        if length(sub(ends[1], ends[0])) > 1e-6 {
            self.edges.push(Edge { ends, surfaces });
        }
    }

    /// Adds a body, and as creases all its edges at which two faces meet at more than 30 degrees. Returns the surface
    /// of each face.
    pub(super) fn solid(&mut self, solid: &Solid, frame: &Frame) -> Vec<u32> {
        let corners: Vec<Vector> = solid.corners.iter().map(|&at| frame.place(at)).collect();
        let mut surfaces = Vec::with_capacity(solid.faces.len());
        // Sides of the faces so far: corners, normal of the face, its surface.
        let mut sides: Vec<([usize; 2], Vector, u32)> = Vec::new();
        for face in &solid.faces {
            let polygon: Vec<Vector> = face.iter().map(|&i| corners[i]).collect();
            let surface = self.surface(solid.class);
            self.polygon(&polygon, surface);
            let normal = normal(&polygon);
            for (i, &a) in face.iter().enumerate() {
                let b = face[(i + 1) % face.len()];
                let same = |side: &[usize; 2]| *side == [a, b] || *side == [b, a];
                if let Some((side, other, neighbour)) = sides.iter().find(|(side, ..)| same(side)) {
                    // Faces that turn the same way run along their common side in opposite directions.
                    let sign = if *side == [a, b] { -1.0 } else { 1.0 };
                    if sign * dot(normal, *other) < CREASE {
                        self.edge([corners[a], corners[b]], [*neighbour, surface]);
                    }
                }
                sides.push(([a, b], normal, surface));
            }
            surfaces.push(surface);
        }
        surfaces
    }
}

/// Normal of a polygon by Newell's method.
fn normal(polygon: &[Vector]) -> Vector {
    let ends = polygon.iter().zip(polygon.iter().cycle().skip(1));
    unit(ends.map(|(&a, &b)| cross(a, b)).fold([0.0; 3], add))
}

/// A box along the axes of its frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub(super) low: Vector,
    pub(super) high: Vector,
    pub(super) class: u8,
    /// Whether the bottom and the top are open: something else closes them.
    pub(super) open: [bool; 2],
}

impl Block {
    /// A corner: the bits of `number` choose low or high x, y, z.
    fn corner(&self, number: usize) -> Vector {
        [0, 1, 2].map(|a| if number >> a & 1 == 0 { self.low[a] } else { self.high[a] })
    }

    /// Adds the block. Returns the surfaces of its four sides, which stand on the lines of [`Block::foot`].
    pub(super) fn build(&self, world: &mut World, frame: &Frame) -> Vec<u32> {
        let mut faces = vec![vec![0, 1, 5, 4], vec![1, 3, 7, 5], vec![3, 2, 6, 7], vec![2, 0, 4, 6]];
        faces.extend((!self.open[0]).then(|| vec![0, 2, 3, 1]));
        faces.extend((!self.open[1]).then(|| vec![4, 5, 7, 6]));
        let solid = Solid { corners: (0..8).map(|i| self.corner(i)).collect(), faces, class: self.class };
        world.solid(&solid, frame)
    }

    /// The lines below the four sides (`up` 0), or those above them (`up` 1).
    pub(super) fn foot(&self, up: usize) -> [[Vector; 2]; 4] {
        [[0, 1], [1, 3], [3, 2], [2, 0]].map(|ends| ends.map(|i| self.corner(i + 4 * up)))
    }

    /// Adds the block between two flat surfaces: the one below it, and the one above it. Their creases with it are
    /// added.
    pub(super) fn fit(&self, world: &mut World, frame: &Frame, around: [Option<u32>; 2]) {
        let sides = self.build(world, frame);
        for (up, surface) in around.into_iter().enumerate() {
            let Some(surface) = surface else { continue };
            for (line, &side) in self.foot(up).into_iter().zip(&sides) {
                world.edge(line.map(|at| frame.place(at)), [side, surface]);
            }
        }
    }
}

/// A surface of discs in a volume: leaves.
pub(super) struct Leaves {
    pub(super) count: usize,
    /// Radius of a leaf.
    pub(super) radius: f64,
    pub(super) class: u8,
}

impl Leaves {
    /// Adds leaves at these places, turned at random.
    pub(super) fn build(
        &self,
        world: &mut World,
        random: &mut crate::random::Stream,
        place: impl Fn(&mut crate::random::Stream) -> Vector,
    ) {
        let surface = world.surface(self.class);
        for _ in 0..self.count {
            let corner = place(random);
            let normal = unit([random.normal(), random.normal(), random.normal()]);
            let u = unit(cross(normal, [0.6, -0.48, 0.64]));
            let radius = self.radius * (0.6 + 0.8 * random.uniform());
            let sides = [scaled(u, radius), scaled(cross(normal, u), radius)];
            world.patches.push(Patch { corner, sides, form: Form::Disc, surface });
        }
    }
}
