"""The random forest for tables, with the interface of scikit-learn."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice
from scansion._importance import ForestClassifier
from scansion._settings import MOST_TREES, class_weight, seed, share, whole
from scansion._table import TrainingData

BAG = 0.632
"""Share of the samples that each tree is trained on with the trainer "ethz"."""


class RandomForestClassifier(ForestClassifier):
    """Random forest (Breiman 2001, doi:10.1023/A:1010933404324) on binned features.

    The same data, parameters and ``random_state`` give the same bytes, for any number of threads.

    Parameters
    ----------
    n_estimators : int
        Number of trees.
    criterion : {"gini", "entropy"}
        Impurity measure.
    max_depth : int, optional
        Largest depth of a tree; unlimited by default.
    min_samples_split : int
        Nodes with fewer samples become leaves.
    min_samples_leaf : int
        Least number of samples on each side of a split.
    min_weight_fraction_leaf : float
        Least share of the weight on each side of a split; 0..0.5.
    max_features : {"sqrt", "log2"}, int, float or None
        Number of features tried at each node: a rule, a count, a share, or all (None).
    bootstrap : bool
        Train each tree on a random sample; if False, on all samples.
    trainer : {"breiman", "ethz"}
        Thresholds are borders of bins, which lie midway between values. "breiman": the middle one of those between two
        occupied bins, samples drawn with replacement. "ethz" (Hackel et al. 2016): one of those at random, the same if there
        is only one; 63.2 % of the samples drawn without replacement.
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
    >>> from scansion import RandomForestClassifier
    >>> X = np.array([[0.0], [1.0], [2.0], [3.0]])
    >>> forest = RandomForestClassifier(n_estimators=10, bootstrap=False).fit(X, ["low", "low", "high", "high"])
    >>> forest.predict([[0.2], [2.8]]).tolist()
    ['low', 'high']
    """

    oob_score_: float

    def __init__(
        self,
        n_estimators: int = 100,
        *,
        criterion: Literal["gini", "entropy"] = "gini",
        max_depth: int | None = None,
        min_samples_split: int = 2,
        min_samples_leaf: int = 1,
        min_weight_fraction_leaf: float = 0.0,
        max_features: Literal["sqrt", "log2"] | int | float | None = "sqrt",
        bootstrap: bool = True,
        trainer: Literal["breiman", "ethz"] = "breiman",
        max_bins: int = 255,
        oob_score: bool = False,
        class_weight: Literal["balanced"] | Mapping[Any, float] | None = None,
        random_state: int | np.random.RandomState | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.n_estimators = n_estimators
        self.criterion = criterion
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.min_weight_fraction_leaf = min_weight_fraction_leaf
        self.max_features = max_features
        self.bootstrap = bootstrap
        self.trainer = trainer
        self.max_bins = max_bins
        self.oob_score = oob_score
        self.class_weight = class_weight
        self.random_state = random_state
        self.n_jobs = n_jobs

    def _learn(self, data: TrainingData) -> Any:
        params = json.dumps(self._settings(data.classes))
        asked = bool(self.oob_score and self.bootstrap)
        forest, oob = _core.fit_forest(*data.samples, params, asked, self.n_jobs)
        self.__dict__.pop("oob_score_", None)
        if asked:
            self.oob_score_ = np.nan if oob is None else oob
        return forest

    def _settings(self, classes: NDArray[Any]) -> dict[str, Any]:
        """The parameters under the core's names."""
        choice(self.trainer, "trainer", ("breiman", "ethz"))
        choice(self.criterion, "criterion", ("gini", "entropy"))
        if self.oob_score and not self.bootstrap:
            raise ValueError(
                "oob_score: found True, expected False without bootstrap (every tree sees every sample)"
            )
        return {
            "trees": whole(self.n_estimators, "n_estimators", 1, MOST_TREES),
            "max_depth": 0 if self.max_depth is None else whole(self.max_depth, "max_depth"),
            "trainer": self.trainer,
            "criterion": self.criterion,
            "max_features": _max_features(self.max_features),
            "min_samples_split": whole(self.min_samples_split, "min_samples_split"),
            "min_samples_leaf": whole(self.min_samples_leaf, "min_samples_leaf"),
            "min_weight_leaf": share(self.min_weight_fraction_leaf, "min_weight_fraction_leaf", (0, 0.5)),
            "bootstrap": _bootstrap(self.bootstrap, self.trainer),
            "class_weight": class_weight(self.class_weight, classes),
            "max_bins": whole(self.max_bins, "max_bins"),
            "seed": seed(self.random_state),
        }


def _max_features(value: Any) -> Any:
    if value is None:
        return "all"
    if isinstance(value, str) and value in ("sqrt", "log2"):
        return value
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and value > 0:
        return {"count": int(value)}
    if isinstance(value, (float, np.floating)) and 0 < value <= 1:
        return {"fraction": float(value)}
    raise ValueError(
        f"max_features: found {value!r}, expected 'sqrt', 'log2', a count, a share in 0..1 or None"
    )


def _bootstrap(value: Any, trainer: str) -> Any:
    if not value:
        return "none"
    return {"without_replacement": BAG} if trainer == "ethz" else "with_replacement"
