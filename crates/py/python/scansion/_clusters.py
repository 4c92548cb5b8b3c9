"""Clusters at four levels, and the features that they give."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, to_json
from scansion._base import Estimator
from scansion._cloud import as_cloud

_COLOUR = ["Red", "Green", "Blue"]


class Automatic(NamedTuple):
    """Parameters of a segmentation, and where each comes from."""

    radius: float
    min_size: int
    angle_deg: float
    offset: float
    reasons: list[str]


class ClusterLevels(NamedTuple):
    """Cluster of each point on levels 1 to 4 (rows), centrality of each point, parameters, clusters of each level."""

    labels: NDArray[np.uint32]
    centrality: NDArray[np.float32]
    automatic: Automatic
    counts: list[int]


def automatic_parameters(
    xyz: Any,
    *,
    settings: Mapping[str, Any] | None = None,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> Automatic:
    """Radius, least size, angle and offset of segments, from the cloud.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    settings : mapping, optional
        Parameters that are known, as in ``{"radius": 0.5, "seed": 3}``; see ``docs/clusters.md``.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    Automatic
        ``radius`` and ``offset`` in metres, ``min_size`` in points, ``angle_deg`` in degrees, and ``reasons``.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> plane = np.stack(np.meshgrid(np.arange(30.0), np.arange(30.0), [0.0]), -1).reshape(-1, 3)
    >>> found = segmentation.automatic_parameters(plane)
    >>> round(found.radius, 3), found.min_size, found.angle_deg
    (2.236, 84, 10.0)
    """
    cloud = as_cloud(xyz, columns=[])
    text = _core.automatic_parameters(cloud._core, to_json(settings or {}), metres_per_unit, n_jobs)
    return Automatic(**json.loads(text))


def cluster_levels(
    xyz: Any,
    *,
    settings: Mapping[str, Any] | None = None,
    colour: bool = False,
    metres_per_unit: float | None = None,
    n_jobs: int | None = None,
) -> ClusterLevels:
    """Clusters of a cloud at four levels: segments, merged segments, categories, centrality.

    E. Grilli, F. Poux, F. Remondino, *Unsupervised object-based clustering in support of supervised point-based 3D point
    cloud classification*, ISPRS Archives XLIII-B2-2021.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    settings : mapping, optional
        Parameters, as in ``{"angle_deg": 20.0}``; see ``docs/clusters.md``.
    colour : bool
        Whether red, green and blue describe the categories; the cloud needs the columns.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Returns
    -------
    ClusterLevels
        ``labels`` of shape (4, n), from 1 on, 0 for points that belong to none; ``centrality`` 0..1.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 4.0, 0.1)
    >>> floor = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([4.0], grid, grid + 0.1), -1).reshape(-1, 3)
    >>> found = segmentation.cluster_levels(np.concatenate([floor, wall]))
    >>> found.counts[:2], bool(found.labels[0, 0] != found.labels[0, -1])
    ([2, 2], True)
    """
    cloud = as_cloud(xyz, columns=_COLOUR if colour else [])
    labels, centrality, text = _core.cluster_levels(
        cloud._core, to_json(settings or {}), colour, metres_per_unit, n_jobs
    )
    report = json.loads(text)
    return ClusterLevels(labels, centrality, Automatic(**report["automatic"]), report["counts"])


class ClusterFeatures(Estimator):
    """Features of points from clusters and from spheres whose radius follows from the cloud.

    It is not a step of scikit-learn's pipelines: clusters are those of one cloud, so that there is no ``transform`` of another.

    E. Grilli, F. Poux, F. Remondino, *Unsupervised object-based clustering in support of supervised point-based 3D point
    cloud classification*, ISPRS Archives XLIII-B2-2021, sets A, B and C of section 4.

    Parameters
    ----------
    set : {"a", "b", "c"}
        "a": the clusters at four levels (4 features). "b": eight covariance features and verticality in spheres of eight
        radii, and the height above the ground (73). "c": the clusters, three features in spheres of four radii, and the
        height (17).
    form : {"rank", "descriptor"}
        "rank": numbers of clusters, as in the paper; they name places of the cloud, so that training and test parts must
        be clustered together. "descriptor": sizes and shapes of clusters, which mean the same in every cloud.
    colour : bool
        Add red, green and blue (3); the cloud needs the columns.
    settings : mapping, optional
        Parameters of the clusters, as in ``{"angle_deg": 20.0}``; see ``docs/clusters.md``.
    metres_per_unit : float, optional
        Metres per unit of the coordinates; None uses the cloud's own unit, else 1.
    n_jobs : int, optional
        Number of threads; None and -1 use all. The result does not depend on it.

    Attributes
    ----------
    feature_names_out_ : list of str
        Names of the columns.
    automatic_ : Automatic
        The parameters of the segmentation, and where each comes from.
    counts_ : list of int
        Number of clusters on each level; 0 for set "b".

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import ClusterFeatures
    >>> grid = np.arange(0.0, 6.0, 0.1)
    >>> floor = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> features = ClusterFeatures()
    >>> features.fit_transform(floor).shape, features.feature_names_out_[:5]
    ((3600, 17), ['ClusterL1', 'ClusterL2', 'ClusterL3', 'ClusterL4', 'Omnivariance_e1'])
    """

    _fitted, _fits = "feature_names_out_", "fit_transform"

    feature_names_out_: list[str]
    automatic_: Automatic
    counts_: list[int]

    def __init__(
        self,
        *,
        set: Literal["a", "b", "c"] = "c",
        form: Literal["rank", "descriptor"] = "rank",
        colour: bool = False,
        settings: Mapping[str, Any] | None = None,
        metres_per_unit: float | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.set = set
        self.form = form
        self.colour = colour
        self.settings = settings
        self.metres_per_unit = metres_per_unit
        self.n_jobs = n_jobs

    def fit_transform(self, xyz: Any, y: Any = None) -> NDArray[np.float32]:
        """Features of every point of a cloud.

        Parameters
        ----------
        xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
            The cloud.
        y : object
            Not used.

        Returns
        -------
        array of shape (n, number of features), float32
            Rows of points with NaN or infinite coordinates are NaN.
        """
        choice(self.set, "set", ("a", "b", "c"))
        choice(self.form, "form", ("rank", "descriptor"))
        cloud = as_cloud(xyz, columns=_COLOUR if self.colour else [])
        settings = {
            "set": self.set,
            "form": self.form,
            "colour": self.colour,
            "metres_per_unit": self.metres_per_unit,
            "clusters": dict(self.settings or {}),
        }
        table, self.feature_names_out_, text = _core.cluster_table(cloud._core, to_json(settings), self.n_jobs)
        report = json.loads(text)
        self.automatic_ = Automatic(**report["automatic"])
        self.counts_ = report["counts"]
        return table

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Names of the columns of the last table, ``feature_names_out_`` as an array.

        Parameters
        ----------
        input_features : object
            Without effect.
        """
        self._check_is_fitted()
        return np.array(self.feature_names_out_, dtype=object)

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import Tags, TargetTags, TransformerTags

        return Tags(
            estimator_type=None, target_tags=TargetTags(required=False), transformer_tags=TransformerTags(preserves_dtype=[])
        )
