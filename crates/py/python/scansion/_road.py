"""The road of a street scan (Guinard and Landrieu 2017, section 2.2)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import finite, mask, to_json
from scansion._cloud import as_cloud
from scansion._graph import as_rows
from scansion._labels import signed
from scansion._settings import seed, whole


class RoadPosition(NamedTuple):
    """Where points are with respect to the road."""

    position: NDArray[np.float32]
    """0 on the road, 0.5 near its border on either side, 1 away from it."""
    area: float
    """Area of the road, square metres."""
    border_length: float
    """Length of its border, metres."""


def road_points(
    features: ArrayLike,
    labels: ArrayLike,
    *,
    n_estimators: int = 100,
    random_state: int | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.bool_]:
    """The points that a random forest considers at least as likely road as not.

    Parameters
    ----------
    features : array_like of shape (n, 4)
        Linearity, planarity, scattering and verticality of each point, as from `scansion.neighbours.optimal`; finite.
    labels : array_like of shape (n,)
        1 for labelled points of the road, 0 for labelled points of other things, negative for all others.
    n_estimators : int
        Number of trees.
    random_state : int, optional
        Seed.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import terrain
    >>> features = np.random.default_rng(0).random((200, 4))
    >>> labels = np.full(200, -1)
    >>> labels[:40] = features[:40, 3] < 0.3
    >>> found = terrain.road_points(features, labels)
    >>> bool((found == (features[:, 3] < 0.3)).mean() > 0.8)
    True
    """
    table = finite(as_rows(features, "features"), "features")
    if table.shape[1] != 4:
        raise ValueError(f"features: found shape {table.shape}, expected (n, 4)")
    known = signed(labels, "labels", len(table))
    if known.max(initial=-1) > 1:
        raise ValueError(f"labels: found {known.max()}, expected 1 (road), 0 (not road) or negative (unlabelled)")
    trees = whole(n_estimators, "n_estimators")
    return _core.road_points(table, known, trees, seed(random_state), n_jobs)


def road_position(
    xyz: Any,
    road: ArrayLike,
    *,
    alpha: float = 2.0,
    thinning: float = 0.25,
    rim: float = 1.0,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> RoadPosition:
    """Position of every point with respect to the α-shape of the road's points.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    road : array_like of shape (n,), bool
        Whether each point is road.
    alpha : float
        Triangles of the road's points with a circumscribed circle of a larger radius are not road, metres.
    thinning : float
        Edge of the squares of which only the outermost road points are used, as a share of alpha, 0..0.5; 0 uses all.
    rim : float
        Points nearer than this to the border of the road are on it, metres.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import terrain
    >>> xyz = np.stack(np.meshgrid(np.arange(0.0, 40.0), np.arange(0.0, 40.0), [0.0]), -1).reshape(-1, 3)
    >>> found = terrain.road_position(xyz, xyz[:, 0] < 20, rim=1.5)
    >>> [float(found.position[np.argmin(abs(xyz - [x, 20, 0]).sum(1))]) for x in (10, 20, 30)]
    [0.0, 0.5, 1.0]
    >>> found.area
    741.0
    """
    cloud = as_cloud(xyz, columns=[])
    marks = mask(road, "road", len(cloud))
    settings = to_json({"alpha": alpha, "thinning": thinning, "rim": rim})
    return RoadPosition(*_core.road_position(cloud._core, marks, settings, metres_per_unit, n_jobs))
