"""Common base of the classifiers for tables: fit, predict and score as in scikit-learn."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _validation
from scansion._base import Classifier, logarithms
from scansion._labels import check_kind, is_text, texts
from scansion._routing import RoutedInScore

Self = TypeVar("Self", bound="TableClassifier")


_BLOCK = 1 << 18
"""Labels that numpy sorts at a time, so that Ctrl-C is noticed between blocks."""


def _positions(targets: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.uint16]]:
    """The classes, ascending, and the place of each label among them (not valid for more than 65,536 classes)."""
    blocks = [targets[first : first + _BLOCK] for first in range(0, len(targets), _BLOCK)]
    classes = np.unique(np.concatenate([np.unique(block) for block in blocks]))
    places = [np.searchsorted(classes, block).astype(np.uint16) for block in blocks]
    return classes, np.concatenate(places)


class TrainingData(NamedTuple):
    """Samples and classes."""

    samples: tuple[NDArray[np.float32], NDArray[np.uint16], NDArray[np.float32] | None, int]
    """The table, positions of the labels in ``classes``, weights, and the number of classes."""
    classes: NDArray[Any]
    """The labels of the classes, ascending."""


class TableClassifier(RoutedInScore, Classifier):
    """A classifier of rows of features. A subclass trains its trees in ``_learn``."""

    classes_: NDArray[Any]
    n_classes_: int
    n_features_in_: int
    feature_names_in_: NDArray[np.object_]
    n_jobs: int | None

    _missing = False
    """NaN in the table is allowed."""

    @abstractmethod
    def _learn(self, data: TrainingData) -> Any:
        """The trained trees."""

    def fit(self: Self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> Self:
        """Trains the trees.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
            Features; used as float32.
        y : array_like of shape (n_samples,)
            Class labels: numbers or text.
        sample_weight : array_like of shape (n_samples,), optional
            Weight of each sample, 0 or more; used as float32. Samples of weight 0 are ignored.
        """
        name = type(self).__name__
        names = _validation.feature_names(X)
        table = _validation.table(X, name, self._missing)
        targets = _validation.labels(y, len(table), name)
        weights = _validation.weights(sample_weight, len(table))
        classes, positions = _positions(targets)
        if len(classes) > 65_535:
            raise ValueError(f"y: found {len(classes)} classes, expected at most 65535")
        self._trees = self._learn(TrainingData((table, positions, weights, len(classes)), classes))
        self.classes_, self.n_classes_, self.n_features_in_ = classes, len(classes), table.shape[1]
        self.__dict__.pop("feature_names_in_", None)
        if names is not None:
            self.feature_names_in_ = names
        return self

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float32]:
        """Probability of each class.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)

        Returns
        -------
        array of shape (n_samples, n_classes)
            Columns in the order of ``classes_``.
        """
        rows = self._rows(X)
        found: NDArray[np.float32] = self._trees.predict_proba(rows, self.n_jobs)
        return found

    def predict_log_proba(self, X: ArrayLike) -> NDArray[np.float32]:
        """Natural logarithm of `predict_proba`; minus infinity for a probability of 0.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
        """
        return logarithms(self.predict_proba(X))

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """The most probable class of each row.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
        """
        rows = self._rows(X)
        labels: NDArray[Any] = self.classes_[self._trees.predict(rows, self.n_jobs)]
        return labels

    def _rows(self, X: ArrayLike) -> NDArray[np.float32]:
        """X as the trees need it, checked against the training data."""
        self._check_is_fitted()
        name = type(self).__name__
        fitted = getattr(self, "feature_names_in_", None)
        _validation.check_feature_names(_validation.feature_names(X), fitted, name)
        table = _validation.table(X, name, self._missing)
        _validation.check_width(table.shape[1], self.n_features_in_, name)
        return table

    def score(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Accuracy: share of the rows that are classified correctly, 0..1.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
        y : array_like of shape (n_samples,)
            Class labels as for `fit`.
        sample_weight : array_like of shape (n_samples,), optional
            Weight of each row, as for `fit`.
        """
        found = self.predict(X)
        labels = _validation.labels(y, len(found), type(self).__name__)
        check_kind(labels, self.classes_, "y")
        if is_text(labels) and not labels.dtype.kind == found.dtype.kind == "U":
            labels, found = texts(labels, "y"), texts(found, "y")
        weights = _validation.weights(sample_weight, len(labels), np.float64)
        return float(np.average(found == labels, weights=None if weights is None else _validation.near_one(weights)))

    @property
    def feature_importances_(self) -> NDArray[np.float64]:
        """Share of each feature in the improvement by all splits, summing to 1."""
        self._check_is_fitted()
        found: NDArray[np.float64] = self._trees.importance()
        return found

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = self._missing
        return tags
