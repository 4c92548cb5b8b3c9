"""Ground points, heights above the ground, terrain and surface models, height contours, outlines of buildings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import mask, to_json
from scansion._cloud import as_cloud
from scansion._footprints import footprints, write_footprints
from scansion._height_contours import HeightContours, contours
from scansion._road import RoadPosition, road_points, road_position
from scansion._surfaces import Raster, chm, dsm, dtm, height_above_ground, write_raster

__all__ = [
    "HeightContours",
    "Raster",
    "RoadPosition",
    "chm",
    "contours",
    "dsm",
    "dtm",
    "footprints",
    "ground_points",
    "height_above_ground",
    "heights",
    "road_points",
    "road_position",
    "write_footprints",
    "write_raster",
]


def __dir__() -> list[str]:
    return __all__


def ground_points(
    xyz: Any,
    *,
    method: str = "refined",
    cell: float = 1.0,
    slope: float = 0.12,
    relief: float = 0.2,
    window: float = 27.0,
    wall: float = 2.0,
    threshold: float = 0.45,
    scaling: float = 1.0,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.bool_]:
    """Ground points by the simple morphological filter (Pingel, Clarke and McBride 2013).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    method : {"refined", "morphological"}
        The refined filter, or the one of the paper; its published parameters are slope 0.15, window 18, threshold 0.5,
        scaling 1.25.
    cell : float
        Edge of a cell, metres.
    slope : float
        Slope of the steepest ground, rise over run; for the refined filter, where the terrain is level.
    relief : float
        Additional slope per unit of the slope of the terrain around, for the refined filter.
    window : float
        Half the width of the widest object that is found by its width, metres.
    wall : float
        Least height of the walls around a wider roof, of at least the area window * window, metres; for the refined filter.
        0: such roofs are ground. Walls lower than a cell edge are not seen.
    threshold : float
        Largest distance of ground points from the height of the ground, metres.
    scaling : float
        Additional distance per unit of slope, metres.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    ground : array of shape (n,), bool

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import terrain
    >>> grid = np.arange(0.0, 40.0, 0.5)
    >>> field = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> roof = np.abs(field[:, :2] - 20).max(1) < 5
    >>> field[roof, 2] = 6.0
    >>> bool((terrain.ground_points(field) == ~roof).all())
    True
    """
    settings = {
        "method": method,
        "cell": cell,
        "slope": slope,
        "relief": relief,
        "window": window,
        "wall": wall,
        "threshold": threshold,
        "scaling": scaling,
    }
    return _core.ground_points(as_cloud(xyz, columns=[])._core, to_json(settings), metres_per_unit, n_jobs)


def heights(
    xyz: Any,
    ground: Any = None,
    *,
    cell: float = 1.0,
    percentile: float = 0.1,
    median: int = 3,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.float32]:
    """Height of every point above the ground, in metres.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    ground : array_like of shape (n,), bool, optional
        Whether each point is ground; by default from `ground_points`.
    cell : float
        Edge of a cell of the elevation model, metres.
    percentile : float
        Percentile of the ground points' heights that is the height of a cell, 0..1.
    median : int
        Width of the median filter, cells; odd, 1 does not smooth.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    heights : array of shape (n,), float32

    Examples
    --------
    >>> from scansion import terrain
    >>> terrain.heights([[0, 0, 1.0], [5, 0, 1.0], [5, 0, 4.0]], [True, True, False]).tolist()
    [0.0, 0.0, 3.0]
    """
    cloud = as_cloud(xyz, columns=[])
    if ground is None:
        ground = ground_points(cloud, metres_per_unit=metres_per_unit, n_jobs=n_jobs)
    marks = mask(ground, "ground", len(cloud))
    settings = to_json({"cell": cell, "percentile": percentile, "median": median})
    return _core.heights(cloud._core, marks, settings, metres_per_unit, n_jobs)
