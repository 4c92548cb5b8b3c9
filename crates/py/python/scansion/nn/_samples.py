"""Objects in the forms that users have, as the core takes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import to_json, unmasked
from scansion.nn._tensor import Entries, SparseTensor


def samples(X: Any, labels: NDArray[np.intp] | None, resolution: int) -> tuple[_core.Objects, dict[str, Any]]:
    """The objects, and the shape of one in cells."""
    codes = [] if labels is None else labels.tolist()
    if not isinstance(X, SparseTensor) and _are_points(X):
        return _points(X, codes, resolution)
    tensor = X if isinstance(X, SparseTensor) else _of_cells(X)
    if not 3 <= len(tensor.shape) <= 6 or 0 in tensor.shape[1:]:
        expected = "(samples, channels, cells along 1 to 4 axes), no length 0"
        raise ValueError(f"X: found shape {tensor.shape}, expected {expected}")
    count, channels, *extent = tensor.shape
    _same_length(count, codes, labels)
    lengths = [int(length) for length in extent]
    shape = {"channels": int(channels), "extent": lengths}
    size = int(channels) * math.prod(lengths)
    keys, values, _ = Entries.of(tensor, "X")
    starts = np.searchsorted(keys, np.arange(count + 1, dtype=np.uint64) * np.uint64(size)).tolist()
    return _core.Objects.of_entries(to_json(shape), starts, keys % np.uint64(size), values, codes), shape


def _are_points(X: Any) -> bool:
    """Whether these are arrays of points, one an object: shape (n, 3) each, or the instances of a cloud."""
    return isinstance(X, Sequence) and all(np.ndim(points) == 2 and np.shape(points)[1] == 3 for points in X)


def _points(X: Any, codes: list[int], resolution: int) -> tuple[_core.Objects, dict[str, Any]]:
    arrays = [unmasked(points, "X", np.float64) for points in X]
    _same_length(len(arrays), codes, codes or None)
    # Coordinates of maps have more digits than single precision; only the shape of an object matters.
    local = [points - points.mean(axis=0) if len(points) else points for points in arrays]
    rows = np.ascontiguousarray(np.concatenate([*local, np.zeros((0, 3))]), np.float32)
    starts = np.cumsum([0, *map(len, arrays)]).tolist()
    shape = {"channels": 1, "extent": [resolution] * 3}
    return _core.Objects.of_points(to_json(shape), starts, rows, codes), shape


def _of_cells(X: Any) -> SparseTensor:
    cells = unmasked(X, "X")
    if not 2 <= cells.ndim <= 5 or cells.dtype.kind not in "fiub":
        expected = "(n, cells, ...) with 1 to 4 axes of cells, a list of (m, 3) arrays of points, or a SparseTensor"
        raise ValueError(f"X: found shape {cells.shape} of dtype {cells.dtype}, expected {expected}")
    return SparseTensor.from_dense(cells[:, None])


def _same_length(count: int, codes: list[int], labels: Any) -> None:
    if labels is not None and count != len(codes):
        raise ValueError(f"y: found {len(codes)} labels for {count} objects")
