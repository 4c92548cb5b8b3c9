//! LZF, the compression of `binary_compressed` PCD (M. Lehmann, LibLZF).
//!
//! Format: a control byte below 32 is followed by that many literal bytes plus one. Other control bytes copy from at
//! most 8192 bytes back: the upper three bits are the length minus two (7: another length byte follows), the lower five
//! bits and the next byte are the distance minus one.

/// Largest ratio of output to input: three bytes copy at most 264.
pub(super) const MOST_RATIO: u64 = 88;
const LONGEST: usize = 264;
const FARTHEST: usize = 8192;
const LITERALS: usize = 32;

/// Unpacks to exactly `size` bytes, for which `out` (empty) has room; the error is the offset in the input.
pub(super) fn unpack(packed: &[u8], size: usize, mut out: Vec<u8>) -> std::result::Result<Vec<u8>, usize> {
    let mut at = 0;
    while let Some(&control) = packed.get(at) {
        let control = usize::from(control);
        at += 1;
        if control < LITERALS {
            out.extend_from_slice(packed.get(at..at + control + 1).ok_or(at)?);
            at += control + 1;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(*packed.get(at).ok_or(at)?);
                at += 1;
            }
            let distance = (control & 31) << 8 | usize::from(*packed.get(at).ok_or(at)?);
            at += 1;
            copy(&mut out, distance + 1, length + 2).ok_or(at)?;
        }
        if out.len() > size {
            return Err(at);
        }
    }
    if out.len() == size { Ok(out) } else { Err(at) }
}

/// Appends `length` bytes from `distance` back; source and destination may overlap.
fn copy(out: &mut Vec<u8>, distance: usize, length: usize) -> Option<()> {
    let start = out.len().checked_sub(distance)?;
    let mut left = length;
    while left > 0 {
        let now = left.min(out.len() - start);
        out.extend_from_within(start..start + now);
        left -= now;
    }
    Some(())
}

/// Packs bytes greedily, with a table of the last position of each hash of three bytes.
pub(super) fn pack(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() / 2);
    let mut places = vec![usize::MAX; 1 << 14];
    let (mut at, mut pending) = (0, 0);
    while at < bytes.len() {
        let found = bytes.get(at..at + 3).and_then(|three| {
            let key = u32::from_le_bytes([three[0], three[1], three[2], 0]).wrapping_mul(0x9e37_79b1) >> 18;
            let old = std::mem::replace(&mut places[key as usize], at);
            let distance = at.checked_sub(old)?;
            let same = matching(bytes, old, at);
            (distance <= FARTHEST && same >= 3).then_some((distance, same))
        });
        let Some((distance, length)) = found else {
            at += 1;
            continue;
        };
        literals(&mut out, &bytes[pending..at]);
        let (high, low) = ((distance - 1) >> 8, ((distance - 1) & 255) as u8);
        match length - 2 {
            short @ 1..=6 => out.push((short << 5 | high) as u8),
            long => out.extend([(7 << 5 | high) as u8, (long - 7) as u8]),
        }
        out.push(low);
        at += length;
        pending = at;
    }
    literals(&mut out, &bytes[pending..]);
    out
}

fn matching(bytes: &[u8], old: usize, at: usize) -> usize {
    bytes[old..].iter().zip(&bytes[at..]).take(LONGEST).take_while(|(a, b)| a == b).count()
}

fn literals(out: &mut Vec<u8>, bytes: &[u8]) {
    for run in bytes.chunks(LITERALS) {
        out.push((run.len() - 1) as u8);
        out.extend_from_slice(run);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_packing_done_by_hand_unpacks() {
        // "abc", then 6 bytes from 3 back, then 264 copies of the last byte.
        let packed = [2, b'a', b'b', b'c', 4 << 5, 2, 7 << 5, 255, 0];
        let expected = [b"abcabcabc".to_vec(), vec![b'c'; 264]].concat();
        assert_eq!(unpack(&packed, 273, Vec::new()), Ok(expected));
        assert_eq!(unpack(&packed, 272, Vec::new()), Err(9));
        assert_eq!(unpack(&packed[..8], 273, Vec::new()), Err(8));
        assert_eq!(unpack(&[32, 0], 3, Vec::new()), Err(2), "a copy from before the start");
    }

    proptest! {
        #[test]
        fn what_is_packed_unpacks(bytes in prop::collection::vec(0u8..4, 0..3000)) {
            let packed = pack(&bytes);
            prop_assert_eq!(unpack(&packed, bytes.len(), Vec::new()), Ok(bytes.clone()));
            prop_assert!(bytes.len() as u64 <= packed.len() as u64 * MOST_RATIO);
        }

        #[test]
        fn any_bytes_unpack_or_fail(bytes in prop::collection::vec(any::<u8>(), 0..300), size in 0usize..1000) {
            if let Ok(out) = unpack(&bytes, size, Vec::new()) {
                prop_assert_eq!(out.len(), size);
            }
        }
    }
}
