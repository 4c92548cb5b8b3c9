"""Bagging of unpruned trees for tables, with the interface of scikit-learn."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._importance import ForestClassifier
from scansion._settings import MOST_TREES, class_weight, seed, share, whole
from scansion._table import TrainingData


class BaggingClassifier(ForestClassifier):
    """Bagging (Breiman 1996, doi:10.1007/BF00058655): the mean of unpruned trees on bootstrap samples.

    Every tree tries all features at every node. The same data, parameters and ``random_state`` give the same bytes, for any
    number of threads.

    Parameters
    ----------
    n_estimators : int
        Number of trees.
    max_depth : int, optional
        Largest depth of a tree; unlimited by default.
    min_samples_split : int
        Nodes with fewer samples become leaves.
    min_samples_leaf : int
        Least number of samples on each side of a split.
    min_weight_fraction_leaf : float
        Least share of the weight on each side of a split; 0..0.5.
    max_bins : int
        Largest number of bins of a feature, 2..255.
    oob_score : bool
        Compute the out-of-bag accuracy, as ``oob_score_``.
    class_weight : {None, "balanced"} or dict
        Class weights by label.
    random_state : int, numpy.random.RandomState or None
        Seed; None means 0, so that results are reproducible.
    n_jobs : int, optional
        Number of threads; None and -1 use all.

    Attributes
    ----------
    classes_ : array of shape (n_classes,)
    n_classes_ : int
    n_features_in_ : int
    feature_names_in_ : array of shape (n_features,)
        Only if ``X`` had column names.
    feature_importances_ : array of shape (n_features,)
        Mean decrease of impurity, summing to 1 (all 0 if no tree has a split).
    oob_score_ : float
        Only with ``oob_score=True``. Samples that no tree left out do not count, with a warning; NaN if there are no others.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import BaggingClassifier
    >>> X = np.arange(20.0).reshape(-1, 1)
    >>> trees = BaggingClassifier(n_estimators=10).fit(X, np.where(X[:, 0] < 10, "low", "high"))
    >>> trees.predict([[2], [18]]).tolist()
    ['low', 'high']
    """

    oob_score_: float

    def __init__(
        self,
        n_estimators: int = 100,
        *,
        max_depth: int | None = None,
        min_samples_split: int = 2,
        min_samples_leaf: int = 1,
        min_weight_fraction_leaf: float = 0.0,
        max_bins: int = 255,
        oob_score: bool = False,
        class_weight: Literal["balanced"] | Mapping[Any, float] | None = None,
        random_state: int | np.random.RandomState | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.n_estimators = n_estimators
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.min_weight_fraction_leaf = min_weight_fraction_leaf
        self.max_bins = max_bins
        self.oob_score = oob_score
        self.class_weight = class_weight
        self.random_state = random_state
        self.n_jobs = n_jobs

    def _learn(self, data: TrainingData) -> Any:
        params = json.dumps(self._settings(data.classes))
        trees, oob = _core.fit_bagging(*data.samples, params, bool(self.oob_score), self.n_jobs)
        self.__dict__.pop("oob_score_", None)
        if self.oob_score:
            self.oob_score_ = np.nan if oob is None else oob
        return trees

    def _settings(self, classes: NDArray[Any]) -> dict[str, Any]:
        """The parameters under the core's names."""
        return {
            "trees": whole(self.n_estimators, "n_estimators", 1, MOST_TREES),
            "max_depth": 0 if self.max_depth is None else whole(self.max_depth, "max_depth"),
            "min_samples_split": whole(self.min_samples_split, "min_samples_split"),
            "min_samples_leaf": whole(self.min_samples_leaf, "min_samples_leaf"),
            "min_weight_leaf": share(self.min_weight_fraction_leaf, "min_weight_fraction_leaf", (0, 0.5)),
            "class_weight": class_weight(self.class_weight, classes),
            "max_bins": whole(self.max_bins, "max_bins"),
            "seed": seed(self.random_state),
        }
