"""Checks of tables and labels, with the messages of scikit-learn."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion._arrays import native, unmasked
from scansion._base import DataConversionWarning, from_sklearn


def table(values: Any, name: str, missing: bool = False) -> NDArray[np.float32]:
    """A table of numbers as C-ordered float32, at least one row and column, all finite (or NaN if ``missing``)."""
    if hasattr(values, "toarray") and hasattr(values, "nnz"):
        raise TypeError(
            "Sparse data was passed for X, but dense data is required. Use '.toarray()' to convert to a dense array."
        )
    array = unmasked(values, "X")
    if array.dtype.kind == "c":
        raise ValueError("Complex data not supported: X must be real numbers")
    _check_shape(array, name)
    if array.dtype.kind not in "fiub":
        array = array.astype(np.float64)
    with np.errstate(over="ignore"):
        result = native(array, np.float32)
    if not missing:
        _check_finite(result, "X", "float32")
    elif np.isinf(result).any():
        _refuse_infinity(result, "X", "float32")
    return result


def _check_shape(array: NDArray[Any], name: str) -> None:
    if array.ndim < 2:
        kind = "scalar" if array.ndim == 0 else "1D"
        raise ValueError(
            f"Expected 2D array, got {kind} array instead:\narray={array}.\nReshape your data either using "
            "array.reshape(-1, 1) if your data has a single feature or array.reshape(1, -1) if it contains a single "
            "sample."
        )
    if array.ndim > 2:
        raise ValueError(f"Found array with dim {array.ndim}, while dim <= 2 is required by {name}.")
    for count, what in zip(array.shape, ("sample", "feature"), strict=True):
        if count == 0:
            shape = f"(shape={array.shape})"
            raise ValueError(
                f"Found array with 0 {what}(s) {shape} while a minimum of 1 is required by {name}."
            )


def _check_finite(array: NDArray[Any], what: str, dtype: str) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        if math.isfinite(float(np.sum(array, dtype=np.float64))):
            return
    missing = np.isnan(array)
    if missing.any():
        raise ValueError(f"Input {what} contains NaN{_first(missing)}.")
    if np.isinf(array).any():
        _refuse_infinity(array, what, dtype)


def _refuse_infinity(array: NDArray[Any], what: str, dtype: str) -> None:
    place = _first(np.isinf(array))
    raise ValueError(f"Input {what} contains infinity or a value too large for dtype('{dtype}'){place}.")


def _first(wrong: NDArray[np.bool_]) -> str:
    """Where the first one is, and how many there are."""
    at = np.unravel_index(int(wrong.argmax()), wrong.shape)
    names = ("row", "column") if wrong.ndim == 2 else ("index",)
    place = ", ".join(f"{name} {i}" for name, i in zip(names, at, strict=True))
    count = int(np.count_nonzero(wrong))
    others = {1: "", 2: " and 1 other place"}.get(count, f" and {count - 1} other places")
    return f" at {place}{others}"


def labels(values: Any, rows: int, name: str) -> NDArray[Any]:
    """Class labels as a vector of ``rows`` discrete values."""
    if values is None:
        raise ValueError(f"This {name} estimator requires y to be passed, but the target y is None.")
    array = unmasked(values, "y")
    if array.ndim == 2 and array.shape[1] == 1:
        warnings.warn(
            "A column-vector y was passed when a 1d array was expected. Please change the shape of y to "
            "(n_samples,), for example using ravel().",
            from_sklearn(DataConversionWarning),
            stacklevel=3,
        )
        array = array.ravel()
    if array.ndim != 1:
        raise ValueError(f"y should be a 1d array, got an array of shape {array.shape} instead.")
    check_lengths(rows, len(array))
    if array.dtype.kind == "f":
        _check_finite(array, "y", str(array.dtype))
        if (array != np.floor(array)).any():
            raise ValueError(
                "Unknown label type: continuous. Maybe you are trying to fit a classifier, which expects discrete "
                "classes on a regression target with continuous values."
            )
    if array.dtype.kind == "O" and any(_is_missing(label) for label in array.tolist()):
        raise ValueError("Input y contains NaN.")
    if array.dtype.kind == "c":
        raise ValueError("Complex data not supported: y must be discrete labels")
    return array


def _is_missing(label: Any) -> bool:
    return label is None or (isinstance(label, (float, np.floating)) and bool(np.isnan(label)))


def check_lengths(rows: int, other: int) -> None:
    """Refuses a table and a vector of different lengths."""
    if rows != other:
        raise ValueError(f"Found input variables with inconsistent numbers of samples: [{rows}, {other}]")


def weights(values: Any, rows: int, dtype: Any = np.float32) -> NDArray[Any] | None:
    """Sample weights as float32 or another type: finite, not negative, not all zero."""
    if values is None:
        return None
    array = unmasked(values, "sample_weight")
    if array.ndim == 0:
        array = np.full(rows, array)
    if array.ndim != 1:
        raise ValueError(f"Sample weights must be 1D array or scalar, got {array.ndim}D array.")
    if len(array) != rows:
        raise ValueError(f"sample_weight.shape == {array.shape}, expected {(rows,)}!")
    with np.errstate(over="ignore"):
        result = native(array, dtype)
    _check_finite(result, "sample_weight", np.dtype(dtype).name)
    if (result < 0).any():
        raise ValueError(
            f"Negative values in data passed to `sample_weight`: found {result.min()}, expected >= 0"
        )
    if not result.any():
        raise ValueError("Sample weights must contain at least one non-zero number.")
    return result


def near_one(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same weights times a power of two, the largest from 0.5 to 1, so that their sum is finite; their ratios stay exact.

    >>> bool(near_one(np.array([1e308, 1e308])).sum() < 2)
    True
    """
    return np.ldexp(weights, -int(np.frexp(weights.max())[1]))


def feature_names(values: Any) -> NDArray[np.object_] | None:
    """Column names of a data frame, if all are text."""
    columns = getattr(values, "columns", None)
    if columns is None:
        return None
    names = np.asarray(columns, dtype=object)
    kinds = sorted({type(name).__name__ for name in names})
    if kinds == ["str"]:
        return names
    if "str" in kinds:
        raise TypeError(
            "Feature names are only supported if all input features have string names, but your input has "
            f"{kinds} as feature name / column name types. If you want feature names to be stored and validated, "
            "you must convert them all to strings, by using X.columns = X.columns.astype(str) for example."
        )
    return None


def check_feature_names(
    given: NDArray[np.object_] | None, fitted: NDArray[np.object_] | None, name: str
) -> None:
    """Refuses columns that are not those of ``fit``; warns if only one side has names."""
    if given is None and fitted is None:
        return
    if fitted is None:
        warnings.warn(f"X has feature names, but {name} was fitted without feature names", stacklevel=3)
    elif given is None:
        warnings.warn(
            f"X does not have valid feature names, but {name} was fitted with feature names", stacklevel=3
        )
    elif list(given) != list(fitted):
        raise ValueError(_names_differ(set(given), set(fitted)))


def _names_differ(given: set[str], fitted: set[str]) -> str:
    text = "The feature names should match those that were passed during fit.\n"
    parts = [("Feature names unseen at fit time:\n", given - fitted)]
    parts.append(("Feature names seen at fit time, yet now missing:\n", fitted - given))
    for title, names in parts:
        if names:
            text += title + "".join(f"- {name}\n" for name in sorted(names)[:5])
            text += "- ...\n" if len(names) > 5 else ""
    if given == fitted:
        text += "Feature names must be in the same order as they were in fit.\n"
    return text


def check_width(width: int, fitted: int, name: str) -> None:
    """Refuses a table whose number of columns is not that of ``fit``."""
    if width != fitted:
        raise ValueError(f"X has {width} features, but {name} is expecting {fitted} features as input.")
