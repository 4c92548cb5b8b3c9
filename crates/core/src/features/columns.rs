//! Where the features of a group stand in the rows of a table.

use std::ops::Range;

/// Which features of each layer of a group (a size of cells, say) are selected, and the columns they stand in.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    of_layer: Vec<Vec<Column>>,
}

/// A selected feature of a layer.
#[derive(Clone, Copy, Debug)]
struct Column {
    /// Its number within the layer.
    feature: usize,
    /// Its column in the table.
    column: usize,
}

/// The rows of a table.
pub(crate) struct TableRows<'a> {
    /// Row-major.
    pub(crate) values: &'a mut [f32],
    /// Number of columns.
    pub(crate) width: usize,
}

/// Rows that are filled together, layer by layer: they and the cells of a layer around them stay in the fast caches.
const TOGETHER: usize = 64;

impl TableRows<'_> {
    /// Calls `work` with the numbers of rows that are filled together, and the rows.
    pub(super) fn together(self, mut work: impl FnMut(Range<usize>, &mut [f32])) {
        let width = self.width.max(1);
        for (part, rows) in self.values.chunks_mut(TOGETHER * width).enumerate() {
            let first = part * TOGETHER;
            work(first..first + rows.len() / width, rows);
        }
    }
}

impl Columns {
    /// Selects a feature of a layer for a column.
    pub(super) fn put(&mut self, layer: usize, feature: usize, column: usize) {
        self.of_layer.resize(self.of_layer.len().max(layer + 1), Vec::new());
        self.of_layer[layer].push(Column { feature, column });
    }

    /// Whether no feature is selected.
    pub(super) fn is_empty(&self) -> bool {
        self.of_layer.is_empty()
    }

    /// Whether a feature of a layer is selected.
    pub(super) fn any(&self, layer: usize) -> bool {
        self.of_layer.get(layer).is_some_and(|columns| !columns.is_empty())
    }

    /// Writes the selected ones of all features of a layer into a row; NaN if there are none.
    #[inline(always)]
    pub(super) fn write(&self, layer: usize, features: Option<&[f32]>, row: &mut [f32]) {
        for &Column { feature, column } in &self.of_layer[layer] {
            row[column] = features.map_or(f32::NAN, |features| features[feature]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_filled_in_order_and_rows_without_columns_not_at_all() {
        for (rows, width) in [(0, 3), (1, 3), (64, 2), (150, 5), (9, 0)] {
            let mut values = vec![0.0; rows * width];
            let mut next = 0;
            TableRows { values: &mut values, width }.together(|places, rows| {
                assert_eq!((places.start, rows.len()), (next, places.len() * width));
                rows.fill(1.0);
                next = places.end;
            });
            assert_eq!(next, if width == 0 { 0 } else { rows });
            assert!(values.iter().all(|&v| v == 1.0));
        }
    }

    #[test]
    fn selected_features_stand_in_their_columns() {
        let mut columns = Columns::default();
        assert!(columns.is_empty());
        [[1, 2, 0], [1, 0, 3], [3, 1, 1]].into_iter().for_each(|[layer, feature, at]| columns.put(layer, feature, at));
        assert_eq!([0, 1, 2, 3, 4].map(|layer| columns.any(layer)), [false, true, false, true, false]);
        let mut row = [0.0; 4];
        columns.write(1, Some(&[5.0, 6.0, 7.0]), &mut row);
        columns.write(3, None, &mut row);
        assert_eq!([row[0], row[2], row[3]], [7.0, 0.0, 5.0]);
        assert!(row[1].is_nan() && !columns.is_empty());
    }
}
