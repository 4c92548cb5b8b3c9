//! Morton order: interleaving the bits of three cell indices, so that cells near in space are mostly near in the order.
//!
//! A code shifted right by 3 is the code of the enclosing cell of twice the size.

/// Cell indices per axis are below this.
pub const LIMIT: u32 = 1 << 21;

/// Interleaves three indices below [`LIMIT`]; x takes the lowest bit.
#[inline(always)]
pub fn encode(cell: [u32; 3]) -> u64 {
    spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
}

/// The three indices of a code.
#[inline(always)]
pub fn decode(code: u64) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

/// Interleaves two indices below 2^32; x takes the lowest bit. A code shifted right by 2 is that of the enclosing cell.
#[inline(always)]
pub fn encode_plane(cell: [u32; 2]) -> u64 {
    spread_plane(cell[0]) | spread_plane(cell[1]) << 1
}

#[inline(always)]
fn spread_plane(index: u32) -> u64 {
    let mut v = u64::from(index);
    v = (v | v << 16) & 0x0000_ffff_0000_ffff;
    v = (v | v << 8) & 0x00ff_00ff_00ff_00ff;
    v = (v | v << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    v = (v | v << 2) & 0x3333_3333_3333_3333;
    (v | v << 1) & 0x5555_5555_5555_5555
}

#[inline(always)]
fn spread(index: u32) -> u64 {
    let mut v = u64::from(index) & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

#[inline(always)]
fn gather(code: u64) -> u32 {
    let mut v = code & 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10c3_0c30_c30c_30c3;
    v = (v | v >> 4) & 0x100f_00f0_0f00_f00f;
    v = (v | v >> 8) & 0x001f_0000_ff00_00ff;
    v = (v | v >> 16) & 0x001f_0000_0000_ffff;
    ((v | v >> 32) & 0x1f_ffff) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_interleave_bits_and_come_back() {
        assert_eq!(encode([1, 0, 0]), 1);
        assert_eq!(encode([0, 1, 0]), 2);
        assert_eq!(encode([3, 0, 1]), 0b1101);
        for cell in [[0, 0, 0], [LIMIT - 1, 5, 77], [123_456, LIMIT - 1, 2_000_000]] {
            assert_eq!(decode(encode(cell)), cell);
            assert_eq!(decode(encode(cell) >> 3), cell.map(|c| c >> 1));
        }
        assert_eq!(encode_plane([3, 1]), 0b0111);
        let bits = |index: u32| (0..32).fold(0u64, |sum, bit| sum | u64::from(index >> bit & 1) << (2 * bit));
        for [x, y] in [[0, u32::MAX], [123_456, 99_999], [1 << 31, 5]] {
            assert_eq!(encode_plane([x, y]), bits(x) | bits(y) << 1);
            assert_eq!(encode_plane([x, y]) >> 2, encode_plane([x >> 1, y >> 1]));
        }
    }
}
