//! A tree of boxes over patches, in which rays are traced.

use super::geometry::{Patch, Ray, Vector};
use crate::cloud::{Bounds, around};

/// Largest number of patches of a leaf.
const LEAF: usize = 4;
/// Boxes that wait while the tree is walked; halving 2^32 patches needs fewer.
const WAITING: usize = 64;

/// Patches in a binary tree of boxes, halved at the median along the longest axis.
#[derive(Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    patches: Vec<Patch>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// Axis along which the children lie.
    axis: usize,
    /// First patch of a leaf, or the second child; the first child is the next node.
    next: u32,
    /// Number of patches of a leaf, 0 for other nodes.
    count: u32,
}

/// Where a ray ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Metres from the origin.
    pub(super) range: f64,
    pub(super) surface: u32,
    /// Cosine of the angle between the ray and the normal, 0..=1.
    pub(super) cosine: f64,
}

impl Tree {
    /// Builds the tree. O(n log n).
    pub(super) fn new(mut patches: Vec<Patch>) -> Self {
        let mut nodes = Vec::with_capacity(patches.len());
        if !patches.is_empty() {
            divide(&mut nodes, &mut patches, 0);
        }
        Self { nodes, patches }
    }

    /// The first patch that a ray meets between two ranges.
    pub(super) fn first(&self, ray: &Ray, [near, far]: [f64; 2]) -> Option<Hit> {
        let (mut best, mut found) = (far, None);
        let mut waiting = [0u32; WAITING];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let at = waiting[height] as usize;
            let node = &self.nodes[at];
            if !crosses(&node.bounds, ray, best) {
                continue;
            }
            if node.count > 0 {
                let start = node.next as usize;
                for (i, patch) in self.patches[start..start + node.count as usize].iter().enumerate() {
                    if let Some(range) = patch.meet(ray).filter(|&range| range > near && range < best) {
                        (best, found) = (range, Some(start + i));
                    }
                }
                continue;
            }
            let children = [at as u32 + 1, node.next];
            let first = usize::from(ray.direction[node.axis] < 0.0);
            waiting[height] = children[1 - first];
            waiting[height + 1] = children[first];
            height += 2;
        }
        found.map(|at| {
            let patch = &self.patches[at];
            let cosine = super::geometry::dot(patch.normal(), ray.direction).abs();
            Hit { range: best, surface: patch.surface, cosine }
        })
    }
}

/// Adds the node of these patches, the first of which has the number `start`, and those below it.
fn divide(nodes: &mut Vec<Node>, patches: &mut [Patch], start: usize) {
    let bounds = bounds(patches.iter().map(Patch::bounds));
    let size = super::geometry::sub(bounds[1], bounds[0]);
    let axis = (0..3).fold(0, |best, a| if size[a] > size[best] { a } else { best });
    let own = nodes.len();
    nodes.push(Node { bounds, axis, next: start as u32, count: patches.len() as u32 });
    if patches.len() <= LEAF {
        return;
    }
    let middle = |patch: &Patch| {
        let [low, high] = patch.bounds();
        low[axis] + high[axis]
    };
    let half = patches.len() / 2;
    patches.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
    let (left, right) = patches.split_at_mut(half);
    divide(nodes, left, start);
    let second = nodes.len() as u32;
    divide(nodes, right, start + half);
    nodes[own] = Node { next: second, count: 0, ..nodes[own] };
}

fn bounds(all: impl Iterator<Item = Bounds>) -> Bounds {
    all.reduce(around).unwrap_or_default()
}

/// Whether a ray crosses a box before `far` metres.
#[inline]
fn crosses([low, high]: &[Vector; 2], ray: &Ray, far: f64) -> bool {
    let (mut enter, mut leave) = (0.0f64, far);
    for a in 0..3 {
        let one = (low[a] - ray.origin[a]) * ray.inverse[a];
        let other = (high[a] - ray.origin[a]) * ray.inverse[a];
        // A ray in the plane of a side gives NaN, which min and max leave out.
        enter = enter.max(one.min(other));
        leave = leave.min(one.max(other));
    }
    enter <= leave
}

#[cfg(test)]
mod tests {
    use super::super::geometry::Form;
    use super::*;
    use crate::random::stream;

    #[test]
    fn the_tree_finds_what_a_search_through_all_patches_finds() {
        let mut random = stream(5, 0);
        let mut vector = |size: f64| [0; 3].map(|_| (random.uniform() - 0.5) * size);
        let forms = [Form::Triangle, Form::Parallelogram, Form::Disc];
        let patches: Vec<Patch> = (0..700)
            .map(|i| Patch {
                corner: vector(10.0),
                sides: [vector(1.0), vector(1.0)],
                form: forms[i % 3],
                surface: i as u32,
            })
            .collect();
        let tree = Tree::new(patches.clone());
        let mut hits = 0;
        for _ in 0..500 {
            let ray = Ray::new(vector(20.0), vector(1.0));
            let ranges = patches.iter().filter_map(|p| p.meet(&ray).map(|r| (r, p.surface)));
            let expected = ranges.filter(|&(r, _)| r > 0.1 && r < 30.0).min_by(|a, b| a.0.total_cmp(&b.0));
            let found = tree.first(&ray, [0.1, 30.0]).map(|hit| (hit.range, hit.surface));
            assert_eq!(found, expected);
            hits += usize::from(found.is_some());
        }
        assert!(hits > 30, "{hits}");
        assert!(Tree::new(Vec::new()).first(&Ray::new([0.0; 3], [1.0, 0.0, 0.0]), [0.0, 1.0]).is_none());
    }
}
