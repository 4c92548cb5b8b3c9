"""Sparse convolutions of arrays, and their gradients.

Two kinds: sub-manifold convolutions, whose rows have all channels at occupied positions (as spconv and MinkowskiEngine have
them), and direct sparse convolutions, in which each channel has its own entries and the strongest responses are kept. A network
that is made of the first kind is the recipe ``unet`` of :class:`scansion.PointClassifier`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, to_json

__all__ = [
    "SparseTensor",
    "sparse_convolution",
    "sparse_convolution_gradient",
    "submanifold_convolution",
    "submanifold_convolution_gradient",
]


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
        dense = np.asarray(dense, np.float32)
        keys = np.flatnonzero(dense)
        return cls(keys.astype(np.uint64), dense.ravel()[keys], dense.shape)

    def to_dense(self) -> NDArray[np.float32]:
        """The array, 0 where there is no entry."""
        dense = np.zeros(math.prod(self.shape), np.float32)
        dense[self.keys.astype(np.int64)] = self.values
        return dense.reshape(self.shape)


def _submanifold(coordinates: Any, features: Any, weights: Any, dilation: int) -> tuple[Any, ...]:
    coordinates = np.ascontiguousarray(coordinates, np.int64)
    features = np.ascontiguousarray(features, np.float32)
    weights = np.asarray(weights, np.float32)
    if coordinates.ndim != 2 or features.ndim != 2 or len(coordinates) != len(features):
        raise ValueError("coordinates: expected shape (n, axes), features: expected shape (n, channels)")
    axes = coordinates.shape[1]
    if weights.ndim != axes + 2 or len(set(weights.shape[:axes])) > 1 or weights.shape[axes] != features.shape[1]:
        expected = f"({', '.join(['size'] * axes)}, {features.shape[1]}, outputs)"
        raise ValueError(f"weights: found shape {weights.shape}, expected {expected}")
    if weights.shape[0] % 2 == 0:
        raise ValueError(f"weights: found size {weights.shape[0]}, expected an odd number")
    layer = {"size": weights.shape[0], "dilation": int(dilation), "outputs": weights.shape[-1]}
    return coordinates, features, np.ascontiguousarray(weights).ravel(), to_json(layer)


def submanifold_convolution(
    coordinates: Any, features: Any, weights: Any, dilation: int = 1, n_jobs: int | None = None
) -> NDArray[np.float32]:
    """Convolution whose outputs are the occupied positions: ``y[i] = sum_k x[j(i, k)] @ weights[k]`` over the positions
    ``j(i, k)`` at offset ``dilation * (k - size // 2)`` from i that are occupied.

    B. Graham, M. Engelcke, L. van der Maaten, 2018, doi:10.1109/CVPR.2018.00961. O(n * size ** (axes - 1)) time besides the
    products.

    Parameters
    ----------
    coordinates : array of shape (n, axes)
        Integer positions along 1 to 4 axes, each row once, in any order.
    features : array of shape (n, inputs)
        Values of the input channels.
    weights : array of shape (size, ..., size, inputs, outputs)
        Weights; ``size`` is odd, at most 15, once for each axis.
    dilation : int
        Step from weight to weight.
    n_jobs : int or None
        Number of threads; None: all.

    Returns
    -------
    array of shape (n, outputs)
        In the order of the rows.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import nn
    >>> row = np.array([[0], [1], [5]])
    >>> nn.submanifold_convolution(row, [[1.0], [2.0], [4.0]], np.ones((3, 1, 1))).ravel()
    array([3., 3., 4.], dtype=float32)
    """
    coordinates, features, flat, layer = _submanifold(coordinates, features, weights, dilation)
    return _core.submanifold_convolution(coordinates, features, flat, layer, n_jobs)


def submanifold_convolution_gradient(
    coordinates: Any,
    features: Any,
    weights: Any,
    gradient: Any,
    dilation: int = 1,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Gradients of a loss with respect to features and weights of :func:`submanifold_convolution`.

    Parameters
    ----------
    coordinates, features, weights, dilation, n_jobs
        As given to :func:`submanifold_convolution`.
    gradient : array of shape (n, outputs)
        Gradient with respect to its outputs.

    Returns
    -------
    tuple of arrays
        Of the shapes of ``features`` and ``weights``.
    """
    coordinates, features, flat, layer = _submanifold(coordinates, features, weights, dilation)
    gradient = np.ascontiguousarray(gradient, np.float32)
    if gradient.shape != (len(features), np.shape(weights)[-1]):
        raise ValueError(f"gradient: found shape {gradient.shape}, expected {(len(features), np.shape(weights)[-1])}")
    values, found = _core.submanifold_gradient(coordinates, features, flat, gradient, layer, n_jobs)
    return values, found.reshape(np.shape(weights))


def _direct(tensor: SparseTensor, weights: Any, bias: Any, density: float | None, attention: str) -> tuple[Any, ...]:
    choice(attention, "attention", ("positive", "magnitude"))
    weights = np.asarray(weights, np.float32)
    axes = len(tensor.shape) - 2
    if weights.ndim != axes + 2 or len(set(weights.shape[2:])) > 1 or weights.shape[1] != tensor.shape[1]:
        expected = f"(outputs, {tensor.shape[1]}, {', '.join(['size'] * axes)})"
        raise ValueError(f"weights: found shape {weights.shape}, expected {expected}")
    bias = np.ascontiguousarray([] if bias is None else bias, np.float32)
    selection = None if density is None else {"attention": attention, "density": float(density)}
    layer = {"shape": list(tensor.shape), "size": weights.shape[2], "outputs": weights.shape[0], "selection": selection}
    keys = np.ascontiguousarray(tensor.keys, np.uint64)
    values = np.ascontiguousarray(tensor.values, np.float32)
    return keys, values, np.ascontiguousarray(weights).ravel(), bias, to_json(layer)


def sparse_convolution(
    tensor: SparseTensor,
    weights: Any,
    bias: Any = None,
    density: float | None = None,
    attention: str = "positive",
    n_jobs: int | None = None,
) -> SparseTensor:
    """Direct sparse convolution with attention: the output is as large as the input, with zeros around it.

    Hackel et al. 2018, algorithm 2, doi:10.1007/978-3-030-12939-2_41. Weights that are 0 are not calculated with.

    Parameters
    ----------
    tensor : SparseTensor
        The input.
    weights : array of shape (outputs, inputs, size, ..., size)
        Weights, as in torch; ``size`` is odd, at most 15, once for each axis.
    bias : array of shape (outputs,) or None
        Added to responses that are not 0.
    density : float or None
        Upper bound of the share of the cells of a channel that keep a response, above 0, at most 1; None: no bound.
    attention : {"positive", "magnitude"}
        With a bound: the largest responses above 0, or those of largest magnitude.
    n_jobs : int or None
        Number of threads; None: all.

    Returns
    -------
    SparseTensor

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import nn
    >>> image = nn.SparseTensor.from_dense(np.diag([1.0, 2.0, 3.0])[None, None])
    >>> found = nn.sparse_convolution(image, np.ones((1, 1, 3, 3)), density=0.34)
    >>> found.to_dense()[0, 0]
    array([[0., 0., 0.],
           [0., 6., 5.],
           [0., 5., 0.]], dtype=float32)
    """
    keys, values, flat, own, layer = _direct(tensor, weights, bias, density, attention)
    found = _core.sparse_convolution(keys, values, flat, own, layer, n_jobs)
    return SparseTensor(*found, (tensor.shape[0], np.shape(weights)[0], *tensor.shape[2:]))


def sparse_convolution_gradient(
    tensor: SparseTensor,
    weights: Any,
    gradient: SparseTensor,
    bias: Any = None,
    n_jobs: int | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Gradients of a loss with respect to what :func:`sparse_convolution` was given (equations 6.3 and 6.4 of the thesis).

    Parameters
    ----------
    tensor, weights, bias, n_jobs
        As given to :func:`sparse_convolution`.
    gradient : SparseTensor
        Gradient with respect to the entries of its output: the output with other values.

    Returns
    -------
    tuple of arrays
        With respect to the values of the tensor, the weights (0 for those that are 0), and the bias (empty without one).
    """
    keys, values, flat, own, layer = _direct(tensor, weights, bias, None, "positive")
    towards = (np.ascontiguousarray(gradient.keys, np.uint64), np.ascontiguousarray(gradient.values, np.float32))
    of_values, of_weights, of_bias = _core.sparse_gradient(keys, values, flat, own, *towards, layer, n_jobs)
    return of_values, of_weights.reshape(np.shape(weights)), of_bias
