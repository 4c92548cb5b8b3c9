"""Pictures of clouds, without a display."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import choice, to_json, unmasked
from scansion._cloud import as_cloud
from scansion._labels import signed
from scansion._settings import whole


def render(
    cloud: Any,
    path: str | os.PathLike[str] | None = None,
    by: str = "class",
    view: Literal["map", "oblique"] = "map",
    *,
    azimuth: float = 30.0,
    elevation: float = 35.0,
    width: int = 1600,
    height: int | None = None,
    shading: bool = True,
    legend: bool = True,
    title: str | None = None,
    value_range: tuple[float, float] | None = None,
    truth: ArrayLike | None = None,
    classes: Iterable[int] = (),
    changes: bool = False,
    clip: tuple[float, float] | None = None,
    contours: Iterable[ArrayLike] = (),
    n_jobs: int | None = None,
) -> NDArray[np.uint8]:
    """Draws a map or an oblique view of a cloud.

    Parameters
    ----------
    cloud : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
    path : path, optional
        Also write the picture there, as ``.png``; a map gets a world file ``.pgw`` beside it.
    by : str
        Quantity shown by colour: "class", "height", "rgb" (the points' own colour) or the name of a column; with
        ``truth`` only "class".
    view : {"map", "oblique"}
    azimuth, elevation : float
        Viewing direction of the oblique view, degrees clockwise from north, and the elevation of the viewpoint above the
        horizon, 0..90 degrees.
    width, height : int
        Pixels, 200..8000; by default the height follows from the shape of the cloud.
    shading : bool
        Hillshading.
    legend : bool
        Draw legend and scale bar.
    title : str, optional
    value_range : (float, float), optional
        Ends of the colour bar; the 2nd and 98th percentile by default.
    truth : array_like of shape (n,), optional
        True class codes 0..255 of the cloud's class list (negative, and of LAS 0 and 1: unlabelled); the colours then show where
        the cloud's classes differ from them.
    classes : iterable of int
        With ``truth``: compare only points whose true class is one of these; all by default.
    changes : bool
        With ``truth``: a colour for each pair of a true class and another.
    clip : (float, float), optional
        Draw only points of these heights (z), e.g. ``(-inf, 2.2)`` for a room without its ceiling.
    contours : Contours, or iterable of array of shape (m, 3)
        Lines drawn over the cloud, in its coordinates; faint where points are in front of them.
    n_jobs : int, optional
        Number of threads; None and -1 use all.

    Returns
    -------
    array of shape (height, width, 3)
        sRGB.
    """
    choice(view, "view", ("map", "oblique"))
    picked = [whole(code, "classes", 0, 255) for code in classes]
    if truth is not None and str(by).lower() != "class":
        raise ValueError(f"by: found {by!r} with truth, expected 'class'")
    if truth is None and (picked or changes):
        raise ValueError(f"{'classes' if picked else 'changes'}: found without truth, expected with it")
    settings = {
        "by": by,
        "angles": (azimuth, elevation) if view == "oblique" else None,
        "width": width,
        "height": height,
        "shading": shading,
        "legend": legend,
        "title": title,
        "range": value_range,
        "changes": changes,
        "clip": None if clip is None else tuple(float(np.clip(end, -1e300, 1e300)) for end in clip),
        "lines": [_line(line) for line in contours],
        "classes": picked,
    }
    target = None if path is None else os.fspath(path)
    if target is not None and isinstance(cloud, (str, os.PathLike)):
        _apart(cloud, target)
    points = as_cloud(cloud)
    codes = None if truth is None else signed(truth, "truth", len(points), points._core.unlabelled())
    return _core.render(points._core, to_json(settings), target, codes, n_jobs)


def _line(line: ArrayLike) -> list[list[float]]:
    vertices = unmasked(line, "contours", float)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
        raise ValueError(f"contours: found a line of shape {vertices.shape}, expected (m, 3) with finite numbers")
    return [[float(value) for value in vertex] for vertex in vertices]


def _apart(cloud: str | os.PathLike[str], target: str) -> None:
    """Fails if the picture would overwrite the cloud."""
    if os.path.exists(target) and os.path.exists(cloud) and os.path.samefile(cloud, target):
        raise ValueError(f"path: {target} is the file that is drawn; give the picture another name")
