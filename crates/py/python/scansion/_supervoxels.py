"""Supervoxels of a cloud, and features of segments."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, column, in_segments, native, refuse, to_json
from scansion._cloud import as_cloud
from scansion._graph import as_rows


def supervoxels(
    xyz: Any,
    *,
    method: str = "slic",
    size: float = 1.2,
    normals: Any = None,
    colours: Any = None,
    spatial_weight: float = 0.4,
    normal_weight: float = 1.0,
    colour_weight: float = 0.1,
    voxel: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.int64]:
    """Supervoxels: small pieces of a cloud whose points are similar in position, normal and colour.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    method : {"slic", "vccs"}
        On points (Hasanpour Zaryabi et al. 2022), or on adjacent voxels, which never crosses a gap (Papon et al. 2013).
    size : float
        Distance of the seeds, metres.
    normals : array_like of shape (n, 3), optional
        Unit normals, as of `scansion.features.normals`.
    colours : array_like of shape (n, 3), optional
        Red, green and blue, 0..1.
    spatial_weight, normal_weight, colour_weight : float
        Weights of the three distances.
    voxel : float, optional
        "vccs": edge of the voxels, metres; a quarter of ``size`` by default.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    labels : array of shape (n,), int64
        Supervoxel of each point; -1 for none, as of stray points: `segment_shapes` and the other functions of segments leave
        such points out.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 8.0, 0.25)
    >>> plane = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> labels = segmentation.supervoxels(plane, size=2.0)
    >>> len(np.unique(labels))
    16
    """
    choice(method, "method", ("slic", "vccs"))
    weights = {"spatial": spatial_weight, "normal": normal_weight, "colour": colour_weight}
    settings: dict[str, Any] = {"size": size, "weights": weights}
    if method == "vccs":
        settings["voxel"] = size / 4 if voxel is None else voxel
    elif voxel is not None:
        raise ValueError(f"voxel: found {voxel!r} with method 'slic', expected None")
    cloud = as_cloud(xyz, columns=[])
    sides, rgb = _triples(normals, "normals", len(cloud)), _colours(colours, len(cloud))
    found = _core.supervoxels(cloud._core, method, to_json(settings), sides, rgb, n_jobs)
    return np.where(found == 2**32 - 1, -1, found.astype(np.int64))


def object_features(
    xyz: Any, labels: Any, *, colours: Any = None, heights: Any = None, n_jobs: int | None = None
) -> tuple[NDArray[np.float32], list[str]]:
    """Features of each segment: shape, colours and height (Hasanpour Zaryabi et al. 2022, Table 3).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    labels : array_like of shape (n,)
        Segment of each point, 0..4294967295; points of -1 are in none and left out.
    colours : array_like of shape (n, 3), optional
        Red, green and blue, 0..1.
    heights : array_like of shape (n,), optional
        Height of each point above the ground, metres, as of `scansion.terrain.heights`; NaN where it is not known.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    features : array of shape (segments, f), float32
        One row a segment, in the order of their first points.
    names : list of str

    Examples
    --------
    >>> from scansion import segmentation
    >>> features, names = segmentation.object_features([[0, 0, 0], [1, 0, 0], [5, 5, 5]], [0, 0, 1])
    >>> features.shape, float(features[0, names.index("Linearity")])
    ((2, 9), 1.0)
    """
    cloud = as_cloud(xyz, columns=[])
    of, kept = in_segments(labels, "labels", len(cloud))
    rgb = _colours(colours, len(cloud))
    above = None if heights is None else native(column(heights, "heights", len(cloud)), np.float32)
    if kept is not None:
        cloud = cloud[kept]
        rgb, above = (None if values is None else values[kept] for values in (rgb, above))
    return _core.object_features(cloud._core, of, rgb, above, n_jobs)


def _colours(values: Any, length: int) -> NDArray[np.float32] | None:
    array = _triples(values, "colours", length)
    if array is not None:
        refuse(~((array >= 0) & (array <= 1)), array, "colours: expected numbers in 0..1")
    return array


def _triples(values: Any, name: str, length: int) -> NDArray[np.float32] | None:
    if values is None:
        return None
    array = as_rows(values, name)
    if array.shape != (length, 3):
        raise ValueError(f"{name}: expected shape ({length}, 3), found {array.shape}")
    return array
