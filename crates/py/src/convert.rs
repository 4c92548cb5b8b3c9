//! numpy arrays to slices and back. The Python side converts arrays to native C order; this is only checked here.

use crate::call::in_pieces;
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use scansion_core::cloud::Values;

/// The elements of a C-ordered matrix, borrowed.
pub(crate) fn matrix<'a, T: Element>(array: &'a PyReadonlyArray2<'_, T>, name: &str) -> PyResult<&'a [T]> {
    let order = |_| PyValueError::new_err(format!("{name}: expected a C-contiguous array"));
    array.as_slice().map_err(order)
}

/// The elements of a vector, borrowed.
pub(crate) fn vector<'a, T: Element>(array: &'a PyReadonlyArray1<'_, T>, name: &str) -> PyResult<&'a [T]> {
    let order = |_| PyValueError::new_err(format!("{name}: expected a contiguous array"));
    array.as_slice().map_err(order)
}

/// Rows of three numbers as one vector per axis.
pub(crate) fn axes<T: Element + Copy + Send + Sync>(
    py: Python<'_>,
    array: &PyReadonlyArray2<'_, T>,
    name: &str,
) -> PyResult<[Vec<T>; 3]> {
    let [rows, columns] = [array.shape()[0], array.shape()[1]];
    if columns != 3 {
        return Err(PyValueError::new_err(format!("{name}: found shape ({rows}, {columns}), expected (n, 3)")));
    }
    let (values, _) = matrix(array, name)?.as_chunks::<3>();
    let mut axes = [0; 3].map(|_| Vec::with_capacity(rows));
    in_pieces(py, rows, |piece| {
        (0..3).for_each(|a| axes[a].extend(values[piece.clone()].iter().map(|row| row[a])));
    })?;
    Ok(axes)
}

/// The vertices of lines, which stand one line after the other in a matrix; `counts` are the numbers of vertices.
pub(crate) fn pieces<const D: usize>(
    vertices: &PyReadonlyArray2<'_, f64>,
    counts: &PyReadonlyArray1<'_, u64>,
) -> PyResult<Vec<Vec<[f64; D]>>> {
    let (rows, counts) = (matrix(vertices, "vertices")?, vector(counts, "counts")?);
    let (rows, rest) = rows.as_chunks::<D>();
    let wrong = || PyValueError::new_err("counts: expected the number of vertices of each line");
    let mut first = 0usize;
    let piece = |&count: &u64| {
        let last = usize::try_from(count).ok().and_then(|count| first.checked_add(count));
        let found = last.and_then(|last| rows.get(first..last)).ok_or_else(wrong)?;
        first += found.len();
        Ok(found.to_vec())
    };
    let found = counts.iter().map(piece).collect::<PyResult<_>>()?;
    if vertices.shape()[1] == D && rest.is_empty() { Ok(found) } else { Err(wrong()) }
}

/// Row-major values as a matrix without a copy.
pub(crate) fn to_matrix<T: Element>(py: Python<'_>, values: Vec<T>, width: usize) -> PyResult<Bound<'_, PyArray2<T>>> {
    let rows = values.len().checked_div(width).unwrap_or(0);
    PyArray1::from_vec(py, values).reshape([rows, width])
}

/// A column of any number type as a numpy vector.
pub(crate) fn to_vector<'py>(py: Python<'py>, values: &Values) -> Bound<'py, PyAny> {
    match values {
        Values::U8(v) => PyArray1::from_slice(py, v).into_any(),
        Values::I8(v) => PyArray1::from_slice(py, v).into_any(),
        Values::U16(v) => PyArray1::from_slice(py, v).into_any(),
        Values::I16(v) => PyArray1::from_slice(py, v).into_any(),
        Values::U32(v) => PyArray1::from_slice(py, v).into_any(),
        Values::I32(v) => PyArray1::from_slice(py, v).into_any(),
        Values::U64(v) => PyArray1::from_slice(py, v).into_any(),
        Values::I64(v) => PyArray1::from_slice(py, v).into_any(),
        Values::F32(v) => PyArray1::from_slice(py, v).into_any(),
        Values::F64(v) => PyArray1::from_slice(py, v).into_any(),
    }
}

/// A numpy vector as a column's values, in its own type.
pub(crate) fn values(array: &Bound<'_, PyAny>, name: &str) -> PyResult<Values> {
    macro_rules! first_that_fits {
        ($($variant:ident $element:ty),*) => {
            $(if let Ok(array) = array.extract::<PyReadonlyArray1<'_, $element>>() {
                return Ok(Values::$variant(vector(&array, name)?.to_vec()));
            })*
        };
    }
    first_that_fits!(U8 u8, I8 i8, U16 u16, I16 i16, U32 u32, I32 i32, U64 u64, I64 i64, F32 f32, F64 f64);
    let message = "expected a one-dimensional numpy array of 8 to 64-bit integers or 32 or 64-bit floats";
    Err(PyTypeError::new_err(format!("column {name}: {message}, found {}", array.get_type())))
}

/// Whether an array of the column's own type has the column's values, bit by bit.
pub(crate) fn holds(values: &Values, array: &Bound<'_, PyAny>) -> PyResult<bool> {
    macro_rules! of_its_type {
        ($($variant:ident $element:ty),*) => {
            match values {
                $(Values::$variant(own) => {
                    let array = array.extract::<PyReadonlyArray1<'_, $element>>()?;
                    let array = vector(&array, "column")?;
                    let same = |(a, b): (&$element, &$element)| a.to_ne_bytes() == b.to_ne_bytes();
                    Ok(own.len() == array.len() && own.iter().zip(array).all(same))
                })*
            }
        };
    }
    of_its_type!(U8 u8, I8 i8, U16 u16, I16 i16, U32 u32, I32 i32, U64 u64, I64 i64, F32 f32, F64 f64)
}
