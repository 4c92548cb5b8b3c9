"""Object-based classification: whole segments."""

from __future__ import annotations

from scansion._classifier import PointClassifier


class ObjectClassifier(PointClassifier):
    """Classifies the segments of a scan, and every point by its segment.

    E. Hasanpour Zaryabi, M. Saadatseresht, E. Ghanbari Parmehr, *An object-based classification framework for ALS point
    cloud in urban areas*, ISPRS Annals X-4/W1, 2022: supervoxels, segments by local graphs, features of each segment, and a
    random forest (or boosted trees, or bagging) trained on a share of the labelled segments and evaluated on the others.

    Parameters
    ----------
    recipe : path, str or mapping, optional
        A TOML recipe of the kind ``objects``: its path, its text, a name, or a mapping of keys (nested or dotted) to values,
        as in
        ``{"segments.slic.size": 2.0, "training.share": 1.0, "classifier": "gbt"}``. By default as
        in ``docs/objects.md``.
    unlabelled : iterable of int or str, optional
        Labels that mean "unlabelled"; such points do not count for the class of their segment. By default those of the
        cloud's class list (LAS: 0 and 1, Semantic3D: 0, others: none), also for codes that are given as an array beside the
        cloud; a cloud that is an array has no list. ``[]`` makes every code a class. Negative labels, NaN and None are always
        unlabelled.
    class_map : str
        Mapping of codes before training, as in ``"3-4=5"``.
    random_state : int, numpy.random.RandomState or None
        Seed; None uses the recipe's (0 if it has none).
    n_jobs : int, optional
        Number of threads; None and -1 use all. Results do not depend on it.

    Attributes
    ----------
    classes_ : array of shape (n_classes,)
        Class codes, ascending; the texts if ``fit`` was given text.
    report_ : dict
        Report of the training, with the scores of the segments that were not used for it, ``by_segment`` and ``by_point``;
        only after ``fit``.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import ObjectClassifier
    >>> grid = np.arange(0.0, 30.0, 0.5)
    >>> ground = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> roof = np.stack(np.meshgrid(grid[:12] + 10.0, grid[:12] + 10.0, [5.0]), -1).reshape(-1, 3)
    >>> xyz = np.concatenate([ground, roof])
    >>> labels = np.repeat([2, 6], [len(ground), len(roof)])
    >>> classifier = ObjectClassifier({"segments.slic.size": 2.0, "training.share": 0.5}, random_state=0)
    >>> codes = classifier.fit(xyz, labels).predict(xyz)
    >>> bool((codes == labels).mean() > 0.95)
    True
    """

    def _recipe(self) -> tuple[str, list[str]]:
        text, settings = super()._recipe()
        return text or "objects", settings
