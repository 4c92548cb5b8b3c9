//! The k nearest points in a k-d tree: for one query, and for all points of a leaf together.
//!
//! The queries of a leaf share the list of leaves that may hold their neighbours. The search radius of a query q
//! follows from the last solved query p: the k nearest of p and p itself lie within r(p) + |pq| of q (triangle
//! inequality).

use super::build::Bounds;
use super::lanes::{LANES, append, bits, least};
use super::list::List;
use super::rank::{Ranking, Rows};
use super::tree::{Chunk, Leaf, Tree};
use pulp::Simd;

/// With more leaves than this no list is made: every query walks the tree by itself.
const LISTED: usize = 512;
/// Factor in the first guess of the search radius: the disc of the last query is enlarged by this share over √k, which
/// is the spread of the number of points in a disc of constant density.
const SPREAD: f32 = 1.2;
/// Flag of a leaf among the nodes that are still to be visited.
const IS_LEAF: u32 = 1 << 31;

/// Scratch memory for the searches of one thread. Results do not depend on previous searches.
#[derive(Clone, Debug, Default)]
pub(in crate::neighbours) struct Seeker {
    ranking: Ranking,
    stack: Vec<(f32, u32)>,
    list: List,
    visit: Vec<u32>,
}

/// A solved query: its position and the distance of its k-th neighbour.
#[derive(Clone, Copy, Debug)]
struct Known {
    place: [f32; 3],
    radius: f32,
}

#[inline(always)]
fn squared(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|i| a[i] - b[i]);
    x * x + y * y + z * z
}

/// The square of a radius, rounded up.
#[inline(always)]
fn limit(radius: f32) -> f32 {
    let wide = radius * (1.0 + 1e-5) + 1e-18;
    wide * wide
}

impl Seeker {
    /// Appends to `out` the `k` nearest of every point of the leaves, in the order of the tree, excluding the point
    /// itself. The tree holds more than `k` points.
    #[inline(always)]
    pub(super) fn leaves<S: Simd>(
        &mut self,
        simd: S,
        tree: &Tree,
        leaves: std::ops::Range<usize>,
        (k, out): (usize, &mut Rows),
    ) {
        let mut last = None;
        for id in leaves {
            let leaf = &tree.leaves[id];
            last = Some(self.batch(simd, tree, (leaf, &tree.chunks[id]), (k, last), out));
            // Points that are not kept coincide with kept ones and have the first of these as nearest points.
            let beyond = tree.points_of(id..id + 1).len() - leaf.count as usize;
            if beyond > 0 {
                self.walk(simd, tree, leaf.bounds.low, (k, f32::INFINITY, None));
                self.ranking.write(simd, k, out);
                for _ in 1..beyond {
                    out.index.extend_from_within(out.index.len() - k..);
                    out.squared.extend_from_within(out.squared.len() - k..);
                }
            }
        }
    }

    /// Appends to `out` the `k` nearest of every position. The tree holds at least `k` points.
    #[inline(always)]
    pub(in crate::neighbours) fn places<S: Simd>(
        &mut self,
        simd: S,
        tree: &Tree,
        places: &[[f32; 3]],
        (k, out): (usize, &mut Rows),
    ) {
        let mut last = Known { place: [0.0; 3], radius: f32::INFINITY };
        for &at in places {
            // The triangle inequality with the last query bounds the search radius.
            self.walk(simd, tree, at, (k, limit(last.radius + squared(at, last.place).sqrt()), None));
            self.ranking.write(simd, k, out);
            last = Known { place: at, radius: radius(out) };
        }
    }

    /// Collects all points within a squared distance of a position; returns their number.
    #[inline(always)]
    pub(in crate::neighbours) fn collect<S: Simd>(&mut self, simd: S, tree: &Tree, at: [f32; 3], limit: f32) -> usize {
        self.ranking.len = 0;
        if !tree.nodes.is_empty() {
            self.walk(simd, tree, at, (tree.index.len(), limit, None));
        }
        self.ranking.len
    }

    /// Appends the nearest `count` of the collected points to `out`.
    #[inline(always)]
    pub(in crate::neighbours) fn write<S: Simd>(&mut self, simd: S, count: usize, out: &mut Rows) {
        if count > 0 {
            self.ranking.write(simd, count, out);
        }
    }

    /// Solves the queries of a leaf. Returns the last one.
    #[inline(always)]
    fn batch<S: Simd>(
        &mut self,
        simd: S,
        tree: &Tree,
        (leaf, chunk): (&Leaf, &Chunk),
        (k, last): (usize, Option<Known>),
        out: &mut Rows,
    ) -> Known {
        let mut known = [[f32::INFINITY; LANES]; 4];
        let mut before = match last {
            Some(known) if self.list.fill(simd, tree, &leaf.bounds, (far(&leaf.bounds, known), LISTED)) => last,
            _ => None,
        };
        let mut listed = before.is_some();
        let mut likely = before.map_or(f32::INFINITY, |known| known.radius);
        let guess = (1.0 + SPREAD / (k as f32).sqrt()).sqrt();
        let mut last = Known { place: [0.0; 3], radius: f32::INFINITY };
        for l in 0..(leaf.count as usize).min(LANES) {
            let (at, own) = (chunk.place(l), chunk.index[l]);
            let radius_at = match before.take() {
                Some(b) => b.radius + squared(at, b.place).sqrt(),
                None => nearest_known(&known, at),
            };
            let certain = limit(radius_at);
            if listed {
                // The distance is mostly about that of the last query; if it is larger, the search is repeated with the
                // certain bound.
                let likely = limit(likely * guess);
                self.visit_listed(simd, tree, (at, own), certain.min(likely));
                if self.ranking.len < k && likely < certain {
                    self.visit_listed(simd, tree, (at, own), certain);
                }
            }
            if !listed || self.ranking.len < k {
                self.walk(simd, tree, at, (k, certain, Some(own)));
            }
            self.ranking.write(simd, k, out);
            last = Known { place: at, radius: radius(out) };
            likely = last.radius;
            if l == 0 && !listed {
                listed = self.list.fill(simd, tree, &leaf.bounds, (far(&leaf.bounds, last), LISTED));
            }
            (0..3).for_each(|a| known[a][l] = at[a]);
            known[3][l] = last.radius;
        }
        last
    }

    /// Collects every point of the listed leaves within the limit, excluding the query itself.
    #[inline(always)]
    fn visit_listed<S: Simd>(&mut self, simd: S, tree: &Tree, (at, own): ([f32; 3], u32), limit: f32) {
        let count = self.list.within(simd, at, limit, &mut self.visit);
        self.ranking.len = 0;
        for &leaf in &self.visit[..count] {
            scan(simd, (&tree.chunks[leaf as usize], own), (at, limit), &mut self.ranking);
        }
    }

    /// Collects the `k` nearest of a position, and perhaps more, by walking the tree, the nearest child first. `limit`
    /// is a known bound of the squared distance. One point can be excluded.
    #[inline(always)]
    fn walk<S: Simd>(&mut self, simd: S, tree: &Tree, at: [f32; 3], (k, mut limit, but): (usize, f32, Option<u32>)) {
        let place = Bounds { low: at, high: at };
        self.ranking.len = 0;
        self.stack.clear();
        self.stack.push((0.0, 0));
        while let Some((bound, n)) = self.stack.pop() {
            if bound > limit {
                continue;
            }
            if n & IS_LEAF == 0 {
                let node = &tree.nodes[n as usize];
                let (gaps, first) = (node.gaps(&place), self.stack.len());
                let mark = if node.holds_leaves { IS_LEAF } else { 0 };
                let near = gaps.iter().zip(&node.child).take(node.count).filter(|(gap, _)| **gap <= limit);
                self.stack.extend(near.map(|(&gap, &child)| (gap, child | mark)));
                self.stack[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
                continue;
            }
            let chunk = &tree.chunks[(n ^ IS_LEAF) as usize];
            scan(simd, (chunk, but.unwrap_or(u32::MAX)), (at, limit), &mut self.ranking);
            if self.ranking.len >= 2 * k.max(LANES) {
                limit = limit.min(self.ranking.shrink(k));
            }
        }
    }
}

/// Collects the points of a leaf within the limit, excluding one.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "chains of iterators are not turned into vectors")]
fn scan<S: Simd>(simd: S, (chunk, but): (&Chunk, u32), (at, limit): ([f32; 3], f32), kept: &mut Ranking) {
    let mut d = [0.0f32; LANES];
    for l in 0..LANES {
        let (x, y, z) = (chunk.x[l] - at[0], chunk.y[l] - at[1], chunk.z[l] - at[2]);
        let squared = x * x + y * y + z * z;
        d[l] = if chunk.index[l] == but { f32::NAN } else { squared };
    }
    append(simd, (&d, limit), bits(&d), (&mut kept.squared, kept.len));
    kept.len += append(simd, (&d, limit), &chunk.index, (&mut kept.index, kept.len));
}

/// The distance of the last neighbour of the last row.
#[inline(always)]
fn radius(rows: &Rows) -> f32 {
    rows.squared.last().map_or(f32::INFINITY, |&d| f32::from_bits(d).sqrt())
}

/// A radius around a position that certainly contains its k nearest, by the triangle inequality.
#[inline(always)]
fn nearest_known(known: &[[f32; LANES]; 4], at: [f32; 3]) -> f32 {
    let mut radius = [f32::INFINITY; LANES];
    for l in 0..LANES {
        let (x, y, z) = (known[0][l] - at[0], known[1][l] - at[1], known[2][l] - at[2]);
        radius[l] = known[3][l] + (x * x + y * y + z * z).sqrt();
    }
    least(radius)
}

/// The squared search radius for all queries of a leaf, from one solved query.
#[inline(always)]
fn far(bounds: &Bounds, known: Known) -> f32 {
    let far = [0, 1, 2].map(|a| (bounds.high[a] - known.place[a]).abs().max((known.place[a] - bounds.low[a]).abs()));
    limit(known.radius + squared(far, [0.0; 3]).sqrt())
}
