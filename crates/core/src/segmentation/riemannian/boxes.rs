//! A bounding-box hierarchy over positions in spatial order, so that a search can skip groups of them.

use std::ops::Range;

/// Positions in a box of the finest level, and child boxes in a box of the others.
const WIDTH: usize = 8;

/// An axis-parallel box, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    low: [f32; 3],
    high: [f32; 3],
}

impl Bounds {
    /// The box of a single position.
    pub(super) fn at(place: [f32; 3]) -> Self {
        Self { low: place, high: place }
    }

    /// The empty box.
    pub(super) fn none() -> Self {
        Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] }
    }

    /// Extends the box to hold another.
    #[inline(always)]
    pub(super) fn include(&mut self, other: &Self) {
        for a in 0..3 {
            self.low[a] = self.low[a].min(other.low[a]);
            self.high[a] = self.high[a].max(other.high[a]);
        }
    }

    /// Squared distance between boxes. Rounding is monotone, so that the result is never above the computed squared
    /// distance `(dx² + dy²) + dz²` of two positions inside.
    #[inline(always)]
    pub(super) fn gap(&self, other: &Self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|a| (self.low[a] - other.high[a]).max(other.low[a] - self.high[a]).max(0.0));
        x * x + y * y + z * z
    }
}

/// Boxes of 8 consecutive positions, of 8 such boxes, and so on up to a single one.
#[derive(Clone, Debug, Default)]
pub(super) struct Boxes {
    /// The finest level first.
    levels: Vec<Vec<Bounds>>,
    places: usize,
}

impl Boxes {
    /// Boxes over positions in any order; efficient only if neighbours in the list are near in space. O(n).
    pub(super) fn new(places: &[[f32; 3]]) -> Self {
        let unite = |boxes: &[Bounds]| {
            let mut all = Bounds::none();
            boxes.iter().for_each(|b| all.include(b));
            all
        };
        let finest = places.chunks(WIDTH).map(|row| unite(&row.iter().map(|&p| Bounds::at(p)).collect::<Vec<_>>()));
        let mut levels: Vec<Vec<Bounds>> = vec![finest.collect()];
        while let Some(last) = levels.last().filter(|last| last.len() > 1) {
            levels.push(last.chunks(WIDTH).map(unite).collect());
        }
        Self { levels, places: places.len() }
    }

    /// Visits, in ascending order, the positions in boxes that the visitor wants: `wants(level, box index, box)` is
    /// asked from the top down, `take` receives the positions of the finest boxes.
    #[inline(always)]
    pub(super) fn visit(&self, state: &mut impl Visitor) {
        let mut stack = [(0u32, 0u32); 8 * 12];
        let top = self.levels.len().saturating_sub(1);
        let mut depth = 0;
        if self.places > 0 {
            stack[0] = (top as u32, 0);
            depth = 1;
        }
        while depth > 0 {
            depth -= 1;
            let (level, index) = (stack[depth].0 as usize, stack[depth].1 as usize);
            if !state.wants(level, index, &self.levels[level][index]) {
                continue;
            }
            if level == 0 {
                state.take(index * WIDTH..((index + 1) * WIDTH).min(self.places));
                continue;
            }
            let children = index * WIDTH..((index + 1) * WIDTH).min(self.levels[level - 1].len());
            for child in children.rev() {
                stack[depth] = (level as u32 - 1, child as u32);
                depth += 1;
            }
        }
    }

    /// One value for every box: `finest` computes it from positions, `unite` from the values of the child boxes.
    pub(super) fn summarise<T: Copy>(
        &self,
        finest: impl Fn(Range<usize>) -> T,
        unite: impl Fn(T, T) -> T,
    ) -> Vec<Vec<T>> {
        let rows = (0..self.places.div_ceil(WIDTH)).map(|b| finest(b * WIDTH..((b + 1) * WIDTH).min(self.places)));
        let mut all: Vec<Vec<T>> = vec![rows.collect()];
        for _ in 1..self.levels.len() {
            let next = match all.last() {
                Some(last) => last.chunks(WIDTH).filter_map(|c| c.iter().copied().reduce(&unite)).collect(),
                None => Vec::new(),
            };
            all.push(next);
        }
        all
    }
}

/// A search in the boxes.
pub(super) trait Visitor {
    /// Whether a box may contain a result.
    fn wants(&mut self, level: usize, index: usize, bounds: &Bounds) -> bool;
    /// The positions of a finest box that was wanted.
    fn take(&mut self, places: Range<usize>);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    struct Near(Bounds, f32, Vec<usize>);

    impl Visitor for Near {
        fn wants(&mut self, _: usize, _: usize, bounds: &Bounds) -> bool {
            bounds.gap(&self.0) <= self.1
        }

        fn take(&mut self, places: Range<usize>) {
            self.2.extend(places);
        }
    }

    #[test]
    fn every_place_within_reach_is_visited_once_in_order() {
        let mut random = stream(1, 2);
        for count in [0, 1, 7, 8, 9, 64, 65, 700] {
            let mut places: Vec<[f32; 3]> =
                (0..count).map(|_| std::array::from_fn(|_| random.uniform() as f32)).collect();
            places.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let boxes = Boxes::new(&places);
            let mut near = Near(Bounds::at([0.3, 0.5, 0.5]), 0.01, vec![]);
            boxes.visit(&mut near);
            assert!(near.2.windows(2).all(|w| w[0] < w[1]));
            let inside = |&i: &usize| Bounds::at(places[i]).gap(&near.0) <= 0.01;
            assert!((0..count).filter(inside).all(|i| near.2.contains(&i)));
            let counts = boxes.summarise(|range| range.len(), |a, b| a + b);
            assert!(count == 0 || counts.last().unwrap() == &[count]);
        }
    }
}
