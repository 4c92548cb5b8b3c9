//! A polygon with holes that tells quickly what is inside.

use crate::error::{Error, Result};
use parry2d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry2d_f64::math::Vector;
use parry2d_f64::partitioning::{Bvh, BvhBuildStrategy};

/// Corners of a closed line; the first may be repeated at the end.
pub(super) type Ring = Vec<[f64; 2]>;

/// A polygon with holes.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    /// The sides of all rings, each with its lower end first.
    sides: Vec<[[f64; 2]; 2]>,
    /// Their boxes.
    tree: Bvh,
    pub(super) bounds: Aabb,
}

impl Polygon {
    /// From an outer ring and its holes, in any direction. O(sides log sides).
    pub(super) fn new(rings: Vec<Ring>) -> Result<Self> {
        let mut sides = Vec::new();
        for ring in rings {
            add_sides(ring, &mut sides)?;
        }
        if sides.is_empty() {
            return Err(Error::input("a polygon without a ring"));
        }
        let boxes: Vec<Aabb> = sides.iter().map(|ends| Aabb::from_points(ends.map(vector))).collect();
        let bounds = boxes.iter().copied().reduce(|a, b| a.merged(&b)).unwrap_or_else(Aabb::new_invalid);
        Ok(Self { sides, tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes), bounds })
    }

    /// Whether a ray from there to the east crosses an odd number of sides.
    pub(super) fn holds(&self, at: [f64; 2]) -> bool {
        let ray = Aabb::new(vector(at), vector([self.bounds.maxs.x.max(at[0]), at[1]]));
        let crossed = |&i: &u32| crosses(self.sides[i as usize], at);
        self.tree.intersect_aabb(&ray).filter(crossed).count() % 2 == 1
    }
}

/// Whether the ray crosses a side. Rounding is the same for both polygons at the side, because its lower end comes first.
fn crosses([low, high]: [[f64; 2]; 2], at: [f64; 2]) -> bool {
    let east = || low[0] + (at[1] - low[1]) / (high[1] - low[1]) * (high[0] - low[0]) > at[0];
    (low[1] <= at[1]) != (high[1] <= at[1]) && east()
}

fn add_sides(mut ring: Ring, sides: &mut Vec<[[f64; 2]; 2]>) -> Result<()> {
    if let Some(corner) = ring.iter().find(|corner| !corner.iter().all(|v| v.is_finite())) {
        return Err(Error::input(format!("a polygon with the corner {corner:?}; expected finite numbers")));
    }
    ring.dedup();
    if ring.first() == ring.last() {
        ring.pop();
    }
    if ring.len() < 3 {
        return Err(Error::input(format!("a polygon with a ring of {} corners; expected 3 or more", ring.len())));
    }
    let ends = |i: usize| [ring[i], ring[(i + 1) % ring.len()]];
    let ordered = |[a, b]: [[f64; 2]; 2]| if [a[1], a[0]] <= [b[1], b[0]] { [a, b] } else { [b, a] };
    sides.extend((0..ring.len()).map(|i| ordered(ends(i))));
    Ok(())
}

fn vector(at: [f64; 2]) -> Vector {
    Vector::new(at[0], at[1])
}
