//! Features: what a point's surroundings look like, as numbers.

/// Feature values, one row a point, with the name of each column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureTable {
    /// Name of each column, e.g. `planarity_r0p4`.
    pub names: Vec<String>,
    /// Row-major: `values[row * names.len() + column]`.
    pub values: Vec<f32>,
}

impl FeatureTable {
    /// Number of columns.
    pub fn width(&self) -> usize {
        self.names.len()
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        if self.names.is_empty() { 0 } else { self.values.len() / self.names.len() }
    }

    /// Values of one row.
    pub fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.width()..(row + 1) * self.width()]
    }
}
