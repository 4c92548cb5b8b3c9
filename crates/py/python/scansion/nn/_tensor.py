"""Sparse tensors as arrays."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scansion._arrays import unmasked, whole_numbers


class SparseTensor(NamedTuple):
    """Entries of an array of shape (samples, channels, cells along 1 to 4 axes): the place of each in the flattened array,
    ascending, and its value."""

    keys: NDArray[np.uint64]
    values: NDArray[np.float32]
    shape: tuple[int, ...]

    @classmethod
    def from_dense(cls, dense: Any) -> SparseTensor:
        """The entries that are not 0.

        >>> import numpy as np
        >>> from scansion import nn
        >>> nn.SparseTensor.from_dense(np.eye(3)[None, None]).keys
        array([0, 4, 8], dtype=uint64)
        """
        dense = unmasked(dense, "dense", np.float32)
        keys = np.flatnonzero(dense)
        return cls(keys.astype(np.uint64), dense.ravel()[keys], dense.shape)

    def to_dense(self) -> NDArray[np.float32]:
        """The array, 0 where there is no entry."""
        dense = np.zeros(math.prod(self.shape), np.float32)
        dense[whole_numbers(self.keys, "keys")] = self.values
        return dense.reshape(self.shape)

    @classmethod
    def from_torch(cls, tensor: Any) -> SparseTensor:
        """The entries of a sparse or dense tensor of torch of shape (samples, channels, cells along 1 to 4 axes).

        Parameters
        ----------
        tensor : torch.Tensor
            On any device; gradients are not followed.
        """
        tensor = tensor.detach().cpu()
        if not tensor.is_sparse:
            return cls.from_dense(tensor.numpy())
        tensor = tensor.coalesce()
        shape = tuple(tensor.shape)
        keys = np.ravel_multi_index(tuple(tensor.indices().numpy()), shape)
        return cls(keys.astype(np.uint64), tensor.values().numpy().astype(np.float32), shape)

    def to_torch(self) -> Any:
        """A sparse tensor of torch (COO) with the same entries; torch must be installed."""
        import torch

        places = np.stack(np.unravel_index(whole_numbers(self.keys, "keys"), self.shape))
        return torch.sparse_coo_tensor(torch.from_numpy(places), torch.from_numpy(self.values.copy()), self.shape)


class Entries(NamedTuple):
    """The entries of a tensor as the core takes them."""

    keys: NDArray[np.uint64]
    """Ascending, each once."""
    values: NDArray[np.float32]
    order: NDArray[np.intp] | slice
    """The place of each entry in the tensor."""

    @classmethod
    def of(cls, tensor: SparseTensor, name: str) -> Entries:
        """Entries in any order; ``name`` is that of the tensor in messages."""
        keys, values = whole_numbers(tensor.keys, f"{name}.keys"), unmasked(tensor.values, f"{name}.values", np.float32)
        if keys.ndim != 1 or keys.shape != values.shape:
            found = f"keys of shape {keys.shape} and values of shape {values.shape}"
            raise ValueError(f"{name}: found {found}, expected (n,) twice")
        end = math.prod(map(int, tensor.shape))
        ascend = bool((keys[1:] > keys[:-1]).all())
        some = keys[[0, -1]] if ascend and len(keys) else keys
        outside = some[(some < 0) | (some >= end)]
        if len(outside):
            raise ValueError(f"{name}: found key {outside[0]}, expected 0 up to {end - 1}")
        if ascend:
            return cls(keys.view(np.uint64), values, slice(None))
        order = np.argsort(keys, kind="stable")
        ascending = keys[order].astype(np.uint64)
        twice = np.flatnonzero(ascending[1:] == ascending[:-1])
        if len(twice):
            raise ValueError(f"{name}: found key {ascending[twice[0]]} twice, expected each once")
        return cls(ascending, values[order], order)
