"""Conversion of edges and weights to what the core takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion._arrays import NUMBERS, native, unmasked


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
    array = unmasked(values, name)
    if array.dtype.kind not in NUMBERS:
        raise TypeError(f"{name}: expected numbers, found dtype {array.dtype}")
    if array.ndim != 2 or array.shape[1] == 0:
        raise ValueError(f"{name}: expected shape (n, width) with a width of 1 or more, found {array.shape}")
    return native(array, np.float32)


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


def valued(values: Any, edges: Any, weights: Any, node_weights: Any) -> Valued:
    """A graph with values on its nodes: values, edges, weights of the edges and of the nodes."""
    rows, pairs = as_rows(values, "values"), as_edges(edges)
    return rows, pairs, as_weights(weights, len(pairs)), as_weights(node_weights, len(rows), "node_weights")
