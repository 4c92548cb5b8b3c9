"""Lines along the edges of objects: roofs, walls, kerbs, furniture."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, codes, to_json
from scansion._classifier import PointClassifier
from scansion._cloud import PointCloud, as_cloud
from scansion._settings import dotted_settings, seed

__all__ = ["Contours", "Scene", "extract", "labels", "score", "synthetic_scene"]

Lines = Sequence[Any]
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
        Mean probability along each line, 0..1.
    classes : array of shape (n, 2), int; or None
        The most frequent classes beside each line; None if the cloud has no classes.
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
        self.classes = None if not rows or any(pair is None for pair in known) else np.array(known, np.int64)
        self.voxel: float = report["voxel"]
        self.n_seeds: int = report["seeds"]
        self.n_candidates: int = report["candidates"]
        self.energies = np.array(report["energies"], float)
        self.warnings: list[str] = report["warnings"]

    def __len__(self) -> int:
        return len(self.lines)

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        return iter(self.lines)

    def __repr__(self) -> str:
        return f"Contours({len(self)} lines, {self.length.sum():.1f} m)"

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the lines as a drawing with a layer for each pair of classes.

        Parameters
        ----------
        path : path
            ``.dxf``, ``.gpkg``, ``.geojson``, ``.obj`` or ``.ply``.
        """
        self._core.write(os.fspath(path))


def extract(
    cloud: Any,
    model: PointClassifier | str | os.PathLike[str] | None = None,
    *,
    voxel: float | None = None,
    classes: Any = None,
    without: Sequence[int] = (),
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
        Edge of the voxels that hold one seed of a line each, metres; smaller: finer edges. By default 2 times the spacing of
        the points.
    classes : array_like of shape (n,), optional
        Class of each point, for the classes beside the lines; by default those of the cloud, if it has any.
    without : sequence of int
        Points of these classes carry no line, for instance vegetation.
    settings : mapping, optional
        Settings of the model's recipe, as ``{"trace.tidy.least_length": 0.5}``.
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
    >>> scene = scansion.contours.synthetic_scene("indoor", seed=1, rays=100_000)
    >>> found = scansion.contours.extract(scene.cloud)
    >>> len(found) > 10
    True
    """
    points = as_cloud(cloud)
    own = {**(settings or {}), **({} if voxel is None else {"voxel": float(voxel)})}
    if model is not None and not isinstance(model, PointClassifier):
        model = PointClassifier.load(model)
    return Contours(
        _core.contours(
            points._core,
            None if model is None else model._model,
            dotted_settings(own),
            None if classes is None else codes(classes, "classes"),
            [int(code) for code in without],
            metres_per_unit,
            n_jobs,
        )
    )


class Scene(NamedTuple):
    """A made-up scene with known edges."""

    cloud: PointCloud
    """The points with their class in the column Classification."""
    edges: NDArray[np.float32]
    """Both ends of each edge, shape (m, 2, 3), metres."""
    scan_positions: NDArray[np.float32]
    """Where the scanner stood, shape (k, 3)."""


def synthetic_scene(kind: str = "urban", *, random_state: Any = None, n_jobs: int | None = None, **settings: Any) -> Scene:
    """A street or a room that is made up and scanned, with its true edges.

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
    given = {**settings, "seed": seed(random_state)}
    xyz, classes, edges, places = _core.synthetic_scene(kind, to_json(given), n_jobs)
    cloud = PointCloud(xyz.astype(np.float64), Classification=classes)
    return Scene(cloud, edges.reshape(-1, 2, 3), places)


def _pieces(lines: Lines, dtype: Any) -> tuple[NDArray[Any], NDArray[np.uint64]]:
    arrays = [np.asarray(line, dtype) for line in lines]
    for number, line in enumerate(arrays):
        if line.ndim != 2 or line.shape[1] != 3:
            raise ValueError(f"line {number}: found shape {line.shape}, expected (m, 3)")
    rows = np.concatenate([*arrays, np.zeros((0, 3), dtype)])
    return np.ascontiguousarray(rows, dtype), np.array([len(line) for line in arrays], np.uint64)


def score(
    lines: Lines, reference: Lines, *, tolerance: float = 0.06, forgiven: float = 0.03, step: float = 0.01
) -> dict[str, float | None]:
    """Precision and recall of lines by the rules of the thesis (section 4.6.2).

    Parameters
    ----------
    lines, reference : sequences of array of shape (m, 3)
        What was found, and what is true; coordinates near 0, in metres.
    tolerance : float
        Largest distance of lines that match.
    forgiven : float
        Distance from a part that was found within which nothing counts as missing.
    step : float
        Distance of the samples that are counted.

    Returns
    -------
    dict
        ``precision``, ``recall`` and ``f1`` (None where nothing counts), and the numbers of samples.

    Examples
    --------
    >>> import scansion
    >>> line = [[0, 0, 0], [1, 0, 0]]
    >>> scansion.contours.score([line], [line, [[0, 5, 0], [1, 5, 0]]])["precision"]
    1.0
    """
    params = to_json({"tolerance": tolerance, "forgiven": forgiven, "step": step})
    found = json.loads(_core.score_lines(_pieces(lines, np.float32), _pieces(reference, np.float32), params))
    kept, true = found["correct"] + found["false_positives"], found["covered"] + found["false_negatives"]
    precision = found["correct"] / kept if kept else None
    recall = found["covered"] / true if true else None
    f1 = None
    if precision is not None and recall is not None:
        f1 = 2 * precision * recall / (precision + recall) if precision + recall else 0.0
    return {"precision": precision, "recall": recall, "f1": f1, **found}


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
        1 near a line, 0 farther than a voxel from all, -1 (unlabelled) between.

    Examples
    --------
    >>> import numpy as np
    >>> import scansion
    >>> scansion.contours.labels(np.array([[0.0, 0, 0], [0.7, 0, 0], [5, 0, 0]]), [[[0, -1, 0], [0, 1, 0]]], voxel=1)
    array([ 1, -1,  0], dtype=int16)
    """
    rows, counts = _pieces(lines, np.float64)
    return _core.edge_labels(as_cloud(cloud)._core, rows, counts, None if voxel is None else float(voxel))
