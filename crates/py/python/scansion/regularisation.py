"""Regularisation: neighbours that agree, labellings of least energy, and smoothed probabilities.

The energy of labels is ``sum_i unary[i, l_i] + strength * sum_(i,j) weights_ij * distance(l_i, l_j)``, plus the costs of
the labels that occur. Computed from costs in float32, after subtraction of the least cost of a node where that is more than
1000 times its distance to another cost of the node.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import as_array, choice, finite, to_json, unmasked
from scansion._cloud import as_cloud
from scansion._graph import as_edges, as_rows, as_weights, relative_to_rows
from scansion._settings import dotted_settings, together

__all__ = [
    "Labelling",
    "Regularized",
    "alpha_beta_swap",
    "alpha_expansion",
    "energy",
    "icm",
    "local_smoothing",
    "regularize",
]


def __dir__() -> list[str]:
    return __all__


class Labelling(NamedTuple):
    """Labels, their energy, and whether the search converged; as an array, the labels."""

    labels: NDArray[np.uint16]
    energy: float
    converged: bool

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return as_array(self.labels, dtype, copy)


class Regularized(NamedTuple):
    """Column of the class of each point, the probabilities that the decision is based on, and the energy of the labels, if
    the method minimises one; as an array, the labels."""

    labels: NDArray[np.uint16]
    probabilities: NDArray[np.float32]
    energy: float | None

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return as_array(self.labels, dtype, copy)


METHODS = ("none", "local", "point-crf", "consensus", "segment-crf")


def regularize(
    xyz: Any,
    probabilities: Any,
    *,
    method: str = "segment-crf",
    strength: float | None = None,
    settings: Mapping[str, Any] | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Regularized:
    """Labels that are consistent among neighbours, from class probabilities of any classifier.

    S. Guinard, L. Landrieu, 2017, doi:10.5194/isprs-archives-XLII-1-W1-151-2017, sections 3 and 4. On the command line:
    ``scansion regularize``.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    probabilities : array_like of shape (n, classes)
        Probability of each class at each point, as of ``predict_proba``; finite, at most 65,536 classes.
    method : {"none", "local", "point-crf", "consensus", "segment-crf"}
        "local": the mean of the neighbours' probabilities; "point-crf": a random field on the points; "consensus": the most
        probable class of each segment; "segment-crf": a random field on the segments.
    strength : float, optional
        Cost of an edge between different labels, for "point-crf" and "segment-crf" only; None: 1.
    settings : mapping, optional
        Other settings of the section ``regularise`` of recipes, e.g. ``{"neighbours": 15}``.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    Regularized
        ``labels``, the ``probabilities`` that they are based on, of shape (n, classes), and the ``energy``.

    Examples
    --------
    >>> from scansion import regularisation
    >>> xyz = [[0.1 * i, 0, 0] for i in range(5)]
    >>> votes = [[0.9, 0.1], [0.9, 0.1], [0.4, 0.6], [0.9, 0.1], [0.9, 0.1]]
    >>> regularisation.regularize(xyz, votes, method="point-crf", settings={"neighbours": 2}).labels.tolist()
    [0, 0, 0, 0, 0]
    """
    choice(method, "method", METHODS)
    given = together(settings, method=method, strength=strength)
    if "strength" in given and not _core.has_strength(method):
        raise ValueError(f"strength: found {given['strength']!r}, expected none: the method {method!r} does not use it")
    rows = finite(as_rows(probabilities, "probabilities"), "probabilities")
    cloud = as_cloud(xyz, columns=[])._core
    return Regularized(*_core.regularize(cloud, rows, dotted_settings(given, "regularise."), metres_per_unit, n_jobs))


def alpha_expansion(
    unary: Any,
    edges: Any,
    weights: Any = None,
    *,
    strength: float = 1.0,
    distances: Any = None,
    label_costs: Any = None,
    max_rounds: int = 100,
    starts: int = 2,
    n_jobs: int | None = None,
) -> Labelling:
    """alpha-expansion: the labelling that no expansion move improves.

    Y. Boykov, O. Veksler, R. Zabih, *Fast approximate energy minimization via graph cuts*, IEEE PAMI 23(11), 2001. With two
    labels and no label costs the energy is the minimum.

    Parameters
    ----------
    unary : array_like of shape (n, labels)
        Cost of each label at each node, e.g. ``-np.log(probabilities)``; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes, e.g. of `scansion.graph.knn_graph`.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.
    strength : float
        Factor of the weights; larger values give fewer changes of label between neighbours.
    distances : array_like of shape (labels, labels), optional
        A metric on the labels; by default 1 for any two different ones (Potts).
    label_costs : array_like of shape (labels,), optional
        Cost of each label, paid once if any node has it; 0 or more (Delong et al. 2012).
    max_rounds : int
        Largest number of rounds over all labels from each start.
    starts : {1, 2}
        Number of initial labellings. 1: the cheapest labels. 2: also label 0 everywhere, as in gco; the two results are fused
        region by region. Takes up to twice as long.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    Labelling
        ``labels`` of the nodes, their ``energy``, and whether the search ``converged``.

    Examples
    --------
    >>> from scansion import regularisation
    >>> found = regularisation.alpha_expansion([[0, 1], [0.3, 0], [0, 1]], [[0, 1], [1, 2]])
    >>> found.labels.tolist(), round(found.energy, 6), found.converged
    ([0, 0, 0], 0.3, True)
    """
    problem, offset = _problem(unary, edges, weights)
    costs = {"label_costs": _label_costs(label_costs)}
    text = to_json({**_settings(problem, strength, distances), **costs, "max_rounds": max_rounds, "starts": starts})
    return _labelling(_core.alpha_expansion(problem, text, n_jobs), offset)


def alpha_beta_swap(
    unary: Any,
    edges: Any,
    weights: Any = None,
    *,
    strength: float = 1.0,
    distances: Any = None,
    max_rounds: int = 100,
    n_jobs: int | None = None,
) -> Labelling:
    """alpha-beta swap: the labelling that no swap move improves, for distances that need not be a metric.

    Y. Boykov, O. Veksler, R. Zabih, *Fast approximate energy minimization via graph cuts*, IEEE PAMI 23(11), 2001.

    Parameters
    ----------
    unary : array_like of shape (n, labels)
        Cost of each label at each node; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.
    strength : float
        Factor of the weights.
    distances : array_like of shape (labels, labels), optional
        Symmetric, 0 from a label to itself; by default 1 for any two different ones (Potts).
    max_rounds : int
        Largest number of rounds over all pairs of labels.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    Labelling
        ``labels`` of the nodes, their ``energy``, and whether the search ``converged``.

    Examples
    --------
    >>> from scansion import regularisation
    >>> regularisation.alpha_beta_swap([[0, 1], [0.3, 0], [0, 1]], [[0, 1], [1, 2]]).labels.tolist()
    [0, 0, 0]
    """
    problem, offset = _problem(unary, edges, weights)
    text = to_json({**_settings(problem, strength, distances), "max_rounds": max_rounds})
    return _labelling(_core.alpha_beta_swap(problem, text, n_jobs), offset)


def icm(
    unary: Any,
    edges: Any,
    weights: Any = None,
    *,
    strength: float = 1.0,
    distances: Any = None,
    max_rounds: int = 100,
) -> Labelling:
    """Iterated conditional modes: the labelling that no change of a single node improves.

    Besag 1986. Faster than `alpha_expansion`, but with a higher energy.

    Parameters
    ----------
    unary : array_like of shape (n, labels)
        Cost of each label at each node; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.
    strength : float
        Factor of the weights.
    distances : array_like of shape (labels, labels), optional
        Symmetric, 0 from a label to itself; by default 1 for any two different ones (Potts).
    max_rounds : int
        Largest number of rounds over all nodes.

    Returns
    -------
    Labelling
        ``labels`` of the nodes, their ``energy``, and whether the search ``converged``.

    Examples
    --------
    >>> from scansion import regularisation
    >>> regularisation.icm([[0, 1], [0.3, 0], [0, 1]], [[0, 1], [1, 2]]).labels.tolist()
    [0, 0, 0]
    """
    problem, offset = _problem(unary, edges, weights)
    text = to_json({**_settings(problem, strength, distances), "max_rounds": max_rounds})
    return _labelling(_core.icm(problem, text), offset)


def energy(
    labels: Any,
    unary: Any,
    edges: Any,
    weights: Any = None,
    *,
    strength: float = 1.0,
    distances: Any = None,
    label_costs: Any = None,
) -> float:
    """Energy of given labels.

    Parameters
    ----------
    labels : array_like of shape (n,)
        Label of each node.
    unary : array_like of shape (n, labels)
        Cost of each label at each node; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.
    strength : float
        Factor of the weights.
    distances : array_like of shape (labels, labels), optional
        Symmetric, 0 from a label to itself; by default 1 for any two different ones (Potts).
    label_costs : array_like of shape (labels,), optional
        Cost of each label, paid once if any node has it.

    Returns
    -------
    float
        Unary costs, boundaries and label costs together.

    Examples
    --------
    >>> from scansion import regularisation
    >>> regularisation.energy([0, 1, 0], [[0, 1], [0.3, 0], [0, 1]], [[0, 1], [1, 2]], strength=0.5)
    1.0
    """
    array = unmasked(labels, "labels")
    if array.ndim != 1 or array.dtype.kind not in "iub":
        raise ValueError(f"labels: expected whole numbers of shape (n,), found {array.dtype} {array.shape}")
    if array.size and not (array.min() >= 0 and array.max() <= 0xFFFF):
        raise ValueError(f"labels: expected 0..65535, found {array.min()} and {array.max()}")
    problem, offset = _problem(unary, edges, weights)
    costs = {"label_costs": _label_costs(label_costs)}
    text = to_json({**_settings(problem, strength, distances), **costs})
    return _core.energy(problem, np.ascontiguousarray(array, np.uint16), text) + offset


def local_smoothing(
    probabilities: Any,
    edges: Any,
    weights: Any = None,
    *,
    n_jobs: int | None = None,
) -> NDArray[np.float32]:
    """Weighted mean of each node's probabilities (of weight 1) and those of its neighbours.

    Schindler 2012; ``argmax(axis=1)`` gives labels.

    Parameters
    ----------
    probabilities : array_like of shape (n, classes)
        Probability of each class at each node; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,), optional
        Weights of the edges; finite, 0 or more; 1 by default.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    array of shape (n, classes), float32

    Examples
    --------
    >>> from scansion import regularisation
    >>> smooth = regularisation.local_smoothing([[0.75, 0.25], [0.25, 0.75], [1, 0]], [[0, 1], [1, 2]])
    >>> smooth.argmax(axis=1).tolist()
    [0, 0, 0]
    """
    pairs = as_edges(edges)
    problem = (finite(as_rows(probabilities, "probabilities"), "probabilities"), pairs, as_weights(weights, len(pairs)))
    return _core.local_smoothing(problem, n_jobs)


_Problem = tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32] | None]


def _problem(unary: Any, edges: Any, weights: Any) -> tuple[_Problem, float]:
    """The arrays of a problem, and the energy that was subtracted from all labellings of it."""
    pairs = as_edges(edges)
    costs, offsets = relative_to_rows(unary, "unary")
    return (costs, pairs, as_weights(weights, len(pairs))), float(offsets.sum())


def _labelling(found: tuple[NDArray[np.uint16], float, bool], offset: float) -> Labelling:
    labels, least, converged = found
    return Labelling(labels, least + offset, converged)


def _settings(problem: _Problem, strength: float, distances: Any) -> dict[str, Any]:
    labels = problem[0].shape[1]
    if distances is None:
        return {"strength": strength, "pairwise": "potts"}
    table = as_rows(distances, "distances")
    if table.shape != (labels, labels):
        raise ValueError(f"distances: expected shape ({labels}, {labels}), found {table.shape}")
    return {"strength": strength, "pairwise": {"metric": _finite(table.ravel(), "distances")}}


def _label_costs(costs: Any) -> list[float]:
    if costs is None:
        return []
    array = unmasked(costs, "label_costs")
    return _finite(as_weights(array, array.size, "label_costs"), "label_costs")


def _finite(values: Any, name: str) -> list[float]:
    return [float(value) for value in finite(values, name)]
