//! The npy header: type, order and shape of an array (NumPy Enhancement Proposal 1).

use crate::io::table::number::Kind;

/// Type of the elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    Number {
        kind: Kind,
        big: bool,
    },
    /// 16-bit floating-point numbers, which become `f32`.
    Half {
        big: bool,
    },
    /// Text with this many characters of 4 bytes.
    Text {
        characters: usize,
        big: bool,
    },
}

impl Element {
    pub(super) fn size(self) -> usize {
        match self {
            Self::Number { kind, .. } => kind.size(),
            Self::Half { .. } => 2,
            Self::Text { characters, .. } => characters.saturating_mul(4),
        }
    }
}

/// An array's header.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Npy {
    pub(super) element: Element,
    /// Column-major instead of row-major.
    pub(super) fortran: bool,
    pub(super) shape: Vec<u64>,
    /// Offset of the first byte after the header.
    pub(super) body: usize,
}

/// Longest header that is accepted.
pub(super) const LONGEST: usize = 65_536;

impl Npy {
    /// Parses a header; `None` if it is invalid, or of a non-numeric type.
    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let version = *bytes.strip_prefix(b"\x93NUMPY")?.first()?;
        let (length, start): (usize, usize) = match version {
            1 => (usize::from(u16::from_le_bytes(crate::io::table::number::array(bytes, 8))), 10),
            2 | 3 => (u32::from_le_bytes(crate::io::table::number::array(bytes, 8)) as usize, 12),
            _ => return None,
        };
        let text = std::str::from_utf8(bytes.get(start..start.checked_add(length)?)?).ok()?;
        let value = |key: &str| {
            let after = text.split_once(&format!("'{key}'"))?.1;
            Some(after.trim_start().strip_prefix(':')?.trim_start())
        };
        let descr = value("descr")?.strip_prefix('\'')?.split('\'').next()?;
        let shape = value("shape")?.strip_prefix('(')?.split(')').next()?;
        let shape = shape.split(',').map(str::trim).filter(|w| !w.is_empty());
        Some(Self {
            element: element(descr)?,
            fortran: value("fortran_order")?.starts_with("True"),
            shape: shape.map(|w| w.trim_end_matches('L').parse().ok()).collect::<Option<_>>()?,
            body: start + length,
        })
    }

    /// Number of elements, unless it exceeds 2^64.
    pub(super) fn count(&self) -> Option<u64> {
        self.shape.iter().try_fold(1u64, |product, &n| product.checked_mul(n))
    }
}

fn element(descr: &str) -> Option<Element> {
    let big = match descr.as_bytes().first()? {
        b'<' | b'|' => false,
        b'>' => true,
        _ => return None,
    };
    let kind = match &descr[1..] {
        "u1" | "b1" => Kind::U8,
        "i1" => Kind::I8,
        "u2" => Kind::U16,
        "i2" => Kind::I16,
        "u4" => Kind::U32,
        "i4" => Kind::I32,
        "u8" => Kind::U64,
        "i8" => Kind::I64,
        "f4" => Kind::F32,
        "f8" => Kind::F64,
        "f2" => return Some(Element::Half { big }),
        other => return Some(Element::Text { characters: other.strip_prefix('U')?.parse().ok()?, big }),
    };
    Some(Element::Number { kind, big })
}

/// Header of a row-major array of this type (`<f8`) and shape.
pub(super) fn header(descr: &str, shape: &[usize]) -> Vec<u8> {
    let shape: String = shape.iter().map(|n| format!("{n},")).collect();
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape}), }}");
    // Data start at a multiple of 64 bytes, as numpy writes them.
    let padded = (10 + text.len() + 1).next_multiple_of(64) - 10;
    text.extend(std::iter::repeat_n(' ', padded - text.len() - 1));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

/// The value of a 16-bit floating-point number (IEEE 754 binary16).
pub(super) fn half(bits: u16) -> f32 {
    let (exponent, fraction) = (bits >> 10 & 31, f32::from(bits & 1023));
    let size = match exponent {
        0 => fraction * 2f32.powi(-24),
        31 if fraction > 0.0 => f32::NAN,
        31 => f32::INFINITY,
        _ => (1024.0 + fraction) * 2f32.powi(i32::from(exponent) - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_all_versions_are_understood() {
        let npy = Npy::parse(&header("<f8", &[7, 3])).unwrap();
        let element = Element::Number { kind: Kind::F64, big: false };
        assert_eq!(npy, Npy { element, fortran: false, shape: vec![7, 3], body: 128 });
        let dict = b"{'shape': (5,), 'fortran_order': True, 'descr': '>u2'}\n";
        let second = [b"\x93NUMPY\x02\x00".as_slice(), &(dict.len() as u32).to_le_bytes(), dict].concat();
        let npy = Npy::parse(&second).unwrap();
        assert_eq!((npy.fortran, &npy.shape[..], npy.element.size()), (true, &[5][..], 2));
        for descr in ["|O", "<c16", "<M8[s]", "", "<"] {
            assert_eq!(Npy::parse(&header(descr, &[1])), None, "{descr}");
        }
        assert_eq!(Npy::parse(&header("<f8", &[])).unwrap().count(), Some(1));
    }

    #[test]
    fn halves_have_their_values() {
        for (bits, value) in
            [(0x3c00, 1.0), (0xc000, -2.0), (0x7bff, 65_504.0), (0x0001, 5.960_464_5e-8), (0x7c00, f32::INFINITY)]
        {
            assert_eq!(half(bits), value);
        }
        assert!(half(0x7e00).is_nan());
    }
}
