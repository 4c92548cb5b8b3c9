"""Divides a LiDAR scan into its parts and names every point.

>>> import scansion
>>> scansion.__version__.count(".")
2
"""

from scansion import evaluation, features
from scansion._classifier import Classified, PointClassifier
from scansion._cloud import PointCloud, info, read, rewrite, write
from scansion._core import FileFormatError, __version__
from scansion._forest import RandomForestClassifier
from scansion._render import render

__all__ = [
    "Classified",
    "FileFormatError",
    "PointClassifier",
    "PointCloud",
    "RandomForestClassifier",
    "__version__",
    "evaluation",
    "features",
    "info",
    "read",
    "render",
    "rewrite",
    "write",
]
