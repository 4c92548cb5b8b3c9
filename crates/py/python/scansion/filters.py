"""Noise, points in polygons, and files with only the points that filters keep."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import to_json, unmasked
from scansion._cloud import as_cloud
from scansion._files import _box, _steps
from scansion._ground import choice, code_list, filter_settings
from scansion._settings import whole

__all__ = ["filter_file", "inside_polygon", "radius_outliers", "statistical_outliers"]

_MOST = 1000
"""Most neighbours that a search may ask for."""


def __dir__() -> list[str]:
    return __all__


def statistical_outliers(
    xyz: Any,
    neighbours: int = 8,
    multiplier: float = 2.0,
    *,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.bool_]:
    """Points whose mean distance to their nearest neighbours is far above that of all points (Rusu et al. 2008).

    Robotics and Autonomous Systems 56(11), doi:10.1016/j.robot.2008.08.005; the defaults are those of PDAL's
    ``filters.outlier``. Points that are not finite and stray points are outliers, and nobody's neighbours.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud.
    neighbours : int
        Number of nearest other points to which the mean distance is taken, 1 to 1000.
    multiplier : float
        Standard deviations above the mean from which on a distance is that of an outlier.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    outliers : array of shape (n,), bool

    Examples
    --------
    >>> import numpy as np
    >>> import scansion
    >>> field = np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0), [0.0]), -1).reshape(-1, 3)
    >>> cloud = scansion.PointCloud(np.vstack([field, [[5.0, 5.0, 30.0]]]))
    >>> noise = scansion.filters.statistical_outliers(cloud)
    >>> np.flatnonzero(noise).tolist(), len(cloud.select(~noise))
    ([100], 100)
    """
    settings = to_json({"neighbours": whole(neighbours, "neighbours", 1, _MOST), "multiplier": multiplier})
    return _core.statistical_outliers(as_cloud(xyz, columns=[])._core, settings, metres_per_unit, n_jobs)


def radius_outliers(
    xyz: Any,
    radius: float = 1.0,
    min_neighbours: int = 2,
    *,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.bool_]:
    """Points with few neighbours within a radius.

    The defaults are those of PDAL's ``filters.outlier``. Points that are not finite and stray points are outliers, and
    nobody's neighbours.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud.
    radius : float
        Distance within which neighbours count, metres.
    min_neighbours : int
        A point with fewer other points within the radius is an outlier, 1 to 1000.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    outliers : array of shape (n,), bool

    Examples
    --------
    >>> from scansion import filters
    >>> row = [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [1.5, 0, 0], [9, 0, 0]]
    >>> filters.radius_outliers(row).tolist()
    [False, False, False, False, True]
    """
    settings = to_json({"radius": radius, "min_neighbours": whole(min_neighbours, "min_neighbours", 1, _MOST)})
    return _core.radius_outliers(as_cloud(xyz, columns=[])._core, settings, metres_per_unit, n_jobs)


def inside_polygon(xyz: Any, polygon: Any, *, n_jobs: int | None = None) -> NDArray[np.bool_]:
    """Points whose x and y are inside polygons, and not in their holes.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud.
    polygon : path, str, dict or array_like of shape (m, 2)
        In the coordinates of the cloud: a GeoJSON file, well-known text (or a file with it), a GeoJSON object such as
        from `terrain.footprints`, an object with ``__geo_interface__`` such as of shapely, or the corners of one polygon.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    inside : array of shape (n,), bool
        Of two polygons that share a side, a point on it is inside exactly one.

    Examples
    --------
    >>> from scansion import filters
    >>> points = [[1, 1, 0], [5, 1, 0], [1, 5, 0]]
    >>> filters.inside_polygon(points, "POLYGON ((0 0, 6 0, 6 2, 0 2, 0 0))").tolist()
    [True, True, False]
    >>> filters.inside_polygon(points, [[0, 0], [2, 0], [2, 6], [0, 6]]).tolist()
    [True, False, True]
    """
    return _core.inside_polygon(as_cloud(xyz, columns=[])._core, _text(polygon), n_jobs)


def filter_file(
    input: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    classes: Sequence[int] = (),
    drop_classes: Sequence[int] = (),
    statistical: bool | Mapping[str, Any] = False,
    radius: bool | Mapping[str, Any] = False,
    mark: bool = False,
    height: tuple[float | None, float | None] | None = None,
    ground: Any = None,
    cell: float | None = None,
    noise: Sequence[int] | None = None,
    slope: float | None = None,
    window: float | None = None,
    wall: float | None = None,
    bounds: ArrayLike | None = None,
    polygon: Any = None,
    outside: bool = False,
    scale: float | Sequence[float] | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> dict[str, Any]:
    """Writes the points of a file that all filters keep, as the command ``scansion filter``.

    The filters are applied in the order of the parameters, each to the points that those before it left. Of LAS and LAZ
    all fields, extra dimensions, header and records are kept.

    Parameters
    ----------
    input, output : path
        May be the same file.
    classes : sequence of int
        Keep only points of these classes; empty for all.
    drop_classes : sequence of int
        Remove points of these classes.
    statistical : bool or dict
        Remove statistical outliers; a dict has parameters of `statistical_outliers`.
    radius : bool or dict
        Remove points with few neighbours; a dict has parameters of `radius_outliers`.
    mark : bool
        Keep outliers, with class 7 (noise).
    height : tuple of two floats, optional
        Lowest and greatest height above ground, metres; None at one end, or infinity, has no limit. Heights are those
        of the dimension HeightAboveGround if the file has it and none of the settings below is given.
    ground : "filter" or list of int, optional
        Find the ground by the ground filter, or take the points of these classes. None takes class 2 if the file has such
        points, else the ground filter.
    cell : float, optional
        Edge of a cell of the terrain model, metres; None: 1.
    noise : list of int, optional
        Classes that are left out of the ground. None: 7 and 18 in LAS and LAZ, else none.
    slope, window, wall : float, optional
        Parameters of the ground filter, as in `terrain.ground_points`.
    bounds : array_like of shape (2, 3) or (2, 2), optional
        Keep only points in this box, lowest and highest corner, both included.
    polygon : path, str, dict or array_like of shape (m, 2), optional
        Keep only points inside, as in `inside_polygon`.
    outside : bool
        Keep the points outside the polygon instead.
    scale : float or three of them, optional
        As in `scansion.write`; not from LAS to LAS, which keeps its scale.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the file's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    report : dict
        ``points`` of the input, ``steps`` (``filter``, ``removed``, ``marked``), ``kept``, ``notes``.

    Examples
    --------
    >>> import tempfile, pathlib, numpy as np, scansion
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> codes = np.array([2, 2, 6, 6], dtype=np.uint8)
    >>> scansion.write(folder / "all.laz", scansion.PointCloud(np.eye(4, 3), Classification=codes))
    >>> scansion.filters.filter_file(folder / "all.laz", folder / "houses.laz", classes=[6])["kept"]
    2
    """
    find_ground = any(setting is not None for setting in (ground, cell, noise, slope, window, wall))
    if find_ground and height is None:
        raise ValueError("ground, cell, noise, slope, window and wall need height")
    settings: dict[str, Any] = {
        "find_ground": find_ground,
        "classes": code_list(classes, "classes") if len(classes) else [],
        "drop_classes": code_list(drop_classes, "drop_classes") if len(drop_classes) else [],
        "statistical": _method(statistical, "statistical"),
        "radius": _method(radius, "radius"),
        "mark": mark,
        "height": None if height is None else _range(height),
        "ground": {
            **({} if cell is None else {"cell": cell}),
            "ground": choice(ground),
            "noise": None if noise is None else code_list(noise, "noise"),
            "filter": filter_settings(slope, window, wall),
        },
        "polygon": None if polygon is None else _text(polygon),
        "outside": outside,
        "metres_per_unit": metres_per_unit,
    }
    paths = (os.fspath(input), os.fspath(output))
    report: dict[str, Any] = json.loads(
        _core.filter(*paths, to_json(settings), _box(bounds), _steps(scale), n_jobs)
    )
    return report


def _method(setting: bool | Mapping[str, Any] | None, name: str) -> Any:
    """Parameters of a search for outliers; None without one."""
    if isinstance(setting, Mapping):
        return dict(setting)
    if not isinstance(setting, (bool, np.bool_, type(None))):
        raise TypeError(f"{name}: found {setting!r}, expected True, False or a dict of parameters")
    return {} if setting else None


def _range(height: tuple[float | None, float | None]) -> dict[str, float]:
    """The ends of a range that are limits."""
    low, high = height
    ends = {"low": -np.inf if low is None else float(low), "high": np.inf if high is None else float(high)}
    if not (ends["low"] < np.inf and ends["high"] > -np.inf):
        raise ValueError(f"height: found {height}, expected two numbers; None, -inf and inf have no limit")
    return {name: end for name, end in ends.items() if np.isfinite(end)}


def _text(polygon: Any) -> str:
    """Polygons as GeoJSON or well-known text."""
    polygon = getattr(polygon, "__geo_interface__", polygon)
    if isinstance(polygon, Mapping):
        return json.dumps(polygon)
    if isinstance(polygon, str) and polygon.lstrip()[:1] == "{":
        return polygon
    if isinstance(polygon, (str, os.PathLike)):
        return _core.polygon_text(os.fspath(polygon))
    corners = unmasked(polygon, "polygon", np.float64)
    if corners.ndim != 2 or corners.shape[1] != 2:
        raise ValueError(f"polygon: found shape {corners.shape}, expected corners of shape (m, 2)")
    return json.dumps({"type": "Polygon", "coordinates": [corners.tolist()]})
