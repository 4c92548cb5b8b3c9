"""Segments of a cloud, and which of them to label next."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import column, finite, native, refuse, to_json
from scansion._classifier import PointClassifier
from scansion._cloud import measured
from scansion._labels import signed
from scansion._progress import Progress, following
from scansion._settings import recipe as read_recipe
from scansion._settings import seed, whole

_LABELS = "Classification"


class Segments(NamedTuple):
    """A segmented cloud."""

    cluster_id: NDArray[np.uint32]
    """Segment of each point, from 1; 0 where coordinates are not finite."""
    levels: list[NDArray[np.uint32]]
    """The same at each requested level."""
    report: dict[str, Any]
    """``method``, ``segments``, ``supervoxels``, ``strength``, ``trials``, ``sizes``, ``levels``; with labels
    ``oracle_accuracy`` and ``boundaries``."""


class Suggestions(NamedTuple):
    """Segments whose labels would help most."""

    cluster_id: NDArray[np.uint32]
    """Segment of each point, from 1; 0 where coordinates are not finite."""
    segments: list[dict[str, Any]]
    """``cluster_id``, ``point``, ``points``, ``uncertainty``, ``diversity``, ``score`` of each, best first."""


def segment(
    cloud: Any,
    *,
    method: str | None = None,
    strength: float | None = None,
    segments_per_hectare: float | None = None,
    smallest_object: float | None = None,
    oracle_loss: float | None = None,
    size: float | None = None,
    levels: Sequence[int] = (),
    recipe: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    cutoff: float | None = None,
    k_min: int | None = None,
    random_state: int | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
    progress: Progress = None,
) -> Segments:
    """Divides a cloud into segments.

    Give at most one of ``strength``, ``segments_per_hectare``, ``smallest_object`` and ``oracle_loss``. An option that the
    method does not use is an error.

    Parameters
    ----------
    cloud : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
    method : str, optional
        The recipe's by default, else ``"cut-pursuit"``: linearity, planarity, scattering and verticality nearly constant
        on each segment; ``"merge"``: the same, faster; ``"felzenszwalb"``: differences of these between segments larger than within; ``"riemannian"``: l0 cut pursuit on the graph of an octree's supervoxels; ``"local-graph"``:
        supervoxels grouped by their local graphs; ``"slic"``, ``"vccs"``: supervoxels; ``"region-growing"``,
        ``"octree-region-growing"``: smooth and flat regions.
    strength : float, optional
        Cost of a boundary edge; larger values give fewer, larger segments. 0.03 by default; "riemannian": 0.1.
    segments_per_hectare : float, optional
        Aim at this many segments per hectare of covered ground ("cut-pursuit", "merge").
    smallest_object : float, optional
        Aim at the smallest object that should be a segment of its own, metres ("cut-pursuit", "merge").
    oracle_loss : float, optional
        Aim at the fewest segments whose oracle accuracy on the cloud's labels is at most this much below that of a very fine
        partition, 0..1 ("cut-pursuit", "merge").
    size : float, optional
        Size of the supervoxels, metres ("local-graph", "slic", "vccs": 1.2 by default), or of the largest voxels
        ("octree-region-growing": 2).
    levels : sequence of int
        Also divide the cloud at each of these least depths of the octree ("riemannian").
    recipe : path, str or mapping, optional
        Settings of all methods: TOML as a path or text, the name of a method (``"riemannian-paper"``: as printed), or a
        mapping of keys, nested or dotted, to values, as in ``{"objects.vccs.voxel": 0.4}``. Other arguments take precedence.
    cutoff : float, optional
        Segments of fewer points are merged into their best neighbour ("cut-pursuit", "merge").
    k_min : int, optional
        Smallest neighbourhood of a point ("cut-pursuit", "merge", "felzenszwalb"); 20 or more on scans that consist of lines.
    random_state : int, optional
        Seed; methods without random draws take it too.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1. Degrees are an error.
    n_jobs : int, optional
        Number of threads; None and -1 use all. Results do not depend on it.
    progress : bool or callable, optional
        Show the progress, as `scansion.progress`.

    Returns
    -------
    Segments
        ``cluster_id`` of each point, the same for each of the ``levels``, and a ``report`` of sizes and strength.

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
    text, settings = _settings(recipe, method, cutoff, k_min, random_state)
    settings += [f"levels={[whole(level, 'levels', 0) for level in levels]}"] if len(levels) else []
    aim = _aim(strength, segments_per_hectare, smallest_object, oracle_loss)
    _core.check_segment_options(text, settings, cutoff is not None, k_min is not None)
    points = measured(cloud, [_LABELS, *_core.segment_columns(text, settings)], metres_per_unit)
    with following(progress):
        clusters, found, report = _core.segment(points._core, text, settings, aim, size, n_jobs)
    return Segments(clusters, found, json.loads(report))


def suggest(
    cloud: Any,
    count: int = 50,
    *,
    model: Any = None,
    uncertainty: ArrayLike | None = None,
    labels: ArrayLike | None = None,
    labelled: bool = False,
    page: str | os.PathLike[str] | None = None,
    offer: Mapping[int, str] | Sequence[int] | None = None,
    method: str | None = None,
    strength: float | None = None,
    segments_per_hectare: float | None = None,
    smallest_object: float | None = None,
    size: float | None = None,
    recipe: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    k_min: int | None = None,
    random_state: int | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Suggestions:
    """The segments whose labels would help most: different from those labelled or suggested before, and uncertain if there
    is a model.

    Parameters
    ----------
    cloud : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
    count : int
        Number of segments to suggest.
    model : PointClassifier, WeakClassifier or path, optional
        The model to improve: segments that it is unsure of come first.
    uncertainty : array_like of shape (n,), optional
        Uncertainty of each point, 0..1 (finite), in place of the model's; all are 1 without either.
    labels : array_like of shape (n,), optional
        Labels of earlier rounds, codes 0..255 (negative, and 0 and 1 of a cloud from LAS: unlabelled): segments that contain
        one are left out.
    labelled : bool
        The same for the labels in the column Classification (codes of 2 or more in LAS); those above 255 are an error.
    page : path, optional
        Write an HTML page for labelling the segments: pictures of each, keys for the classes, a button that saves the table.
    offer : mapping of int to str, or sequence of int, optional
        The classes that the page offers, codes with or without names; by default the model's, else well-known ones.
    method, strength, segments_per_hectare, smallest_object, size, recipe, k_min, random_state, metres_per_unit, n_jobs
        As in :func:`segment`. Neighbourhoods of ``k_min`` also describe the segments, whatever the method.

    Returns
    -------
    Suggestions
        ``cluster_id`` of each point, and the ``segments`` to label, best first.

    Examples
    --------
    >>> import numpy as np, scansion
    >>> grid = np.arange(0.0, 10.0, 0.25)
    >>> ground = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([30.0], grid, grid), -1).reshape(-1, 3)
    >>> found = scansion.suggest(np.concatenate([ground, wall]), 2)
    >>> sorted(s["points"] >= 10 for s in found.segments)
    [True, True]
    >>> labels = np.where(found.cluster_id == found.segments[0]["cluster_id"], 2, -1)
    >>> following = scansion.suggest(np.concatenate([ground, wall]), 1, labels=labels)
    >>> following.segments[0]["cluster_id"] == found.segments[0]["cluster_id"]
    False
    """
    if labels is not None and labelled:
        raise ValueError("found labels and labelled=True, expected one of them")
    if model is not None and uncertainty is not None:
        raise ValueError("found model and uncertainty, expected one of them")
    text, settings = _settings(recipe, method, None, k_min, random_state)
    aim = _aim(strength, segments_per_hectare, smallest_object, None)
    points = measured(cloud, [_LABELS, *_core.segment_columns(text, settings)], metres_per_unit)
    if labels is not None:
        points = points.copy()
        points._put(_LABELS, signed(labels, "labels", len(points)))
    elif labelled and _LABELS in points:
        _check_codes(points[_LABELS])
    wishes = to_json({"count": whole(count, "count")})
    doubt: Any = None
    if model is not None:
        model = PointClassifier.load(model) if isinstance(model, (str, os.PathLike)) else model
        said = model.classify(cloud, probabilities=True, regularize="none", metres_per_unit=metres_per_unit)
        doubt = said.probabilities
        offer = dict(zip(model.codes_.tolist(), model.class_names_, strict=True)) if offer is None else offer
    elif uncertainty is not None:
        given = finite(column(uncertainty, "uncertainty", len(points)), "uncertainty")
        doubt = native(given, np.float32).reshape(-1, 1)
    html = None if page is None else (os.fspath(page), _offered(offer))
    known = labelled or labels is not None
    clusters, found = _core.suggest(points._core, text, settings, aim, wishes, size, doubt, known, html, n_jobs)
    return Suggestions(clusters, json.loads(found))


def _offered(offer: Mapping[int, str] | Sequence[int] | None) -> str:
    """Codes and names in the form that the core reads."""
    if isinstance(offer, Mapping):
        return ",".join(f"{whole(code, 'offer', 0, 255)}={name.replace(',', ' ')}" for code, name in offer.items())
    return ",".join(str(whole(code, "offer", 0, 255)) for code in (() if offer is None else offer))


def _check_codes(values: NDArray[Any]) -> None:
    """Refuses a column of labels with other numbers than codes; negative ones and NaN are unlabelled."""
    with np.errstate(invalid="ignore"):
        wrong = (values >= 0) & ((values > 255) | (values != np.floor(values)))
    refuse(wrong, values, f"{_LABELS}: expected codes 0..255 (others can be changed to such and be given as labels)")


def _settings(
    given: Any, method: str | None, cutoff: float | None, k_min: int | None, random_state: int | None
) -> tuple[str, list[str]]:
    """The core's settings as TOML and single settings."""
    text, settings = read_recipe(given)
    settings += [] if method is None else [f"method={json.dumps(method)}"]
    if cutoff is not None:
        settings.append(f"partition.cutoff={float(cutoff)}")
    if k_min is not None:
        least = whole(k_min, "k_min", 2)
        settings.append(f"neighbourhood.k_min={least}")
        settings += [f"neighbourhood.k_max={least}"] if least > 100 else []
    if random_state is not None:
        number = seed(random_state)
        settings += [f"{part}.seed={number}" for part in ("partition", "riemannian", "clusters")]
    return text, settings


def _aim(*aims: float | None) -> str:
    """The aim of the search for the strength, as JSON."""
    names = ("strength", "segments-per-hectare", "smallest-object", "oracle-accuracy")
    given = {name: float(value) for name, value in zip(names, aims, strict=True) if value is not None}
    if len(given) > 1:
        raise ValueError(f"found {', '.join(given)}, expected at most one of them")
    return to_json(given, ("strength",)) if given else "null"
