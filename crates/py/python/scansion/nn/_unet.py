"""The sparse U-Net as an estimator of its own."""

from __future__ import annotations

from scansion._classifier import PointClassifier


class SparseUNet(PointClassifier):
    """A sparse U-Net that labels every point of a cloud: :class:`scansion.PointClassifier` with the recipe ``unet``.

    Its probabilities are (1 - 0.01) p + 0.01 / classes (``regularise.smoothing``), also without regularisation.

    Parameters
    ----------
    recipe : path, str or mapping, optional
        Settings of the recipe ``unet``, as ``{"voxel": 0.25, "learning.steps": 300}``; the page "A sparse convolutional network" lists them.
    unlabelled, class_map, random_state, n_jobs
        As in :class:`scansion.PointClassifier`, whose attributes it has too.

    Examples
    --------
    >>> from scansion import nn
    >>> nn.SparseUNet({"voxel": 0.25}, n_jobs=2)
    SparseUNet(n_jobs=2, recipe={'voxel': 0.25})
    """

    def _recipe(self) -> tuple[str, list[str]]:
        text, settings = super()._recipe()
        return text or "unet", settings
