"""Classifies LiDAR point clouds: divides a scan into segments and assigns a class to every point.

>>> import scansion
>>> scansion.__version__.count(".")
2
"""

from scansion import (
    contours,
    evaluation,
    features,
    filters,
    graph,
    neighbours,
    nn,
    regularisation,
    segmentation,
    terrain,
)
from scansion._annotation import picked_labels, segment_colours, spread_labels
from scansion._bagging import BaggingClassifier
from scansion._boosting import GradientBoostingClassifier
from scansion._classifier import Classified, PointClassifier
from scansion._cloud import PointCloud
from scansion._clusters import ClusterFeatures
from scansion._concatenate import concatenate
from scansion._core import FileFormatError, __version__
from scansion._files import blocks, convert, diff, info, merge, read, rewrite, salvage, write
from scansion._forest import RandomForestClassifier
from scansion._objects import ObjectClassifier
from scansion._progress import progress
from scansion._render import render
from scansion._search import Search, search
from scansion._segments import Segments, Suggestions, segment, suggest
from scansion._spatial import SpatialKFold
from scansion._weak import WeakClassifier

__all__ = [
    "BaggingClassifier",
    "Classified",
    "ClusterFeatures",
    "FileFormatError",
    "GradientBoostingClassifier",
    "ObjectClassifier",
    "PointClassifier",
    "PointCloud",
    "RandomForestClassifier",
    "Search",
    "Segments",
    "SpatialKFold",
    "Suggestions",
    "WeakClassifier",
    "__version__",
    "blocks",
    "concatenate",
    "contours",
    "convert",
    "diff",
    "evaluation",
    "features",
    "filters",
    "graph",
    "info",
    "merge",
    "neighbours",
    "nn",
    "picked_labels",
    "progress",
    "read",
    "regularisation",
    "render",
    "rewrite",
    "salvage",
    "search",
    "segment",
    "segment_colours",
    "segmentation",
    "spread_labels",
    "suggest",
    "terrain",
    "write",
]
