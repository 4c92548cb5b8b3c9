"""Segments of a cloud that follow its surfaces: the Riemannian graph, and region growing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, to_json
from scansion._cloud import as_cloud
from scansion._settings import together


class Riemannian(NamedTuple):
    """Segment and supervoxel of each point, and a report with sizes and seconds of all stages."""

    labels: NDArray[np.uint32]
    supervoxels: NDArray[np.uint32]
    report: dict[str, Any]


def riemannian(
    xyz: Any,
    *,
    min_depth: int | None = None,
    strength: float | None = None,
    settings: Mapping[str, Any] | None = None,
    n_jobs: int | None = None,
) -> Riemannian:
    """Segments by supervoxels of an adaptive octree on a Riemannian graph.

    M. Li, *A super voxel-based Riemannian graph for multi scale segmentation of LiDAR point clouds*, ISPRS Annals, 2018.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    min_depth : int, optional
        Least depth of the octree: the number of times that the cloud's cube is halved on each axis everywhere; 6 by default.
    strength : float, optional
        Cost of an edge between segments; larger values give fewer, larger segments; 0.1 by default.
    settings : mapping, optional
        Further settings, as in a recipe: ``{"graph": {"nearest": 12}, "octree.stop.absolute": 0.5}``. A setting that is
        also given as an argument is an error.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    Riemannian
        ``labels`` and ``supervoxels`` of each point, uint32, and a ``report`` of all stages.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 8.0, 0.125)
    >>> floor = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([0.0], grid, grid + 0.125), -1).reshape(-1, 3)
    >>> found = segmentation.riemannian(np.concatenate([floor, wall]), min_depth=4, strength=0.3)
    >>> bool(found.labels[2000] != found.labels[6000]), found.report["segments"] < found.report["supervoxels"]
    (True, True)
    """
    given = together(settings, strength=strength, octree__min_depth=min_depth)
    points, text = as_cloud(xyz, columns=[])._core, to_json(given)
    clusters, segments, report = _core.riemannian(points, text, n_jobs)
    return Riemannian(segments, clusters, json.loads(report))


def region_growing(
    xyz: Any,
    *,
    k: int = 15,
    angle_deg: float = 10.0,
    variation: float = 0.03,
    min_size: int = 50,
    reference: str = "current",
    n_jobs: int | None = None,
) -> NDArray[np.uint32]:
    """Smooth regions of points (Rabbani, van den Heuvel and Vosselman 2006).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    k : int
        Number of neighbours for region growing and for normals; 2..32.
    angle_deg : float
        Largest angle between normals, degrees.
    variation : float
        Regions grow on only from points whose surface variation is below this.
    min_size : int
        Regions of fewer points are dissolved.
    reference : {"current", "seed"}
        Which normal the next one is compared with: that of the neighbour (regions may bend) or of the first seed (flat).
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    labels : array of shape (n,), uint32
        Region of each point, from 1; 0 for none.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 5.0, 0.25)
    >>> planes = np.stack(np.meshgrid(grid, grid, [0.0, 3.0]), -1).reshape(-1, 3)
    >>> segmentation.region_growing(planes, k=8).max()
    np.uint32(2)
    """
    choice(reference, "reference", ("current", "seed"))
    settings = {"angle_deg": angle_deg, "variation": variation, "min_size": min_size, "reference": reference}
    return _core.region_growing(as_cloud(xyz, columns=[])._core, k, to_json(settings), n_jobs)


def octree_region_growing(
    xyz: Any, *, size: float | None = None, settings: Mapping[str, Any] | None = None, n_jobs: int | None = None
) -> NDArray[np.uint32]:
    """Octree-based region growing: flat voxels, refined at the boundary of regions (Vo et al. 2015).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    size : float, optional
        Edge of the largest voxels, metres; 2 by default. In ``settings`` it is ``largest_voxel``.
    settings : mapping, optional
        Further settings, as in a recipe: ``{"residual": 0.05, "angle_deg": 15.0}``. A setting that is also given as an
        argument is an error.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    labels : array of shape (n,), uint32
        Region of each point, from 1; 0 for none.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 8.0, 0.125)
    >>> planes = np.stack(np.meshgrid(grid, grid, [0.5, 5.5]), -1).reshape(-1, 3)
    >>> segmentation.octree_region_growing(planes).max()
    np.uint32(2)
    """
    text = to_json(together(settings, largest_voxel=size))
    return _core.octree_region_growing(as_cloud(xyz, columns=[])._core, text, n_jobs)
