//! The k nearest points in a k-d tree: one query at a time, and all points of a leaf together.
//!
//! Queries of a leaf share the list of leaves that can matter to them. How far a query must look follows from a neighbour
//! whose answer is known: the k nearest of p and p itself lie within r(p) + |pq| of q (triangle inequality).

use super::knn_list::List;
use super::knn_tree::{LEAF, Node, Tree};

/// Squared distance (upper half, its bits) and index: ascending by (distance, index).
pub(super) type Key = u64;
/// More leaves than this are not listed: every query then walks the tree on its own.
const LISTED: usize = 512;

/// Reusable state of the searches of one thread. Results do not depend on what was searched before.
#[derive(Clone, Debug, Default)]
pub(super) struct Seeker {
    keys: Vec<Key>,
    kept: usize,
    stack: Vec<(f32, u32)>,
    list: List,
    visit: Vec<u32>,
}

/// A point whose k-th distance is known.
#[derive(Clone, Copy, Debug)]
struct Known {
    place: [f32; 3],
    radius: f32,
}

#[inline(always)]
pub(super) fn key(squared: f32, index: u32) -> Key {
    u64::from(squared.to_bits()) << 32 | u64::from(index)
}

/// The squared distance of a key.
#[inline(always)]
pub(super) fn distance_of(key: Key) -> f32 {
    f32::from_bits((key >> 32) as u32)
}

#[inline(always)]
fn squared(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|i| a[i] - b[i]);
    x * x + y * y + z * z
}

/// The square of a radius, a little larger than any rounding of it.
#[inline(always)]
fn limit(radius: f32) -> f32 {
    let wide = radius * (1.0 + 1e-5) + 1e-18;
    wide * wide
}

impl Seeker {
    /// Appends to `out` the keys of the `k` nearest of every point of the leaves, in the order of the tree, the point itself
    /// left out. The tree holds more than `k` points.
    #[inline(always)]
    pub(super) fn leaves(&mut self, tree: &Tree, leaves: std::ops::Range<usize>, k: usize, out: &mut Vec<Key>) {
        let mut last = None;
        for leaf in leaves {
            let node = tree.leaf(leaf);
            let (first, end) = (node.first as usize, (node.first + node.count) as usize);
            for start in (first..end).step_by(LEAF) {
                last = Some(self.batch(tree, node, start..end.min(start + LEAF), (k, last), out));
            }
            // Points beyond the kept ones stand where the others do: their nearest are the first of that place.
            if node.skip > node.count {
                self.walk(tree, tree.place(first), (k, f32::INFINITY, None));
                for _ in node.count..node.skip {
                    out.extend_from_slice(&self.keys[..k]);
                }
            }
        }
    }

    /// Appends to `out` the keys of the `k` nearest of every place. The tree holds at least `k` points.
    #[inline(always)]
    pub(super) fn places(&mut self, tree: &Tree, places: &[[f32; 3]], k: usize, out: &mut Vec<Key>) {
        let mut last = Known { place: [0.0; 3], radius: f32::INFINITY };
        for &at in places {
            // The k nearest of the last place lie within reach of this one.
            self.walk(tree, at, (k, limit(last.radius + squared(at, last.place).sqrt()), None));
            out.extend_from_slice(&self.keys[..k]);
            last = Known { place: at, radius: distance_of(self.keys[k - 1]).sqrt() };
        }
    }

    /// Up to [`LEAF`] points of a leaf. Returns the last of them as known.
    #[inline(always)]
    fn batch(
        &mut self,
        tree: &Tree,
        node: &Node,
        points: std::ops::Range<usize>,
        (k, last): (usize, Option<Known>),
        out: &mut Vec<Key>,
    ) -> Known {
        let mut known = [[f32::INFINITY; LEAF]; 4];
        let mut before = last.filter(|l| self.make_list(tree, node, reach(node, *l)));
        let mut listed = before.is_some();
        let mut last = Known { place: [0.0; 3], radius: f32::INFINITY };
        for (l, point) in points.enumerate() {
            let at = tree.place(point);
            let radius = match before.take() {
                Some(b) => b.radius + squared(at, b.place).sqrt(),
                None => nearest_known(&known, at),
            };
            if listed {
                self.visit_listed(tree, point, limit(radius));
            }
            if !listed || self.kept < k {
                self.walk(tree, at, (k, limit(radius), Some(tree.index[point])));
            }
            self.rank(k);
            out.extend_from_slice(&self.keys[..k]);
            last = Known { place: at, radius: distance_of(self.keys[k - 1]).sqrt() };
            if l == 0 && !listed {
                listed = self.make_list(tree, node, reach(node, last));
            }
            (0..3).for_each(|a| known[a][l] = at[a]);
            known[3][l] = last.radius;
        }
        last
    }

    /// Lists the leaves within `reach` of the node; false if they are too many.
    #[inline(always)]
    fn make_list(&mut self, tree: &Tree, node: &Node, reach: f32) -> bool {
        let limit = limit(reach);
        self.list.clear();
        self.stack.clear();
        self.stack.push((0.0, 0));
        while let Some((_, n)) = self.stack.pop() {
            let other = &tree.nodes[n as usize];
            if other.gap(node) > limit {
                continue;
            }
            if other.count > 0 {
                if self.list.ranges.len() == LISTED {
                    return false;
                }
                self.list.push(other);
            } else {
                self.stack.push((0.0, n + other.skip));
                self.stack.push((0.0, n + 1));
            }
        }
        self.list.pad();
        true
    }

    /// Keeps every point of the listed leaves that is at most that far, but for the query itself.
    #[inline(always)]
    fn visit_listed(&mut self, tree: &Tree, query: usize, limit: f32) {
        let at = tree.place(query);
        self.visit.clear();
        self.list.within(at, limit, &mut self.visit);
        self.kept = 0;
        for v in 0..self.visit.len() {
            let [first, count] = self.list.ranges[self.visit[v] as usize];
            self.scan(tree, (first as usize, count as usize), at, limit);
        }
        self.leave_out(tree.index[query]);
    }

    /// Keeps the points of a leaf that are at most that far, without a branch.
    #[inline(always)]
    fn scan(&mut self, tree: &Tree, (first, count): (usize, usize), at: [f32; 3], limit: f32) {
        for start in (first..first + count).step_by(LEAF) {
            let used = LEAF.min(first + count - start);
            let lanes = |axis: &[f32]| axis[start..].first_chunk::<LEAF>().copied().unwrap_or([f32::INFINITY; LEAF]);
            let (x, y, z) = (lanes(&tree.x), lanes(&tree.y), lanes(&tree.z));
            let mut d = [0.0f32; LEAF];
            for l in 0..LEAF {
                let (x, y, z) = (x[l] - at[0], y[l] - at[1], z[l] - at[2]);
                d[l] = x * x + y * y + z * z;
            }
            if self.keys.len() < self.kept + LEAF {
                self.keys.resize(2 * (self.kept + LEAF), 0);
            }
            let mut kept = 0usize;
            if let Some(slots) = self.keys[self.kept..].first_chunk_mut::<LEAF>() {
                for (&d, &index) in d.iter().zip(&tree.index[start..start + used]) {
                    slots[kept & (LEAF - 1)] = key(d, index);
                    kept = kept.wrapping_add(usize::from(d <= limit));
                }
            }
            self.kept += kept;
        }
    }

    /// Takes the key of that index out of the kept ones.
    #[inline(always)]
    fn leave_out(&mut self, index: u32) {
        if let Some(i) = self.keys[..self.kept].iter().position(|&k| k as u32 == index) {
            self.kept -= 1;
            self.keys.swap(i, self.kept);
        }
    }

    /// Brings the `k` smallest of the kept keys to the front, in order.
    #[inline(always)]
    fn rank(&mut self, k: usize) {
        let keys = &mut self.keys[..self.kept];
        if keys.len() > k {
            keys.select_nth_unstable(k - 1);
        }
        keys[..k].sort_unstable();
    }

    /// Finds the `k` nearest of a place by walking the tree, the nearer child first; `limit` is a bound known before.
    /// Leaves out one point. Returns how many there are.
    #[inline(never)]
    pub(super) fn walk(&mut self, tree: &Tree, at: [f32; 3], (k, limit, but): (usize, f32, Option<u32>)) -> usize {
        let mut limit = limit;
        self.kept = 0;
        self.stack.clear();
        self.stack.extend(tree.nodes.first().map(|n| (n.bound(at), 0)));
        while let Some((bound, n)) = self.stack.pop() {
            let node = &tree.nodes[n as usize];
            if bound > limit {
                continue;
            }
            if node.count == 0 {
                let children = [n + 1, n + node.skip].map(|c| (tree.nodes[c as usize].bound(at), c));
                let [near, far] = if children[1].0 < children[0].0 { [children[1], children[0]] } else { children };
                self.stack.extend([far, near]);
                continue;
            }
            self.scan(tree, (node.first as usize, node.count as usize), at, limit);
            if let Some(but) = but {
                self.leave_out(but);
            }
            if self.kept >= 2 * k.max(LEAF) {
                self.keys[..self.kept].select_nth_unstable(k - 1);
                self.kept = k;
            }
            if self.kept == k {
                let farthest = self.keys[..k].iter().copied().max().unwrap_or(Key::MAX);
                limit = limit.min(distance_of(farthest));
            }
        }
        let found = k.min(self.kept);
        if found > 0 {
            self.rank(found);
        }
        found
    }
}

/// Smallest radius around a place that is certain to hold the k nearest, by what is known.
#[inline(always)]
fn nearest_known(known: &[[f32; LEAF]; 4], at: [f32; 3]) -> f32 {
    let mut radius = [f32::INFINITY; LEAF];
    for l in 0..LEAF {
        let (x, y, z) = (known[0][l] - at[0], known[1][l] - at[1], known[2][l] - at[2]);
        radius[l] = known[3][l] + (x * x + y * y + z * z).sqrt();
    }
    radius.iter().fold(f32::INFINITY, |m, &r| m.min(r))
}

/// How far the queries of a leaf look at most if one point is known.
#[inline(always)]
fn reach(node: &Node, known: Known) -> f32 {
    let far = [0, 1, 2].map(|a| (node.high[a] - known.place[a]).abs().max((known.place[a] - node.low[a]).abs()));
    known.radius + squared(far, [0.0; 3]).sqrt()
}
