"""Outlines of buildings."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

from scansion import _core
from scansion._arrays import to_json
from scansion._cloud import as_cloud
from scansion._ground import code_list, is_marks
from scansion._ground import settings as ground_settings


def footprints(
    xyz: Any,
    *,
    classes: Sequence[int] = (6,),
    alpha: float | None = None,
    min_area: float = 10.0,
    tolerance: float = 0.5,
    cell: float = 1.0,
    ground: Any = None,
    noise: Sequence[int] | None = None,
    slope: float | None = None,
    window: float | None = None,
    wall: float | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> dict[str, Any]:
    """Outlines of the buildings, as a GeoJSON object.

    Coordinates are those of the cloud, not WGS 84; the member ``crs`` has the EPSG code, if it is known. Withheld points (the
    flag of LAS) are left out.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData or structured array
        The cloud with its classes.
    classes : sequence of int
        Classes of buildings.
    alpha : float, optional
        Gaps wider than twice this separate buildings, metres; larger than the distance between points. None: twice that
        distance, at least 1.
    min_area : float
        Buildings of a smaller area are left out, and smaller holes are closed, m².
    tolerance : float
        Outlines are simplified by up to this distance (Douglas and Peucker 1973), metres.
    cell : float
        Edge of a cell of the terrain model, metres.
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
    collection : dict
        A ``FeatureCollection``, largest building first. Properties: ``id``, ``area`` (m²), ``height_median`` and
        ``height_max`` above ground (metres), ``points``.

    Examples
    --------
    >>> import numpy as np
    >>> import scansion
    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0, 20, 0.5), np.arange(0, 20, 0.5)))
    >>> house = (abs(x - 10) <= 4) & (abs(y - 10) <= 3)
    >>> codes = np.where(house, 6, 2).astype(np.uint8)
    >>> cloud = scansion.PointCloud(np.column_stack([x, y, np.where(house, 7.0, 1.0)]), Classification=codes)
    >>> [found["properties"] for found in scansion.terrain.footprints(cloud)["features"]]
    [{'area': 48.0, 'height_max': 6.0, 'height_median': 6.0, 'id': 1, 'points': 221}]
    """
    if is_marks(ground):
        raise ValueError(
            "ground: expected classes, 'filter' or None: marks would replace the classes of the buildings"
        )
    cloud = as_cloud(xyz, columns=["Classification", "Withheld"])
    shape = {
        "classes": code_list(classes, "classes"),
        "alpha": alpha,
        "min_area": min_area,
        "tolerance": tolerance,
    }
    settings = to_json(ground_settings(cell, ground, noise, slope, window, wall))
    found: dict[str, Any] = json.loads(
        _core.footprints(cloud._core, settings, to_json(shape), metres_per_unit, n_jobs)
    )
    return found


def write_footprints(path: str | os.PathLike[str], collection: Mapping[str, Any]) -> None:
    """Writes outlines of buildings as GeoJSON or GeoPackage, by the extension.

    Parameters
    ----------
    path : path
        ``.geojson``, ``.json`` or ``.gpkg``; a GeoPackage has one table with the name of the file.
    collection : mapping
        A ``FeatureCollection`` of polygons, as from `footprints`.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from scansion import terrain
    >>> square = {"type": "Polygon", "coordinates": [[[0, 0], [5, 0], [5, 5], [0, 5], [0, 0]]]}
    >>> house = {"type": "Feature", "properties": {"id": 1}, "geometry": square}
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "houses.gpkg"
    >>> terrain.write_footprints(path, {"type": "FeatureCollection", "features": [house]})
    >>> path.read_bytes()[:15]
    b'SQLite format 3'
    """
    _core.write_footprints(os.fspath(path), json.dumps(collection))
