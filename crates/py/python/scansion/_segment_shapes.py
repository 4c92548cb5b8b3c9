"""Adjacency and shapes of segments."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import choice, in_segments
from scansion._cloud import as_cloud
from scansion._graph import as_edges, as_weights, edges_between


class SegmentShapes(NamedTuple):
    """Shape of each segment, in the order of the first points of the segments."""

    points: NDArray[np.uint64]
    """Number of points."""
    centroid: NDArray[np.float64]
    """Mean of the points, shape (segments, 3)."""
    low: NDArray[np.float64]
    """Lowest x, y and z."""
    high: NDArray[np.float64]
    """Highest x, y and z."""
    centre: NDArray[np.float64]
    """Centre of the oriented box."""
    sides: NDArray[np.float64]
    """Sides of the oriented box, falling."""
    axes: NDArray[np.float64]
    """Direction of each side, shape (segments, 3, 3)."""


def segment_shapes(xyz: Any, labels: ArrayLike) -> SegmentShapes:
    """Number of points, extent and oriented box of each segment.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    labels : array_like of shape (n,)
        Segment of each point, 0..4294967295; points of -1 are in none and left out.

    Returns
    -------
    SegmentShapes
        Metres, in the cloud's coordinates.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(3.0), [0.0]), -1).reshape(-1, 3)
    >>> found = segmentation.segment_shapes(np.concatenate([grid, grid + 50.0]), np.repeat([7, 3], 15))
    >>> found.points.tolist(), found.centroid[1].tolist(), found.sides[0].round(6).tolist()
    ([15, 15], [52.0, 51.0, 50.0], [4.0, 2.0, 0.0])
    """
    cloud = as_cloud(xyz, columns=[])
    of, kept = in_segments(labels, "labels", len(cloud))
    cloud = cloud if kept is None else cloud[kept]
    points, rows = _core.segment_shapes(cloud._core, of)
    centroid, low, high, centre, sides = (rows[:, first : first + 3] for first in range(0, 15, 3))
    return SegmentShapes(points, centroid, low, high, centre, sides, rows[:, 15:].reshape(-1, 3, 3))


def segment_graph(
    edges: Any, labels: ArrayLike, weights: Any = None, *, interface: str = "count"
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """The graph of adjacent segments.

    Parameters
    ----------
    edges : array_like of shape (m, 2)
        Pairs of points.
    labels : array_like of shape (n,)
        Segment of each point, 0..4294967295; points of -1 are in none and left out.
    weights : array_like of shape (m,), optional
        Weights of the edges; 1 by default.
    interface : {"count", "weight"}
        The weight of two adjacent segments: the number of edges between them, or the sum of their weights.

    Returns
    -------
    edges : array of shape (k, 2), uint32
        Pairs of segments, numbered in the order of their first points.
    weights : array of shape (k,), float32

    Examples
    --------
    >>> from scansion import segmentation
    >>> edges, weights = segmentation.segment_graph([[0, 1], [1, 2], [0, 2], [2, 3]], [4, 4, 9, 9])
    >>> edges.tolist(), weights.tolist()
    ([[0, 1]], [2.0])
    """
    choice(interface, "interface", ("count", "weight"))
    pairs, (of, kept) = as_edges(edges), in_segments(labels, "labels")
    each = as_weights(weights, len(pairs))
    if kept is not None:
        pairs, each = edges_between(pairs, each, kept)
    return _core.segment_graph(pairs, of, each, interface == "weight")
