"""Partitions for a purpose: the strength is searched, so that the user need not know what it means."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import as_array, to_json
from scansion._cloud import as_cloud
from scansion._graph import valued
from scansion._labels import signed
from scansion._settings import seed, share, whole


@dataclass(frozen=True)
class PartitionParams:
    """Parameters of a partition; the section ``[partition]`` of recipes.

    Give at most one of ``strength``, ``segments_per_hectare``, ``smallest_object``, ``smallest_object_points`` and
    ``oracle_loss``; all but the first search for the strength.

    Parameters
    ----------
    strength : float, optional
        Cost of a boundary edge of weight 1, in units of squared difference; 0.1 if no aim is given.
    segments_per_hectare : float, optional
        Number of segments per hectare of covered ground (cells of 2 m in plan that hold points); needs positions.
    smallest_object : float, optional
        The finest partition of which at most 5 % of the nodes lie in segments that are shorter than this in every direction,
        metres; needs positions.
    smallest_object_points : float, optional
        The same for segments of fewer nodes than this.
    oracle_loss : float, optional
        The coarsest partition whose oracle accuracy on the labels is at most this much below that of a very fine one, 0..1;
        needs labels.
    method : {"cut-pursuit", "merge"}
        Lower energy, or faster.
    cutoff : float
        Segments of less weight than this are merged into their best neighbour at the end.
    trials : int
        Largest number of partitions computed in the search for the strength.
    random_state : int
        Seed of cut pursuit.

    Examples
    --------
    >>> from scansion.segmentation import PartitionParams
    >>> PartitionParams(segments_per_hectare=200).settings()["intent"]
    {'segments-per-hectare': 200.0}
    """

    strength: float | None = None
    segments_per_hectare: float | None = None
    smallest_object: float | None = None
    smallest_object_points: float | None = None
    oracle_loss: float | None = None
    method: str = "cut-pursuit"
    cutoff: float = 0.0
    trials: int = 14
    random_state: int = 0

    def settings(self) -> dict[str, Any]:
        """The same under the names used in recipes, e.g. for ``recipe={"regularise.partition.cutoff": 10}``."""
        aims = {
            "strength": self.strength,
            "segments-per-hectare": self.segments_per_hectare,
            "smallest-object": self.smallest_object,
            "smallest-object-points": self.smallest_object_points,
            "oracle-accuracy": self.oracle_loss,
        }
        given = {name: float(value) for name, value in aims.items() if value is not None}
        if len(given) > 1:
            raise ValueError(f"found {', '.join(given)}, expected at most one of them")
        return {
            "method": self.method,
            "intent": given or {"strength": 0.1},
            "cutoff": share(self.cutoff, "cutoff", (0, np.inf)),
            "trials": whole(self.trials, "trials"),
            "seed": seed(self.random_state),
        }


class Partition(NamedTuple):
    """The partition that fulfils an aim best; as an array, the labels."""

    labels: NDArray[np.uint32]
    """Segment of each node, numbered in the order of their smallest nodes."""
    strength: float
    """The strength of this partition."""
    trials: list[dict[str, Any]]
    """``strength``, ``segments``, ``energy``, ``small_share``, ``oracle_accuracy`` of all trials, by strength."""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return as_array(self.labels, dtype, copy)


def partition(
    values: Any,
    edges: Any,
    params: PartitionParams | None = None,
    *,
    weights: Any = None,
    node_weights: Any = None,
    xyz: Any = None,
    labels: ArrayLike | None = None,
    n_jobs: int | None = None,
) -> Partition:
    """Partitions a graph, with the strength that fulfils an aim.

    Parameters
    ----------
    values : array_like of shape (n, d)
        Values of each node, e.g. the features of `scansion.neighbours.optimal`; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    params : PartitionParams, optional
        The aim and other parameters; a strength of 0.1 by default.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.
    node_weights : array_like of shape (n,), optional
        Weight of each node; 1 by default.
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3), optional
        Position of each node.
    labels : array_like of shape (n,), optional
        Class codes 0..255 of the nodes, negative: unlabelled.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Examples
    --------
    >>> from scansion.segmentation import PartitionParams, partition
    >>> edges = [[0, 1], [1, 2], [2, 3]]
    >>> found = partition([[0.0], [0.25], [5.0], [5.25]], edges, PartitionParams(oracle_loss=0.0), labels=[2, 2, 6, 6])
    >>> found.labels.tolist()
    [0, 0, 1, 1]
    """
    given, _ = valued(values, edges, weights, node_weights)
    codes = None if labels is None else signed(labels, "labels")
    cloud = None if xyz is None else as_cloud(xyz, columns=[])._core
    settings = to_json((params or PartitionParams()).settings(), ("strength",))
    found, strength, trials = _core.partition(given, settings, cloud, codes, n_jobs)
    # JSON has no infinity: it says null.
    tried = [{**t, "strength": np.inf if t["strength"] is None else t["strength"]} for t in json.loads(trials)]
    return Partition(found, strength, tried)
