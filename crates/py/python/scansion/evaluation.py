"""How good labels are: confusion matrix, scores, report.

Axes are named everywhere: rows are the truth, columns the prediction.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import choice, codes, column, native, to_json
from scansion._cloud import as_cloud

__all__ = ["confusion_matrix", "report", "scores", "segmentation_error"]


def _pair(truth: ArrayLike, predicted: ArrayLike) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    first = codes(truth, "truth")
    return first, codes(predicted, "predicted", len(first))


def confusion_matrix(
    truth: ArrayLike, predicted: ArrayLike, unlabelled: Iterable[int] = ()
) -> tuple[NDArray[np.uint64], NDArray[np.uint8]]:
    """Counts of points by true and predicted class.

    Parameters
    ----------
    truth, predicted : array_like of shape (n,)
        Class codes 0..255.
    unlabelled : iterable of int
        Codes in ``truth`` whose points are skipped.

    Returns
    -------
    counts : array of shape (classes, classes)
        ``counts[i, j]`` points of true class i were named j.
    codes : array of shape (classes,)
        The code of each row and column, ascending.

    Examples
    --------
    >>> from scansion.evaluation import confusion_matrix
    >>> counts, codes = confusion_matrix([2, 2, 6, 6], [2, 6, 6, 6])
    >>> counts.tolist(), codes.tolist()
    ([[1, 1], [0, 2]], [2, 6])
    """
    return _core.confusion_matrix(*_pair(truth, predicted), _codes(unlabelled))


def scores(truth: ArrayLike, predicted: ArrayLike, unlabelled: Iterable[int] = ()) -> dict[str, Any]:
    """Precision, recall, F1 and intersection over union of each class, and their summaries.

    Parameters
    ----------
    truth, predicted : array_like of shape (n,)
        Class codes 0..255.
    unlabelled : iterable of int
        Codes in ``truth`` whose points are skipped.

    Returns
    -------
    dict
        ``confusion_matrix``, ``labels`` (one dict a class: ``code``, ``name``, ``precision``, ``recall``,
        ``f1_score``, ``intersection_over_union``, ``support``), ``overall_accuracy``,
        ``mean_intersection_over_union``, ``mean_f1_score``, ``kappa`` and more. All scores are in 0..1 (kappa in
        -1..1); a score that is not defined is 0.

    Examples
    --------
    >>> from scansion.evaluation import scores
    >>> scores([2, 2, 6, 6], [2, 6, 6, 6])["overall_accuracy"]
    0.75
    """
    found: dict[str, Any] = json.loads(_core.scores(*_pair(truth, predicted), _codes(unlabelled)))
    return found


def report(truth: ArrayLike, predicted: ArrayLike, unlabelled: Iterable[int] = ()) -> str:
    """The scores as a table for people.

    Parameters
    ----------
    truth, predicted : array_like of shape (n,)
        Class codes 0..255.
    unlabelled : iterable of int
        Codes in ``truth`` whose points are skipped.

    Returns
    -------
    str
        Aligned text with the confusion matrix and one line a class.
    """
    return _core.report(*_pair(truth, predicted), _codes(unlabelled))


def _codes(values: Iterable[int]) -> bytes:
    """Codes as bytes, which is how the core takes a short list of them."""
    return codes(np.asarray(list(values), dtype=np.int64), "unlabelled").tobytes()


def segmentation_error(
    xyz: Any, labels: ArrayLike, truth: ArrayLike, *, cell: float = 0.3, empty: str = "ignored"
) -> dict[str, Any]:
    """How well segments keep the edges of the classes, seen from above (Hasanpour Zaryabi et al. 2022).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    labels : array_like of shape (n,)
        Segment of each point.
    truth : array_like of shape (n,)
        Class codes 0..255; 0 is unlabelled.
    cell : float
        Edge of a cell of the raster, metres: the spacing of the points.
    empty : {"ignored", "background"}
        Whether cells without a labelled point have edges.

    Returns
    -------
    error : dict
        ``error`` (1 - edge recall, mean of the classes), ``precision``, and ``classes`` one by one.

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
    segments = native(column(labels, "labels", len(cloud)), np.uint32)
    settings = to_json({"cell": cell, "empty": empty})
    codes_of = codes(truth, "truth", len(cloud))
    found: dict[str, Any] = json.loads(_core.segmentation_error(cloud._core, segments, codes_of, settings))
    return found
