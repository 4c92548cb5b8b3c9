"""Permutation importance of the features of forests."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core, _validation
from scansion._settings import seed, whole
from scansion._table import TableClassifier


class PermutationImportance(NamedTuple):
    """Loss of accuracy when one feature is shuffled."""

    importances_mean: NDArray[np.float64]
    """Mean over the repeats, one a feature; negative if shuffling improved the accuracy by chance."""
    importances_std: NDArray[np.float64]
    """Standard deviation over the repeats."""


class ForestClassifier(TableClassifier):
    """A classifier whose trees are a forest."""

    def permutation_importance(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        *,
        n_repeats: int = 5,
        random_state: int | np.random.RandomState | None = None,
    ) -> PermutationImportance:
        """Loss of accuracy when one feature is shuffled (Breiman 2001, section 10), best on samples held out from training.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
        y : array_like of shape (n_samples,)
        sample_weight : array_like of shape (n_samples,), optional
        n_repeats : int
            Number of shuffles of each feature.
        random_state : int, numpy.random.RandomState or None
            Seed; None means 0.

        Examples
        --------
        >>> import numpy as np
        >>> from scansion import RandomForestClassifier
        >>> X = np.random.default_rng(0).random((400, 2))
        >>> y = X[:, 1] > 0.5
        >>> found = RandomForestClassifier(n_estimators=10).fit(X[:300], y[:300]).permutation_importance(X[300:], y[300:])
        >>> int(found.importances_mean.argmax())
        1
        """
        table: Any = self._rows(X)
        targets = _validation.labels(y, len(table), type(self).__name__)
        if not np.isin(targets, self.classes_).all():
            raise ValueError(f"y: found labels that are no class of the forest, expected some of {self.classes_.tolist()}")
        places = np.searchsorted(self.classes_, targets).astype(np.uint16)
        weights = _validation.weights(sample_weight, len(table))
        repeats = whole(n_repeats, "n_repeats")
        found = _core.permutation_importance(
            self._trees, table, places, weights, repeats, seed(random_state), self.n_jobs
        )
        return PermutationImportance(*found)
