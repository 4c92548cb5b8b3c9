"""Gradient-boosted trees for tables, in scikit-learn's shape."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._settings import class_weight, seed, share, whole
from scansion._table import Lesson, TableClassifier


class GradientBoostingClassifier(TableClassifier):
    """Gradient-boosted trees (Friedman 2001, doi:10.1214/aos/1013203451) on binned features.

    Softmax of one score a class, the logistic function for two classes; leaf-wise growth and second-order gains, with
    LightGBM's defaults but XGBoost's penalty. Missing values (NaN) go to the side that the learning finds better. Same
    data, same parameters, same ``random_state``: the same bytes, for any number of threads.

    Parameters
    ----------
    n_estimators : int
        Rounds; each grows one tree a class (one in all for two classes).
    learning_rate : float
        Factor of every tree's answer, above 0, at most 1.
    max_leaf_nodes : int
        Most leaves of a tree.
    max_depth : int, optional
        Deepest level; without limit by default.
    min_samples_leaf : int
        Splits that leave fewer samples on a side are not made.
    min_child_weight : float
        Splits that leave a smaller sum of second derivatives on a side are not made.
    l2_regularization : float
        L2 penalty of the leaves' answers; with 0 a leaf of a rare class may answer without bound.
    min_split_gain : float
        A split must gain more than this.
    subsample : float
        Share of the samples that a tree sees.
    subsample_freq : int
        Rounds between two draws of these samples.
    max_features : float
        Share of the features that a tree sees.
    n_iter_no_change : int, optional
        Stop after this many rounds without a lower loss on held-out samples and keep the best round; never by default.
    validation_fraction : float
        Share of the samples of each class held out for that.
    max_bins : int
        Bins of a feature, 2..255; NaN has its own on top.
    class_weight : {None, "balanced"} or dict
        Weight of each class by label.
    random_state : int, numpy.random.RandomState or None
        Seed; None stands for 0, so that results repeat.
    n_jobs : int, optional
        Threads; None and -1 take all.

    Attributes
    ----------
    classes_ : array of shape (n_classes,)
    n_classes_ : int
    n_features_in_ : int
    feature_names_in_ : array of shape (n_features,)
        Only if ``X`` had column names.
    feature_importances_ : array of shape (n_features,)
        Share of each feature in the gain of all splits, summing to 1 (to 0 if no tree splits).
    n_estimators_ : int
        Rounds kept.
    train_score_ : array of shape (n_rounds + 1,)
        Mean loss of the samples learned from, before the first round and after each.
    validation_score_ : array of shape (n_rounds + 1,)
        The same of the samples held out; empty without early stopping.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import GradientBoostingClassifier
    >>> X = np.array([[0.0], [1.0], [2.0], [np.nan]])
    >>> trees = GradientBoostingClassifier(n_estimators=10, min_samples_leaf=1).fit(X, ["low", "low", "high", "high"])
    >>> trees.predict([[0.2], [2.8], [np.nan]]).tolist()
    ['low', 'high', 'high']
    """

    _missing = True

    n_estimators_: int
    train_score_: NDArray[np.float64]
    validation_score_: NDArray[np.float64]

    def __init__(
        self,
        n_estimators: int = 100,
        *,
        learning_rate: float = 0.1,
        max_leaf_nodes: int = 31,
        max_depth: int | None = None,
        min_samples_leaf: int = 20,
        min_child_weight: float = 1e-3,
        l2_regularization: float = 1.0,
        min_split_gain: float = 0.0,
        subsample: float = 1.0,
        subsample_freq: int = 1,
        max_features: float = 1.0,
        n_iter_no_change: int | None = None,
        validation_fraction: float = 0.1,
        max_bins: int = 255,
        class_weight: Literal["balanced"] | Mapping[Any, float] | None = None,
        random_state: int | np.random.RandomState | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.n_estimators = n_estimators
        self.learning_rate = learning_rate
        self.max_leaf_nodes = max_leaf_nodes
        self.max_depth = max_depth
        self.min_samples_leaf = min_samples_leaf
        self.min_child_weight = min_child_weight
        self.l2_regularization = l2_regularization
        self.min_split_gain = min_split_gain
        self.subsample = subsample
        self.subsample_freq = subsample_freq
        self.max_features = max_features
        self.n_iter_no_change = n_iter_no_change
        self.validation_fraction = validation_fraction
        self.max_bins = max_bins
        self.class_weight = class_weight
        self.random_state = random_state
        self.n_jobs = n_jobs

    def _learn(self, lesson: Lesson) -> Any:
        params = json.dumps(self._settings(lesson.classes))
        trees, training, validation, rounds = _core.fit_boosting(*lesson.samples, params, self.n_jobs)
        self.train_score_, self.validation_score_, self.n_estimators_ = training, validation, rounds
        return trees

    def _settings(self, classes: NDArray[Any]) -> dict[str, Any]:
        """The parameters under the core's names."""
        most = (0, math.inf)
        return {
            "rounds": whole(self.n_estimators, "n_estimators"),
            "learning_rate": share(self.learning_rate, "learning_rate"),
            "max_leaves": whole(self.max_leaf_nodes, "max_leaf_nodes", 2),
            "max_depth": 0 if self.max_depth is None else whole(self.max_depth, "max_depth"),
            "min_samples_leaf": whole(self.min_samples_leaf, "min_samples_leaf"),
            "min_child_weight": share(self.min_child_weight, "min_child_weight", most),
            "lambda": share(self.l2_regularization, "l2_regularization", most),
            "min_gain": share(self.min_split_gain, "min_split_gain", most),
            "row_fraction": share(self.subsample, "subsample"),
            "row_rounds": whole(self.subsample_freq, "subsample_freq"),
            "column_fraction": share(self.max_features, "max_features"),
            "early_stopping": 0
            if self.n_iter_no_change is None
            else whole(self.n_iter_no_change, "n_iter_no_change"),
            "validation_fraction": share(self.validation_fraction, "validation_fraction"),
            "class_weight": class_weight(self.class_weight, classes),
            "max_bins": whole(self.max_bins, "max_bins"),
            "seed": seed(self.random_state),
        }
