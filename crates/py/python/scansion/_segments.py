"""Segments of a cloud, and which of them to label next."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._cloud import as_cloud

_LABELS = "Classification"


class Segments(NamedTuple):
    """A parted cloud."""

    cluster_id: NDArray[np.uint32]
    """Segment of each point, from 1; 0 where coordinates are not finite."""
    report: dict[str, Any]
    """``segments``, ``strength``, ``trials``, ``sizes``; with labels ``oracle_accuracy`` and ``boundaries``."""


class Suggestions(NamedTuple):
    """Segments whose labels would help most."""

    cluster_id: NDArray[np.uint32]
    """Segment of each point, from 1; 0 where coordinates are not finite."""
    segments: list[dict[str, Any]]
    """``cluster_id``, ``point``, ``points``, ``uncertainty``, ``diversity``, ``score`` of each, best first."""


def segment(
    cloud: Any,
    *,
    strength: float | None = None,
    segments_per_hectare: float | None = None,
    smallest_object: float | None = None,
    oracle_loss: float | None = None,
    method: str = "cut-pursuit",
    cutoff: float = 0.0,
    k_min: int = 10,
    random_state: int = 0,
    n_jobs: int | None = None,
) -> Segments:
    """Parts a cloud into segments on which linearity, planarity, scattering and verticality are nearly constant.

    Say at most one of the first four options.

    Parameters
    ----------
    cloud : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
    strength : float, optional
        Cost of a boundary edge; larger gives fewer, larger segments. 0.03 if nothing is said.
    segments_per_hectare : float, optional
        Aim at so many segments on a hectare of covered ground.
    smallest_object : float, optional
        Aim at the smallest object that is to be a segment of its own, metres.
    oracle_loss : float, optional
        Aim at the fewest segments that could be named with at most so much loss of accuracy on the cloud's labels, 0..1.
    method : {"cut-pursuit", "merge"}
        Lower energy, or faster.
    cutoff : float
        Segments of fewer points join their best neighbour.
    k_min : int
        Smallest neighbourhood that describes a point; 20 or more on scans that consist of lines.
    random_state : int
        Seed.
    n_jobs : int, optional
        Threads; None and -1 take all. Results do not depend on it.

    Examples
    --------
    >>> import numpy as np, scansion
    >>> grid = np.arange(0.0, 10.0, 0.25)
    >>> ground = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([30.0], grid, grid), -1).reshape(-1, 3)
    >>> found = scansion.segment(np.concatenate([ground, wall]))
    >>> bool(found.cluster_id[0] != found.cluster_id[-1])
    True
    """
    points = as_cloud(cloud, columns=[_LABELS])
    settings = _settings(
        (strength, segments_per_hectare, smallest_object, oracle_loss), method, cutoff, k_min, random_state
    )
    clusters, report = _core.segment(points._core, settings, n_jobs)
    return Segments(clusters, json.loads(report))


def suggest(
    cloud: Any,
    count: int = 50,
    *,
    uncertainty: ArrayLike | None = None,
    labelled: bool = False,
    strength: float | None = None,
    segments_per_hectare: float | None = None,
    smallest_object: float | None = None,
    method: str = "cut-pursuit",
    k_min: int = 10,
    random_state: int = 0,
    n_jobs: int | None = None,
) -> Suggestions:
    """The segments whose labels would help most: uncertain, large, and unlike those that are labelled or named before.

    Parameters
    ----------
    cloud : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
    count : int
        Segments to name.
    uncertainty : array_like of shape (n,), optional
        Uncertainty of each point, 0..1: its entropy over ln(classes); all are 1 without it.
    labelled : bool
        Leave out segments that hold a label (a code of 2 or more in the column Classification).
    strength, segments_per_hectare, smallest_object, method, k_min, random_state, n_jobs
        As in :func:`segment`.

    Examples
    --------
    >>> import numpy as np, scansion
    >>> grid = np.arange(0.0, 10.0, 0.25)
    >>> ground = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([30.0], grid, grid), -1).reshape(-1, 3)
    >>> found = scansion.suggest(np.concatenate([ground, wall]), 2)
    >>> sorted(s["points"] >= 10 for s in found.segments)
    [True, True]
    """
    points = as_cloud(cloud, columns=[_LABELS])
    settings = _settings((strength, segments_per_hectare, smallest_object, None), method, 0.0, k_min, random_state)
    wishes = json.dumps({"count": count})
    unsure = None if uncertainty is None else np.ascontiguousarray(uncertainty, dtype=np.float32)
    clusters, found = _core.suggest(points._core, settings, wishes, unsure, labelled, n_jobs)
    return Suggestions(clusters, json.loads(found))


def _settings(
    intents: tuple[float | None, ...], method: str, cutoff: float, k_min: int, random_state: int
) -> str:
    """The core's parameters as JSON."""
    names = ("strength", "segments-per-hectare", "smallest-object", "oracle-accuracy")
    given = {name: value for name, value in zip(names, intents, strict=True) if value is not None}
    if len(given) > 1:
        raise ValueError(f"found {', '.join(given)}, expected at most one of them")
    partition: dict[str, Any] = {"method": method, "cutoff": cutoff, "seed": random_state}
    partition["intent"] = given or {"strength": 0.03}
    neighbourhood = {"k_min": k_min, "k_max": max(100, k_min)}
    return json.dumps({"neighbourhood": neighbourhood, "partition": partition})
