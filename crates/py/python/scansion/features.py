"""Multi-scale features: the geometry around each point on each level of a voxel pyramid.

T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich 2018, doi:10.3929/ethz-b-000264691,
chapter 4.4.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, to_json, unmasked
from scansion._cloud import as_cloud

__all__ = ["definitions", "multiscale", "names", "normals", "preset", "radius", "radius_names"]


def __dir__() -> list[str]:
    return __all__


def multiscale(
    xyz: Any,
    *,
    first_scale: float | None = 0.025,
    levels: int = 9,
    k: int = 10,
    include_query: bool = True,
    centre: Literal["medoid", "mean"] = "medoid",
    divisor: Literal["n", "n-1"] = "n",
    normalise: bool = False,
    column: Literal["cylinder", "cell"] = "cylinder",
    column_radius: float = 1.0,
    near_share: float = 0.5,
    colour: bool = False,
    intensity: bool = False,
    returns: bool = False,
    dimensions: Sequence[str] = (),
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.float32]:
    """Features of every point on every level.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud.
    first_scale : float, optional
        Edge of the finest voxel in metres; None derives it from the cloud's point spacing.
    levels : int
        Number of levels, each with voxels of twice the edge; 1..16.
    k : int
        Number of points in a neighbourhood; 3..32.
    include_query : bool
        Whether the point itself is one of the k.
    centre : {"medoid", "mean"}
        Centre of the structure tensor.
    divisor : {"n", "n-1"}
        Divisor of the structure tensor.
    normalise : bool
        Whether eigenvalues are divided by their sum before omnivariance and entropy.
    column : {"cylinder", "cell"}
        Shape of the vertical column.
    column_radius : float
        Radius (cylinder) or edge (cell) of the column in voxels; 0.25..8.
    near_share : float
        Share of the neighbourhood that forms the near set of the line feature; above 0, below 1.
    colour, intensity, returns : bool
        Add features of the point itself; the cloud needs the columns.
    dimensions : sequence of str
        Other columns of the cloud whose values are features as they are.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    array of shape (n, 16 * levels + point features)
        Columns as in `names`; rows of points with NaN or infinite coordinates are NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import features
    >>> plane = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), -1).reshape(-1, 3)
    >>> table = features.multiscale(plane, first_scale=1.0, levels=2)
    >>> table.shape
    (400, 32)
    >>> float(table[:, features.names(first_scale=1.0, levels=2).index("SurfaceVariation_r1")].max())
    0.0
    """
    choice(centre, "centre", ("medoid", "mean"))
    choice(divisor, "divisor", ("n", "n-1"))
    choice(column, "column", ("cylinder", "cell"))
    pyramid = {
        "first_scale": first_scale,
        "levels": levels,
        "k": k,
        "include_query": include_query,
        "centre": centre,
        "divisor": divisor,
        "normalise": normalise,
        "column": column,
        "column_radius": column_radius,
        "near_share": near_share,
    }
    point = {"colour": colour, "intensity": intensity, "returns": returns, "dimensions": list(dimensions)}
    settings = to_json({"pyramid": pyramid, "metres_per_unit": metres_per_unit, **point})
    cloud = as_cloud(xyz, columns=_core.feature_columns(settings))
    return _core.multiscale(cloud._core, settings, n_jobs)


def names(
    *,
    first_scale: float = 0.025,
    levels: int = 9,
    colour: bool = False,
    intensity: bool = False,
    returns: bool = False,
    dimensions: Sequence[str] = (),
) -> list[str]:
    """Names of the columns of `multiscale`, e.g. ``Planarity_r0p4``: level by level, then those of the point itself.

    Parameters
    ----------
    first_scale : float
        Edge of the finest voxel in metres.
    levels : int
        Number of levels, each with voxels of twice the edge.
    colour, intensity, returns : bool
        Whether features of the point itself are included.
    dimensions : sequence of str
        Other columns of the cloud that are features as they are.

    Examples
    --------
    >>> from scansion import features
    >>> features.names()[0], len(features.names())
    ('Sum_r0p025', 144)
    """
    pyramid = {"first_scale": first_scale, "levels": levels}
    point = {"colour": colour, "intensity": intensity, "returns": returns, "dimensions": list(dimensions)}
    settings = to_json({"pyramid": pyramid, **point})
    return _core.feature_names(settings, first_scale)


def definitions() -> list[dict[str, str]]:
    """All features: name, group, formula, range, unit, missing value and reach of each.

    Features of a level have the scale appended in the tables of `multiscale`; segments have their own groups.

    Examples
    --------
    >>> from scansion import features
    >>> next(d["formula"] for d in features.definitions() if d["name"] == "Planarity")
    '(l2 - l3) / l1'
    """
    found: list[dict[str, str]] = json.loads(_core.feature_definitions())
    return found


def preset(name: str) -> dict[str, Any]:
    """Keywords of `multiscale` that follow the conventions of other software.

    Parameters
    ----------
    name : {"hackel", "jakteristics", "pgeof"}
        "hackel" is the default.

    Examples
    --------
    >>> from scansion import features
    >>> features.preset("jakteristics")["divisor"]
    'n-1'
    """
    found: dict[str, Any] = json.loads(_core.feature_preset(name))
    return found


def normals(
    xyz: Any,
    k: int = 15,
    *,
    orientation: str | tuple[float, float, float] = "up",
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Normal and surface variation of every point from its nearest neighbours.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    k : int
        Number of neighbours of a point, not counting itself; 2..32.
    orientation : "up", "spanning-tree" or (x, y, z)
        Orientation of the normals: up; consistently to one side of the surface, propagated from the highest point (Hoppe et
        al. 1992); or towards a sensor at this position, in metres.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    normals : array of shape (n, 3), float32
        Unit vectors.
    variation : array of shape (n,), float32
        Smallest eigenvalue divided by the sum of all, 0..1/3.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import features
    >>> wall = np.stack(np.meshgrid(np.arange(9.0), [0.0], np.arange(9.0)), -1).reshape(-1, 3)
    >>> directions, variation = features.normals(wall, k=8, orientation=(4.0, -10.0, 4.0))
    >>> directions[0].round(3).tolist(), float(variation.max())
    ([-0.0, -1.0, -0.0], 0.0)
    """
    if isinstance(orientation, str):
        choice(orientation, "orientation", ("up", "spanning-tree"))
        side: Any = orientation
    else:
        side = {"sensor": [float(v) for v in orientation]}
    return _core.normals(as_cloud(xyz, columns=[])._core, k, json.dumps(side), metres_per_unit, n_jobs)


def radius(
    xyz: Any,
    radii: float | Sequence[float] = 1.0,
    features: Sequence[str] | None = None,
    *,
    shape: Literal["sphere", "cylinder"] = "sphere",
    divisor: Literal["n", "n-1"] = "n-1",
    normalise: bool = False,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.float32]:
    """Covariance features of all points within a radius of each point: names and values of jakteristics.

    ``features.radius(xyz, 0.5, ["planarity", "nz"])`` stands for ``jakteristics.compute_features(xyz, 0.5,
    feature_names=["planarity", "nz"])`` (version 0.6.2). Differences: several radii may be given; the number of neighbours
    has no limit; where all points of a neighbourhood are in one place, or it holds a single one, features are 0
    instead of NaN; the largest component of eigenvectors is positive; points are compared in float32 metres relative to a
    corner of the cloud, so that a point whose distance is the radius but for 1e-7 of the extent may be counted
    otherwise.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    radii : float or sequence of float
        In metres, each above 0.
    features : sequence of str, optional
        Names as in `radius_names`; all by default.
    shape : {"sphere", "cylinder"}
        All points within the radius, or within it in plan, at any height.
    divisor : {"n", "n-1"}
        Divisor of the covariance.
    normalise : bool
        Whether eigenvalues are divided by their sum before omnivariance and entropy.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    array of shape (n, number of radii * number of features), float32
        The features at the first radius, then those at the second.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import features
    >>> plane = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0), [0.0]), -1).reshape(-1, 3)
    >>> features.radius(plane, [1.0, 1.5], ["number_of_neighbors", "verticality"])[40].tolist()
    [5.0, 0.0, 9.0, 0.0]
    """
    choice(shape, "shape", ("sphere", "cylinder"))
    choice(divisor, "divisor", ("n", "n-1"))
    given: list[float] = np.atleast_1d(unmasked(radii, "radii", np.float64)).tolist()
    if not np.all(np.isfinite(given)):
        raise ValueError(f"radii: found {given}, expected finite numbers")
    settings = {"radii": given, "shape": shape, "divisor": divisor, "normalise": normalise}
    wanted = radius_names() if features is None else list(features)
    cloud = as_cloud(xyz, columns=[])
    found = _core.radius_features(cloud._core, wanted, to_json(settings), metres_per_unit, n_jobs)
    return found if wanted else found.reshape(len(cloud), 0)


def radius_names() -> list[str]:
    """Names of all features of `radius`, those of jakteristics.

    Examples
    --------
    >>> from scansion import features
    >>> features.radius_names()[:3]
    ['eigenvalue_sum', 'omnivariance', 'eigenentropy']
    """
    return _core.radius_names()
