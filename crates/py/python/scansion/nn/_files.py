"""Files in which sets of objects and networks come."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._settings import seed, whole

Path = str | os.PathLike[str]


def read_idx(path: Path) -> NDArray[np.uint8]:
    """The array of an IDX file of bytes, in which MNIST comes, compressed by gzip or not.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    array of uint8
        Of the shape that the file declares.

    Raises
    ------
    scansion.FileFormatError
        If it is no IDX file, has other elements than bytes, or is not as long as declared.
    """
    return _core.read_idx(os.fspath(path))


def read_off(path: Path) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """The mesh of an OFF file, in which ModelNet comes; faces of more than three corners are divided.

    Parameters
    ----------
    path : path
        The file; its counts may stand on the line of the word ``OFF``, as in some of ModelNet.

    Returns
    -------
    tuple of arrays
        Vertices of shape (n, 3), and for each triangle the rows of its vertices, of shape (m, 3).

    Raises
    ------
    scansion.FileFormatError
        With the line.
    """
    return _core.read_off(os.fspath(path))


def sample_surface(vertices: Any, triangles: Any, count: int, random_state: Any = None) -> NDArray[np.float64]:
    """Points on the surface of a mesh, each place with the same chance; the mesh need not be closed.

    Parameters
    ----------
    vertices : array of shape (n, 3)
        Coordinates.
    triangles : array of shape (m, 3)
        Rows of the vertices of each triangle.
    count : int
        Number of points.
    random_state : int, numpy.random.RandomState or None
        Seed; None means 0.

    Returns
    -------
    array of shape (count, 3)

    Examples
    --------
    >>> from scansion import nn
    >>> points = nn.sample_surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], 100)
    >>> bool((points.sum(axis=1) <= 1).all())
    True
    """
    triangles = np.asarray(triangles)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or (triangles < 0).any():
        raise ValueError(f"triangles: found shape {triangles.shape}, expected (m, 3) and rows, 0 or more")
    corners = np.ascontiguousarray(vertices, np.float64)
    if corners.ndim != 2:
        raise ValueError(f"vertices: found shape {corners.shape}, expected (n, 3)")
    rows = np.ascontiguousarray(triangles, np.uint32)
    return _core.sample_surface(corners, rows, whole(count, "count", 0), seed(random_state))


def load_voxels(path: Path) -> tuple[NDArray[Any], NDArray[np.str_]]:
    """Cells of a ``.npz`` file with one array of shape (objects, cells, cells, cells) for each class.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    tuple of arrays
        The objects one below the other, and the name of the class of each: that of its array.
    """
    with np.load(path, allow_pickle=False) as arrays:
        parts = [(name, arrays[name]) for name in arrays.files]
    shapes = {part.shape[1:] for _, part in parts}
    if len(shapes) != 1 or len(next(iter(shapes))) < 2:
        raise ValueError(f"{os.fspath(path)}: found objects of {shapes} cells, expected one shape for all")
    labels = [np.full(len(part), name) for name, part in parts]
    return np.concatenate([part for _, part in parts]), np.concatenate(labels)


def load_weights(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a network of scansion by name, for use in other programs: ``numpy.savez("net.npz", **load_weights(path))``.

    Both kinds of networks are read: models of the recipe ``unet`` and those of :class:`VoxelClassifier`. What each array
    is, is told in the guide, page "Sparse convolution". The file is in the format safetensors, which other libraries read
    directly.

    Parameters
    ----------
    path : path
        A model.

    Returns
    -------
    dict of arrays
    """
    types = {"F32": "<f4", "F64": "<f8", "U64": "<u8", "I64": "<i8", "U32": "<u4", "U16": "<u2", "U8": "u1", "I32": "<i4"}
    with open(path, "rb") as file:
        start = file.read(8)
        length = int.from_bytes(start, "little")
        if len(start) < 8 or length > 1 << 30:
            raise _core.FileFormatError(f"{os.fspath(path)}: expected a file of the format safetensors")
        header = json.loads(file.read(length))
        body = file.read()
    found: dict[str, NDArray[Any]] = {}
    for name, entry in header.items():
        if name != "__metadata__":
            first, last = entry["data_offsets"]
            values = np.frombuffer(body[first:last], types[entry["dtype"]])
            found[name] = values.reshape(entry["shape"])
    return found
