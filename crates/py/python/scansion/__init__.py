"""Divides a LiDAR scan into its parts and names every point.

>>> import scansion
>>> scansion.__version__.count(".")
2
"""

from scansion import evaluation, features
from scansion._bagging import BaggingClassifier
from scansion._boosting import GradientBoostingClassifier
from scansion._classifier import Classified, PointClassifier
from scansion._cloud import PointCloud, convert, diff, info, merge, read, rewrite, salvage, write
from scansion._core import FileFormatError, __version__
from scansion._forest import RandomForestClassifier
from scansion._render import render
from scansion._weak import WeakClassifier

__all__ = [
    "BaggingClassifier",
    "Classified",
    "FileFormatError",
    "GradientBoostingClassifier",
    "PointClassifier",
    "PointCloud",
    "RandomForestClassifier",
    "WeakClassifier",
    "__version__",
    "convert",
    "diff",
    "evaluation",
    "features",
    "info",
    "merge",
    "read",
    "render",
    "rewrite",
    "salvage",
    "write",
]
