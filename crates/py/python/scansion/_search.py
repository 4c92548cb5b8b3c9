"""Cross-validation and grids of settings for whole recipes."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from scansion import _core
from scansion._classifier import LABELS, Reading, labelled_clouds
from scansion._labels import listed
from scansion._settings import recipe as read_recipe
from scansion._settings import seed, toml_value


class Search(NamedTuple):
    """Result of `search`."""

    best: dict[str, Any]
    """The settings with the largest mean F1; ``PointClassifier({**recipe, **best})`` takes them."""
    tried: list[dict[str, Any]]
    """``settings`` and ``scores`` of each combination, in the order of the grid; scores as of `evaluation.scores`."""
    block: float
    """Edge of the squares, metres."""


def search(
    clouds: Any,
    labels: Any = None,
    *,
    grid: Mapping[str, Sequence[Any]] | None = None,
    recipe: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    folds: int = 5,
    block: float | None = None,
    unlabelled: Iterable[int] | None = None,
    class_map: str = "",
    random_state: int | None = None,
    n_jobs: int | None = None,
) -> Search:
    """Cross-validates a recipe on squares of the clouds, with all combinations of the values of a grid.

    Parameters
    ----------
    clouds : cloud or list of clouds
        Each a PointCloud, path, laspy.LasData, structured array or array of shape (n, 3).
    labels : array_like of shape (n,) or list of such, optional
        Class codes 0..255 of the cloud's class list (negative: unlabelled); by default each cloud's column Classification.
    grid : mapping of str to sequence, optional
        Keys of the recipe and the values to try, as in ``{"forest.max_depth": [18, 30]}``; without it the recipe itself is
        evaluated.
    recipe : path, str or mapping, optional
        As for `PointClassifier`; the name ``"weak"`` or ``"objects"`` takes that recipe.
    folds : int
        Number of folds.
    block : float, optional
        Edge of the squares that are held out together, metres; by default 50, halved until there are two squares a fold.
    unlabelled : iterable of int, optional
        Codes that mean "unlabelled"; by default those of the cloud's class list (LAS: 0 and 1), for ``labels`` too.
    class_map : str
        Mapping of codes before training, as in ``"3-4=5"``.
    random_state : int, optional
        Seed; None uses the recipe's.
    n_jobs : int, optional
        Number of threads; None and -1 use all. Results do not depend on it.

    Returns
    -------
    Search
        The ``best`` settings, and the scores of the held-out points of all that were ``tried``.

    Examples
    --------
    >>> import numpy as np, scansion
    >>> ground = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([0.5], np.arange(20.0), np.arange(1.0, 21.0)), -1).reshape(-1, 3)
    >>> cloud, labels = np.concatenate([ground, wall]), np.repeat([2, 6], 400)
    >>> recipe = {"features.pyramid.first_scale": 1.0, "features.pyramid.levels": 2, "forest.trees": 10}
    >>> found = scansion.search(cloud, labels, grid={"forest.max_depth": [1, 9]}, recipe=recipe, folds=2)
    >>> len(found.tried), set(found.best)
    (2, {'forest.max_depth'})
    """
    text, settings = read_recipe(recipe)
    if random_state is not None:
        settings.append(f"seed={seed(random_state)}")
    wanted = _core.recipe_columns(text, settings)
    prepared = labelled_clouds(clouds, labels, Reading(wanted, class_map, listed=unlabelled is None))
    values = {key: list(each) for key, each in (grid or {}).items()}
    axes = [(key, [toml_value(key, value) for value in each]) for key, each in values.items()]
    codes = None if unlabelled is None else listed(list(unlabelled))
    report = json.loads(
        _core.search(
            [cloud._core for cloud in prepared], text, settings, axes, LABELS, class_map, codes, folds, block, n_jobs
        )
    )
    given = [dict(zip(values, combination, strict=True)) for combination in _combinations(list(values.values()))]
    tried = [{"settings": s, "scores": t["scores"]} for s, t in zip(given, report["tried"], strict=True)]
    return Search(given[report["best"]], tried, report["block"])


def _combinations(values: list[list[Any]]) -> list[tuple[Any, ...]]:
    """All combinations, the last key fastest."""
    found: list[tuple[Any, ...]] = [()]
    for each in values:
        found = [(*before, value) for before in found for value in each]
    return found
