"""Bringing what people have to what the core takes: native, C-ordered numpy arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

NUMBERS = "fiub"
"""numpy's kinds of real numbers: floats, signed and unsigned integers, booleans."""

_COLUMN_TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")


def coordinates(points: Any) -> NDArray[np.float64]:
    """``points`` as an ``(n, 3)`` array of float64, not copied if it is one already."""
    array = np.asarray(points)
    if array.dtype.kind not in NUMBERS:
        raise TypeError(f"coordinates: expected an (n, 3) array of numbers, found dtype {array.dtype}")
    if array.size == 0 and array.ndim < 2:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"coordinates: expected shape (n, 3), found {array.shape}")
    return np.ascontiguousarray(array, dtype=np.float64)


def column(values: Any, name: str, length: int | None = None) -> NDArray[Any]:
    """``values`` as one number a point, in a type that the core has."""
    array = np.asarray(values)
    if array.dtype.kind not in NUMBERS:
        raise TypeError(f"{name}: expected a one-dimensional array of numbers, found dtype {array.dtype}")
    if array.ndim != 1 or (length is not None and len(array) != length):
        expected = "(n,)" if length is None else f"({length},)"
        raise ValueError(f"{name}: expected shape {expected}, found {array.shape}")
    if array.dtype.kind == "b":
        return np.ascontiguousarray(array, dtype=np.uint8)
    if array.dtype == np.float16:
        return np.ascontiguousarray(array, dtype=np.float32)
    native = array.dtype.newbyteorder("=")
    if native.str[1:] not in _COLUMN_TYPES:
        native = np.dtype(np.float64)
    return np.ascontiguousarray(array, dtype=native)


def codes(values: Any, name: str, length: int | None = None) -> NDArray[np.uint8]:
    """``values`` as class codes 0..255, one a point."""
    array = column(values, name, length)
    if array.dtype == np.uint8:
        return array
    wrong = ~((array >= 0) & (array <= 255) & (array == np.floor(array)))
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise ValueError(f"{name}: expected whole numbers in 0..255, found {array[first]} at index {first}")
    return array.astype(np.uint8)
