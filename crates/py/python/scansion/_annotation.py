"""Labelling with the help of segments: labels picked by hand, spread over segments, and colours of segments."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _arrays, _core
from scansion._cloud import PointCloud, as_cloud
from scansion._labels import signed

Path = str | os.PathLike[str]


def picked_labels(
    cloud: PointCloud | ArrayLike,
    files: Path | Sequence[Path],
    *,
    within: float = 0.5,
    unit: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.int16]:
    """Labels picked by hand, for the points of a cloud.

    Parameters
    ----------
    cloud : PointCloud or array_like of shape (n, 3)
        The points.
    files : path, or list of paths
        Tables with the columns x, y, z, class (for the nearest point) or cluster_id, class (for all points with that
        ``ClusterID``), or GeoJSON with polygons that have a property ``class`` (for all points in them).
    within : float
        Largest distance between a position and the nearest point, metres.
    unit : float, optional
        Metres per unit of the coordinates; by default what the cloud says, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. Results do not depend on it.

    Returns
    -------
    ndarray of shape (n,)
        Class codes, -1 for points without a label.

    Raises
    ------
    ValueError
        If a position is too far from every point, a polygon holds none, or a point gets two classes.

    Examples
    --------
    >>> import numpy as np, pathlib, scansion, tempfile
    >>> table = pathlib.Path(tempfile.mkdtemp()) / "picked.csv"
    >>> _ = table.write_text("x,y,z,class\\n0.1,0,0,6\\n")
    >>> scansion.picked_labels(np.array([[0.0, 0, 0], [5, 0, 0]]), table).tolist()
    [6, -1]
    """
    paths = [files] if isinstance(files, (str, os.PathLike)) else list(files)
    return _core.picked_labels(as_cloud(cloud)._core, [os.fspath(path) for path in paths], within, unit, n_jobs)


def spread_labels(labels: ArrayLike, segments: ArrayLike) -> NDArray[np.int16]:
    """The labels of a few points, spread over the segments that these points are in.

    All points of a segment get the most frequent of its labels; segments in which several are equally frequent keep what
    they have, and so do points of no segment (number 0 or -1).

    Parameters
    ----------
    labels : array_like of shape (n,)
        Class codes; negative for points without a label.
    segments : array_like of shape (n,)
        Number of the segment of each point, as of `segment`, -1..4294967295.

    Returns
    -------
    ndarray of shape (n,)
        Class codes, -1 for points without a label.

    Examples
    --------
    >>> import scansion
    >>> scansion.spread_labels([6, -1, -1, 2], [1, 1, 2, 3]).tolist()
    [6, 6, -1, 2]
    """
    return _core.spread_labels(signed(labels, "labels"), _numbers(segments))


def segment_colours(segments: ArrayLike) -> NDArray[np.uint8]:
    """A colour for each segment number, in which segments with neighbouring numbers differ; no segment (0 or -1) is grey.

    Parameters
    ----------
    segments : array_like of shape (n,)
        Numbers of segments, -1..4294967295.

    Returns
    -------
    ndarray of shape (n, 3)
        Red, green and blue, 0..255.

    Examples
    --------
    >>> import scansion
    >>> scansion.segment_colours([0, 1, 1]).tolist()[0]
    [190, 190, 190]
    """
    return _core.segment_colours(_numbers(segments))


def _numbers(segments: ArrayLike) -> NDArray[np.uint32]:
    """Numbers of segments, 0 for none."""
    numbers = _arrays.segments(segments, "segments")
    return _arrays.native(np.where(numbers == -1, 0, numbers), np.uint32)
