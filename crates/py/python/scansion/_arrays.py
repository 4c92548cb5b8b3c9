"""Conversion of inputs to what the core takes: native, C-ordered numpy arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

NUMBERS = "fiub"
"""numpy's kinds of real numbers: floats, signed and unsigned integers, booleans."""

_COLUMN_TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")

_MOST_SEGMENTS = 0xFFFFFFFF
"""The largest number of a segment."""


def native(array: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """The array in this type, C-ordered and aligned; not copied if it has this form already."""
    return np.require(array, dtype, ["C_CONTIGUOUS", "ALIGNED"])


def unmasked(values: Any, name: str, dtype: Any = None) -> NDArray[Any]:
    """``values`` as an array. Masked values are refused: numpy would take what lies behind the mask.

    >>> unmasked(np.ma.array([2, 6], mask=[False, True]), "labels")
    Traceback (most recent call last):
    ValueError: labels: found 1 masked values, expected none: .filled(value) gives them one, .compressed() leaves them out
    """
    _refuse_masked(values, name, _masked(values))
    array = np.asarray(values, dtype)
    # numpy makes NaN of masked values in lists of lists; to look for them takes longer than to make the array.
    if isinstance(values, (list, tuple)) and array.dtype.kind == "f" and np.isnan(array).any():
        _refuse_masked(values, name, _masked(values, deep=True))
    return array


def _refuse_masked(values: Any, name: str, count: int) -> None:
    if count:
        without = "numpy.ma.compress_rows" if getattr(values, "ndim", 1) == 2 else ".compressed()"
        advice = f".filled(value) gives them one, {without} leaves them out"
        raise ValueError(f"{name}: found {count} masked values, expected none: {advice}")


def _masked(values: Any, deep: bool = False) -> int:
    """Number of masked values in an array, or in a list of arrays, or, if ``deep``, in lists of lists."""
    if isinstance(values, (list, tuple)):
        kinds = (np.ma.MaskedArray, list, tuple) if deep else np.ma.MaskedArray
        return sum(_masked(part, deep) for part in values if isinstance(part, kinds))
    if not isinstance(values, np.ma.MaskedArray):
        return 0
    # The mask of a structured array has its fields.
    return int(np.count_nonzero(np.ascontiguousarray(np.ma.getmask(values)).view(np.bool_)))


def as_array(array: NDArray[Any], dtype: Any, copy: bool | None) -> NDArray[Any]:
    """The return value of ``__array__`` for a result whose main part is this array."""
    return np.array(array, dtype) if copy else np.asarray(array, dtype)


def coordinates(points: Any) -> NDArray[np.float64]:
    """``points`` as an ``(n, 3)`` array of float64, not copied if it is one already."""
    array = unmasked(points, "coordinates")
    if array.dtype.kind not in NUMBERS:
        raise TypeError(f"coordinates: expected an (n, 3) array of numbers, found dtype {array.dtype}")
    if array.size == 0 and array.ndim < 2:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"coordinates: expected shape (n, 3), found {array.shape}")
    return native(array, np.float64)


def column(values: Any, name: str, length: int | None = None) -> NDArray[Any]:
    """``values`` as one number a point, in a type that the core supports."""
    array = unmasked(values, name)
    if array.dtype.kind not in NUMBERS:
        raise TypeError(f"{name}: expected a one-dimensional array of numbers, found dtype {array.dtype}")
    if array.ndim != 1 or (length is not None and len(array) != length):
        expected = "(n,)" if length is None else f"({length},)"
        raise ValueError(f"{name}: expected shape {expected}, found {array.shape}")
    if array.dtype.kind == "b":
        return native(array, np.uint8)
    if array.dtype == np.float16:
        return native(array, np.float32)
    kind = array.dtype.newbyteorder("=")
    return native(array, kind if kind.str[1:] in _COLUMN_TYPES else np.float64)


def filled(value: Any, like: NDArray[Any] | None, length: int) -> NDArray[Any]:
    """One number for all points, in the type of the column that it replaces if that can hold it.

    >>> filled(7, np.zeros(2, np.uint8), 2), filled(300, np.zeros(2, np.uint8), 2)
    (array([7, 7], dtype=uint8), array([300, 300], dtype=uint16))
    """
    number = np.asarray(value)
    if like is None or number.dtype.kind not in NUMBERS:
        return np.full(length, number)
    return np.full(length, number, _holding(number, like.dtype))


def _holding(number: NDArray[Any], kind: np.dtype[Any]) -> np.dtype[Any]:
    """The type of a column of this type that takes a number: its own if that holds whole numbers exactly, and others in
    range."""
    if kind.kind != "f":
        return np.dtype(np.float64) if number.dtype.kind == "f" else np.result_type(kind, np.min_scalar_type(number))
    with np.errstate(over="ignore"):
        stored = number.astype(kind)
    fits = np.isfinite(stored) == np.isfinite(number) if number.dtype.kind == "f" else stored == number
    return kind if fits else np.dtype(np.float64)


def codes(values: Any, name: str, length: int | None = None) -> NDArray[np.uint8]:
    """``values`` as class codes 0..255, one a point."""
    array = column(values, name, length)
    if array.dtype == np.uint8:
        return array
    check_whole(array, name, 255)
    return array.astype(np.uint8)


def segments(values: Any, name: str, length: int | None = None) -> NDArray[Any]:
    """``values`` as numbers of segments 0..4294967295, one a point; -1 for points of none."""
    array = column(values, name, length)
    check_whole(array, name, _MOST_SEGMENTS, -1)
    return array


def in_segments(
    values: Any, name: str, length: int | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.bool_] | None]:
    """Segments of the points that are in one, and whether each point is (None: all are).

    >>> in_segments([7, -1, 3], "labels")
    (array([7, 3], dtype=uint32), array([ True, False,  True]))
    """
    array = segments(values, name, length)
    kept = array != -1
    return (native(array, np.uint32), None) if kept.all() else (native(array[kept], np.uint32), kept)


def check_whole(array: NDArray[Any], name: str, high: int, low: int = 0) -> None:
    """Refuses numbers that are not whole, below ``low``, above ``high`` or NaN."""
    wrong = (array < low) | (array > high)
    if array.dtype.kind == "f":
        wrong |= array != np.floor(array)
    refuse(wrong, array, f"{name}: expected whole numbers in {low}..{high}")


def whole_numbers(values: Any, name: str) -> NDArray[np.int64]:
    """``values`` as whole numbers of either sign, in an array of any shape."""
    array = unmasked(values, name)
    if array.dtype.kind not in NUMBERS:
        raise TypeError(f"{name}: expected whole numbers, found dtype {array.dtype}")
    if array.dtype.kind == "u":
        refuse(array > np.iinfo(np.int64).max, array, f"{name}: expected whole numbers below 2^63")
    if array.dtype == np.uint64:
        return native(array, np.uint64).view(np.int64)
    if array.dtype.kind == "f":
        refuse((array != np.floor(array)) | ~(np.abs(array) < 2.0**63), array, f"{name}: expected whole numbers")
    return native(array, np.int64)


def finite(array: NDArray[Any], name: str) -> NDArray[Any]:
    """The array, if it has neither NaN nor infinity."""
    refuse(~np.isfinite(array), array, f"{name}: expected finite numbers")
    return array


def refuse(wrong: NDArray[np.bool_], array: NDArray[Any], message: str) -> None:
    """Refuses an array with ``wrong`` numbers; the first of them is added to the message."""
    if wrong.any():
        at = np.unravel_index(int(wrong.argmax()), wrong.shape)
        raise ValueError(f"{message}, found {array[at]} at index {', '.join(str(i) for i in at)}")


def mask(values: Any, name: str, length: int | None = None) -> NDArray[np.bool_]:
    """``values`` as one truth value a point."""
    array = unmasked(values, name)
    if array.dtype != np.bool_ and array.size:
        raise TypeError(f"{name}: expected an array of bool, found dtype {array.dtype}")
    if array.ndim != 1 or (length is not None and len(array) != length):
        expected = "(n,)" if length is None else f"({length},)"
        raise ValueError(f"{name}: expected shape {expected}, found {array.shape}")
    return native(array, np.bool_)


def choice(value: Any, name: str, allowed: tuple[str, ...]) -> None:
    """Refuses a value that is not one of ``allowed``."""
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name}: found {value!r}, expected {' or '.join(repr(a) for a in allowed)}")


def to_json(settings: Mapping[str, Any], infinite: tuple[str, ...] = ()) -> str:
    """Settings as JSON, including numpy's numbers; numbers that are not finite are an error with their name, except that
    those named in ``infinite`` may be infinite."""
    return json.dumps(_finite(settings, infinite), default=_plain)


def _finite(settings: Mapping[str, Any], infinite: tuple[str, ...]) -> dict[str, Any]:
    """The same with infinity as the core reads it in JSON: as a word."""
    return {name: _word(name, value, infinite) for name, value in settings.items()}


def _word(name: str, value: Any, infinite: tuple[str, ...]) -> Any:
    if isinstance(value, Mapping):
        return _finite(value, infinite)
    if not isinstance(value, (float, np.floating)) or np.isfinite(value):
        return value
    if value == np.inf and name in infinite:
        return "inf"
    raise ValueError(f"{name}: found {value}, expected {'a' if name in infinite else 'a finite'} number")


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(
        f"found {value!r} of type {type(value).__name__}, expected a number, text, True, False or None"
    )
