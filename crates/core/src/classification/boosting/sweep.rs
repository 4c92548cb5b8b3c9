//! Prediction with small trees without branches: each node is evaluated for a whole tile of rows, parents before
//! children.

use super::model::Boosting;
use crate::classification::nodes::LEAF_CUT;
use crate::classification::quantise::{CodeBlock, Column, TILE};

/// Largest number of nodes of such a tree.
pub(super) const NARROW: usize = 256;

/// A split of a small tree: rows at `node` with a code above `cut` move to `left + 1`, others to `left`.
#[derive(Clone, Copy)]
struct SmallSplit {
    feature: u16,
    node: u8,
    cut: u8,
    left: u8,
}

/// Adds the leaf values of all trees to the scores, compiled for each instruction set. For trees of at most [`NARROW`]
/// nodes; `scores` holds a column of `stride` rows, a multiple of [`TILE`], for each group.
pub(super) struct Sweep<'a> {
    pub(super) model: &'a Boosting,
    pub(super) codes: &'a CodeBlock<u8>,
    pub(super) stride: usize,
    pub(super) scores: &'a mut [f32],
}

impl pulp::WithSimd for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Sweep { model, codes, stride, scores } = self;
        let (groups, trees) = (model.groups().max(1), splits(model));
        for (tile, columns) in codes.by_tile.chunks_exact(codes.width.max(1)).enumerate() {
            for (tree, (splits, &root)) in trees.iter().zip(&model.roots).enumerate() {
                let mut at = [0u8; TILE];
                for split in splits {
                    if let Some(Column(column)) = columns.get(usize::from(split.feature)) {
                        step(&mut at, column, *split);
                    }
                }
                let leaf_values = model.leaf_values.get(root as usize..).unwrap_or_default();
                let first = (tree % groups) * stride + tile * TILE;
                let Some(scores) = scores.get_mut(first..).and_then(|s| s.first_chunk_mut::<TILE>()) else { continue };
                add(scores, &at, leaf_values);
            }
        }
    }
}

/// The splits of each tree, parents first.
fn splits(model: &Boosting) -> Vec<Vec<SmallSplit>> {
    let ends = model.roots.iter().skip(1).map(|&root| root as usize).chain([model.nodes.len()]);
    let trees = model.roots.iter().zip(ends).map(|(&root, end)| {
        let nodes = model.nodes.get(root as usize..end).unwrap_or_default().iter().enumerate();
        let splits = nodes.filter(|(_, node)| node.cut != LEAF_CUT).map(|(i, node)| SmallSplit {
            feature: node.feature,
            node: i as u8,
            cut: node.cut as u8,
            left: node.left.wrapping_sub(root) as u8,
        });
        splits.collect()
    });
    trees.collect()
}

/// Adds the leaf value at each row's node.
#[inline(always)]
fn add(scores: &mut [f32; TILE], at: &[u8; TILE], leaf_values: &[f32]) {
    let pairs = scores.iter_mut().zip(at);
    match leaf_values.first_chunk::<NARROW>() {
        Some(leaf_values) => pairs.for_each(|(score, &at)| *score += leaf_values[usize::from(at)]),
        None => pairs.for_each(|(score, &at)| *score += leaf_values.get(usize::from(at)).copied().unwrap_or_default()),
    }
}

/// Moves the rows at this split to one of its children.
#[inline(always)]
fn step(at: &mut [u8; TILE], column: &[u8; TILE], SmallSplit { node, cut, left, .. }: SmallSplit) {
    for (at, &code) in at.iter_mut().zip(column) {
        let next = left.wrapping_add(u8::from(code > cut));
        *at = if *at == node { next } else { *at };
    }
}
