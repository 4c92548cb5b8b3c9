"""Segmentation of graphs and of clouds.

Values of nodes are used in float32, after subtraction of the minimum of a column where that is more than 1000 times the
range of the column.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import as_array, to_json
from scansion._clusters import Automatic, ClusterLevels, automatic_parameters, cluster_levels
from scansion._graph import valued
from scansion._partition import Partition, PartitionParams, partition
from scansion._regions import Riemannian, octree_region_growing, region_growing, riemannian
from scansion._segment_shapes import SegmentShapes, segment_graph, segment_shapes
from scansion._settings import seed
from scansion._supervoxels import object_features, supervoxels

__all__ = [
    "Automatic",
    "ClusterLevels",
    "Partition",
    "PartitionParams",
    "Riemannian",
    "SegmentShapes",
    "Segments",
    "automatic_parameters",
    "cluster_levels",
    "cut_pursuit",
    "merge",
    "object_features",
    "octree_region_growing",
    "partition",
    "region_growing",
    "riemannian",
    "segment_graph",
    "segment_shapes",
    "supervoxels",
]


def __dir__() -> list[str]:
    return __all__


class Segments(NamedTuple):
    """Segment of each node, mean values of each segment, and the energy; as an array, the segments."""

    labels: NDArray[np.uint32]
    centroids: NDArray[np.float64]
    energy: float

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return as_array(self.labels, dtype, copy)


def cut_pursuit(
    values: Any,
    edges: Any,
    weights: Any = None,
    *,
    strength: float = 0.1,
    cutoff: float = 0.0,
    node_weights: Any = None,
    coarse_above: int | None = 10_000,
    cycles: int = 2,
    flow_steps: int = 3,
    means_steps: int = 5,
    restarts: int = 3,
    attempts: int = 4,
    max_iterations: int = 10,
    tolerance: float = 1e-3,
    guard: bool = False,
    backward: bool = True,
    moves: bool = True,
    random_state: int = 0,
    n_jobs: int | None = None,
) -> Segments:
    """Segments by l0 cut pursuit: minimises the sum of squared differences and of boundary costs.

    L. Landrieu, G. Obozinski, *Cut pursuit: fast algorithms to learn piecewise constant functions on general weighted
    graphs*, SIAM J. Imaging Sciences 10(4), 2017; their method is
    ``coarse_above=None, cycles=1, attempts=1, moves=False``.

    Parameters
    ----------
    values : array_like of shape (n, d)
        Values of each node, e.g. the features of `scansion.neighbours.optimal`; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.
    strength : float
        Cost of a boundary edge of weight 1, in units of squared difference; larger values give fewer, larger segments.
    cutoff : float
        Segments of less weight than this are merged into their best neighbour at the end.
    node_weights : array_like of shape (n,), optional
        Weight of each node; 1 by default.
    coarse_above : int, optional
        Graphs of more nodes than this are first cut on a coarser graph, which is many times faster; None: never.
    cycles : int
        Number of repetitions of the whole method, each from the result before; 1 or more.
    flow_steps : int
        Number of minimum cuts per split.
    means_steps : int
        Iterations of the 2-means that starts a split.
    restarts : int
        Number of random starts of the 2-means.
    attempts : int
        Number of splits tried for each segment, of which the one of least energy is used; 1 or more.
    max_iterations : int
        Largest number of iterations of splitting and merging.
    tolerance : float
        Stop when an iteration lowers the energy by less than this share of it.
    guard : bool
        Split a segment only if that lowers the energy immediately.
    backward : bool
        Merge segments after each iteration.
    moves : bool
        Move single nodes across boundaries where that lowers the energy; not part of the published method.
    random_state : int
        Seed of the 2-means.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    Segments
        ``labels`` of the nodes, ``centroids`` of the segments, shape (segments, d), and the ``energy``.

    Examples
    --------
    >>> from scansion import segmentation
    >>> edges = [[0, 1], [1, 2], [2, 3]]
    >>> found = segmentation.cut_pursuit([[0.0], [0.25], [5.0], [5.25]], edges, strength=0.5)
    >>> found.labels.tolist(), found.centroids.ravel().tolist(), found.energy
    ([0, 0, 1, 1], [0.125, 5.125], 0.5625)
    """
    settings = {
        "strength": strength,
        "cutoff": cutoff,
        "seed": seed(random_state),
        "steps": {
            "coarse_above": coarse_above,
            "cycles": cycles,
            "flow_steps": flow_steps,
            "means_steps": means_steps,
            "restarts": restarts,
            "attempts": attempts,
            "max_iterations": max_iterations,
            "tolerance": tolerance,
            "guard": guard,
            "backward": backward,
            "moves": moves,
        },
    }
    given, offsets = valued(values, edges, weights, node_weights)
    return _segments(_core.cut_pursuit(given, to_json(settings, ("strength", "cutoff")), n_jobs), offsets)


def merge(
    values: Any,
    edges: Any,
    weights: Any = None,
    *,
    strength: float = 0.1,
    cutoff: float = 0.0,
    node_weights: Any = None,
) -> Segments:
    """Segments by greedy merging: from single nodes, merges pairs of largest gain while the energy of `cut_pursuit` falls.

    Parameters
    ----------
    values : array_like of shape (n, d)
        Values of each node; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.
    strength : float
        Cost of a boundary edge of weight 1, in units of squared difference; larger values give fewer, larger segments.
    cutoff : float
        Segments of less weight than this are merged into their best neighbour at the end.
    node_weights : array_like of shape (n,), optional
        Weight of each node; 1 by default.

    Returns
    -------
    Segments
        ``labels`` of the nodes, ``centroids`` of the segments, shape (segments, d), and the ``energy``.

    Examples
    --------
    >>> from scansion import segmentation
    >>> edges = [[0, 1], [1, 2], [2, 3]]
    >>> segmentation.merge([[0.0], [0.25], [5.0], [5.25]], edges, strength=0.5).labels.tolist()
    [0, 0, 1, 1]
    """
    settings = to_json({"strength": strength, "cutoff": cutoff}, ("strength", "cutoff"))
    given, offsets = valued(values, edges, weights, node_weights)
    return _segments(_core.merge_regions(given, settings), offsets)


def _segments(
    found: tuple[NDArray[np.uint32], NDArray[np.float64], float], offsets: NDArray[np.float64]
) -> Segments:
    """Segments whose centroids are means of the values as they were given."""
    labels, centroids, least = found
    return Segments(labels, centroids + offsets, least)
