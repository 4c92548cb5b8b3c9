//! Selection of small values among 16 at a time, by compaction.

use pulp::{Simd, bytemuck};

/// Number of values that are compared together.
pub(super) const LANES: usize = 16;

/// The entries of `column` whose values are at most `limit`; NaN is never selected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Selection<'a> {
    pub(super) values: &'a [f32; LANES],
    pub(super) limit: f32,
    pub(super) column: &'a [u32; LANES],
}

/// Appends the selected entries to a table whose first `len` entries are in use; returns their number. The table grows by
/// whole vectors.
#[inline(always)]
pub(super) fn append<S: Simd>(simd: S, selection: Selection<'_>, table: &mut Vec<u32>, len: usize) -> usize {
    if table.len() < len + LANES {
        table.resize(2 * (len + LANES), 0);
    }
    let Some(out) = table[len..].first_chunk_mut::<LANES>() else { return 0 };
    #[cfg(target_arch = "x86_64")]
    if let Some(v4) = (&simd as &dyn std::any::Any).downcast_ref::<pulp::x86::V4>() {
        let Selection { values, limit, column } = selection;
        let limit = v4.avx512f._mm512_set1_ps(limit);
        let taken = v4.avx512f._mm512_cmple_ps_mask(bytemuck::cast(*values), limit);
        *out = bytemuck::cast(v4.avx512f._mm512_maskz_compress_epi32(taken, bytemuck::cast(*column)));
        return taken.count_ones() as usize;
    }
    one_by_one(selection, out)
}

/// The same without branches, for any machine.
#[inline(always)]
fn one_by_one(Selection { values, limit, column }: Selection<'_>, out: &mut [u32; LANES]) -> usize {
    let mut taken = 0usize;
    for (value, column) in values.iter().zip(column) {
        out[taken & (LANES - 1)] = *column;
        taken = taken.wrapping_add(usize::from(*value <= limit));
    }
    taken
}

/// Bit patterns of 16 numbers.
#[inline(always)]
pub(super) fn bits(values: &[f32; LANES]) -> &[u32; LANES] {
    bytemuck::cast_ref(values)
}

/// The larger of two; the first if the comparison is with NaN.
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

/// The smallest of 16.
#[inline(always)]
pub(super) fn least(mut values: [f32; LANES]) -> f32 {
    for half in [8, 4, 2, 1] {
        for l in 0..half {
            values[l] = if values[l + half] < values[l] { values[l + half] } else { values[l] };
        }
    }
    values[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    struct Append<'a>(&'a [f32; LANES], f32, &'a mut Vec<u32>, usize);

    impl WithSimd for Append<'_> {
        type Output = usize;

        fn with_simd<S: Simd>(self, simd: S) -> usize {
            let column = &std::array::from_fn(|l| l as u32 + 100);
            append(simd, Selection { values: self.0, limit: self.1, column }, self.2, self.3)
        }
    }

    #[test]
    fn places_of_small_values_are_appended_in_their_order() {
        let mut value: [f32; LANES] = std::array::from_fn(|l| (l * 7 % 16) as f32);
        value[3] = f32::NAN;
        value[5] = f32::INFINITY;
        for (limit, expected) in [
            (4.0, vec![100, 107, 112, 114]),
            (-1.0, vec![]),
            (f32::INFINITY, (100..116).filter(|i| *i != 103).collect()),
        ] {
            let (mut fast, mut slow) = (vec![9, 9], vec![9, 9]);
            assert_eq!(Arch::new().dispatch(Append(&value, limit, &mut fast, 2)), expected.len());
            assert_eq!(pulp::Scalar::new().vectorize(Append(&value, limit, &mut slow, 2)), expected.len());
            let all: Vec<u32> = [9, 9].into_iter().chain(expected).collect();
            assert_eq!((&fast[..all.len()], &slow[..all.len()]), (&all[..], &all[..]));
        }
    }

    #[test]
    fn the_least_is_found_and_what_is_not_a_number_stays() {
        assert_eq!(least(std::array::from_fn(|l| ((l as f32) - 9.0).abs())), 0.0);
        assert!(larger(f32::NAN, 0.0).is_nan());
        assert_eq!((larger(1.0, 2.0), larger(2.0, 1.0), *bits(&[1.0; LANES])), (2.0, 2.0, [1f32.to_bits(); LANES]));
    }
}
