//! Small trees without branches: every node is asked of 64 rows at once, in the order that children follow parents.

use super::super::descend::Codes;
use super::super::forest::LEAF_CUT;
use super::model::Boosting;

/// Rows that go through the trees together.
pub(super) const TILE: usize = 64;

/// Adds the answers of all trees to the scores, compiled for each instruction set. Trees of at most 256 nodes;
/// `codes.by_feature` has [`TILE`] codes to spare at its end; `scores` holds a column of `stride` rows, a multiple of
/// [`TILE`], for each group.
pub(super) struct Sweep<'a> {
    pub(super) model: &'a Boosting,
    pub(super) codes: &'a Codes<u8>,
    pub(super) stride: usize,
    pub(super) scores: &'a mut [f32],
}

impl pulp::WithSimd for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Sweep { model, codes, stride, scores } = self;
        let groups = model.groups().max(1);
        for tile in (0..codes.rows).step_by(TILE) {
            for (tree, &root) in model.roots.iter().enumerate() {
                let end = model.roots.get(tree + 1).map_or(model.nodes.len(), |&r| r as usize);
                let (Some(nodes), Some(answers)) =
                    (model.nodes.get(root as usize..end), model.answers.get(root as usize..end))
                else {
                    continue;
                };
                let mut at = [0u8; TILE];
                for (i, node) in nodes.iter().enumerate() {
                    if node.cut == LEAF_CUT {
                        continue;
                    }
                    let column = codes.by_feature.get(usize::from(node.feature) * codes.rows + tile..);
                    let Some(column) = column.and_then(|c| c.first_chunk::<TILE>()) else { continue };
                    step(&mut at, column, [i as u8, node.cut as u8, node.left.wrapping_sub(root) as u8]);
                }
                let first = (tree % groups) * stride + tile;
                let Some(scores) = scores.get_mut(first..).and_then(|s| s.first_chunk_mut::<TILE>()) else { continue };
                for (score, &at) in scores.iter_mut().zip(&at) {
                    *score += answers.get(usize::from(at)).copied().unwrap_or_default();
                }
            }
        }
    }
}

/// Rows that stand at `node` go on to one of its children.
#[inline(always)]
fn step(at: &mut [u8; TILE], column: &[u8; TILE], [node, cut, left]: [u8; 3]) {
    for (at, &code) in at.iter_mut().zip(column) {
        let next = left.wrapping_add(u8::from(code > cut));
        *at = if *at == node { next } else { *at };
    }
}
