//! Grows one tree: nodes are split depth-first, and their samples are partitioned stably in place.

use super::impurity::{BestSplit, Entry, SplitSearch, Weight};
use super::splitter::{CodeTable, Scan};
use crate::classification::nodes::GrownNode;
use crate::classification::params::{ForestParams, Trainer};
use crate::error::Result;
use crate::parallel::Monitor;
use crate::random::Stream;

/// Nodes of at most this many samples are copied into a small table that fits into the cache.
const LOCAL: usize = 4096;

/// A split of a forest: samples with value > threshold go right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::classification) struct ThresholdSplit {
    pub(in crate::classification) feature: u16,
    pub(in crate::classification) threshold: f32,
}

/// One trained tree; the number of a leaf is its row of probabilities. Leaf rows `0..classes` stand for pure leaves; `leaves` holds the rows from `classes` on.
#[derive(Clone, Debug, Default)]
pub(in crate::classification) struct ForestTree {
    pub(in crate::classification) nodes: Vec<GrownNode<ThresholdSplit>>,
    pub(in crate::classification) leaves: Vec<f32>,
    /// Decrease of impurity x weight by every feature.
    pub(in crate::classification) importance: Vec<f64>,
}

/// A node waiting to be split, and its range of samples.
#[derive(Clone, Copy)]
struct Task {
    node: usize,
    begin: usize,
    end: usize,
    depth: usize,
}

/// Codes of the current samples, feature-major.
#[derive(Clone, Copy)]
struct NodeTable<'a, C> {
    codes: &'a [C],
    stride: usize,
    local: bool,
}

impl<'a, C> NodeTable<'a, C> {
    fn column(&self, feature: usize) -> &'a [C] {
        &self.codes[feature * self.stride..(feature + 1) * self.stride]
    }
}

/// What the trees of a forest have in common.
pub(in crate::classification) struct TreeParams<'a, D> {
    pub(in crate::classification) columns: &'a D,
    pub(in crate::classification) params: &'a ForestParams,
    /// Number of classes.
    pub(in crate::classification) classes: usize,
    pub(in crate::classification) monitor: &'a Monitor,
}

/// A tree that is being grown.
pub(in crate::classification) struct ForestGrower<'a, D: CodeTable, S, W> {
    columns: &'a D,
    params: &'a ForestParams,
    monitor: &'a Monitor,
    random: Stream,
    scan: S,
    search: SplitSearch<D::Code>,
    order: Vec<u16>,
    buffer: Vec<Entry<W>>,
    tree: ForestTree,
}

impl<'a, D: CodeTable, S: Scan<D::Code, W>, W: Weight> ForestGrower<'a, D, S, W> {
    pub(in crate::classification) fn new(of: TreeParams<'a, D>, scan: S, random: Stream) -> Self {
        let TreeParams { columns, params, classes, monitor } = of;
        Self {
            columns,
            params,
            monitor,
            random,
            scan,
            search: SplitSearch::new(classes, params.criterion, params.min_samples_leaf),
            order: (0..columns.width() as u16).collect(),
            buffer: Vec::new(),
            tree: ForestTree { importance: vec![0.0; columns.width()], ..ForestTree::default() },
        }
    }

    /// Grows the tree on these samples (at least one; `row` is an index into the columns).
    pub(in crate::classification) fn grow(mut self, mut entries: Vec<Entry<W>>) -> Result<ForestTree> {
        let codes = self.columns.columns();
        let table = NodeTable { codes, stride: codes.len() / self.columns.width(), local: false };
        self.tree.nodes.push(GrownNode::Leaf(0));
        let all = entries.len();
        let weight: f64 = entries.iter().map(|e| e.weight.get()).sum();
        self.search.min_weight = self.params.min_weight_leaf * weight;
        self.subtree(table, &mut entries, Task { node: 0, begin: 0, end: all, depth: 0 })?;
        Ok(self.tree)
    }

    fn subtree(&mut self, table: NodeTable<'_, D::Code>, entries: &mut [Entry<W>], top: Task) -> Result<()> {
        let mut stack = vec![top];
        while let Some(task) = stack.pop() {
            self.monitor.check()?;
            let here = &mut entries[task.begin..task.end];
            self.search.open(here);
            if self.must_stop(here.len(), task.depth) {
                self.leaf(task.node);
            } else if !table.local && here.len() <= LOCAL && self.columns.row(0).is_some() {
                self.copied(here, task)?;
            } else {
                match self.best(table, here)? {
                    None => self.leaf(task.node),
                    Some(best) => {
                        let left = self.split(table, here, task.node, best);
                        let (first, middle) = (self.tree.nodes.len() - 2, task.begin + left);
                        stack.push(Task { node: first + 1, begin: middle, depth: task.depth + 1, ..task });
                        stack.push(Task { node: first, end: middle, depth: task.depth + 1, ..task });
                    }
                }
            }
        }
        Ok(())
    }

    fn must_stop(&self, samples: usize, depth: usize) -> bool {
        samples < self.params.min_samples_split.max(2 * self.params.min_samples_leaf)
            || depth >= self.params.depth_limit()
            || self.search.only_class().is_some()
    }

    /// Grows the subtree of a small node on a table of its own.
    fn copied(&mut self, entries: &mut [Entry<W>], task: Task) -> Result<()> {
        let (count, width) = (entries.len(), self.columns.width());
        let mut codes = vec![D::Code::default(); count * width];
        for (i, entry) in entries.iter_mut().enumerate() {
            let row = self.columns.row(entry.row as usize).unwrap_or_default();
            codes[i..].iter_mut().step_by(count).zip(row).for_each(|(to, &code)| *to = code);
            entry.row = i as u32;
        }
        let table = NodeTable { codes: &codes, stride: count, local: true };
        self.subtree(table, entries, Task { begin: 0, end: count, ..task })
    }

    /// Tries features in random order: `max_features` of them, and more until one is not constant.
    fn best(&mut self, table: NodeTable<'_, D::Code>, entries: &[Entry<W>]) -> Result<Option<BestSplit<D::Code>>> {
        let width = self.order.len();
        let wanted = self.params.max_features.resolve(width);
        let mut varied = false;
        for i in 0..width {
            if i >= wanted && varied {
                break;
            }
            self.monitor.check()?;
            self.order.swap(i, i + self.random.below(width - i));
            let feature = usize::from(self.order[i]);
            self.search.begin(feature);
            self.scan.scan(table.column(feature), entries, &mut self.search);
            varied |= self.search.varies();
        }
        Ok(self.search.best)
    }

    /// Writes the node, appends its children and partitions the samples; returns the number that go left.
    fn split(
        &mut self,
        table: NodeTable<'_, D::Code>,
        entries: &mut [Entry<W>],
        node: usize,
        best: BestSplit<D::Code>,
    ) -> usize {
        let draw = draw(self.params.trainer, &mut self.random);
        let (cut, threshold) = self.columns.threshold(&best, draw);
        self.tree.importance[best.feature] += (best.score - self.search.parent_score()).max(0.0);
        let left = self.tree.nodes.len() as u32;
        self.tree.nodes[node] = GrownNode::Split(ThresholdSplit { feature: best.feature as u16, threshold }, left);
        self.tree.nodes.extend([GrownNode::Leaf(0); 2]);
        partition(table.column(best.feature), cut, entries, &mut self.buffer)
    }

    fn leaf(&mut self, node: usize) {
        let totals = self.search.totals();
        let row = self.search.only_class().unwrap_or_else(|| {
            let sum: f64 = totals.iter().sum();
            let row = totals.len() + self.tree.leaves.len() / totals.len();
            self.tree.leaves.extend(totals.iter().map(|t| (t / sum) as f32));
            row
        });
        self.tree.nodes[node] = GrownNode::Leaf(row as u32);
    }
}

/// A random number in [0, 1) if the trainer draws thresholds at random.
fn draw(trainer: Trainer, random: &mut Stream) -> Option<f64> {
    match trainer {
        Trainer::Breiman => None,
        Trainer::Ethz => Some(random.uniform()),
    }
}

/// Moves samples with codes above `cut` behind the others, keeping the order on both sides; returns the number in
/// front.
fn partition<C: Copy + Ord, W: Weight>(
    column: &[C],
    cut: C,
    entries: &mut [Entry<W>],
    buffer: &mut Vec<Entry<W>>,
) -> usize {
    buffer.clear();
    let mut left = 0;
    for i in 0..entries.len() {
        let entry = entries[i];
        if column[entry.row as usize] > cut {
            buffer.push(entry);
        } else {
            entries[left] = entry;
            left += 1;
        }
    }
    entries[left..].copy_from_slice(buffer);
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partition_keeps_the_order_on_both_sides() {
        let column = [5u8, 1, 9, 3, 7, 2];
        let mut entries: Vec<Entry<u32>> = (0..6).map(|row| Entry { row, class: 0, weight: 1 }).collect();
        assert_eq!(partition(&column, 4, &mut entries, &mut Vec::new()), 3);
        assert_eq!(entries.iter().map(|e| e.row).collect::<Vec<_>>(), [1, 3, 5, 0, 2, 4]);
    }
}
