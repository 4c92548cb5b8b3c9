"""Cross-validation on squares: neighbouring points resemble each other, so that they are held out together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import unmasked
from scansion._cloud import as_cloud


class SpatialKFold:
    """Folds of whole squares in plan, for the ``cv`` of scikit-learn's ``cross_val_score`` and ``GridSearchCV``.

    Parameters
    ----------
    n_splits : int
        Number of folds, 2 or more.
    block : float, optional
        Edge of the squares, metres; None: 50, halved until there are two squares a fold.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.

    Examples
    --------
    >>> import numpy as np, scansion
    >>> xyz = np.random.default_rng(0).random((1000, 3)) * [40, 40, 1]
    >>> train, test = next(scansion.SpatialKFold(4, block=10.0).split(xyz))
    >>> len(train) + len(test)
    1000
    >>> squares = [set(map(tuple, (xyz[part, :2] // 10).astype(int).tolist())) for part in (train, test)]
    >>> squares[0] & squares[1]
    set()
    """

    def __init__(self, n_splits: int = 5, *, block: float | None = None, metres_per_unit: float | None = None) -> None:
        self.n_splits = n_splits
        self.block = block
        self.metres_per_unit = metres_per_unit

    def __repr__(self) -> str:
        return f"SpatialKFold(n_splits={self.n_splits}, block={self.block}, metres_per_unit={self.metres_per_unit})"

    def get_n_splits(self, X: Any = None, y: Any = None, groups: Any = None) -> int:
        """Number of folds.

        Parameters
        ----------
        X, y, groups : object
            Without effect.
        """
        return self.n_splits

    def folds(self, X: Any) -> NDArray[np.uint32]:
        """The fold of each point, from 0.

        Parameters
        ----------
        X : PointCloud, path, laspy.LasData, pandas.DataFrame, structured array or array_like of shape (n, 3 or more)
            Points. Of an array with more than three columns the first three are the coordinates; of a table with names they
            are X, Y and Z (or x, y and z), and the unit is that in its ``attrs``, as `PointCloud.to_pandas` writes it.
        """
        if getattr(X, "ndim", 0) == 2 and X.shape[1] > 3 and not hasattr(X, "columns"):
            X = unmasked(X, "X")[:, :3]
        return _core.spatial_folds(as_cloud(X, columns=[])._core, self.n_splits, self.block, self.metres_per_unit)

    def split(
        self, X: Any, y: Any = None, groups: Any = None
    ) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Indices of the points to train on and of those to test on, fold by fold.

        Parameters
        ----------
        X : as in `folds`
        y, groups : object
            Without effect.
        """
        folds = self.folds(X)
        for fold in range(self.n_splits):
            yield np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)
