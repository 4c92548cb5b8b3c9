//! The k nearest points in a k-d tree: for one query, and for all points of a leaf together.
//!
//! The queries of a leaf share the list of leaves that may hold their neighbours. The search radius of a query q
//! follows from the last solved query p: the k nearest of p and p itself lie within r(p) + |pq| of q (triangle
//! inequality).

use super::build::Bounds;
use super::lanes::{LANES, Selection, append, bits, least};
use super::list::List;
use super::rank::{Ranking, Rows};
use super::tree::{Chunk, Tree};
use pulp::Simd;

/// Factor in the first guess of the search radius: the disc of the last query is enlarged by this share over √k, which
/// is the spread of the number of points in a disc of constant density.
const SPREAD: f32 = 1.2;
/// No point is excluded from a search.
const NONE: u32 = u32::MAX;
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

/// What is searched: the `k` nearest points of a tree.
#[derive(Clone, Copy, Debug)]
pub(in crate::neighbours) struct Nearest<'a> {
    pub(in crate::neighbours) tree: &'a Tree,
    pub(in crate::neighbours) k: usize,
}

/// Where it is searched.
#[derive(Clone, Copy, Debug)]
struct Query {
    at: [f32; 3],
    /// Largest squared distance.
    limit: f32,
    /// Index of a point that is excluded.
    but: u32,
}

/// A leaf whose points are the queries, and the query solved before them.
#[derive(Clone, Copy, Debug)]
struct Batch {
    leaf: usize,
    last: Option<Known>,
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
    pub(super) fn leaves<S: Simd>(&mut self, simd: S, of: Nearest<'_>, leaves: std::ops::Range<usize>, out: &mut Rows) {
        let Nearest { tree, k } = of;
        let mut last = None;
        for id in leaves {
            let leaf = &tree.leaves[id];
            last = Some(self.batch(simd, of, Batch { leaf: id, last }, out));
            // Points that are not kept coincide with kept ones and have the first of these as nearest points.
            let beyond = tree.points_of(id..id + 1).len() - leaf.count as usize;
            if beyond > 0 {
                self.walk(simd, of, Query { at: leaf.bounds.low, limit: f32::INFINITY, but: NONE });
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
        of: Nearest<'_>,
        places: &[[f32; 3]],
        out: &mut Rows,
    ) {
        let mut last = Known { place: [0.0; 3], radius: f32::INFINITY };
        for &at in places {
            // The triangle inequality with the last query bounds the search radius.
            let limit = limit(last.radius + squared(at, last.place).sqrt());
            self.walk(simd, of, Query { at, limit, but: NONE });
            self.ranking.write(simd, of.k, out);
            last = Known { place: at, radius: radius(out) };
        }
    }

    /// Collects all points within a squared distance of a position; returns their number.
    #[inline(always)]
    pub(in crate::neighbours) fn collect<S: Simd>(&mut self, simd: S, tree: &Tree, at: [f32; 3], limit: f32) -> usize {
        self.ranking.len = 0;
        if !tree.nodes.is_empty() {
            self.walk(simd, Nearest { tree, k: tree.index.len() }, Query { at, limit, but: NONE });
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
    fn batch<S: Simd>(&mut self, simd: S, of: Nearest<'_>, batch: Batch, out: &mut Rows) -> Known {
        let Nearest { tree, k } = of;
        let (leaf, chunk, last) = (&tree.leaves[batch.leaf], &tree.chunks[batch.leaf], batch.last);
        let mut known = [[f32::INFINITY; LANES]; 4];
        let mut before = match last {
            Some(known) if self.list.fill(simd, tree, &leaf.bounds, far(&leaf.bounds, known)) => last,
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
                self.visit_listed(simd, tree, Query { at, limit: certain.min(likely), but: own });
                if self.ranking.len < k && likely < certain {
                    self.visit_listed(simd, tree, Query { at, limit: certain, but: own });
                }
            }
            if !listed || self.ranking.len < k {
                self.walk(simd, of, Query { at, limit: certain, but: own });
            }
            self.ranking.write(simd, k, out);
            last = Known { place: at, radius: radius(out) };
            likely = last.radius;
            if l == 0 && !listed {
                listed = self.list.fill(simd, tree, &leaf.bounds, far(&leaf.bounds, last));
            }
            (0..3).for_each(|a| known[a][l] = at[a]);
            known[3][l] = last.radius;
        }
        last
    }

    /// Collects every point of the listed leaves within the limit, excluding the query itself.
    #[inline(always)]
    fn visit_listed<S: Simd>(&mut self, simd: S, tree: &Tree, query: Query) {
        let count = self.list.within(simd, query.at, query.limit, &mut self.visit);
        self.ranking.len = 0;
        for &leaf in &self.visit[..count] {
            scan(simd, &tree.chunks[leaf as usize], query, &mut self.ranking);
        }
    }

    /// Collects the `k` nearest of a position, and perhaps more, by walking the tree, the nearest child first. The
    /// limit is a known bound of the squared distance.
    #[inline(always)]
    fn walk<S: Simd>(&mut self, simd: S, Nearest { tree, k }: Nearest<'_>, query: Query) {
        let Query { at, mut limit, but } = query;
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
            scan(simd, chunk, Query { at, limit, but }, &mut self.ranking);
            if self.ranking.len >= 2 * k.max(LANES) {
                limit = limit.min(self.ranking.shrink(k));
            }
        }
    }
}

/// Collects the points of a leaf within the limit, excluding one.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "chains of iterators are not turned into vectors")]
fn scan<S: Simd>(simd: S, chunk: &Chunk, Query { at, limit, but }: Query, kept: &mut Ranking) {
    let mut d = [0.0f32; LANES];
    for l in 0..LANES {
        let (x, y, z) = (chunk.x[l] - at[0], chunk.y[l] - at[1], chunk.z[l] - at[2]);
        let squared = x * x + y * y + z * z;
        d[l] = if chunk.index[l] == but { f32::NAN } else { squared };
    }
    let of = |column| Selection { values: &d, limit, column };
    append(simd, of(bits(&d)), &mut kept.squared, kept.len);
    kept.len += append(simd, of(&chunk.index), &mut kept.index, kept.len);
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
