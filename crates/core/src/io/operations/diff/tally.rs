//! Counts the differences between two columns.

use super::FieldDifference;
use crate::cloud::Values;

/// Differences of one field in the blocks so far.
#[derive(Clone, Debug)]
pub(super) struct Tally {
    pub(super) name: String,
    /// Numbers count as equal if they differ by no more than this.
    pub(super) tolerance: f64,
    /// Factor by which differences are multiplied in the report.
    pub(super) unit: f64,
    differing: u64,
    first: u64,
    largest: f64,
    one_sided: u64,
}

impl Tally {
    pub(super) fn new(name: impl Into<String>) -> Self {
        let largest = f64::NAN;
        Self { name: name.into(), tolerance: 0.0, unit: 1.0, differing: 0, first: 0, largest, one_sided: 0 }
    }

    /// Compares the values of the points from `first` on, up to the end of the shorter block.
    pub(super) fn compare(&mut self, a: &Values, b: &Values, first: u64) {
        if identical(a, b) {
            return;
        }
        for i in 0..a.len().min(b.len()) {
            if same_bits(a, b, i) {
                continue;
            }
            let (x, y) = (a.get(i), b.get(i));
            let close = (x - y).abs() <= self.tolerance && !integers(a, b);
            // Columns of two types hold numbers; then values are equal if the numbers are.
            let equal =
                a.type_name() != b.type_name() && x.to_bits() == y.to_bits() && whole(a, i, x) == whole(b, i, y);
            if !(close && self.tolerance > 0.0 || equal) {
                self.note(first + i as u64, (x - y).abs());
                self.one_sided += u64::from(x.is_finite() != y.is_finite());
            }
        }
    }

    fn note(&mut self, point: u64, apart: f64) {
        if self.differing == 0 {
            self.first = point;
        }
        self.differing += 1;
        if apart.is_finite() {
            // `max` prefers a number to NaN.
            self.largest = self.largest.max(apart * self.unit);
        }
    }

    /// The result, if anything differs.
    pub(super) fn finish(self) -> Option<FieldDifference> {
        let Self { name, differing, first, largest, one_sided, .. } = self;
        (differing > 0).then_some(FieldDifference { name, differing, first, largest, one_sided })
    }
}

macro_rules! pairs {
    ($a:expr, $b:expr, ints: $($int:ident),*; floats: $($float:ident),*; $x:ident, $y:ident => $same:expr, $bits:expr) => {
        match ($a, $b) {
            $((Values::$int($x), Values::$int($y)) => $same,)*
            $((Values::$float($x), Values::$float($y)) => $bits,)*
            _ => false,
        }
    };
}

/// Whether two columns of one type are equal, bit by bit.
fn identical(a: &Values, b: &Values) -> bool {
    pairs!(a, b, ints: U8, I8, U16, I16, U32, I32, U64, I64; floats: F32, F64; x, y =>
        x == y,
        x.len() == y.len() && x.iter().zip(y).all(|(p, q)| p.to_bits() == q.to_bits()))
}

/// Whether value `i` of two columns of one type is equal, bit by bit.
fn same_bits(a: &Values, b: &Values, i: usize) -> bool {
    pairs!(a, b, ints: U8, I8, U16, I16, U32, I32, U64, I64; floats: F32, F64; x, y =>
        x[i] == y[i],
        x[i].to_bits() == y[i].to_bits())
}

/// Whether both columns are integers of one type: these are compared exactly, even where `f64` would round.
fn integers(a: &Values, b: &Values) -> bool {
    a.type_name() == b.type_name() && !matches!(a, Values::F32(_) | Values::F64(_))
}

/// Value `i`, about `number`, as an exact integer where `f64` may have rounded it.
fn whole(values: &Values, i: usize, number: f64) -> i128 {
    match values {
        Values::U64(v) => i128::from(v[i]),
        Values::I64(v) => i128::from(v[i]),
        _ => number as i128,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(a: &Values, b: &Values) -> Option<(u64, u64, f64)> {
        let mut tally = Tally::new("x");
        tally.compare(a, b, 10);
        tally.finish().map(|d| (d.differing, d.first, d.largest))
    }

    #[test]
    fn values_are_compared_bit_by_bit() {
        let nan = f64::NAN;
        assert_eq!(tally(&Values::F64(vec![1.0, nan, 0.0]), &Values::F64(vec![1.0, nan, -0.0])), Some((1, 12, 0.0)));
        let large = 1u64 << 60;
        assert_eq!(tally(&Values::U64(vec![large, 2]), &Values::U64(vec![large + 1, 2])), Some((1, 10, 0.0)));
        assert_eq!(tally(&Values::U8(vec![1, 2, 9]), &Values::U8(vec![1, 5, 2])), Some((2, 11, 7.0)));
    }

    #[test]
    fn a_number_differs_from_none() {
        let told = |a: Vec<f32>, b: Vec<f32>| {
            let mut tally = Tally::new("x");
            tally.compare(&Values::F32(a), &Values::F32(b), 0);
            let found = tally.finish().unwrap();
            (found.differing, found.one_sided, found.largest)
        };
        let (differing, one_sided, largest) = told(vec![f32::NAN, 5.0], vec![2.0, f32::INFINITY]);
        assert!((differing, one_sided) == (2, 2) && largest.is_nan(), "{largest}");
        assert_eq!(told(vec![f32::NAN, 5.0, 1.0], vec![2.0, 8.0, 1.0]), (2, 1, 3.0));
        assert_eq!(told(vec![f32::NAN, 0.0], vec![f32::INFINITY, 0.5]), (2, 0, 0.5));
    }

    #[test]
    fn a_number_is_the_same_in_another_type() {
        assert_eq!(tally(&Values::U8(vec![2, 6]), &Values::F32(vec![2.0, 6.0])), None);
        assert_eq!(tally(&Values::F64(vec![0.5]), &Values::F32(vec![0.5])), None);
        let large = 1u64 << 60;
        let rounded = Values::F64(vec![large as f64; 2]);
        assert_eq!(tally(&Values::U64(vec![large, large + 1]), &rounded), Some((1, 11, 0.0)));
        assert!(tally(&Values::F64(vec![0.1]), &Values::F32(vec![0.1])).is_some());
        assert_eq!(tally(&Values::U8(vec![2]), &Values::F32(vec![2.5])), Some((1, 10, 0.5)));
    }
}
