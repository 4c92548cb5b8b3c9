"""Graphs on points, their components and spanning trees.

A graph is two arrays: edges ``(m, 2)`` of uint32, each pair once, the smaller node first, ascending; and their weights
``(m,)`` of float32.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, to_json
from scansion._cloud import as_cloud
from scansion._graph import as_edges, as_weights

__all__ = ["connected_components", "felzenszwalb", "knn_graph", "minimum_spanning_tree"]


def __dir__() -> list[str]:
    return __all__


def knn_graph(
    xyz: Any,
    *,
    k: int = 10,
    weights: Literal["constant", "inverse", "exponential"] = "constant",
    offset: float = 1.0,
    scale: float = 1.0,
    multiplicity: Literal["once", "count"] = "once",
    prune: float | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Edges between points of which one is among the ``k`` nearest of the other.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    k : int
        Number of neighbours of a point, not counting itself; fewer if there are fewer points.
    weights : {"constant", "inverse", "exponential"}
        1, ``1 / (offset + d / mean)`` or ``exp(-d / (scale * mean))`` for an edge of length d, where mean is the mean
        length of the edges.
    offset : float
        For "inverse"; above 0. Superpoint graphs have 1.
    scale : float
        For "exponential"; above 0.
    multiplicity : {"once", "count"}
        Whether points that are neighbours of each other have an edge of twice the weight, which then counts twice in mean.
    prune : float, optional
        Edges longer than this multiple of the mean length are removed.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    edges : array of shape (m, 2), uint32
    weights : array of shape (m,), float32

    Examples
    --------
    >>> from scansion import graph
    >>> edges, weights = graph.knn_graph([[0, 0, 0], [1, 0, 0], [3, 0, 0]], k=1)
    >>> edges.tolist(), weights.tolist()
    ([[0, 1], [1, 2]], [1.0, 1.0])
    """
    choice(weights, "weights", ("constant", "inverse", "exponential"))
    choice(multiplicity, "multiplicity", ("once", "count"))
    kinds = {"constant": "constant", "inverse": {"inverse": {"offset": offset}}}
    weight = kinds.get(weights, {"exponential": {"scale": scale}})
    settings = to_json({"weight": weight, "multiplicity": multiplicity, "prune": prune})
    return _core.knn_graph(as_cloud(xyz, columns=[])._core, k, settings, metres_per_unit, n_jobs)


def connected_components(nodes: int, edges: Any) -> tuple[NDArray[np.uint32], int]:
    """Connected components of a graph.

    Parameters
    ----------
    nodes : int
        Number of nodes.
    edges : array_like of shape (m, 2)
        Pairs of nodes in any order.

    Returns
    -------
    components : array of shape (nodes,), uint32
        Component of each node, numbered in the order of their smallest nodes.
    count : int
        Number of components.

    Examples
    --------
    >>> from scansion import graph
    >>> components, count = graph.connected_components(5, [[3, 1], [4, 2]])
    >>> components.tolist(), count
    ([0, 1, 2, 1, 2], 3)
    """
    return _core.connected_components(nodes, as_edges(edges))


def minimum_spanning_tree(
    nodes: int, edges: Any, weights: Any = None
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Minimum spanning tree, or forest: a tree for every component.

    Parameters
    ----------
    nodes : int
        Number of nodes.
    edges : array_like of shape (m, 2)
        Pairs of nodes in any order; of pairs that occur more than once the smallest weight counts.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.

    Returns
    -------
    edges : array of shape (nodes - components, 2), uint32
    weights : array of shape (nodes - components,), float32

    Examples
    --------
    >>> from scansion import graph
    >>> edges, weights = graph.minimum_spanning_tree(3, [[0, 1], [0, 2], [1, 2]], [1.0, 3.0, 2.0])
    >>> edges.tolist(), float(weights.sum())
    ([[0, 1], [1, 2]], 3.0)
    """
    pairs = as_edges(edges)
    return _core.minimum_spanning_tree(nodes, pairs, as_weights(weights, len(pairs)))


def felzenszwalb(
    nodes: int, edges: Any, weights: Any, *, k: float = 0.5, meaning: str = "dissimilarity"
) -> tuple[NDArray[np.uint32], int]:
    """Graph-based segmentation: components that differ more from each other than within.

    P. F. Felzenszwalb, D. P. Huttenlocher, 2004, doi:10.1023/B:VISI.0000022288.19776.77.

    Parameters
    ----------
    nodes : int
        Number of nodes.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,)
        Finite, 0 or more. Of edges that are given more than once the most alike counts.
    k : float
        Larger values give larger components; in units of the weights.
    meaning : {"dissimilarity", "similarity"}
        Meaning of the weights: 0 for equal ends, or 1 for equal ends.

    Returns
    -------
    components : array of shape (nodes,), uint32
    count : int

    Examples
    --------
    >>> from scansion import graph
    >>> components, count = graph.felzenszwalb(4, [[0, 1], [1, 2], [2, 3]], [0.1, 5.0, 0.1], k=1.0)
    >>> components.tolist(), count
    ([0, 0, 1, 1], 2)
    """
    choice(meaning, "meaning", ("dissimilarity", "similarity"))
    pairs = as_edges(edges)
    each = as_weights(weights, len(pairs))
    if each is None:
        raise TypeError("weights: found None, expected one per edge")
    return _core.felzenszwalb(nodes, pairs, each, to_json({"k": k, "meaning": meaning}, ("k",)))
