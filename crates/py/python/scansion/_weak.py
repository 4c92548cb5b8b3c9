"""Weakly supervised classification: few labelled points."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from scansion._base import lasting
from scansion._classifier import PointClassifier


class WeakClassifier(PointClassifier):
    """Classifies every point of a scan, trained on few labels.

    S. Guinard, L. Landrieu, *Weakly supervised segmentation-aided classification of urban scenes from 3D LiDAR point
    clouds*, 2017, doi:10.5194/isprs-archives-XLII-1-W1-151-2017: descriptors in optimal neighbourhoods and with respect to
    the road, a random forest on the labelled points, segments by l0 cut pursuit, and a conditional random field on the
    segments, solved by alpha-expansion.

    Parameters
    ----------
    recipe : path, str or mapping, optional
        A TOML recipe of the kind ``weak``: its path, its text, a name, or a mapping of keys (nested or dotted) to values,
        as in
        ``{"neighbourhood.k_min": 20, "regularise.strength": 0.5}``. By default the paper's method
        with the additions in ``docs/weak.md``.
    strengths : sequence of float
        Strengths of the random field to choose from, by the accuracy on held-out labels; empty uses the recipe's.
    unlabelled : iterable of int or str, optional
        Labels that mean "unlabelled"; by default those of the cloud's class list (LAS: 0 and 1, Semantic3D: 0, others: none),
        also for codes that are given as an array beside the cloud; a cloud that is an array has no list. ``[]`` makes every
        code a class. Negative labels, NaN and None are always unlabelled.
    class_map : str
        Mapping of codes before training, as in ``"3-4=5"``.
    random_state : int, numpy.random.RandomState or None
        Seed; None uses the recipe's (0 if it has none).
    n_jobs : int, optional
        Number of threads; None and -1 use all. Results do not depend on it.

    Attributes
    ----------
    classes_ : array of shape (n_classes,)
        Class codes, ascending; the texts if ``fit`` was given text.
    report_ : dict
        Report of the training; only after ``fit``.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import WeakClassifier
    >>> grid = np.arange(0.0, 20.0, 0.5)
    >>> ground = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([10.2], grid, grid + 0.5), -1).reshape(-1, 3)
    >>> xyz = np.concatenate([ground, wall])
    >>> truth = np.repeat([2, 6], 1600)
    >>> labels = np.full(3200, -1)
    >>> picked = np.random.default_rng(0).choice(3200, 30, replace=False)
    >>> labels[picked] = truth[picked]
    >>> codes = WeakClassifier(random_state=0).fit(xyz, labels).predict(xyz)
    >>> bool((codes == truth).mean() > 0.95)
    True
    """

    def __init__(
        self,
        recipe: str | os.PathLike[str] | Mapping[str, Any] | None = None,
        *,
        strengths: Iterable[float] = (),
        unlabelled: Iterable[Any] | None = None,
        class_map: str = "",
        random_state: int | np.random.RandomState | None = None,
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(
            recipe, unlabelled=unlabelled, class_map=class_map, random_state=random_state, n_jobs=n_jobs
        )
        self.strengths = strengths

    def _strengths(self) -> list[float]:
        return [float(s) for s in lasting(self.strengths, "strengths")]

    def _recipe(self) -> tuple[str, list[str]]:
        text, settings = super()._recipe()
        return text or "weak", settings
