"""Conversion of edges and weights to what the core takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion._arrays import NUMBERS, native, unmasked

_LARGE = 1000
"""An offset of more than this many times the differences is subtracted from numbers before they become float32."""

_NOISE = 1e-14
"""Differences of less than this share of the offset are rounding errors of float64."""


def as_edges(edges: Any) -> NDArray[np.uint32]:
    """``edges`` as ``(m, 2)`` of uint32."""
    array = unmasked(edges, "edges")
    if array.size == 0:
        array = array.astype(np.uint32).reshape(0, 2)
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(f"edges: expected shape (m, 2), found {array.shape}")
    if array.dtype.kind not in "iu":
        raise TypeError(f"edges: expected whole numbers, found dtype {array.dtype}")
    if array.dtype != np.uint32 and array.size and (array.min() < 0 or array.max() > 0xFFFFFFFF):
        raise ValueError(f"edges: expected nodes in 0..4294967295, found {array.min()} and {array.max()}")
    return native(array, np.uint32)


def as_weights(weights: Any, length: int, name: str = "weights") -> NDArray[np.float32] | None:
    """``weights`` as ``(length,)`` of float32; a single number stands for all."""
    if weights is None:
        return None
    array = unmasked(weights, name)
    if array.dtype.kind not in NUMBERS:
        raise TypeError(f"{name}: expected numbers, found dtype {array.dtype}")
    if array.ndim == 0:
        array = np.full(length, array)
    if array.shape != (length,):
        raise ValueError(f"{name}: expected shape ({length},), found {array.shape}")
    return native(array, np.float32)


def as_rows(values: Any, name: str) -> NDArray[np.float32]:
    """``values`` as ``(n, width)`` of float32."""
    return native(_rows(values, name), np.float32)


def _rows(values: Any, name: str) -> NDArray[Any]:
    array = unmasked(values, name)
    if array.dtype.kind not in NUMBERS:
        raise TypeError(f"{name}: expected numbers, found dtype {array.dtype}")
    if array.ndim != 2 or array.shape[1] == 0:
        raise ValueError(f"{name}: expected shape (n, width) with a width of 1 or more, found {array.shape}")
    return array


def _precise_rows(values: Any, name: str) -> NDArray[Any]:
    """``values`` as ``(n, width)`` of float64, or of float32 if they are that already."""
    array = _rows(values, name)
    return array if array.dtype == np.float32 else array.astype(np.float64, copy=False)


def relative_to_columns(values: Any, name: str) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """``values`` as ``(n, width)`` of float32, and what was subtracted from each column: 0, or a large offset.

    >>> relative_to_columns([[1e8, 0.25], [1e8 + 1, 0.5]], "values")
    (array([[0.  , 0.25],
           [1.  , 0.5 ]], dtype=float32), array([1.e+08, 0.e+00]))
    """
    array = _precise_rows(values, name)
    if not len(array):
        return native(array, np.float32), np.zeros(array.shape[1])
    with np.errstate(invalid="ignore", over="ignore"):
        least = array.min(axis=0)
        far = _are_offset(array.max(axis=0) - least, least)
    offsets = np.where(far, least, 0)
    return native(array - offsets if far.any() else array, np.float32), offsets.astype(np.float64)


def relative_to_rows(costs: Any, name: str) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """``costs`` as ``(n, width)`` of float32, and what was subtracted from each row: 0, or a large offset.

    >>> relative_to_rows([[1e8, 1e8 - 1], [0.5, 0.25]], "unary")
    (array([[1.  , 0.  ],
           [0.5 , 0.25]], dtype=float32), array([99999999.,        0.]))
    """
    array = _precise_rows(costs, name)
    with np.errstate(invalid="ignore", over="ignore"):
        least = array.min(axis=1, keepdims=True)
        apart = array - least
        far = _are_offset(apart, least).any(axis=1, keepdims=True)
    offsets = np.where(far, least, 0)
    return native(np.where(far, apart, array) if far.any() else array, np.float32), offsets.ravel().astype(np.float64)


def _are_offset(apart: NDArray[Any], offset: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether differences are small beside the offset, so that float32 would round them."""
    size = np.abs(offset)
    found: NDArray[np.bool_] = (apart > _NOISE * size) & (apart < size / _LARGE)
    return found


def edges_between(
    pairs: NDArray[np.uint32], weights: NDArray[np.float32] | None, kept: NDArray[np.bool_]
) -> tuple[NDArray[np.uint32], NDArray[np.float32] | None]:
    """The edges whose ends are both kept, and their weights; the kept nodes are numbered anew.

    >>> edges_between(np.array([[0, 1], [1, 2], [0, 2]], np.uint32), None, np.array([True, False, True]))
    (array([[0, 1]], dtype=uint32), None)
    """
    for a, b in pairs[(pairs >= len(kept)).any(axis=1)][:1]:
        raise ValueError(f"edge {a}-{b} does not join two of the {len(kept)} nodes")
    inside = kept[pairs].all(axis=1)
    number = np.cumsum(kept, dtype=np.uint32) - np.uint32(1)
    return number[pairs[inside]], None if weights is None else weights[inside]


Valued = tuple[
    NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32] | None, NDArray[np.float32] | None
]


def valued(values: Any, edges: Any, weights: Any, node_weights: Any) -> tuple[Valued, NDArray[np.float64]]:
    """A graph with values on its nodes: values, edges, weights of the edges and of the nodes; and what was subtracted from
    each column of the values."""
    (rows, offsets), pairs = relative_to_columns(values, "values"), as_edges(edges)
    each = as_weights(weights, len(pairs)), as_weights(node_weights, len(rows), "node_weights")
    return (rows, pairs, *each), offsets
