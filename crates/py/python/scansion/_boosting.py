"""Gradient-boosted trees for tables, with the interface of scikit-learn."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._settings import MOST_TREES, class_weight, fraction, seed, share, whole
from scansion._table import TableClassifier, TrainingData


class GradientBoostingClassifier(TableClassifier):
    """Gradient-boosted trees (Friedman 2001, doi:10.1214/aos/1013203451) on binned features.

    Softmax of one score per class, or the logistic function for two classes; leaf-wise growth and second-order gains, with
    the defaults of LightGBM but the L2 penalty of XGBoost. Missing values (NaN) go to the side of larger gain. The same
    data, parameters and ``random_state`` give the same bytes, for any number of threads.

    Parameters
    ----------
    n_estimators : int
        Number of rounds; each grows one tree per class (a single one for two classes).
    learning_rate : float
        Factor of every leaf value, above 0, at most 1.
    max_leaf_nodes : int
        Largest number of leaves of a tree.
    max_depth : int, optional
        Largest depth of a tree; unlimited by default.
    min_samples_leaf : int
        Least number of samples on each side of a split.
    min_child_weight : float
        Least sum of second derivatives on each side of a split.
    l2_regularization : float
        L2 penalty of the leaf values; with 0 those of rare classes are not bounded.
    min_split_gain : float
        Least gain of a split.
    subsample : float
        Share of the samples that each tree is trained on.
    subsample_freq : int
        Number of rounds between two draws of these samples.
    max_features : int, float or None
        Number of features that each tree is trained on: a count, a share (so that 1 is one feature and 1.0 are all), or all
        (None).
    n_iter_no_change : int, optional
        Stop after this many rounds without a lower loss on held-out samples, and keep the best round; never by default.
    validation_fraction : float
        Share of the samples of each class held out for this.
    max_bins : int
        Largest number of bins of a feature, 2..255, not counting that of NaN.
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
        Share of each feature in the gain of all splits, summing to 1 (all 0 if no tree has a split).
    n_estimators_ : int
        Number of rounds kept.
    train_score_ : array of shape (n_rounds + 1,)
        Mean loss of the training samples, before the first round and after each.
    validation_score_ : array of shape (n_rounds + 1,)
        The same for the held-out samples; empty without early stopping.

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
        max_features: float | None = 1.0,
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

    def _learn(self, data: TrainingData) -> Any:
        settings = self._settings(data)
        _warn_of_little(data, settings)
        params = json.dumps(settings)
        trees, training, validation, rounds = _core.fit_boosting(*data.samples, params, self.n_jobs)
        self.train_score_, self.validation_score_, self.n_estimators_ = training, validation, rounds
        return trees

    def _settings(self, data: TrainingData) -> dict[str, Any]:
        """The parameters under the core's names."""
        most = (0, math.inf)
        return {
            "rounds": whole(self.n_estimators, "n_estimators", 1, MOST_TREES),
            "learning_rate": fraction(self.learning_rate, "learning_rate"),
            "max_leaves": whole(self.max_leaf_nodes, "max_leaf_nodes", 2, 65_535),
            "max_depth": 0 if self.max_depth is None else whole(self.max_depth, "max_depth"),
            "min_samples_leaf": whole(self.min_samples_leaf, "min_samples_leaf"),
            "min_child_weight": share(self.min_child_weight, "min_child_weight", most),
            "lambda": share(self.l2_regularization, "l2_regularization", most),
            "min_gain": share(self.min_split_gain, "min_split_gain", most),
            "row_fraction": fraction(self.subsample, "subsample"),
            "row_rounds": whole(self.subsample_freq, "subsample_freq"),
            "column_fraction": _share_of_features(self.max_features, data.samples[0].shape[1]),
            "early_stopping": 0
            if self.n_iter_no_change is None
            else whole(self.n_iter_no_change, "n_iter_no_change"),
            "validation_fraction": share(self.validation_fraction, "validation_fraction"),
            "class_weight": class_weight(self.class_weight, data.classes),
            "max_bins": whole(self.max_bins, "max_bins"),
            "seed": seed(self.random_state),
        }


def _share_of_features(value: Any, width: int) -> float:
    if value is None:
        return 1.0
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        count = whole(value, "max_features")
        return min(count, width) / width
    if not isinstance(value, (float, np.floating)) or not 0 < value <= 1:
        raise ValueError(f"max_features: found {value!r}, expected a count, a share above 0, at most 1, or None")
    return float(value)


def _warn_of_little(data: TrainingData, settings: dict[str, Any]) -> None:
    """Warns of weights whose sum is small beside the limits that they are compared with, so that trees hardly learn."""
    _, places, weights, count = data.samples
    of_class = settings["class_weight"]
    factors = np.array(of_class["per_class"]) if isinstance(of_class, dict) else np.ones(count)
    total = float(np.bincount(places, weights, count) @ factors)
    rows = len(places) if weights is None else np.count_nonzero(weights)
    # A sample of weight 1 has a second derivative of at most a quarter, and a split needs two sides.
    limit = max(settings["lambda"], 8 * settings["min_child_weight"])
    if total < 0.1 * rows and total < 10 * limit:
        warnings.warn(
            f"the weights of {rows} samples sum to {total:.3g}, which is little beside l2_regularization and "
            "min_child_weight, so that the trees hardly learn; weights of mean 1 avoid this",
            stacklevel=4,
        )
