"""Sub-manifold and direct sparse convolutions, and their gradients."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, to_json, unmasked, whole_numbers
from scansion._settings import seed, whole
from scansion.nn._tensor import Entries, SparseTensor


class Sites:
    """Occupied positions that several convolutions share: which of them are neighbours (the rule book) is found once for each
    size and dilation of a kernel, by the first convolution that needs it, and kept. As ``indice_key`` in spconv and the
    coordinate manager in MinkowskiEngine.

    To be given to :func:`submanifold_convolution`, its gradient and :class:`SparseConv3d` in place of the coordinates; the
    results are the same bytes.

    Parameters
    ----------
    coordinates : array of shape (n, axes)
        Integer positions along 1 to 4 axes, each row once, in any order. Features are given in the same order.
    n_jobs : int or None
        Number of threads; None: all.

    Attributes
    ----------
    axes : int
    nbytes : int
        Bytes in memory: 8 or 12 a position, and for each kernel used 5 for every two positions that it brings together.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import nn
    >>> sites = nn.Sites([[0], [1], [5]])
    >>> once = nn.submanifold_convolution(sites, [[1.0], [2.0], [4.0]], np.ones((3, 1, 1)))
    >>> nn.submanifold_convolution(sites, once, np.ones((3, 1, 1))).ravel()
    array([6., 6., 4.], dtype=float32)
    >>> len(sites)
    3
    """

    def __init__(self, coordinates: Any, n_jobs: int | None = None) -> None:
        coordinates = whole_numbers(coordinates, "coordinates")
        if coordinates.ndim != 2:
            raise ValueError(f"coordinates: found shape {coordinates.shape}, expected shape (n, axes)")
        if not 1 <= coordinates.shape[1] <= 4:
            raise ValueError(f"found coordinates of {coordinates.shape[1]} axes, expected 1 to 4")
        self._core = _core.Sites(coordinates, n_jobs)

    def __reduce__(self) -> tuple[Any, ...]:
        # What was found for kernels is found again; only differences of positions count.
        return Sites, (self._core.positions(),)

    def __len__(self) -> int:
        return len(self._core)

    @property
    def axes(self) -> int:
        return self._core.axes

    @property
    def nbytes(self) -> int:
        return self._core.nbytes


def _sites(coordinates: Any, n_jobs: int | None) -> Sites:
    return coordinates if isinstance(coordinates, Sites) else Sites(coordinates, n_jobs)


def _submanifold(sites: Sites, features: Any, weights: Any, dilation: int) -> tuple[Any, ...]:
    features = np.ascontiguousarray(unmasked(features, "features"), np.float32)
    weights = unmasked(weights, "weights", np.float32)
    if features.ndim != 2 or len(features) != len(sites) or features.shape[1] == 0:
        expected = f"({len(sites)}, channels), one row a position and 1 or more channels"
        raise ValueError(f"features: found shape {features.shape}, expected shape {expected}")
    axes = sites.axes
    if weights.ndim != axes + 2 or len(set(weights.shape[:axes])) > 1 or weights.shape[axes] != features.shape[1]:
        expected = f"({', '.join(['size'] * axes)}, {features.shape[1]}, outputs)"
        raise ValueError(f"weights: found shape {weights.shape}, expected {expected}")
    if weights.shape[0] % 2 == 0:
        raise ValueError(f"weights: found size {weights.shape[0]}, expected an odd number")
    layer = {"size": weights.shape[0], "dilation": whole(dilation, "dilation"), "outputs": weights.shape[-1]}
    return features, np.ascontiguousarray(weights).ravel(), to_json(layer)


def submanifold_convolution(
    coordinates: Any, features: Any, weights: Any, dilation: int = 1, n_jobs: int | None = None
) -> NDArray[np.float32]:
    """Convolution whose outputs are the occupied positions: ``y[i] = sum_k x[j(i, k)] @ weights[k]`` over the positions
    ``j(i, k)`` at offset ``dilation * (k - size // 2)`` from i that are occupied.

    B. Graham, M. Engelcke, L. van der Maaten, 2018, doi:10.1109/CVPR.2018.00961. O(n * size ** (axes - 1)) time besides the
    products.

    Parameters
    ----------
    coordinates : array of shape (n, axes) or Sites
        Integer positions along 1 to 4 axes, each row once, in any order. :class:`Sites` keep what was found about them for
        further calls.
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
    sites = _sites(coordinates, n_jobs)
    features, flat, layer = _submanifold(sites, features, weights, dilation)
    return _core.submanifold_convolution(sites._core, features, flat, layer, n_jobs)


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
    sites = _sites(coordinates, n_jobs)
    features, flat, layer = _submanifold(sites, features, weights, dilation)
    gradient = np.ascontiguousarray(unmasked(gradient, "gradient"), np.float32)
    if gradient.shape != (len(features), np.shape(weights)[-1]):
        raise ValueError(f"gradient: found shape {gradient.shape}, expected {(len(features), np.shape(weights)[-1])}")
    values, found = _core.submanifold_gradient(sites._core, features, flat, gradient, layer, n_jobs)
    return values, found.reshape(np.shape(weights))


def _direct(tensor: SparseTensor, weights: Any, bias: Any, density: float | None, attention: str) -> tuple[Any, ...]:
    choice(attention, "attention", ("positive", "magnitude"))
    weights = unmasked(weights, "weights", np.float32)
    axes = len(tensor.shape) - 2
    if not 1 <= axes <= 4:
        raise ValueError(f"tensor: found shape {tensor.shape}, expected (samples, channels, cells along 1 to 4 axes)")
    if weights.ndim != axes + 2 or len(set(weights.shape[2:])) > 1 or weights.shape[1] != tensor.shape[1]:
        expected = f"(outputs, {tensor.shape[1]}, {', '.join(['size'] * axes)})"
        raise ValueError(f"weights: found shape {weights.shape}, expected {expected}")
    bias = np.ascontiguousarray([] if bias is None else unmasked(bias, "bias"), np.float32)
    selection = None if density is None else {"attention": attention, "density": float(density)}
    layer = {"shape": list(tensor.shape), "size": weights.shape[2], "outputs": weights.shape[0], "selection": selection}
    return Entries.of(tensor, "tensor"), np.ascontiguousarray(weights).ravel(), bias, to_json(layer)


def _output_shape(tensor: SparseTensor, weights: Any) -> tuple[int, ...]:
    return (tensor.shape[0], np.shape(weights)[0], *tensor.shape[2:])


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
        The input, its entries in any order.
    weights : array of shape (outputs, inputs, size, ..., size)
        Weights, as in torch; ``size`` is odd, at most 15, once for each axis.
    bias : array of shape (outputs,) or None
        Added to responses that are not 0.
    density : float or None
        Upper bound of the share of the cells of a channel that keep a response, above 0, at most 1; None: no bound.
    attention : {"positive", "magnitude"}
        With a bound: the largest responses above 0, or those of largest magnitude, of either sign.
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
    entries, flat, own, layer = _direct(tensor, weights, bias, density, attention)
    found = _core.sparse_convolution(entries.keys, entries.values, flat, own, layer, n_jobs)
    return SparseTensor(*found, _output_shape(tensor, weights))


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
        With respect to the values of the tensor, in their order, the weights (0 for those that are 0), and the bias (empty
        without one).
    """
    entries, flat, own, layer = _direct(tensor, weights, bias, None, "positive")
    if tuple(gradient.shape) != _output_shape(tensor, weights):
        raise ValueError(f"gradient: found shape {gradient.shape}, expected {_output_shape(tensor, weights)}")
    towards = Entries.of(gradient, "gradient")
    ascending, of_weights, of_bias = _core.sparse_gradient(
        entries.keys, entries.values, flat, own, towards.keys, towards.values, layer, n_jobs
    )
    of_values = np.empty_like(ascending)
    of_values[entries.order] = ascending
    return of_values, of_weights.reshape(np.shape(weights)), of_bias


class SparseConv3d:
    """A sub-manifold convolution along three axes with weights and bias of its own, as in spconv (``SubMConv3d``) and
    MinkowskiEngine.

    Parameters
    ----------
    in_channels, out_channels : int
        Channels.
    kernel_size : int
        Weights along each axis: odd, at most 15.
    dilation : int
        Step from weight to weight.
    bias : bool
        Whether a bias is added.
    random_state : int, numpy.random.RandomState or None
        Seed of the weights at the start, drawn as in He et al. 2015, doi:10.1109/ICCV.2015.123.
    n_jobs : int or None
        Number of threads; None: all.

    Attributes
    ----------
    weight : array of shape (kernel_size, kernel_size, kernel_size, in_channels, out_channels)
    bias : array of shape (out_channels,) or None
    weight_gradient, bias_gradient : arrays of the same shapes or None
        After :meth:`backward`.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import nn
    >>> layer = nn.SparseConv3d(2, 4)
    >>> voxels = np.array([[0, 0, 0], [0, 0, 1], [7, 3, 2]])
    >>> layer(voxels, np.ones((3, 2))).shape
    (3, 4)
    >>> layer.backward(np.ones((3, 4))).shape
    (3, 2)
    """

    weight_gradient: NDArray[np.float32] | None = None
    bias_gradient: NDArray[np.float32] | None = None

    def __init__(
        self,
        in_channels: int,
        out_channels: int,
        kernel_size: int = 3,
        *,
        dilation: int = 1,
        bias: bool = True,
        random_state: Any = None,
        n_jobs: int | None = None,
    ) -> None:
        inputs, outputs = whole(in_channels, "in_channels"), whole(out_channels, "out_channels")
        shape = (*[whole(kernel_size, "kernel_size")] * 3, inputs, outputs)
        draws = np.random.default_rng(seed(random_state))
        deviation = np.sqrt(2 / (kernel_size**3 * inputs))
        self.weight = (draws.standard_normal(shape) * deviation).astype(np.float32)
        self.bias = np.zeros(outputs, np.float32) if bias else None
        self.dilation = dilation
        self.n_jobs = n_jobs
        self._input: tuple[Any, Any] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """The attributes, for copies and pickles, without what the last call was given."""
        return {**self.__dict__, "_input": None}

    def __call__(self, coordinates: Any, features: Any) -> NDArray[np.float32]:
        """Features of shape (n, out_channels) at integer coordinates of shape (n, 3), each row once, or at :class:`Sites` that
        further layers use too. Keeps a copy of the features for :meth:`backward`."""
        sites = _sites(coordinates, self.n_jobs)
        features = np.array(unmasked(features, "features"), np.float32, order="C")
        self._input = (sites, features)
        found = submanifold_convolution(sites, features, self.weight, self.dilation, self.n_jobs)
        return found if self.bias is None else found + self.bias

    def backward(self, gradient: Any) -> NDArray[np.float32]:
        """Gradient with respect to the features of the last call, given that of its result; keeps those of weights and bias."""
        if self._input is None:
            raise ValueError("backward: expected a call of the layer first")
        found = submanifold_convolution_gradient(
            *self._input, self.weight, gradient, dilation=self.dilation, n_jobs=self.n_jobs
        )
        values, self.weight_gradient = found
        self.bias_gradient = None if self.bias is None else np.asarray(gradient, np.float32).sum(axis=0)
        return values
