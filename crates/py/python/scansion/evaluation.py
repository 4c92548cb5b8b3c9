"""Evaluation of labels: confusion matrix, scores, report.

Rows are true classes, columns predicted ones. Labels are arrays, which have no class list: of LAS files pass
``unlabelled=[0, 1]``, so that unclassified points are skipped.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import choice, in_segments, to_json
from scansion._cloud import as_cloud
from scansion._graph import as_edges, edges_between
from scansion._labels import classes_of, encoded, is_text, no_classes, signed, texts

__all__ = [
    "boundary_scores",
    "confusion_matrix",
    "one_vs_rest",
    "purities",
    "report",
    "scores",
    "segmentation_error",
]


def __dir__() -> list[str]:
    return __all__


class _Pair(NamedTuple):
    """The codes to compare; -1 for points without a true label or without a prediction."""

    truth: NDArray[np.int16]
    predicted: NDArray[np.int16]
    names: list[str]
    """Names of the codes, if the labels are text."""


def _pair(
    truth: ArrayLike, predicted: ArrayLike, unlabelled: Iterable[Any], maps: tuple[str | None, str | None] = (None, None)
) -> _Pair:
    if is_text(truth) or is_text(predicted):
        if any(maps):
            raise ValueError(f"map_truth, map_predicted: found {maps!r}, expected none: the labels are text")
        true = texts(truth, "truth")
        given = texts(predicted, "predicted", len(true))
        names = classes_of([true, given], ())
        missing = no_classes(unlabelled)
        kept = encoded(true, names)
        kept[[text in missing for text in true.tolist()]] = -1
        return _Pair(kept, encoded(given, names), names)
    first = signed(truth, "truth", None, unlabelled, maps[0])
    return _Pair(first, signed(predicted, "predicted", len(first), (), maps[1]), [])


def confusion_matrix(
    truth: ArrayLike,
    predicted: ArrayLike,
    unlabelled: Iterable[Any] = (),
    *,
    map_truth: str = "",
    map_predicted: str = "",
) -> tuple[NDArray[np.uint64], NDArray[Any]]:
    """Counts of points by true and predicted class.

    Parameters
    ----------
    truth, predicted : array_like of shape (n,)
        Class codes 0..255, or text. Points whose true label is negative, NaN or None are skipped; a prediction that is
        negative, NaN or None counts as wrong, under a code that occurs on neither side.
    unlabelled : iterable of int or str
        Labels in ``truth`` whose points are skipped too (codes: after ``map_truth``); ``[0, 1]`` for the codes of LAS.
    map_truth, map_predicted : str
        Mapping of the codes of each side before the comparison, as in ``"3-4=5"``.

    Returns
    -------
    counts : array of shape (classes, classes)
        ``counts[i, j]`` is the number of points of true class i predicted as j.
    codes : array of shape (classes,)
        The code (or text) of each row and column, ascending.

    Examples
    --------
    >>> from scansion.evaluation import confusion_matrix
    >>> counts, codes = confusion_matrix([2, 2, 6, 6], [2, 6, 6, 6])
    >>> counts.tolist(), codes.tolist()
    ([[1, 1], [0, 2]], [2, 6])
    """
    pair = _pair(truth, predicted, unlabelled, (map_truth, map_predicted))
    counts, found = _core.confusion_matrix(*pair)
    if not pair.names:
        return counts, found
    called = [pair.names[code] if code < len(pair.names) else "no prediction" for code in found]
    return counts, np.array(called)


def scores(
    truth: ArrayLike,
    predicted: ArrayLike,
    unlabelled: Iterable[Any] = (),
    *,
    map_truth: str = "",
    map_predicted: str = "",
) -> dict[str, Any]:
    """Precision, recall, F1 and intersection over union of each class, and their summaries.

    Parameters
    ----------
    truth, predicted : array_like of shape (n,)
        Class codes 0..255, or text. Points whose true label is negative, NaN or None are skipped; a prediction that is
        negative, NaN or None counts as wrong, under a code that occurs on neither side.
    unlabelled : iterable of int or str
        Labels in ``truth`` whose points are skipped too (codes: after ``map_truth``); ``[0, 1]`` for the codes of LAS.
    map_truth, map_predicted : str
        Mapping of the codes of each side before the comparison, as in ``"3-4=5"``.

    Returns
    -------
    dict
        ``confusion_matrix``, ``labels`` (one dict a class: ``code``, ``name``, ``precision``, ``recall``,
        ``f1_score``, ``intersection_over_union``, ``support``), ``overall_accuracy``,
        ``mean_intersection_over_union``, ``mean_f1_score`` (over the classes in the truth, ``mean_over``), ``kappa`` and
        more. All scores are in 0..1 (kappa in -1..1). An undefined score of a class is 0; kappa is NaN if all points have and
        get one class.

    Raises
    ------
    ValueError
        If no point has a true label.

    Examples
    --------
    >>> from scansion.evaluation import scores
    >>> scores([2, 2, 6, 6], [2, 6, 6, 6])["overall_accuracy"]
    0.75
    >>> scores([2, 2, 6, 1], [2, 6, 6, 6], unlabelled=[0, 1])["confusion_matrix"]
    [[1, 1], [0, 1]]
    """
    return _with_nan(json.loads(_core.scores(*_pair(truth, predicted, unlabelled, (map_truth, map_predicted)))))


def report(
    truth: ArrayLike,
    predicted: ArrayLike,
    unlabelled: Iterable[Any] = (),
    *,
    map_truth: str = "",
    map_predicted: str = "",
) -> str:
    """The scores as a text table.

    Parameters
    ----------
    truth, predicted : array_like of shape (n,)
        Class codes 0..255, or text. Points whose true label is negative, NaN or None are skipped; a prediction that is
        negative, NaN or None counts as wrong, under a code that occurs on neither side.
    unlabelled : iterable of int or str
        Labels in ``truth`` whose points are skipped too (codes: after ``map_truth``); ``[0, 1]`` for the codes of LAS.
    map_truth, map_predicted : str
        Mapping of the codes of each side before the comparison, as in ``"3-4=5"``.

    Returns
    -------
    str
        Aligned text with the confusion matrix and one line a class; ``-`` stands for what is not defined.

    Raises
    ------
    ValueError
        If no point has a true label.

    Notes
    -----
    A class that only one side divides counts as wrong there: ``PointClassifier.default().predict`` calls all vegetation 5, and a
    truth of 3, 4 and 5 needs ``map_truth="3-4=5"``.

    Examples
    --------
    >>> from scansion.evaluation import report
    >>> truth, predicted = [2, 3, 4, 5, 6, 1], [2, 5, 5, 5, 6, 6]
    >>> "overall accuracy 100.00" in report(truth, predicted, unlabelled=[0, 1], map_truth="3-4=5")
    True
    """
    return _core.report(*_pair(truth, predicted, unlabelled, (map_truth, map_predicted)))


def segmentation_error(
    xyz: Any,
    labels: ArrayLike,
    truth: ArrayLike,
    *,
    cell: float = 0.3,
    empty: str = "ignored",
    unlabelled: Iterable[Any] = (),
) -> dict[str, Any]:
    """Segmentation error: share of the class boundaries, in plan, that segments miss (Hasanpour Zaryabi et al. 2022).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite. Stray points are left out.
    labels : array_like of shape (n,)
        Segment of each point, 0..4294967295; points of -1 are in none and left out.
    truth : array_like of shape (n,)
        Class codes 0..255 (negative: unlabelled), or text (None: unlabelled).
    cell : float
        Edge of a raster cell, metres: about the point spacing.
    empty : {"ignored", "background"}
        Whether cells without a labelled point are ignored or count as background, with boundaries.
    unlabelled : iterable of int or str
        Further labels in ``truth`` that mean "unlabelled".

    Returns
    -------
    error : dict
        ``error`` (1 - boundary recall, mean over the classes), ``precision``, and the same for each of the ``classes`` with
        its ``code`` and ``name``. NaN where there is nothing to compare, as without a boundary in ``truth``.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion.evaluation import segmentation_error
    >>> xyz = np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0), [0.0]), -1).reshape(-1, 3)
    >>> truth = np.where(xyz[:, 0] < 5, 2, 6)
    >>> segmentation_error(xyz, truth, truth, cell=1.0)["error"]
    0.0
    """
    choice(empty, "empty", ("ignored", "background"))
    cloud = as_cloud(xyz, columns=[])
    of, kept = in_segments(labels, "labels", len(cloud))
    settings = to_json({"cell": cell, "empty": empty})
    pair = _pair(truth, truth, unlabelled)
    codes_of = pair.truth
    if len(codes_of) != len(cloud):
        raise ValueError(f"truth: expected shape ({len(cloud)},), found ({len(codes_of)},)")
    if kept is not None:
        cloud, codes_of = cloud[kept], codes_of[kept]
    found: dict[str, Any] = json.loads(_core.segmentation_error(cloud._core, of, codes_of, settings))
    classes = [_with_nan(row) for row in _named(found["classes"], pair)]
    return {**_with_nan(found), "classes": classes}


def _named(rows: list[dict[str, Any]], pair: _Pair) -> list[dict[str, Any]]:
    """Rows of classes with the names that `scores` gives to their codes."""
    if not rows:
        return []
    names = {label["code"]: label["name"] for label in json.loads(_core.scores(*pair))["labels"]}
    return [{"code": row["code"], "name": names[row["code"]], **row} for row in rows]


def _with_nan(found: dict[str, Any]) -> dict[str, Any]:
    """The same with NaN for what JSON calls null."""
    return {key: np.nan if value is None else value for key, value in found.items()}


def one_vs_rest(
    truth: ArrayLike,
    predicted: ArrayLike,
    unlabelled: Iterable[Any] = (),
    *,
    map_truth: str = "",
    map_predicted: str = "",
) -> list[dict[str, Any]]:
    """Precision, sensitivity, specificity and accuracy of each class against all others (Hasanpour Zaryabi et al. 2022).

    Parameters
    ----------
    truth, predicted : array_like of shape (n,)
        Class codes 0..255, or text, as for `scores`.
    unlabelled : iterable of int or str
        Labels in ``truth`` whose points are skipped too (codes: after ``map_truth``); ``[0, 1]`` for the codes of LAS.
    map_truth, map_predicted : str
        Mapping of the codes of each side before the comparison, as in ``"3-4=5"``.

    Returns
    -------
    rows : list of dict
        ``code``, ``name``, ``precision``, ``sensitivity``, ``specificity`` and ``accuracy`` of each class.

    Examples
    --------
    >>> from scansion.evaluation import one_vs_rest
    >>> [row["specificity"] for row in one_vs_rest([2, 2, 6, 6], [2, 6, 6, 6])]
    [1.0, 0.5]
    """
    pair = _pair(truth, predicted, unlabelled, (map_truth, map_predicted))
    return _named(json.loads(_core.one_vs_rest(*pair)), pair)


def purities(labels: ArrayLike, truth: ArrayLike, unlabelled: Iterable[Any] = ()) -> NDArray[np.float64]:
    """Share of the most frequent class in each segment.

    Parameters
    ----------
    labels : array_like of shape (n,)
        Segment of each point, 0..4294967295; points of -1 are in none and left out.
    truth : array_like of shape (n,)
        Class codes 0..255 (negative: unlabelled), or text (None: unlabelled).
    unlabelled : iterable of int or str
        Further labels in ``truth`` that mean "unlabelled".

    Returns
    -------
    purities : array of shape (segments,)
        In the order of the first points of the segments; NaN for segments without a label.

    Examples
    --------
    >>> from scansion.evaluation import purities
    >>> purities([5, 5, 3, 3], [2, 2, 6, 2]).tolist()
    [1.0, 0.5]
    """
    of, codes_of, _ = _segments(labels, truth, unlabelled)
    return _core.purities(of, codes_of)


def boundary_scores(
    edges: Any, labels: ArrayLike, truth: ArrayLike, *, hops: int = 1, unlabelled: Iterable[Any] = ()
) -> dict[str, Any]:
    """Agreement of the boundaries of segments with those of the classes, on the edges of a graph.

    Parameters
    ----------
    edges : array_like of shape (m, 2)
        Pairs of points, e.g. of `scansion.graph.knn_graph`.
    labels : array_like of shape (n,)
        Segment of each point, 0..4294967295; points of -1 are in none and left out.
    truth : array_like of shape (n,)
        Class codes 0..255 (negative: unlabelled), or text (None: unlabelled).
    hops : int
        A boundary edge matches one of the other side that is at most this many edges away; 0: the same edge.
    unlabelled : iterable of int or str
        Further labels in ``truth`` that mean "unlabelled".

    Returns
    -------
    scores : dict
        ``recall`` and ``precision`` (NaN without a true or a found edge), and the numbers of boundary edges,
        ``true_edges`` and ``found_edges``.

    Examples
    --------
    >>> from scansion.evaluation import boundary_scores
    >>> found = boundary_scores([[0, 1], [1, 2], [2, 3]], [0, 0, 1, 1], [2, 2, 2, 6], hops=0)
    >>> found["recall"], found["true_edges"]
    (0.0, 1)
    """
    of, codes_of, kept = _segments(labels, truth, unlabelled)
    pairs = as_edges(edges)
    if kept is not None:
        pairs, _ = edges_between(pairs, None, kept)
    return _with_nan(json.loads(_core.boundary_scores(pairs, of, codes_of, hops)))


def _segments(
    labels: ArrayLike, truth: ArrayLike, unlabelled: Iterable[Any]
) -> tuple[NDArray[np.uint32], NDArray[np.int16], NDArray[np.bool_] | None]:
    """Segments and codes of the points that are in a segment, and whether each point is (None: all are)."""
    codes_of = _pair(truth, truth, unlabelled).truth
    of, kept = in_segments(labels, "labels", len(codes_of))
    return of, codes_of if kept is None else codes_of[kept], kept
