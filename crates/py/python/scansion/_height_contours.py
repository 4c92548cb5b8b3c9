"""Lines of equal height."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import native, to_json, unmasked
from scansion._surfaces import Raster


class HeightContours:
    """Lines of equal height, the lowest first, as `contours` gives them.

    Attributes
    ----------
    lines : list of array of shape (m, 2)
        x and y of the vertices of each line, the higher ground to their left; the first is repeated at the end of a closed line.
    heights : array of float
        Height of each line.
    closed : array of bool
    length : array of float
        In plan, in the unit of the raster.
    """

    def __init__(self, core: _core.HeightContours) -> None:
        self._core = core
        vertices, counts = core.vertices()
        self.heights = core.heights()
        self.closed = core.closed()
        self.length = core.lengths()
        pieces = np.split(vertices, np.cumsum(counts)[:-1].astype(np.int64)) if len(counts) else []
        pairs = zip(pieces, self.closed, strict=True)
        self.lines = [np.concatenate([line, line[:1]]) if closed else line for line, closed in pairs]

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (*self._core.vertices(), *self._core.rest())

    def __len__(self) -> int:
        return len(self.lines)

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        return iter(self.lines)

    def __repr__(self) -> str:
        if not self.lines:
            return "<HeightContours: no lines>"
        return f"<HeightContours: {len(self)} lines from {self.heights[0]:g} to {self.heights[-1]:g}>"

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the lines in space, with their height as ``elevation``; every fifth is on a layer of its own.

        Parameters
        ----------
        path : path
            ``.dxf``, ``.gpkg``, ``.geojson``, ``.obj`` or ``.ply``.
        """
        self._core.write(os.fspath(path))


def _restored(*parts: Any) -> HeightContours:
    """The inverse of ``HeightContours.__reduce__``."""
    return HeightContours(_core.HeightContours.restored(*parts))


def contours(
    raster: Raster, *, interval: float = 1.0, base: float = 0.0, min_length: float = 5.0
) -> HeightContours:
    """Lines of equal height of a terrain model (marching squares).

    Parameters
    ----------
    raster : Raster
        Heights, as from `dtm`; lines end at NaN.
    interval : float
        Difference of height from one line to the next.
    base : float
        A height with a line; the others lie whole intervals above and below.
    min_length : float
        Shorter lines are left out. This and all lengths are in the unit of the raster.

    Returns
    -------
    contours : HeightContours

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import terrain
    >>> hill = 10 - np.hypot(*np.mgrid[-20:21, -20:21] / 3)
    >>> found = terrain.contours(terrain.Raster(hill, (0.0, 41.0), 1.0), interval=2.5)
    >>> found
    <HeightContours: 6 lines from 2.5 to 7.5>
    >>> found.heights[found.closed].tolist(), found.lines[-1].shape[1]
    ([5.0, 7.5], 2)
    """
    values = native(unmasked(raster.values, "raster"), np.float64)
    if values.ndim != 2:
        raise ValueError(f"raster: expected two dimensions, found shape {values.shape}")
    corner = (float(raster.corner[0]), float(raster.corner[1]))
    settings = to_json({"interval": interval, "base": base, "min_length": min_length})
    place = (raster.crs, raster.metres_per_unit)
    return HeightContours(_core.height_contours(values, corner, float(raster.cell), settings, *place))
