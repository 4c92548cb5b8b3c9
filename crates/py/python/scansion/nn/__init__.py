"""Sparse convolutions of arrays with their gradients, and networks made of them.

Two kinds: sub-manifold convolutions, whose rows have all channels at occupied positions (as spconv and MinkowskiEngine have
them), and direct sparse convolutions, in which each channel has its own entries and the strongest responses are kept.
:class:`SparseUNet` is made of the first kind and labels whole clouds; :class:`VoxelClassifier` is made of the second and
classifies objects: images, occupied cells, clouds of points.
"""

from __future__ import annotations

from scansion.nn._convolution import (
    Sites,
    SparseConv3d,
    sparse_convolution,
    sparse_convolution_gradient,
    submanifold_convolution,
    submanifold_convolution_gradient,
)
from scansion.nn._files import load_voxels, load_weights, load_xyz, read_idx, read_off, sample_surface
from scansion.nn._objects import VoxelClassifier
from scansion.nn._tensor import SparseTensor
from scansion.nn._unet import SparseUNet

__all__ = [
    "Sites",
    "SparseConv3d",
    "SparseTensor",
    "SparseUNet",
    "VoxelClassifier",
    "load_voxels",
    "load_weights",
    "load_xyz",
    "read_idx",
    "read_off",
    "sample_surface",
    "sparse_convolution",
    "sparse_convolution_gradient",
    "submanifold_convolution",
    "submanifold_convolution_gradient",
]


def __dir__() -> list[str]:
    return __all__
