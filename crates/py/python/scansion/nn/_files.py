"""Files in which sets of objects and networks come."""

from __future__ import annotations

import json
import os
import struct
import tokenize
import zipfile
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import check_whole, unmasked
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


def load_xyz(folder: Path) -> tuple[list[NDArray[np.float64]], NDArray[np.str_]]:
    """Objects from a folder of text files ``.xyz``, one each: rows of x, y, z and any further columns.

    :class:`VoxelClassifier` takes the list as it is and puts each object into cells.

    Parameters
    ----------
    folder : path
        The folder. Other files in it are left out.

    Returns
    -------
    tuple
        A list of arrays of shape (m, 3) in the order of the files' names, and these names without ``.xyz``.

    Raises
    ------
    scansion.FileFormatError
        With the line; also if there is no such file.
    """
    rows, starts, names = _core.load_xyz(os.fspath(folder))
    return np.split(rows, starts[1:-1]), np.array(names, np.str_)


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
    triangles = unmasked(triangles, "triangles")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or (triangles < 0).any():
        raise ValueError(f"triangles: found shape {triangles.shape}, expected (m, 3) and rows, 0 or more")
    corners = np.ascontiguousarray(unmasked(vertices, "vertices"), np.float64)
    if corners.ndim != 2:
        raise ValueError(f"vertices: found shape {corners.shape}, expected (n, 3)")
    check_whole(triangles, "triangles", 0xFFFFFFFF)
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

    Raises
    ------
    scansion.FileFormatError
        If it is no such file, or is damaged.
    """
    with open(path, "rb") as file:
        try:
            arrays = np.load(file, allow_pickle=False)
            if isinstance(arrays, np.ndarray):
                raise ValueError("a single array")
            parts = [(name, arrays[name]) for name in arrays.files]
        except _DAMAGES as error:
            raise _damaged(path, error, "a file .npz of arrays") from error
    if not all(isinstance(part, np.ndarray) for _, part in parts):
        raise _damaged(path, "members that are no arrays", "a file .npz of arrays")
    shapes = {part.shape[1:] for _, part in parts}
    if len(shapes) != 1 or len(next(iter(shapes))) < 2:
        raise _damaged(path, f"objects of {shapes or 'no'} cells", "one shape for all")
    labels = [np.full(len(part), name) for name, part in parts]
    return np.concatenate([part for _, part in parts]), np.concatenate(labels)


def load_weights(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a network of scansion by name, for use in other programs: ``numpy.savez("net.npz", **load_weights(path))``.

    Models of the recipes ``unet`` and ``windows`` and networks of :class:`VoxelClassifier` are read. What each array is, is
    told in the guide, pages "A sparse convolutional network", "Windows at five scales" and "Direct sparse convolution with
    attention". The file is in the format safetensors, which other libraries read
    directly.

    Parameters
    ----------
    path : path
        A model.

    Returns
    -------
    dict of arrays

    Raises
    ------
    scansion.FileFormatError
        If it is no such file, or is damaged.
    """
    types = {"F32": "<f4", "F64": "<f8", "U64": "<u8", "I64": "<i8", "U32": "<u4", "U16": "<u2", "U8": "u1", "I32": "<i4"}
    with open(path, "rb") as file:
        start = file.read(8)
        length = int.from_bytes(start, "little")
        if len(start) < 8 or length > 1 << 30:
            raise _damaged(path, "another start", "a file of the format safetensors")
        start, body = file.read(length), file.read()
    found: dict[str, NDArray[Any]] = {}
    try:
        for name, entry in json.loads(start).items():
            if name != "__metadata__":
                first, last = entry["data_offsets"]
                if not 0 <= first <= last <= len(body):
                    raise ValueError(f"bytes {first} to {last} of {len(body)}")
                values = np.frombuffer(body[first:last], types[entry["dtype"]])
                found[name] = values.reshape(entry["shape"])
    except _DAMAGES as error:
        raise _damaged(path, error, "a file of the format safetensors") from error
    return found


#: What libraries raise that read a damaged file.
_DAMAGES = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)


def _damaged(path: Path, found: object, expected: str) -> Exception:
    """The error about the content of a file; ``found`` is a text or what a library raised."""
    found = f"{type(found).__name__}: {found}" if isinstance(found, Exception) else found
    return _core.FileFormatError(f"{os.fspath(path)}: found {found}, expected {expected}")
