"""Nearest neighbours and optimal neighbourhoods of points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, to_json
from scansion._cloud import as_cloud

__all__ = ["knn", "optimal", "within"]


def __dir__() -> list[str]:
    return __all__


def knn(
    xyz: Any, k: int = 10, *, metres_per_unit: float | None = None, n_jobs: int | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """The ``k`` nearest other points of every point, exactly.

    Points are compared in float32 metres relative to a corner of the cloud, so that of two neighbours whose distances differ
    by 1e-7 of the extent either may be the nearer one.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    k : int
        Number of neighbours of a point, not counting itself; less than the number of points.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    indices : array of shape (n, k), uint32
        Nearest first; ties in the order of the index.
    distances : array of shape (n, k), float32
        In metres.

    Examples
    --------
    >>> from scansion import neighbours
    >>> indices, distances = neighbours.knn([[0, 0, 0], [1, 0, 0], [3, 0, 0]], k=2)
    >>> indices.tolist(), distances.tolist()
    ([[1, 2], [0, 2], [1, 0]], [[1.0, 3.0], [1.0, 2.0], [2.0, 3.0]])
    """
    return _core.knn(as_cloud(xyz, columns=[])._core, k, metres_per_unit, n_jobs)


def within(
    xyz: Any,
    radius: float,
    queries: Any = None,
    *,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]:
    """All points within a radius of every query, exactly.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    radius : float
        In metres, 0 or more. A point at this distance is within, up to the rounding of float32.
    queries : PointCloud, path, laspy.LasData, structured array or array_like of shape (q, 3), optional
        The positions around which points are sought; by default the points themselves, each of which then finds itself.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    offsets : array of shape (q + 1,), uint32
        The points of query i are ``indices[offsets[i] : offsets[i + 1]]``.
    indices : array of shape (m,), uint32
        Of each query, nearest first; ties in the order of the index.
    distances : array of shape (m,), float32
        In metres.

    Examples
    --------
    >>> from scansion import neighbours
    >>> offsets, indices, distances = neighbours.within([[0, 0, 0], [1, 0, 0], [3, 0, 0]], 2.0)
    >>> offsets.tolist(), indices.tolist(), distances.tolist()
    ([0, 2, 5, 7], [0, 1, 1, 0, 2, 2, 1], [0.0, 1.0, 0.0, 1.0, 2.0, 0.0, 2.0])
    """
    cloud = as_cloud(xyz, columns=[])
    others = None if queries is None else as_cloud(queries, columns=[])._core
    return _core.within(cloud._core, others, radius, metres_per_unit, n_jobs)


def optimal(
    xyz: Any,
    *,
    k_min: int = 10,
    k_max: int = 100,
    k_step: int = 1,
    eigenvalues: str = "raw",
    verticality_factor: float = 1.0,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """The neighbourhood of lowest eigenentropy of every point, and its shape.

    M. Weinmann et al., ISPRS Journal 105, 2015, doi:10.1016/j.isprsjprs.2015.01.016; S. Guinard, L. Landrieu, 2017,
    doi:10.5194/isprs-archives-XLII-1-W1-151-2017.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    k_min, k_max : int
        Smallest and largest number of neighbours, not counting the point itself; 2 <= k_min <= k_max <= 1000.
    k_step : int
        Neighbourhoods of k_min, k_min + k_step, ... and of k_max neighbours are compared.
    eigenvalues : {"raw", "sqrt"}
        Quantities in linearity, planarity and scattering: the eigenvalues or their square roots.
    verticality_factor : float
        Factor of verticality.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    k : array of shape (n,), uint32
        Number of neighbours in the chosen neighbourhood.
    features : array of shape (n, 4), float32
        Its linearity, planarity, scattering and verticality.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import neighbours
    >>> wall = np.stack(np.meshgrid(np.arange(20.0), [0.0], np.arange(20.0)), -1).reshape(-1, 3)
    >>> k, features = neighbours.optimal(wall, k_max=50)
    >>> features.shape, float(features[:, 2].max())
    ((400, 4), 0.0)
    """
    choice(eigenvalues, "eigenvalues", ("raw", "sqrt"))
    settings = {"k_min": k_min, "k_max": k_max, "k_step": k_step, "eigenvalues": eigenvalues}
    text = to_json({**settings, "verticality_factor": verticality_factor})
    return _core.optimal(as_cloud(xyz, columns=[])._core, text, metres_per_unit, n_jobs)
