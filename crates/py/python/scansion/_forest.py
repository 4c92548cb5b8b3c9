"""The random forest for tables, in scikit-learn's shape."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core, _validation
from scansion._arrays import choice
from scansion._base import Classifier

BAG = 0.632
"""Share of the samples that one tree of the trainer "ethz" sees."""


class RandomForestClassifier(Classifier):
    """Random forest (Breiman 2001, doi:10.1023/A:1010933404324) on binned features.

    Same data, same parameters, same ``random_state``: the same bytes, for any number of threads.

    Parameters
    ----------
    n_estimators : int
        Trees.
    criterion : {"gini", "entropy"}
        Impurity that a split lowers.
    max_depth : int, optional
        Deepest level; without limit by default.
    min_samples_split : int
        Nodes with fewer samples become leaves.
    min_samples_leaf : int
        Splits that leave fewer samples on a side are not made.
    min_weight_fraction_leaf : float
        Splits that leave a smaller share of the weight on a side are not made; 0..0.5.
    max_features : {"sqrt", "log2"}, int, float or None
        Features drawn at each node: a rule, a count, a share, or all (None).
    bootstrap : bool
        Each tree sees a random sample; if False all see everything.
    trainer : {"breiman", "ethz"}
        "breiman": thresholds midway between values, samples drawn with replacement. "ethz" (Hackel et al. 2016):
        thresholds at random within the gap, 63.2 % of the samples drawn without replacement.
    max_bins : int
        Bins of a feature, 2..255.
    oob_score : bool
        Measure accuracy on the samples that each tree has not seen, as ``oob_score_``.
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
        Mean decrease of impurity, summing to 1 (to 0 if no tree splits).
    oob_score_ : float
        Only with ``oob_score=True``.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import RandomForestClassifier
    >>> X = np.array([[0.0], [1.0], [2.0], [3.0]])
    >>> forest = RandomForestClassifier(n_estimators=10, bootstrap=False).fit(X, ["low", "low", "high", "high"])
    >>> forest.predict([[0.2], [2.8]]).tolist()
    ['low', 'high']
    """

    classes_: NDArray[Any]
    n_classes_: int
    n_features_in_: int
    feature_names_in_: NDArray[np.object_]
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

    def fit(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> RandomForestClassifier:
        """Grows the trees.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
            Features; used as float32.
        y : array_like of shape (n_samples,)
            Class labels: numbers or text.
        sample_weight : array_like of shape (n_samples,), optional
            Weight of each sample, 0 or more; 0 is as if it were absent.
        """
        name = type(self).__name__
        names = _validation.feature_names(X)
        table = _validation.table(X, name)
        targets = _validation.labels(y, len(table), name)
        weights = _validation.weights(sample_weight, len(table))
        classes, positions = np.unique(targets, return_inverse=True)
        if len(classes) > 65_535:
            raise ValueError(f"y: found {len(classes)} classes, expected at most 65535")
        params = json.dumps(self._settings(classes))
        indices = positions.astype(np.uint16)
        asked = bool(self.oob_score and self.bootstrap)
        forest, oob = _core.fit_forest(table, indices, weights, len(classes), params, asked, self.n_jobs)
        self._forest = forest
        self.classes_, self.n_classes_, self.n_features_in_ = classes, len(classes), table.shape[1]
        for stale in ("feature_names_in_", "oob_score_"):
            self.__dict__.pop(stale, None)
        if names is not None:
            self.feature_names_in_ = names
        if oob is not None:
            self.oob_score_ = oob
        return self

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float32]:
        """Probability of each class: the mean over the trees.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)

        Returns
        -------
        array of shape (n_samples, n_classes)
            Columns in the order of ``classes_``.
        """
        self._check_is_fitted()
        name = type(self).__name__
        fitted = getattr(self, "feature_names_in_", None)
        _validation.check_feature_names(_validation.feature_names(X), fitted, name)
        table = _validation.table(X, name)
        _validation.check_width(table.shape[1], self.n_features_in_, name)
        return self._forest.predict_proba(table, self.n_jobs)

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """The most probable class of each row.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
        """
        probabilities = self.predict_proba(X)
        labels: NDArray[Any] = self.classes_[probabilities.argmax(axis=1)]
        return labels

    def score(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Share of rows that are named rightly (accuracy), 0..1.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
        y : array_like of shape (n_samples,)
        sample_weight : array_like of shape (n_samples,), optional
        """
        right = self.predict(X) == np.asarray(y)
        return float(np.average(right, weights=None if sample_weight is None else np.asarray(sample_weight)))

    @property
    def feature_importances_(self) -> NDArray[np.float64]:
        """Mean decrease of impurity by feature, summing to 1."""
        self._check_is_fitted()
        return self._forest.importance()

    def _settings(self, classes: NDArray[Any]) -> dict[str, Any]:
        """The parameters under the core's names."""
        choice(self.trainer, "trainer", ("breiman", "ethz"))
        choice(self.criterion, "criterion", ("gini", "entropy"))
        if self.oob_score and not self.bootstrap:
            raise ValueError(
                "oob_score: found True, expected False without bootstrap (every tree sees every sample)"
            )
        return {
            "trees": _whole(self.n_estimators, "n_estimators"),
            "max_depth": 0 if self.max_depth is None else _whole(self.max_depth, "max_depth"),
            "trainer": self.trainer,
            "criterion": self.criterion,
            "max_features": _max_features(self.max_features),
            "min_samples_split": _whole(self.min_samples_split, "min_samples_split"),
            "min_samples_leaf": _whole(self.min_samples_leaf, "min_samples_leaf"),
            "min_weight_leaf": _half(self.min_weight_fraction_leaf, "min_weight_fraction_leaf"),
            "bootstrap": _bootstrap(self.bootstrap, self.trainer),
            "class_weight": _class_weight(self.class_weight, classes),
            "max_bins": _whole(self.max_bins, "max_bins"),
            "seed": seed(self.random_state),
        }


def seed(random_state: Any) -> int:
    """A seed from what scikit-learn calls ``random_state``; None stands for 0."""
    if random_state is None:
        return 0
    if isinstance(random_state, (int, np.integer)) and 0 <= random_state < 2**63:
        return int(random_state)
    if isinstance(random_state, np.random.RandomState):
        return int(random_state.randint(0, 2**31 - 1))
    if isinstance(random_state, np.random.Generator):
        return int(random_state.integers(0, 2**63))
    raise ValueError(
        f"random_state: found {random_state!r}, expected a whole number in 0..2^63, a RandomState or None"
    )


def _whole(value: Any, name: str) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise ValueError(f"{name}: found {value!r}, expected a whole number, 1 or more")
    return int(value)


def _half(value: Any, name: str) -> float:
    if not isinstance(value, (int, float, np.floating)) or not 0 <= value <= 0.5:
        raise ValueError(f"{name}: found {value!r}, expected a share in 0..0.5")
    return float(value)


def _max_features(value: Any) -> Any:
    if value is None:
        return "all"
    if value in ("sqrt", "log2"):
        return value
    if isinstance(value, (int, np.integer)) and value > 0:
        return {"count": int(value)}
    if isinstance(value, (int, float, np.floating)) and 0 < value <= 1:
        return {"fraction": float(value)}
    raise ValueError(
        f"max_features: found {value!r}, expected 'sqrt', 'log2', a count, a share in 0..1 or None"
    )


def _bootstrap(value: Any, trainer: str) -> Any:
    if not value:
        return "none"
    return {"without_replacement": BAG} if trainer == "ethz" else "with_replacement"


def _class_weight(value: Any, classes: NDArray[Any]) -> Any:
    if value is None:
        return "none"
    if isinstance(value, str) and value == "balanced":
        return "balanced"
    if not isinstance(value, Mapping):
        raise ValueError(
            f"class_weight: found {value!r}, expected None, 'balanced' or a dict of label to weight"
        )
    known = classes.tolist()
    unknown = [label for label in value if label not in known]
    if unknown:
        raise ValueError(f"class_weight: the labels {unknown} are not in y")
    return {"per_class": [float(value.get(label, 1.0)) for label in known]}
