//! Named columns: one value a point, in the data type of the file.

/// The values of a column, in the data type of the file.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "each variant is the type it names")]
pub enum Values {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    U64(Vec<u64>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Applies the same expression to the contained vector, whatever its type.
macro_rules! each_values {
    ($values:expr, $v:ident => $body:expr) => {
        match $values {
            Values::U8($v) => $body,
            Values::I8($v) => $body,
            Values::U16($v) => $body,
            Values::I16($v) => $body,
            Values::U32($v) => $body,
            Values::I32($v) => $body,
            Values::U64($v) => $body,
            Values::I64($v) => $body,
            Values::F32($v) => $body,
            Values::F64($v) => $body,
        }
    };
}
pub(crate) use each_values;

impl Values {
    /// Number of values.
    pub fn len(&self) -> usize {
        each_values!(self, v => v.len())
    }

    /// True if there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Value `i` as a floating-point number (64-bit integers above 2^53 are rounded).
    #[expect(clippy::unnecessary_cast, reason = "one expression for all types")]
    pub fn get(&self, i: usize) -> f64 {
        each_values!(self, v => v[i] as f64)
    }

    /// All values as `f32`.
    #[expect(clippy::unnecessary_cast, reason = "one expression for all types")]
    pub fn to_f32(&self) -> Vec<f32> {
        each_values!(self, v => v.iter().map(|&x| x as f32).collect())
    }

    /// All values as `f64`.
    #[expect(clippy::unnecessary_cast, reason = "one expression for all types")]
    pub fn to_f64(&self) -> Vec<f64> {
        each_values!(self, v => v.iter().map(|&x| x as f64).collect())
    }

    /// Type name as in numpy: `u1`, `i2`, `f4`, ...
    pub fn type_name(&self) -> &'static str {
        match self {
            Self::U8(_) => "u1",
            Self::I8(_) => "i1",
            Self::U16(_) => "u2",
            Self::I16(_) => "i2",
            Self::U32(_) => "u4",
            Self::I32(_) => "i4",
            Self::U64(_) => "u8",
            Self::I64(_) => "i8",
            Self::F32(_) => "f4",
            Self::F64(_) => "f8",
        }
    }

    fn select(&self, indices: &[u32]) -> Self {
        macro_rules! pick {
            ($($variant:ident),*) => {
                match self { $(Self::$variant(v) => Self::$variant(indices.iter().map(|&i| v[i as usize]).collect()),)* }
            };
        }
        pick!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
    }
}

/// A named column of a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name; PDAL's dimension name if there is one.
    pub name: String,
    /// One value a point.
    pub values: Values,
}

impl Column {
    /// A column with that name.
    pub fn new(name: impl Into<String>, values: Values) -> Self {
        Self { name: name.into(), values }
    }

    /// The values at `indices`, in that order.
    pub fn select(&self, indices: &[u32]) -> Self {
        Self { name: self.name.clone(), values: self.values.select(indices) }
    }
}
