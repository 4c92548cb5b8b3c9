"""Lines along the edges of objects: roofs, walls, kerbs, furniture."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import choice, codes, mask, to_json, unmasked
from scansion._classifier import PointClassifier
from scansion._cloud import PointCloud, as_cloud
from scansion._settings import dotted_settings, seed, share, whole

__all__ = [
    "Contours",
    "Scene",
    "Stages",
    "baseline",
    "extract",
    "labels",
    "precision_recall",
    "score",
    "score_points",
    "stages",
    "synthetic_scene",
]


def __dir__() -> list[str]:
    return __all__


Lines = Iterable[Any]
"""Lines: an array of shape (m, 3) each."""


class Contours:
    """Lines along the edges of a cloud, as `extract` gives them.

    Attributes
    ----------
    lines : list of array of shape (m, 3)
        The vertices of each line in the coordinates of the cloud; the first is repeated at the end of a closed line.
    closed : array of bool
    length : array of float
        Metres.
    confidence : array of float
        Probability of the likeliest candidate along each piece of a line, mean by length, 0..1.
    classes : array of shape (n, 2), int; or None
        The most frequent classes beside each line, -1 where no point is beside it; None if the cloud has no classes.
    voxel : float
        Edge of a voxel, metres.
    n_seeds, n_candidates : int
    energies : array of float
        Energy of the random field before the first sweep and after each.
    """

    def __init__(self, core: _core.Contours) -> None:
        self._core = core
        report = json.loads(core.report())
        vertices, counts = core.vertices()
        rows = report["lines"]
        self.closed = np.array([row[0] for row in rows], bool)
        pieces = np.split(vertices, np.cumsum(counts)[:-1].astype(np.int64)) if rows else []
        pairs = zip(pieces, self.closed, strict=True)
        self.lines = [np.concatenate([line, line[:1]]) if closed else line for line, closed in pairs]
        self.length = np.array([row[1] for row in rows], float)
        self.confidence = np.array([row[2] for row in rows], float)
        known = [row[3] for row in rows]
        none = all(pair is None for pair in known)
        self.classes = None if none else np.array([pair or (-1, -1) for pair in known], np.int64)
        self.voxel: float = report["voxel"]
        self.n_seeds: int = report["seeds"]
        self.n_candidates: int = report["candidates"]
        self.energies = np.array(report["energies"], float)
        self.warnings: list[str] = report["warnings"]

    def __reduce__(self) -> tuple[Any, ...]:
        report = json.loads(self._core.report())
        return _restored, (self._core.vertices(), report, PointCloud._wrap(self._core.place()))

    def __len__(self) -> int:
        return len(self.lines)

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        return iter(self.lines)

    def __repr__(self) -> str:
        return f"Contours({len(self)} lines, {self.length.sum():.1f} m)"

    def write(self, path: str | os.PathLike[str], *, min_confidence: float = 0.0) -> None:
        """Writes the lines as a drawing with a layer for each pair of classes.

        Parameters
        ----------
        path : path
            ``.dxf``, ``.gpkg``, ``.geojson``, ``.obj`` or ``.ply``.
        min_confidence : float
            Lines of a lower confidence are left out, 0..1.
        """
        self._core.write(os.fspath(path), share(min_confidence, "min_confidence"))


def _restored(vertices: tuple[Any, Any], report: dict[str, Any], place: PointCloud) -> Contours:
    """The inverse of ``Contours.__reduce__``."""
    lines = [tuple(row) for row in report["lines"]]
    return Contours(_core.Contours.restored(*vertices, {**report, "lines": lines}, place._core))


def extract(
    cloud: Any,
    model: PointClassifier | str | os.PathLike[str] | None = None,
    *,
    voxel: float | None = None,
    classes: Any = None,
    without: Sequence[int] = (),
    min_confidence: float = 0.0,
    settings: Mapping[str, Any] | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Contours:
    """Lines along the edges of objects (T. Hackel 2018, doi:10.3929/ethz-b-000264691, section 4.5).

    Parameters
    ----------
    cloud : cloud
        A PointCloud, path, laspy.LasData, structured array or array of shape (n, 3).
    model : PointClassifier or path, optional
        A model of the recipe ``contours``; the built-in one by default.
    voxel : float, optional
        Edge of the voxels that hold one seed of a line each, metres; smaller: finer edges. By default from the spacing of the
        points.
    classes : array_like of shape (n,), optional
        Class code 0..255 of each point, for the classes beside the lines; by default those of the cloud, if it has any, among
        which negative codes and NaN are no class.
    without : sequence of int
        Points of these classes carry no line, for instance vegetation.
    min_confidence : float
        Lines of a lower confidence are left out, 0..1.
    settings : mapping, optional
        Settings of the model's recipe, as ``{"trace.tidy.least_length": 0.5}``. Lengths in settings are those for voxels of
        0.1 m and change with the voxel; only ``voxel`` itself is in metres.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    Contours

    Examples
    --------
    >>> import scansion
    >>> scene = scansion.contours.synthetic_scene("indoor", random_state=1, rays=100_000)
    >>> found = scansion.contours.extract(scene.cloud)
    >>> len(found) > 10
    True
    """
    points = as_cloud(cloud)
    own = {**(settings or {}), **({} if voxel is None else {"voxel": float(voxel)})}
    if model is not None and not isinstance(model, PointClassifier):
        model = PointClassifier.load(model)
    params = {
        "recipe": dotted_settings(own),
        "without": [whole(code, "without", 0, 255) for code in without],
        "min_confidence": float(min_confidence),
        "metres_per_unit": metres_per_unit,
    }
    given = None if classes is None else codes(classes, "classes")
    return Contours(
        _core.contours(points._core, None if model is None else model._model, to_json(params), given, n_jobs)
    )


class Stages:
    """Rated candidates of a cloud, as `stages` gives them: lines can be drawn from them with several settings.

    Attributes
    ----------
    voxel : float
        Edge of a voxel, metres.
    """

    def __init__(self, core: _core.ContourStages) -> None:
        self._core = core
        self.voxel = core.voxel

    def lines(self, settings: Mapping[str, Any] | None = None) -> Contours:
        """The lines that the random field chooses.

        Parameters
        ----------
        settings : mapping, optional
            Settings of the model's recipe below ``trace``, as ``{"trace.parts.least": 0.7}``: fewer lines, more of them right.
            Others are for `stages`.

        Returns
        -------
        Contours
        """
        own = dotted_settings(dict(settings or {}))
        for key in (setting.split("=")[0] for setting in own):
            if not key.startswith("trace."):
                raise ValueError(f"settings: found {key}, expected keys below trace; others need new stages")
        return Contours(self._core.lines(own))

    def candidates(self, reference: Lines, *, unsure: Lines = ()) -> NDArray[np.float32]:
        """The candidates beside lines of a reference.

        Parameters
        ----------
        reference, unsure : sequences of array of shape (m, 3)
            What is true, and what may be found or not.

        Returns
        -------
        array of shape (n, 3)
            Probability of each candidate to be a contour, and the shares of its length along the reference and along unsure
            lines.
        """
        return self._core.candidates(_lines(reference), _lines(unsure))


def stages(
    cloud: Any,
    model: PointClassifier | str | os.PathLike[str] | None = None,
    *,
    without: Sequence[int] = (),
    settings: Mapping[str, Any] | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Stages:
    """Rates points and candidates as `extract` does, to draw lines with several settings.

    Parameters
    ----------
    cloud, model, without, settings, metres_per_unit, n_jobs
        As for `extract`; a voxel is given as ``settings={"voxel": 0.05}``.

    Returns
    -------
    Stages

    Examples
    --------
    >>> import scansion
    >>> scene = scansion.contours.synthetic_scene("indoor", rays=50_000)
    >>> rated = scansion.contours.stages(scene.cloud)
    >>> len(rated.lines({"trace.field.bias": 1.0})) <= len(rated.lines({"trace.field.bias": -2.0}))
    True
    """
    if model is not None and not isinstance(model, PointClassifier):
        model = PointClassifier.load(model)
    params = {
        "recipe": dotted_settings(dict(settings or {})),
        "without": [whole(code, "without", 0, 255) for code in without],
        "min_confidence": 0.0,
        "metres_per_unit": metres_per_unit,
    }
    core = None if model is None else model._model
    return Stages(_core.contour_stages(as_cloud(cloud)._core, core, to_json(params), n_jobs))


def baseline(
    cloud: Any,
    strengths: ArrayLike,
    method: Literal["threshold", "canny"] = "canny",
    *,
    voxel: float | None = None,
    settings: Mapping[str, Any] | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Contours:
    """Lines by a simpler method, for comparison with `extract`.

    Parameters
    ----------
    cloud : cloud
        As for `extract`.
    strengths : array_like of shape (n,)
        How much each point looks like a contour, 0..1: a curvature divided by its largest value, or a probability.
    method : {"threshold", "canny"}
        All points of some strength; or those that are the strongest across the edge, with two thresholds (J. Canny 1986).
    voxel : float, optional
        Edge of a voxel, metres; by default from the spacing of the points.
    settings : mapping, optional
        ``least`` of the threshold; ``high``, ``low``, ``across`` and ``angle`` of Canny; ``linked`` of both. Lengths are those
        for voxels of 0.1 m.
    metres_per_unit : float, optional
        As for `extract`.
    n_jobs : int, optional
        Number of threads; None and -1 use all.

    Returns
    -------
    Contours
        Without classes.

    Examples
    --------
    >>> import numpy as np
    >>> import scansion
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(9.0))
    >>> cloud = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    >>> len(scansion.contours.baseline(cloud, y.ravel() == 4))
    1
    """
    choice(method, "method", ("threshold", "canny"))
    values = np.ascontiguousarray(unmasked(strengths, "strengths"), np.float32).reshape(-1)
    params = {"method": {method: dict(settings or {})}, "voxel": voxel, "metres_per_unit": metres_per_unit}
    return Contours(_core.baseline(as_cloud(cloud)._core, values, to_json(params), n_jobs))


class Scene(NamedTuple):
    """A synthetic scene with known edges."""

    cloud: PointCloud
    """The points with their class in the column Classification."""
    edges: NDArray[np.float32]
    """Both ends of each edge, shape (m, 2, 3), metres."""
    edge_spacing: NDArray[np.float32]
    """Metres between the points beside each edge, on the surface where they are farther apart, shape (m,); infinite where the
    scanner does not see the edge."""
    scan_positions: NDArray[np.float32]
    """Where the scanner stood, shape (k, 3)."""


def synthetic_scene(
    kind: str = "urban", *, random_state: Any = None, n_jobs: int | None = None, **settings: Any
) -> Scene:
    """A synthetic scan of a street or a room, with its true edges.

    Parameters
    ----------
    kind : {"urban", "mobile", "indoor", "airborne"}
        A street from tripods, from a car or from an aircraft; a room from tripods.
    random_state : int, numpy.random.RandomState or None
        Seed; None means 0.
    n_jobs : int, optional
        Number of threads; None and -1 use all.
    **settings
        ``rays``, ``positions``, ``extent`` (metres), ``density`` (pulses a square metre from an aircraft), ``noise`` and
        ``noise_per_metre`` (metres), ``mixed_pixels`` (share).

    Returns
    -------
    Scene

    Examples
    --------
    >>> import scansion
    >>> scene = scansion.contours.synthetic_scene("indoor", rays=20_000)
    >>> scene.edges.shape[1:]
    (2, 3)
    """
    choice(kind, "kind", ("urban", "mobile", "indoor", "airborne"))
    if "seed" in settings:
        raise TypeError("seed: give random_state instead")
    made = _core.synthetic_scene(kind, to_json({**settings, "seed": seed(random_state)}), n_jobs)
    cloud = PointCloud(made.points().astype(np.float64), Classification=made.codes())
    return Scene(cloud, made.edges().reshape(-1, 2, 3), made.edge_spacing(), made.scan_positions())


def _lines(lines: Lines) -> _core.Lines:
    arrays = [unmasked(line, f"line {number}", np.float64) for number, line in enumerate(lines)]
    for number, line in enumerate(arrays):
        if line.ndim != 2 or line.shape[1] != 3:
            raise ValueError(f"line {number}: found shape {line.shape}, expected (m, 3)")
    rows = np.concatenate([*arrays, np.zeros((0, 3))])
    return _core.Lines(np.ascontiguousarray(rows), np.array([len(line) for line in arrays], np.uint64))


def score(
    lines: Lines,
    reference: Lines,
    *,
    unsure: Lines = (),
    tolerance: float = 0.06,
    forgiven: float = 0.03,
    step: float = 0.02,
) -> dict[str, float | None]:
    """Precision and recall of lines by the rules of the thesis (section 4.6.2).

    A missing part of the reference counts once every ``forgiven`` metres or more, a found part at every sample. Recall therefore
    depends on ``step``, whose default is the thesis's distance of points along contours. ``recall_by_length`` weighs both
    alike.

    Parameters
    ----------
    lines, reference : sequences of array of shape (m, 3)
        What was found, and what is true, in metres.
    unsure : sequence of array of shape (m, 3)
        Lines that may be found or not: what was found along them does not count.
    tolerance : float
        Largest distance of lines that match.
    forgiven : float
        Distance from a sample that was found, and from one that counts as missing, within which nothing counts as
        missing.
    step : float
        Distance of the samples that are counted.

    Returns
    -------
    dict
        ``precision``, ``recall``, ``recall_by_length`` and ``f1`` (None where nothing counts; F1 is 0 if only precision or
        recall is None), and the numbers of samples.

    Examples
    --------
    >>> import scansion
    >>> line = [[0, 0, 0], [1, 0, 0]]
    >>> scansion.contours.score([line], [line, [[0, 5, 0], [1, 5, 0]]])["precision"]
    1.0
    """
    params = to_json({"tolerance": tolerance, "forgiven": forgiven, "step": step})
    scores: dict[str, float | None] = json.loads(
        _core.score_lines(_lines(lines), _lines(reference), _lines(unsure), params)
    )
    return scores


def score_points(
    points: ArrayLike, found: ArrayLike, reference: ArrayLike, *, forgiven: float = 0.03
) -> dict[str, float | None]:
    """Precision and recall of points by the rules of the thesis (section 4.6.2).

    Parameters
    ----------
    points : array_like of shape (n, 3)
        Metres.
    found, reference : array_like of shape (n,), bool
        Whether each point was marked as contour, and whether it is on one.
    forgiven : float
        Distance from a true positive, and from a counted false negative, within which nothing counts as missing.

    Returns
    -------
    dict
        As `score`.

    Examples
    --------
    >>> import scansion
    >>> scansion.contours.score_points([[0, 0, 0], [1, 0, 0]], [True, False], [True, True])["recall"]
    0.5
    """
    rows = np.ascontiguousarray(unmasked(points, "points"), np.float64).reshape(-1, 3)
    marked, true = mask(found, "found"), mask(reference, "reference")
    params = to_json({"forgiven": forgiven})
    scores: dict[str, float | None] = json.loads(_core.score_points(rows, marked, true, params))
    return scores


def precision_recall(
    found: Contours, reference: Lines, thresholds: ArrayLike | None = None, **settings: Any
) -> NDArray[np.float64]:
    """Precision and recall of the lines above thresholds of the confidence.

    Parameters
    ----------
    found : Contours
    reference : sequence of array of shape (m, 3)
        What is true.
    thresholds : array_like, optional
        By default 0, 0.05, ... 0.95.
    **settings
        As for `score`.

    Returns
    -------
    array of shape (k, 3)
        Threshold, precision and recall; NaN where nothing counts.

    Examples
    --------
    >>> import scansion
    >>> scene = scansion.contours.synthetic_scene("indoor", rays=50_000)
    >>> found = scansion.contours.extract(scene.cloud)
    >>> scansion.contours.precision_recall(found, scene.edges, [0.0, 0.5]).shape
    (2, 3)
    """
    steps = np.arange(20) / 20 if thresholds is None else unmasked(thresholds, "thresholds", float).reshape(-1)
    rows = []
    for least in steps:
        kept = [
            line
            for line, confidence in zip(found.lines, found.confidence, strict=True)
            if confidence >= least
        ]
        scores = score(kept, reference, **settings)
        rows.append(
            [least, *(np.nan if scores[name] is None else scores[name] for name in ("precision", "recall"))]
        )
    return np.array(rows, float).reshape(-1, 3)


def labels(cloud: Any, lines: Lines, *, voxel: float | None = None) -> NDArray[np.int16]:
    """Labels to train the recipe ``contours`` with, from lines along the edges of a cloud.

    Parameters
    ----------
    cloud : cloud
        As for `extract`.
    lines : sequence of array of shape (m, 3)
        Lines in the coordinates of the cloud.
    voxel : float, optional
        Edge of a voxel, metres; points within half of it are near.

    Returns
    -------
    array of shape (n,)
        1 up to half a voxel from a line, 0 farther than 0.6 voxels from all, -1 (unlabelled) between.

    Examples
    --------
    >>> import numpy as np
    >>> import scansion
    >>> scansion.contours.labels(np.array([[0.0, 0, 0], [0.55, 0, 0], [5, 0, 0]]), [[[0, -1, 0], [0, 1, 0]]], voxel=1)
    array([ 1, -1,  0], dtype=int16)
    """
    return _core.edge_labels(as_cloud(cloud)._core, _lines(lines), None if voxel is None else float(voxel))
