"""Rasters of heights, and heights above the ground."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import as_array, native, to_json, unmasked
from scansion._ground import choice, marked
from scansion._ground import settings as ground_settings


@dataclass(frozen=True, eq=False)
class Raster:
    """Heights at the centres of square cells, in the unit and the reference system of the cloud.

    Parameters
    ----------
    values : array of shape (rows, columns), float64
        Heights, the northernmost row first; NaN where there are none.
    corner : tuple of two float
        x and y of the north-west corner of the raster.
    cell : float
        Edge of a cell, in the unit of the cloud.
    crs : str, optional
        Coordinate reference system: WKT, ``EPSG:n``, or ``EPSG:n+m`` with a vertical system m.
    metres_per_unit : float, optional
        Metres per unit of x and y, and of heights unless `crs` tells another unit for them.
    ground : str
        How many ground points there are and how they were found, if they were needed, and how many points are withheld.
    """

    values: NDArray[np.float64]
    corner: tuple[float, float]
    cell: float
    crs: str | None = None
    metres_per_unit: float | None = None
    ground: str = ""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return as_array(self.values, dtype, copy)

    @property
    def transform(self) -> tuple[float, float, float, float, float, float]:
        """Coefficients of ``affine.Affine``: column and row to x and y."""
        return (self.cell, 0.0, self.corner[0], 0.0, -self.cell, self.corner[1])


def dtm(
    xyz: Any,
    *,
    cell: float = 1.0,
    ground: Any = None,
    noise: Sequence[int] | None = None,
    reach: float = 100.0,
    slope: float | None = None,
    window: float | None = None,
    wall: float | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Raster:
    """Terrain model: heights of the ground.

    The ground points of each cell are averaged in position and height and triangulated (Delaunay); the height of a cell is
    that of the triangulation at its centre. Outside the triangulation it is that of the nearest cell. Noise and withheld
    points (the flag of LAS) are left out; `Raster.ground` tells how many are withheld.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud.
    cell : float
        Edge of a cell, metres.
    ground : "filter", list of int, or array_like of shape (n,), bool; optional
        Find the ground by `ground_points`, or take the points of these classes, or these points. None takes class 2 if the
        cloud has such points, else the ground filter.
    noise : list of int, optional
        Classes that are left out. None: 7 and 18 in LAS and LAZ, else none.
    reach : float
        Cells farther than this from all ground points are NaN, metres.
    slope, window, wall : float, optional
        Parameters of the ground filter, as in `ground_points`.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    raster : Raster
        In the unit of the cloud.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import terrain
    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.25, 20, 0.5), np.arange(0.25, 10, 0.5)))
    >>> house = (abs(x - 10) < 3) & (abs(y - 5) < 2)
    >>> slope = np.column_stack([x, y, np.where(house, 30.0, 5 + 0.1 * x)])
    >>> dtm = terrain.dtm(slope, ground=~house)
    >>> dtm.values.shape, dtm.corner, bool(np.allclose(dtm.values[:, 10], 5 + 0.1 * 10.5))
    ((10, 20), (0.0, 10.0), True)
    """
    settings = ground_settings(cell, ground, noise, slope, window, wall, reach)
    return _raster("dtm", xyz, ground, settings, (metres_per_unit, n_jobs))


def dsm(
    xyz: Any,
    *,
    cell: float = 1.0,
    noise: Sequence[int] | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Raster:
    """Surface model: the highest point of each cell of the raster of `dtm`, NaN where there is none.

    Noise and withheld points (the flag of LAS) are left out.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud.
    cell : float
        Edge of a cell, metres.
    noise : list of int, optional
        Classes that are left out. None: 7 and 18 in LAS and LAZ, else none.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    raster : Raster
        In the unit of the cloud.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import terrain
    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.25, 20, 0.5), np.arange(0.25, 10, 0.5)))
    >>> house = (abs(x - 10) < 3) & (abs(y - 5) < 2)
    >>> float(terrain.dsm(np.column_stack([x, y, np.where(house, 30.0, 5.0)])).values[4, 10])
    30.0
    """
    settings = ground_settings(cell, None, noise)
    return _raster("dsm", xyz, None, settings, (metres_per_unit, n_jobs))


def chm(
    xyz: Any,
    *,
    cell: float = 1.0,
    ground: Any = None,
    noise: Sequence[int] | None = None,
    reach: float = 100.0,
    slope: float | None = None,
    window: float | None = None,
    wall: float | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Raster:
    """Normalised surface: `dsm` minus `dtm`, not below 0; canopy heights over forests.

    NaN where one of them is. Noise and withheld points (the flag of LAS) are left out.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud.
    cell : float
        Edge of a cell, metres.
    ground : "filter", list of int, or array_like of shape (n,), bool; optional
        Find the ground by `ground_points`, or take the points of these classes, or these points. None takes class 2 if the
        cloud has such points, else the ground filter.
    noise : list of int, optional
        Classes that are left out. None: 7 and 18 in LAS and LAZ, else none.
    reach : float
        Cells farther than this from all ground points are NaN, metres.
    slope, window, wall : float, optional
        Parameters of the ground filter, as in `ground_points`.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    raster : Raster
        In the unit of the cloud.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import terrain
    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.25, 20, 0.5), np.arange(0.25, 10, 0.5)))
    >>> house = (abs(x - 10) < 3) & (abs(y - 5) < 2)
    >>> float(terrain.chm(np.column_stack([x, y, np.where(house, 30.0, 5.0)]), ground=~house).values[4, 10])
    25.0
    """
    settings = ground_settings(cell, ground, noise, slope, window, wall, reach)
    return _raster("chm", xyz, ground, settings, (metres_per_unit, n_jobs))


def height_above_ground(
    xyz: Any,
    *,
    cell: float = 1.0,
    ground: Any = None,
    noise: Sequence[int] | None = None,
    slope: float | None = None,
    window: float | None = None,
    wall: float | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.float32]:
    """Height of every point above the terrain model, in the unit of the cloud (`heights` gives metres above another model).

    Noise and withheld points (the flag of LAS) have a height, but no part in the terrain model.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud.
    cell : float
        Edge of a cell, metres.
    ground : "filter", list of int, or array_like of shape (n,), bool; optional
        Find the ground by `ground_points`, or take the points of these classes, or these points. None takes class 2 if the
        cloud has such points, else the ground filter.
    noise : list of int, optional
        Classes that are left out. None: 7 and 18 in LAS and LAZ, else none.
    slope, window, wall : float, optional
        Parameters of the ground filter, as in `ground_points`.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    heights : array of shape (n,), float32
        Bilinear between the centres of the cells of `dtm` without a limit of its reach; NaN for coordinates that are not finite.

    Examples
    --------
    >>> from scansion import terrain
    >>> terrain.height_above_ground([[0, 0, 1.0], [5, 0, 1.0], [5, 0, 4.0]], ground=[True, True, False]).tolist()
    [0.0, 0.0, 3.0]
    """
    cloud, ground = marked(xyz, ground)
    settings = to_json(ground_settings(cell, ground, noise, slope, window, wall))
    found, _ = _core.height_above_ground(cloud._core, settings, metres_per_unit, n_jobs)
    return found


def write_raster(path: str | os.PathLike[str], raster: Raster) -> None:
    """Writes a raster as GeoTIFF or ESRI ASCII grid; the file is either complete or absent.

    Parameters
    ----------
    path : path
        ``.tif`` or ``.tiff`` (32-bit floats with reference system and unit) or ``.asc``. NaN becomes -9999, the nodata value.
    raster : Raster
        What to write. Heights of -9999, and those that are infinite as 32-bit floats, are refused.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from scansion import terrain
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "dtm.asc")
    ...     terrain.write_raster(path, terrain.Raster(np.array([[1.5, np.nan]]), (100.0, 51.0), 1.0))
    ...     print(path.read_text().splitlines()[2:])
    ['xllcorner 100', 'yllcorner 50', 'cellsize 1', 'NODATA_value -9999', '1.5 -9999']
    """
    values = native(unmasked(raster.values, "raster"), np.float64)
    if values.ndim != 2:
        raise ValueError(f"raster: expected two dimensions, found shape {values.shape}")
    corner = (float(raster.corner[0]), float(raster.corner[1]))
    _core.write_raster(
        os.fspath(path), values, corner, float(raster.cell), raster.crs, raster.metres_per_unit
    )


def _raster(product: str, xyz: Any, ground: Any, settings: dict[str, Any], run: tuple[Any, Any]) -> Raster:
    cloud, ground = marked(xyz, ground)
    settings["ground"] = choice(ground)
    metres_per_unit, n_jobs = run
    values, corner, cell, note = _core.terrain_raster(
        cloud._core, product, to_json(settings), metres_per_unit, n_jobs
    )
    unit = metres_per_unit if metres_per_unit is not None else cloud.metres_per_unit
    return Raster(values, (corner[0], corner[1]), cell, cloud.crs, unit, note)
